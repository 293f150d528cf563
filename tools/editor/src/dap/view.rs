//! What there is to see: frames, variables, values, bundles, memory.

use crate::dap::breakpoints::{address, reference};
use crate::dap::{Answer, CORE, Debugged, number, text};
use serde_json::{Value as Json, json};
use takt_debug::panes::{flight, stalls};
use takt_debug::session::{Place, Shown};
use takt_isa::program::{Location, Port};
use takt_isa::timing::Cause;
use takt_isa::{BundleAddress, Register, Type};

/// Variables of one list at most.
const VARIABLES: usize = 4096;
/// Bundles of one request at most.
const BUNDLES: u64 = 4096;
/// Bytes of memory of one request at most.
const BYTES: u64 = 1 << 20;

/// The lists of variables of a core, by number.
const INPUTS: u64 = 1;
const OUTPUTS: u64 = 2;
const NAMED: u64 = 3;
const FLIGHT: u64 = 4;
const STALLS: u64 = 5;
const MACHINE: u64 = 6;
/// Of a system, the same for each core.
const LINKS: u64 = 7;
/// From here on, the registers of each bank; then the ways to read each register.
const BANKS: u64 = 16;
const VIEWS: u64 = 64;

/// A register's bits as they are shown.
fn shown(ty: Type, bits: Option<u32>, hex: bool) -> String {
    match bits {
        None => "(never written)".to_owned(),
        Some(bits) if hex => format!("0x{bits:08x}"),
        Some(bits) => Shown::new(ty, bits).text,
    }
}

impl Debugged {
    /// A source as the protocol has it: its path, or the number by which its text can be had.
    pub(super) fn source(&self, core: usize, file: u32) -> Json {
        let session = self.target.session(core);
        let name = session.program().files.get(file as usize).cloned().unwrap_or_default();
        match self.path_of(core, file) {
            Some(path) => json!({ "name": name, "path": path }),
            None if session.source(file).is_some() => {
                json!({ "name": name, "sourceReference": core as u64 * CORE + u64::from(file) + 1 })
            }
            None => json!({ "name": name }),
        }
    }

    pub(super) fn source_text(&mut self, arguments: &Json) -> Answer {
        let reference = &arguments["source"]["sourceReference"];
        let number = reference.as_u64().or(arguments["sourceReference"].as_u64()).unwrap_or(0);
        let file = (number % CORE).checked_sub(1);
        let text = self
            .target
            .checked(number / CORE)
            .zip(file)
            .and_then(|(core, file)| self.target.session(core).source(file as u32));
        text.map(|text| json!({ "content": text })).ok_or_else(|| format!("there is no source {number}"))
    }

    pub(super) fn stack(&mut self, arguments: &Json, from_one: (bool, bool)) -> Answer {
        let core = self.thread(arguments)?;
        let session = self.target.session(core);
        let (emulator, program) = (session.emulator(), session.program());
        let mut frames = vec![(emulator.next_address(), session.location())];
        let calls = emulator.stack().iter().rev().map(|back| back.previous());
        frames.extend(calls.map(|call| (call, program.location(call))));
        let total = frames.len();
        let start = arguments["startFrame"].as_u64().unwrap_or(0) as usize;
        let levels = arguments["levels"]
            .as_u64()
            .filter(|levels| *levels > 0)
            .map_or(usize::MAX, |levels| levels as usize);
        let frame = |(id, (at, location)): (usize, (BundleAddress, Option<Location>))| {
            let name = match program.nearest_label(at) {
                Some((label, 0)) => label.to_owned(),
                Some((label, distance)) => format!("{label}+{distance}"),
                None => format!("bundle {at}"),
            };
            let mut frame = json!({
                "id": core as u64 * CORE + id as u64,
                "name": name,
                "line": location.map_or(0, |location| location.line.saturating_sub(u32::from(!from_one.0))),
                "column": u32::from(from_one.1),
                "instructionPointerReference": reference(core, at.get().into()),
            });
            if let Some(location) = location {
                frame["source"] = self.source(core, location.file);
            }
            frame
        };
        let frames: Vec<Json> = frames.into_iter().enumerate().skip(start).take(levels).map(frame).collect();
        Ok(json!({ "stackFrames": frames, "totalFrames": total }))
    }

    pub(super) fn scopes(&self, arguments: &Json) -> Answer {
        let core = self.core_of(arguments)?;
        let program = self.target.session(core).program();
        let scope = |name: &str, number: u64, count: usize, expensive: bool| json!({ "name": name, "variablesReference": core as u64 * CORE + number, "namedVariables": count, "expensive": expensive });
        let mut scopes = vec![
            scope("Registers", NAMED, program.registers.len(), false),
            scope("Inputs", INPUTS, program.inputs.len(), false),
            scope("Outputs", OUTPUTS, program.outputs.len(), false),
            scope("In flight", FLIGHT, 0, false),
            scope("Stalls", STALLS, 0, false),
            scope("Machine", MACHINE, 0, false),
        ];
        let links = self.target.links().len();
        if links > 0 {
            scopes.insert(3, scope("Links", LINKS, links, false));
        }
        for (number, bank) in (BANKS..VIEWS).zip(program.machine.banks()) {
            scopes.push(scope(&format!("Bank {}", bank.name), number, usize::from(bank.depth), true));
        }
        Ok(json!({ "scopes": scopes }))
    }

    fn register_row(&self, core: usize, name: &str, register: Register, ty: Type, hex: bool) -> Json {
        let session = self.target.session(core);
        let bits = session.register(register);
        let place = session.program().machine.register_name(register).unwrap_or_default();
        json!({
            "name": name,
            "value": shown(ty, bits, hex),
            "type": format!("{} in {place}", ty.name()),
            "evaluateName": name,
            "variablesReference": if bits.is_some() { views(core, register) } else { 0 },
        })
    }

    pub(super) fn variables(&mut self, arguments: &Json) -> Answer {
        let all = number(arguments, "variablesReference")?;
        let unknown = || format!("there is no list of variables {all}");
        let core = self.target.checked(all / CORE).ok_or_else(unknown)?;
        let reference = all % CORE;
        let hex = arguments["format"]["hex"].as_bool().unwrap_or(false);
        let stall = self.target.core_mut(core).session.stall();
        let debugged = &*self;
        let session = debugged.target.session(core);
        let program = session.program();
        let ports = |ports: &[Port]| -> Vec<Json> {
            ports
                .iter()
                .map(|port| debugged.register_row(core, &port.name, port.register, port.ty, hex))
                .collect()
        };
        let plain =
            |name: String, value: String| json!({ "name": name, "value": value, "variablesReference": 0 });
        let rows: Vec<Json> = match reference {
            INPUTS => ports(&program.inputs),
            OUTPUTS => ports(&program.outputs),
            NAMED => ports(&program.registers),
            FLIGHT => flight(session)
                .into_iter()
                .map(|one| {
                    let register =
                        if one.register.is_empty() { one.mnemonic.to_owned() } else { one.register };
                    let cycles = if one.left == 1 { "cycle" } else { "cycles" };
                    plain(register, format!("{} {cycles} to go: {} of {}", one.left, one.mnemonic, one.from))
                })
                .collect(),
            STALLS => {
                stalls(session).into_iter().map(|(cycles, what)| plain(what, cycles.to_string())).collect()
            }
            LINKS => debugged.target.links().into_iter().map(|(name, value)| plain(name, value)).collect(),
            MACHINE => {
                let emulator = session.emulator();
                let flags: Vec<&str> = takt_isa::fp::Flags::NAMES
                    .iter()
                    .filter(|(flag, _)| emulator.flags().contains(*flag))
                    .map(|(_, name)| *name)
                    .collect();
                let cause = |cause: Cause| program.cause_text(cause);
                vec![
                    plain("machine".to_owned(), program.machine.name.to_owned()),
                    plain("cycle".to_owned(), session.cycle().to_string()),
                    plain("period".to_owned(), session.period().to_string()),
                    plain(
                        "flags".to_owned(),
                        if flags.is_empty() { "none".to_owned() } else { flags.join(" ") },
                    ),
                    plain("next bundle".to_owned(), program.bundle_text(emulator.next_address())),
                    plain("stalled".to_owned(), stall.map_or("no".to_owned(), cause)),
                    plain("missed deadlines".to_owned(), emulator.statistics().missed.to_string()),
                ]
            }
            BANKS..VIEWS => {
                let bank = program
                    .machine
                    .banks()
                    .nth((reference - BANKS) as usize)
                    .ok_or("there is no such bank")?;
                let start = arguments["start"].as_u64().unwrap_or(0) as usize;
                let count = arguments["count"]
                    .as_u64()
                    .filter(|count| *count > 0)
                    .map_or(VARIABLES, |count| count as usize);
                let registers =
                    Register::all().filter(|register| bank.contains(*register)).skip(start).take(count);
                registers
                    .map(|register| {
                        let place = program.machine.register_name(register).unwrap_or_default();
                        debugged.register_row(core, &format!("@{place}"), register, Type::B, hex)
                    })
                    .collect()
            }
            _ => {
                let register = usize::try_from(reference - reference.min(VIEWS)).ok().and_then(Register::new);
                let register = register.filter(|_| reference >= VIEWS);
                debugged.views(core, register.ok_or_else(unknown)?)
            }
        };
        Ok(json!({ "variables": rows.into_iter().take(VARIABLES).collect::<Vec<_>>() }))
    }

    /// A register's bits in every way.
    fn views(&self, core: usize, register: Register) -> Vec<Json> {
        let Some(bits) = self.target.session(core).register(register) else { return Vec::new() };
        let views = Shown::new(Type::F, bits);
        let float = views.float;
        // The distance to the next number: what one unit in the last place is here.
        let ulp = f64::from(f32::from_bits(float.abs().to_bits().saturating_add(1))) - f64::from(float.abs());
        let row =
            |name: &str, value: String| json!({ "name": name, "value": value, "variablesReference": 0 });
        vec![
            row("float", views.text.clone()),
            row("hex float", views.hex_float.clone()),
            row("int", views.integer.to_string()),
            row("bits", format!("0x{bits:08x}")),
            row("1 ulp", if float.is_finite() { format!("{ulp:e}") } else { "none".to_owned() }),
        ]
    }

    /// Sets what an expression names.
    pub(super) fn set_variable(&mut self, name: &str, arguments: &Json) -> Answer {
        let written = text(arguments, "value")?.to_owned();
        let core = self.core_of(arguments)?;
        let session = self.target.session(core);
        let live = session.parse(name)?;
        let Some((place, ty, _)) = session.place(&live)? else {
            return Err(format!("`{name}` is neither a register nor a word of memory"));
        };
        let value = session.parse(&written).and_then(|live| session.evaluate(&live))?;
        let bits = value.bits(ty).map_err(|fault| fault.to_string())?;
        self.target.set(core, place, bits)?;
        let reference = match place {
            Place::Register(register) => views(core, register),
            Place::Word(_) => 0,
        };
        Ok(
            json!({ "value": shown(ty, Some(bits), false), "type": ty.name(), "variablesReference": reference }),
        )
    }

    pub(super) fn evaluate(&mut self, arguments: &Json) -> Answer {
        let written = text(arguments, "expression")?.to_owned();
        let hex = arguments["format"]["hex"].as_bool().unwrap_or(false);
        let core = self.core_of(arguments)?;
        let session = self.target.session(core);
        let result = session.parse(&written).and_then(|live| {
            let (reference, ty, value) = match session.place(&live)? {
                Some((Place::Register(register), ty, bits)) => {
                    (views(core, register), Some(ty), shown(ty, bits, hex))
                }
                Some((Place::Word(_), ty, bits)) => (0, Some(ty), shown(ty, bits, hex)),
                None => (0, None, session.evaluate(&live)?.to_string()),
            };
            Ok((reference, ty, value))
        });
        match result {
            Ok((reference, ty, value)) => Ok(json!({
                "result": value,
                "type": ty.map_or("value", takt_isa::Type::name),
                "variablesReference": reference,
            })),
            // In the console, the debugger's own commands that only look.
            Err(error) if arguments["context"] == "repl" => {
                self.target.select(core);
                let text = self.target.look(&written).unwrap_or(Err(error))?;
                Ok(json!({ "result": text.trim_end(), "variablesReference": 0 }))
            }
            Err(error) => Err(error),
        }
    }

    pub(super) fn completions(&mut self, arguments: &Json) -> Answer {
        let written = text(arguments, "text")?;
        let end =
            arguments["column"].as_u64().map_or(written.len(), |column| (column as usize).saturating_sub(1));
        let before: String = written.chars().take(end).collect();
        let start = before
            .rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'))
            .map_or(0, |at| at + 1);
        let core = self.core_of(arguments)?;
        let names = self.target.session(core).names(before.get(start..).unwrap_or(""));
        let targets: Vec<Json> = names
            .into_iter()
            .take(200)
            .map(|name| json!({ "label": name, "start": start, "length": before.len() - start }))
            .collect();
        Ok(json!({ "targets": targets }))
    }

    pub(super) fn disassemble(&mut self, arguments: &Json, from_one: bool) -> Answer {
        let asked = text(arguments, "memoryReference")?;
        let (core, first) = self.address(asked).ok_or_else(|| format!("`{asked}` is no bundle's address"))?;
        let offset = arguments["instructionOffset"]
            .as_i64()
            .unwrap_or(0)
            .saturating_add(arguments["offset"].as_i64().unwrap_or(0));
        let count = number(arguments, "instructionCount")?.min(BUNDLES);
        let session = self.target.session(core);
        let program = session.program();
        let mut rows = Vec::new();
        for number in
            (0..count as i64).map(|index| i64::from(first.get()).saturating_add(offset).saturating_add(index))
        {
            let address = u32::try_from(number)
                .ok()
                .filter(|number| *number < program.bundles())
                .map(BundleAddress::new);
            let Some(at) = address else {
                rows.push(json!({ "address": reference(core, number.clamp(0, u32::MAX.into()) as u64), "instruction": "(no bundle)", "presentationHint": "invalid" }));
                continue;
            };
            let slots = program.machine.slots.iter().zip(session.bundle(at));
            let operations: Vec<String> =
                slots.filter_map(|(slot, text)| Some(format!("{}: {}", slot.name, text?))).collect();
            let words: Vec<String> =
                program.words(at).unwrap_or_default().iter().map(|word| format!("{word:012x}")).collect();
            let mut row = json!({
                "address": reference(core, at.get().into()),
                "instructionBytes": words.join(" "),
                "instruction": if operations.is_empty() { "nop".to_owned() } else { operations.join(" | ") },
            });
            if let Some((label, 0)) = program.nearest_label(at) {
                row["symbol"] = label.into();
            }
            if let Some(location) = program.location(at) {
                row["location"] = self.source(core, location.file);
                row["line"] = location.line.saturating_sub(u32::from(!from_one)).into();
            }
            rows.push(row);
        }
        Ok(json!({ "instructions": rows }))
    }

    /// An address with its core, if there is such a core.
    fn address(&self, text: &str) -> Option<(usize, BundleAddress)> {
        let (core, address) = address(text)?;
        Some((self.target.checked(core)?, address))
    }

    /// Data memory: `memoryReference` is a word's address, bytes are little-endian.
    pub(super) fn read_memory(&mut self, arguments: &Json) -> Answer {
        let asked = text(arguments, "memoryReference")?;
        let (core, word) = self.address(asked).ok_or_else(|| format!("`{asked}` is no word's address"))?;
        let start = (i64::from(word.get()) * 4).saturating_add(arguments["offset"].as_i64().unwrap_or(0));
        let count = number(arguments, "count")?.min(BYTES) as usize;
        let memory = self.target.session(core).emulator().memory();
        let bytes: Vec<u8> = memory.iter().flat_map(|word| word.to_le_bytes()).collect();
        let from = usize::try_from(start).unwrap_or(usize::MAX).min(bytes.len());
        let found = &bytes[from..from.saturating_add(count).min(bytes.len())];
        Ok(json!({
            "address": reference(core, start.max(0) as u64 / 4),
            "unreadableBytes": count - found.len(),
            "data": base64(found),
        }))
    }
}

/// The number of the list of ways to read a register.
fn views(core: usize, register: Register) -> u64 {
    core as u64 * CORE + VIEWS + u64::from(register.get())
}

/// Bytes in base 64, as the protocol has them.
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
