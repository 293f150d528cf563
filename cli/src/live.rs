//! `takt load` and `takt live`: a board, over its serial port.

use crate::files::{self, Out};
use crate::load::Load;
use crate::select::{OptionalMachine, SourceArguments};
use crate::shadow;
use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::{Args, Subcommand};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use takt_board::Host;
use takt_board::protocol::{ENABLE, HOLD, INPUTS, OUTPUTS, RESTART, RUN};
use takt_board::serial::Serial;
use takt_board::top::{RECORDS, image};
use takt_isa::{Program, Type};

/// A board's serial port.
#[derive(Args)]
struct Port {
    /// The serial port: /dev/ttyUSB0, or what `takt board sim` says.
    port: PathBuf,
    /// Baud rate, as in the wiring file.
    #[arg(long, default_value_t = 115_200)]
    baud: u32,
}

impl Port {
    fn open(&self) -> Result<Host<Serial>> {
        let name = self.port.display();
        let line = Serial::open(&self.port, self.baud).with_context(|| {
            format!("cannot open {name}: is the board plugged in, and may you use the port?")
        })?;
        // Not the number of the last request of an earlier command.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.subsec_micros());
        Host::connect(line, now as u8).with_context(|| format!("{name} at {} baud", self.baud))
    }
}

/// Load a program into a board over its serial port, and start it.
///
/// The program that ran is stopped first, and outputs are safe. What was loaded is read back and compared. It stays until power-off.
#[derive(Args)]
pub(crate) struct LoadBoard {
    #[command(flatten)]
    port: Port,
    /// Source or image.
    program: PathBuf,
    /// Load only; `takt live PORT start` starts it.
    #[arg(long)]
    stopped: bool,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
}

pub(crate) fn load(arguments: &LoadBoard, color: bool, out: &mut Out) -> Result<()> {
    files::check(&[("the program", &arguments.program)], &[])?;
    let program =
        Load::new(arguments.machine.machine, color).with(&arguments.source).program(&arguments.program)?;
    let records = image(&program)?;
    let mut host = arguments.port.open()?;
    host.load(&records, RECORDS)?;
    if !arguments.stopped {
        host.set("control", RUN | ENABLE)?;
    }
    let state = if arguments.stopped { "stopped" } else { "started" };
    writeln!(out, "{} records loaded and compared; {state}", records.len())?;
    Ok(())
}

/// Monitor and control a running program on a board, over its serial port.
#[derive(Args)]
pub(crate) struct Live {
    #[command(flatten)]
    port: Port,
    /// The program that runs there, for the names of its ports.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// What the program does, and the counters.
    Status,
    /// Start the program from its beginning; outputs drive.
    Start,
    /// Stop the program; outputs are safe.
    Stop,
    /// Hold at the end of a period: no more ticks.
    Hold,
    /// One period, while it is held.
    Step,
    /// Go on after `hold`.
    Go,
    /// Read ports; all of them unless named.
    Read {
        /// Ports.
        names: Vec<String>,
    },
    /// Set input ports, between two periods.
    Set {
        /// `name=value`, each.
        #[arg(required = true)]
        values: Vec<String>,
    },
    /// Run the program from its beginning, a period at a time, beside the emulator with the same inputs, and name the first output
    /// that differs. Outputs stay safe unless --drive is given; afterwards the board is held.
    Shadow {
        /// `name=value`: input ports that the host sets, before the first period.
        values: Vec<String>,
        /// Periods to compare.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        periods: u32,
        /// Let outputs drive. Periods take as long as the line does: nothing may hang on them.
        #[arg(long)]
        drive: bool,
    },
    /// Print an output port every N periods, with the period's number.
    Stream {
        /// The port.
        name: String,
        /// Periods from one to the next.
        #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..4096))]
        every: u32,
        /// Values to print.
        #[arg(long, default_value_t = 100)]
        count: u32,
    },
}

/// A port's address and type.
pub(crate) fn find(program: &Program, name: &str) -> Result<(u16, Type)> {
    let input = program.inputs.iter().find(|port| port.name == name);
    if let Some(port) = input {
        let index = program.machine.inputs.index(port.register).context("an input is in the inputs' bank")?;
        return Ok((INPUTS + index.get(), port.ty));
    }
    let output = program.outputs.iter().find(|port| port.name == name);
    let output =
        output.map(|port| (OUTPUTS + port.register.get() % program.machine.outputs_per_bank, port.ty));
    output.ok_or_else(|| {
        let names: Vec<&str> =
            program.inputs.iter().chain(&program.outputs).map(|port| port.name.as_str()).collect();
        anyhow!("the program has no port `{name}`; there are {}", names.join(", "))
    })
}

pub(crate) fn shown(bits: u32, ty: Type) -> String {
    match ty {
        Type::F => f32::from_bits(bits).to_string(),
        Type::I => (bits as i32).to_string(),
        Type::B => format!("{bits:#x}"),
    }
}

fn bits(text: &str, ty: Type) -> Option<u32> {
    match ty {
        Type::F => text.parse::<f32>().ok().map(f32::to_bits),
        Type::I => text.parse::<i32>().ok().map(|n| n as u32),
        Type::B => {
            text.strip_prefix("0x").map_or_else(|| text.parse().ok(), |hex| u32::from_str_radix(hex, 16).ok())
        }
    }
}

pub(crate) fn live(arguments: &Live, color: bool, out: &mut Out) -> Result<()> {
    let read =
        |path: &Path| Load::new(arguments.machine.machine, color).with(&arguments.source).program(path);
    let program = arguments.program.as_deref().map(read).transpose()?;
    let program = || program.as_ref().context("ports have names in the program: --program FILE");
    // What the command line says is checked before the line is opened.
    let mut settings = Vec::new();
    if let Command::Set { values } | Command::Shadow { values, .. } = &arguments.command {
        for value in values {
            let (name, text) =
                value.split_once('=').with_context(|| format!("`{value}` is not `name=value`"))?;
            let (address, ty) = find(program()?, name)?;
            ensure!(address < OUTPUTS, "`{name}` is an output port, which the program sets");
            let bits = bits(text, ty).with_context(|| format!("`{text}` is no value of `{name}`"))?;
            settings.push((address, bits));
        }
        settings.sort_unstable();
    }
    if matches!(arguments.command, Command::Shadow { .. }) {
        program()?;
    }
    let mut host = arguments.port.open()?;
    let control = host.register("control")?;
    match &arguments.command {
        Command::Status => {
            let status = host.status()?;
            let state = match status {
                s if s.fault() => "stopped with a fault",
                s if s.halted() => "halted",
                s if s.in_reset() => "stopped",
                _ if control & HOLD != 0 => "held",
                _ => "runs",
            };
            let drive = if status.drives() { "drive" } else { "are safe" };
            writeln!(out, "the program {state}; outputs {drive}")?;
            let causes: Vec<&str> = status.causes().collect();
            if !causes.is_empty() {
                writeln!(out, "stopped the drive: {}", causes.join(", "))?;
            }
            if status.fault() {
                writeln!(out, "fault at bundle {}", host.register("fault")? & 0xffff)?;
            }
            for name in ["periods", "misses", "cycles", "most_cycles", "errors", "lost"] {
                writeln!(out, "{name:<12} {}", host.register(name)?)?;
            }
        }
        Command::Start => host.set("control", RUN | ENABLE | RESTART)?,
        Command::Stop => host.set("control", 0)?,
        Command::Hold => host.set("control", control | HOLD)?,
        Command::Go => host.set("control", control & !HOLD)?,
        Command::Step => {
            ensure!(control & HOLD != 0, "the program is not held: `takt live PORT hold` first");
            host.set("step", 1)?;
        }
        Command::Read { names } => {
            let program = program()?;
            let all = program.inputs.iter().chain(&program.outputs).map(|port| &port.name);
            let names: Vec<&String> = if names.is_empty() { all.collect() } else { names.iter().collect() };
            for name in names {
                let (address, ty) = find(program, name)?;
                let value = host.read(address, 1)?.first().copied().unwrap_or(0);
                writeln!(out, "{name} = {}", shown(value, ty))?;
            }
        }
        Command::Set { .. } => set(&mut host, &settings)?,
        Command::Shadow { periods, drive, .. } => {
            let enable = if *drive { ENABLE } else { 0 };
            // Held from its beginning on, so that no period goes by unseen.
            host.set("control", RUN | HOLD | enable | RESTART)?;
            set(&mut host, &settings)?;
            shadow::run(&mut host, program()?, *periods, out)?;
        }
        Command::Stream { name, every, count } => {
            let (address, ty) = find(program()?, name)?;
            host.set("stream", every << 20 | 1 << 16 | u32::from(address))?;
            let (mut printed, mut silent) = (0, 0);
            while printed < *count && silent < SILENCE {
                match host.streamed()? {
                    Some(frame) if frame.words.len() == 2 => {
                        writeln!(out, "{} {}", frame.words[0], shown(frame.words[1], ty))?;
                        (printed, silent) = (printed + 1, 0);
                    }
                    _ => silent += 1,
                }
            }
            host.set("stream", 0)?;
            if printed < *count {
                bail!("the stream ended after {printed} values: the program has no periods any more");
            }
            let lost = host.register("lost")?;
            if lost > 0 {
                crate::output::warning(
                    &format!("{lost} frames were lost since power-up: use a larger --every"),
                    color,
                );
            }
        }
    }
    Ok(())
}

/// Sets input ports, in ascending order; those whose numbers follow each other change together.
fn set(host: &mut Host<Serial>, settings: &[(u16, u32)]) -> Result<()> {
    for together in settings.chunk_by(|a, b| a.0 + 1 == b.0) {
        let values: Vec<u32> = together.iter().map(|(_, bits)| *bits).collect();
        host.write(together[0].0, &values)?;
    }
    Ok(())
}

/// Tenths of a second without a frame, until a stream has ended.
const SILENCE: u32 = 50;
