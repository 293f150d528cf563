// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt debug --board PORT`: debug session on a board at a serial port.

use super::{Debug, converse, script};
use crate::commands::live;
use crate::run::load::{self, Load};
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::files::{self, Out};
use crate::terminal::interrupt::{self, INTERRUPTED};
use crate::terminal::output::Failure;
use anyhow::{Context, Result, anyhow, bail};
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use takt_board::host::fault_kind;
use takt_board::protocol::{ENABLE, HOLD, Line, LinkError, RESTART, RUN};
use takt_board::{Application, Host, top};
use takt_debug::console::{Console, Target};
use takt_debug::remote::{Activity, Remote, RemoteError, RemoteSession, State};
use takt_debug::session::{Control, Options, Session};
use takt_isa::{BundleAddress, Program, Register};

/// Maximum gap between neighbouring addresses that share one read request.
const GAP: u16 = 4;
/// Interval between two polls of a running board.
const POLL: Duration = Duration::from_millis(50);

/// Runs a session on a board.
pub(super) fn run(arguments: &Debug, port: &Path, color: bool, out: &mut Out) -> Result<()> {
    let file = arguments.file.as_deref().context("no file")?;
    if load::is_system(file) {
        let text = format!(
            "--board is for a single program, and {} is a system: what is under way on its links cannot be read, so no emulator can take over in the board's state; `takt live {} --program {} read CORE.NAME` reads ports and registers of its cores, `shadow` compares their outputs with the emulator's from the start",
            files::input_name(file),
            port.display(),
            files::input_name(file)
        );
        return Err(Failure::Usage(text).into());
    }
    // Check the command line before accessing the board.
    let commands = arguments.script.as_deref().map(|path| script(path, Target::Board)).transpose()?;
    let loaded = Load::new(arguments.machine.machine, color).with(&arguments.source).with_source(file)?;
    super::changed_sources(file, &loaded, color);
    let LoadedProgram { program, constants, sources, names, .. } = loaded;
    let records = top::image(&program)?.records;
    let control = Arc::new(Control::default());
    let view = Session::new(&program, Options { constants, sources, names, ..Options::default() })?;

    let mut host = live::open(port, arguments.baud)?;
    host.fits(&program)?;
    carries(&mut host, &records).with_context(|| {
        let (port, file) = (port.display(), files::input_name(file));
        format!("the board does not carry {file}; `takt load {port} {file}` loads it")
    })?;
    if host.register("observed")? == 0 {
        bail!(
            "the board's circuit has no copies of registers and data words to read (`observe = false` in its wiring); `takt live {}` reads ports",
            port.display()
        );
    }
    let interactive = commands.is_none() && std::io::stdin().is_terminal();
    let ended = interrupts(&control, interactive)?;
    let board = Board { host, program: program.clone(), enable: if arguments.drive { ENABLE } else { 0 } };
    let session = RemoteSession::attach(&program, Box::new(board), Arc::clone(&control))
        .map_err(|error| anyhow!("{error}"))?;
    let (console, said) = Console::of_board(session, view, arguments.restart, interactive)
        .map_err(|error| anyhow!("{error}"))?;
    converse(console, &said, commands, &control, &ended, color, out)
}

/// Ctrl-C stops the running command. Without a prompt it also ends the session, which restores the board first; a second Ctrl-C ends the
/// process immediately.
fn interrupts(control: &Arc<Control>, interactive: bool) -> Result<Arc<AtomicBool>> {
    let ended = Arc::new(AtomicBool::new(false));
    let (heard, ends) = (Arc::clone(control), Arc::clone(&ended));
    let handler = move || {
        if !interactive && ends.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED);
        }
        heard.interrupt();
    };
    interrupt::on_interrupt(handler)?;
    Ok(ended)
}

/// Checks that the board carries this image.
fn carries<L: Line>(host: &mut Host<L>, records: &[[u32; 3]]) -> Result<()> {
    let there = host.register("records")? as usize;
    if there != records.len() {
        bail!("the board's image has {there} records, but this program's has {}", records.len());
    }
    match host.first_difference(records)? {
        Some(record) => bail!("record {record} of the board's image differs from this program's"),
        None => Ok(()),
    }
}

/// A board as a remote machine.
struct Board<L> {
    host: Host<L>,
    program: Program,
    /// Bit of `control` that enables the outputs after a restart, or 0.
    enable: u32,
}

fn failed(error: LinkError) -> RemoteError {
    match error {
        LinkError::Busy => RemoteError::Busy,
        other => RemoteError::Other(other.to_string()),
    }
}

impl<L: Line> Board<L> {
    fn register(&mut self, name: &str) -> Result<u32, RemoteError> {
        self.host.register(name).map_err(failed)
    }

    fn set(&mut self, name: &str, value: u32) -> Result<(), RemoteError> {
        self.host.set(name, value).map_err(failed)
    }

    /// Reads values at ascending addresses; nearby addresses are combined in one request.
    fn read(&mut self, addresses: &[u16]) -> Result<Vec<u32>, RemoteError> {
        let mut values = Vec::with_capacity(addresses.len());
        for near in addresses.chunk_by(|a, b| b - a <= GAP) {
            let (first, last) = (near[0], near[near.len() - 1]);
            let words = self.host.read(first, usize::from(last - first) + 1).map_err(failed)?;
            values.extend(near.iter().map(|address| words[usize::from(address - first)]));
        }
        Ok(values)
    }

    /// Waits until the program is between two periods, or has stopped.
    fn settle(&mut self) -> Result<(), RemoteError> {
        self.host.settle().map_err(failed)?;
        // Reading any register also waits until the outputs have reached the peripherals.
        let any = self.program.machine.slots.iter().flat_map(|slot| slot.bank.registers()).next();
        self.registers(any.as_slice()).map(drop)
    }

    /// Addresses of the program's ports.
    fn ports(&self, outputs: bool) -> Result<Vec<u16>, RemoteError> {
        let ports: Vec<&_> = match outputs {
            true => self.program.outputs.iter().collect(),
            false => self.program.host_registers().collect(),
        };
        let find = |name: &str| Application::from(&self.program).find(name).map(|place| place.read);
        ports.iter().map(|port| find(&port.name).map_err(RemoteError::Other)).collect()
    }

    /// Reads values at addresses in any order.
    fn read_any(&mut self, addresses: &[u16]) -> Result<Vec<u32>, RemoteError> {
        let mut sorted = addresses.to_vec();
        sorted.sort_unstable();
        let values = self.read(&sorted)?;
        let value = |address: &u16| sorted.binary_search(address).map_or(0, |at| values[at]);
        Ok(addresses.iter().map(value).collect())
    }
}

impl<L: Line> Remote for Board<L> {
    fn state(&mut self) -> Result<State, RemoteError> {
        let control = self.register("control")?;
        let status = self.host.status().map_err(failed)?;
        let activity = match status {
            s if s.fault() => {
                let fault = self.register("fault")?;
                let slot = self.program.machine.slots.get(s.fault_slot());
                let slot = slot.map_or(String::new(), |slot| format!(" of slot {}", slot.name));
                let kind = fault_kind(fault);
                Activity::Faulted(BundleAddress::new(fault & 0xffff), format!("{kind}{slot}"))
            }
            s if s.halted() => Activity::Halted,
            s if s.in_reset() => Activity::Stopped,
            _ if control & HOLD == 0 => Activity::Runs,
            s if s.waiting() => Activity::Held,
            _ => Activity::InPeriod,
        };
        let issued = self.host.register_of(0, "issued").map_err(failed)?;
        Ok(State {
            activity,
            issued: BundleAddress::new(issued & 0xffff),
            periods: self.register("periods")?.into(),
            flags: status.flags(),
            drives: status.drives(),
        })
    }

    fn poll(&mut self) -> Result<State, RemoteError> {
        thread::sleep(POLL);
        self.state()
    }

    fn hold(&mut self) -> Result<(), RemoteError> {
        let control = self.register("control")?;
        self.set("control", control | HOLD)?;
        self.settle()
    }

    fn go(&mut self) -> Result<(), RemoteError> {
        let control = self.register("control")?;
        self.set("control", control & !HOLD)
    }

    fn step(&mut self) -> Result<(), RemoteError> {
        self.set("step", 1)?;
        self.settle()
    }

    fn restart(&mut self) -> Result<(), RemoteError> {
        self.set("control", RUN | HOLD | RESTART | self.enable)?;
        self.settle()
    }

    fn set_input(&mut self, port: Register, bits: u32) -> Result<(), RemoteError> {
        let known = self.program.host_registers().find(|known| known.register == port);
        let name = known.map_or("", |port| &port.name);
        let (address, _) = Application::from(&self.program).settable(name).map_err(RemoteError::Other)?;
        self.host.write(address, &[bits]).map_err(failed)
    }

    fn inputs(&mut self) -> Result<Vec<u32>, RemoteError> {
        let addresses = self.ports(false)?;
        self.read_any(&addresses)
    }

    fn outputs(&mut self) -> Result<Vec<u32>, RemoteError> {
        let addresses = self.ports(true)?;
        self.read_any(&addresses)
    }

    fn registers(&mut self, registers: &[Register]) -> Result<Vec<u32>, RemoteError> {
        let application = Application::from(&self.program);
        let address = |register: &Register| {
            let missing = || RemoteError::Other(format!("the machine has no register at {register}"));
            application.register(0, *register).ok_or_else(missing)
        };
        let addresses = registers.iter().map(address).collect::<Result<Vec<_>, _>>()?;
        self.read_any(&addresses)
    }

    fn words(&mut self, words: &[u32]) -> Result<Vec<u32>, RemoteError> {
        let application = Application::from(&self.program);
        let address = |word: &u32| {
            let missing = || {
                RemoteError::Other(format!("data word {word} has no address for a host (docs/protocol.md)"))
            };
            application.word(0, *word).ok_or_else(missing)
        };
        let addresses = words.iter().map(address).collect::<Result<Vec<_>, _>>()?;
        self.read_any(&addresses)
    }
}
