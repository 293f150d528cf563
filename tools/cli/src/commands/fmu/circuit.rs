// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt fmu --circuit`: the circuit of a board in Verilator behind the interface of an FMU.

use super::{ToFmu, count};
use crate::commands::board::Target;
use crate::commands::board::pins::Pins;
use crate::run::application::Application as Carried;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::output::Failure;
use crate::terminal::progress::DelayedActivity;
use anyhow::{Context, Result, anyhow, ensure};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use takt_board::host::Status;
use takt_board::protocol::{self, ENABLE, HOLD, RUN};
use takt_board::simulation::Packed;
use takt_board::top::RESET;
use takt_board::{Application, Board, Wiring};
use takt_fmu::circuit::{Circuit, Encoder, HostPort, InputPin, PortType, Requests};
use takt_fmu::{Causality, Fmu, Instance, Library, Model, Platform, Settings};
use takt_isa::{Program, Type};

/// Wall-clock time of the run that measures the rate, and its limit in periods.
const RUN_TIME: Duration = Duration::from_secs(1);
const RUN_PERIODS: u32 = 100_000;
/// Number of causes for which outputs become safe.
const CAUSES: u32 = 8;

/// Rejects options whose values come from the wiring.
fn refuse(arguments: &ToFmu) -> Result<()> {
    for (option, given, why) in [
        ("--period", arguments.period.is_some(), "a step is the wiring's `period`"),
        ("--clock", arguments.clock.is_some(), "the clock is the wiring's `clock`"),
    ] {
        if given {
            return Err(Failure::Usage(format!("{option} cannot be used with --circuit: {why}")).into());
        }
    }
    Ok(())
}

pub(super) fn run(arguments: &ToFmu, color: bool, out: &mut Out) -> Result<()> {
    refuse(arguments)?;
    let libraries = libraries(arguments)?;
    let target = Target {
        board: arguments.board.clone(),
        wiring: arguments.wiring.clone(),
        program: arguments.file.clone(),
        machine: arguments.machine.clone(),
        source: arguments.source.clone(),
        parameters: arguments.parameters.clone(),
    };
    let (board, wiring, carried) = target.read(color, true)?;
    let folder = takt_cache::folder()?.join(format!("fmu-{}", std::process::id()));
    let mut write = || -> Result<()> {
        let program = match &carried {
            Carried::Program(loaded) => Some(&loaded.program),
            Carried::System(_) => None,
        };
        let model = model(&board, &wiring, &carried.on_board(), program, &folder)?;
        let sources: Vec<_> = carried.programs().iter().map(|program| program.sources.as_slice()).collect();
        let model = model.with_units(&sources);
        let name = arguments.name();
        let bytes = Fmu { model: &model, name: &name, fmi: arguments.fmi.into(), libraries: &libraries }
            .to_bytes()?;
        // Before the file is written, so that no FMU remains that does not run.
        let resources = folder.join("resources");
        model.write(&resources).with_context(|| format!("cannot write {}", resources.display()))?;
        let rate = rate(&resources)?;
        files::write(&arguments.output, &bytes)?;
        if files::is_dash(&arguments.output) {
            return Ok(());
        }
        let Settings { period, tick } = model.settings();
        writeln!(
            out,
            "{}: FMI {} for co-simulation on Linux, the circuit of {} in Verilator, {} inputs, {} outputs, a step of {period} s or {tick} \
             cycles",
            arguments.output.display(),
            arguments.fmi.number(),
            board.name,
            count(&model, Causality::Input),
            count(&model, Causality::Output),
        )?;
        writeln!(
            out,
            "{rate:.0} periods a second on this machine, in a run with inputs at rest: a second takes {:.3} s",
            1.0 / (rate * period)
        )?;
        Ok(())
    };
    let written = write();
    let _ = std::fs::remove_dir_all(&folder);
    written
}

/// The library for Linux, where alone a circuit runs.
fn libraries(arguments: &ToFmu) -> Result<Vec<Library>> {
    let (linux, others): (Vec<Library>, Vec<Library>) =
        arguments.libraries()?.into_iter().partition(|library| library.platform() == Platform::Linux);
    ensure!(
        arguments.library.is_empty() || others.is_empty(),
        "--library: with --circuit the FMU runs on Linux only; leave out the library for {}",
        others[0].platform().name()
    );
    Ok(linux)
}

/// Model of a board; `folder` takes files for the simulation.
fn model(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
    program: Option<&Program>,
    folder: &Path,
) -> Result<Model> {
    ensure!(
        wiring.uart,
        "an FMU's master starts the program over the UART, which the wiring leaves out (`uart = false`)"
    );
    let _waiting = DelayedActivity::new(format!("compiling the circuit for {}", board.name));
    let packed = Packed::new(board, wiring, application.clone(), folder)?;
    let ports = program.map_or(Vec::new(), |program| ports(wiring, program));
    let circuit = circuit(board, wiring, application, ports, &packed)?;
    let simulation = std::fs::read(&packed.program)
        .with_context(|| format!("cannot read {}", packed.program.display()))?;
    let files = packed.files.into_iter().map(|file| (file.name, file.text.into_bytes())).collect();
    let period = number::shortest(f64::from(wiring.period) / (wiring.clock * 1e6));
    let settings = Settings { period, tick: wiring.period.into() };
    Ok(Model::of_circuit(&circuit, simulation, files, settings)?)
}

/// Pins, files and host of a board.
fn circuit(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
    mut ports: Vec<HostPort>,
    packed: &Packed,
) -> Result<Circuit> {
    let pins = Pins::new(board, wiring, &[]);
    let index = |name: &String| packed.inputs.iter().position(|(input, _)| input == name);
    let encoders = pins.encoders().map(|(name, [a, b], start)| {
        let pins = index(&a).zip(index(&b)).with_context(|| format!("`{name}` has no pins"))?;
        Ok(Encoder { name: name.to_owned(), pins: pins.into(), start })
    });
    let mut encoders = encoders.collect::<Result<Vec<Encoder>>>()?;
    let unknown = |name: &str| anyhow!("the pin `{name}` of the circuit has no name in the wiring");
    let inputs = packed.inputs.iter().enumerate().map(|(at, (name, level))| {
        let turns = encoders.iter().any(|encoder| encoder.pins.contains(&at));
        let shown = pins.input_name(name).ok_or_else(|| unknown(name))?;
        Ok(InputPin { name: (!turns).then(|| shown.to_owned()), level: *level })
    });
    let inputs = inputs.collect::<Result<Vec<InputPin>>>()?;
    let outputs =
        packed.outputs.iter().map(|name| Ok(pins.output_name(name).ok_or_else(|| unknown(name))?.to_owned()));
    let outputs = outputs.collect::<Result<Vec<String>>>()?;
    // A signal may have the name of an encoder, and a port that of either.
    let mut taken: BTreeSet<String> = outputs.iter().cloned().collect();
    taken.extend(inputs.iter().filter_map(|input| input.name.clone()));
    for encoder in &mut encoders {
        if !taken.insert(encoder.name.clone()) {
            encoder.name.push_str(".count");
        }
    }
    for port in &mut ports {
        if taken.contains(&port.name) {
            port.name.push_str(".port");
        }
    }
    let cores = &application.description().cores;
    let core_name = |name: &String| if application.is_program() { String::new() } else { name.clone() };
    let cause = |bit| Status(1_u32 << (12 + bit)).causes().next().unwrap_or("another cause").to_owned();
    Ok(Circuit {
        board: board.name.clone(),
        reset: RESET,
        inputs,
        encoders,
        outputs,
        cores: cores.iter().map(|core| core_name(&core.name)).collect(),
        causes: (0..CAUSES).map(cause).collect(),
        trips: wiring.trips().map(|trip| trip.name.clone()).collect(),
        ports,
        requests: requests(wiring)?,
        files: packed.files.iter().map(|file| file.name.clone()).collect(),
    })
}

/// Input ports of a program that no peripheral drives.
fn ports(wiring: &Wiring, program: &Program) -> Vec<HostPort> {
    let driven: BTreeSet<&String> =
        wiring.peripherals.iter().flat_map(|peripheral| peripheral.reads.iter().flatten()).collect();
    let ports = program.inputs.iter().filter(|port| !driven.contains(&port.name));
    let ports = ports.filter_map(|port| {
        let address = protocol::INPUTS + program.machine.inputs.index(port.register)?.get();
        let ty = match port.ty {
            Type::F => PortType::Float,
            Type::I => PortType::Integer,
            Type::B => PortType::Bits,
        };
        let range = program.range(port.register).map(|range| [range.low, range.high]);
        Some(HostPort { name: port.name.clone(), port: port.name.clone(), ty, address, range })
    });
    let mut ports: Vec<HostPort> = ports.collect();
    ports.sort_by_key(|port| port.address);
    ports
}

/// Requests of the FMU's host.
fn requests(wiring: &Wiring) -> Result<Requests> {
    let address = |name: &str| {
        let register = protocol::REGISTERS.iter().find(|register| register.name == name);
        register.map(|register| register.address).with_context(|| format!("no register `{name}`"))
    };
    let control = address("control")?;
    let command = |number, bits| match wiring.autostart {
        true => Vec::new(),
        false => protocol::write(number, control, &[bits]),
    };
    // Numbers that differ from those before and after.
    let (hold, start) = (command(0x80, RUN | HOLD | ENABLE), command(0x81, RUN | ENABLE));
    let status = address("status")?;
    let ask = match wiring.host {
        0 => Vec::new(),
        _ => (0x82..=0x83).map(|number| protocol::read(number, status, 1)).collect(),
    };
    Ok(Requests { hold, start, ask, every: (wiring.host / 2).max(1) })
}

/// Periods a second of an unpacked FMU, with its inputs at rest.
fn rate(resources: &Path) -> Result<f64> {
    let model = Model::read(resources)?;
    let period = model.settings().period;
    let mut instance = Instance::new(Arc::new(model))?;
    instance.enter_initialisation(0.0)?;
    instance.exit_initialisation()?;
    let begun = Instant::now();
    let mut periods = 0;
    while periods < RUN_PERIODS && begun.elapsed() < RUN_TIME {
        instance.step(instance.time(), period)?;
        periods += 1;
    }
    Ok(f64::from(periods) / begun.elapsed().as_secs_f64())
}
