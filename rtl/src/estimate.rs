// SPDX-License-Identifier: MIT OR Apache-2.0
//! Estimates of a core's area and clock, for rows that were never placed. The area on [`MEASURED`] is the sum of its units' areas and of
//! parts whose sizes are known, plus a linear function of the number of source operands; the clock period is a linear function of the area.
//! These functions are least-squares fits through the placed and routed machines (`rtl/synthesis.json`). Block RAMs are counted.
//!
//! For another family, LUTs, flip-flops and multipliers are linear functions of those on [`MEASURED`], through the machines that were
//! synthesised for both, and the clock is the same part of it as theirs.

use crate::Library;
use crate::export::Safety;
use crate::memories::block_rams;
use crate::plan::{Plan, PlanError};
use crate::synthesis::{Synthesis, committed};
use takt_family::{Family, MEASURED, REFERENCE, Resources};
use takt_isa::{MACHINES, Machine, UNITS};

/// Estimated area and clock of a core.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Look-up tables, including memories in logic and carry chains; cells of a family whose cells hold a table and a flip-flop.
    pub luts: f64,
    /// Number of flip-flops.
    pub flip_flops: f64,
    /// Number of the family's block RAMs.
    pub block_rams: u64,
    /// Number of the family's multipliers.
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
    flip_flops: f64,
    mhz: f64,
}

/// Features of a row, from which area and clock are estimated.
#[derive(Clone, Copy)]
struct Counts {
    /// LUT4 and flip-flops of all units, each placed alone, and of the parts of [`MeasurementDevice::parts`](takt_family::MeasurementDevice::parts).
    parts: [f64; 2],
    /// Source operands that all slots read in a cycle: selection and forwarding dominate the area besides the units.
    sources: f64,
    /// Period of the slowest unit alone, ns.
    slowest: f64,
    block_rams: u64,
    multipliers: u64,
}

/// Fitted lines: LUT4 and flip-flops beside the parts by source operands, the clock's period by LUT4.
type Lines = [Line; 3];

/// Figures of a family's devices by those of [`MEASURED`].
#[derive(Clone, Copy)]
struct Conversion {
    luts: Line,
    flip_flops: Line,
    multipliers: Line,
    /// Factor of the clock, the family's margin deducted.
    clock: f64,
}

impl Conversion {
    /// Through the machines that were synthesised for both; `None` if none was, or none with its clock.
    fn of(family: &Family) -> Option<Conversion> {
        let rows = committed();
        let is_machine =
            |row: &&Synthesis| row.parts.is_empty() && UNITS.iter().all(|unit| unit.name != row.design);
        let own = rows.iter().filter(|row| family.part(&row.device).is_some()).filter(is_machine);
        let pairs: Vec<(&Synthesis, &Synthesis)> = own
            .filter_map(|own| {
                Some((rows.iter().find(|row| is_measured(row) && row.design == own.design)?, own))
            })
            .collect();
        let line = |of: fn(&Resources) -> u64| {
            let points: Vec<(f64, f64)> = pairs
                .iter()
                .map(|(from, to)| (of(&from.resources) as f64, of(&to.resources) as f64))
                .collect();
            // A single machine gives a factor.
            Line::fit(if points.len() < 2 { vec![(0.0, 0.0), points[0]] } else { points }.as_slice())
        };
        let clocks: Vec<f64> =
            pairs.iter().filter_map(|(from, to)| Some(to.median()? / from.median()?)).collect();
        (!clocks.is_empty()).then(|| Conversion {
            luts: line(|resources| resources.luts),
            flip_flops: line(|resources| resources.flip_flops),
            multipliers: line(|resources| resources.multipliers),
            clock: clocks.iter().sum::<f64>()
                / clocks.len() as f64
                / family.place.map_or(1.0, |place| place.margin),
        })
    }
}

/// A measurement on [`MEASURED`].
fn is_measured(row: &Synthesis) -> bool {
    (row.device.as_str(), row.grade) == (MEASURED.part, Some(MEASURED.grade))
}

/// Estimator for a family, with the fitted lines.
pub struct Estimator {
    family: &'static Family,
    library: Library,
    rows: Vec<Synthesis>,
    placed: Vec<PlacedMachine>,
    lines: Lines,
    conversion: Option<Conversion>,
}

impl Estimator {
    /// The measurements suffice for a family: a machine was synthesised for it, with its clock.
    pub fn knows(family: &Family) -> bool {
        *family == *REFERENCE || Conversion::of(family).is_some()
    }

    /// Fits the estimator for a family to the committed measurements. Without measurements of the family, its figures are those of
    /// [`MEASURED`].
    ///
    /// # Errors
    /// If a machine of the table has no circuit.
    pub fn of(family: &'static Family) -> Result<Estimator, PlanError> {
        let rows: Vec<Synthesis> = committed().into_iter().filter(is_measured).collect();
        let mut estimator = Estimator {
            family,
            library: Library::builtin(),
            rows,
            placed: Vec::new(),
            lines: [Line(0.0, 0.0); 3],
            conversion: if *family == *REFERENCE { None } else { Conversion::of(family) },
        };
        let mut placed = Vec::new();
        for &machine in MACHINES {
            let row = estimator.rows.iter().find(|row| row.design == machine.name);
            if let Some((resources, mhz)) = row.and_then(|row| Some((row.resources, row.median()?))) {
                let (luts, flip_flops) = (resources.luts as f64, resources.flip_flops as f64);
                placed.push(PlacedMachine {
                    machine,
                    counts: estimator.counts(machine)?,
                    luts,
                    flip_flops,
                    mhz,
                });
            }
        }
        estimator.lines = lines(&placed);
        estimator.placed = placed;
        Ok(estimator)
    }

    fn counts(&self, machine: &'static Machine) -> Result<Counts, PlanError> {
        let plan = Plan::new(machine, &self.library)?;
        let sources = plan.sources().count();
        let depths =
            machine.banks().map(|bank| u32::from(bank.depth)).chain([machine.code_depth, machine.data_depth]);
        let numbers = [
            f64::from(machine.outputs_per_bank) * machine.slots.len() as f64,
            f64::from(machine.loop_depth),
            f64::from(machine.stack_depth),
            depths.map(|depth| f64::from(depth).log2()).sum(),
        ];
        let parts =
            MEASURED.parts.map(|sizes| sizes.iter().zip(numbers).map(|(size, number)| size * number).sum());
        let mut counts = Counts {
            parts,
            sources: sources as f64,
            slowest: 0.0,
            block_rams: block_rams(&plan, &self.library, self.family.block_ram()).total(),
            multipliers: 0,
        };
        let mut add = |luts: u64, flip_flops: u64, multipliers: u64| {
            counts.parts[0] += luts as f64;
            counts.parts[1] += flip_flops as f64;
            counts.multipliers += multipliers;
        };
        let mut slowest = 0.0_f64;
        for unit in machine.slots.iter().flat_map(|slot| slot.units) {
            if let Some(row) = self.rows.iter().find(|row| row.design == unit.name) {
                add(row.resources.luts, row.resources.flip_flops, row.resources.multipliers);
                slowest = row.median().map_or(slowest, |mhz| slowest.max(1e3 / mhz));
            } else if let Some((_, [luts, flip_flops, multipliers])) =
                MEASURED.units.iter().find(|(name, ..)| *name == unit.name)
            {
                add(*luts, *flip_flops, *multipliers);
            }
        }
        counts.slowest = slowest;
        Ok(counts)
    }

    /// Estimates a machine from its row.
    ///
    /// # Errors
    /// If the machine has no circuit.
    pub fn estimate(&self, machine: &'static Machine) -> Result<Estimate, PlanError> {
        let estimate = estimate(&self.counts(machine)?, self.lines);
        let Some(conversion) = self.conversion else { return Ok(estimate) };
        let flip_flops = conversion.flip_flops.at(estimate.flip_flops).max(0.0);
        let tables = conversion.luts.at(estimate.luts).max(0.0);
        Ok(Estimate {
            luts: tables + self.family.cells_per_flip_flop.unwrap_or(0.0) * flip_flops,
            flip_flops,
            multipliers: conversion.multipliers.at(estimate.multipliers as f64).round().max(0.0) as u64,
            mhz: conversion.clock * estimate.mhz,
            ..estimate
        })
    }

    /// Estimates a machine with mechanisms against faults: error correction takes the share of cells that it takes on t1, and a second core
    /// as much as the first one; what compares the two is small beside them. The clock is that without them.
    ///
    /// # Errors
    /// If the machine has no circuit.
    pub fn estimate_with(&self, machine: &'static Machine, safety: Safety) -> Result<Estimate, PlanError> {
        let estimate = self.estimate(machine)?;
        let plan = Plan { ecc: safety.ecc, ..Plan::new(machine, &self.library)? };
        let times = 1 + u32::from(safety.second_core.is_some());
        let cells = f64::from(times) * if safety.ecc { ecc_share() } else { 1.0 };
        Ok(Estimate {
            luts: cells * estimate.luts,
            flip_flops: cells * estimate.flip_flops,
            multipliers: u64::from(times) * estimate.multipliers,
            block_rams: u64::from(times) * block_rams(&plan, &self.library, self.family.block_ram()).total(),
            ..estimate
        })
    }

    /// Compares the placed machines with their estimates on [`MEASURED`].
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

/// Cells of t1 with error correction, as a multiple of those without; 1 if it was not placed.
fn ecc_share() -> f64 {
    let rows = committed();
    let luts = |design: &str| {
        let row = rows.iter().find(|row| row.design == design && row.device == MEASURED.part);
        row.map(|row| row.resources.luts as f64)
    };
    luts("t1 with error correction").zip(luts("t1")).map_or(1.0, |(with, without)| with / without)
}

/// Fits LUT4 and flip-flops besides the parts as functions of source operands, and the clock's period as a function of LUT4.
fn lines(placed: &[PlacedMachine]) -> Lines {
    let fit =
        |point: fn(&PlacedMachine) -> (f64, f64)| Line::fit(&placed.iter().map(point).collect::<Vec<_>>());
    [
        fit(|row| (row.counts.sources, row.luts - row.counts.parts[0])),
        fit(|row| (row.counts.sources, row.flip_flops - row.counts.parts[1])),
        fit(|row| (row.luts, 1e3 / row.mhz)),
    ]
}

fn estimate(counts: &Counts, [luts, flip_flops, period]: Lines) -> Estimate {
    let luts = counts.parts[0] + luts.at(counts.sources).max(0.0);
    let flip_flops = counts.parts[1] + flip_flops.at(counts.sources).max(0.0);
    let mhz = 1e3 / period.at(luts).max(counts.slowest).max(1.0);
    Estimate { luts, flip_flops, block_rams: counts.block_rams, multipliers: counts.multipliers, mhz }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::of_machine;
    use takt_isa::Function;
    use takt_isa::spec::row::{BankOwned, RowOwned, SlotOwned, UnitOwned};

    /// Counted block RAMs and multipliers equal the placed ones, within 2 block RAMs.
    #[test]
    fn memories_and_multipliers_are_counted() {
        let estimator = Estimator::of(REFERENCE).expect("every machine has a circuit");
        for &machine in MACHINES {
            let placed = of_machine(machine.name).expect("it is placed").resources;
            let estimate = estimator.estimate(machine).expect("it has a circuit");
            assert_eq!(estimate.multipliers, placed.multipliers, "{}", machine.name);
            assert_eq!(estimate.block_rams, placed.block_rams, "{}", machine.name);
        }
    }

    /// A machine that is not in the fit, on each family that it was synthesised for: LUTs and flip-flops within 15 %, clocks within a third.
    #[test]
    fn a_small_machine_is_near_its_measurements() {
        let file = "programs/examples/board/step/machine.toml";
        let machine = small();
        let rows = committed();
        let rows: Vec<&Synthesis> = rows.iter().filter(|row| row.design == file).collect();
        assert!(rows.len() >= 4, "{}", rows.len());
        for row in rows {
            let family = Family::of_part(&row.device).expect("a family");
            let estimate = Estimator::of(family).expect("an estimator").estimate(machine).expect("a circuit");
            let cells = family.cells_per_flip_flop.unwrap_or(0.0) * row.resources.flip_flops as f64;
            let luts = row.resources.luts as f64 + cells;
            let near = |estimate: f64, measured: f64, most: f64| (estimate / measured - 1.0).abs() < most;
            assert!(near(estimate.luts, luts, 0.15), "{}: {luts} and {}", row.device, estimate.luts);
            let flip_flops = row.resources.flip_flops as f64;
            assert!(
                near(estimate.flip_flops, flip_flops, 0.15),
                "{}: {flip_flops} and {}",
                row.device,
                estimate.flip_flops
            );
            assert_eq!(estimate.block_rams, row.resources.block_rams, "{}", row.device);
            assert_eq!(estimate.multipliers, row.resources.multipliers, "{}", row.device);
            if let Some(mhz) = row.median() {
                let mhz = mhz / family.place.map_or(1.0, |place| place.margin);
                assert!(near(estimate.mhz, mhz, 0.34), "{}: {mhz} and {}", row.device, estimate.mhz);
            }
        }
    }

    /// The row of that file.
    fn small() -> &'static Machine {
        let unit = |name: &str| UnitOwned::of(name).expect("a unit");
        let mut sequencer = unit("sequencer");
        sequencer.functions.retain(|function| *function != Function::Loop);
        let bank = |name: &str, base, depth| BankOwned { name: name.to_owned(), base, depth };
        let row = RowOwned {
            name: "small".to_owned(),
            text: String::new(),
            slots: vec![SlotOwned {
                name: "one".to_owned(),
                bank: bank("r", 0, 64),
                units: vec![unit("addmul"), unit("alu"), unit("memory"), sequencer],
            }],
            inputs: bank("i", 1016, 8),
            outputs_per_bank: 2,
            code_depth: 256,
            data_depth: 256,
            stack_depth: 2,
            loop_depth: 0,
            refill: 6,
            resolve: 2,
        };
        row.machine().expect("a machine")
    }

    /// Estimates stay within the error that docs/machines.md states; a new measurement may change it.
    #[test]
    fn fitted_lines_are_near_the_placed_machines() {
        let calibration = Estimator::of(REFERENCE).expect("every machine has a circuit").calibration();
        assert_eq!(calibration.len(), MACHINES.len());
        for Calibration { machine, luts, mhz } in calibration {
            for ([placed, own, _], most) in [(luts, 0.015), (mhz, 0.1)] {
                assert!((own / placed - 1.0).abs() < most, "{machine}: {placed} and {own}");
            }
        }
    }
}
