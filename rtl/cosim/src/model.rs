//! A core in Verilator: built once for each design and kept, run as a process.

use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use takt_isa::load::{LoadRecord, Space, load_records};
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register};
use takt_rtl::Design;
use takt_rtl::export::RESET_CYCLES;
use takt_rtl::verilator::{Sources, VerilatorError};
use thiserror::Error;

/// The other half of [`Simulation`].
const DRIVER: &str = include_str!("driver.cpp");
/// What it shares with that of a system.
const SHARED: &str = include_str!("driver.h");

/// Why the circuit cannot be simulated.
#[derive(Debug, Error)]
pub enum ModelError {
    /// There is no program.
    #[error(transparent)]
    Verilator(#[from] VerilatorError),
    /// A file cannot be written or read.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// The simulation ended.
    #[error("the simulation ended early: {0}")]
    Ended(String),
}

fn file_error(path: &Path) -> impl FnOnce(std::io::Error) -> ModelError {
    let path = path.display().to_string();
    move |source| ModelError::File { path, source }
}

/// A design compiled for simulation.
#[derive(Clone, Debug)]
pub struct Model {
    program: PathBuf,
    latched: u16,
}

/// What the driver must know of the machine.
fn ports(design: &Design) -> String {
    let slots = design.machine.slots;
    let mut text = format!(
        "#define SLOTS {}\n#define RESET_CYCLES {RESET_CYCLES}\n#define OUTPUTS {}\n#define LATCHED {}\n\
         template <class F> static void outputs(F f) {{\n",
        slots.len(),
        design.machine.outputs_per_bank,
        design.latched
    );
    for (s, slot) in slots.iter().enumerate() {
        let (b, first) = (slot.bank.name, slot.bank.base + slot.bank.depth - design.machine.outputs_per_bank);
        text.push_str(&format!(
            "    f({s}, top->output_{b}_write && !top->rst, {first} + top->output_{b}_index, top->output_{b}_value);\n"
        ));
    }
    text.push_str("}\n");
    text
}

/// The sources of a simulation, from its Verilog, its driver and the driver's headers.
pub(crate) fn sources<'a>(
    (top, prefix): (&'a str, &'static str),
    files: Vec<(&'a str, &'a str)>,
    driver: &'a str,
    header: (&'a str, &'a str),
    trace: bool,
) -> Sources<'a> {
    let headers = vec![("driver.h", SHARED), header];
    let (arguments, defines) = (Vec::new(), Vec::new());
    Sources { name: top, top, prefix, files, driver, headers, arguments, defines, optimise: "-O1", trace }
}

impl Model {
    /// Compiles a design, or finds it in the folder as it was compiled before. With `trace` it can write waveforms.
    ///
    /// # Errors
    /// If Verilator or a C++ compiler is missing or fails.
    pub fn build(design: &Design, folder: &Path, trace: bool) -> Result<Model, ModelError> {
        let files = design.files.iter().map(|file| (file.name.as_str(), file.text.as_str())).collect();
        let ports = ports(design);
        let mut sources = sources((&design.top, "Vcore"), files, DRIVER, ("ports.h", &ports), trace);
        sources.arguments.push(format!("-GLATCHED={}", design.latched));
        Ok(Model { program: sources.build(folder)?, latched: design.latched })
    }

    /// Starts a simulation. A model that can trace writes its waveform to the first argument; others are Verilog's plusargs.
    ///
    /// # Errors
    /// If the process cannot be started.
    pub fn start(&self, arguments: &[&OsStr]) -> Result<Simulation, ModelError> {
        Ok(Simulation { process: Process::start(&self.program, arguments, None)?, latched: self.latched })
    }
}

/// Something that happens in the circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CircuitEvent {
    /// The cycle: that of the issue, the writeback, the tick.
    pub cycle: Cycle,
    /// What.
    pub kind: EventKind,
    /// The slot, where it is one's.
    pub slot: u8,
    /// The bundle; of a store, the data word.
    pub address: u32,
    /// The register that is written; of a fault, its kind; of an output that is published, its number.
    pub register: u16,
    /// The value that is written.
    pub value: u32,
    /// The flags that were raised, as the status register has them.
    pub flags: u8,
}

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EventKind {
    /// A bundle issues.
    Issue,
    /// A store issues.
    Store,
    /// A register is written.
    Retire,
    /// An output port is written.
    Port,
    /// A deadline is missed.
    Missed,
    /// A tick is lost.
    Lost,
    /// The machine halts.
    Halt,
    /// A fault.
    Fault,
    /// A `wait` issues, and what was written to an output port since the last one is what the outside sees there.
    Publish,
    /// A value stands on the input pins: of a system, where the driver shows it.
    Input,
}

const KINDS: [EventKind; 10] = [
    EventKind::Issue,
    EventKind::Store,
    EventKind::Retire,
    EventKind::Port,
    EventKind::Missed,
    EventKind::Lost,
    EventKind::Halt,
    EventKind::Fault,
    EventKind::Publish,
    EventKind::Input,
];

/// What stands on a pin in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pin {
    /// The tick.
    Tick,
    /// A value for an input port.
    Input {
        /// The port: index into the inputs' bank.
        index: u16,
        /// Its new value.
        value: u32,
    },
}

/// A compiled simulation that runs, and the pipes to it.
#[derive(Debug)]
pub(crate) struct Process {
    process: Child,
    stdin: Option<ChildStdin>,
    stdout: Option<ChildStdout>,
}

impl Process {
    /// Starts a program, in a folder if there is one.
    pub(crate) fn start(
        program: &Path,
        arguments: &[&OsStr],
        folder: Option<&Path>,
    ) -> Result<Process, ModelError> {
        let mut command = Command::new(program);
        if let Some(folder) = folder {
            command.current_dir(folder);
        }
        let mut process = command
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(file_error(program))?;
        let (stdin, stdout) = (process.stdin.take(), process.stdout.take());
        Ok(Process { process, stdin, stdout })
    }

    pub(crate) fn send(&mut self, words: &[u32]) -> Result<(), ModelError> {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let sent = self.stdin.as_mut().map(|stdin| stdin.write_all(&bytes).and_then(|()| stdin.flush()));
        if matches!(sent, Some(Ok(()))) { Ok(()) } else { Err(self.ended()) }
    }

    /// So many words.
    pub(crate) fn receive(&mut self, count: usize) -> Result<Vec<u32>, ModelError> {
        let mut bytes = vec![0; 4 * count];
        let read = self.stdout.as_mut().map(|stdout| stdout.read_exact(&mut bytes));
        if !matches!(read, Some(Ok(()))) {
            return Err(self.ended());
        }
        let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
        Ok(bytes.chunks_exact(4).map(word).collect())
    }

    fn ended(&mut self) -> ModelError {
        self.stdin = None;
        let mut text = String::new();
        if let Some(stderr) = self.process.stderr.as_mut() {
            let _ = stderr.read_to_string(&mut text);
        }
        ModelError::Ended(text)
    }

    /// Ends it in order.
    pub(crate) fn finish(&mut self) {
        self.stdin = None;
        let _ = self.process.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It ends when nobody speaks or listens to it.
        (self.stdin, self.stdout) = (None, None);
        let _ = self.process.wait();
    }
}

/// Words of an event, as the drivers send it.
pub(crate) const EVENT_WORDS: usize = 8;

/// A core's event from a driver's words; `None` if it is of another kind.
pub(crate) fn circuit_event(words: &[u32]) -> Option<CircuitEvent> {
    Some(CircuitEvent {
        kind: *KINDS.get(words[0] as usize)?,
        cycle: words[1].into(),
        address: words[2],
        slot: words[3] as u8,
        register: words[4] as u16,
        value: words[5],
        flags: words[6] as u8,
    })
}

/// A running simulation.
#[derive(Debug)]
pub struct Simulation {
    process: Process,
    latched: u16,
}

impl Simulation {
    /// The input ports of this circuit that are latched; 0 if its ports are not.
    pub fn latched(&self) -> u16 {
        self.latched
    }

    /// Resets the circuit and loads a program and the first values of input ports.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn load(&mut self, program: &Program, inputs: &[(Register, u32)]) -> Result<(), ModelError> {
        let bank = &program.machine.inputs;
        let first = inputs.iter().filter_map(|&(register, bits)| {
            let address = bank.index(register)?.get();
            Some(LoadRecord { space: Space::Input, slot: 0, address, value: bits.into() })
        });
        let records: Vec<LoadRecord> = load_records(program).into_iter().chain(first).collect();
        let mut words = vec![1, records.len() as u32];
        for LoadRecord { space, slot, address, value } in records {
            words.extend([space as u32, slot.into(), address.into(), value as u32, (value >> 32) as u32]);
        }
        self.process.send(&words)
    }

    /// Runs until so many cycles have passed since reset. `pins` are sorted by cycle; none of a cycle that has passed.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn run(&mut self, until: Cycle, pins: &[(Cycle, Pin)]) -> Result<Vec<CircuitEvent>, ModelError> {
        let mut words = vec![2, until as u32, pins.len() as u32];
        for &(cycle, pin) in pins {
            words.extend(match pin {
                Pin::Tick => [cycle as u32, 1, 0, 0],
                Pin::Input { index, value } => [cycle as u32, 2, index.into(), value],
            });
        }
        self.process.send(&words)?;
        let count = self.process.receive(1)?[0] as usize;
        let words = self.process.receive(EVENT_WORDS * count)?;
        Ok(words.chunks_exact(EVENT_WORDS).filter_map(circuit_event).collect())
    }

    /// Writes a waveform of these cycles of the next run; the model must have been built for it.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn trace(&mut self, first: Cycle, last: Cycle) -> Result<(), ModelError> {
        self.process.send(&[3, first as u32, last as u32])
    }

    /// Ends the simulation in order, so that its waveform is whole.
    pub fn finish(mut self) {
        self.process.finish();
    }
}
