//! `takt live … shadow`: what a board computes, beside the emulator with the same inputs.

pub(crate) mod system;

use crate::files::Out;
use crate::live::{find, shown};
use crate::progress::progress;
use anyhow::{Context, Result, bail};
use std::fmt::Write as _;
use std::io::Write;
use takt_board::Host;
use takt_board::protocol::Line;
use takt_emu::Emulator;
use takt_isa::program::Port;
use takt_isa::{Program, Type};

/// A port on the board and in the emulator.
struct Watched<'a> {
    port: &'a Port,
    address: u16,
    ty: Type,
}

fn watched<'a>(program: &'a Program, ports: &'a [Port]) -> Result<Vec<Watched<'a>>> {
    let application = program.into();
    let watch = |port: &'a Port| {
        let (address, ty) = find(&application, &port.name)?;
        Ok(Watched { port, address, ty })
    };
    let mut ports = ports.iter().map(watch).collect::<Result<Vec<_>>>()?;
    // In the order of their numbers, of which those that follow each other are read together.
    ports.sort_by_key(|port| port.address);
    Ok(ports)
}

fn read<L: Line>(host: &mut Host<L>, ports: &[Watched<'_>]) -> Result<Vec<u32>> {
    let mut words = Vec::with_capacity(ports.len());
    for together in ports.chunk_by(|a, b| a.address + 1 == b.address) {
        words.extend(host.read(together[0].address, together.len())?);
    }
    Ok(words)
}

/// The state of the board, if it does not wait.
fn stopped<L: Line>(host: &mut Host<L>) -> Result<Option<&'static str>> {
    let status = host.status()?;
    Ok(match status {
        s if s.fault() => Some("has stopped with a fault"),
        s if s.halted() => Some("has halted"),
        _ => None,
    })
}

/// Compares the next period.
fn compare<L: Line>(
    host: &mut Host<L>,
    emulator: &mut Emulator,
    inputs: &[Watched<'_>],
    outputs: &[Watched<'_>],
) -> Result<()> {
    // A port is read once the program waits: the step before this one is then over, too.
    host.settle()?;
    read(host, outputs)?;
    let before = host.register("periods")?;
    host.set("step", 1)?;
    host.settle()?;
    let live = read(host, outputs)?;
    // Between two ticks nothing changes these: they are what the period had.
    let given = read(host, inputs)?;
    for (port, bits) in inputs.iter().zip(&given) {
        emulator.set_input_bits(port.port.register, *bits)?;
    }
    let ran = emulator.run_period(&[]);
    match (stopped(host)?, ran) {
        (None, Ok(_)) => {}
        (Some(what), Err(error)) => bail!("the board {what}; the emulator: {error}"),
        (Some(what), Ok(_)) => bail!("the board {what}, the emulator goes on"),
        (None, Err(error)) => bail!("the board goes on; the emulator: {error}"),
    }
    if host.register("periods")? != before.wrapping_add(1) {
        bail!("the board did not run the period: is another host connected?");
    }
    for (port, bits) in outputs.iter().zip(live) {
        // A port that was never written may have any value.
        let Some(expected) = emulator.output_bits(port.port.register) else { continue };
        if expected != bits {
            let mut text = String::new();
            for (input, bits) in inputs.iter().zip(&given) {
                let _ = write!(text, ", {} = {}", input.port.name, shown(*bits, input.ty));
            }
            bail!(
                "output port `{}` is {} on the board, {} in the emulator{}",
                port.port.name,
                shown(bits, port.ty),
                shown(expected, port.ty),
                text.strip_prefix(", ").map_or_else(String::new, |text| format!("; inputs: {text}"))
            );
        }
    }
    Ok(())
}

/// Compares so many periods, from the program's beginning: it has been started anew and is held.
///
/// # Errors
/// The first difference, or what the board or the emulator stops at.
pub(crate) fn run<L: Line>(host: &mut Host<L>, program: &Program, periods: u32, out: &mut Out) -> Result<()> {
    let mut emulator = Emulator::new(program)?;
    let (inputs, outputs) = (watched(program, &program.inputs)?, watched(program, &program.outputs)?);
    let bar = progress(periods.into(), "periods", false);
    for period in 1..=periods {
        let same = compare(host, &mut emulator, &inputs, &outputs);
        if same.is_err() {
            bar.finish_and_clear();
        }
        same.with_context(|| format!("period {period}"))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    writeln!(
        out,
        "{periods} periods, {} input ports, {} output ports: no difference; the board is held",
        inputs.len(),
        outputs.len()
    )
    .context("the result cannot be written")
}
