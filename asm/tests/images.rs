// SPDX-License-Identifier: MIT OR Apache-2.0
//! The image format: written deterministically, read with suspicion.

use crate::common;
use object::read::elf::{FileHeader as _, SectionHeader as _};
use object::{LittleEndian as LE, elf};
use proptest::prelude::*;
use takt_asm::image::{self, ImageError};
use takt_asm::names::{DebugInfo, Position};
use takt_isa::{BundleAddress, Function, Instruction, MachineNameError, Program, Register};

fn program() -> Program {
    common::good(
        ".input x, n:int\n.output F\n.reg a\n.data\nt: .word 1, 2\n.period\np: fadd a, x, 0.5 || ld @x3, t[n]\n fadd F, a, @x3\n wait p\n",
    )
    .program
}

/// File offset and size of a section.
fn section(bytes: &[u8], name: &str) -> (usize, usize) {
    let header = elf::FileHeader32::<LE>::parse(bytes).expect("it is an ELF file");
    let sections = header.sections(LE, bytes).expect("it has sections");
    let (_, section) = sections.section_by_name(LE, name.as_bytes()).expect("the section is there");
    (section.sh_offset(LE) as usize, section.sh_size(LE) as usize)
}

/// File offset of a section's header.
fn section_header(bytes: &[u8], name: &str) -> usize {
    let header = elf::FileHeader32::<LE>::parse(bytes).expect("it is an ELF file");
    let sections = header.sections(LE, bytes).expect("it has sections");
    let (index, _) = sections.section_by_name(LE, name.as_bytes()).expect("the section is there");
    header.e_shoff(LE) as usize + 40 * index.0
}

/// The image with its metadata changed; the new text must not be longer.
fn with_meta(bytes: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    let (offset, size) = section(bytes, ".takt.meta");
    let old = std::str::from_utf8(&bytes[offset..offset + size]).expect("JSON is text");
    let new = change(old);
    assert_ne!(old, new, "the change changes something");
    // Room for a longer text.
    let new = new.replace("test.s", "t");
    assert!(new.len() <= size, "{} > {size}", new.len());
    let mut bytes = bytes.to_vec();
    bytes[offset..offset + size].fill(b' ');
    bytes[offset..offset + new.len()].copy_from_slice(new.as_bytes());
    bytes
}

#[test]
fn written_data_is_read_back() {
    let program = program();
    let bytes = image::write(&program).expect("an image holds it");
    assert!(image::is_image(&bytes));
    assert!(!image::is_image(b".period"));
    assert_eq!(image::read(&bytes).as_ref(), Ok(&program));
    assert_eq!(bytes, image::write(&program).expect("an image holds it"), "equal programs give equal bytes");
    // The image is read at any alignment in memory.
    let mut moved = vec![0];
    moved.extend(&bytes);
    assert_eq!(image::read(&moved[1..]).as_ref(), Ok(&program));
}

#[test]
fn labels_are_symbols_that_other_tools_see() {
    let bytes = image::write(&program()).expect("an image holds it");
    let header = elf::FileHeader32::<LE>::parse(&bytes[..]).expect("it is an ELF file");
    let sections = header.sections(LE, &bytes[..]).expect("it has sections");
    let symbols = sections.symbols(LE, &bytes[..], elf::SHT_SYMTAB).expect("it has symbols");
    let names: Vec<&[u8]> =
        symbols.iter().map(|symbol| symbols.symbol_name(LE, symbol).expect("it has a name")).collect();
    assert_eq!(names, [&b""[..], b"p", b"t"]);
}

#[test]
fn an_empty_program() {
    let program = common::good("").program;
    assert_eq!(image::read(&image::write(&program).expect("an image holds it")).as_ref(), Ok(&program));
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = image::write(&program()).expect("an image holds it");
    for length in 0..bytes.len() {
        match image::read(&bytes[..length]) {
            Err(ImageError::NotElf) => assert!(length < 4),
            Err(_) => assert!(length >= 4),
            Ok(_) => panic!("{length} of {} bytes are accepted", bytes.len()),
        }
    }
}

#[test]
fn other_files_are_told_apart() {
    let bytes = image::write(&program()).expect("an image holds it");
    let changed = |at: usize, value: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = value;
        image::read(&bytes).expect_err("it is damaged")
    };
    assert_eq!(changed(0, b'x'), ImageError::NotElf);
    assert_eq!(changed(4, 2), ImageError::NotTakt, "64 bits");
    assert_eq!(changed(5, 2), ImageError::NotTakt, "big endian");
    assert_eq!(changed(18, 243), ImageError::NotTakt, "RISC-V");
    assert_eq!(changed(39, 0), ImageError::NotTakt, "flags");
    assert_eq!(changed(36, 2), ImageError::Version { found: 2 }, "container of another version");
    assert!(matches!(changed(32, 0xff), ImageError::Damaged(_)), "section headers elsewhere");
}

/// A program with all that a debugger may know: a macro's names, a name of several values, constants of every kind.
fn debugged() -> (Program, DebugInfo) {
    let assembled = common::good(
        ".const big = inf\n.const odd = nan\n.const n = -3\n.const h = 0.1\n.input x\n.output F\n.reg t\n\
         .macro m to, by\n.reg own\n fmul own, by, by\n fadd to, own, h\n.endm\n.period\n.schedule on\n\
         p: fadd t, x, x\n fmul t, t, t\n m F, t\n.schedule off\n wait p\n",
    );
    (assembled.program.clone(), assembled.debug_info())
}

#[test]
fn debug_information_is_read_back() {
    let (program, info) = debugged();
    let bytes = image::write_with(&program, Some(&info)).expect("an image holds it");
    let (read, debug) = image::read_with(&bytes).expect("it is an image");
    let debug = debug.expect("it is not stripped");
    assert_eq!((&read, &debug.names, &debug.sources), (&program, &info.names, &info.sources));
    // A NaN is not equal to itself.
    assert_eq!(format!("{:?}", debug.constants), format!("{:?}", info.constants));
    assert!(debug.constants.len() == 4 && debug.names.values.len() == 2 && debug.names.scopes.len() == 2);
    assert_eq!(
        image::write_with(&program, Some(&info)).expect("an image holds it"),
        bytes,
        "equal programs give equal bytes"
    );
    assert_eq!(
        image::read_with(&image::write(&program).expect("an image holds it")),
        Ok((program, None)),
        "stripped"
    );
}

#[test]
fn debug_information_matches_the_program() {
    let (program, info) = debugged();
    type Change = fn(&mut DebugInfo);
    let defects: [(&str, Change); 13] = [
        ("`1x` is not a name", |info| info.constants[0].0 = "1x".to_owned()),
        ("`` is not a name", |info| info.sources[0].0.clear()),
        ("two things are named `test.s`", |info| info.sources.extend(info.sources.clone())),
        ("1 positions for", |info| info.names.positions.truncate(1)),
        ("there is no scope 7", |info| info.names.positions[0] = Some(Position::new(0, 7))),
        ("the first scope is that outside of macros", |info| info.names.scopes[0].name = "m".to_owned()),
        ("`m 1` is not a name", |info| info.names.scopes[1].name = "m 1".to_owned()),
        ("`?` is not a name", |info| info.names.scopes[1].parameters[0].1 = "?".to_owned()),
        ("`t!` is not a name", |info| info.names.values[0].label = "t!".to_owned()),
        ("`` is not a name", |info| info.names.values[0].name.clear()),
        ("register address 1023", |info| info.names.values[0].register = Register::ZERO),
        ("is read from 5 to 4", |info| info.names.values[0].orders = Some((5, 4))),
        ("lives in bundles 2 to 99", |info| {
            info.names.values[0].bundles = Some([2, 99].map(BundleAddress::new).into())
        }),
    ];
    for (expected, change) in defects {
        let mut info = info.clone();
        change(&mut info);
        let error = image::write_with(&program, Some(&info)).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error} / {expected}");
    }
    let bytes = image::write_with(&program, Some(&info)).expect("an image holds it");
    let (offset, size) = section(&bytes, ".takt.debug");
    let text = String::from_utf8(bytes[offset..offset + size].to_vec()).expect("JSON is text");
    let read = |from: &str, to: &str| {
        let at = text.find(from).expect("it is there");
        let mut bytes = bytes.clone();
        bytes[offset + at..offset + at + to.len()].copy_from_slice(to.as_bytes());
        image::read(&bytes)
    };
    for (from, to) in
        [(":-3", ":-x"), ("\"0.1\"", "\"0,1\""), ("sources", "sauces"), ("positions\":[", "positions\":{")]
    {
        assert!(matches!(read(from, to), Err(ImageError::Debug(_))), "{to}");
    }
    // A name that must not be written is not read either.
    assert_eq!(read("\"label\":\"t.1\"", "\"label\":\"t!1\""), Err(ImageError::Name("t!1".to_owned())));
}

#[test]
fn every_defect_has_its_error() {
    let bytes = image::write(&program()).expect("an image holds it");
    let meta = |from: &'static str, to: &'static str| {
        let error = image::read(&with_meta(&bytes, |meta| meta.replacen(from, to, 1)));
        error.expect_err("it is damaged")
    };
    assert_eq!(meta("\"version\":1", "\"version\":7"), ImageError::Version { found: 7 });
    assert_eq!(meta("\"f3\"", "\"t9\""), ImageError::UnknownMachine(MachineNameError::Machine("t9".into())));
    assert!(matches!(meta("\"machine\"", "\"maschin\""), ImageError::Meta(_)));
    assert!(matches!(meta("\"inputs\":[", "\"inputs\":{"), ImageError::Meta(_)));
    assert!(matches!(meta("\"int\"", "\"jnt\""), ImageError::Meta(_)));
    assert_eq!(meta("\"f3\"", "\"f1\""), ImageError::Sections { bundles: 9 });
    assert!(matches!(meta("\"register\":769", "\"register\":3"), ImageError::Register { .. }));
    assert!(matches!(meta("\"register\":769", "\"register\":768"), ImageError::Register { .. }));
    assert!(matches!(meta("\"register\":769", "\"register\":-1"), ImageError::Meta(_)));
    assert!(matches!(meta("\"register\":769", "\"register\":1023"), ImageError::Register { .. }));
    assert_eq!(meta("\"x\"", "\"1\""), ImageError::Name("1".into()));
    assert_eq!(meta("\"x\"", "\"\""), ImageError::Name(String::new()));
    assert_eq!(meta("\"x\"", "\"n\""), ImageError::RepeatedName("n".into()));
    assert_eq!(meta("\"x\"", "\"t\""), ImageError::RepeatedName("t".into()));
    assert_eq!(meta("\"period\"", "\"other\""), ImageError::Sections { bundles: 3 });
    assert_eq!(meta("\"end\":3", "\"end\":2"), ImageError::Sections { bundles: 3 });
    assert_eq!(meta("\"start\":0", "\"start\":1"), ImageError::Sections { bundles: 3 });
    assert!(matches!(meta("[0,7]", "[1,7]"), ImageError::Lines(_)));
    assert!(matches!(meta("[0,7]", "[0,0]"), ImageError::Lines(_)));
    assert!(matches!(meta("[0,7],", ""), ImageError::Lines(_)));

    let word = |section_name: &str, index: usize, value: u32| {
        let mut bytes = bytes.clone();
        let (offset, _) = section(&bytes, section_name);
        bytes[offset + 4 * index..offset + 4 * index + 4].copy_from_slice(&value.to_le_bytes());
        image::read(&bytes)
    };
    assert!(matches!(word(".takt.code", 1, 1 << 16), Err(ImageError::WordBits { index: 0, .. })));
    assert!(matches!(word(".takt.constants", 0, 1023), Err(ImageError::Register { .. })));
    assert!(matches!(word(".takt.constants", 0, 70_000), Err(ImageError::Register { .. })));
    // Any word of 48 bits may stand in the code: the machine faults on it.
    assert!(word(".takt.code", 0, 0xffff_ffff).is_ok());
    // A symbol's value.
    assert!(matches!(word(".symtab", 5, 4), Err(ImageError::Label { .. })));
    assert!(word(".symtab", 5, 3).is_ok(), "a label may stand at the end");

    let size = |name: &str, size: u32| {
        let mut bytes = bytes.clone();
        let at = section_header(&bytes, name) + 20;
        bytes[at..at + 4].copy_from_slice(&size.to_le_bytes());
        image::read(&bytes).expect_err("it is damaged")
    };
    assert!(matches!(size(".takt.code", 71), ImageError::SectionSize { section: ".takt.code", .. }));
    assert!(matches!(size(".takt.code", 64), ImageError::WordCount { words: 8, .. }));
    assert!(matches!(size(".takt.data", 7), ImageError::SectionSize { section: ".takt.data", .. }));
    assert!(matches!(size(".takt.constants", 4), ImageError::SectionSize { .. }));
    assert!(matches!(size(".takt.code", 1 << 30), ImageError::Damaged(_)));
    assert!(matches!(size(".takt.meta", 10), ImageError::Meta(_)));

    let renamed = |from: &str, to: &str| {
        let mut bytes = bytes.clone();
        let at =
            bytes.windows(from.len()).rposition(|window| window == from.as_bytes()).expect("it is there");
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        image::read(&bytes).expect_err("it is damaged")
    };
    assert_eq!(renamed(".takt.data", ".takt.dote"), ImageError::MissingSection(".takt.data"));
    assert_eq!(renamed(".takt.code", ".takt.data"), ImageError::MissingSection(".takt.code"));
}

#[test]
fn bounds_of_loops() {
    let text = ".loop_bound 7 total 12\na: jmp a\n.loop_bound 4294967295\nb: jmp b\n halt\n";
    let program = common::good(text).program;
    let bytes = image::write(&program).expect("an image holds it");
    assert_eq!(image::read(&bytes).as_ref(), Ok(&program));
    let words = |words: [u32; 4]| {
        let mut bytes = bytes.clone();
        let (offset, size) = section(&bytes, ".takt.loops");
        assert_eq!(size, 16);
        bytes[offset..offset + 16].copy_from_slice(&words.map(u32::to_le_bytes).concat());
        image::read(&bytes)
    };
    assert_eq!(words([0, 7, 1, u32::MAX]), Ok(program.clone()));
    for wrong in [[0, 0, 1, 1], [0, 1, 3, 1], [1, 1, 0, 1], [1, 1, 1, 1]] {
        assert!(matches!(words(wrong), Err(ImageError::Loop { .. })), "{wrong:?}");
    }
    let totals = |words: [u32; 2]| {
        let mut bytes = bytes.clone();
        let (offset, size) = section(&bytes, ".takt.totals");
        assert_eq!(size, 8);
        bytes[offset..offset + 8].copy_from_slice(&words.map(u32::to_le_bytes).concat());
        image::read(&bytes)
    };
    assert_eq!(totals([0, 12]), Ok(program.clone()));
    for wrong in [[0, 0], [2, 12]] {
        assert!(matches!(totals(wrong), Err(ImageError::Loop { .. })), "{wrong:?}");
    }
    assert_eq!(program.loop_bounds.iter().map(|bound| bound.total).collect::<Vec<_>>(), [Some(12), None]);
    // Without bounds the image lacks the section.
    assert!(
        !image::write(&common::good("a: jmp a\n").program)
            .expect("an image holds it")
            .windows(11)
            .any(|w| w == b".takt.loops")
    );
}

#[test]
fn ports_in_images() {
    let text = ".ports latched\n.input x\n.output F, G\n.period\n fmul F, x, x\n fadd G, x, x\n";
    let mut program = common::good(text).program;
    let bytes = image::write(&program).expect("an image holds it");
    assert_eq!(image::read(&bytes).as_ref(), Ok(&program));
    assert!(bytes.windows(14).any(|window| window == b"\"latched\":true"));
    // Images of programs without latched ports do not mention them.
    program.latched = false;
    let bytes = image::write(&program).expect("an image holds it");
    assert_eq!(image::read(&bytes).as_ref(), Ok(&program));
    assert!(!bytes.windows(7).any(|window| window == b"latched"));
    // Two outputs of one number, in two banks.
    program.outputs[1].register =
        program.machine.output_registers(&program.machine.slots[1]).next().expect("a port");
    let error = image::write(&program).expect_err("one number twice");
    assert!(error.to_string().contains("output `G`") && error.to_string().contains("same number"), "{error}");
}

#[test]
fn memories_that_overflow() {
    let mut program = program();
    let depth = program.machine.data_depth as usize;
    program.data = vec![0; depth + 1];
    assert!(matches!(image::write(&program), Err(ImageError::MemorySize { .. })));
    program.data.pop();
    assert!(image::read(&image::write(&program).expect("an image holds it")).is_ok());
    let words = program.machine.slots.len() * (program.machine.code_depth as usize + 1);
    program.code = vec![0; words];
    program.lines = vec![None; words];
    assert!(matches!(image::write(&program), Err(ImageError::MemorySize { .. })));
}

/// An image and its disassembly name the machine with the depths of its memories.
#[test]
fn memories_of_other_depths() {
    let text = "
        .machine f3 code=4096, data = 2*4096
        .input  n:int
        .output y, z
        .data
        low:    .space 8000
        high:   .float 1, 2, 3
        .period
        p:      ld      y, high+2
                ld      z, high[n]
                st      high+1, y
        .rep i, 1, 1500
                fadd    y, y, 1
        .endr
                wait    p
    ";
    let program = common::good(text).program;
    assert_eq!(program.machine.name, "f3,code=4096,data=8192");
    let bytes = image::write(&program).expect("an image holds it");
    let read = image::read(&bytes).expect("it was just written");
    assert_eq!(read, program);
    assert!(std::ptr::eq(read.machine, program.machine));
    let disassembled = takt_asm::disasm::disassemble(&program);
    assert!(disassembled.starts_with(".machine f3 code=4096 data=8192\n"), "{disassembled}");
    assert_eq!(common::good(&disassembled).program.code, program.code);
    // An offset beyond 12 bits, in a load and in a store.
    let offsets = program.code.iter().filter_map(|word| Instruction::decode(*word).ok());
    let offsets = offsets
        .filter(|instruction| matches!(instruction.op.row().function, Function::Load | Function::Store));
    assert_eq!(offsets.map(|instruction| instruction.constant).collect::<Vec<_>>(), [8002, 8000, 8001]);
    // Data that a smaller memory does not hold.
    let small = Program { machine: &takt_isa::F3, ..program };
    assert!(matches!(image::write(&small), Err(ImageError::MemorySize { .. })));
}

#[test]
fn an_image_that_could_not_be_read_is_not_written() {
    let refused = |change: fn(&mut Program)| {
        let mut program = program();
        change(&mut program);
        image::write(&program).expect_err("the reader would refuse it")
    };
    assert_eq!(
        refused(|program| program.symbols[0].name = "a\0b".to_owned()),
        ImageError::Name("a\0b".to_owned())
    );
    assert_eq!(
        refused(|program| program.registers[0].name = ":1".to_owned()),
        ImageError::Name(":1".to_owned())
    );
    assert!(matches!(refused(|program| program.code[0] = 1 << 48), ImageError::WordBits { index: 0, .. }));
    assert!(matches!(
        refused(|program| program.constants.push(program.constants[0])),
        ImageError::Register { .. }
    ));
    assert!(matches!(refused(|program| program.lines.truncate(1)), ImageError::Lines(_)));
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let _ = image::read(&bytes);
        let mut image = b"\x7fELF\x01\x01\x01".to_vec();
        image.extend(bytes);
        let _ = image::read(&image);
    }

    #[test]
    fn no_damage_makes_the_reader_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let (program, info) = debugged();
        let mut bytes = image::write_with(&program, Some(&info)).expect("an image holds it");
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok((program, debug)) = image::read_with(&bytes) {
            // An image that is accepted can be written and read again.
            let (again, known) = image::read_with(&image::write_with(&program, debug.as_ref()).expect("an image holds it")).expect("it was read");
            prop_assert_eq!(again, program);
            prop_assert_eq!(known.map(|known| known.names), debug.map(|debug| debug.names));
        }
    }
}
