//! `takt analyse`: where the cycles of one period went, bundle by bundle, and what would make it shorter.

use crate::fault;
use crate::files::{self, Out};
use crate::load::Load;
use crate::number;
use crate::output;
use crate::ports;
use crate::select::{OptionalMachine, SourceArguments};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::cmp::Reverse;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_analysis::picture::{Faster, Picture, Reassembled, gained};
use takt_analysis::{Link, Trace, WhatIf};
use takt_asm::schedule::BlockReport;
use takt_emu::{Emulator, Rows, Status};
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{Machine, Program, SlotIndex};

/// Show where the cycles of a period went: every bundle, every stall, the chain that sets the time.
///
/// Runs the program and looks at its last period; at a program without periods from reset to `halt`. Input ports are 0
/// unless --inputs says otherwise.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Analyse {
    /// Source or image; `-` is standard input.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; `-` is standard input.
    #[arg(long, value_name = "CSV")]
    inputs: Option<PathBuf>,
    /// Run so many periods and look at the last; 0 is what runs once [default: the rows of --inputs, else 2].
    #[arg(long, value_name = "N", value_parser = number::natural, allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Write the picture of the pipeline as a page for a browser, which needs nothing else; `-` is standard output.
    #[arg(long, value_name = "OUT")]
    html: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt analyse prog.s                     the second period: stalls, critical path, what a faster unit would bring
  takt analyse prog.s --html prog.html    the pipeline as a picture
  takt analyse prog.s --periods 0         what runs once
  takt analyse prog.s --inputs in.csv     the last period of recorded inputs";

/// Periods without `--inputs`.
const PERIODS: u64 = 2;
/// Periods that are run at most on the way to the one to look at.
const MOST_PERIODS: u64 = 1_000_000;
/// Lines of each list of the text; --json has all.
const SHOWN: usize = 12;

pub(crate) fn run(arguments: &Analyse, color: bool, out: &mut Out) -> Result<()> {
    let mut reads = vec![("FILE", arguments.file.as_path())];
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    let mut writes: Vec<_> = arguments.html.as_deref().map(|path| ("--html", path)).into_iter().collect();
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    let load = Load::new(arguments.machine.machine, color).with(&arguments.source);
    let loaded = load.with_source(&arguments.file)?;
    let program = &loaded.program;
    let rows = read_inputs(arguments, program)?;
    let followed = follow(arguments, program, &rows);
    let (trace, period) = followed.map_err(|error| fault::told(error, &loaded, color))?;
    let faster = faster(arguments, &load, program, &trace, &rows);
    let picture =
        Picture { faster, ..Picture::new(program, files::input_name(&arguments.file), period, trace) };
    if let Some(path) = &arguments.html {
        files::write(path, picture.html().as_bytes())?;
    }
    if arguments.json {
        output::json(&picture.json(), out)?;
    } else if !arguments.html.as_deref().is_some_and(files::is_dash) {
        text(&picture, out)?;
    }
    Ok(())
}

/// The inputs of the periods up to the one to look at.
fn read_inputs(arguments: &Analyse, program: &Program) -> Result<Rows> {
    let wanted = arguments.periods;
    if let Some(wanted) = wanted.filter(|wanted| *wanted > MOST_PERIODS) {
        bail!("{wanted} periods: at most {MOST_PERIODS} are run on the way to the one to look at");
    }
    let path = arguments.inputs.as_deref();
    // What runs once reads the first period's inputs.
    let most = wanted.map(|wanted| wanted.max(1)).or(path.map(|_| MOST_PERIODS));
    let rows = ports::rows(path, most, PERIODS, &program.inputs)?;
    if let (Some(path), Some(wanted)) = (path, wanted)
        && (rows.len() as u64) < wanted
    {
        let plural = if rows.len() == 1 { "" } else { "s" };
        bail!("{} has {} row{plural}, so there is no such period", files::input_name(path), rows.len());
    }
    Ok(rows)
}

/// Runs the program and follows the last period asked for; its number, 0 being what runs once.
fn follow(arguments: &Analyse, program: &Program, rows: &Rows) -> Result<(Trace, u64)> {
    let wanted = arguments.periods.unwrap_or(rows.len() as u64);
    let mut emulator = Emulator::new(program)?;
    let set = |emulator: &mut Emulator, period: u64| -> Result<()> {
        for &(register, bits) in rows.get(period.saturating_sub(1) as usize).into_iter().flatten() {
            emulator.set_input_bits(register, bits)?;
        }
        emulator.set_cycle_limit(emulator.now() + crate::run::PERIOD_LIMIT);
        Ok(())
    };
    set(&mut emulator, 0)?;
    let mut trace = takt_analysis::trace(&mut emulator)?;
    let mut period = 0;
    while period < wanted && !matches!(emulator.status(), Status::Halted { .. }) {
        period += 1;
        set(&mut emulator, period)?;
        let which = || format!("period {period}");
        if period < wanted {
            emulator.run_period(&[]).with_context(which)?;
        } else {
            trace = takt_analysis::trace(&mut emulator).with_context(which)?;
        }
    }
    if period < wanted && (arguments.periods.is_some() || period > 0) {
        bail!("the program halts before period {wanted}; --periods {period} looks at the last");
    }
    Ok((trace, period))
}

fn faster(arguments: &Analyse, load: &Load, program: &Program, trace: &Trace, rows: &Rows) -> Vec<Faster> {
    // Standard input has been read; an image has no source.
    let source = Some(&arguments.file).filter(|file| !files::is_dash(file));
    let source = source.and_then(|file| Load::source(file).ok());
    let reassembled = |what: &WhatIf| {
        let machine = Some(quicker(program.machine, what.unit));
        let assembled = Load { machine, ..load.clone() }.assemble(&arguments.file, source.clone()?).ok()?;
        let found = follow(arguments, &assembled.program, rows).ok()?.0;
        let visits = |address| found.issues.iter().filter(|issue| issue.address == address).count() as Cycle;
        let spare = |block: &BlockReport| Cycle::from(block.cycles.saturating_sub(block.bound.cycles()));
        let spare: Cycle = assembled.blocks.iter().map(|block| visits(block.address) * spare(block)).sum();
        Some(Reassembled { cycles: found.cycles, least: found.cycles.saturating_sub(spare) })
    };
    trace.what_if(program).into_iter().map(|what| Faster { reassembled: reassembled(&what), what }).collect()
}

/// A machine with one cycle less in a unit, or in the front end. It is never given back: there are as many as units.
fn quicker(machine: &Machine, unit: Option<(SlotIndex, u8)>) -> &'static Machine {
    let mut slots = machine.slots.to_vec();
    let mut refill = machine.refill;
    match unit {
        Some((slot, unit)) => {
            let slot = &mut slots[slot.index()];
            let mut units = slot.units.to_vec();
            let row = &mut units[usize::from(unit)];
            row.latency -= 1;
            row.interval = row.interval.saturating_sub(1).max(1);
            slot.units = Box::leak(units.into());
        }
        None => refill -= 1,
    }
    Box::leak(Box::new(Machine { slots: Box::leak(slots.into()), refill, ..*machine }))
}

fn text(picture: &Picture<'_>, out: &mut Out) -> Result<()> {
    let Picture { program, trace, .. } = picture;
    let issues = &trace.issues;
    let what =
        if picture.period == 0 { "what runs once".to_owned() } else { format!("period {}", picture.period) };
    let (machine, cycles) = (program.machine.name, trace.cycles);
    writeln!(out, "{what} on {machine}: {cycles} cycles, {} bundles", issues.len())?;
    let share = |count: u64| 100.0 * count as f64 / cycles.max(1) as f64;
    let slots = picture.slots().into_iter();
    let slots: Vec<String> =
        slots.map(|(name, count)| format!("{name} {count} ({:.0} %)", share(count))).collect();
    writeln!(out, "operations by slot, and their share of the cycles: {}", slots.join(", "))?;

    let mut stalls: Vec<(usize, Cause, u32)> = Vec::new();
    for (i, issue) in issues.iter().enumerate() {
        stalls.extend(issue.stalls.iter().map(|&(cause, cycles)| (i, cause, cycles)));
    }
    stalls.sort_by_key(|&(i, _, cycles)| (Reverse(cycles), i));
    let stalled: u32 = stalls.iter().map(|(_, _, cycles)| cycles).sum();
    writeln!(out, "\nstalls: {}, {stalled} cycles; the longest:", stalls.len())?;
    for &(i, cause, cycles) in stalls.iter().take(SHOWN) {
        let (at, what) = (program.bundle_text(issues[i].address), program.cause_text(cause));
        writeln!(out, "  {cycles:>5}  before cycle {:<5} {at}: {what}", picture.cycle(i))?;
    }

    let chain: Cycle = picture.chain.iter().map(|link| link.cycles).sum();
    writeln!(out, "\nthe chain that sets the time: {} links, {chain} cycles, through", picture.chain.len())?;
    for (kind, cycles) in picture.chain_by_kind() {
        writeln!(out, "  {cycles:>5}  {kind}")?;
    }
    let mut links: Vec<&Link> = picture.chain.iter().filter(|link| link.cycles > 1).collect();
    links.sort_by_key(|link| (Reverse(link.cycles), link.to));
    links.truncate(SHOWN);
    links.sort_by_key(|link| link.to);
    writeln!(out, "its longest links:")?;
    for link in links {
        let (to, how) = (program.bundle_text(issues[link.to].address), picture.link(link));
        writeln!(out, "  {:>5}  to cycle {:<5} {to}: {how}", link.cycles, picture.cycle(link.to))?;
    }

    faster_text(picture, out)
}

/// What a faster unit would bring; where that is more cycles than today, why.
fn faster_text(picture: &Picture<'_>, out: &mut Out) -> Result<()> {
    let today = picture.trace.cycles;
    writeln!(out, "\none cycle less in      as it is      reassembled")?;
    let gain = |new: Cycle| format!("{new} ({:+})", new.cast_signed() - today.cast_signed());
    for Faster { what, reassembled } in &picture.faster {
        let reassembled =
            reassembled.as_ref().map_or_else(|| "-".to_owned(), |reassembled| gain(reassembled.cycles));
        writeln!(out, "  {:<16} {:>12} {reassembled:>16}", picture.unit(what.unit), gain(what.cycles))?;
    }
    let worse: Vec<&WhatIf> =
        picture.faster.iter().map(|faster| &faster.what).filter(|what| what.cycles > today).collect();
    if !worse.is_empty() {
        writeln!(out, "more as it is: in bundles packed for today's latencies, sooner results meet others")?;
    }
    for what in worse {
        let stalls: Vec<String> = gained(what).map(|(kind, more)| format!("{kind} {more:+}")).collect();
        writeln!(out, "  {:<16} stalled cycles: {}", picture.unit(what.unit), stalls.join(", "))?;
    }
    let worse = || picture.faster.iter().filter_map(|faster| Some((faster, faster.reassembled.as_ref()?)));
    let worse = || worse().filter(|(_, reassembled)| reassembled.cycles > today);
    if worse().next().is_some() {
        writeln!(
            out,
            "more when reassembled: the search ended with a longer schedule, which proves nothing"
        )?;
    }
    for (faster, reassembled) in worse() {
        writeln!(
            out,
            "  {:<16} none takes fewer than {}",
            picture.unit(faster.what.unit),
            reassembled.least
        )?;
    }
    Ok(())
}
