// SPDX-License-Identifier: MIT OR Apache-2.0
//! State at a position: frames, variables, values, bundles, memory.

use super::breakpoints::{address, reference};
use super::protocol::{
    Answer, Body, CompletionItem, CompletionsArguments, DisassembleArguments, DisassembledInstruction,
    EvaluateArguments, EvaluateResponse, Format, Memory, ReadMemoryArguments, Scope, ScopeArguments,
    SetArguments, Source, SourceArguments, StackFrame, StackTrace, StackTraceArguments, Variable,
    VariablesArguments, answer,
};
use super::{CORE, DebuggedSession};
use takt_debug::panes::{flight, stalls};
use takt_debug::session::{Place, ValueNotations};
use takt_debug::system::link_text;
use takt_isa::program::{Location, Port};
use takt_isa::{BundleAddress, Register, Type};

/// Maximum number of variables in one list.
const VARIABLES: usize = 4096;
/// Maximum number of completions in an answer.
const COMPLETIONS: usize = 200;
/// Maximum number of bundles in an answer.
const BUNDLES: u64 = 4096;
/// Maximum number of memory bytes in an answer.
const BYTES: u64 = 1 << 20;

/// Numbers of a core's variable lists.
const INPUTS: u64 = 1;
const OUTPUTS: u64 = 2;
const NAMED: u64 = 3;
const FLIGHT: u64 = 4;
const STALLS: u64 = 5;
const MACHINE: u64 = 6;
/// Links of a system: the same list for every core.
const LINKS: u64 = 7;
/// First of the banks' register lists; the lists of each register's notations follow.
const BANKS: u64 = 16;
const VIEWS: u64 = 64;

/// Text of a register's bits.
fn value_text(ty: Type, bits: Option<u32>, hex: bool) -> String {
    match bits {
        None => "(never written)".to_owned(),
        Some(bits) if hex => format!("0x{bits:08x}"),
        Some(bits) => ValueNotations::new(ty, bits).text,
    }
}

/// Value with a note if it is stale.
fn noted(value: String, note: Option<String>) -> String {
    note.map_or(value.clone(), |note| format!("{value}  ({note})"))
}

/// A variable without children.
fn plain(name: impl Into<String>, value: String) -> Variable {
    Variable { name: name.into(), value, ..Variable::default() }
}

impl DebuggedSession {
    /// A source in the form of the protocol: a path, or a number with which its text can be requested.
    pub(super) fn source(&self, core: usize, file: u32) -> Source {
        let session = self.session(core);
        let name = session.program().files.get(file as usize).cloned().unwrap_or_default();
        let path = self.path_of(core, file).map(|path| path.display().to_string());
        let has_text = path.is_none() && session.source(file).is_some();
        let source_reference = has_text.then(|| core as u64 * CORE + u64::from(file) + 1);
        Source { name, path, source_reference }
    }

    pub(super) fn source_text(&mut self, arguments: &SourceArguments) -> Answer {
        let number = arguments.source.source_reference.or(arguments.source_reference).unwrap_or(0);
        let file = (number % CORE).checked_sub(1);
        let text = self
            .checked(number / CORE)
            .zip(file)
            .and_then(|(core, file)| self.session(core).source(file as u32));
        let text = text.ok_or_else(|| format!("there is no source {number}"))?;
        answer(Body::Content(text.to_owned()))
    }

    pub(super) fn stack(&mut self, arguments: StackTraceArguments, from_one: (bool, bool)) -> Answer {
        let core = self.thread(arguments.thread_id)?;
        let session = self.session(core);
        let (emulator, program) = (session.emulator(), session.program());
        let mut frames = vec![(emulator.next_address(), session.location())];
        let calls = emulator.stack().iter().rev().map(|back| back.previous());
        frames.extend(calls.map(|call| (call, program.location(call))));
        let total_frames = frames.len();
        let start = arguments.start_frame.unwrap_or(0) as usize;
        let levels = arguments.levels.filter(|levels| *levels > 0).unwrap_or(u64::MAX) as usize;
        let frame = |(id, (at, location)): (usize, (BundleAddress, Option<Location>))| StackFrame {
            id: core as u64 * CORE + id as u64,
            name: match program.nearest_label(at) {
                Some((label, 0)) => label.to_owned(),
                Some((label, distance)) => format!("{label}+{distance}"),
                None => format!("bundle {at}"),
            },
            source: location.map(|location| self.source(core, location.file)),
            line: location.map_or(0, |location| location.line.saturating_sub(u32::from(!from_one.0))),
            column: u32::from(from_one.1),
            instruction_pointer_reference: reference(core, at.get().into()),
        };
        let stack_frames = frames.into_iter().enumerate().skip(start).take(levels).map(frame).collect();
        answer(StackTrace { stack_frames, total_frames })
    }

    pub(super) fn scopes(&self, of: &ScopeArguments) -> Answer {
        let core = self.core_of(of)?;
        let program = self.session(core).program();
        let scope = |name: &str, number: u64, named_variables: usize, expensive: bool| Scope {
            name: name.to_owned(),
            variables_reference: core as u64 * CORE + number,
            named_variables,
            expensive,
        };
        let mut scopes = vec![
            scope("Registers", NAMED, program.registers.len(), false),
            scope("Inputs", INPUTS, program.host_registers().count(), false),
            scope("Outputs", OUTPUTS, program.outputs.len(), false),
            scope("In flight", FLIGHT, 0, false),
            scope("Stalls", STALLS, 0, false),
            scope("Machine", MACHINE, 0, false),
        ];
        let links = self.links().len();
        if links > 0 {
            scopes.insert(3, scope("Links", LINKS, links, false));
        }
        for (number, bank) in (BANKS..VIEWS).zip(program.machine.banks()) {
            scopes.push(scope(&format!("Bank {}", bank.name), number, usize::from(bank.depth), true));
        }
        answer(Body::Scopes(scopes))
    }

    /// Links of a system with their contents.
    fn links(&self) -> Vec<Variable> {
        let Some(system) = self.console.system().map(|session| session.system()) else { return Vec::new() };
        let links = system.description().links.iter().enumerate();
        links.map(|(number, link)| plain(&link.name, link_text(system, number))).collect()
    }

    fn register_row(&self, core: usize, name: &str, register: Register, ty: Type, hex: bool) -> Variable {
        let session = self.session(core);
        let bits = session.register(register);
        let place = session.program().machine.register_name(register).unwrap_or_default();
        Variable {
            name: name.to_owned(),
            value: noted(
                value_text(ty, bits, hex),
                session.stale(register).map(|stale| stale.text(session.program())),
            ),
            ty: Some(format!("{} in {place}", ty.name())),
            evaluate_name: Some(name.to_owned()),
            variables_reference: if bits.is_some() { views(core, register) } else { 0 },
        }
    }

    pub(super) fn variables(&mut self, arguments: &VariablesArguments) -> Answer {
        let all = arguments.variables_reference;
        let unknown = || format!("there is no list of variables {all}");
        let core = self.checked(all / CORE).ok_or_else(unknown)?;
        let hex = Format::is_hex(arguments.format.as_ref());
        let program = self.session(core).program();
        let row = |port: &Port| self.register_row(core, &port.name, port.register, port.ty, hex);
        let ports = |ports: &[Port]| -> Vec<Variable> { ports.iter().map(row).collect() };
        let mut rows = match all % CORE {
            INPUTS => program.host_registers().map(row).collect(),
            OUTPUTS => ports(&program.outputs),
            NAMED => ports(&program.registers),
            FLIGHT => self.in_flight(core),
            STALLS => {
                let rows = stalls(self.session(core)).into_iter();
                rows.map(|(cycles, what)| plain(what, cycles.to_string())).collect()
            }
            LINKS => self.links(),
            MACHINE => self.machine(core),
            bank @ BANKS..VIEWS => {
                let bank = program.machine.banks().nth((bank - BANKS) as usize);
                let bank = bank.ok_or("there is no such bank")?;
                let start = arguments.start.unwrap_or(0) as usize;
                let count = arguments.count.filter(|count| *count > 0).unwrap_or(u64::MAX) as usize;
                let registers = Register::all().filter(|register| bank.contains(*register));
                let row = |register| {
                    let place = program.machine.register_name(register).unwrap_or_default();
                    self.register_row(core, &format!("@{place}"), register, Type::B, hex)
                };
                registers.skip(start).take(count.min(VARIABLES)).map(row).collect()
            }
            view => {
                let register =
                    view.checked_sub(VIEWS).and_then(|view| Register::new(usize::try_from(view).ok()?));
                self.views(core, register.ok_or_else(unknown)?)
            }
        };
        rows.truncate(VARIABLES);
        answer(Body::Variables(rows))
    }

    fn in_flight(&self, core: usize) -> Vec<Variable> {
        let row = |one: takt_debug::panes::InFlightOperation| {
            let register = if one.register.is_empty() { one.mnemonic.to_owned() } else { one.register };
            let cycles = if one.left == 1 { "cycle" } else { "cycles" };
            plain(register, format!("{} {cycles} to go: {} of {}", one.left, one.mnemonic, one.from))
        };
        flight(self.session(core)).into_iter().map(row).collect()
    }

    /// State of the machine apart from its registers.
    fn machine(&mut self, core: usize) -> Vec<Variable> {
        let stall = self.console.core_mut(core).and_then(|session| session.stall());
        let session = self.session(core);
        let (program, emulator) = (session.program(), session.emulator());
        let set = takt_isa::fp::Flags::NAMES.iter().filter(|(flag, _)| emulator.flags().contains(*flag));
        let flags: Vec<&str> = set.map(|(_, name)| *name).collect();
        let or = |text: String, none: &str| if text.is_empty() { none.to_owned() } else { text };
        vec![
            plain("machine", program.machine.name.to_owned()),
            plain("cycle", session.cycle().to_string()),
            plain("period", session.period().to_string()),
            plain("flags", or(flags.join(" "), "none")),
            plain("next bundle", program.bundle_text(emulator.next_address())),
            plain("stalled", stall.map_or("no".to_owned(), |cause| program.cause_text(cause))),
            plain("missed deadlines", emulator.statistics().missed.to_string()),
        ]
    }

    /// Register bits in all notations.
    fn views(&self, core: usize, register: Register) -> Vec<Variable> {
        let Some(bits) = self.session(core).register(register) else { return Vec::new() };
        let views = ValueNotations::new(Type::F, bits);
        let float = views.float;
        // The ulp is the distance to the next binary32 number.
        let ulp = f64::from(f32::from_bits(float.abs().to_bits().saturating_add(1))) - f64::from(float.abs());
        vec![
            plain("float", views.text.clone()),
            plain("hex float", views.hex_float.clone()),
            plain("int", views.integer.to_string()),
            plain("bits", format!("0x{bits:08x}")),
            plain("1 ulp", if float.is_finite() { format!("{ulp:e}") } else { "none".to_owned() }),
        ]
    }

    /// Assigns to the destination that an expression names.
    pub(super) fn set_variable(&mut self, SetArguments { name, value, of }: &SetArguments) -> Answer {
        let core = self.core_of(of)?;
        let session = self.session(core);
        let live = session.parse(name)?;
        let Some((place, ty, _)) = session.place(&live)? else {
            return Err(format!("`{name}` is neither a register nor a word of memory"));
        };
        let live = session.parse(value)?;
        let note = session.note(&live);
        let bits = session.evaluate(&live)?.bits(ty).map_err(|fault| fault.to_string())?;
        self.console.set(core, place, bits)?;
        let variables_reference = match place {
            Place::Register(register) => views(core, register),
            Place::Word(_) => 0,
        };
        let value = Some(noted(value_text(ty, Some(bits), false), note));
        answer(EvaluateResponse { value, ty: Some(ty.name()), variables_reference, result: None })
    }

    pub(super) fn evaluate(&mut self, arguments: &EvaluateArguments) -> Answer {
        let EvaluateArguments { expression, context, format, of } = arguments;
        let hex = Format::is_hex(format.as_ref());
        let core = self.core_of(of)?;
        let session = self.session(core);
        let evaluated = session.parse(expression).and_then(|live| {
            let (variables_reference, ty, value) = match session.place(&live)? {
                Some((Place::Register(register), ty, bits)) => {
                    (views(core, register), ty.name(), value_text(ty, bits, hex))
                }
                Some((Place::Word(_), ty, bits)) => (0, ty.name(), value_text(ty, bits, hex)),
                None => (0, "value", session.evaluate(&live)?.to_string()),
            };
            let value = noted(value, session.note(&live));
            Ok(EvaluateResponse { result: Some(value), ty: Some(ty), variables_reference, value: None })
        });
        match evaluated {
            // The console also accepts read-only commands of the debugger.
            Err(error) if context.as_deref() == Some("repl") => {
                self.console.select(core);
                let text = self.console.look(expression).unwrap_or(Err(error))?;
                answer(EvaluateResponse {
                    result: Some(text.trim_end().to_owned()),
                    ..EvaluateResponse::default()
                })
            }
            evaluated => answer(evaluated?),
        }
    }

    pub(super) fn completions(&mut self, arguments: &CompletionsArguments) -> Answer {
        let CompletionsArguments { text, column, of } = arguments;
        let end = column.map_or(text.len(), |column| (column as usize).saturating_sub(1));
        let before: String = text.chars().take(end).collect();
        let start = before
            .rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'))
            .map_or(0, |at| at + 1);
        let core = self.core_of(of)?;
        let names = self.session(core).names(before.get(start..).unwrap_or(""));
        let item = |label| CompletionItem { label, start, length: before.len() - start };
        answer(Body::Targets(names.into_iter().take(COMPLETIONS).map(item).collect()))
    }

    pub(super) fn disassemble(&mut self, arguments: &DisassembleArguments, from_one: bool) -> Answer {
        let asked = &arguments.memory_reference;
        let (core, first) =
            self.address(asked).ok_or_else(|| format!("`{asked}` is not a bundle's address"))?;
        let offset = arguments.instruction_offset.unwrap_or(0).saturating_add(arguments.offset.unwrap_or(0));
        let first = i64::from(first.get()).saturating_add(offset);
        let count = arguments.instruction_count.min(BUNDLES) as i64;
        let rows = (0..count).map(|index| self.instruction(core, first.saturating_add(index), from_one));
        answer(Body::Instructions(rows.collect()))
    }

    /// Disassembly of a bundle; beyond the program, a placeholder.
    fn instruction(&self, core: usize, number: i64, from_one: bool) -> DisassembledInstruction {
        let session = self.session(core);
        let program = session.program();
        let Some(at) = u32::try_from(number).ok().filter(|number| *number < program.bundles()) else {
            return DisassembledInstruction {
                address: reference(core, number.clamp(0, u32::MAX.into()) as u64),
                instruction: "(no bundle)".to_owned(),
                presentation_hint: Some("invalid"),
                ..DisassembledInstruction::default()
            };
        };
        let at = BundleAddress::new(at);
        let slots = program.machine.slots.iter().zip(session.bundle(at));
        let operations: Vec<String> =
            slots.filter_map(|(slot, text)| Some(format!("{}: {}", slot.name, text?))).collect();
        let words: Vec<String> =
            program.words(at).unwrap_or_default().iter().map(|word| format!("{word:012x}")).collect();
        let location = program.location(at);
        DisassembledInstruction {
            address: reference(core, at.get().into()),
            instruction: if operations.is_empty() { "nop".to_owned() } else { operations.join(" | ") },
            instruction_bytes: Some(words.join(" ")),
            symbol: program.nearest_label(at).filter(|label| label.1 == 0).map(|(label, _)| label.to_owned()),
            location: location.map(|location| self.source(core, location.file)),
            line: location.map(|location| location.line.saturating_sub(u32::from(!from_one))),
            presentation_hint: None,
        }
    }

    /// Parses an address with its core; `None` if the core does not exist.
    pub(super) fn address(&self, text: &str) -> Option<(usize, BundleAddress)> {
        let (core, address) = address(text)?;
        Some((self.checked(core)?, address))
    }

    /// Reads data memory: `memoryReference` is a word address; the bytes are little-endian.
    pub(super) fn read_memory(&mut self, arguments: &ReadMemoryArguments) -> Answer {
        let asked = &arguments.memory_reference;
        let (core, word) = self.address(asked).ok_or_else(|| format!("`{asked}` is not a word's address"))?;
        let start = (i64::from(word.get()) * 4).saturating_add(arguments.offset.unwrap_or(0));
        let count = arguments.count.min(BYTES) as usize;
        let memory = self.session(core).emulator().memory();
        let bytes: Vec<u8> = memory.iter().flat_map(|word| word.to_le_bytes()).collect();
        let from = usize::try_from(start).unwrap_or(usize::MAX).min(bytes.len());
        let found = &bytes[from..from.saturating_add(count).min(bytes.len())];
        answer(Memory {
            address: reference(core, start.max(0) as u64 / 4),
            unreadable_bytes: count - found.len(),
            data: base64(found),
        })
    }
}

/// Number of the list that contains a register's notations.
fn views(core: usize, register: Register) -> u64 {
    core as u64 * CORE + VIEWS + u64::from(register.get())
}

/// Base64 encoding of bytes.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let group =
            chunk.iter().fold(0u32, |group, byte| group << 8 | u32::from(*byte)) << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            let index = (group >> (18 - 6 * digit)) as usize & 63;
            text.push(if digit <= chunk.len() { char::from(DIGITS[index]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn base_64() {
        for (bytes, text) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(super::base64(bytes.as_bytes()), text);
        }
    }
}
