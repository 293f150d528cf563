// SPDX-License-Identifier: MIT OR Apache-2.0
//! Disassembly: source text that assembles to the same program, bit for bit.
//!
//! Every register has its place (`@`), every operation its line (`.loc`). A word that the assembler would not put into its slot,
//! because it encodes no instruction or stands in the wrong slot, is written bit by bit (`.raw`).

use std::collections::HashMap;
use std::fmt::Write as _;
use takt_isa::program::{Columns, Location, Port, Space};
use takt_isa::spec::instructions::Function;
use takt_isa::text::push_visible;
use takt_isa::{BundleAddress, Effect, Instruction, Machine, Op, Program, Register, SlotIndex, Type};

/// The source text of a program.
///
/// For every program that [`image::read`](crate::output::image::read) accepts, and every one that the assembler makes, assembling
/// the text for the same machine gives the program again.
pub fn disassemble(program: &Program) -> String {
    let mut writer = Writer::new(program);
    writer.declarations();
    writer.code();
    writer.data();
    writer.text
}

/// The source lines of a bundle's operations.
#[derive(Clone, PartialEq, Eq)]
enum BundleOrigin {
    /// All operations have the same line.
    One(Option<SourcePart>),
    /// Each operation has a line of its own.
    Each(Vec<Option<SourcePart>>),
}

/// A line, and a part of it.
type SourcePart = (Location, Option<Columns>);

struct Writer<'p> {
    program: &'p Program,
    text: String,
    /// Names of registers, by address.
    registers: HashMap<Register, &'p str>,
    /// The first label of each bundle.
    targets: HashMap<BundleAddress, &'p str>,
    filler: u64,
}

/// Type of a declaration as the source writes it.
fn type_suffix(ty: Type) -> &'static str {
    match ty {
        Type::F => "",
        Type::I => ":int",
        Type::B => ":bits",
    }
}

/// A value that reads back as the same bits.
fn value_text(ty: Type, bits: u32) -> String {
    let value = f32::from_bits(bits);
    match ty {
        Type::F => format!("{value:?}"),
        Type::I => bits.cast_signed().to_string(),
        Type::B => format!("0x{bits:08x}"),
    }
}

/// The line that names the machine: a directive if other tools find it by that name.
fn machine(machine: &Machine) -> String {
    match Machine::from_name(machine.name) {
        Ok(found) if found == machine => format!("{}\n", machine.directive()),
        _ => {
            let mut text = format!("; For machine {}, whose file (-m) is:\n", machine.name);
            for line in machine.to_toml().lines() {
                text.push_str(format!("; {line}").trim_end());
                text.push('\n');
            }
            text
        }
    }
}

impl<'p> Writer<'p> {
    fn new(program: &'p Program) -> Writer<'p> {
        let mut targets = HashMap::new();
        for symbol in program.symbols.iter().filter(|symbol| symbol.space == Space::Code) {
            targets.entry(BundleAddress::new(symbol.address)).or_insert(symbol.name.as_str());
        }
        Writer {
            program,
            text: machine(program.machine),
            registers: program.named_registers().map(|port| (port.register, port.name.as_str())).collect(),
            targets,
            filler: Instruction::NOP.encode().unwrap_or(0),
        }
    }

    /// Writes a line of text; writing to a `String` cannot fail.
    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        let _ = self.text.write_fmt(line);
        self.text.push('\n');
    }

    fn place(&self, register: Register) -> String {
        self.program.machine.register_name(register).unwrap_or_default()
    }

    fn declarations(&mut self) {
        let Program { inputs, outputs, parameters, registers, constants, files, latched, .. } = self.program;
        if *latched {
            self.line(format_args!(".ports  latched"));
        }
        for (directive, ports) in [(".input", inputs), (".output", outputs), (".reg", registers)] {
            for Port { name, register, ty } in ports {
                let ty = type_suffix(*ty);
                let place = self.place(*register);
                self.line(format_args!("{directive:<8}{name}{ty} @ {place}"));
            }
        }
        for Port { name, register, ty } in parameters {
            let (suffix, place) = (type_suffix(*ty), self.place(*register));
            let bits = self.program.initial(*register).unwrap_or(0);
            self.line(format_args!(".param  {name}{suffix} @ {place} = {}", value_text(*ty, bits)));
        }
        let is_parameter = |register| parameters.iter().any(|port| port.register == register);
        for (register, bits) in constants.iter().filter(|(register, _)| !is_parameter(*register)) {
            let place = self.place(*register);
            let value = f32::from_bits(*bits);
            self.line(format_args!(".preset @{place} = 0x{bits:08x}  ; {value:?}"));
        }
        for range in &self.program.ranges {
            // Elements are named by their place, and a place has no type.
            let named = self.program.named_registers().find(|port| {
                port.register == range.register && port.ty == range.ty && !port.name.contains('[')
            });
            let name =
                named.map_or_else(|| format!("@{}", self.place(range.register)), |port| port.name.clone());
            let (low, high) = (range.low, range.high);
            let ends = match range.ty {
                Type::F => format!("{:?}, {:?}", f32::from_bits(low), f32::from_bits(high)),
                Type::I | Type::B => format!("{}, {}", low.cast_signed(), high.cast_signed()),
            };
            self.line(format_args!(".range  {name} = {ends}"));
        }
        for range in &self.program.array_ranges {
            let Some(label) = self.program.data_label(range.first) else { continue };
            let ends = match range.ty {
                Type::F => format!("{:?}, {:?}", f32::from_bits(range.low), f32::from_bits(range.high)),
                Type::I | Type::B => format!("{}, {}", range.low.cast_signed(), range.high.cast_signed()),
            };
            self.line(format_args!(".range  {label} = {ends}"));
        }
        for result in &self.program.results {
            let Some(label) = self.program.data_label(result.first) else { continue };
            self.line(format_args!(".result {label}"));
        }
        // The order of the first `.loc` lines is the order of the files in the program.
        for file in files {
            self.line(format_args!(".loc {} 1", quoted(file)));
        }
    }

    fn code(&mut self) {
        let program = self.program;
        let slots = program.machine.slots.len();
        let mut labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Code).peekable();
        let mut loc = None;
        for address in program.addresses() {
            if let Some(section) = program.sections.iter().find(|section| section.start == address) {
                self.line(format_args!("\n.{}", section.name));
            }
            while let Some(label) = labels.next_if(|label| label.address <= address.get()) {
                self.line(format_args!("{}:", label.name));
            }
            if let Some(bound) = program.loop_bounds.iter().find(|bound| bound.address == address) {
                let total = bound.total.map(|total| format!(" total {total}")).unwrap_or_default();
                self.line(format_args!("        .loop_bound {}{total}", bound.most));
            }
            let words = address.index() * slots..(address.index() + 1) * slots;
            let lines: Vec<Option<SourcePart>> =
                words.clone().map(|word| Some((program.lines[word]?, program.part(word)))).collect();
            let (text, places) = self.bundle(&program.code[words], &lines);
            let wanted = match places.as_slice() {
                [first, rest @ ..] if rest.iter().all(|place| place == first) => BundleOrigin::One(*first),
                _ => BundleOrigin::Each(places),
            };
            if loc.as_ref() != Some(&wanted) {
                let text = self.loc(&wanted);
                self.line(format_args!("        .loc {text}"));
                loc = Some(wanted);
            }
            self.line(format_args!("        {text}"));
            self.assumptions(address);
        }
        for label in labels {
            self.line(format_args!("{}:", label.name));
        }
    }

    /// The assumptions about what a bundle writes.
    fn assumptions(&mut self, address: BundleAddress) {
        let program = self.program;
        let Some(Ok(instructions)) = program.bundle(address) else { return };
        let slots = program.machine.slots;
        for ((slot, instruction), word) in
            slots.iter().zip(&instructions).zip(address.index() * slots.len()..)
        {
            let Some(assumption) = program.assumption(word as u32) else { continue };
            let Some(register) = instruction.writes(slot) else { continue };
            // A name with the assumption's type, or the place, which is a float.
            let named = self.registers.get(&register).map(|name| (*name).to_owned());
            let name = named.unwrap_or_else(|| self.place(register));
            for (bound, ends) in assumption.bounds() {
                self.line(format_args!("        .assume {name} {bound} {ends}"));
            }
        }
    }

    fn loc(&self, loc: &BundleOrigin) -> String {
        let place = |place: &Option<SourcePart>| match place {
            Some((Location { file, line }, columns)) => {
                let file = quoted(self.program.files.get(*file as usize).map_or("", String::as_str));
                let columns = columns.map_or(String::new(), |part| format!("[{},{}]", part.first, part.last));
                format!("{file} {line}{columns}")
            }
            None => "none".to_owned(),
        };
        match loc {
            BundleOrigin::One(one) => place(one),
            BundleOrigin::Each(each) => each.iter().map(place).collect::<Vec<_>>().join(" || "),
        }
    }

    /// A bundle's text, and the source lines of its operations.
    fn bundle(&self, words: &[u64], lines: &[Option<SourcePart>]) -> (String, Vec<Option<SourcePart>>) {
        let slots = || self.program.machine.numbered_slots().map(|(slot, _)| slot);
        let word = |slot: SlotIndex| words[slot.index()];
        let is_filler = |slot: &SlotIndex| word(*slot) == self.filler && lines[slot.index()].is_none();
        let mut present: Vec<SlotIndex> = slots().filter(|slot| !is_filler(slot)).collect();
        if present.is_empty() {
            present.push(SlotIndex::FIRST);
        }
        let mut texts: Vec<String> = Vec::with_capacity(present.len());
        let mut idle = Vec::new();
        for &slot in &present {
            texts.push(self.operation(word(slot), slot).unwrap_or_else(|| {
                if word(slot) == self.filler {
                    idle.push((texts.len(), slot));
                }
                self.raw(word(slot), slot)
            }));
        }
        // A `nop` takes the first free slot: write `nop` where that is the right slot for each.
        let free = slots().filter(|slot| !present.contains(slot) || idle.iter().any(|(_, nop)| nop == slot));
        if free.zip(&idle).all(|(free, (_, slot))| free == *slot) {
            for (index, _) in &idle {
                texts[*index] = Op::nop.row().mnemonic.to_owned();
            }
        }
        (texts.join(" || "), present.iter().map(|slot| lines[slot.index()]).collect())
    }

    fn raw(&self, word: u64, slot: SlotIndex) -> String {
        format!(".raw {} 0x{word:012x}", self.program.machine.slot(slot).name)
    }

    /// The text of a word, if the assembler would put the text's word into this slot.
    fn operation(&self, word: u64, slot: SlotIndex) -> Option<String> {
        let machine = self.program.machine;
        let instruction = Instruction::decode(word).ok()?;
        instruction.place(machine, slot).ok()?;
        let function = instruction.op.row().function;
        if function == Function::Idle {
            return None;
        }
        let is_access = matches!(instruction.effect(), Effect::Load | Effect::Store);
        if is_access && instruction.sources[0] == Register::ZERO && instruction.constant >= machine.data_depth
        {
            return None;
        }
        let register = |register: Register| match self.registers.get(&register) {
            Some(name) => (*name).to_owned(),
            None if register == Register::ZERO => self.place(register),
            None => format!("@{}", self.place(register)),
        };
        let target = |address: BundleAddress| match self.targets.get(&address) {
            Some(name) => (*name).to_owned(),
            None => address.to_string(),
        };
        let text = instruction.text_with(machine, slot, register, target);
        if machine.hosts(function).len() < 2 {
            return Some(text);
        }
        // Several slots host the function: name the slot.
        let (mnemonic, operands) = text.split_at(instruction.op.row().mnemonic.len());
        Some(format!("{mnemonic}.{}{operands}", machine.slot(slot).name))
    }

    fn data(&mut self) {
        const WORDS: usize = 8;
        let program = self.program;
        let mut labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Data).peekable();
        if program.data.is_empty() && labels.peek().is_none() {
            return;
        }
        self.line(format_args!("\n.data"));
        let mut at = 0;
        while at < program.data.len() {
            while let Some(label) = labels.next_if(|label| label.address as usize <= at) {
                self.line(format_args!("{}:", label.name));
            }
            let end = labels.peek().map_or(program.data.len(), |label| label.address as usize);
            let rest = &program.data[at..end.min(program.data.len())];
            let zeros = rest.iter().take_while(|word| **word == 0).count();
            if zeros >= WORDS {
                self.line(format_args!("        .space {zeros}"));
                at += zeros;
                continue;
            }
            let words: Vec<String> = rest.iter().take(WORDS).map(|word| format!("0x{word:08x}")).collect();
            self.line(format_args!("        .word {}", words.join(", ")));
            at += words.len();
        }
        for label in labels {
            self.line(format_args!("{}:", label.name));
        }
    }
}

/// A text between quotes.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            '\r' => quoted.push_str("\\r"),
            // Escape characters that control a terminal, which a file's name may contain.
            c => push_visible(&mut quoted, c),
        }
    }
    quoted.push('"');
    quoted
}
