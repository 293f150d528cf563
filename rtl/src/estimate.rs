// SPDX-License-Identifier: MIT OR Apache-2.0
//! Estimates of a core's area and clock on an ECP5, for rows that nobody has placed: what its units take alone, and two lines fitted by least
//! squares through the machines that were placed and routed (`rtl/synthesis.json`). Block RAMs and multipliers are counted.

use crate::Library;
use crate::plan::{Plan, PlanError};
use crate::synthesis::{Synthesis, committed};
use takt_isa::memory::block_rams;
use takt_isa::{MACHINES, Machine};

/// The device and the grade of the placed rows.
const DEVICE: (&str, u8) = ("LFE5U-85F", 8);

/// Units that were not placed alone: LUT4 and multipliers as yosys's `synth_ecp5` counts them (`add`, counted the same way, has 810 and,
/// placed, 814).
const COUNTED: [(&str, u64, u64); 3] = [("fused", 1635, 3), ("addmul", 945, 3), ("recurrence", 657, 0)];

/// An estimate.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// LUT4, those of memories in logic and the halves of carry chains included.
    pub luts: f64,
    /// Block RAMs of 18 kbit.
    pub block_rams: u64,
    /// Multipliers of 18 x 18 bits.
    pub multipliers: u64,
    /// Clock.
    pub mhz: f64,
}

/// A placed machine beside its estimate.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Calibration {
    /// The machine.
    pub machine: &'static str,
    /// LUT4: placed, estimated, and estimated by lines through the other machines alone.
    pub luts: [f64; 3],
    /// Median clock in MHz, the same way.
    pub mhz: [f64; 3],
}

/// A line: what there is at 0, and how much more for each.
#[derive(Clone, Copy, Debug)]
struct Line(f64, f64);

impl Line {
    /// The line of least squares.
    fn fit(points: &[(f64, f64)]) -> Line {
        let count = points.len().max(1) as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(|point| point.0), mean(|point| point.1));
        let wide: f64 = points.iter().map(|point| (point.0 - x).powi(2)).sum();
        let both: f64 = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum();
        let slope = if wide > 0.0 { both / wide } else { 0.0 };
        Line(y - slope * x, slope)
    }

    fn at(self, x: f64) -> f64 {
        self.0 + self.1 * x
    }
}

/// A placed machine, as the lines see it.
#[derive(Clone, Copy)]
struct Placed {
    machine: &'static Machine,
    counts: Counts,
    luts: f64,
    mhz: f64,
}

/// The known figures of a row, from which area and clock are estimated.
#[derive(Clone, Copy)]
struct Counts {
    /// LUT4 of the units alone.
    units: f64,
    /// Source operands that the slots read in a cycle: most of a core beside its units is what selects and forwards them.
    sources: f64,
    /// The period of the slowest unit alone, in ns.
    slowest: f64,
    block_rams: u64,
    multipliers: u64,
}

/// The estimator.
pub struct Estimator {
    library: Library,
    rows: Vec<Synthesis>,
    placed: Vec<Placed>,
    lines: [Line; 2],
}

impl Estimator {
    /// The estimator of the committed measurements.
    ///
    /// # Errors
    /// If a machine of the table has no circuit.
    pub fn new() -> Result<Estimator, PlanError> {
        let rows: Vec<Synthesis> = committed()
            .into_iter()
            .filter(|row| (row.device.as_str(), row.grade) == (DEVICE.0, Some(DEVICE.1)))
            .collect();
        let mut estimator =
            Estimator { library: Library::builtin(), rows, placed: Vec::new(), lines: [Line(0.0, 0.0); 2] };
        let mut placed = Vec::new();
        for &machine in MACHINES {
            let row = estimator.rows.iter().find(|row| row.design == machine.name);
            if let Some((luts, mhz)) = row.and_then(|row| Some((row.resources.luts as f64, row.median()?))) {
                placed.push(Placed { machine, counts: estimator.counts(machine)?, luts, mhz });
            }
        }
        estimator.lines = lines(&placed);
        estimator.placed = placed;
        Ok(estimator)
    }

    fn counts(&self, machine: &'static Machine) -> Result<Counts, PlanError> {
        let plan = Plan::new(machine, &self.library)?;
        let sources = plan.sources().count();
        let mut counts = Counts {
            units: 0.0,
            sources: sources as f64,
            slowest: 0.0,
            block_rams: machine.code_block_rams() + machine.data_block_rams(),
            multipliers: 0,
        };
        // Each operand has a copy of every bank.
        let banks: u64 = machine.banks().map(|bank| block_rams(bank.depth.into(), 32)).sum();
        counts.block_rams += sources as u64 * banks;
        for unit in machine.slots.iter().flat_map(|slot| slot.units) {
            if let Some(row) = self.rows.iter().find(|row| row.design == unit.name) {
                counts.units += row.resources.luts as f64;
                counts.block_rams += row.resources.block_rams;
                counts.multipliers += row.resources.multipliers;
                counts.slowest = row.median().map_or(counts.slowest, |mhz| counts.slowest.max(1e3 / mhz));
            } else if let Some((_, luts, multipliers)) = COUNTED.iter().find(|(name, ..)| *name == unit.name)
            {
                counts.units += *luts as f64;
                counts.multipliers += multipliers;
            }
        }
        Ok(counts)
    }

    /// The estimate of a machine.
    ///
    /// # Errors
    /// If it has no circuit.
    pub fn estimate(&self, machine: &'static Machine) -> Result<Estimate, PlanError> {
        Ok(estimate(&self.counts(machine)?, self.lines))
    }

    /// The placed machines beside their estimates.
    pub fn calibration(&self) -> Vec<Calibration> {
        let row = |(index, placed): (usize, &Placed)| {
            let mut others = self.placed.clone();
            others.remove(index);
            let [own, left_out] = [self.lines, lines(&others)].map(|lines| estimate(&placed.counts, lines));
            Calibration {
                machine: placed.machine.name,
                luts: [placed.luts, own.luts, left_out.luts],
                mhz: [placed.mhz, own.mhz, left_out.mhz],
            }
        };
        self.placed.iter().enumerate().map(row).collect()
    }
}

/// LUT4 beside the units over source operands, and the clock's period over LUT4.
fn lines(placed: &[Placed]) -> [Line; 2] {
    let beside = placed.iter().map(|row| (row.counts.sources, row.luts - row.counts.units));
    let periods = placed.iter().map(|row| (row.luts, 1e3 / row.mhz));
    [Line::fit(&beside.collect::<Vec<_>>()), Line::fit(&periods.collect::<Vec<_>>())]
}

fn estimate(counts: &Counts, [beside, period]: [Line; 2]) -> Estimate {
    let luts = counts.units + beside.at(counts.sources).max(0.0);
    let mhz = 1e3 / period.at(luts).max(counts.slowest).max(1.0);
    Estimate { luts, block_rams: counts.block_rams, multipliers: counts.multipliers, mhz }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::of_machine;

    /// Block RAMs and multipliers are those that place and route counted.
    #[test]
    fn memories_and_multipliers_are_counted() {
        let estimator = Estimator::new().expect("every machine has a circuit");
        for &machine in MACHINES {
            let placed = of_machine(machine.name).expect("it is placed").resources;
            let estimate = estimator.estimate(machine).expect("it has a circuit");
            assert_eq!(estimate.multipliers, placed.multipliers, "{}", machine.name);
            assert!(estimate.block_rams.abs_diff(placed.block_rams) <= 2, "{}: {estimate:?}", machine.name);
        }
    }

    /// The error that docs/machines.md states; a new measurement may move it.
    #[test]
    fn the_lines_are_near_what_was_placed() {
        let calibration = Estimator::new().expect("every machine has a circuit").calibration();
        assert_eq!(calibration.len(), MACHINES.len());
        for Calibration { machine, luts, mhz } in calibration {
            for [placed, own, _] in [luts, mhz] {
                assert!((own / placed - 1.0).abs() < 0.08, "{machine}: {placed} and {own}");
            }
        }
    }
}
