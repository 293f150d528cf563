// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommand `shadow` of `takt live`: compares a board's outputs with the emulator's for the same inputs, period by period.

use crate::terminal::files::Out;
use crate::terminal::progress::progress;
use anyhow::{Context, Result, bail};
use indicatif::ProgressFinish;
use std::fmt::Write as _;
use std::io::Write;
use takt_board::protocol::Line;
use takt_board::{Application, Host};
use takt_emu::Emulator;
use takt_isa::timing::Cycle;
use takt_isa::{Register, Type};
use takt_live::value::{find, value_text};
use takt_system::{Description, End, System};

/// Cycle limit until all cores reach their first `wait`.
const START: u64 = 1 << 32;

/// A value on the board: a port, or an end of a link at the host.
struct WatchedValue {
    name: String,
    address: u16,
    ty: Type,
    core: usize,
    register: Register,
}

/// Emulator that shadows the board.
enum Shadow {
    Program(Box<Emulator>),
    /// A system, the snapshots that the host publishes, and the cycle of the host's next turn.
    System(Box<System>, Vec<usize>, Cycle),
}

impl Shadow {
    /// Starts a shadow at the beginning of the program, where the board is.
    fn start(application: &Application<'_>) -> Result<Shadow> {
        let description = application.description();
        if application.is_program() {
            return Ok(Shadow::Program(Box::new(Emulator::new(&description.cores[0].program)?)));
        }
        let mut system = System::new(description)?;
        let start = system
            .run_to_start(START)?
            .context("every core halts before its first period, or does not wait")?;
        let links = description.links.iter().enumerate();
        let snapshots = links.filter(|(_, link)| link.is_snapshot() && link.from == End::Host);
        let snapshots = snapshots.map(|(number, _)| number).collect();
        Ok(Shadow::System(Box::new(system), snapshots, start - description.lead()))
    }

    /// Runs one period or base tick with these inputs.
    fn run(&mut self, inputs: &[WatchedValue], bits: &[u32]) -> Result<()> {
        let inputs = inputs.iter().zip(bits);
        match self {
            Shadow::Program(emulator) => {
                for (input, bits) in inputs {
                    emulator.set_input_bits(input.register, *bits)?;
                }
                emulator.run_period(&[])?;
            }
            Shadow::System(system, snapshots, next) => {
                system.run_until(*next)?;
                for (input, bits) in inputs {
                    system.set_input(&input.name, *bits)?;
                }
                for link in snapshots {
                    system.publish(*link)?;
                }
                *next += system.description().tick;
                system.run_until(*next)?;
            }
        }
        Ok(())
    }

    /// Value of a port; `None` before its first write.
    fn output(&self, port: &WatchedValue) -> Option<u32> {
        match self {
            Shadow::Program(emulator) => emulator.output_bits(port.register),
            Shadow::System(system, ..) => system.core(port.core).output_bits(port.register),
        }
    }
}

/// Output ports of all cores.
fn outputs(application: &Application<'_>) -> Result<Vec<WatchedValue>> {
    let mut all = Vec::new();
    for (core, known) in application.description().cores.iter().enumerate() {
        for port in &known.program.outputs {
            let name = application.name(core, &port.name);
            let (address, ty) = find(application, &name)?;
            all.push(WatchedValue { name, address, ty, core, register: port.register });
        }
    }
    Ok(all)
}

/// Input ports of a program, or ends of a system's links at the host.
fn inputs(application: &Application<'_>) -> Result<Vec<WatchedValue>> {
    let program = &application.description().cores[0].program;
    let names: Vec<(String, Register)> = match application.is_program() {
        true => program.host_registers().map(|port| (port.name.clone(), port.register)).collect(),
        false => {
            let ends = application.endpoints().inputs.iter();
            ends.map(|end| (end.name.clone(), Register::ZERO)).collect()
        }
    };
    let watched = |(name, register): (String, Register)| {
        let (address, ty) = find(application, &name)?;
        Ok(WatchedValue { name, address, ty, core: 0, register })
    };
    names.into_iter().map(watched).collect()
}

/// Reads values from the board, combining consecutive addresses.
fn read<L: Line>(host: &mut Host<L>, all: &[WatchedValue]) -> Result<Vec<u32>> {
    let mut addresses: Vec<u16> = all.iter().map(|one| one.address).collect();
    addresses.sort_unstable();
    let mut words = Vec::with_capacity(addresses.len());
    for together in addresses.chunk_by(|a, b| a + 1 == *b) {
        words.extend(host.read(together[0], together.len())?);
    }
    let word = |one: &WatchedValue| addresses.binary_search(&one.address).map_or(0, |at| words[at]);
    Ok(all.iter().map(word).collect())
}

/// Part of the board that is not waiting for its next period, with a description of its state.
fn stopped<L: Line>(host: &mut Host<L>, application: &Application<'_>) -> Result<Option<String>> {
    let Description { cores, .. } = application.description();
    for (number, core) in cores.iter().enumerate() {
        let status = host.status_of(number)?;
        let who = match application.is_program() {
            true => "the board".to_owned(),
            false => format!("core {} of the board", core.name),
        };
        match status {
            s if s.fault() => return Ok(Some(format!("{who} has stopped with a fault"))),
            // In a system, the other cores continue.
            s if s.halted() && application.is_program() => return Ok(Some(format!("{who} has halted"))),
            _ => {}
        }
    }
    Ok(None)
}

/// Compares a number of periods or base ticks from the start, after a restart of the board, which is held. FIFOs from the host stay empty.
///
/// # Errors
/// The first difference, or the reason why board or emulator stopped.
pub(crate) fn run<L: Line>(
    host: &mut Host<L>,
    application: &Application<'_>,
    periods: u32,
    out: &mut Out,
) -> Result<()> {
    let (unit, ports) =
        if application.is_program() { ("period", "input ports") } else { ("base tick", "inputs") };
    let (inputs, outputs) = (inputs(application)?, outputs(application)?);
    let mut shadow = Shadow::start(application)?;
    // The bar is cleared on drop.
    let bar = progress(periods.into(), &format!("{unit}s"), false).with_finish(ProgressFinish::AndClear);
    for period in 1..=periods {
        let compared = compare(host, application, &mut shadow, &inputs, &outputs);
        compared.with_context(|| format!("{unit} {period}"))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    let (inputs, outputs) = (inputs.len(), outputs.len());
    writeln!(
        out,
        "{periods} {unit}s, {inputs} {ports}, {outputs} output ports: no difference; the board is held"
    )
    .context("the result cannot be written")
}

/// Compares the next period.
fn compare<L: Line>(
    host: &mut Host<L>,
    application: &Application<'_>,
    shadow: &mut Shadow,
    inputs: &[WatchedValue],
    outputs: &[WatchedValue],
) -> Result<()> {
    // A port read waits until the program waits, so the previous step is complete.
    host.settle()?;
    read(host, outputs)?;
    let before = host.register("periods")?;
    host.set("step", 1)?;
    host.settle()?;
    let live = read(host, outputs)?;
    // Inputs do not change between two ticks, so these are the inputs of the period.
    let given = read(host, inputs)?;
    match (stopped(host, application)?, shadow.run(inputs, &given)) {
        (None, Ok(())) => {}
        (Some(stopped), Err(error)) => bail!("{stopped}; the emulator has stopped too: {error}"),
        (Some(stopped), Ok(())) => bail!("{stopped}, but the emulator continues"),
        (None, Err(error)) => bail!("the board continues, but the emulator has stopped: {error}"),
    }
    if application.is_program() && host.register("periods")? != before.wrapping_add(1) {
        bail!("the board did not run the period: is another host connected?");
    }
    for (port, bits) in outputs.iter().zip(live) {
        // A port that was never written may have any value.
        let Some(expected) = shadow.output(port).filter(|expected| *expected != bits) else { continue };
        let mut text = String::new();
        for (i, (input, bits)) in inputs.iter().zip(&given).enumerate() {
            let before = if i == 0 { "; inputs: " } else { ", " };
            let _ = write!(text, "{before}{} = {}", input.name, value_text(*bits, input.ty));
        }
        bail!(
            "output port `{}` is {} on the board, {} in the emulator{text}",
            port.name,
            value_text(bits, port.ty),
            value_text(expected, port.ty)
        );
    }
    Ok(())
}
