//! What place and route made of the machines: `docs/synthesis.json`, which `cargo xtask synth` writes.

use serde::{Deserialize, Serialize};

const RESULTS: &str = include_str!("../../docs/synthesis.json");
/// The device and speed grade whose clock counts.
const DEVICE: (&str, u32) = ("LFE5U-85F", 8);

#[derive(Deserialize)]
struct Measurement {
    design: String,
    device: String,
    grade: Option<u32>,
    mhz: Vec<f64>,
    date: String,
}

/// A machine's clock after place and route.
#[derive(Serialize)]
pub(crate) struct Placed {
    /// The median over the seeds, in MHz.
    pub(crate) mhz: f64,
    pub(crate) seeds: usize,
    /// Device and speed grade, `LFE5U-85F-8`.
    pub(crate) device: String,
    /// The day of the measurement.
    pub(crate) date: String,
}

/// The committed result for a machine, if it has been placed and routed.
pub(crate) fn placed(machine: &str) -> Option<Placed> {
    let results: Vec<Measurement> = serde_json::from_str(RESULTS).ok()?;
    let found = results.into_iter().find(|result| {
        (result.design.as_str(), result.device.as_str(), result.grade) == (machine, DEVICE.0, Some(DEVICE.1))
    })?;
    let mut mhz = found.mhz;
    mhz.sort_by(f64::total_cmp);
    let median = *mhz.get(mhz.len() / 2)?;
    let device = format!("{}-{}", DEVICE.0, DEVICE.1);
    Some(Placed { mhz: median, seeds: mhz.len(), device, date: found.date })
}

#[cfg(test)]
mod tests {
    /// The file is there and is what this module takes it for.
    #[test]
    fn committed_results_are_read() {
        let results: Vec<super::Measurement> = serde_json::from_str(super::RESULTS).unwrap();
        assert!(results.iter().any(|result| result.design == "add" && !result.mhz.is_empty()));
    }
}
