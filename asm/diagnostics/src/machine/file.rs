// SPDX-License-Identifier: MIT OR Apache-2.0
//! A machine's row as a file (TOML), each mistake at its place. [`Machine::error`] checks the row like the table's rows;
//! this module checks that names, keys and numbers can be read at all.

use super::too_long;
use crate::diag::{Diagnostic, Diagnostics};
use crate::source::{Sources, Span};
use crate::{nearest, toml_mistake};
use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use std::collections::HashMap;
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use takt_isa::spec::row::{BankOwned, RowError, RowOwned, RowPlace, SlotOwned, UnitOwned};
use takt_isa::{Function, Machine, MachineReason, UNITS};
use toml::Spanned;

/// Maximum length of a machine's file, in bytes.
pub const FILE_BYTES: usize = 1 << 16;
/// Maximum length of a name in a file, in bytes: names become parts of names in assembly and Verilog.
const NAME_BYTES: usize = 40;
/// Maximum number of units of a slot.
const UNITS_OF_SLOT: usize = 32;

/// Advice for a file with missing parts.
const PATTERN: &str =
    "`takt machines t3 --toml` prints a file that has every key; docs/machines.md explains them";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Spanned<String>,
    #[serde(default)]
    text: String,
    code_depth: Spanned<i64>,
    data_depth: Spanned<i64>,
    stack_depth: Spanned<i64>,
    loop_depth: Spanned<i64>,
    outputs_per_bank: Spanned<i64>,
    refill: Spanned<i64>,
    resolve: Spanned<i64>,
    inputs: BankTable,
    #[serde(default)]
    slot: Vec<SlotTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BankTable {
    bank: Spanned<String>,
    base: Spanned<i64>,
    depth: Spanned<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SlotTable {
    name: Spanned<String>,
    bank: Spanned<String>,
    base: Spanned<i64>,
    depth: Spanned<i64>,
    units: Spanned<Vec<Spanned<Entry>>>,
}

/// An entry of `units`: a name, or a table with one.
struct Entry(UnitTable);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UnitTable {
    unit: String,
    functions: Option<Vec<Spanned<String>>>,
    latency: Option<Spanned<i64>>,
    interval: Option<Spanned<i64>>,
}

impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Entry, D::Error> {
        struct EntryVisitor;

        impl<'de> Visitor<'de> for EntryVisitor {
            type Value = Entry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a unit: \"sine\", or { unit = \"sine\", interval = 6 }")
            }

            fn visit_str<E>(self, unit: &str) -> Result<Entry, E> {
                let unit = unit.to_owned();
                Ok(Entry(UnitTable { unit, functions: None, latency: None, interval: None }))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Entry, A::Error> {
                UnitTable::deserialize(MapAccessDeserializer::new(map)).map(Entry)
            }
        }

        deserializer.deserialize_any(EntryVisitor)
    }
}

/// Name and text of each machine's file, by the machine's name.
type Files = HashMap<&'static str, [Arc<str>; 2]>;

/// The files of the machines that were read, for messages of later stages.
static FILES: LazyLock<Mutex<Files>> = LazyLock::new(Mutex::default);

fn span(range: Range<usize>) -> Span {
    Span::new(range.start as u32, range.end as u32)
}

fn diagnostics(name: &str, text: &str, list: Vec<Diagnostic>) -> Diagnostics {
    let mut sources = Sources::default();
    sources.add(name, text.to_owned());
    Diagnostics { sources: Arc::new(sources), list, ..Diagnostics::default() }
}

/// Reads a machine's row. A row that was read before gives the same machine.
///
/// # Errors
/// All mistakes that one pass over the file finds.
pub fn read(name: &str, text: &str) -> Result<&'static Machine, Diagnostics> {
    if text.len() > FILE_BYTES {
        return Err(diagnostics(name, text, vec![Diagnostic::placeless("limit", too_long())]));
    }
    let file = parse(text).map_err(|error| diagnostics(name, text, vec![syntax(&error, text)]))?;
    let mut reader = Reader { mistakes: Vec::new() };
    let row = reader.row(&file);
    if !reader.mistakes.is_empty() {
        return Err(diagnostics(name, text, reader.mistakes));
    }
    match row.machine() {
        Ok(machine) => {
            let mut files = FILES.lock().unwrap_or_else(PoisonError::into_inner);
            files.insert(machine.name, [name.into(), text.into()]);
            Ok(machine)
        }
        Err(error) => Err(diagnostics(name, text, vec![mistake(&file, &error)])),
    }
}

/// A message at the place of a part of a machine, in the file from which the machine was read; `None` for other machines. Options
/// in the machine's name are ignored.
pub fn about(machine: &str, place: RowPlace<'_>, message: &str, help: &str) -> Option<Diagnostics> {
    let [name, text] = {
        let files = FILES.lock().unwrap_or_else(PoisonError::into_inner);
        files.get(machine.split(',').next()?)?.clone()
    };
    let file = parse(&text).ok()?;
    let diagnostic = Diagnostic::error("machine", span(find(&file, place)), message).help(help);
    Some(diagnostics(&name, &text, vec![diagnostic]))
}

fn parse(text: &str) -> Result<File, toml::de::Error> {
    toml::from_str(text)
}

fn syntax(error: &toml::de::Error, text: &str) -> Diagnostic {
    let diagnostic = toml_mistake(error, text);
    let other = toml::from_str::<toml::Table>(text).ok().filter(|file| !file.contains_key("slot"));
    let kinds =
        [("core", "a system of cores"), ("board", "a board's wiring"), ("peripheral", "a board's wiring")];
    let kind = other.and_then(|file| kinds.into_iter().find(|(key, _)| file.contains_key(*key)));
    match kind {
        Some((_, kind)) => {
            Diagnostic { message: format!("expected a machine, found {kind}"), ..diagnostic }.help(PATTERN)
        }
        None if diagnostic.help.is_none() => diagnostic.help(PATTERN),
        None => diagnostic,
    }
}

/// The error of a row that can be read, at its place.
fn mistake(file: &File, error: &RowError) -> Diagnostic {
    let RowError::Machine(error) = error else {
        let diagnostic = Diagnostic::error("machine", span(file.name.span()), error.to_string());
        return match error {
            RowError::Taken { .. } => {
                diagnostic.help("choose another name; `takt machines` lists those that are taken")
            }
            _ => diagnostic,
        };
    };
    let reason = &error.reason;
    let diagnostic = Diagnostic::error("machine", span(find(file, reason.place())), error.to_string());
    let other = match reason {
        MachineReason::Overlap { other, .. } => Some((RowPlace::Bank(other), "the other bank")),
        MachineReason::TwoUnits { slot, other, .. } => Some((RowPlace::Unit(slot, other), "the other unit")),
        MachineReason::TwoSlots { other, .. } => Some((RowPlace::Slot(other), "the other slot")),
        MachineReason::LoadAfterStore { store, .. } => Some((RowPlace::Slot(store), "the slot that stores")),
        _ => None,
    };
    let diagnostic = diagnostic.help(reason.mend());
    match other.map(|(place, text)| (find(file, place), text)) {
        Some((place, text))
            if Some(span(place.clone())) != diagnostic.labels.first().map(|label| label.span) =>
        {
            diagnostic.also(span(place), text)
        }
        _ => diagnostic,
    }
}

/// The place of a part of the row; among several with the same name, the last.
fn find(file: &File, place: RowPlace<'_>) -> Range<usize> {
    let top = || file.name.span();
    let slot = |name: &str| file.slot.iter().rev().find(|slot| slot.name.get_ref() == name);
    match place {
        RowPlace::Name => top(),
        RowPlace::Slots => file.slot.last().map_or_else(top, |slot| slot.name.span()),
        RowPlace::Field(field) => match field {
            "code_depth" => file.code_depth.span(),
            "data_depth" => file.data_depth.span(),
            "stack_depth" => file.stack_depth.span(),
            "loop_depth" => file.loop_depth.span(),
            "outputs_per_bank" => file.outputs_per_bank.span(),
            "refill" => file.refill.span(),
            "resolve" => file.resolve.span(),
            _ => top(),
        },
        RowPlace::Slot(name) => slot(name).map_or_else(top, |slot| slot.name.span()),
        RowPlace::Bank(name) => {
            let banks = file.slot.iter().map(|slot| &slot.bank).chain([&file.inputs.bank]);
            banks.rev().find(|bank| bank.get_ref() == name).map_or_else(top, Spanned::span)
        }
        RowPlace::Unit(name, unit) => {
            let units = slot(name).map(|slot| slot.units.get_ref());
            let found =
                units.and_then(|units| units.iter().rev().find(|entry| entry.get_ref().0.unit == unit));
            found.map_or_else(|| slot(name).map_or_else(top, |slot| slot.name.span()), Spanned::span)
        }
    }
}

struct Reader {
    mistakes: Vec<Diagnostic>,
}

impl Reader {
    fn row(&mut self, file: &File) -> RowOwned {
        let mut slots = Vec::new();
        for table in &file.slot {
            let units = table.units.get_ref();
            if units.len() > UNITS_OF_SLOT {
                let message = format!("{} units; a slot can have at most {UNITS_OF_SLOT}", units.len());
                self.mistakes.push(Diagnostic::error("limit", span(table.units.span()), message));
            }
            let counts = *file.loop_depth.get_ref() != 0;
            let units =
                units.iter().take(UNITS_OF_SLOT).filter_map(|entry| self.unit(entry, counts)).collect();
            let bank = self.bank(&table.bank, &table.base, &table.depth);
            slots.push(SlotOwned { name: self.name(&table.name), bank, units });
        }
        RowOwned {
            name: self.name(&file.name),
            text: file.text.clone(),
            slots,
            inputs: self.bank(&file.inputs.bank, &file.inputs.base, &file.inputs.depth),
            outputs_per_bank: self.number("outputs_per_bank", &file.outputs_per_bank),
            code_depth: self.number("code_depth", &file.code_depth),
            data_depth: self.number("data_depth", &file.data_depth),
            stack_depth: self.number("stack_depth", &file.stack_depth),
            loop_depth: self.number("loop_depth", &file.loop_depth),
            refill: self.number("refill", &file.refill),
            resolve: self.number("resolve", &file.resolve),
        }
    }

    fn name(&mut self, name: &Spanned<String>) -> String {
        if name.get_ref().len() > NAME_BYTES {
            let message =
                format!("the name has {} bytes; at most {NAME_BYTES} are allowed", name.get_ref().len());
            self.mistakes.push(Diagnostic::error("limit", span(name.span()), message));
        }
        name.get_ref().clone()
    }

    /// A number in the type of the row's field; the row's own checks come later.
    fn number<T: TryFrom<i64> + Default>(&mut self, what: &str, number: &Spanned<i64>) -> T {
        T::try_from(*number.get_ref()).unwrap_or_else(|_| {
            let message = format!("{what} is {}, which is out of range", number.get_ref());
            let error = Diagnostic::error("machine", span(number.span()), message);
            self.mistakes
                .push(error.help("a number that is not negative, and below 65536 if it counts registers"));
            T::default()
        })
    }

    fn bank(&mut self, name: &Spanned<String>, base: &Spanned<i64>, depth: &Spanned<i64>) -> BankOwned {
        let name = self.name(name);
        BankOwned { name, base: self.number("base", base), depth: self.number("depth", depth) }
    }

    /// A unit as the machine has it. On a machine that counts no loops (`counts` is false), a unit lacks [`Function::Loop`]
    /// unless the entry lists its functions.
    fn unit(&mut self, entry: &Spanned<Entry>, counts: bool) -> Option<UnitOwned> {
        let UnitTable { unit: name, functions, latency, interval } = &entry.get_ref().0;
        let Some(mut unit) = UnitOwned::of(name) else {
            let known = UNITS.iter().map(|unit| unit.name);
            let names: Vec<&str> = known.clone().collect();
            let error =
                Diagnostic::error("machine", span(entry.span()), format!("there is no unit `{name}`"));
            let error = error.did_you_mean(nearest(name, known)).note(format!("units: {}", names.join(", ")));
            self.mistakes.push(error);
            return None;
        };
        if let Some(functions) = functions {
            let own = std::mem::take(&mut unit.functions);
            let names: Vec<String> = own.iter().map(|function| function.name().to_lowercase()).collect();
            for wanted in functions {
                match names.iter().position(|name| name == wanted.get_ref()) {
                    Some(at) if !unit.functions.contains(&own[at]) => unit.functions.push(own[at]),
                    Some(_) => {}
                    None => {
                        let message = format!("unit `{name}` has no function `{}`", wanted.get_ref());
                        let near = nearest(wanted.get_ref(), names.iter().map(String::as_str));
                        let error = Diagnostic::error("machine", span(wanted.span()), message);
                        let error = error.help(format!("it has {}", names.join(", "))).did_you_mean(near);
                        self.mistakes.push(error);
                    }
                }
            }
        } else if !counts {
            unit.functions.retain(|function| *function != Function::Loop);
        }
        if let Some(latency) = latency {
            unit.latency = self.number("latency", latency);
        }
        if let Some(interval) = interval {
            unit.interval = self.number("interval", interval);
        }
        Some(unit)
    }
}
