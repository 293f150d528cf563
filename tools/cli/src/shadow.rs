// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt live … shadow`: a board's outputs beside those of the emulator with the same inputs, period by period.

use crate::files::Out;
use crate::live::{find, shown};
use crate::progress::progress;
use anyhow::{Context, Result, bail};
use indicatif::ProgressFinish;
use std::fmt::Write as _;
use std::io::Write;
use takt_board::protocol::Line;
use takt_board::{Application, Host};
use takt_emu::Emulator;
use takt_isa::timing::Cycle;
use takt_isa::{Register, Type};
use takt_system::{Description, End, System};

/// Cycles within which every core is to wait for the first time.
const START: u64 = 1 << 32;

/// A value on the board: a port, or a host's end of a link.
struct Watched {
    name: String,
    address: u16,
    ty: Type,
    core: usize,
    register: Register,
}

/// The emulator beside the board.
enum Shadow {
    Program(Box<Emulator>),
    /// A system, the snapshots that the host publishes, and the cycle of its next turn.
    System(Box<System>, Vec<usize>, Cycle),
}

impl Shadow {
    /// From the beginning, as the board is.
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

    /// Runs a period, or a base tick, with these inputs.
    fn run(&mut self, inputs: &[Watched], bits: &[u32]) -> Result<()> {
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

    /// A port's value; `None` if it was never written.
    fn output(&self, port: &Watched) -> Option<u32> {
        match self {
            Shadow::Program(emulator) => emulator.output_bits(port.register),
            Shadow::System(system, ..) => system.core(port.core).output_bits(port.register),
        }
    }
}

/// The output ports of every core.
fn outputs(application: &Application<'_>) -> Result<Vec<Watched>> {
    let mut all = Vec::new();
    for (core, known) in application.description().cores.iter().enumerate() {
        for port in &known.program.outputs {
            let name = application.name(core, &port.name);
            let (address, ty) = find(application, &name)?;
            all.push(Watched { name, address, ty, core, register: port.register });
        }
    }
    Ok(all)
}

/// The input ports of a program, or the host's ends of a system's links.
fn inputs(application: &Application<'_>) -> Result<Vec<Watched>> {
    let program = &application.description().cores[0].program;
    let names: Vec<(String, Register)> = match application.is_program() {
        true => program.inputs.iter().map(|port| (port.name.clone(), port.register)).collect(),
        false => {
            let ends = application.endpoints().inputs.iter();
            ends.map(|end| (end.name.clone(), Register::ZERO)).collect()
        }
    };
    let watched = |(name, register): (String, Register)| {
        let (address, ty) = find(application, &name)?;
        Ok(Watched { name, address, ty, core: 0, register })
    };
    names.into_iter().map(watched).collect()
}

/// Values from the board; those at addresses that follow each other are read together.
fn read<L: Line>(host: &mut Host<L>, all: &[Watched]) -> Result<Vec<u32>> {
    let mut addresses: Vec<u16> = all.iter().map(|one| one.address).collect();
    addresses.sort_unstable();
    let mut words = Vec::with_capacity(addresses.len());
    for together in addresses.chunk_by(|a, b| a + 1 == *b) {
        words.extend(host.read(together[0], together.len())?);
    }
    let word = |one: &Watched| addresses.binary_search(&one.address).map_or(0, |at| words[at]);
    Ok(all.iter().map(word).collect())
}

/// The part of the board that does not wait for its next period, and its state.
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
            // The other cores of a system go on.
            s if s.halted() && application.is_program() => return Ok(Some(format!("{who} has halted"))),
            _ => {}
        }
    }
    Ok(None)
}

/// Compares so many periods, or base ticks of a system, from the beginning: the board has been started anew and is
/// held. FIFOs from the host stay empty.
///
/// # Errors
/// The first difference, or what the board or the emulator stops at.
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
    // A bar that is dropped is cleared.
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
    inputs: &[Watched],
    outputs: &[Watched],
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
    match (stopped(host, application)?, shadow.run(inputs, &given)) {
        (None, Ok(())) => {}
        (Some(stopped), Err(error)) => bail!("{stopped}; the emulator: {error}"),
        (Some(stopped), Ok(())) => bail!("{stopped}, the emulator goes on"),
        (None, Err(error)) => bail!("the board goes on; the emulator: {error}"),
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
            let _ = write!(text, "{before}{} = {}", input.name, shown(*bits, input.ty));
        }
        bail!(
            "output port `{}` is {} on the board, {} in the emulator{text}",
            port.name,
            shown(bits, port.ty),
            shown(expected, port.ty)
        );
    }
    Ok(())
}
