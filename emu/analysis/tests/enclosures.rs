// SPDX-License-Identifier: MIT OR Apache-2.0
//! Falsifier of `takt accuracy`: random programs over all operations, with inputs at the ends of their ranges; every statement of an
//! [`Enclosure`] is compared with the run.
//!
//! Campaign: `TAKT_PROGRAMS=10000 cargo test --release -p takt-analysis --test suite enclosures::`; `TAKT_SEED` moves its seeds.
#![allow(clippy::print_stdout)]

use crate::accuracy::port;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use takt_analysis::accuracy::{Enclosure, MAX_UNROLLED, Problem, Shadow, StateRange, enclose_within};
use takt_asm::{MemoryLoader, Options};
use takt_emu::testing::Random;
use takt_emu::{Emulator, Status, Step};
use takt_isa::fp::{Flags, Host};
use takt_isa::program::{Range, Space};
use takt_isa::timing::Cycle;
use takt_isa::{Effect, Instruction, MACHINES, Machine, Program, ROWS, Register, Row, Type, compute};

/// Programs per run of the tests, and periods of each.
const PROGRAMS: u64 = 600;
const PERIODS: usize = 48;
/// Limit on the cycles of a period; the run is abandoned beyond it.
const LONGEST: Cycle = 20_000;

/// Words that operations on bits meet in practice: masks, exponents, integers; and constants that round to integers.
const CONSTANTS: [&str; 24] = [
    "0x7fffffff",
    "0x80000000",
    "0xff800000",
    "0x007fffff",
    "0xfffff000",
    "0xffffffff",
    "0",
    "1",
    "3",
    "23",
    "127 << 23",
    "1 << 23",
    "2 << 23",
    "-(1 << 23)",
    "0x3f2aaaab",
    "0x3f800000",
    "12582912.0",
    "8388608.0",
    "-12582912.0",
    "1.0",
    "-0.5",
    "0.7",
    "1082130432.0",
    "3.0e38",
];

fn pick<'a, T: ?Sized>(random: &mut Random, from: &[&'a T]) -> &'a T {
    from[random.below(from.len() as u32) as usize]
}

/// Ends of a range: of usual size, around powers of two, tiny, large, of one sign or both.
fn ends(random: &mut Random) -> (f32, f32) {
    let number = |random: &mut Random| {
        let unit = random.below(1 << 20) as f32 / (1 << 19) as f32 - 1.0;
        match random.below(12) {
            0 => 0.0,
            1 => [1.0, -1.0, 2.0, 0.5, 4.0][random.below(5) as usize],
            2 => unit * 1e-38,
            3 => f32::from_bits(random.below(1 << 23)) * unit.signum(),
            4 => unit * 5e6,
            5 => unit * 3e9,
            6 => unit * 1e20,
            7 => unit * 3e38,
            8 => unit * 100.0,
            _ => unit * 3.0,
        }
    };
    let one = number(random);
    let other = match random.below(3) {
        0 => one * (1.0 + random.below(1000) as f32 / 1e4),
        _ => number(random),
    };
    if one.is_finite() && other.is_finite() { (one.min(other), one.max(other)) } else { (-1.0, 1.0) }
}

/// Writes a program of straight lines, branches and loops over all operations of a machine.
struct Writer<'r> {
    random: &'r mut Random,
    text: String,
    /// Names that hold floats and integers, preferred as operands.
    floats: Vec<String>,
    integers: Vec<String>,
    temporaries: Vec<String>,
    labels: u32,
    rows: Vec<&'static Row>,
}

impl Writer<'_> {
    fn operand(&mut self, ty: Type) -> String {
        let random = &mut *self.random;
        let suffix = match ty {
            Type::F => "float",
            Type::I => "int",
            Type::B => "bits",
        };
        let constants = match ty {
            // Constants from index 16 on are float literals or rounding constants.
            Type::F => &CONSTANTS[16..],
            _ => &CONSTANTS[..16],
        };
        if random.once_in(if ty == Type::F { 6 } else { 3 }) {
            return pick(random, constants).to_owned();
        }
        let float = match ty {
            Type::F => !random.once_in(12),
            Type::I => random.once_in(4),
            Type::B => random.once_in(2),
        };
        let names = if float || self.integers.is_empty() { &self.floats } else { &self.integers };
        format!("{}:{suffix}", names[random.below(names.len() as u32) as usize])
    }

    fn operation(&mut self, hot: bool) {
        let row = self.rows[self.random.below(self.rows.len() as u32) as usize];
        let operands: Vec<String> =
            (0..row.shape.sources()).map(|i| self.operand(row.source_type(i))).collect();
        // Mark results of operations on bits as floats now and then.
        let float = match row.result_type() {
            Type::F => true,
            Type::I => self.random.once_in(3) && row.source_type(0) == Type::I,
            Type::B => self.random.once_in(2),
        };
        // Branches overwrite earlier names, so that paths have different values to join.
        let again = hot && !self.temporaries.is_empty() && !self.random.once_in(3);
        let name = match again {
            true => {
                let known = self.random.below(self.temporaries.len() as u32) as usize;
                self.temporaries[known].clone()
            }
            false => format!("t{}", self.temporaries.len()),
        };
        if !again {
            self.temporaries.push(name.clone());
        }
        let ty = if float { "float" } else { "int" };
        writeln!(self.text, " {} {name}:{ty}, {}", row.mnemonic, operands.join(", ")).unwrap();
        if !hot {
            if float { &mut self.floats } else { &mut self.integers }.push(name);
        }
    }

    fn load(&mut self) {
        if self.random.once_in(2) {
            return self.access();
        }
        let index = self.operand(Type::I);
        let (at, name) = (format!("t{}", self.temporaries.len()), format!("t{}", self.temporaries.len() + 1));
        writeln!(self.text, " iand {at}:int, {index}, 3\n ld {name}:float, V[{at}:int]").unwrap();
        self.temporaries.extend([at.clone(), name.clone()]);
        self.integers.push(at);
        self.floats.push(name);
    }

    /// Load from or store to an array that lasts from period to period, mostly within its bounds. Returns the value's name.
    fn access(&mut self) {
        let index = self.operand(Type::I);
        let at = format!("t{}", self.temporaries.len());
        let line = if self.random.once_in(8) && index.contains(':') { "mov" } else { "iand" };
        let mask = if line == "iand" { ", 3" } else { "" };
        writeln!(self.text, " {line} {at}:int, {index}{mask}").unwrap();
        self.temporaries.push(at.clone());
        self.integers.push(at.clone());
        let (array, ty) = if self.random.once_in(2) { ("A", Type::F) } else { ("N", Type::I) };
        let name = format!("t{}", self.temporaries.len());
        self.temporaries.push(name.clone());
        if self.random.once_in(2) {
            // Values stay in the range of their array more often than not.
            let limit = match (self.random.once_in(4), ty) {
                (true, _) => "mov",
                (_, Type::F) => "fsat",
                _ => "iand",
            };
            let value = self.operand(ty);
            let (cast, most) = if ty == Type::F { ("float", "1.0") } else { ("int", "7") };
            let most = if limit == "mov" { String::new() } else { format!(", {most}") };
            writeln!(self.text, " {limit} {name}:{cast}, {value}{most}\n st {array}[{at}:int], {name}")
                .unwrap();
        } else {
            writeln!(self.text, " ld {name}, {array}[{at}:int]").unwrap();
        }
        if ty == Type::F { &mut self.floats } else { &mut self.integers }.push(name);
    }

    fn branch(&mut self) {
        let condition = self.operand(Type::B);
        if !condition.contains(':') {
            return;
        }
        self.labels += 1;
        let (label, way) = (self.labels, pick(self.random, &["bz", "bnz"]));
        writeln!(self.text, " {way} {condition}, l{label}").unwrap();
        for _ in 0..1 + self.random.below(3) {
            self.again();
        }
        writeln!(self.text, "l{label}:").unwrap();
    }

    /// Flag of a comparison, or of two combined: preferably of values that later operations read.
    fn condition(&mut self) -> String {
        let mut flags = Vec::new();
        for _ in 0..1 + u32::from(self.random.once_in(4)) {
            let row = pick(self.random, &["flt", "fle", "feq", "ilt", "ieq", "iltu"]);
            let ty = if row.starts_with('f') { Type::F } else { Type::I };
            let mut operands = [self.operand(ty), self.operand(ty)];
            if self.random.once_in(2) {
                let few = if ty == Type::F { ["0.0", "1.0", "-0.5", "2.0"] } else { ["0", "1", "3", "-1"] };
                operands[self.random.below(2) as usize] = pick(self.random, &few).to_owned();
            }
            let name = format!("t{}", self.temporaries.len());
            writeln!(self.text, " {row} {name}:int, {}, {}", operands[0], operands[1]).unwrap();
            self.temporaries.push(name.clone());
            flags.push(name);
        }
        let [a, b] = &flags[..] else { return flags.remove(0) };
        let (name, row) =
            (format!("t{}", self.temporaries.len()), pick(self.random, &["iand", "ior", "ixor"]));
        writeln!(self.text, " {row} {name}:int, {a}:int, {b}:int").unwrap();
        self.temporaries.push(name.clone());
        name
    }

    /// Decision by a comparison: a selection of values that depend on the compared ones, or a branch around operations.
    fn decision(&mut self) {
        let flag = self.condition();
        if self.random.once_in(2) {
            self.operation(false);
            self.operation(false);
            let operands = [self.operand(Type::F), self.operand(Type::F)];
            let name = format!("t{}", self.temporaries.len());
            writeln!(self.text, " sel {name}:float, {flag}:int, {}, {}", operands[0], operands[1]).unwrap();
            self.temporaries.push(name.clone());
            self.floats.push(name);
            return;
        }
        self.labels += 1;
        let (label, way) = (self.labels, pick(self.random, &["bz", "bnz"]));
        writeln!(self.text, " {way} {flag}:int, l{label}").unwrap();
        for _ in 0..1 + self.random.below(3) {
            self.again();
        }
        writeln!(self.text, "l{label}:").unwrap();
    }

    /// Overwrites a name that has a value.
    fn again(&mut self) {
        if !self.temporaries.is_empty() {
            let before = self.temporaries.len();
            for _ in 0..8 {
                let length = self.text.len();
                self.operation(true);
                if self.temporaries.len() == before {
                    return;
                }
                self.text.truncate(length);
                self.temporaries.truncate(before);
            }
        }
    }

    /// Counted loop, now and then a long one; its count goes down to 1, and may be an index.
    fn turns(&mut self) {
        self.labels += 1;
        let longest = if self.random.once_in(4) { 30 } else { 4 };
        let (label, turns) = (self.labels, 1 + self.random.below(longest));
        writeln!(self.text, " li k, {turns}\n.loop_bound {turns}\nl{label}:").unwrap();
        for _ in 0..1 + self.random.below(4) {
            let value = self.operand(Type::F);
            let line = match self.random.below(9) {
                0 => format!(" fadd u, u, {value}\n"),
                1 => format!(" fadd u, u, {value}\n fsat u, u, 3.0\n"),
                2 => format!(" fmul u, u, 0.75\n fadd u, u, {value}\n"),
                3 => " iand j, k, 3\n ld w, A[j]\n fadd u, u, w\n".to_owned(),
                4 => " iadd j, j, 1\n iand j, j, 3\n fsat w, u, 1.0\n st A[j], w\n".to_owned(),
                5 => " isub j, j, 2\n".to_owned(),
                6 => " iadd j, j, 1\n ld w, A[j]\n fadd u, u, w\n".to_owned(),
                _ => {
                    self.again();
                    String::new()
                }
            };
            self.text += &line;
        }
        writeln!(self.text, " isub k, k, 1\n bnz k, l{label}").unwrap();
    }
}

/// Source of a random program.
fn source(random: &mut Random, machine: &'static Machine) -> String {
    let mut text = String::new();
    if random.once_in(2) {
        text += ".ports latched\n";
    }
    if random.once_in(2) {
        text += ".schedule on\n";
    }
    text += ".input x0, x1, x2, n0:int\n.output y0, y1, y2, y3, y4, z0:int, z1:int\n.state s0\n.state c0:int\n.reg k:int j:int u w\n";
    text += ".range A = -2.0, 2.0\n.range N = 0, 9\n";
    for name in ["x0", "x1", "x2", "s0"] {
        let (low, high) = ends(random);
        writeln!(text, ".range {name} = {low:e}, {high:e}").unwrap();
    }
    let (low, size) = (random.below(200) as i32 - 100, [3, 100, 1 << 20][random.below(3) as usize]);
    writeln!(text, ".range n0 = {low}, {}", low + random.below(size) as i32).unwrap();
    writeln!(text, ".range c0 = 0, {}", random.below(9)).unwrap();
    // Restricts a third of the programs to float arithmetic.
    let only_float = random.once_in(3);
    let offered = |row: &&'static Row| {
        let float = row.types.iter().all(|ty| *ty == Type::F);
        row.effect == Effect::Compute
            && machine.slots.iter().any(|slot| slot.unit(row.function).is_some())
            && (!only_float || float)
    };
    let rows: Vec<_> = ROWS.iter().filter(offered).collect();
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let mut writer = Writer {
        floats: names(&["x0", "x1", "x2", "s0", "u"]),
        integers: names(&["n0", "c0", "j"]),
        temporaries: Vec::new(),
        labels: 0,
        rows,
        random,
        text: String::new(),
    };
    for _ in 0..1 + writer.random.below(10) {
        match writer.random.below(20) {
            0 | 18 | 19 if !only_float => writer.load(),
            1 | 2 => writer.branch(),
            3 => writer.turns(),
            4..=7 => writer.decision(),
            _ => writer.operation(false),
        }
    }
    let last = writer.integers[writer.integers.len() - 1].clone();
    writeln!(writer.text, " mov y4, u\n mov z0, {last}:int\n mov z1, j").unwrap();
    // Outputs: recent values; integers as numbers, now and then as arbitrary bits.
    for i in 0..4 {
        let random = &mut *writer.random;
        let last = |names: &[String], random: &mut Random| {
            names[names.len() - 1 - random.below(names.len().min(4) as u32) as usize].clone()
        };
        let line = match random.below(if only_float { 2 } else { 4 }) {
            2 => format!(" itof y{i}, {}:int", last(&writer.integers, random)),
            3 if random.once_in(3) => format!(" mov y{i}:float, {}:float", last(&writer.integers, random)),
            _ => format!(" mov y{i}:float, {}:float", last(&writer.floats, random)),
        };
        writeln!(writer.text, "{line}").unwrap();
    }
    let states = [writer.operand(Type::F), writer.operand(Type::I)];
    let random = &mut *writer.random;
    let keeps = random.once_in(2);
    let state = match random.below(4) {
        0 => format!(" mov s0:float, {}\n", states[0]),
        // A filter, which may or may not keep its range over all periods.
        2 => " fsub s0, s0, x0\n fmul s0, s0, -0.875\n".to_owned(),
        1 => " fmul s0, s0, 0.5\n".to_owned(),
        _ => String::new(),
    };
    let counter = match random.below(3) {
        0 => format!(" iand c0:int, {}, 3\n", states[1].replace(":float", ":int")),
        1 if !keeps => " iadd c0, c0, 1\n".to_owned(),
        _ => String::new(),
    };
    let body = " mov u, 0.0\n mov w, 0.0\n mov j, 0\n".to_owned() + &writer.text + &state + &counter;
    let temporaries = writer.temporaries.join(" ");
    let start = pick(writer.random, &["0.0", "1.0", "-2.0", "1e-39", "zero", "x0"]);
    let first = pick(writer.random, &["0", "1", "4", "n0"]);
    if !temporaries.is_empty() {
        writeln!(text, ".reg {temporaries}").unwrap();
    }
    let enter = match writer.random.below(3) {
        // Gives the first period its own code.
        0 => " wait q\nq: mov s0, 0.25\n.period\np:\n".to_owned(),
        _ => " wait p\n.period\np:\n".to_owned(),
    };
    let presets = match writer.random.below(3) {
        0 => ".preset s0 = 0.5\n.preset c0 = 2\n.once\n".to_owned(),
        _ => format!(".once\n mov s0, {start}\n mov c0, {first}\n"),
    };
    let data = ".data\nV: .float 1.0, -2.5\n .word 3, 0x3f000000\nA: .float 1.0, 0.5, -1.0, 0.25\nN: .word 1, 0, 7, 2\n";
    text + &presets + &enter + &body + " wait p\n" + data
}

/// Values of a range that break claims: its ends and their neighbours, zeros, powers of two, subnormals, and random members.
fn draw(range: &Range, random: &mut Random) -> u32 {
    let (low, high) = range.ends();
    if range.ty != Type::F {
        let inside = low + (high - low) * f64::from(random.below(1 << 16)) / 65_535.0;
        let value = [low, high, inside.round(), 0.0][random.below(4) as usize];
        return (value.clamp(low, high) as i32).cast_unsigned();
    }
    let (low, high) = (low as f32, high as f32);
    let part = random.below(1 << 24) as f32 / (1 << 24) as f32;
    let inside = low + part * (high - low);
    let value = match random.below(10) {
        0 => low,
        1 => high,
        2 => low.next_up(),
        3 => high.next_down(),
        4 => [0.0, -0.0][random.below(2) as usize],
        5 => 2f32.powi(random.below(60) as i32 - 30) * [1.0, -1.0][random.below(2) as usize],
        6 => f32::from_bits(random.below(1 << 23)),
        7 => inside.round(),
        _ => inside,
    };
    let value = if value.is_finite() { value } else { 0.0 };
    // Keeps zeros of either sign.
    if value >= low && value <= high { value.to_bits() } else { value.clamp(low, high).to_bits() }
}

/// Operations whose result holds for any operands: comparisons, and conversions of integers to numbers.
fn settles(row: &Row) -> bool {
    matches!(row.mnemonic, "feq" | "flt" | "fle" | "ieq" | "ilt" | "iltu" | "itof")
}

/// Registers whose values may depend on a listed hazard; no statement covers them.
fn tainted(program: &Program, enclosure: &Enclosure) -> BTreeSet<Register> {
    let listed = |word: usize| {
        let here = enclosure.hazards.iter().filter(|hazard| hazard.word as usize == word);
        here.into_iter().any(|hazard| !hazard.problem.is_defined() && hazard.problem != Problem::Output)
    };
    let slots = program.machine.slots.len();
    let unbounded = enclosure.hazards.iter().filter(|hazard| hazard.problem == Problem::Unbounded);
    let mut tainted: BTreeSet<Register> =
        unbounded.flat_map(|hazard| hazard.operands.iter().map(|(register, _)| *register)).collect();
    loop {
        let before = tainted.len();
        for (word, bits) in program.code.iter().enumerate() {
            let Ok(instruction) = Instruction::decode(*bits) else { continue };
            let Some(register) = instruction.writes(&program.machine.slots[word % slots]) else { continue };
            let row = instruction.op.row();
            let from = instruction.reads().iter().any(|register| tainted.contains(register));
            if !settles(row) && (listed(word) || from) {
                tainted.insert(register);
            }
        }
        if tainted.len() == before {
            return tainted;
        }
    }
}

/// Registers that may hold a float, or an integer computed from a float's bits.
fn of_bits(program: &Program) -> BTreeSet<Register> {
    let slots = program.machine.slots.len();
    let typed = program.inputs.iter().chain(&program.registers).filter(|port| port.ty == Type::F);
    let mut found: BTreeSet<Register> = typed.map(|port| port.register).collect();
    loop {
        let before = found.len();
        for (word, bits) in program.code.iter().enumerate() {
            let Ok(instruction) = Instruction::decode(*bits) else { continue };
            let Some(register) = instruction.writes(&program.machine.slots[word % slots]) else { continue };
            let row = instruction.op.row();
            let is_float = row.result_type() == Type::F || instruction.effect() == Effect::Load;
            let from = row.result_type() != Type::F
                && instruction.reads().iter().any(|register| found.contains(register));
            if is_float || from && !settles(row) {
                found.insert(register);
            }
        }
        if found.len() == before {
            return found;
        }
    }
}

/// Counts of statements compared with a run.
#[derive(Default, Debug)]
struct CheckCounts {
    programs: u64,
    /// Programs that the analysis refuses, and programs without a hazard.
    refused: u64,
    safe: u64,
    bounds: u64,
    /// Tight bounds: a run reached a third of the bound.
    tight: u64,
    states: u64,
    /// Operations that raised a flag, each listed.
    raised: u64,
    /// Sums of integers that wrapped, and shifts by more than 31, each listed.
    wrapped: u64,
    /// Array that each access of the run has touched, by its word.
    touched: BTreeMap<usize, Option<u32>>,
    /// Accesses outside of their array, each listed.
    outside: u64,
    /// Ranges of integer outputs compared with a value.
    integers: u64,
    /// Operations whose values are compared.
    extents: u64,
}

/// Run of a program, compared with its enclosure.
struct Run<'p> {
    program: &'p Program,
    enclosure: &'p Enclosure,
    tainted: BTreeSet<Register>,
    /// Registers that may hold a float, or an integer computed from a float's bits.
    bits: BTreeSet<Register>,
    /// Inputs change in every cycle, since ports are not latched.
    restless: bool,
}

impl Run<'_> {
    fn inputs(&self, emulator: &mut Emulator, random: &mut Random) {
        for range in self.program.ranges.iter().filter(|range| self.program.machine.is_input(range.register))
        {
            emulator.set_input_bits(range.register, draw(range, random)).unwrap();
        }
    }

    /// Checks an operation of the run: a flag that it raises is listed, unless it depends on a listed hazard.
    fn operation(
        &self,
        emulator: &Emulator,
        word: usize,
        instruction: &Instruction,
        checked: &mut CheckCounts,
    ) {
        if matches!(instruction.effect(), Effect::Load | Effect::Store) {
            return self.access(emulator, word, instruction, checked);
        }
        if instruction.effect() != Effect::Compute {
            return;
        }
        let mut operands = [0; 3];
        for (operand, register) in operands.iter_mut().zip(instruction.reads()) {
            *operand = emulator.register(*register).unwrap_or(0);
        }
        let value = compute::<Host>(instruction.op, operands[0], operands[1], operands[2]);
        let known = instruction.reads().iter().all(|register| !self.tainted.contains(register));
        let listed = self.enclosure.hazards.iter().any(|hazard| hazard.word as usize == word);
        let is_listed = |problem| {
            self.enclosure
                .hazards
                .iter()
                .any(|hazard| hazard.word as usize == word && hazard.problem == problem)
        };
        let signed = |operand: u32| i64::from(operand.cast_signed());
        let sum = match instruction.op.row().mnemonic {
            "iadd" => signed(operands[0]) + signed(operands[1]),
            "isub" => signed(operands[0]) - signed(operands[1]),
            _ => 0,
        };
        let is_whole = |register: &Register| !self.bits.contains(register);
        if i32::try_from(sum).is_err() && known && instruction.reads().iter().all(is_whole) {
            checked.wrapped += 1;
            assert!(is_listed(Problem::Wrap), "{instruction:?} of {operands:08x?} wraps");
        }
        let is_shift = matches!(instruction.op.row().mnemonic, "ishl" | "ishr" | "isar");
        if is_shift && operands[1] > 31 && known && instruction.reads().iter().all(is_whole) {
            checked.wrapped += 1;
            assert!(is_listed(Problem::Shift), "{instruction:?} of {operands:08x?} shifts by more than 31");
        }
        if value.flags != Flags::NONE {
            checked.raised += u64::from(listed);
            assert!(listed || !known, "{instruction:?} of {operands:08x?} raises {}", value.flags);
        }
    }

    /// Checks that an access outside of its array is listed.
    fn access(&self, emulator: &Emulator, word: usize, instruction: &Instruction, checked: &mut CheckCounts) {
        let base = instruction.reads()[0];
        let address = emulator.register(base).unwrap_or(0).wrapping_add(instruction.constant);
        let starts = || {
            let labels = self.program.symbols.iter().filter(|symbol| symbol.space == Space::Data);
            labels.map(|label| label.address).chain([self.program.data.len() as u32])
        };
        if self.tainted.contains(&base) {
            return;
        }
        let array = starts().filter(|start| *start <= address).max();
        let touched = checked.touched.entry(word).or_insert(array);
        if *touched != array || address >= self.program.data.len() as u32 {
            checked.outside += 1;
            let mut hazards = self.enclosure.hazards.iter();
            let is_listed =
                hazards.any(|hazard| hazard.word as usize == word && hazard.problem == Problem::Address);
            assert!(is_listed, "{instruction:?} accesses word {address}");
        }
    }

    /// Checks the ranges of integer outputs.
    fn integers(&self, emulator: &Emulator, checked: &mut CheckCounts) {
        for bound in self.enclosure.outputs.iter().filter(|bound| bound.ty == Type::I) {
            let Some(range) = bound.range else { continue };
            let value = f64::from(emulator.register(port(bound)).unwrap().cast_signed());
            checked.integers += 1;
            assert!(range.contains(value), "{} is {value}, of {range:?}", bound.name);
        }
    }

    /// Checks the states against their ranges. Returns false if a state has left an unproved range: the statements need not hold for the
    /// next period.
    fn states(&self, emulator: &Emulator, checked: &mut CheckCounts) -> bool {
        let mut kept = true;
        for range in self.program.ranges.iter().filter(|range| !self.program.machine.is_input(range.register))
        {
            let bits = emulator.register(range.register).unwrap();
            let value = match range.ty {
                Type::F => f64::from(f32::from_bits(bits)),
                _ => f64::from(bits.cast_signed()),
            };
            let (low, high) = range.ends();
            let within = low <= value && value <= high;
            let assumed = self.enclosure.later().any(|state| state.range == StateRange::Register(*range));
            checked.states += u64::from(!assumed);
            assert!(within || assumed, "a state is {value}, {bits:08x}, of [{low}, {high}]");
            kept &= within;
        }
        for range in &self.program.array_ranges {
            let (low, high) = range.ends();
            let assumed = self.enclosure.later().any(|state| state.range == StateRange::Array(*range));
            for word in range.span() {
                let bits = emulator.memory()[word as usize];
                let value = if range.ty == Type::F {
                    f64::from(f32::from_bits(bits))
                } else {
                    f64::from(bits.cast_signed())
                };
                let within = low <= value && value <= high;
                checked.states += u64::from(!assumed);
                assert!(within || assumed, "data word {word} is {value}, of [{low}, {high}]");
                kept &= within;
            }
        }
        kept
    }

    /// Checks the ranges and errors at every operation.
    fn operations(&self, shadow: &Shadow, checked: &mut CheckCounts) {
        for (word, operation) in shadow.operations() {
            let Some(bound) = self.enclosure.extents.get(word) else { continue };
            let (Some(range), Some(error)) = (bound.result.range, bound.result.error) else { continue };
            let Some(seen) = operation.result.range else { continue };
            let most = error * (1.0 + 1e-6) + 1e-12 * range.magnitude() + 1e-44;
            let within = range.low <= seen.low && seen.high <= range.high;
            checked.extents += 1;
            assert!(within, "word {word}: {seen:?} beyond {range:?}");
            assert!(operation.result.error <= most, "word {word}: {:?} beyond {error}", operation.result);
        }
    }

    fn run(&self, periods: usize, random: &mut Random, checked: &mut CheckCounts) {
        let (program, machine) = (self.program, self.program.machine);
        let mut emulator = Emulator::new(program).unwrap();
        let mut shadow = Shadow::new(program).each_period_afresh();
        checked.touched.clear();
        self.inputs(&mut emulator, random);
        let mut begun = false;
        for _ in 0..periods {
            if let Status::Waiting { since, .. } = *emulator.status() {
                self.inputs(&mut emulator, random);
                emulator.tick_at(emulator.now().max(since + Cycle::from(machine.refill)));
                shadow.begin_period();
                begun = true;
            }
            let end = emulator.now() + LONGEST;
            loop {
                if self.restless && random.once_in(3) {
                    self.inputs(&mut emulator, random);
                }
                // Faults, and loops beyond their bound, end the run.
                let Ok(step) = emulator.step_cycle() else { return };
                let Step::Issued { address, .. } = step else {
                    if emulator.now() > end {
                        return;
                    }
                    continue;
                };
                shadow.issued(&emulator, address);
                if let Some(Ok(instructions)) = program.bundle(address) {
                    for (slot, instruction) in instructions.iter().enumerate() {
                        let word = address.index() * machine.slots.len() + slot;
                        self.operation(&emulator, word, instruction, checked);
                    }
                }
                match emulator.status() {
                    Status::Running => {}
                    Status::Waiting { .. } => break,
                    Status::Halted { .. } | Status::Faulted(_) => return,
                }
            }
            if begun {
                shadow.compare(&emulator);
                if self.enclosure.hazards.is_empty() {
                    assert!(emulator.flags().is_empty(), "{}", emulator.flags());
                    for port in program.outputs.iter().filter(|port| port.ty == Type::F) {
                        let value = f32::from_bits(emulator.register(port.register).unwrap());
                        assert!(value.is_finite(), "{} is {value}", port.name);
                    }
                }
                self.integers(&emulator, checked);
                if !self.states(&emulator, checked) {
                    break;
                }
            } else if self.enclosure.first().next().is_some() {
                return;
            }
        }
        self.operations(&shadow, checked);
        for bound in self.enclosure.outputs.iter().filter(|bound| bound.ty == Type::F) {
            let measured = shadow.outputs().iter().find(|output| output.place == bound.place).unwrap();
            let (Some(error), Some(range), Some(worst)) = (bound.error, bound.range, measured.absolute)
            else {
                continue;
            };
            // Allowance for the rounding of binary64.
            let slack = error * 1e-6 + 1e-12 * range.magnitude() + 1e-44;
            assert!(worst.error <= error + slack, "{}: {worst:?} beyond {error}", bound.name);
            for worst in [measured.absolute, measured.ulp, measured.relative].into_iter().flatten() {
                assert!(range.contains(worst.value), "{}: {worst:?} beyond {range:?}", bound.name);
            }
            checked.bounds += 1;
            checked.tight += u64::from(error > 0.0 && worst.error > error / 3.0);
        }
    }
}

fn assembled(text: &str, machine: &'static Machine) -> Option<Program> {
    let options = Options { machine, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("test.s", text.into(), &MemoryLoader::new(&[]), &options);
    match assembled {
        Ok(assembled) => Some(assembled.program),
        Err(diagnostics) => panic!("{}\n{text}", diagnostics.render(false)),
    }
}

/// Compares the statements about a random program with its runs.
fn check(seed: u64, checked: &mut CheckCounts) {
    let mut random = Random::new(seed);
    let machine = MACHINES[random.below(MACHINES.len() as u32) as usize];
    let text = source(&mut random, machine);
    let Some(program) = assembled(&text, machine) else { return };
    compare(&program, MAX_UNROLLED, seed, &text, checked);
    if text.contains(".loop_bound") {
        compare(&program, 0, seed, &text, checked);
        // Loops without a bound may have any number of iterations.
        let open = Program { loop_bounds: Vec::new(), ..program };
        compare(&open, MAX_UNROLLED, seed, &text, checked);
    }
}

/// Compares the statements with runs; loops of more than so many bundles are summarised.
fn compare(program: &Program, unrolled: u64, seed: u64, text: &str, checked: &mut CheckCounts) {
    checked.programs += 1;
    let mut random = Random::new(seed);
    let enclosure = match enclose_within(program, unrolled) {
        Ok(enclosure) => enclosure,
        Err(_) => {
            checked.refused += 1;
            return;
        }
    };
    checked.safe += u64::from(enclosure.hazards.is_empty());
    let run = Run {
        tainted: tainted(program, &enclosure),
        bits: of_bits(program),
        restless: !program.latched && random.once_in(2),
        program,
        enclosure: &enclosure,
    };
    let result =
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| run.run(PERIODS, &mut random, checked)));
    let machine = program.machine.name;
    assert!(result.is_ok(), "seed {seed} on {machine}, loops up to {unrolled}:\n{text}{enclosure:#?}");
}

#[test]
fn no_run_contradicts_an_enclosure() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().unwrap());
    let (programs, first) = (number("TAKT_PROGRAMS").unwrap_or(PROGRAMS), number("TAKT_SEED").unwrap_or(0));
    let mut checked = CheckCounts::default();
    for seed in first..first + programs {
        check(seed, &mut checked);
    }
    let CheckCounts {
        programs,
        refused,
        safe,
        bounds,
        tight,
        states,
        raised,
        wrapped,
        outside,
        integers,
        extents,
        ..
    } = checked;
    println!(
        "figures: programs={programs} refused={refused} without_hazards={safe} bounds={bounds} tight={tight} states={states} \
         raised={raised} wrapped={wrapped} outside={outside} integers={integers} \
         extents={extents}"
    );
    // Weak statements would not test the analysis: require enough that are made and nearly reached.
    assert!(refused < programs / 4 && safe > programs / 8 && bounds > programs / 2, "too little is stated");
    assert!(
        wrapped > programs / 8 && outside > programs / 100 && integers > programs && extents > 2 * programs,
        "integers are not tried"
    );
    assert!(tight > programs / 20 && states > programs && raised > programs / 4, "nothing comes near");
}
