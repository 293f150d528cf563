// SPDX-License-Identifier: MIT OR Apache-2.0
//! A board in simulation: the complete top level in Verilator, with pins that a plant moves and a UART that a host talks to.

use crate::application::Application;
use crate::boards::Board;
use crate::flash::{self, Flash};
use crate::kind::Direction;
use crate::protocol::{self, Line};
use crate::safety_watch::{self, Watch};
use crate::top::{self, AROUND, OSCILLATOR, TOP, TopError, simulated_oscillator};
use crate::wiring::Wiring;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;
use takt_rtl::export::DesignFile;
use takt_rtl::verilator::{Sources, VerilatorError};
use thiserror::Error;

const DRIVER: &str = include_str!("driver.cpp");
/// File in a simulation's folder with the contents of the flash; `driver.cpp` names it, too.
pub const FLASH: &str = "flash.bin";

/// Reason why a board cannot be simulated.
#[derive(Debug, Error)]
pub enum SimulationError {
    /// There is no circuit.
    #[error(transparent)]
    Top(#[from] TopError),
    /// Verilator is missing or failed.
    #[error(transparent)]
    Verilator(#[from] VerilatorError),
    /// The simulation cannot be started, or a file cannot be written.
    #[error("{0}: {1}")]
    Start(String, io::Error),
    /// The simulation ended.
    #[error("the simulation ended: {0}")]
    Ended(#[from] io::Error),
}

/// An encoder that turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderMotion {
    /// Pins of the encoder, as numbers of inputs.
    pub pins: [usize; 2],
    /// Count before the motion.
    pub from: i32,
    /// Counts of the motion; negative turns backwards.
    pub by: i32,
}

/// Changes of an output pin that end a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// From 0 to 1.
    Rise,
    /// From 1 to 0.
    Fall,
    /// Either.
    Both,
}

/// Conditions that end a run before its time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Watched {
    /// Output pins, as numbers of [`Simulation::outputs`], each with its edges.
    pub pins: Vec<(usize, Edge)>,
    /// The board's tick, of a board that was made from a program or a system.
    pub tick: bool,
}

/// End of a run: its length, and the conditions that were met.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stop {
    /// Cycles that were run. Output pins have their new levels from the cycle after them on.
    pub cycles: u32,
    /// The last of these cycles was that of the board's tick.
    pub tick: bool,
    /// For each of the watched pins, whether one of its edges has ended the run.
    pub edges: Vec<bool>,
}

/// The program that simulates a board, with all that it needs on a machine without Verilator. The comment of `driver.cpp` describes the
/// words on its standard input and output.
#[derive(Clone, Debug)]
pub struct Packed {
    /// The program, linked statically.
    pub program: PathBuf,
    /// Files that it reads in its working folder.
    pub files: Vec<DesignFile>,
    /// Input pins in the order of the words, each with its level at power-up.
    pub inputs: Vec<(String, bool)>,
    /// Output pins in the order of the words.
    pub outputs: Vec<String>,
}

impl Packed {
    /// Builds a board with a program, or a system; `folder` takes the files that the program reads.
    ///
    /// # Errors
    /// If there is no circuit for it, or Verilator is missing or fails.
    pub fn new<'a>(
        board: &Board,
        wiring: &Wiring,
        application: impl Into<Application<'a>>,
        folder: &Path,
    ) -> Result<Packed, SimulationError> {
        let application = application.into();
        let watch = Watch::new(wiring, &application);
        let files = top::circuit(board, wiring, application)?.files;
        let how = Linking { optimise: "-O2", defines: vec!["-static".to_owned()] };
        let (program, inputs, outputs) = build(&files, board, wiring, folder, Some(&watch), how)?;
        let files = files.into_iter().filter(|file| !is_verilog(file)).collect();
        let inputs = inputs.into_iter().map(|(name, level)| (name, level != 0)).collect();
        Ok(Packed { program, files, inputs, outputs })
    }
}

/// A simulated board.
#[derive(Debug)]
pub struct Simulation {
    process: Child,
    stdin: ChildStdin,
    stdout: ChildStdout,
    inputs: Vec<(String, u32)>,
    outputs: Vec<String>,
    /// Wires: an input and the output, by number, whose level it has a cycle later.
    wires: Vec<(usize, usize)>,
    /// Encoders that turn in the next cycles, once.
    pub turns: Vec<EncoderMotion>,
    /// One in this many bits of the UART is inverted, in either direction; 0 for none.
    pub noise: u32,
    /// The line is interrupted: bytes to the board are lost.
    pub unplugged: bool,
    /// Cycles simulated since reset.
    pub cycles: u64,
    /// Called with the time and reason when outputs become safe, if the board was made from a program or a system.
    pub tell: Option<fn(&str)>,
    watch: Option<Watch>,
    high: Vec<u32>,
    levels: Vec<u32>,
    seen: Vec<u32>,
    received: Vec<u8>,
}

impl Simulation {
    /// Builds a board with a program, or a system, in a folder, and starts it.
    ///
    /// # Errors
    /// If there is no circuit for it, or Verilator is missing or fails.
    pub fn new<'a>(
        board: &Board,
        wiring: &Wiring,
        application: impl Into<Application<'a>>,
        folder: &Path,
    ) -> Result<Simulation, SimulationError> {
        let application = application.into();
        let watch = Watch::new(wiring, &application);
        let files = top::circuit(board, wiring, application)?.files;
        Simulation::start(&files, board, wiring, folder, 0, Some(watch))
    }

    /// Builds a board from files, whose top level is [`TOP`] with the wiring's pins, and starts it in a folder, where memory images are
    /// written. Earlier builds are reused from the user's cache folder.
    ///
    /// # Errors
    /// If Verilator is missing or fails.
    pub fn of(
        files: &[DesignFile],
        board: &Board,
        wiring: &Wiring,
        folder: &Path,
    ) -> Result<Simulation, SimulationError> {
        Simulation::with_fault(files, board, wiring, folder, 0)
    }

    /// Starts like [`Simulation::of`], with one of the faults that [`takt_rtl::verilator::plant`] has planted in the files; 0 for none.
    ///
    /// # Errors
    /// If Verilator is missing or fails.
    pub fn with_fault(
        files: &[DesignFile],
        board: &Board,
        wiring: &Wiring,
        folder: &Path,
        fault: usize,
    ) -> Result<Simulation, SimulationError> {
        Simulation::start(files, board, wiring, folder, fault, None)
    }

    fn start(
        files: &[DesignFile],
        board: &Board,
        wiring: &Wiring,
        folder: &Path,
        fault: usize,
        watch: Option<Watch>,
    ) -> Result<Simulation, SimulationError> {
        let (built, inputs, outputs) =
            build(files, board, wiring, folder, watch.as_ref(), Linking::default())?;
        let start = |error| SimulationError::Start(built.display().to_string(), error);
        let mut process = Command::new(&built)
            .current_dir(folder)
            .arg(format!("+fault={fault}"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(start)?;
        let ended = || SimulationError::Ended(io::ErrorKind::BrokenPipe.into());
        let stdin = process.stdin.take().ok_or_else(ended)?;
        let stdout = process.stdout.take().ok_or_else(ended)?;
        Ok(Simulation {
            process,
            stdin,
            stdout,
            high: vec![0; outputs.len()],
            levels: vec![0; outputs.len()],
            inputs,
            outputs,
            wires: Vec::new(),
            turns: Vec::new(),
            noise: 0,
            unplugged: false,
            cycles: 0,
            tell: None,
            seen: vec![0; watch.as_ref().map_or(0, |watch| watch.seen().len())],
            watch,
            received: Vec::new(),
        })
    }

    /// The number of an input: `encoder_a`, `signal_stop`, `button`.
    pub fn input(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|(input, _)| input == name)
    }

    /// The inputs by name, each with its level.
    pub fn inputs(&self) -> impl Iterator<Item = (&str, bool)> {
        self.inputs.iter().enumerate().map(|(at, (name, level))| {
            let wire = self.wires.iter().find(|(input, _)| *input == at);
            (name.as_str(), wire.map_or(*level, |(_, output)| self.levels[*output]) != 0)
        })
    }

    /// Connects an output to an input, by their names in the circuit, from the next cycle on. Names that do not exist have no effect.
    pub fn wire(&mut self, output: &str, input: &str) {
        let output = self.outputs.iter().position(|name| name == output);
        self.wires.extend(self.input(input).zip(output));
    }

    /// Names of the outputs, by number.
    pub fn outputs(&self) -> &[String] {
        &self.outputs
    }

    /// Sets an input by its number, from the next cycle on; a number that does not exist has no effect.
    pub fn set_input(&mut self, input: usize, level: bool) {
        if let Some((_, own)) = self.inputs.get_mut(input) {
            *own = level.into();
        }
    }

    /// Levels of the outputs at the end of the last run, and the cycles of it in which each was 1, in the order of
    /// [`Simulation::outputs`].
    pub fn output_levels(&self) -> impl Iterator<Item = (bool, u32)> {
        self.levels.iter().zip(&self.high).map(|(level, high)| (*level != 0, *high))
    }

    /// Input ports that registers of peripherals drive, each with the register's value at the end of the last run: captured at the tick, or
    /// where the wiring has its `latch`. Empty for a board that was made from files.
    pub fn seen(&self) -> impl Iterator<Item = (&str, u32)> {
        let ports = self.watch.iter().flat_map(|watch| watch.seen());
        ports.map(|(port, _)| port.as_str()).zip(self.seen.iter().copied())
    }

    /// Sets an input by its name, from the next cycle on.
    pub fn set(&mut self, name: &str, level: bool) {
        if let Some(at) = self.input(name) {
            self.inputs[at].1 = level.into();
        }
    }

    /// An output's level at the end of the last run, and the cycles of it in which it was 1.
    pub fn output(&self, name: &str) -> Option<(bool, u32)> {
        let at = self.outputs.iter().position(|output| output == name)?;
        Some((self.levels[at] != 0, self.high[at]))
    }

    /// Runs `cycles` cycles, and starts sending these bytes to the board.
    ///
    /// # Errors
    /// If the simulation has ended.
    pub fn run(&mut self, cycles: u32, bytes: &[u8]) -> io::Result<()> {
        self.run_watched(cycles, bytes, &Watched::default()).map(|_| ())
    }

    /// Runs at most `cycles` cycles, at least one, and starts sending these bytes to the board; ends after the first cycle that gives a
    /// watched change. [`Simulation::turns`] are of the whole run: an encoder that turns in a run which ends early has not gone all the way.
    ///
    /// # Errors
    /// If the simulation has ended.
    pub fn run_watched(&mut self, cycles: u32, bytes: &[u8], watched: &Watched) -> io::Result<Stop> {
        let mut words = vec![cycles, self.noise];
        let inputs = words.len();
        words.extend(self.inputs.iter().map(|(_, level)| *level));
        for (input, output) in &self.wires {
            words[inputs + input] = 2 + *output as u32;
        }
        words.push(self.turns.len() as u32);
        for EncoderMotion { pins: [a, b], from, by } in self.turns.drain(..) {
            words.extend([a as u32, b as u32, from as u32, by as u32]);
            // The pins keep the levels at the end of the motion.
            let end = from.wrapping_add(by) as u32;
            self.inputs[a].1 = end.wrapping_add(1) >> 1 & 1;
            self.inputs[b].1 = end >> 1 & 1;
        }
        let bytes = if self.unplugged { &[] } else { bytes };
        words.push(bytes.len() as u32);
        words.extend(bytes.iter().map(|&byte| u32::from(byte)));
        words.push((watched.pins.len() + usize::from(watched.tick)) as u32);
        for (pin, edge) in &watched.pins {
            let edges = match edge {
                Edge::Rise => 1,
                Edge::Fall => 2,
                Edge::Both => 3,
            };
            words.extend([*pin as u32, edges]);
        }
        if watched.tick {
            words.extend([self.outputs.len() as u32, 1]);
        }
        let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.stdin.write_all(&words)?;
        self.stdin.flush()?;
        let begun = self.cycles;
        let (pins, many) = (watched.pins.len(), watched.pins.len().div_ceil(32));
        let head = self.words(3 + many)?;
        let (cycles, tick, count) = (head[0], head[1], head[2 + many]);
        let edges = (0..pins).map(|pin| head[2 + pin / 32] >> (pin % 32) & 1 == 1).collect();
        self.cycles += u64::from(cycles);
        // The rest has a length that is known, but for its last part.
        let (count, outputs, seen) = (count as usize, self.outputs.len(), self.seen.len());
        let mut rest = self.words(count + 2 * outputs + 1 + seen + 1)?;
        let moments = rest.pop().unwrap_or_default() as usize;
        if !self.unplugged {
            self.received.extend(rest[..count].iter().map(|&word| word as u8));
        }
        self.seen = rest.split_off(count + 2 * outputs + 1);
        rest.truncate(count + 2 * outputs);
        self.levels = rest.split_off(count + outputs);
        self.high = rest.split_off(count);
        for moment in self.words(safety_watch::WORDS * moments)?.chunks_exact(safety_watch::WORDS) {
            if let (Some(watch), Some(tell)) = (&self.watch, self.tell) {
                tell(&watch.text(begun, moment));
            }
        }
        Ok(Stop { cycles, tick: tick != 0, edges })
    }

    fn words(&mut self, count: usize) -> io::Result<Vec<u32>> {
        let mut bytes = vec![0; 4 * count];
        self.stdout.read_exact(&mut bytes)?;
        Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// Takes the bytes received from the board since the last call.
    pub fn take_received(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.received)
    }
}

impl Line for Simulation {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.run(1, bytes)
    }

    fn receive(&mut self) -> io::Result<Vec<u8>> {
        self.run(2000, &[])?;
        Ok(self.take_received())
    }

    fn patience(&self) -> u32 {
        40
    }

    /// Simulated time: one microsecond per cycle.
    fn time(&self) -> Duration {
        Duration::from_micros(self.cycles)
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

type Pins = (PathBuf, Vec<(String, u32)>, Vec<String>);

/// Options of compiler and linker.
struct Linking {
    optimise: &'static str,
    defines: Vec<String>,
}

impl Default for Linking {
    fn default() -> Linking {
        Linking { optimise: "-O1", defines: Vec::new() }
    }
}

fn is_verilog(file: &DesignFile) -> bool {
    [".v", ".vh"].iter().any(|end| file.name.ends_with(end))
}

fn build(
    files: &[DesignFile],
    board: &Board,
    wiring: &Wiring,
    folder: &Path,
    watch: Option<&Watch>,
    how: Linking,
) -> Result<Pins, SimulationError> {
    // Verilog, which is compiled, and files that a simulation reads when it runs.
    let (verilog, read): (Vec<_>, Vec<_>) = files.iter().partition(|file| is_verilog(file));
    for file in read {
        let path = folder.join(&file.name);
        fs::create_dir_all(path.parent().unwrap_or(folder))
            .and_then(|()| fs::write(&path, &file.text))
            .map_err(|error| SimulationError::Start(path.display().to_string(), error))?;
    }
    fs::create_dir_all(folder)
        .map_err(|error| SimulationError::Start(folder.display().to_string(), error))?;
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    if let Some(reset) = &board.reset {
        inputs.push(("button".to_owned(), u32::from(!reset.level)));
    }
    for top::OwnPin { name, direction, .. } in top::own_pins(wiring) {
        match direction {
            // `stop` is 1 when open, but here it is wired.
            Direction::Input => inputs.push((name, 0)),
            Direction::Output => outputs.push(name),
        }
    }
    let divide = (wiring.clock * 1e6 / f64::from(wiring.baud)).round();
    let mut header = format!(
        "#define UART {}\n#define DIVIDE {divide}\n#define INPUTS {}\n#define OUTPUTS {}\n",
        u8::from(wiring.uart),
        inputs.len(),
        outputs.len()
    );
    let lists = [
        ("input", inputs.iter().map(|(name, _)| name).collect::<Vec<_>>()),
        ("output", outputs.iter().collect()),
    ];
    for (what, names) in lists {
        let _ = writeln!(header, "static void {what}_pins(Vtop *top, CData **pins) {{");
        for name in names {
            let _ = writeln!(header, "    *pins++ = &top->{name};");
        }
        let _ = writeln!(header, "    (void)top; (void)pins;\n}}");
    }
    // The levels at the flash's pins; the clock of a configuration flash is at none.
    for (own, way) in flash::PINS.into_iter().filter(|_| wiring.flash.is_some()) {
        let name = format!("flash_{own}");
        let (at, list) = match way {
            Direction::Input => (inputs.iter().position(|(input, _)| *input == name), "inputs"),
            Direction::Output => (outputs.iter().position(|output| *output == name), "outputs"),
        };
        let level = match at {
            Some(at) => format!("(*{list}[{at}])"),
            None => format!("(top.{})", safety_watch::net(&name)),
        };
        let _ = writeln!(header, "#define FLASH_{} {level}", own.to_uppercase());
    }
    let watched = watch.map_or_else(|| "#define CORES 0\n#define SEEN 0\n".to_owned(), Watch::header);
    let mut kept = watch.map_or_else(|| "`verilator_config\n".to_owned(), Watch::configuration);
    let flash_clock =
        board.family.flash_clock.filter(|_| wiring.flash.as_ref().is_some_and(Flash::is_configuration));
    if flash_clock.is_some() {
        kept += &safety_watch::kept(AROUND, "flash_clock");
    }
    let oscillator = simulated_oscillator(board, wiring);
    let verilog = verilog.into_iter().map(|file| match &oscillator {
        Some(text) if file.name == OSCILLATOR => (OSCILLATOR, text.as_str()),
        _ => (file.name.as_str(), file.text.as_str()),
    });
    let sources = Sources {
        name: TOP,
        top: TOP,
        prefix: "Vtop",
        files: board
            .family
            .pll
            .iter()
            .map(|pll| pll.stand_in)
            .chain(flash_clock.map(|clock| clock.stand_in))
            .chain(verilog)
            .collect(),
        driver: DRIVER,
        headers: vec![("pins.h", &header), ("watch.h", &watched), ("watch.vlt", &kept)],
        arguments: vec!["-Wno-fatal".to_owned(), "watch.vlt".to_owned()],
        defines: how.defines,
        optimise: how.optimise,
        trace: false,
    };
    Ok((sources.build(&takt_cache::folder().map_err(VerilatorError::Cache)?)?, inputs, outputs))
}

const _: () = assert!(protocol::WORDS == 16, "takt_bridge keeps 16 words");
