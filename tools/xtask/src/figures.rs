// SPDX-License-Identifier: MIT OR Apache-2.0
//! Measured figures in documents, each named by the comment after it: `112<!-- =tracking.t3.cycles -->`.
//!
//! The comment is invisible when rendered. Cycles, bounds and latencies are measured here, by assembler, analysis and tables in this
//! process; clocks and sizes come from the record of place and route. `cargo xtask docs` writes the figures; `--check` fails if one is
//! wrong.

use anyhow::{Context, Result, bail, ensure};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use takt_asm::schedule::DemandKind;
use takt_asm::{AssembledProgram, Contract, FileLoader, Options, Search};
use takt_family::MEASURED;
use takt_isa::{Machine, Op};
use takt_rtl::synthesis;

const OPEN: &str = "<!-- =";
const CLOSE: &str = " -->";

/// Clock for times in documents, in MHz: that of the founding paper's processor.
const CLOCK: f64 = 125.0;

/// Programs with figures: name, and path relative to the project's folder.
const PROGRAMS: [(&str, &str); 12] = [
    ("tracking", "programs/hybrid/tracking.s"),
    ("contracted", "programs/hybrid/tracking.s"),
    ("literal", "programs/hybrid/tracking_literal.s"),
    ("friction", "programs/hybrid/tracking_friction.s"),
    ("generation", "programs/hybrid/generation.s"),
    ("forward", "programs/arm/forward.s"),
    ("inverse", "programs/arm/inverse.s"),
    ("dynamic", "programs/three/dynamic.s"),
    ("kinematic", "programs/three/kinematic.s"),
    ("communication", "programs/three/communication.s"),
    ("biquads", "asm/tests/kernels/biquads.s"),
    ("equations", "programs/hybrid/tracking_equations.s"),
];

/// Prefix of the program variant with contracted products and sums.
const CONTRACTED: &str = "contracted";

/// Documents with figures: path, and updated text. Documents in `generated` are taken from there instead of from disk.
pub(crate) fn documents(
    root: &Path,
    generated: &BTreeMap<PathBuf, String>,
) -> Result<Vec<(PathBuf, String)>> {
    let mut paths: Vec<PathBuf> = Vec::new();
    for folder in ["", "docs", "rtl"] {
        for entry in std::fs::read_dir(root.join(folder)).with_context(|| format!("cannot read {folder}/"))? {
            paths.push(Path::new(folder).join(entry?.file_name()));
        }
    }
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    paths.sort();
    let mut figures = Figures { root, measured: HashMap::new() };
    let mut documents = Vec::new();
    for path in paths {
        let text = match generated.get(&path) {
            Some(text) => text.clone(),
            None => std::fs::read_to_string(root.join(&path))
                .with_context(|| format!("cannot read {}", path.display()))?,
        };
        if text.contains(OPEN) {
            let new = figures.fill(&text).with_context(|| format!("in {}", path.display()))?;
            documents.push((path, new));
        }
    }
    Ok(documents)
}

/// Measurements of one program on one machine.
struct ProgramMeasurement {
    assembled: AssembledProgram,
    bounds: takt_analysis::Bounds,
}

struct Figures<'r> {
    root: &'r Path,
    measured: HashMap<(String, String), ProgramMeasurement>,
}

impl Figures<'_> {
    /// Document text with all figures updated.
    fn fill(&mut self, text: &str) -> Result<String> {
        let mut filled = String::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once(OPEN) {
            let (name, after) = after
                .split_once(CLOSE)
                .with_context(|| format!("unterminated figure comment: missing `{CLOSE}`"))?;
            let number = |c: char| c.is_ascii_digit() || ",.".contains(c);
            let kept = before.trim_end_matches(number);
            ensure!(kept.len() < before.len(), "no figure stands before {OPEN}{name}{CLOSE}");
            let value = self.value(name).with_context(|| format!("figure {name}"))?;
            filled += &format!("{kept}{value}{OPEN}{name}{CLOSE}");
            rest = after;
        }
        Ok(filled + rest)
    }

    /// Looks up a figure: `PROGRAM.MACHINE.QUANTITY`, `MNEMONIC.MACHINE.latency`, or `circuit.DESIGN.QUANTITY`.
    fn value(&mut self, name: &str) -> Result<String> {
        let mut parts = name.splitn(3, '.');
        let [Some(what), Some(of), Some(quantity)] = [parts.next(), parts.next(), parts.next()] else {
            bail!("expected a name of three parts, such as PROGRAM.MACHINE.QUANTITY");
        };
        if what == "circuit" {
            return circuit(of, quantity);
        }
        let machine = Machine::from_name(of)?;
        match Op::from_mnemonic(what) {
            Some(op) => unit(machine, op, quantity),
            None => quantity_of(self.program(what, machine)?, quantity),
        }
    }

    fn program(&mut self, name: &str, machine: &'static Machine) -> Result<&ProgramMeasurement> {
        let key = (name.to_owned(), machine.name.to_owned());
        if !self.measured.contains_key(&key) {
            let known: BTreeMap<&str, &str> = PROGRAMS.into_iter().collect();
            let path = known
                .get(name)
                .with_context(|| format!("there is no program `{name}`; there are {:?}", known.keys()))?;
            let measured = measure(self.root, path, name == CONTRACTED, machine)?;
            self.measured.insert(key.clone(), measured);
        }
        Ok(&self.measured[&key])
    }
}

/// Assembles a program with the options of `takt asm`, and computes bounds as `takt bound` does.
fn measure(
    root: &Path,
    path: &str,
    contracted: bool,
    machine: &'static Machine,
) -> Result<ProgramMeasurement> {
    let (folder, file) = path.rsplit_once('/').context("expected the path of a program in a folder")?;
    let loader = Search::new(FileLoader::new(root.join(folder))).library(takt_programs::LIBRARY);
    let contract = if contracted { Contract::All } else { Contract::AsWritten };
    let options = Options { machine, contract, ..Options::default() };
    let assembled = takt_asm::assemble(file, &loader, &options)
        .map_err(|errors| anyhow::anyhow!("{}", errors.render(false)))?;
    let bounds = takt_analysis::bound(&assembled.program)?;
    Ok(ProgramMeasurement { assembled, bounds })
}

fn quantity_of(measured: &ProgramMeasurement, quantity: &str) -> Result<String> {
    let ProgramMeasurement { assembled, bounds } = measured;
    let section = bounds.sections.iter().find(|section| section.name == "period");
    let cycles = match section {
        Some(section) => section.cycles.worst,
        // The program halts and has no periods.
        None => bounds.sections.iter().map(|section| section.cycles.worst).max().context("no section")?,
    };
    let late = || {
        let late = assembled.timing.iter().find(|report| matches!(report.kind, DemandKind::Late(_)));
        late.context("the program reads no input late")
    };
    Ok(match quantity {
        "cycles" => grouped(cycles),
        "us" => format!("{:.2}", cycles as f64 / CLOCK),
        // Includes the refill after the `wait`, during which a tick may arrive.
        "in_time" => grouped(section.context("it has no period")?.in_time.worst),
        "worst" => grouped(bounds.worst_period().context("it has no period")?),
        "once" => {
            let once = bounds.sections.iter().find(|section| section.once);
            grouped(once.context("it has no code that runs once")?.cycles.worst)
        }
        "best" => grouped(section.context("it has no period")?.cycles.best),
        // Bound of the scheduled block, plus the cycles of the section outside the block.
        "bound" => {
            let blocks = assembled.blocks.iter();
            let block = blocks.max_by_key(|block| block.cycles).context("no block is scheduled")?;
            grouped(cycles - u64::from(block.cycles - block.bound.cycles()))
        }
        "late" => grouped(late()?.window.context("no output follows")?.0.into()),
        "late_bound" => grouped(late()?.window.context("no output follows")?.1.into()),
        // Cycles from the latest read of an input.
        "last" => {
            let report = late()?;
            let first = report.ports.iter().map(|port| port.1);
            let spread = first.clone().max().unwrap_or(0) - first.min().unwrap_or(0);
            grouped((report.window.context("no output follows")?.0 - spread).into())
        }
        _ => bail!("a program has no `{quantity}`"),
    })
}

/// Latency or initiation interval of the unit that executes an instruction.
fn unit(machine: &Machine, op: Op, quantity: &str) -> Result<String> {
    let (_, unit) = machine.host(op.row().function).context("the machine has no unit for it")?;
    match quantity {
        "latency" => Ok(unit.latency.to_string()),
        "interval" => Ok(unit.interval.to_string()),
        _ => bail!("an instruction has `latency` and `interval`, and no `{quantity}`"),
    }
}

/// Figure of a placed and routed circuit.
fn circuit(design: &str, quantity: &str) -> Result<String> {
    let rows = synthesis::committed().into_iter();
    let name = if design == "three" { "programs/three/controller.toml" } else { design };
    let placed = rows.filter(|row| row.design == name && row.device == MEASURED.part);
    let row = placed.max_by_key(|row| row.grade).context("it has not been placed and routed")?;
    let clock = |mhz: Option<f64>| mhz.map(|mhz| format!("{mhz:.1}")).context("no clock is recorded");
    match quantity {
        "median" => clock(row.median()),
        "least" => clock(row.least()),
        "greatest" => clock(row.greatest()),
        "total" => Ok(grouped(row.resources.luts)),
        "luts" => Ok(grouped(row.resources.luts - row.resources.carries.unwrap_or(0))),
        "carries" => Ok(grouped(row.resources.carries.context("no carry cells are recorded")?)),
        "flip_flops" => Ok(grouped(row.resources.flip_flops)),
        "multipliers" => Ok(grouped(row.resources.multipliers)),
        "block_rams" => Ok(grouped(row.resources.block_rams)),
        _ => bail!("a circuit has no `{quantity}`"),
    }
}

/// Decimal number with commas between thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.char_indices() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figures are replaced and all other text is kept; a missing figure or an unknown name is an error.
    #[test]
    fn figures_are_filled_in() {
        let mut figures = Figures { root: Path::new("."), measured: HashMap::new() };
        let mut fill = |text: &str| figures.fill(text);
        let sum = takt_isa::T3.host(Op::fadd.row().function).map(|(_, unit)| unit.latency);
        let filled = fill("**7<!-- =fadd.t3.latency -->** of 7").expect("it is known");
        assert_eq!(filled, format!("**{}<!-- =fadd.t3.latency -->** of 7", sum.expect("t3 adds")));
        for wrong in [
            "x<!-- =fadd.t3.latency -->",
            "7<!-- =fadd.t9.latency -->",
            "7<!-- =nothing.t3.cycles -->",
            "7<!-- =fadd -->",
        ] {
            assert!(fill(wrong).is_err(), "{wrong}");
        }
        assert_eq!([999, 1000, 147_310].map(grouped), ["999", "1,000", "147,310"]);
    }
}
