// SPDX-License-Identifier: MIT OR Apache-2.0
//! No input causes a panic, and the assembler reads back the disassembler's text.

use crate::common;
use crate::rows;
use proptest::prelude::*;
use takt_asm::diag::{Diagnostics, Severity};
use takt_asm::{Expression, disasm, image};
use takt_isa::program::{Location, LoopBound, Port, Range, Section, Space, Symbol};
use takt_isa::shape::Field;
use takt_isa::{BankIndex, BundleAddress, Instruction, MACHINES, Machine, Program, ROWS, Register, Type};

/// Pieces that sources are made of, besides mnemonics.
const PIECES: &[&str] = &[
    "\n",
    "\n",
    "\n",
    " ",
    ",",
    ", ",
    ":",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    "@",
    "=",
    "||",
    "|",
    "&",
    "^",
    "~",
    "!",
    "+",
    "-",
    "*",
    "/",
    "%",
    "==",
    "!=",
    "<",
    "<=",
    ">>",
    "<<",
    "\"",
    ";",
    "a",
    "b",
    "c",
    "x1",
    "zero",
    "pi",
    "m3",
    "@x4",
    "a{i}",
    "b{i+1}c",
    "{p}",
    "1",
    "0",
    "2.5",
    "0x1f",
    "1e400",
    "9223372036854775807",
    "99999999999999999999",
    ".period\n",
    ".once\n",
    ".data\n",
    "\n.reg a b c\n",
    "\n.input x1, n:int\n",
    "\n.output F\n",
    "\n.state s\n",
    "\n.const K = ",
    "\n.preset @m3 = ",
    "\n.word ",
    "\n.float ",
    "\n.space ",
    "\n.rep i, 1, 3\n",
    "\n.endr\n",
    "\n.macro m p, q\n",
    "\n.endm\n",
    "\n m ",
    "\n.if ",
    "\n.elif ",
    "\n.else\n",
    "\n.endif\n",
    "\n.include \"test.s\"\n",
    "\n.loc \"f\" 3\n",
    "\n.loc none\n",
    "\n.error \"x\"\n",
    "\n.raw mul ",
    ".raw aux 0x1",
    "\n.schedule on\n",
    "\nl: ",
    "\nl{i}: ",
    "\n jmp l\n",
    "\n wait l\n",
    "\n fadd a, b, 1\n",
    "\n fadd.aux a, b, 1\n",
    "\n fadd a, b, 1 || fadd b, x1, 2\n",
    "\n mov c, a || fmul b, a, x1\n",
    "\n.reg P[2,2] v[3]\n",
    "\n.loc \"f\" 3[1,2]\n",
    "\na = ",
    "\nb, F = ",
    "\nv[i] = ",
    "\nP[1,2] = ",
    "\nF = x1*x1 + ",
    "?",
    " ? a : b",
    "v[2]",
    "P[i,1]",
    "sqrt(",
    "min(a, ",
    "sum(i, 1, 3, ",
    "m(a)",
    "itof(n)",
    "has.fatan2",
    "\u{e9}",
    "\0",
];

/// Sources of pieces in any order.
fn soup() -> impl Strategy<Value = String> {
    let mnemonics = ROWS.iter().map(|row| format!("\n {} ", row.mnemonic));
    let all: Vec<String> = PIECES.iter().map(|piece| (*piece).to_owned()).chain(mnemonics).collect();
    prop::collection::vec(prop::sample::select(all), 0..60).prop_map(|pieces| pieces.concat())
}

fn machine() -> impl Strategy<Value = &'static Machine> {
    let shared = ["second_adder", "second_multiplier", "two_alus", "four"].map(rows::named);
    prop::sample::select([MACHINES, &shared].concat())
}

/// Any result can be rendered, and goes through image and disassembly.
fn exercise(text: &str, machine: &'static Machine) -> Result<(), TestCaseError> {
    match common::assemble(text, machine) {
        Ok(assembled) => {
            let _ = takt_asm::listing::listing(&assembled);
            let _ = assembled.warnings.render(true);
            if has_images(machine) {
                let debug = assembled.debug_info();
                let read = image::read_with(
                    &image::write_with(&assembled.program, Some(&debug)).expect("an image holds it"),
                );
                prop_assert_eq!(read.map(|(_, read)| read.map(|read| read.names)), Ok(Some(debug.names)));
            }
            round_trip(&assembled.program)
        }
        Err(report) => {
            prop_assert!(report.has_errors());
            prop_assert!(!report.render(true).is_empty());
            prop_assert!(!report.to_json().is_empty());
            Ok(())
        }
    }
}

/// The machine is in the table: an image names its machine, and the reader must know the name.
fn has_images(machine: &Machine) -> bool {
    Machine::from_name(machine.name).is_ok()
}

/// Program to text to program, and to image and back.
fn round_trip(program: &Program) -> Result<(), TestCaseError> {
    if has_images(program.machine) {
        let bytes = image::write(program).expect("an image holds it");
        let read = image::read(&bytes);
        prop_assert_eq!(read.as_ref(), Ok(program));
    }
    let text = disasm::disassemble(program);
    match common::assemble(&text, program.machine) {
        Ok(again) => {
            prop_assert_eq!(&again.program, program, "{}", text);
            let image = |program| image::write(program).expect("an image holds it");
            prop_assert_eq!(image(&again.program), image(program));
            Ok(())
        }
        // Words can write an output after a `publish`; the assembler refuses that.
        Err(report) if is_published_early(&report) => Ok(()),
        Err(report) => Err(TestCaseError::fail(format!("{}\n{text}", report.render(false)))),
    }
}

/// The only mistakes are outputs written after a `publish`.
fn is_published_early(report: &Diagnostics) -> bool {
    let mut errors = report.list.iter().filter(|diagnostic| diagnostic.severity == Severity::Error);
    errors.all(|error| error.code == "publish")
}

/// Any register of the register space.
fn register() -> impl Strategy<Value = Register> + Clone {
    (0..Register::COUNT).prop_map(|number| Register::new(number).expect("in range"))
}

/// Any register but `zero`.
fn writable() -> impl Strategy<Value = Register> + Clone {
    register().prop_filter("writable", |register| *register != Register::ZERO)
}

/// A word: legal for its slot, legal somewhere, or any bits.
fn word(machine: &'static Machine) -> impl Strategy<Value = u64> {
    let register = prop_oneof![
        4 => register().prop_filter("in a bank", |register| MACHINES[0].has_register(*register)),
        1 => register(),
        1 => Just(Register::ZERO),
    ];
    let sources = [register.clone(), register.clone(), register];
    let instruction = (prop::sample::select(ROWS), 0..256usize, sources, any::<u32>()).prop_map(
        |(row, dest, sources, constant)| {
            let mut constant = constant;
            for field in row.shape.fields() {
                match field {
                    Field::Offset | Field::Target => constant &= field.bits().max(),
                    Field::OffsetHigh => constant &= Field::Offset.bits().max(),
                    _ => {}
                }
            }
            let dest = BankIndex::new(dest).expect("in range");
            Instruction { op: row.op, dest, sources, constant }.encode().unwrap_or(0)
        },
    );
    let _ = machine;
    prop_oneof![
        4 => Just(Instruction::NOP.encode().unwrap_or(0)),
        10 => instruction,
        1 => 0..1u64 << 48,
        1 => Just(0),
    ]
}

prop_compose! {
    /// A program that the image reader accepts.
    fn program()(machine in machine())(
        code in prop::collection::vec(word(machine), 0..30usize),
        once in 0..12usize,
        data in prop::collection::vec(prop_oneof![any::<u32>(), Just(0)], 0..40),
        constants in prop::collection::btree_map(writable(), any::<u32>(), 0..8),
        ports in prop::collection::btree_map(writable(), 0..3usize, 0..12),
        labels in prop::collection::vec((any::<bool>(), any::<prop::sample::Index>()), 0..8),
        files in prop::sample::subsequence(vec!["a.s", "b \"c\".s", "dir/d.s", "\\e\n"], 0..=4).prop_shuffle(),
        loops in prop::collection::btree_map(0..30u32, 1..=u32::MAX, 0..4),
        lines in prop::collection::vec(prop::option::of((any::<prop::sample::Index>(), 1..9u32)), 30),
        machine in Just(machine),
        latched in any::<bool>(),
    ) -> Program {
        let slots = machine.slots.len();
        let code: Vec<u64> = code[..code.len() / slots * slots].to_vec();
        let bundles = code.len() / slots;
        let once = once.min(bundles) as u32;
        let types = [Type::F, Type::I, Type::B];
        let (mut inputs, mut outputs, mut registers) = (Vec::new(), Vec::new(), Vec::new());
        let mut numbers = std::collections::HashSet::new();
        for (register, ty) in ports {
            if machine.register_name(register).is_none() {
                continue;
            }
            let list = match register {
                register if machine.is_input(register) => &mut inputs,
                register if machine.is_output(register) => &mut outputs,
                _ => &mut registers,
            };
            let number = machine.output_number(register);
            if number.is_some() && !numbers.insert(number) {
                continue;
            }
            // Names that look like places, but of other registers.
            let name = if register.get() % 3 == 0 { format!("m{register}") } else { format!("r.{register}_") };
            list.insert(0, Port { name, register, ty: types[ty] });
        }
        // Parameters have a finite value at the start.
        let mut constants = constants;
        let parameters: Vec<Port> = inputs.extract_if(.., |port| port.register.get() % 3 == 1).collect();
        constants.extend(parameters.iter().map(|port| (port.register, 0x3f00_0000 + u32::from(port.register.get()))));
        let mut symbols: Vec<Symbol> = labels.iter().enumerate().map(|(i, (code, index))| {
            let (space, end) = if *code { (Space::Code, bundles) } else { (Space::Data, data.len()) };
            Symbol { name: format!("label{i}"), space, address: index.index(end + 1) as u32 }
        }).collect();
        symbols.sort_by_key(|symbol| (symbol.space, symbol.address));
        let sections = [("once", 0, once), ("period", once, bundles as u32)]
            .map(|(name, start, end)| (name, BundleAddress::new(start), BundleAddress::new(end)));
        let files: Vec<String> = files.into_iter().map(str::to_owned).collect();
        let location = |line: &Option<(prop::sample::Index, u32)>| match line {
            Some((index, line)) if !files.is_empty() => {
                Some(Location { file: index.index(files.len()) as u32, line: *line })
            }
            _ => None,
        };
        let lines = (0..code.len()).map(|i| location(&lines[i])).collect();
        let mut ranges: Vec<Range> = inputs.iter().chain(&parameters).filter(|port| port.ty != Type::B && port.register.get() % 2 == 0).map(|port| {
            let (low, high) = if port.ty == Type::F { ((-1.5f32).to_bits(), 0.25f32.to_bits()) } else { ((-7i32).cast_unsigned(), 7) };
            Range { register: port.register, ty: port.ty, low, high }
        }).collect();
        ranges.sort_by_key(|range| range.register);
        Program {
            ranges,
            array_ranges: Vec::new(),
            results: Vec::new(),
            assumptions: Vec::new(),
            machine,
            code,
            data,
            constants: constants.into_iter().filter(|(register, _)| machine.register_name(*register).is_some()).collect(),
            inputs,
            outputs,
            parameters,
            latched,
            registers,
            symbols,
            sections: sections
                .into_iter()
                .filter(|(_, start, end)| start < end)
                .map(|(name, start, end)| Section { name: name.to_owned(), start, end })
                .collect(),
            loop_bounds: loops
                .into_iter()
                .filter(|(address, _)| (*address as usize) < bundles)
                .map(|(address, most)| LoopBound { address: BundleAddress::new(address), most, total: None })
                .collect(),
            files: files.clone(),
            lines,
            parts: Vec::new(),
            origins: Vec::new(),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn no_soup_makes_the_assembler_panic(text in soup(), machine in machine()) {
        exercise(&text, machine)?;
    }

    #[test]
    fn no_bytes_make_the_assembler_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let loader = takt_asm::MemoryLoader::of("test.s", bytes);
        if let Err(report) = takt_asm::assemble("test.s", &loader, &common::options(MACHINES[0])) {
            prop_assert!(!report.render(false).is_empty());
        }
    }

    #[test]
    fn no_text_makes_an_expression_panic(text in "[-+*/%^~!<>=&|(){}a-e0-9. ,]{0,40}") {
        if let Ok(expression) = Expression::parse(&text) {
            let _ = expression.evaluate(|_| Some(takt_asm::expr::Value::Int(3)));
        }
    }

    #[test]
    fn disassembly_assembles_to_the_program(program in program()) {
        round_trip(&program)?;
    }
}
