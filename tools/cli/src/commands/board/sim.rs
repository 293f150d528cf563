// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt board sim`: a board in Verilator, with its UART on a pseudo-terminal and drivers at its pins.

use super::Target;
#[cfg(unix)]
use super::{closed_loop, external_host, pins, plant_at_pins, robot};
use crate::run::application::Application;
use crate::terminal::files::Out;
#[cfg(unix)]
use crate::terminal::files::{self, OptionPath};
use crate::terminal::number;
use crate::terminal::options;
#[cfg(unix)]
use crate::terminal::output;
#[cfg(unix)]
use crate::terminal::progress::DelayedActivity;
#[cfg(unix)]
use anyhow::{Context, anyhow};
use anyhow::{Result, bail};
use clap::{ArgGroup, Args};
#[cfg(unix)]
use std::io::{IsTerminal, Write};
#[cfg(unix)]
use std::path::Path;
use std::path::PathBuf;
#[cfg(unix)]
use takt_board::emulated::EmulatedBoard;
#[cfg(unix)]
use takt_board::protocol::Line;
#[cfg(unix)]
use takt_board::simulation::{EncoderMotion, FLASH, Simulation};
#[cfg(unix)]
use takt_board::{Host, Wiring};

/// Run the complete top level in Verilator, with its UART on a pseudo-terminal that replaces a board's serial port.
///
/// `takt load` and `takt live` talk to the port that is printed. Input pins are low until --set, --wire, --script, --inputs or --plant drives them;
/// pins are named PERIPHERAL.PIN, or PERIPHERAL if it has one input. It runs slower than a board: a second of it takes minutes.
#[derive(Args)]
#[command(
    after_help = EXAMPLES,
    group = ArgGroup::new("behind").args(["inputs", "plant"]),
    group = ArgGroup::new("periodic").args(["robot", "plant"])
)]
pub(super) struct Sim {
    #[command(flatten)]
    target: Target,
    /// A motor that turns an encoder: the peripherals' names, and counts per second at full duty; may be repeated.
    #[arg(long, value_name = "PWM,QUADRATURE,SPEED")]
    axis: Vec<String>,
    /// An input pin's level from power-up on; may be repeated.
    #[arg(long, value_name = "PIN=LEVEL", conflicts_with = "robot")]
    set: Vec<String>,
    /// Connect an output pin to an input pin, `pulse.high=pulses.in`; may be repeated.
    #[arg(long, value_name = "OUT=IN", conflicts_with = "robot")]
    wire: Vec<String>,
    /// Commands that drive input pins, a line each: `set limit=1 stop=0`, `wait 5ms`, `show`, `quit`; `-` takes them from standard input as
    /// they come (docs/board.md).
    #[arg(long, value_name = "FILE", conflicts_with = "robot")]
    script: Option<PathBuf>,
    /// A plant's side of the pins: CSV with a column for each input that it drives, by pin or, for an encoder's count, by peripheral, and a
    /// row for each period of the board; `-` is standard input. The simulation ends with it.
    #[arg(long, value_name = "CSV", conflicts_with_all = ["axis", "robot", "script"])]
    inputs: Option<PathBuf>,
    /// The board's side: for each of these rows the part of the period in which each output pin was 1; `-` is standard output. With --plant
    /// a row for each period: input ports as the board read them, these parts, and the plant's states.
    #[arg(long, value_name = "CSV", requires = "behind")]
    outputs: Option<PathBuf>,
    /// Put a plant at the pins: a TOML file with a model and its numbers (docs/plant.md), or an FMU. Half bridges drive it, converters and
    /// encoders measure it; this command starts the program, and writes the ports of the file's [inputs] over the UART.
    #[arg(long, value_name = "TOML|FMU", conflicts_with_all = ["axis", "robot"])]
    plant: Option<PathBuf>,
    /// With --plant: connect a signal of the plant with a port of another name, in place of the file's map; may be given several times.
    #[arg(long, value_name = "SIGNAL=PORT", requires = "plant")]
    connect: Vec<String>,
    /// With --plant: draw the table of --outputs over time as SVG.
    #[arg(long, value_name = "SVG", value_parser = options::picture(), requires = "plant")]
    plot: Option<PathBuf>,
    /// Put the hybrid robot behind the pins and drive it along a tool path, this command being the host at the UART: the tracking
    /// error through the pins beside that of `takt track`.
    #[arg(long, conflicts_with_all = ["axis", "cycles"])]
    robot: bool,
    /// With --robot: tool path in G-code [default: the letters AGH].
    #[arg(long, value_name = "FILE", requires = "robot")]
    gcode: Option<PathBuf>,
    /// With --robot: periods to drive, from the path's beginning [default: 1000; with --serve until it is interrupted]. With --plant:
    /// periods to run [default: until --cycles, or until it is interrupted].
    #[arg(long, value_name = "N", value_parser = number::count, requires = "periodic", allow_hyphen_values = true)]
    periods: Option<u64>,
    /// With --robot: leave the UART to a host at the pseudo-terminal that is printed, such as LinuxCNC (docs/linuxcnc.md). After each frame
    /// of a stream, time on the board stands still until the host writes.
    #[arg(long, requires = "robot")]
    serve: bool,
    /// With --serve: cores and links are the emulator's, in place of the circuit in Verilator; for systems of several cores.
    #[arg(long, requires = "serve")]
    emulated: bool,
    /// With --serve: write where the robot is at each tick, and what drives it, while the outputs drive and shortly after.
    #[arg(long, value_name = "CSV", requires = "serve")]
    record: Option<PathBuf>,
    /// With --serve: cut the line at the UART once the outputs have driven for N periods.
    #[arg(long, value_name = "N", requires = "serve", value_parser = number::count, allow_hyphen_values = true)]
    unplug_at: Option<u64>,
    /// With --serve: press the button at the pin `stop` once the outputs have driven for N periods.
    #[arg(long, value_name = "N", requires = "serve", value_parser = number::count, allow_hyphen_values = true)]
    stop_at: Option<u64>,
    /// Contents of the flash at the pins of the wiring's `[flash]`; what a host stores there stays in this file [default: an erased one].
    #[arg(long, value_name = "FILE", conflicts_with = "emulated")]
    flash: Option<PathBuf>,
    /// Flip one in N bits on the UART, in either direction; 0 flips none.
    #[arg(long, default_value_t = 0, value_name = "N")]
    noise: u32,
    /// End after N cycles; without it, when it is interrupted.
    #[arg(long, value_name = "N")]
    cycles: Option<u64>,
}

const EXAMPLES: &str = "\
Examples:
  takt board sim --wiring position.toml --program position.s --axis motor,encoder,20000
  takt board sim --wiring limit.toml --program limit.s --script -        then, for example, `set limit=1`
  takt board sim --wiring limit.toml --program limit.s --inputs - --outputs -   a plant at both pipes
  takt board sim --wiring drive.toml --program drive.s --plant plant/drive.toml --periods 400 --outputs loop.csv";

/// Default number of cycles per run of the simulation.
#[cfg(unix)]
const SLICE: u32 = 2000;

/// Default number of periods of --robot.
#[cfg(unix)]
const PERIODS: u64 = 1000;

/// A motor with its encoder.
#[cfg(unix)]
struct Axis {
    motor: String,
    pins: [usize; 2],
    half: f64,
    /// Speed at full duty, in counts per cycle.
    speed: f64,
    position: f64,
    counts: i32,
}

#[cfg(unix)]
impl Axis {
    fn new(text: &str, wiring: &Wiring, sim: &Simulation) -> Result<Axis> {
        let wrong = || anyhow!("--axis {text}: expected PWM,QUADRATURE,SPEED, as in motor,encoder,20000");
        let [motor, encoder, speed] = text.split(',').collect::<Vec<_>>()[..] else { return Err(wrong()) };
        let find = |name: &str, kind: &str| {
            let mut all = wiring.peripherals.iter();
            all.find(|p| p.name == name && p.kind.name == kind)
                .ok_or_else(|| anyhow!("--axis {text}: the wiring has no {kind} `{name}`"))
        };
        let half = find(motor, "pwm")?.parameters[0];
        find(encoder, "quadrature")?;
        let speed: f64 = speed.parse().map_err(|_| wrong())?;
        let pins = ["a", "b"].map(|pin| sim.input(&format!("{encoder}_{pin}")));
        let [Some(a), Some(b)] = pins else { return Err(wrong()) };
        let speed = speed / (wiring.clock * 1e6);
        Ok(Axis { motor: motor.to_owned(), pins: [a, b], half: half.into(), speed, position: 0.0, counts: 0 })
    }

    /// Advances the encoder after a PWM period, according to the force of the previous one.
    fn moves(&mut self, sim: &mut Simulation, cycles: u32) {
        let high = sim.output(&format!("{}_high", self.motor)).map_or(0, |(_, high)| high);
        let drives = sim.output(&format!("{}_low", self.motor)).is_none_or(|(_, low)| low + high > 0);
        let duty = if drives { f64::from(high) / self.half - 1.0 } else { 0.0 };
        self.position += duty * self.speed * f64::from(cycles);
        let counts = self.position.round() as i32;
        sim.turns.push(EncoderMotion {
            pins: self.pins,
            from: self.counts,
            by: counts.wrapping_sub(self.counts),
        });
        self.counts = counts;
    }
}

#[cfg(unix)]
pub(super) fn run(arguments: &Sim, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<OptionPath<'_>> = vec![("--program", &arguments.target.program)];
    reads.extend(arguments.target.wiring.as_deref().map(|path| ("--wiring", path)));
    reads.extend(arguments.script.as_deref().map(|path| ("--script", path)));
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    reads.extend(arguments.plant.as_deref().map(|path| ("--plant", path)));
    let outputs = [
        ("--outputs", &arguments.outputs),
        ("--record", &arguments.record),
        ("--plot", &arguments.plot),
        ("--flash", &arguments.flash),
    ];
    let writes: Vec<OptionPath<'_>> =
        outputs.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?))).collect();
    files::check(&reads, &writes)?;
    let (board, wiring, carried) = arguments.target.read(color, true)?;
    if !wiring.uart {
        let talks = [("--robot", arguments.robot), ("--noise", arguments.noise > 0)];
        if let Some((option, _)) = talks.into_iter().find(|(_, is_given)| *is_given) {
            bail!(
                "{option} is for a board with a UART, which the wiring leaves out (`uart = false`); --axis, --plant, --script and --inputs drive its pins"
            );
        }
    }
    // Check the drivers of the pins before the circuit is compiled.
    let taken: Vec<&str> = arguments.axis.iter().filter_map(|text| text.split(',').nth(1)).collect();
    let mut pins = pins::Pins::new(&board, &wiring, &taken);
    let wires =
        pins.wires(arguments.wire.iter().map(String::as_str)).map_err(|text| anyhow!("--wire {text}"))?;
    let plant = match &arguments.plant {
        Some(path) => {
            let Application::Program(loaded) = &carried else {
                bail!(
                    "--plant is for a single program; a system's plant is one at the pipes of --inputs and --outputs"
                );
            };
            let plant =
                closed_loop::PlantAtPins::new(path, &arguments.connect, &wiring, loaded, &pins, color)?;
            pins.leave_out(&plant.driven());
            Some(plant)
        }
        None => None,
    };
    let levels =
        pins.levels(arguments.set.iter().map(String::as_str)).map_err(|text| anyhow!("--set {text}"))?;
    let script = match &arguments.script {
        Some(path) => Some(pins::Script::open(path, &pins, &wiring, color)?),
        None => None,
    };
    let folder = takt_cache::folder()?.join(format!("board-{}", std::process::id()));
    if let Some(file) = &arguments.flash {
        if wiring.flash.is_none() {
            bail!("--flash is for a wiring with the table `[flash]`");
        }
        // The simulation itself says nothing of a file that it cannot use.
        let mut options = std::fs::OpenOptions::new();
        let opened = options.read(true).write(true).create(true).truncate(false).open(file);
        opened
            .and_then(|_| std::fs::create_dir_all(&folder))
            .and_then(|()| std::os::unix::fs::symlink(std::path::absolute(file)?, folder.join(FLASH)))
            .with_context(|| format!("cannot use {}", file.display()))?;
    }
    let simulation = || -> Result<Simulation> {
        let _waiting = DelayedActivity::new(format!("compiling the circuit for {}", board.name));
        let mut sim = Simulation::new(&board, &wiring, carried.on_board(), &folder)?;
        sim.noise = arguments.noise;
        // With --robot alone, this command is the host, and reports itself how its drive ended.
        sim.tell = (!arguments.robot || arguments.serve).then_some(output::message as fn(&str));
        levels.iter().for_each(|(pin, level)| sim.set(pin, *level));
        wires.iter().for_each(|(output, input)| sim.wire(output, input));
        Ok(sim)
    };
    let run = || -> Result<()> {
        if arguments.serve {
            return serve_robot(arguments, &wiring, &carried, simulation, out);
        }
        if arguments.robot {
            let Application::Program(loaded) = &carried else {
                bail!(
                    "--robot gives a single program a point of the path in each period, and the systems that drive this robot compute their points themselves; `takt track --system` drives it with one"
                );
            };
            let drive = robot::Drive::new(
                &loaded.program,
                &wiring,
                arguments.gcode.as_deref(),
                arguments.periods.unwrap_or(PERIODS),
            )?;
            return drive.run(&board.name, simulation()?, out);
        }
        if let Some(plant) = plant {
            let sim = simulation()?;
            let outputs = arguments.outputs.as_deref();
            let tables = (outputs, arguments.plot.is_some());
            let rows = closed_loop::Rows::new(&plant, &sim, &pins, tables, arguments.periods)?;
            let run = closed_loop::Run {
                cycles: arguments.cycles,
                script,
                plot: arguments.plot.as_deref(),
                title: files::input_name(&arguments.target.program),
                is_quiet: outputs.is_some_and(files::is_dash),
            };
            let report = |host: &mut Host<_>| report_reasons(host, &wiring, &carried);
            return closed_loop::run(plant, sim, rows, run, report, out);
        }
        if let Some(inputs) = &arguments.inputs {
            let plant =
                pins::Plant { pins: &pins, wiring: &wiring, inputs, outputs: arguments.outputs.as_deref() };
            return report_safe_outputs(plant.run(simulation, arguments.cycles, out)?, &wiring, &carried);
        }
        report_safe_outputs(serve(arguments, &wiring, script, simulation()?, out)?, &wiring, &carried)
    };
    let ended = run();
    let _ = std::fs::remove_dir_all(&folder);
    ended
}

/// Serves the robot at the pins to an external host program.
#[cfg(unix)]
fn serve_robot(
    arguments: &Sim,
    wiring: &Wiring,
    carried: &Application,
    simulation: impl FnOnce() -> Result<Simulation>,
    out: &mut Out,
) -> Result<()> {
    let pose = crate::commands::track::trajectory(arguments.gcode.as_deref())?.1.start();
    let axes = plant_at_pins::Axis::all(wiring, &pose)?;
    let Sim { unplug_at: unplug, stop_at: stop, periods: end, .. } = *arguments;
    let mut signals = takt_board::wiring::SIGNALS.iter().zip(&wiring.signals);
    if stop.is_some() && !signals.any(|(signal, pin)| signal.name == "stop" && pin.is_some()) {
        bail!("--stop-at: the wiring has no pin for the signal `stop`, under [signals]");
    }
    let events = external_host::Events { unplug, stop, end };
    let record = arguments.record.as_deref();
    if arguments.emulated {
        let mut board = EmulatedBoard::new(wiring, carried.on_board())?;
        board.tell = Some(output::message as fn(&str));
        return external_host::serve(
            plant_at_pins::EmulationWithRobot::new(board, &axes, &pose)?,
            wiring.baud,
            record,
            events,
            out,
        );
    }
    external_host::serve(
        plant_at_pins::CircuitWithRobot::new(simulation()?, wiring, &axes, &pose)?,
        wiring.baud,
        record,
        events,
        out,
    )
}

/// Reports at the end of a simulation why the outputs are safe, if they are.
#[cfg(unix)]
fn report_safe_outputs(mut sim: Simulation, wiring: &Wiring, carried: &Application) -> Result<()> {
    if !wiring.uart {
        return Ok(());
    }
    // No external host is connected any more, so disturbing the requests serves no purpose.
    sim.noise = 0;
    sim.unplugged = false;
    sim.tell = None;
    report_reasons(&mut Host::connect(sim, 1)?, wiring, carried)
}

/// Reports why the outputs are safe, if they are.
#[cfg(unix)]
fn report_reasons<L: Line>(host: &mut Host<L>, wiring: &Wiring, carried: &Application) -> Result<()> {
    // Query this first: each request takes simulated time, after which a silent host would appear as a further reason.
    let reasons = host.safe_reasons(Some(&carried.on_board()))?;
    for trip in host.tripped(Some(wiring))? {
        output::message(&format!("at the end {trip}"));
    }
    if !reasons.is_empty() {
        output::message(&format!("at the end the outputs are safe: {}", reasons.join("; ")));
    }
    Ok(())
}

/// Says on a terminal how to use the port that was printed. `program`: the program, if the host has to load it.
#[cfg(unix)]
pub(super) fn next_commands(program: Option<&Path>, port: &Path, baud: u32) {
    if !std::io::stderr().is_terminal() {
        return;
    }
    let port = port.display();
    let baud = if baud == number::BAUD { String::new() } else { format!(" --baud {baud}") };
    output::message("Ctrl-C ends the simulation; type in another terminal:");
    if let Some(program) = program {
        output::message(&format!("  takt load {port} {}{baud}", program.display()));
    }
    output::message(&format!("  takt live {port}{baud} status"));
}

#[cfg(unix)]
fn serve(
    arguments: &Sim,
    wiring: &Wiring,
    mut script: Option<pins::Script<'_>>,
    mut sim: Simulation,
    out: &mut Out,
) -> Result<Simulation> {
    let axes = arguments.axis.iter().map(|text| Axis::new(text, wiring, &sim));
    let mut axes = axes.collect::<Result<Vec<Axis>>>()?;
    // Pulses are measured over complete PWM periods.
    let whole = axes.iter().map(|axis| 2 * axis.half as u32).max();
    let mut terminal = match wiring.uart {
        true => Some(takt_board::terminal::Terminal::new()?),
        false => None,
    };
    match &terminal {
        Some(terminal) => {
            writeln!(out, "{} {}", terminal.path().display(), wiring.baud)?;
            out.flush()?;
            next_commands(Some(&arguments.target.program), terminal.path(), wiring.baud);
        }
        None if arguments.cycles.is_some() || script.is_some() => output::message("the board has no UART"),
        None => output::message("the board has no UART; Ctrl-C ends the simulation"),
    }
    while arguments.cycles.is_none_or(|most| sim.cycles < most) {
        let mut slice = whole.unwrap_or(SLICE);
        if let Some(script) = &mut script {
            if script.act(&mut sim, out)? {
                break;
            }
            if whole.is_none() {
                slice = script.at_most(sim.cycles, slice);
            }
        }
        let bytes = match &mut terminal {
            Some(terminal) => terminal.receive()?,
            None => Vec::new(),
        };
        for axis in &mut axes {
            axis.moves(&mut sim, slice);
        }
        sim.run(slice, &bytes)?;
        let received = sim.take_received();
        if let Some(terminal) = terminal.as_mut().filter(|_| !received.is_empty()) {
            terminal.send(&received)?;
        }
    }
    for axis in &axes {
        writeln!(out, "{}: {} counts", axis.motor, axis.counts)?;
    }
    Ok(sim)
}

#[cfg(not(unix))]
pub(super) fn run(_: &Sim, _: bool, _: &mut Out) -> Result<()> {
    bail!("a simulated board needs pseudo-terminals, which this system does not have")
}
