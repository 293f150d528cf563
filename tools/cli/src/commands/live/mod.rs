// SPDX-License-Identifier: MIT OR Apache-2.0
//! The commands `takt load` and `takt live`: access to a board at a serial port.

mod comparison;
mod fifo;
mod flash;
mod parameters;
mod scope;
mod serve;

use crate::commands::board;
use crate::run::application;
use crate::run::parameters::ParameterArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::progress::progress;
use anyhow::{Context, Result, anyhow, bail};
use clap::{Args, Subcommand};
use serve::Served;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use takt_board::endpoints::Fifo;
use takt_board::protocol::{ENABLE, HOLD, RESTART, RUN};
use takt_board::scope::Setup;
use takt_board::serial::Serial;
use takt_board::top::image;
use takt_board::{Application, Host, Stream, Wiring};
use takt_live::report::Report;
use takt_live::value::{find, value_text};
use takt_live::{Control, set, setting};

/// A board's serial port.
#[derive(Args)]
struct Port {
    /// The serial port: /dev/ttyUSB0, or the path that `takt board sim` prints.
    port: PathBuf,
    /// Baud rate, as in the wiring file.
    #[arg(long, default_value_t = number::BAUD)]
    baud: u32,
}

impl Port {
    fn open(&self) -> Result<Host<Serial>> {
        open(&self.port, self.baud)
    }
}

/// Connects to the board at a serial port.
pub(crate) fn open(port: &Path, baud: u32) -> Result<Host<Serial>> {
    let name = port.display();
    let line = Serial::open(port, baud)
        .with_context(|| format!("cannot open {name}: is the board plugged in, and may you use the port?"))?;
    let line = line
        .reserved()
        .map_err(|_| anyhow!("{name} is in use by another command of takt, which must end first"))?;
    // Number of the first request; it should differ from the last request of an earlier command.
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.subsec_micros());
    Host::connect(line, now as u8).with_context(|| format!("{name} at {baud} baud"))
}

/// Load a program, or the programs of a system, into a board over its serial port, and start it.
///
/// The program that ran is stopped first, and outputs are safe. The loaded data is read back and compared. It stays until power-off;
/// with --flash it starts at each power-up, with its parameters.
#[derive(Args)]
pub(crate) struct LoadBoard {
    #[command(flatten)]
    port: Port,
    /// Source or image; or a system, a `.toml` file, if the board carries its circuit.
    program: PathBuf,
    /// Load only; `takt live PORT start` starts it.
    #[arg(long)]
    stopped: bool,
    /// Store it in the board's flash, too, in place of the older of two images: until all of it is there and compared, a power-up begins
    /// with the newer one. The wiring has the flash's pins.
    #[arg(long)]
    flash: bool,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    parameters: ParameterArguments,
}

pub(crate) fn load(arguments: &LoadBoard, color: bool, out: &mut Out) -> Result<()> {
    files::check(&[("the program", &arguments.program)], &[])?;
    let mut carried =
        application::Application::load(&arguments.program, &arguments.machine, &arguments.source, color)?;
    arguments.parameters.apply(&mut carried)?;
    let records = image(carried.on_board())?.records;
    let mut host = arguments.port.open()?;
    host.fits(carried.on_board())?;
    let place = if arguments.flash { Some(flash::place(&mut host)?) } else { None };
    let bar = progress(records.len() as u64, "records", false);
    let loaded = host.load_with(&records, |more| bar.inc(more as u64));
    bar.finish_and_clear();
    loaded?;
    if !arguments.stopped {
        host.set("control", RUN | ENABLE)?;
    }
    let state = if arguments.stopped { "stopped" } else { "started" };
    writeln!(out, "{} records loaded and compared; {state}", records.len())?;
    if let Some(place) = place {
        flash::store(&mut host, &place, &records, out)?;
    }
    Ok(())
}

/// Monitor and control a running program, or system, on a board, over its serial port.
#[derive(Args)]
pub(crate) struct Live {
    #[command(flatten)]
    port: Port,
    /// The program, or the system, that runs there, for its names. In a system, a name is `core.name`.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// The wiring that the board was built with: messages name the peripheral that drives a port.
    #[arg(long, value_name = "TOML", requires = "program")]
    wiring: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// State of the program, or of each core, and counters.
    Status,
    /// Start the program from its beginning; outputs drive.
    Start,
    /// Stop the program; outputs are safe.
    Stop,
    /// Hold at the end of a period: no more ticks.
    Hold,
    /// Run one period while the program is held.
    Step,
    /// Go on after `hold`.
    Go,
    /// Read ports, registers and data words; all ports unless named.
    Read {
        /// Ports, registers (`x`, `@m12`), elements of arrays as the source writes them (`M[2,3]`), all of one (`M`), data words
        /// (`table[3]` behind a label, `[17]`, from 0).
        names: Vec<String>,
    },
    /// Set input ports, between two periods.
    Set {
        /// `name=value`, each.
        #[arg(required = true)]
        values: Vec<String>,
    },
    /// Show parameters (`.param`), or set some of them, all at once between two periods.
    Param {
        /// `name=value`, each; without any, all parameters are shown.
        values: Vec<String>,
        /// Set the parameters in this file, lines `kp = 3.0` in TOML; values on the command line come after it.
        #[arg(long, value_name = "TOML")]
        load: Option<PathBuf>,
        /// Write all parameters, as they are on the board then, to this file.
        #[arg(long, value_name = "TOML")]
        save: Option<PathBuf>,
    },
    /// Run the program from its beginning, a period at a time, alongside the emulator with the same inputs, and report the first output
    /// that differs. Outputs stay safe unless --drive is given; afterwards the board is held.
    Shadow {
        /// `name=value`: input ports that the host sets, before the first period.
        values: Vec<String>,
        /// Periods to compare; of a system, base ticks.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        periods: u32,
        /// Let outputs drive. Periods then last as long as the serial line takes: connect nothing that depends on their timing.
        #[arg(long)]
        drive: bool,
    },
    /// Put an entry into a FIFO of a system, from the host.
    Push {
        /// The FIFO.
        name: String,
        /// `field=value`, for each field of an entry.
        #[arg(required = true)]
        values: Vec<String>,
    },
    /// Take an entry out of a FIFO of a system, to the host.
    Pop {
        /// The FIFO.
        name: String,
    },
    /// Show the images in the board's flash, and with which of them the board started.
    Flash {
        /// Make both images invalid: the next power-up begins with the bitstream's program.
        #[arg(long)]
        forget: bool,
    },
    /// Record registers and ports on the board itself, in every period, around a trigger: no cycle of the program, no period left out.
    Scope(scope::ScopeArguments),
    /// Serve a page to a browser on this computer: parameters and inputs with sliders, the scope, status and faults, start and stop.
    ///
    /// The address that is printed is for the browser: it holds a token, and nobody else can open it. One page sets values and starts and
    /// stops; others show what it does. The page follows the board until this command is interrupted, also when the port goes and comes
    /// back.
    #[command(long_flag = "serve")]
    Serve(serve::ServeArguments),
    /// Print ports, registers or data words every N periods, with the period's number: a head line with the names, then a line each.
    Stream {
        /// Ports, registers or data words, as for `read`: all of one kind, of one core, and within 15 consecutive numbers.
        #[arg(required = true)]
        names: Vec<String>,
        /// Periods from one line to the next.
        #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..4096))]
        every: u32,
        /// Lines to print.
        #[arg(long, default_value_t = 100)]
        count: u32,
    },
}

/// Arguments of a command, parsed before the serial port is opened.
enum PreparedCommand {
    Nothing,
    /// Addresses and values to set, and the port name at each address.
    Settings(Vec<(u16, u32)>, Vec<(u16, String)>),
    /// Entry to push into a FIFO.
    Entry(Fifo, Vec<u32>),
    /// FIFO to pop an entry from.
    Pop(Fifo),
    Stream(Stream),
    /// Parameters to set.
    Parameters(parameters::Changes),
    /// Channels and trigger of the scope.
    Scope(Setup),
    /// Address of the page.
    Serve(serve::Address),
}

fn prepare(
    command: &Command,
    application: Option<&Application<'_>>,
    wiring: Option<&Wiring>,
) -> Result<PreparedCommand> {
    let named = || application.context("ports are named by the program: give it with --program FILE");
    Ok(match command {
        Command::Set { values } | Command::Shadow { values, .. } => {
            if matches!(command, Command::Shadow { .. }) {
                named()?;
            }
            let (mut settings, mut names) = (Vec::new(), Vec::new());
            for value in values {
                let (name, text) =
                    value.split_once('=').with_context(|| format!("`{value}` is not `name=value`"))?;
                let (address, bits) = setting(named()?, wiring, name, text)?;
                settings.push((address, bits));
                names.push((address, name.to_owned()));
            }
            settings.sort_unstable();
            PreparedCommand::Settings(settings, names)
        }
        Command::Push { name, values } => {
            let (fifo, entry) = fifo::entry(named()?, name, values)?;
            PreparedCommand::Entry(fifo, entry)
        }
        Command::Pop { name } => PreparedCommand::Pop(fifo::of(named()?, name, true)?),
        Command::Stream { names, .. } => {
            let stream = Stream::of(named()?, names);
            PreparedCommand::Stream(stream.map_err(|text| anyhow!("{text}"))?)
        }
        Command::Param { values, load, .. } => {
            let given = ParameterArguments { settings: values.clone(), file: load.clone() };
            PreparedCommand::Parameters(parameters::prepare(named()?, &given)?)
        }
        Command::Scope(arguments) => PreparedCommand::Scope(scope::prepare(named()?, arguments)?),
        Command::Serve(arguments) => {
            named()?;
            PreparedCommand::Serve(serve::Address::listen(arguments)?)
        }
        _ => PreparedCommand::Nothing,
    })
}

pub(crate) fn live(arguments: &Live, color: bool, out: &mut Out) -> Result<()> {
    if let Command::Param { load: Some(load), save: Some(save), .. } = &arguments.command {
        files::check(&[("--load", load.as_path())], &[("--save", save.as_path())])?;
    }
    let carried = arguments.program.as_deref();
    let carried = carried
        .map(|path| application::Application::load(path, &arguments.machine, &arguments.source, color))
        .transpose()?;
    let application = carried.as_ref().map(application::Application::on_board);
    let wiring = match (&arguments.wiring, &application) {
        (Some(path), Some(application)) => Some(board::wired(path, None, application, color)?.1),
        _ => None,
    };
    let prepared = prepare(&arguments.command, application.as_ref(), wiring.as_ref())?;
    let named =
        || application.as_ref().context("ports are named by the program: give it with --program FILE");
    let mut host = arguments.port.open()?;
    if let Some(application) = &application {
        host.fits(application.clone())?;
    }
    match &arguments.command {
        Command::Status => {
            let report = Report::read(&mut host, application.as_ref(), wiring.as_ref())?;
            write!(out, "{report}")?;
        }
        Command::Start => Control::Start.send(&mut host)?,
        Command::Stop => Control::Stop.send(&mut host)?,
        Command::Hold => Control::Hold.send(&mut host)?,
        Command::Go => Control::Go.send(&mut host)?,
        Command::Step => Control::Step.send(&mut host)?,
        Command::Read { names } => {
            let application = named()?;
            let each = |name: &String| application.elements(name).unwrap_or_else(|| vec![name.clone()]);
            let names =
                if names.is_empty() { application.names() } else { names.iter().flat_map(each).collect() };
            let places = names.iter().map(|name| find(application, name)).collect::<Result<Vec<_>>>()?;
            let addresses: Vec<u16> = places.iter().map(|(address, _)| *address).collect();
            for ((name, (_, ty)), value) in names.iter().zip(places).zip(host.read_each(&addresses)?) {
                writeln!(out, "{name} = {}", value_text(value, ty))?;
            }
        }
        Command::Flash { forget } => flash::run(&mut host, *forget, out)?,
        Command::Set { .. } => {
            if let PreparedCommand::Settings(settings, names) = &prepared {
                set(&mut host, settings, names)?;
            }
        }
        Command::Param { save, .. } => {
            if let PreparedCommand::Parameters(changes) = &prepared {
                parameters::run(&mut host, changes, save.as_deref(), out)?;
            }
        }
        Command::Scope(arguments) => {
            if let PreparedCommand::Scope(setup) = &prepared {
                scope::run(&mut host, named()?, (arguments, setup), wiring.as_ref(), out)?;
            }
        }
        Command::Shadow { periods, drive, .. } => {
            let enable = if *drive { ENABLE } else { 0 };
            // Hold the program from its start, so that no period is missed.
            host.set("control", RUN | HOLD | enable | RESTART)?;
            if let PreparedCommand::Settings(settings, names) = &prepared {
                set(&mut host, settings, names)?;
            }
            comparison::run(&mut host, named()?, *periods, out)?;
        }
        Command::Push { .. } => {
            if let PreparedCommand::Entry(fifo, entry) = &prepared {
                fifo::push(&mut host, named()?, fifo, entry)?;
            }
        }
        Command::Pop { .. } => {
            if let PreparedCommand::Pop(fifo) = &prepared {
                fifo::pop(&mut host, fifo, out)?;
            }
        }
        Command::Serve(_) => {
            if let (PreparedCommand::Serve(address), Some(file), Some(loaded), Some(application)) =
                (prepared, &arguments.program, &carried, &application)
            {
                let served =
                    Served { port: &arguments.port, file, loaded, application, wiring: wiring.as_ref() };
                serve::run(host, &served, address, out)?;
            }
        }
        Command::Stream { names, every, count } => {
            if let PreparedCommand::Stream(stream) = &prepared {
                streamed(&mut host, (stream, names), *every, *count, color, out)?;
            }
        }
    }
    Ok(())
}

/// Prints a head line, then the values of `count` stream frames, each line as it comes.
fn streamed(
    host: &mut Host<Serial>,
    (stream, names): (&Stream, &[String]),
    every: u32,
    count: u32,
    color: bool,
    out: &mut Out,
) -> Result<()> {
    host.set("stream", stream.register(every))?;
    writeln!(out, "period {}", names.join(" "))?;
    out.flush()?;
    let (mut printed, mut silent) = (0, 0);
    while printed < count && silent < SILENCE {
        let frame = host.streamed()?;
        match frame.as_ref().and_then(|frame| stream.values(frame)) {
            Some((period, values)) => {
                let values = values.map(|(bits, ty)| value_text(bits, ty));
                writeln!(out, "{period} {}", values.collect::<Vec<_>>().join(" "))?;
                // Flush: a reader may be waiting for each line.
                out.flush()?;
                (printed, silent) = (printed + 1, 0);
            }
            None => silent += 1,
        }
    }
    host.set("stream", 0)?;
    if printed < count {
        bail!("the stream ended after {printed} values: the program has no periods any more");
    }
    let lost = host.register("lost")?;
    if lost > 0 {
        crate::terminal::output::warning(
            &format!("{lost} frames were lost since power-up: use a larger --every"),
            color,
        );
    }
    Ok(())
}

/// Time without a frame after which the stream counts as ended, in tenths of a second.
const SILENCE: u32 = 50;
