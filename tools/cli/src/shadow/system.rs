//! The same for a system: every output port of every core, a base tick at a time.

use super::find;
use crate::files::Out;
use crate::live::shown;
use crate::progress::progress;
use anyhow::{Context, Result, bail};
use indicatif::ProgressFinish;
use std::fmt::Write as _;
use std::io::Write;
use takt_board::Host;
use takt_board::endpoints::Endpoints;
use takt_board::protocol::{DRIVEN, Line};
use takt_isa::{Register, Type};
use takt_system::{Description, End, System};

/// Cycles within which every core is to wait for the first time.
const START: u64 = 1 << 32;

/// An output port of a core.
struct Watched {
    name: String,
    core: usize,
    register: Register,
    address: u16,
    ty: Type,
}

fn watched(description: &Description) -> Result<Vec<Watched>> {
    let (application, mut all) = (description.into(), Vec::new());
    for (core, known) in description.cores.iter().enumerate() {
        for port in &known.program.outputs {
            let name = format!("{}.{}", known.name, port.name);
            let (address, ty) = find(&application, &name)?;
            all.push(Watched { name, core, register: port.register, address, ty });
        }
    }
    // In the order of their addresses, of which those that follow each other are read together.
    all.sort_by_key(|port| port.address);
    Ok(all)
}

fn faulted<L: Line>(host: &mut Host<L>) -> Result<Option<usize>> {
    for core in 0..host.cores {
        if host.status_of(core)?.fault() {
            return Ok(Some(core));
        }
    }
    Ok(None)
}

/// Compares so many base ticks, from the beginning: the board has been started anew and is held. FIFOs from the host stay empty.
///
/// # Errors
/// The first difference, or what the board or the emulator stops at.
pub(crate) fn run<L: Line>(
    host: &mut Host<L>,
    description: &Description,
    ticks: u32,
    out: &mut Out,
) -> Result<()> {
    let mut system = System::new(description)?;
    let start =
        system.run_to_start(START)?.context("every core halts before its first period, or does not wait")?;
    let (ends, outputs) = (Endpoints::of(description), watched(description)?);
    let snapshots = description.links.iter().enumerate();
    let snapshots = snapshots.filter(|(_, link)| link.is_snapshot() && link.from == End::Host);
    let snapshots: Vec<usize> = snapshots.map(|(number, _)| number).collect();
    let mut next = start - description.lead();
    host.settle()?;
    // A bar that is dropped is cleared.
    let bar = progress(ticks.into(), "base ticks", false).with_finish(ProgressFinish::AndClear);
    for tick in 1..=ticks {
        host.set("step", 1)?;
        host.settle().with_context(|| format!("base tick {tick}"))?;
        let mut live = Vec::with_capacity(outputs.len());
        for together in outputs.chunk_by(|a, b| a.address + 1 == b.address) {
            live.extend(host.read(together[0].address, together.len())?);
        }
        // Between two base ticks nothing changes these: they are what the periods had.
        let given = host.read(DRIVEN, ends.inputs.len())?;
        let mut emulated = || -> Result<()> {
            system.run_until(next)?;
            for (input, bits) in ends.inputs.iter().zip(&given) {
                system.set_input(&input.name, *bits)?;
            }
            for link in &snapshots {
                system.publish(*link)?;
            }
            next += description.tick;
            Ok(system.run_until(next)?)
        };
        match (faulted(host)?, emulated()) {
            (None, Ok(())) => {}
            (Some(core), Err(error)) => {
                bail!(
                    "base tick {tick}: core {} of the board has stopped with a fault; the emulator: {error}",
                    description.cores[core].name
                )
            }
            (Some(core), Ok(())) => {
                bail!(
                    "base tick {tick}: core {} of the board has stopped with a fault, the emulator goes on",
                    description.cores[core].name
                )
            }
            (None, Err(error)) => bail!("base tick {tick}: the board goes on; the emulator: {error}"),
        }
        for (port, bits) in outputs.iter().zip(live) {
            // A port that was never written may have any value.
            let Some(expected) = system.core(port.core).output_bits(port.register) else { continue };
            if expected != bits {
                let mut text = String::new();
                for (input, bits) in ends.inputs.iter().zip(&given) {
                    let _ = write!(text, ", {} = {}", input.name, shown(*bits, input.ty));
                }
                bail!(
                    "base tick {tick}: output port `{}` is {} on the board, {} in the emulator{}",
                    port.name,
                    shown(bits, port.ty),
                    shown(expected, port.ty),
                    text.strip_prefix(", ").map_or_else(String::new, |text| format!("; inputs: {text}"))
                );
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let inputs = ends.inputs.len();
    writeln!(
        out,
        "{ticks} base ticks, {inputs} inputs, {} output ports: no difference; the board is held",
        outputs.len()
    )
    .context("the result cannot be written")
}
