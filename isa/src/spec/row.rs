// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rows of machines made at run time, for example from a file. They pass the checks of the table's rows ([`Machine::error`]), are
//! kept for as long as the process runs, and each exists once.

use super::check::MachineError;
use super::fixture::FIXTURES;
use super::instructions::Function;
use super::machines::{Bank, MACHINES, Machine, Slot};
use super::units::{UNITS, Unit};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::sync::{LazyLock, Mutex, PoisonError};

/// Limit on the rows that a process may add to the table's, invalid ones included: each occupies about 2 KB until it exits.
pub const MOST_ROWS: usize = 16_384;

/// A machine's row that owns its texts; the fields are [`Machine`]'s.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
#[allow(missing_docs, reason = "the fields are those of the machine")]
pub struct RowOwned {
    pub name: String,
    pub text: String,
    pub slots: Vec<SlotOwned>,
    pub inputs: BankOwned,
    pub outputs_per_bank: u16,
    pub code_depth: u32,
    pub data_depth: u32,
    pub stack_depth: u32,
    pub loop_depth: u32,
    pub refill: u32,
    pub resolve: u32,
}

/// A slot of a [`RowOwned`].
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
#[allow(missing_docs, reason = "the fields are those of the slot")]
pub struct SlotOwned {
    pub name: String,
    pub bank: BankOwned,
    pub units: Vec<UnitOwned>,
}

/// A bank of a [`RowOwned`].
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
#[allow(missing_docs, reason = "the fields are those of the bank")]
pub struct BankOwned {
    pub name: String,
    pub base: u16,
    pub depth: u16,
}

/// A unit of a [`RowOwned`]: a row of the table of units, with functions and cycles of its own.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct UnitOwned {
    /// Name in the table of units.
    pub name: &'static str,
    /// Functions that the unit executes in this machine, a subset of the table's.
    pub functions: Vec<Function>,
    /// Cycles from issue to the earliest issue of a dependent operation.
    pub latency: u32,
    /// Cycles between two issues.
    pub interval: u32,
}

/// The reason why a row does not make a machine.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum RowError {
    /// The row is invalid, by a check that the table's rows pass.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Another machine of the table has this name.
    #[error("`{name}` is a machine of Takt's, and this is another: it needs a name of its own")]
    Taken {
        /// Name of both machines.
        name: &'static str,
    },
    /// The process already holds [`MOST_ROWS`] rows.
    #[error("more than {MOST_ROWS} machines in one run")]
    Many,
}

/// The part of a row that a message points at, by the row's own names.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RowPlace<'a> {
    /// Name of the machine.
    Name,
    /// List of the slots.
    Slots,
    /// A number of the row, by the name of its field.
    Field(&'static str),
    /// A slot, by its name.
    Slot(&'a str),
    /// A bank, the inputs' included.
    Bank(&'a str),
    /// A unit of a slot.
    Unit(&'a str, &'a str),
}

static ROWS: LazyLock<Mutex<HashMap<RowOwned, &'static Machine>>> = LazyLock::new(Mutex::default);

/// The machine of the table, fixtures included, with a name.
pub(super) fn builtin(name: &str) -> Option<&'static Machine> {
    MACHINES.iter().chain(FIXTURES).copied().find(|machine| machine.name == name)
}

fn leak(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

impl UnitOwned {
    /// A unit of the table, by its name.
    pub fn of(name: &str) -> Option<UnitOwned> {
        UNITS.iter().find(|unit| unit.name == name).map(UnitOwned::from)
    }

    fn leaked(&self) -> Unit {
        // Readers derive every `UnitOwned` from a row; a unit without a row keeps its name, for which no circuit exists.
        let row = UNITS.iter().find(|unit| unit.name == self.name).unwrap_or(&UNITS[0]);
        let functions = match row.functions == self.functions {
            true => row.functions,
            false => Box::leak(self.functions.clone().into_boxed_slice()),
        };
        // The cuts describe the pipeline of the row's latency.
        let cuts = if self.latency == row.latency { row.cuts } else { &[] };
        Unit { name: self.name, functions, latency: self.latency, interval: self.interval, cuts, ..*row }
    }
}

impl From<&Unit> for UnitOwned {
    fn from(unit: &Unit) -> UnitOwned {
        let Unit { name, functions, latency, interval, .. } = *unit;
        UnitOwned { name, functions: functions.to_vec(), latency, interval }
    }
}

impl BankOwned {
    fn leaked(&self) -> Bank {
        Bank { name: leak(&self.name), base: self.base, depth: self.depth }
    }
}

impl From<&Bank> for BankOwned {
    fn from(bank: &Bank) -> BankOwned {
        BankOwned { name: bank.name.to_owned(), base: bank.base, depth: bank.depth }
    }
}

impl From<&Machine> for RowOwned {
    fn from(machine: &Machine) -> RowOwned {
        let slot = |slot: &Slot| SlotOwned {
            name: slot.name.to_owned(),
            bank: (&slot.bank).into(),
            units: slot.units.iter().map(UnitOwned::from).collect(),
        };
        RowOwned {
            name: machine.name.to_owned(),
            text: machine.text.to_owned(),
            slots: machine.slots.iter().map(slot).collect(),
            inputs: (&machine.inputs).into(),
            outputs_per_bank: machine.outputs_per_bank,
            code_depth: machine.code_depth,
            data_depth: machine.data_depth,
            stack_depth: machine.stack_depth,
            loop_depth: machine.loop_depth,
            refill: machine.refill,
            resolve: machine.resolve,
        }
    }
}

impl RowOwned {
    fn leaked(&self) -> &'static Machine {
        let slot = |slot: &SlotOwned| Slot {
            name: leak(&slot.name),
            bank: slot.bank.leaked(),
            units: slot.units.iter().map(UnitOwned::leaked).collect::<Vec<_>>().leak(),
        };
        Box::leak(Box::new(Machine {
            name: leak(&self.name),
            text: leak(&self.text),
            slots: self.slots.iter().map(slot).collect::<Vec<_>>().leak(),
            inputs: self.inputs.leaked(),
            outputs_per_bank: self.outputs_per_bank,
            code_depth: self.code_depth,
            data_depth: self.data_depth,
            stack_depth: self.stack_depth,
            loop_depth: self.loop_depth,
            refill: self.refill,
            resolve: self.resolve,
        }))
    }

    /// The machine of the row: the table's, if this row is in the table, or else one that lives as long as the process.
    ///
    /// # Errors
    /// If the row is invalid, or has the name of another machine of the table.
    pub fn machine(&self) -> Result<&'static Machine, RowError> {
        if let Some(builtin) = builtin(&self.name) {
            // The text does not affect programs.
            let same = RowOwned { text: builtin.text.to_owned(), ..self.clone() } == RowOwned::from(builtin);
            return if same { Ok(builtin) } else { Err(RowError::Taken { name: builtin.name }) };
        }
        let mut known = ROWS.lock().unwrap_or_else(PoisonError::into_inner);
        let machine = match known.get(self) {
            Some(machine) => *machine,
            None if known.len() >= MOST_ROWS => return Err(RowError::Many),
            None => {
                let machine = self.leaked();
                known.insert(self.clone(), machine);
                machine
            }
        };
        match machine.error() {
            None => Ok(machine),
            Some(error) => Err(error.into()),
        }
    }
}

impl Machine {
    /// The machine is a row of the table or a fixture, with any memories, so that every tool finds it by name. A file's machine is
    /// not built in.
    pub fn is_builtin(&self) -> bool {
        builtin(self.row_name()).is_some()
    }

    /// The row as a TOML file for `-m`, with this machine's depths of memories.
    pub fn to_toml(&self) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "name = \"{}\"", self.identifier());
        let _ = writeln!(out, "text = {}", quoted(self.text));
        for (key, value) in [
            ("code_depth", self.code_depth),
            ("data_depth", self.data_depth),
            ("stack_depth", self.stack_depth),
            ("loop_depth", self.loop_depth),
            ("outputs_per_bank", self.outputs_per_bank.into()),
            ("refill", self.refill),
            ("resolve", self.resolve),
        ] {
            let _ = writeln!(out, "{key} = {value}");
        }
        let bank = |out: &mut String, bank: &Bank| {
            let _ = writeln!(out, "bank = \"{}\"\nbase = {}\ndepth = {}", bank.name, bank.base, bank.depth);
        };
        let _ = writeln!(out, "\n[inputs]");
        bank(&mut out, &self.inputs);
        for slot in self.slots {
            let _ = writeln!(out, "\n[[slot]]\nname = \"{}\"", slot.name);
            bank(&mut out, &slot.bank);
            let _ = writeln!(out, "units = [");
            for unit in slot.units {
                let _ = writeln!(out, "    {},", entry(unit));
            }
            let _ = writeln!(out, "]");
        }
        out
    }
}

/// A unit as an entry of `units`: its name, perhaps with differences from its row.
fn entry(unit: &Unit) -> String {
    let Some(row) = UNITS.iter().find(|row| row.name == unit.name) else {
        return format!("\"{}\"", unit.name);
    };
    let mut more = String::new();
    if unit.functions != row.functions {
        let names: Vec<String> =
            unit.functions.iter().map(|function| format!("\"{}\"", function.name().to_lowercase())).collect();
        let _ = write!(more, ", functions = [{}]", names.join(", "));
    }
    for (key, value, usual) in
        [("latency", unit.latency, row.latency), ("interval", unit.interval, row.interval)]
    {
        if value != usual {
            let _ = write!(more, ", {key} = {value}");
        }
    }
    if more.is_empty() {
        format!("\"{}\"", unit.name)
    } else {
        format!("{{ unit = \"{}\"{more} }}", unit.name)
    }
}

/// A text as a basic string of TOML.
fn quoted(text: &str) -> String {
    let mut out = "\"".to_owned();
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
