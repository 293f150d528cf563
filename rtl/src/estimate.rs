// SPDX-License-Identifier: MIT OR Apache-2.0
//! Estimates of a core's area and clock on [`MEASURED`], for rows that were never placed. The area is the sum of its units' areas plus a
//! linear function of the number of source operands; the clock period is a linear function of the area. Both functions are least-squares
//! fits through the placed and routed machines (`rtl/synthesis.json`). Block RAMs and multipliers are counted.

use crate::Library;
use crate::memories::block_rams;
use crate::plan::{Plan, PlanError};
use crate::synthesis::{Synthesis, committed};
use takt_family::{MEASURED, REFERENCE};
use takt_isa::{MACHINES, Machine};

/// Estimated area and clock of a core.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// LUT4, including memories in logic and halves of carry chains.
    pub luts: f64,
    /// Number of 18-kbit block RAMs.
    pub block_rams: u64,
    /// Number of multipliers of 18 x 18 bits.
    pub multipliers: u64,
    /// Estimated clock in MHz.
    pub mhz: f64,
}

/// Comparison of a placed machine with its estimates.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Calibration {
    /// Name of the machine.
    pub machine: &'static str,
    /// LUT4: placed, estimated, and estimated without this machine's measurement (leave-one-out).
    pub luts: [f64; 3],
    /// Median clock in MHz: placed, estimated, and estimated leave-one-out.
    pub mhz: [f64; 3],
}

/// Line: value at 0, and slope.
#[derive(Clone, Copy, Debug)]
struct Line(f64, f64);

impl Line {
    /// Fits a line by least squares.
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

/// Measurement of a placed machine, for the fit.
#[derive(Clone, Copy)]
struct PlacedMachine {
    machine: &'static Machine,
    counts: Counts,
    luts: f64,
    mhz: f64,
}

/// Features of a row, from which area and clock are estimated.
#[derive(Clone, Copy)]
struct Counts {
    /// LUT4 of all units, each placed alone.
    units: f64,
    /// Source operands that all slots read in a cycle: selection and forwarding dominate the area besides the units.
    sources: f64,
    /// Period of the slowest unit alone, ns.
    slowest: f64,
    block_rams: u64,
    multipliers: u64,
}

/// Estimator with the fitted lines.
pub struct Estimator {
    library: Library,
    rows: Vec<Synthesis>,
    placed: Vec<PlacedMachine>,
    lines: [Line; 2],
}

impl Estimator {
    /// Fits the estimator to the committed measurements.
    ///
    /// # Errors
    /// If a machine of the table has no circuit.
    pub fn new() -> Result<Estimator, PlanError> {
        let rows: Vec<Synthesis> = committed()
            .into_iter()
            .filter(|row| (row.device.as_str(), row.grade) == (MEASURED.part, Some(MEASURED.grade)))
            .collect();
        let mut estimator =
            Estimator { library: Library::builtin(), rows, placed: Vec::new(), lines: [Line(0.0, 0.0); 2] };
        let mut placed = Vec::new();
        for &machine in MACHINES {
            let row = estimator.rows.iter().find(|row| row.design == machine.name);
            if let Some((luts, mhz)) = row.and_then(|row| Some((row.resources.luts as f64, row.median()?))) {
                placed.push(PlacedMachine { machine, counts: estimator.counts(machine)?, luts, mhz });
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
            block_rams: block_rams(&plan, &self.library, REFERENCE.block_ram()),
            multipliers: 0,
        };
        for unit in machine.slots.iter().flat_map(|slot| slot.units) {
            if let Some(row) = self.rows.iter().find(|row| row.design == unit.name) {
                counts.units += row.resources.luts as f64;
                counts.multipliers += row.resources.multipliers;
                counts.slowest = row.median().map_or(counts.slowest, |mhz| counts.slowest.max(1e3 / mhz));
            } else if let Some((_, luts, multipliers)) =
                MEASURED.units.iter().find(|(name, ..)| *name == unit.name)
            {
                counts.units += *luts as f64;
                counts.multipliers += multipliers;
            }
        }
        Ok(counts)
    }

    /// Estimates a machine from its row.
    ///
    /// # Errors
    /// If the machine has no circuit.
    pub fn estimate(&self, machine: &'static Machine) -> Result<Estimate, PlanError> {
        Ok(estimate(&self.counts(machine)?, self.lines))
    }

    /// Compares the placed machines with their estimates.
    pub fn calibration(&self) -> Vec<Calibration> {
        let row = |(index, placed): (usize, &PlacedMachine)| {
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

/// Fits LUT4 besides the units as a function of source operands, and the clock's period as a function of LUT4.
fn lines(placed: &[PlacedMachine]) -> [Line; 2] {
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

    /// Counted block RAMs and multipliers equal the placed ones, within 2 block RAMs.
    #[test]
    fn memories_and_multipliers_are_counted() {
        let estimator = Estimator::new().expect("every machine has a circuit");
        for &machine in MACHINES {
            let placed = of_machine(machine.name).expect("it is placed").resources;
            let estimate = estimator.estimate(machine).expect("it has a circuit");
            assert_eq!(estimate.multipliers, placed.multipliers, "{}", machine.name);
            assert_eq!(estimate.block_rams, placed.block_rams, "{}", machine.name);
        }
    }

    /// Estimates stay within the error that docs/machines.md states; a new measurement may change it.
    #[test]
    fn fitted_lines_are_near_the_placed_machines() {
        let calibration = Estimator::new().expect("every machine has a circuit").calibration();
        assert_eq!(calibration.len(), MACHINES.len());
        for Calibration { machine, luts, mhz } in calibration {
            for [placed, own, _] in [luts, mhz] {
                assert!((own / placed - 1.0).abs() < 0.08, "{machine}: {placed} and {own}");
            }
        }
    }
}
