// SPDX-License-Identifier: MIT OR Apache-2.0
//! Hardware kit: a program that applies every computing instruction of its machine, in each slot that executes it, to pseudo-random
//! operands, and a wiring that puts it on a board with two loop-backs.
//!
//! Operands come from xorshift generators (Marsaglia, Xorshift RNGs, 2003), by turns any bits and moderate numbers. A register for each
//! instruction keeps a digest of its results, which the host reads. The emulator, which runs the same program, has the digests and cycles
//! to compare with. An instruction that is added to the table is in the program without a change here.

mod run;
mod text;

pub use run::{Clock, Comparison, LoopBack, Options, Report, check, run};

use crate::application::Application;
use crate::boards::Board;
use crate::latency::to_outputs;
use crate::protocol::LinkError;
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_emu::{Emulator, LoadError, PeriodError};
use takt_isa::program::Port;
use takt_isa::{Effect, Function, Machine, Program, ROWS, Row};
use thiserror::Error;

/// Operands of each instruction in a period, by turns of either kind.
pub const BATCH: u32 = 8;
/// Operands of each instruction that a board is tested with.
pub const OPERANDS: u32 = 1_000_000;
/// Most operands of each instruction: the program counts them in an integer.
pub const MOST_OPERANDS: u32 = 1 << 30;
/// Least operands of each instruction: some periods with loop-backs.
pub const LEAST_OPERANDS: u32 = 8 * BATCH;

/// Baud rate, if the clock makes it.
const BAUD: f64 = 1e6;
/// Highest clock in MHz; a faster one of a board is halved.
const CLOCK: f64 = 50.0;
/// Half a period of the PWM in cycles. The board's period is a multiple of the whole, so that each has the same number of pulses.
const HALF: u64 = 100;
/// Cycles by which a word's frame starts before the tick: longer than the frame.
const LEAD: u64 = 300;
/// Cycles of a period that are left for requests of the host, 160 of them without a pause.
const ROOM: u64 = 400;
/// Half a bit of a word in cycles.
const HALF_BIT: u64 = 8;

/// Names that program and wiring share.
const PULSES: &str = "pulses";
const RECEIVED: &str = "received";
const WORD: &str = "word";
const ROUNDS: &str = "rounds";
const DONE: &str = "done";
const COUNTED: &str = "counted";
const ECHOES: &str = "echoes";

/// Reason why a board cannot be tested.
#[derive(Debug, Error)]
pub enum SelftestError {
    /// The operands are made by integer instructions.
    #[error("the hardware kit needs a unit with integer instructions, which {0} does not have")]
    NoIntegers(String),
    /// The board has too few pins for the loop-backs.
    #[error("the hardware kit needs {needed} pins for its wires; {board} has {there}")]
    Pins {
        /// Name of the board.
        board: String,
        /// Pins of the board.
        there: usize,
        /// Pins of the kit.
        needed: usize,
    },
    /// A register or a port of the kit is missing.
    #[error(
        "the program is not the hardware kit of this version of takt, whose `{0}` it lacks: `takt board selftest --board` writes it"
    )]
    Foreign(String),
    /// The wiring is not the kit's.
    #[error(
        "the wiring is not the hardware kit's: it has no `{0}` with a pin for a wire: `takt board selftest --board` writes it"
    )]
    Wiring(&'static str),
    /// The board lacks a UART.
    #[error("the wiring has no UART (`uart = false`), over which the hardware kit reports")]
    NoUart,
    /// The host cannot read the registers with the digests.
    #[error(
        "the host cannot read the board's registers, where the digests are: the wiring says `observe = false`"
    )]
    Unobserved,
    /// A register of the board differs from the wiring or the program.
    #[error(
        "the board does not carry this hardware kit: its register `{register}` has {there}, the kit's {wanted}; configure it with the bitstream built from these files"
    )]
    Other {
        /// Register of the board.
        register: &'static str,
        /// Value of the register.
        there: u32,
        /// Value of the kit.
        wanted: u32,
    },
    /// The board has the program of another kit: registers lie elsewhere.
    #[error(
        "the board carries another program than that of this hardware kit, from record {0} on; configure it with the bitstream built from these files, or load the program with `takt load`"
    )]
    OtherProgram(usize),
    /// The program has stopped on the board.
    #[error("the program has stopped on the board: {0}, after {1} operands")]
    Stopped(String, u32),
    /// The program does not get on.
    #[error("the program stands still on the board, after {0} operands")]
    Still(u32),
    /// The board does not answer.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The program has no circuit.
    #[error(transparent)]
    Top(#[from] crate::top::TopError),
    /// The program does not fit the emulator.
    #[error("the emulator cannot run the program: {0}")]
    Load(#[from] LoadError),
    /// The program stops in the emulator.
    #[error("the program stops in the emulator: {0}")]
    Period(#[from] PeriodError),
}

/// Instruction in a slot.
#[derive(Clone, Debug)]
pub struct Operation {
    /// Mnemonic; with the slot, `fadd.mac`, if several execute it.
    pub name: String,
    /// Unit that executes it.
    pub unit: &'static str,
    row: &'static Row,
}

impl Operation {
    /// Register with the digest of the results.
    fn digest(&self) -> String {
        format!("digest_{}", self.name.replace('.', "_"))
    }
}

/// Computing instructions of a machine, in each slot that executes them.
pub fn operations(machine: &Machine) -> Vec<Operation> {
    let mut all = Vec::new();
    for row in ROWS.iter().filter(|row| row.effect == Effect::Compute) {
        let slots: Vec<_> =
            machine.slots.iter().filter_map(|slot| Some((slot.name, slot.unit(row.function)?))).collect();
        let is_one = slots.len() == 1;
        all.extend(slots.into_iter().map(|(slot, unit)| {
            let name = if is_one { row.mnemonic.to_owned() } else { format!("{}.{slot}", row.mnemonic) };
            Operation { name, unit: unit.name, row }
        }));
    }
    all
}

const HEAD: &str = "\
; The hardware kit: every computing instruction on pseudo-random operands, and a digest of its results in a register.
; Written by `takt board selftest`: docs/board.md.
";

const PORTS: &str = "
.schedule on

.input  rounds:int                      ; operands of each instruction, from the host
.input  pulses:int                      ; pulses of the PWM at the other end of a wire
.input  received:int                    ; word that has come back over a wire
.output word:int                        ; word that is sent before the next tick
.output counted:int                     ; pulses in the periods that are compared

.state  done:int first:int echoes:int   ; operands so far; pulses before; words that came back
.preset done = 0
.preset first = 0
.preset echoes = 0
";

const MACROS: &str = "
.reg    a:bits b:bits c:bits result:bits any:bits special:bits is_moderate:int
.reg    goes:int counts:int same:int

.macro  random  x:bits                  ; xorshift
.reg    t:bits
        ishl    t, x, 13
        ixor    x, x, t
        ishr    t, x, 17
        ixor    x, x, t
        ishl    t, x, 5
        ixor    x, x, t
.endm

; By turns a moderate number, from 2^-7 to 2^9, and any bits: of a quarter the fraction is 0, of a quarter the exponent is 0, and of a
; quarter the exponent is all ones.
.macro  operand x:bits, s:bits
.reg    t:bits u:bits
        random  s
        ishl    any, any, 1
        isar    t, any, 31
        ior     t, t, 0xff800000
        iand    t, t, s
        ishl    any, any, 1
        isar    u, any, 31
        ior     u, u, 0x807fffff
        iand    t, t, u
        ishl    special, special, 1
        isar    u, special, 31
        iand    u, u, 0x7f800000
        ior     t, t, u
        iand    u, s, 0x87ffffff
        iadd    u, u, 0x3c000000
        sel     x, is_moderate, u, t
.endm

; A sum before the rotation: exclusive ors would cancel an error that is the same in 64 results.
.macro  fold    d:bits
.reg    t:bits u:bits
        iadd    t, d, result
        ishl    u, t, 13
        ishr    t, t, 19
        ior     d, u, t
.endm

.once
        li      word, 0x4000
        mov     counted, zero
        wait    period

.period
period: ilt     goes, done, rounds
        bz      goes, idle
";

const OPERAND_LINES: &str = "\
        iand    is_moderate, k, 1
        random  random_y
        random  random_z
        ior     any, random_y, random_z
        iand    special, random_y, random_z
        ishl    special, special, 16
        operand a, random_a
        operand b, random_b
        operand c, random_c
";

/// States of the generators: of the three operands, and of the choice among their kinds. First bits of square roots and of e, π, φ.
const SEEDS: [(&str, u32); 5] = [
    ("random_a", 0x9e37_79b9),
    ("random_b", 0x243f_6a88),
    ("random_c", 0xb7e1_5162),
    ("random_y", 0x6a09_e667),
    ("random_z", 0xbb67_ae85),
];

/// Source of the program for a machine. `file` names the machine's file, for one that is not built in.
///
/// # Errors
/// If the machine has no integer instructions.
pub fn source(machine: &Machine, file: &str) -> Result<String, SelftestError> {
    if machine.host(Function::Alu).is_none() {
        return Err(SelftestError::NoIntegers(machine.name.to_owned()));
    }
    let directive = if machine.is_builtin() { machine.directive() } else { format!(".machine \"{file}\"") };
    let mut text = format!("{directive}\n{HEAD}{PORTS}");
    let operations = operations(machine);
    for (name, seed) in SEEDS {
        let _ = writeln!(text, ".state  {name}:bits\n.preset {name} = {seed:#x}");
    }
    for operation in &operations {
        let digest = operation.digest();
        let _ = writeln!(text, ".state  {digest}:bits\n.preset {digest} = 0");
    }
    text += MACROS;
    let _ = write!(
        text,
        "        ilt     counts, {BATCH}, done       ; not in the first two periods
        sel     first, counts, first, pulses
        isub    counted, pulses, first
        ieq     same, received, word
        iand    same, same, counts
        iadd    echoes, echoes, same
        .for    k, 1, {BATCH} unroll 1
{OPERAND_LINES}"
    );
    for operation in &operations {
        let sources = ["a", "b", "c"].iter().take(operation.row.shape.sources());
        let sources = sources.copied().collect::<Vec<_>>().join(", ");
        let _ = writeln!(
            text,
            "        {:<7} result, {sources}\n        fold    {}",
            operation.name,
            operation.digest()
        );
    }
    let _ = write!(
        text,
        "        .endfor
        iadd    done, done, {BATCH}
        iand    word, random_a, 0x3fff  ; no level that stands is a word
        ior     word, word, 0x4000
idle:   wait    period
"
    );
    Ok(text)
}

/// Pins of the wires, of the PWM and of the SPI: each from an output to an input.
const WIRES: usize = 2;
/// Pins of the kit: the wires' ends, and clock and selection of the SPI, which nothing is connected to.
const PINS: usize = 2 * WIRES + 2;

/// Text of the wiring for a board, at its first pins; the longest period of the program takes `cycles`.
///
/// # Errors
/// If the board has too few pins.
pub fn wiring(board: &Board, cycles: u64) -> Result<String, SelftestError> {
    let names: Vec<&str> = board.pins.iter().map(|(name, _)| name.as_str()).collect();
    let Some(&[pulse, pulses, out, back, clock_pin, select]) = names.first_chunk::<PINS>() else {
        return Err(SelftestError::Pins { board: board.name.clone(), there: names.len(), needed: PINS });
    };
    let mut clock = board.clock.1;
    while clock > CLOCK {
        clock /= 2.0;
    }
    let period = (to_outputs(cycles, 2, 1) + LEAD + ROOM).next_multiple_of(2 * HALF);
    let micros = |cycles: u64| cycles as f64 / clock;
    let mut text = format!(
        "# The hardware kit, written by `takt board selftest`: docs/board.md.
# Wires, which may be left out: {pulse} to {pulses}, {out} to {back}.

"
    );
    if Board::names().any(|name| name == board.name) {
        let _ = writeln!(text, "board = \"{}\"", board.name);
    }
    if clock < board.clock.1 {
        let _ = writeln!(text, "clock = {clock}             # MHz");
    }
    let _ = writeln!(text, "period = {:?}        # µs", micros(period));
    let _ = writeln!(text, "lead = {:?}            # µs", micros(LEAD));
    let divide = clock * 1e6 / BAUD;
    if (divide.round() / divide - 1.0).abs() < 0.02 && divide >= 4.0 {
        let _ = writeln!(text, "baud = {BAUD}");
    }
    let _ = write!(
        text,
        "
[peripheral.pulse]
kind = \"pwm\"
pins = {{ high = \"{pulse}\" }}
half = {HALF}

[peripheral.pulses]
kind = \"digital-in\"
pins = {{ in = \"{pulses}\" }}
ports = {{ rises = \"{PULSES}\" }}

[peripheral.words]
kind = \"spi\"
pins = {{ out = \"{out}\", in = \"{back}\", clock = \"{clock_pin}\", select = \"{select}\" }}
half = {HALF_BIT}
ports = {{ send = \"{WORD}\", received = \"{RECEIVED}\" }}
"
    );
    Ok(text)
}

/// Wire of the kit: its ends as pins of the board, and as pins of peripherals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wire {
    /// Signal over the wire.
    pub text: &'static str,
    /// Pin of the board that drives the wire, and pin that reads it.
    pub pins: [String; 2],
    /// The same as pins of the simulated board: `pulse.high`, `pulses.in`.
    pub names: [String; 2],
}

/// Wires of the kit: those of the PWM, and of the SPI.
///
/// # Errors
/// If the wiring is not the kit's.
pub fn wires(wiring: &Wiring) -> Result<[Wire; WIRES], SelftestError> {
    let end = |kind: &'static str, pin: &str| {
        let mut found = wiring.peripherals.iter().filter(|peripheral| peripheral.kind.name == kind);
        let end = found.find_map(|of| {
            let at = of.kind.pins.iter().position(|own| own.name == pin)?;
            Some((of.pins.get(at)?.clone()?, format!("{}.{pin}", of.name)))
        });
        end.ok_or(SelftestError::Wiring(kind))
    };
    let wire = |text, from: (&'static str, &str), to: (&'static str, &str)| {
        let ((from, from_name), (to, to_name)) = (end(from.0, from.1)?, end(to.0, to.1)?);
        Ok::<Wire, SelftestError>(Wire { text, pins: [from, to], names: [from_name, to_name] })
    };
    Ok([wire("PWM", ("pwm", "high"), ("digital-in", "in"))?, wire("SPI", ("spi", "out"), ("spi", "in"))?])
}

/// Results of the program in the emulator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Emulated {
    /// Digest of each instruction, in the order of [`operations`].
    pub digests: Vec<u32>,
    /// Operands of each instruction: those that were asked for, in whole periods.
    pub done: u32,
    /// Cycles of the longest period, from the tick to the `wait`.
    pub cycles: u64,
}

/// Finds a register or port of the kit's program.
fn named<'p>(program: &'p Program, name: &str) -> Result<&'p Port, SelftestError> {
    let mut all = program.named_registers();
    all.find(|port| port.name == name).ok_or_else(|| SelftestError::Foreign(name.to_owned()))
}

/// Runs the program in the emulator.
///
/// # Errors
/// If it is not the kit's.
pub fn emulate(program: &Program, operands: u32) -> Result<Emulated, SelftestError> {
    let rounds = named(program, ROUNDS)?.register;
    let done = named(program, DONE)?.register;
    let digests: Vec<_> = operations(program.machine)
        .iter()
        .map(|operation| Ok(named(program, &operation.digest())?.register))
        .collect::<Result<_, SelftestError>>()?;
    let mut emulator = Emulator::new(program)?;
    // The digests do not depend on the inputs from the wires.
    for port in &program.inputs {
        let bits = if port.register == rounds { operands } else { 0 };
        emulator
            .set_input_bits(port.register, bits)
            .map_err(|_| SelftestError::Foreign(port.name.clone()))?;
    }
    let mut cycles = 0;
    let mut before = 0;
    loop {
        cycles = cycles.max(emulator.run_period(&[])?.cycles);
        let now = emulator.register(done).unwrap_or(0);
        if now >= operands {
            let digests = digests.iter().map(|register| emulator.register(*register).unwrap_or(0));
            return Ok(Emulated { digests: digests.collect(), done: now, cycles });
        }
        if now == before {
            return Err(SelftestError::Foreign(DONE.to_owned()));
        }
        before = now;
    }
}

/// Cycles from the board's tick to the peripherals' new values, by the emulator's cycles of a period: the register `cycles`.
fn board_cycles(wiring: &Wiring, cycles: u64) -> u64 {
    let count =
        |all: fn(&crate::wiring::Peripheral) -> usize| wiring.peripherals.iter().map(all).sum::<usize>();
    let reads = count(|of| of.reads.iter().flatten().count());
    let writes = count(|of| of.writes.iter().flatten().count());
    to_outputs(cycles, reads as u64, writes as u64)
}

/// The address at which the host reads a register or port of the program.
fn address(application: &Application<'_>, name: &str) -> Result<u16, SelftestError> {
    application.find(name).map(|place| place.read).map_err(|_| SelftestError::Foreign(name.to_owned()))
}
