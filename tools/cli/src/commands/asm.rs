// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt asm`: assembles a program; writes image, listing, headers and reports.

use crate::commands::verify;
use crate::run::load::Load;
use crate::run::spills::{block_name, spilled};
use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::options::{OptionalMachine, SourceArguments, TransformMode};
use crate::terminal::output::Failure;
use crate::terminal::page::{Columns, left, right};
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_asm::diag::Diagnostics;
use takt_asm::loops::{CountedLoop, LoopForm};
use takt_asm::schedule::DemandKind;
use takt_asm::schedule::{
    BlockReport, DEFAULT_EFFORT, LoopReport, PlainLoop, Resources, SharedBound, TimingReport,
};
use takt_asm::select::Selection;
use takt_asm::{
    Adjustment, AssembledProgram, Contraction, Schedule, SpilledValue, Spills, Transfer, image, listing,
};
use takt_isa::{Program, SlotIndex, Slots};
use takt_rtl::header::{Header, Language};

/// Assemble a source into an image.
///
/// Without any of the output options, the image goes to FILE with the ending `.takt`. What the scheduler made of each block
/// is printed beside the bound that no schedule can beat.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Asm {
    /// Source; `-` is standard input.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// Write the image here; `-` is standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a listing: address, words, source; `-` is standard output.
    #[arg(long, short, value_name = "FILE")]
    listing: Option<PathBuf>,
    /// Write the symbol map: labels, registers, ports, constants; `-` is standard output.
    #[arg(long, short, value_name = "FILE")]
    symbols: Option<PathBuf>,
    /// Write `$readmemh` memories into this folder: code of each slot, constants of each bank, data.
    #[arg(long, value_name = "FOLDER")]
    readmemh: Option<PathBuf>,
    /// Write the program's interface for a host, in this language: ports and their bus addresses, the loader's records, cycles.
    #[arg(long, value_enum, value_name = "LANGUAGE")]
    header: Option<HeaderLanguage>,
    /// Write the header here; `-` is standard output.
    #[arg(long, value_name = "FILE", default_value = "-", requires = "header")]
    header_file: PathBuf,
    /// Schedule everything: the same as --schedule on.
    #[arg(short = 'O', conflicts_with = "schedule")]
    optimise: bool,
    /// Operations that the scheduler packs into bundles and orders: operations under `.schedule on`, all, or none.
    #[arg(long, value_enum, value_name = "WHEN", default_value_t = TransformMode::Source)]
    schedule: TransformMode,
    /// Effort of the scheduler's search, up to 100000; 0 is the first passes only.
    #[arg(long, value_name = "N", default_value_t = DEFAULT_EFFORT, value_parser = clap::value_parser!(u32).range(0..=100_000), allow_hyphen_values = true)]
    effort: u32,
    /// Leave the data for debuggers out of the image: sources, constants, meanings of names.
    #[arg(long)]
    strip: bool,
    /// Check only; write no file.
    #[arg(long, conflicts_with_all = ["output", "listing", "symbols", "readmemh", "header"])]
    check: bool,
    /// Check that the image, read back from its bytes, is equivalent to the source, as `takt verify` does; if not, no file is written.
    #[arg(long)]
    verify: bool,
    /// Print the result, errors and warnings as JSON on standard output.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt asm prog.s                       prog.s into prog.takt
  takt asm prog.s -m t1 -o small.takt   the same source for the small machine
  takt asm prog.s --listing -           which bundle came from which lines
  takt asm prog.s --header c --header-file prog.h   ports, loader and cycles for a host in C
  takt asm prog.s --verify              check the image against the source
  takt asm prog.s --check --json        errors and warnings for an editor";

/// A host's language.
#[derive(Clone, Copy, ValueEnum)]
enum HeaderLanguage {
    /// C99: addresses, functions for each port, a loader.
    C,
    /// A Rust module without the standard library.
    Rust,
    /// JSON, as docs/headers.md says.
    Json,
    /// CMSIS-SVD: the bus slave with the program's ports.
    Svd,
}

impl From<HeaderLanguage> for Language {
    fn from(language: HeaderLanguage) -> Language {
        match language {
            HeaderLanguage::C => Language::C,
            HeaderLanguage::Rust => Language::Rust,
            HeaderLanguage::Json => Language::Json,
            HeaderLanguage::Svd => Language::Svd,
        }
    }
}

impl From<TransformMode> for Schedule {
    fn from(when: TransformMode) -> Schedule {
        match when {
            TransformMode::Source => Schedule::AsWritten,
            TransformMode::On => Schedule::All,
            TransformMode::Off => Schedule::None,
        }
    }
}

impl Asm {
    /// Path of the image; `None` if no image is to be written.
    fn image_path(&self) -> Result<Option<PathBuf>> {
        let others = self.listing.is_some()
            || self.symbols.is_some()
            || self.readmemh.is_some()
            || self.header.is_some();
        match &self.output {
            Some(path) => Ok(Some(path.clone())),
            None if others || self.check => Ok(None),
            None if files::is_dash(&self.file) => Err(Failure::Usage(
                "the source is standard input: give the image's name with --output".to_owned(),
            )
            .into()),
            None => Ok(Some(self.file.with_extension("takt"))),
        }
    }

    /// Files that the command writes, with their options.
    fn writes<'a>(&'a self, image_path: &'a Option<PathBuf>) -> Vec<OptionPath<'a>> {
        let mut writes: Vec<OptionPath<'_>> =
            [("the image", image_path), ("--listing", &self.listing), ("--symbols", &self.symbols)]
                .into_iter()
                .filter_map(|(option, path)| Some((option, path.as_deref()?)))
                .collect();
        if self.header.is_some() {
            writes.push(("--header", &self.header_file));
        }
        if self.json {
            writes.push(("--json", Path::new("-")));
        }
        writes
    }
}

pub(crate) fn run(arguments: &Asm, color: bool, out: &mut Out) -> Result<()> {
    let image_path = arguments.image_path()?;
    let source = Load::source(&arguments.file)?;
    let writes = arguments.writes(&image_path);
    files::check(&[("FILE", &arguments.file)], &writes)?;

    let schedule = if arguments.optimise { Schedule::All } else { arguments.schedule.into() };
    let load = Load {
        schedule,
        effort: arguments.effort,
        ..Load::new(arguments.machine.machine, color).with(&arguments.source)
    };
    let again = arguments.verify.then(|| source.clone());
    let result = load.assemble(&arguments.file, source);
    let assembled = match result {
        Err(errors) if arguments.json => {
            files::json(&json!({ "messages": messages(&errors)? }), out)?;
            return Err(Failure::Reported.into());
        }
        Ok(assembled) if arguments.json => assembled,
        result => load.finish(result)?,
    };

    let program = &assembled.program;
    let image = match image_path.is_some() || arguments.verify {
        true => {
            Some(image::write_with(program, (!arguments.strip).then(|| assembled.debug_info()).as_ref())?)
        }
        false => None,
    };
    let verified = match again.zip(image.as_deref()) {
        Some((source, image)) => {
            let read = image::read(image).context("the image cannot be read back")?;
            Some(verify::check(&load, &read, &arguments.file, source)?)
        }
        None => None,
    };
    if let Some(checked) = verified.as_ref().filter(|checked| !checked.is_proved()) {
        match arguments.json {
            true => files::json(&json!({ "verify": checked.json() }), out)?,
            false => checked.write(out)?,
        }
        return Err(Failure::Reported.into());
    }
    write_outputs(arguments, &assembled)?;
    if let Some((path, image)) = image_path.as_ref().zip(image) {
        files::write(path, &image)?;
    }
    if arguments.json {
        let mut result = result_json(&assembled, image_path.as_deref())?;
        if let Some(checked) = &verified {
            result["verify"] = checked.json();
        }
        files::json(&result, out)?;
    } else if !writes.iter().any(|(_, path)| files::is_dash(path)) {
        let place =
            image_path.map_or_else(|| "assembled".to_owned(), |path| format!("wrote {}", path.display()));
        write_report(&assembled, &place, out)?;
        if let Some(checked) = &verified {
            checked.write(out)?;
        }
    }
    Ok(())
}

/// Writes the files other than the image: listing, symbol map, memories and header.
fn write_outputs(arguments: &Asm, assembled: &AssembledProgram) -> Result<()> {
    if let Some(path) = &arguments.listing {
        files::write(path, listing::listing(assembled).as_bytes())?;
    }
    if let Some(path) = &arguments.symbols {
        files::write(path, listing::symbol_map(assembled).to_string().as_bytes())?;
    }
    if let Some(folder) = &arguments.readmemh {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        for (name, text) in listing::readmemh(&assembled.program) {
            files::write(&folder.join(name), text.as_bytes())?;
        }
    }
    if let Some(language) = arguments.header {
        let text = header(&assembled.program, &arguments.file).text(language.into());
        files::write(&arguments.header_file, text.as_bytes())?;
    }
    Ok(())
}

/// Report of a program at a place: sizes, blocks, loops, and the assembler's transformations.
fn write_report(assembled: &AssembledProgram, place: &str, out: &mut Out) -> Result<()> {
    let program = &assembled.program;
    writeln!(
        out,
        "{place}: {} bundles ({} words), {} constants, {} data words for {}",
        program.bundles(),
        program.code.len(),
        program.constants.len(),
        program.data.len(),
        program.machine.name
    )?;
    writeln!(out, "memories: {}", takt_isa::manual::memories_text(program.machine))?;
    write_blocks(assembled, out)?;
    for counted in &assembled.counted_loops {
        writeln!(out, "{counted}")?;
    }
    for Selection { location, registers, .. } in &assembled.selections {
        let place = location.map_or_else(|| "a branch".to_owned(), |at| program.place_text(at));
        let plural = if *registers == 1 { "" } else { "s" };
        writeln!(out, "no branch at {place}: {registers} selection{plural} in its place")?;
    }
    for pipelined in &assembled.loops {
        writeln!(out, "{}", loop_text(pipelined, program))?;
    }
    for PlainLoop { location, reason } in &assembled.plain_loops {
        let place = location.map_or_else(|| "a loop".to_owned(), |at| program.place_text(at));
        writeln!(out, "not pipelined: the loop at {place}: {reason}")?;
    }
    write_timing(assembled, out)?;
    write_contractions(assembled, out)?;
    write_adjustments(assembled, out)?;
    for line in spilled(assembled) {
        writeln!(out, "{line}")?;
    }
    Ok(())
}

/// Header of a program for a host, with a name derived from the source file.
fn header(program: &Program, source: &Path) -> Header {
    let stem = source.file_stem().filter(|_| !files::is_dash(source));
    let name = stem.map_or_else(|| "program".into(), |stem| stem.to_string_lossy());
    Header::new(program, &name, takt_analysis::section_cycles(program))
}

/// Prints a table of all scheduled blocks with cycles and bounds.
fn write_blocks(assembled: &AssembledProgram, out: &mut Out) -> Result<()> {
    let program = &assembled.program;
    let names: Vec<String> = assembled.blocks.iter().map(|block| block_name(program, block)).collect();
    let Some(longest) = names.iter().map(|name| name.chars().count()).max() else { return Ok(()) };
    let bounds: Vec<String> = assembled.blocks.iter().map(|block| bounds_text(block, program)).collect();
    let text = bounds.iter().map(|text| text.chars().count()).max().unwrap_or(0);
    let width = longest.clamp(12, 40) + 2;
    let columns = [
        left(width, 0),
        right(11, 2),
        right(9, 1),
        right(8, 0),
        right(8, 0),
        right(11, 3),
        left(3 + text, 4),
    ];
    let columns = Columns::new(&columns, out.page());
    // If the terminal is too narrow for all bounds, show only the tightest, with the cycles.
    let is_short = columns.leave_out_some();
    let titles = ["scheduled", "operations", "bundles", "cycles", "bound", "above it", "   bounds"];
    let title = columns.row(&titles, None);
    out.lines(&if is_short { title.replace('\n', "   set by\n") } else { title })?;
    for ((block, name), bounds) in assembled.blocks.iter().zip(&names).zip(&bounds) {
        let bound = block.bound.cycles();
        let above = 100.0 * f64::from(block.cycles.saturating_sub(bound)) / f64::from(bound.max(1));
        let [operations, bundles, cycles] =
            [block.operations, block.bundles, block.cycles].map(|count| count.to_string());
        let cells = [
            format!("  {name}"),
            operations,
            bundles,
            cycles,
            bound.to_string(),
            format!("{above:.1} %"),
            format!("   {bounds}"),
        ];
        let row = columns.row(&cells, Some(3));
        out.lines(&if is_short {
            row.replace('\n', &format!("   {}\n", bound_text(block, program)))
        } else {
            row
        })?;
    }
    Ok(())
}

/// Describes a pipelined loop: initiation interval, and its lower bounds.
fn loop_text(report: &LoopReport, program: &Program) -> String {
    let place = report.location.map_or_else(|| "a loop".to_owned(), |at| program.place_text(at));
    let LoopReport { iterations, interval, stages, .. } = report;
    let bounds: Vec<String> =
        loop_bounds(report, program).into_iter().map(|(of, cycles)| format!("{of} {cycles}")).collect();
    format!(
        "pipelined loop at {place}: {iterations}, one every {interval} cycles, {stages} at a time; bound {}: {}",
        report.bound.cycles(),
        bounds.join(", ")
    )
}

/// Lower bounds of a loop's initiation interval in cycles: from the most heavily used slots and unit, and from the longest dependence
/// chain between iterations.
fn loop_bounds(report: &LoopReport, program: &Program) -> Vec<(String, u32)> {
    let slots = report.bound.slots.iter().map(|&(slots, cycles)| (Resources::Slots(slots), cycles));
    let units =
        report.bound.units.iter().enumerate().map(|(unit, &cycles)| (Resources::Units(vec![unit]), cycles));
    // Of equal maxima, take the first.
    let slots = slots.rev().max_by_key(|(_, cycles)| *cycles);
    let units = units.rev().max_by_key(|(_, cycles)| *cycles);
    let resources =
        [slots, units].into_iter().flatten().map(|(of, cycles)| (of.text(program.machine), cycles));
    resources.chain([("recurrence".to_owned(), report.bound.recurrence)]).collect()
}

/// Reports the demands on ports. All are met: an unmet demand is an error of the assembler.
fn write_timing(assembled: &AssembledProgram, out: &mut Out) -> Result<()> {
    for report in &assembled.timing {
        let cycles = |(name, first, last): &(String, u32, u32)| match first == last {
            true => format!("{name} {first}"),
            false => format!("{name} {first}…{last}"),
        };
        let ports = report.ports.iter().map(cycles).collect::<Vec<_>>().join(", ");
        let (demand, result) = timing_text(report);
        writeln!(out, "  {demand}: {result}; cycles: {ports}")?;
    }
    Ok(())
}

/// Reports the numbers of contracted products and sums, by instruction.
fn write_contractions(assembled: &AssembledProgram, out: &mut Out) -> Result<()> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for contraction in &assembled.contractions {
        *counts.entry(contraction.mnemonic).or_default() += 1;
    }
    if !counts.is_empty() {
        let counts: Vec<String> =
            counts.iter().map(|(mnemonic, count)| format!("{count} {mnemonic}")).collect();
        writeln!(
            out,
            "contracted: {} products fused into sums ({})",
            assembled.contractions.len(),
            counts.join(", ")
        )?;
    }
    Ok(())
}

/// Reports operations whose slot does not write the bank of their destination, with the assembler's remedy.
fn write_adjustments(assembled: &AssembledProgram, out: &mut Out) -> Result<()> {
    let adjustments = &assembled.adjustments;
    let Some(longest) = adjustments.iter().map(|one| one.register.chars().count()).max() else {
        return Ok(());
    };
    let width = longest.clamp(12, 40);
    writeln!(out, "{:<1$} bank   written by several slots", "registers", width + 2)?;
    for Adjustment { register, bank, mnemonic, location, transfer } in adjustments {
        let place = location.map_or(String::new(), |at| format!("{}: ", assembled.program.place_text(at)));
        writeln!(out, "  {register:<width$} {bank:<6} {place}`{mnemonic}` {transfer}")?;
    }
    Ok(())
}

/// Describes a demand, and the margin by which it is met.
fn timing_text(report: &TimingReport) -> (String, String) {
    match (report.kind, report.window) {
        (DemandKind::Deadline(cycle), _) => (format!("deadline {cycle}"), "met".to_owned()),
        (DemandKind::Order, _) => ("order".to_owned(), "met".to_owned()),
        (DemandKind::Late(_), Some((window, bound))) => (
            "late".to_owned(),
            format!("{window} cycles from the first read to the last output, bound {bound}"),
        ),
        (DemandKind::Late(_), None) => ("late".to_owned(), "no output depends on it".to_owned()),
    }
}

/// Lower bounds of a block: its critical path, and the most heavily used slot, unit, and group of slots and units with shared functions.
fn bounds_text(block: &BlockReport, program: &Program) -> String {
    let resources = resources(block);
    // Of equal maxima, take the first.
    let most = |kind: fn(&Resources) -> bool| {
        let found = resources.iter().rev().filter(|(of, _)| kind(of)).max_by_key(|(_, cycles)| *cycles);
        found.map_or(String::new(), |(of, cycles)| format!(", {} {cycles}", of.text(program.machine)))
    };
    let kinds: [fn(&Resources) -> bool; 4] = [
        |of| matches!(of, Resources::Slots(slots) if slots.len() == 1),
        |of| matches!(of, Resources::Units(units) if units.len() == 1),
        |of| matches!(of, Resources::Slots(slots) if slots.len() > 1),
        |of| matches!(of, Resources::Units(units) if units.len() > 1),
    ];
    let together = match block.bound.windows {
        0 => String::new(),
        windows => format!(", together {windows}"),
    };
    format!("chain {}{}{together}", block.bound.critical_path, kinds.map(most).concat())
}

/// Lower bound that each resource imposes on a block: slots, units, then groups.
fn resources(block: &BlockReport) -> Vec<(Resources, u32)> {
    let bound = &block.bound;
    let slots = SlotIndex::all().zip(&bound.slots);
    let slots = slots.map(|(slot, cycles)| (Resources::Slots(Slots::of(slot)), *cycles));
    let units = (0..).zip(&bound.units).map(|(unit, cycles)| (Resources::Units(vec![unit]), *cycles));
    let shared = bound.shared.iter().map(|shared| (shared.resources.clone(), shared.cycles));
    slots.chain(units).chain(shared).collect()
}

/// Description of the tightest bound.
fn bound_text(block: &BlockReport, program: &Program) -> String {
    let bound = block.bound.cycles();
    if block.bound.critical_path == bound {
        return "the chain of dependent operations".to_owned();
    }
    let found = resources(block).into_iter().find(|(_, cycles)| *cycles == bound);
    found.map_or("chains and slots together".to_owned(), |(of, _)| of.text(program.machine))
}

/// Cost of spilled values in a block, as JSON.
fn spills_json(assembled: &AssembledProgram, spills: &Spills) -> Value {
    let value = |value: &SpilledValue| {
        json!({
            "name": value.name,
            "bank": value.bank,
            "place": value.location.map(|at| assembled.program.place_text(at)),
            "word": value.word,
            "loads": value.loads,
        })
    };
    json!({
        "block": block_name(&assembled.program, &assembled.blocks[spills.block]),
        "values": spills.values.iter().map(value).collect::<Vec<_>>(),
        "operations": spills.operations(),
        "cycles": spills.cycles,
    })
}

fn messages(diagnostics: &Diagnostics) -> Result<Value> {
    Ok(serde_json::to_value(diagnostics.messages())?)
}

/// Schedule of a block with its bounds, as JSON.
fn block_json(program: &Program, block: &BlockReport) -> Value {
    let shared = |shared: &SharedBound| json!({ "resources": shared.resources.text(program.machine), "cycles": shared.cycles });
    json!({
        "name": block_name(program, block),
        "address": block.address,
        "operations": block.operations,
        "bundles": block.bundles,
        "cycles": block.cycles,
        "bound": block.bound.cycles(),
        "bound_set_by": bound_text(block, program),
        "bounds": {
            "critical_path": block.bound.critical_path,
            "slots": block.bound.slots,
            "units": block.bound.units,
            "shared": block.bound.shared.iter().map(shared).collect::<Vec<_>>(),
            "together": block.bound.windows,
        },
    })
}

/// A demand on ports with its result, as JSON.
fn timing_json(report: &TimingReport) -> Value {
    let (demand, result) = timing_text(report);
    let port =
        |(name, first, last): &(String, u32, u32)| json!({ "name": name, "first": first, "last": last });
    json!({
        "section": if report.period { "period" } else { "once" },
        "demand": demand,
        "result": result,
        "window": report.window.map(|(window, _)| window),
        "window_bound": report.window.map(|(_, bound)| bound),
        "ports": report.ports.iter().map(port).collect::<Vec<_>>(),
    })
}

/// Transfer of an operation's result to another bank, as JSON.
fn adjustment_json(program: &Program, one: &Adjustment) -> Value {
    let (made, details) = match one.transfer {
        Transfer::Preset(bits) => ("preset", json!({ "bits": bits })),
        Transfer::Rematerialised(mnemonic) => ("operation", json!({ "mnemonic": mnemonic })),
        Transfer::Copy { address, alone, cycles } => {
            ("copy", json!({ "address": address, "alone": alone, "cycles": cycles }))
        }
    };
    json!({
        "register": one.register,
        "bank": one.bank,
        "mnemonic": one.mnemonic,
        "place": one.location.map(|at| program.place_text(at)),
        "made": made,
        "details": details,
    })
}

/// Form of a counted loop, as JSON.
fn counted_json(one: &CountedLoop) -> Value {
    let (iterations, exact) = (one.count.most(), one.count.is_exact());
    json!({
        "name": one.name,
        "place": format!("{}:{}", one.file, one.line),
        "iterations": iterations,
        "exact": exact,
        "rolled": !matches!(one.form, LoopForm::Unrolled(_)),
        "written_out": match one.form {
            LoopForm::Unrolled(why) => Some(why.to_string()),
            LoopForm::Rolled(_) => None,
        },
        "unrolled": match one.form {
            LoopForm::Unrolled(_) => iterations,
            LoopForm::Rolled(unroll) => unroll,
        },
    })
}

fn result_json(assembled: &AssembledProgram, image: Option<&Path>) -> Result<Value> {
    let program = &assembled.program;
    let selection = |one: &Selection| {
        json!({
            "place": one.location.map(|at| program.place_text(at)),
            "registers": one.registers,
        })
    };
    let pipelined = |one: &LoopReport| {
        json!({
            "place": one.location.map(|at| program.place_text(at)),
            "iterations": one.iterations.most(),
            "exact": one.iterations.is_exact(),
            "interval": one.interval,
            "stages": one.stages,
            "bounds": loop_bounds(one, program).into_iter().collect::<BTreeMap<_, _>>(),
        })
    };
    let plain = |one: &PlainLoop| json!({ "place": one.location.map(|at| program.place_text(at)), "reason": one.reason });
    let contraction = |one: &Contraction| {
        json!({
            "mnemonic": one.mnemonic,
            "product": one.product.map(|at| program.place_text(at)),
            "sum": one.sum.map(|at| program.place_text(at)),
        })
    };
    Ok(json!({
        "machine": program.machine.name,
        "image": image.map(|path| path.display().to_string()),
        "bundles": program.bundles(),
        "words": program.code.len(),
        "constants": program.constants.len(),
        "data_words": program.data.len(),
        "blocks": assembled.blocks.iter().map(|one| block_json(program, one)).collect::<Vec<_>>(),
        "counted_loops": assembled.counted_loops.iter().map(counted_json).collect::<Vec<_>>(),
        "selections": assembled.selections.iter().map(selection).collect::<Vec<_>>(),
        "pipelined_loops": assembled.loops.iter().map(pipelined).collect::<Vec<_>>(),
        "plain_loops": assembled.plain_loops.iter().map(plain).collect::<Vec<_>>(),
        "contractions": assembled.contractions.iter().map(contraction).collect::<Vec<_>>(),
        "timing": assembled.timing.iter().map(timing_json).collect::<Vec<_>>(),
        "adjustments": assembled.adjustments.iter().map(|one| adjustment_json(program, one)).collect::<Vec<_>>(),
        "spills": assembled.spills.iter().map(|one| spills_json(assembled, one)).collect::<Vec<_>>(),
        "messages": messages(&assembled.warnings)?,
    }))
}
