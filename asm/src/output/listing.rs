// SPDX-License-Identifier: MIT OR Apache-2.0
//! Listing of a program, its symbol map, and its memories as `$readmemh` files.

use crate::AssembledProgram;
use crate::context::bits_text;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt::Write as _;
use takt_diagnostics::source::Lines;
use takt_isa::program::{Columns, Location, Port, Space};
use takt_isa::text::visible;
use takt_isa::{Instruction, Program, SlotIndex, Type};
use takt_syntax::expr::Value;

/// The listing of an assembled program: for each bundle its address, its words in the order of the slots, and the source lines that
/// they come from. An operation made by a macro, a repetition or the assembler is disassembled, after a `+`; so is an operation
/// that computes a part of an equation, with that part. A line begins with the slots of its operations that another slot could have
/// taken.
pub fn listing(assembled: &AssembledProgram) -> String {
    let mut lister = Lister::new(assembled);
    lister.code();
    lister.data();
    lister.constants();
    match visible(&lister.text) {
        Cow::Borrowed(_) => lister.text,
        Cow::Owned(text) => text,
    }
}

struct Lister<'a> {
    program: &'a Program,
    assembled: &'a AssembledProgram,
    /// Text and lines of each file of the program that is among the sources.
    files: Vec<Option<(&'a str, Lines)>>,
    filler: u64,
    text: String,
}

impl<'a> Lister<'a> {
    fn new(assembled: &'a AssembledProgram) -> Lister<'a> {
        let program = &assembled.program;
        let source = |name: &String| {
            let file = assembled.sources.files().iter().find(|file| *file.name == **name)?;
            Some((file.text.as_str(), Lines::of(&file.text)))
        };
        let files = program.files.iter().map(source).collect();
        let filler = Instruction::NOP.encode().unwrap_or(0);
        Lister { program, assembled, files, filler, text: String::new() }
    }

    /// Writes a line of text; writing to a `String` cannot fail.
    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        let start = self.text.len();
        let _ = self.text.write_fmt(line);
        self.text.truncate(start + self.text[start..].trim_end().len());
        self.text.push('\n');
    }

    fn code(&mut self) {
        let program = self.program;
        let slots = program.machine.slots;
        let heads: String = slots.iter().map(|slot| format!("{:<14}", slot.name)).collect();
        self.line(format_args!(
            "; {} bundles of {} for {}, {} words of data, {} constants",
            program.bundles(),
            slots.len(),
            program.machine.name,
            program.data.len(),
            program.constants.len()
        ));
        match self.assembled.contractions.len() {
            0 => {}
            1 => self.line(format_args!("; 1 product fused into a sum")),
            count => self.line(format_args!("; {count} products fused into sums")),
        }
        for spills in &self.assembled.spills {
            self.line(format_args!("; {spills}"));
            for value in &spills.values {
                let place =
                    value.location.map_or(String::new(), |at| format!("{}: ", program.place_text(at)));
                self.line(format_args!(";   {place}{value}"));
            }
        }
        self.line(format_args!("; addr  {heads}line            source"));
        let mut labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Code).peekable();
        for address in program.addresses() {
            if let Some(section) = program.sections.iter().find(|section| section.start == address) {
                self.line(format_args!("\n.{}", section.name));
            }
            let first = address.index() * slots.len();
            let range = first..first + slots.len();
            let mut words = String::new();
            for (word, line) in program.code[range.clone()].iter().zip(&program.lines[range]) {
                // Fillers are left blank.
                let blank = *word == self.filler && line.is_none();
                let _ = write!(words, "{:<14}", if blank { "-".to_owned() } else { format!("{word:012x}") });
            }
            let mut rows = self.rows(first).into_iter();
            let head = rows.next().unwrap_or_default();
            while let Some(label) = labels.next_if(|label| label.address <= address.get()) {
                // The source line shows a single operation already.
                if !head.1.starts_with(&format!("{}:", label.name)) {
                    self.line(format_args!("{}:", label.name));
                }
            }
            self.line(format_args!("  {:04x}  {words}{:<15} {}", address.get(), head.0, head.1));
            let indent = 8 + words.len();
            for (place, text) in rows {
                self.line(format_args!("{:indent$}{place:<15} {text}", ""));
            }
        }
        for label in labels {
            self.line(format_args!("{}:", label.name));
        }
    }

    /// The source lines of a bundle whose words begin at `first`: place and text.
    fn rows(&self, first: usize) -> Vec<(String, String)> {
        let program = self.program;
        let mut rows: Vec<(String, String, Vec<&str>)> = Vec::new();
        let slots = program.machine.slots.len();
        for (slot, _) in program.machine.numbered_slots() {
            let index = first + slot.index();
            let row = match program.lines[index] {
                None if program.code[index] == self.filler => continue,
                None => (String::new(), self.operation(index, slot)),
                Some(location) => {
                    let expanded = self.assembled.expanded.binary_search(&(index as u32)).is_ok();
                    let place = program.place_text(location);
                    if let Some(Columns { first, last }) = program.part(index) {
                        let part = self.columns(location, first, last);
                        let operation = self.operation(index, slot);
                        rows.push((
                            place + "+",
                            format!("{operation:<31} ; {part}"),
                            self.chosen(index, slot).into_iter().collect(),
                        ));
                        continue;
                    }
                    match self.source(location) {
                        // Each operation of a serialised bundle is shown by itself.
                        Some(text) if !(expanded || slots == 1 && text.contains("||")) => (place, text),
                        _ => (place + "+", self.operation(index, slot)),
                    }
                }
            };
            // A line with several operations is shown once.
            let at = rows.iter().position(|(place, text, _)| (place, text) == (&row.0, &row.1));
            let at = at.unwrap_or_else(|| {
                rows.push((row.0, row.1, Vec::new()));
                rows.len() - 1
            });
            rows[at].2.extend(self.chosen(index, slot));
        }
        let shown = |(place, text, slots): (String, String, Vec<&str>)| match slots.is_empty() {
            true => (place, text),
            false => (place, format!("{:<8}{text}", slots.join(" "))),
        };
        rows.into_iter().map(shown).collect()
    }

    /// The slot of an operation, if another could have taken it.
    fn chosen(&self, index: usize, slot: SlotIndex) -> Option<&'a str> {
        let machine = self.program.machine;
        let function = Instruction::decode(self.program.code[index]).ok()?.op.row().function;
        (machine.hosts(function).len() > 1).then(|| machine.slot(slot).name)
    }

    /// A part of a source line.
    fn columns(&self, location: Location, first: u32, last: u32) -> String {
        let line = self.files.get(location.file as usize).and_then(Option::as_ref);
        let line = line.and_then(|(text, lines)| lines.text(text, location.line)).unwrap_or("");
        let part = line.chars().skip(first as usize - 1).take((last - first + 1).min(160) as usize);
        part.map(|c| if c == '\t' { ' ' } else { c }).collect()
    }

    fn source(&self, location: Location) -> Option<String> {
        let (text, lines) = self.files.get(location.file as usize)?.as_ref()?;
        // Replace tabs, which would break the alignment, and cut long lines, which may be a megabyte long.
        let line = lines.text(text, location.line)?.trim().replace('\t', " ");
        Some(line.chars().take(160).collect())
    }

    /// Disassembles the operation of a word.
    fn operation(&self, index: usize, slot: SlotIndex) -> String {
        let program = self.program;
        let word = program.code[index];
        match Instruction::decode(word) {
            Ok(instruction) => {
                let target = |address| program.target_text(address);
                instruction.text_with(program.machine, slot, |register| self.register(register), target)
            }
            Err(_) => format!(".raw 0x{word:012x}"),
        }
    }

    /// The source's name of a register, or the value of the constant that it holds.
    fn register(&self, register: takt_isa::Register) -> String {
        let constants = &self.program.constants;
        let named = self.program.named_registers().any(|port| port.register == register);
        match constants.binary_search_by_key(&register, |constant| constant.0) {
            Ok(index) if !named => bits_text(constants[index].1),
            _ => self.program.register_text(register),
        }
    }

    fn data(&mut self) {
        let program = self.program;
        let mut labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Data).peekable();
        if program.data.is_empty() && labels.peek().is_none() {
            return;
        }
        self.line(format_args!("\n.data"));
        for (address, word) in program.data.iter().enumerate() {
            while let Some(label) = labels.next_if(|label| label.address as usize <= address) {
                self.line(format_args!("{}:", label.name));
            }
            self.line(format_args!("  {address:04x}  {word:08x}      {}", bits_text(*word)));
        }
        for label in labels {
            self.line(format_args!("{}:", label.name));
        }
    }

    fn constants(&mut self) {
        let program = self.program;
        if program.constants.is_empty() {
            return;
        }
        self.line(format_args!("\n; registers that the loader sets"));
        for (register, bits) in &program.constants {
            let name = program.machine.register_name(*register).unwrap_or_default();
            self.line(format_args!("  {name:<6}{bits:08x}      {}", bits_text(*bits)));
        }
    }
}

/// Symbol map: names of a program with their values.
#[derive(Clone, Debug, Serialize)]
pub struct SymbolMap {
    /// Labels, by ascending address.
    pub labels: Vec<Label>,
    /// Input ports of the program.
    pub inputs: Vec<Register>,
    /// Output ports of the program.
    pub outputs: Vec<Register>,
    /// Parameters in the order of their declaration.
    pub parameters: Vec<Register>,
    /// Registers with a name.
    pub registers: Vec<Register>,
    /// Constants with a name.
    pub constants: Vec<Constant>,
}

/// A label of the [`SymbolMap`].
#[derive(Clone, Debug, Serialize)]
pub struct Label {
    /// Name of the label.
    pub name: String,
    /// Memory that the label points into.
    pub space: Space,
    /// Address of the bundle or data word.
    pub address: u32,
}

/// A named register of the [`SymbolMap`].
#[derive(Clone, Debug, Serialize)]
pub struct Register {
    /// Name in the source.
    pub name: String,
    /// Canonical name of its place on the machine.
    pub place: String,
    /// Address in the register space.
    pub address: takt_isa::Register,
    /// Number of a port; `None` for other registers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<u16>,
    /// Type by which debuggers show the bits.
    #[serde(rename = "type")]
    pub ty: Type,
}

/// A named constant of the [`SymbolMap`].
#[derive(Clone, Debug, Serialize)]
pub struct Constant {
    /// Name in the source.
    pub name: String,
    /// Value of its expression.
    pub value: Value,
}

/// The symbol map of an assembled program.
pub fn symbol_map(assembled: &AssembledProgram) -> SymbolMap {
    let Program { machine, symbols, inputs, outputs, parameters, registers, .. } = &assembled.program;
    let label = |symbol: &takt_isa::program::Symbol| Label {
        name: symbol.name.clone(),
        space: symbol.space,
        address: symbol.address,
    };
    let list = |ports: &[Port]| {
        let register = |port: &Port| Register {
            name: port.name.clone(),
            place: machine.register_name(port.register).unwrap_or_default(),
            address: port.register,
            number: machine.input_number(port.register).or_else(|| machine.output_number(port.register)),
            ty: port.ty,
        };
        ports.iter().map(register).collect()
    };
    let constant = |(name, value): &(String, Value)| Constant { name: name.clone(), value: *value };
    SymbolMap {
        labels: symbols.iter().map(label).collect(),
        inputs: list(inputs),
        outputs: list(outputs),
        parameters: list(parameters),
        registers: list(registers),
        constants: assembled.constants.iter().map(constant).collect(),
    }
}

impl std::fmt::Display for SymbolMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = self.labels.iter().map(|label| label.name.len());
        let lists = [
            ("input", &self.inputs),
            ("output", &self.outputs),
            ("param", &self.parameters),
            ("register", &self.registers),
        ];
        let ports = lists.iter().flat_map(|(_, list)| *list);
        let names = names.chain(ports.map(|register| register.name.len()));
        let width =
            names.chain(self.constants.iter().map(|constant| constant.name.len())).max().unwrap_or(0) + 2;
        for label in &self.labels {
            let space = if label.space == Space::Code { "code" } else { "data" };
            writeln!(f, "label     {:<width$}{space} {:04x}", label.name, label.address)?;
        }
        for (what, list) in lists {
            for register in list {
                let ty = register.ty.name();
                let what = register.number.map_or(what.to_owned(), |number| format!("{what} {number}"));
                writeln!(f, "{what:<10}{:<width$}{:<5} {ty}", register.name, register.place)?;
            }
        }
        for constant in &self.constants {
            write!(f, "constant  {:<width$}", constant.name)?;
            match constant.value {
                Value::Int(value) => writeln!(f, "{value}")?,
                Value::Real(value) => writeln!(f, "{value:?}")?,
            }
        }
        Ok(())
    }
}

/// The program's memories in the format that Verilog's `$readmemh` reads, as file names and contents: `code_SLOT.hex` for
/// each slot, `data.hex`, and `constants_BANK.hex` for each bank, whose addresses count from the bank's first register.
pub fn readmemh(program: &Program) -> Vec<(String, String)> {
    let slots = program.machine.slots;
    let mut files = Vec::new();
    for (index, slot) in slots.iter().enumerate() {
        let words = program.code.iter().skip(index).step_by(slots.len());
        files.push((format!("code_{}.hex", slot.name), words.map(|word| format!("{word:012x}\n")).collect()));
    }
    files.push(("data.hex".to_owned(), program.data.iter().map(|word| format!("{word:08x}\n")).collect()));
    for bank in program.machine.banks() {
        let mut contents = String::new();
        for (register, bits) in &program.constants {
            if let Some(index) = bank.index(*register) {
                let _ = writeln!(contents, "@{:03x} {bits:08x}", index.get());
            }
        }
        files.push((format!("constants_{}.hex", bank.name), contents));
    }
    files
}
