// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of unit headers: the facts that the generator and the tests need in order to instantiate `rtl/units/<unit>.v`.
//!
//! A unit selects among its operations by its own operation code, which is as short as possible. The header of its Verilog file is the
//! only place that states the code of each instruction:
//!
//! ```text
//! //@ op 1'b0 fadd
//! //@ op 1'b1 fsub
//! ```
//!
//! Several instructions may share a code. A unit with a single operation has no `op` port and writes `-` for the code. A wrapper around
//! another unit's module takes over that unit's codes: `//@ as alu`. The other ports follow from the unit's row in the table of units:
//! there are as many operands (`a`, `b`, `c`) as its instructions have sources. If a machine's row uses only a part of the unit's
//! functions, the ports are the same.
//!
//! `//@ clears` states that result and flags are 0 without out_valid: the slot's bus takes them without a gate.

use crate::{files, tables};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::{fs, io};
use takt_isa::{Effect, Op, ROWS, Row, UNITS, Unit};
use thiserror::Error;

/// An instruction that a circuit executes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operation {
    /// Row of the table of instructions.
    pub op: Op,
    /// Value of the circuit's `op` port.
    pub code: u32,
}

/// The circuit of a unit.
#[derive(Clone, Debug)]
pub struct Circuit {
    /// Row of the table of units.
    pub unit: Unit,
    /// Width of the `op` port; 0 without such a port.
    pub op_bits: u32,
    /// Number of operand ports.
    pub operands: usize,
    /// Operations for this machine, in the order of the table of instructions.
    pub operations: Vec<Operation>,
    /// The module has a parameter INTERVAL besides LATENCY.
    pub has_interval: bool,
    /// Result and flags are 0 without `out_valid`.
    pub clears: bool,
    /// Files of the library that the circuit needs, in dependency order, its own last.
    pub files: Vec<String>,
}

/// Verilog files by their names in `rtl/units/`: `add.v`, `common/takt_product.v`.
#[derive(Clone, Debug, Default)]
pub struct Library {
    files: BTreeMap<String, String>,
}

/// Reason why a header describes no circuit for its unit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CircuitError {
    /// File of a unit that is missing: unit, then file.
    #[error("unit `{0}`: there is no circuit rtl/units/{1}: write it and list it in rtl/src/files.rs")]
    NoFile(&'static str, String),
    /// A line with `//@` that cannot be parsed.
    #[error(
        "`{0}`: expected `//@ op <width>'b<bits> <mnemonic> …`, `//@ op - <mnemonic> …`, `//@ as <unit>` or `//@ clears`"
    )]
    Syntax(String),
    /// Operation codes of different widths.
    #[error("`{0}`: the code differs in width from the codes before it")]
    Width(String),
    /// A mnemonic that the unit does not execute.
    #[error("`{0}` is not an instruction that the unit `{1}` offers")]
    Foreign(String, &'static str),
    /// An instruction with two codes.
    #[error("`{0}` has two codes")]
    Twice(&'static str),
    /// Instructions that the unit's row offers, but its circuit lacks.
    #[error(
        "no circuit for {1}: unit `{0}` offers the function, but its Verilog file names no code: a line `//@ op <code> {1}` in the \
         header of rtl/units/{0}.v, and what it computes below"
    )]
    Missing(&'static str, String),
    /// A value of the row that the circuit does not support.
    #[error("unit `{unit}` has {} {value}; rtl/units/{unit}.v needs {limit}", limit.quantity)]
    Limit {
        /// Name of the unit.
        unit: &'static str,
        /// Latency or interval in the row.
        value: u32,
        /// Values that the circuit supports.
        limit: Limit,
    },
}

/// Limit of a parameter. A Verilog module rejects unsupported parameters by instantiating a missing module whose name gives the reason,
/// such as `takt_recurrence_has_latency_21_and_interval_15`. A limit is one part of such a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limit {
    /// Parameter in lower case: `latency`.
    pub quantity: String,
    /// Least value that the module supports.
    pub least: u32,
    /// Greatest value; `None` for an interval, which may be longer.
    pub most: Option<u32>,
}

impl Limit {
    /// The value is within the limit.
    pub fn holds(&self, value: u32) -> bool {
        self.least <= value && self.most.is_none_or(|most| value <= most)
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Limit { quantity, least, most } = self;
        match most {
            None => write!(f, "{quantity} {least} at least"),
            Some(most) if most == least => write!(f, "{quantity} {least}"),
            Some(most) if *most == least + 1 => write!(f, "{quantity} {least} or {most}"),
            Some(most) => write!(f, "{quantity} {least} to {most}"),
        }
    }
}

/// Limits in the text of a module, from the names of its instances called `unsupported`.
pub fn limits(text: &str) -> Vec<Limit> {
    let refusals = text.lines().filter_map(|line| line.trim().strip_suffix(" unsupported ();"));
    let stated =
        refusals.filter_map(|name| name.split_once("_has_")).flat_map(|(_, said)| said.split("_and_"));
    stated
        .filter_map(|said| {
            let (quantity, values) = said.split_once('_')?;
            let mut numbers = values.split(['_']).filter_map(|word| word.parse().ok());
            let least = numbers.next()?;
            let most = (quantity != "interval").then(|| numbers.next().unwrap_or(least));
            Some(Limit { quantity: quantity.to_owned(), least, most })
        })
        .collect()
}

/// The unit's module executes the instruction: it writes a register and is not a load.
fn computes(unit: &Unit, row: &Row) -> bool {
    unit.functions.contains(&row.function) && row.shape.has_dest() && row.effect != Effect::Load
}

impl Library {
    /// Files embedded in this crate, and the tables.
    pub fn builtin() -> Library {
        let files = files::UNITS.iter().map(|&(name, text)| (name.to_owned(), text.to_owned()));
        Library { files: files.chain(tables::texts().iter().cloned()).collect() }
    }

    /// Reads the files of a folder and of its subfolder `common`.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn load(folder: &Path) -> io::Result<Library> {
        let mut library = Library::default();
        for part in ["", "common/"] {
            for entry in fs::read_dir(folder.join(part))? {
                let path = entry?.path();
                if let Some(name) =
                    path.file_name().and_then(|name| name.to_str()).filter(|name| name.ends_with(".v"))
                {
                    library.put(&format!("{part}{name}"), fs::read_to_string(&path)?);
                }
            }
        }
        Ok(library)
    }

    /// Adds or replaces a file.
    pub fn put(&mut self, name: &str, text: String) {
        self.files.insert(name.to_owned(), text);
    }

    /// Text of a file.
    pub fn text(&self, name: &str) -> Option<&str> {
        self.files.get(name).map(String::as_str)
    }

    /// Circuit of a unit.
    ///
    /// # Errors
    /// If a file is missing, a header cannot be parsed, or does not list exactly the unit's instructions.
    pub fn circuit(&self, unit: &Unit) -> Result<Circuit, CircuitError> {
        let own = unit.name;
        let file = |unit: &str| {
            let name = format!("{unit}.v");
            let text = self.text(&name).ok_or_else(|| CircuitError::NoFile(own, name.clone()))?;
            Ok::<_, CircuitError>((name, text))
        };
        let (own_file, text) = file(own)?;
        let mut files = Vec::new();
        let inner = text.lines().find_map(|line| line.strip_prefix("//@ as "));
        let Codes { op_bits, operands, operations } = match inner {
            None => codes(unit, text)?,
            Some(inner) => {
                let (name, text) = file(inner.trim())?;
                files.push(name);
                codes(unit, text)?
            }
        };
        for (quantity, value) in [("latency", unit.latency), ("interval", unit.interval)] {
            let broken = limits(text).into_iter().find(|l| l.quantity == quantity && !l.holds(value));
            if let Some(limit) = broken {
                return Err(CircuitError::Limit { unit: unit.name, value, limit });
            }
        }
        files.push(own_file);
        let files = self.with_common(files);
        let has_interval = text.contains("parameter INTERVAL");
        let clears = text.lines().any(|line| line == CLEARS);
        Ok(Circuit { unit: *unit, op_bits, operands, operations, has_interval, clears, files })
    }

    /// Adds the files of `common/` whose modules are instantiated, transitively, in dependency order.
    fn with_common(&self, mut files: Vec<String>) -> Vec<String> {
        let mut seen = 0;
        while seen < files.len() {
            let text = self.text(&files[seen]).unwrap_or_default();
            let words = |text: &str, word: &str| {
                text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|other| other == word)
            };
            for name in self.files.keys().filter(|name| !files.contains(name)).cloned().collect::<Vec<_>>() {
                let module = name.strip_prefix("common/").and_then(|name| name.strip_suffix(".v"));
                if module.is_some_and(|module| words(text, module)) {
                    files.push(name);
                }
            }
            seen += 1;
        }
        files.reverse();
        files
    }
}

impl Circuit {
    /// Instructions that a unit's module must execute.
    pub fn rows(unit: &Unit) -> impl Iterator<Item = &'static Row> {
        ROWS.iter().filter(move |row| computes(unit, row))
    }

    /// Parameters of the module's instance, with the row's values.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static str, u32)> {
        let interval = self.has_interval.then_some(("INTERVAL", self.unit.interval));
        [("LATENCY", self.unit.latency)].into_iter().chain(interval)
    }
}

/// Line of a header: result and flags are 0 without `out_valid`.
const CLEARS: &str = "//@ clears";

/// Statements of a header.
struct Codes {
    /// Width of the `op` port; 0 without such a port.
    op_bits: u32,
    /// Number of operand ports.
    operands: usize,
    /// Operations that belong to the unit's functions.
    operations: Vec<Operation>,
}

/// Parses the `//@` lines of a unit's file.
fn codes(unit: &Unit, text: &str) -> Result<Codes, CircuitError> {
    let mut operations: Vec<Operation> = Vec::new();
    let (mut width, mut operands) = (None, 0);
    // The table's row has all functions of the unit; a machine's row may have fewer.
    let whole = UNITS.iter().find(|row| row.name == unit.name).unwrap_or(unit);
    for line in text.lines().filter(|line| line.starts_with("//@") && *line != CLEARS) {
        let syntax = || CircuitError::Syntax(line.to_owned());
        let mut words = line.strip_prefix("//@ op ").ok_or_else(syntax)?.split_whitespace();
        let (bits, code) = words.next().and_then(code).ok_or_else(syntax)?;
        if *width.get_or_insert(bits) != bits {
            return Err(CircuitError::Width(line.to_owned()));
        }
        for name in words {
            let op = Op::from_mnemonic(name)
                .filter(|op| computes(whole, op.row()) || computes(unit, op.row()))
                .ok_or_else(|| CircuitError::Foreign(name.to_owned(), unit.name))?;
            operands = operands.max(operand_ports(op.row()));
            if !computes(unit, op.row()) {
                continue;
            }
            if operations.iter().any(|operation| operation.op == op) {
                return Err(CircuitError::Twice(op.row().mnemonic));
            }
            operations.push(Operation { op, code });
        }
    }
    let missing: Vec<_> = Circuit::rows(unit)
        .filter(|row| operations.iter().all(|operation| operation.op != row.op))
        .map(|row| row.mnemonic)
        .collect();
    if !missing.is_empty() {
        return Err(CircuitError::Missing(unit.name, missing.join(" ")));
    }
    operations.sort_by_key(|operation| operation.op);
    Ok(Codes { op_bits: width.unwrap_or(0), operands, operations })
}

/// Number of operand ports that an instruction uses: its sources, but at least `a`, on which the core puts an immediate or the status
/// register.
fn operand_ports(row: &Row) -> usize {
    row.shape.sources().max(1)
}

/// Parses an operation code: `3'b010` → (3, 2); `-` → (0, 0).
fn code(word: &str) -> Option<(u32, u32)> {
    if word == "-" {
        return Some((0, 0));
    }
    let (width, digits) = word.split_once("'b")?;
    let width = width.parse().ok().filter(|&width| width as usize == digits.len() && width <= 16)?;
    Some((width, u32::from_str_radix(digits, 2).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_isa::Function;
    use takt_isa::spec::units::{ADD, ARCTANGENT, FUSED, MULTIPLY};

    fn parse(unit: &Unit, source: &str) -> Result<Vec<(&'static str, u32)>, String> {
        let mut library = Library::default();
        library.put(&format!("{}.v", unit.name), source.to_owned());
        library
            .circuit(unit)
            .map(|circuit| circuit.operations.iter().map(|o| (o.op.row().mnemonic, o.code)).collect())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn header() {
        assert_eq!(parse(&ADD, "//@ op 1'b1 fsub\n//@ op 1'b0 fadd"), Ok(vec![("fadd", 0), ("fsub", 1)]));
        assert_eq!(parse(&ARCTANGENT, "//@ op - fatan2"), Ok(vec![("fatan2", 0)]));
    }

    /// If a machine uses only some functions of a unit, the codes are limited to these, but the ports stay the unit's.
    #[test]
    fn a_part_of_a_unit() {
        let library = Library::builtin();
        let products = Unit { functions: &[Function::Multiply], ..FUSED };
        let circuit = library.circuit(&products).expect("it has a circuit");
        assert_eq!((circuit.operations.len(), circuit.operands), (2, 3));
        let whole = library.circuit(&FUSED).expect("it has a circuit");
        assert!(whole.operations.contains(&circuit.operations[0]));
        assert_eq!((circuit.op_bits, circuit.operands), (whole.op_bits, whole.operands));
        let more = Unit { functions: &[Function::Multiply, Function::Divide], ..FUSED };
        let error = library.circuit(&more).expect_err("it does not divide").to_string();
        assert!(error.contains("no circuit for fdiv: unit `fused`"), "{error}");
    }

    #[test]
    fn every_unit_states_its_limits() {
        let library = Library::builtin();
        for unit in UNITS.iter().filter(|unit| Circuit::rows(unit).next().is_some() && unit.name != "memory")
        {
            library.circuit(unit).unwrap_or_else(|error| panic!("{error}"));
            for latency in [0, 1, 63] {
                let error = library.circuit(&Unit { latency, ..*unit }).expect_err("no such circuit");
                assert!(error.to_string().contains(&format!("has latency {latency}; rtl/units/")), "{error}");
            }
        }
        let message = |unit: Unit| library.circuit(&unit).expect_err("no such circuit").to_string();
        use takt_isa::spec::units::{ALU_LATE, CONVERT, RECURRENCE};
        assert_eq!(
            message(Unit { latency: 4, ..ADD }),
            "unit `add` has latency 4; rtl/units/add.v needs latency 5"
        );
        assert_eq!(
            message(Unit { interval: 14, ..RECURRENCE }),
            "unit `recurrence` has interval 14; rtl/units/recurrence.v needs interval 15 at least"
        );
        assert!(message(Unit { latency: 6, ..CONVERT }).ends_with("latency 4 or 5"));
        assert!(message(Unit { latency: 2, ..ALU_LATE }).ends_with("latency 3 to 16"));
    }

    #[test]
    fn refused() {
        let message = |unit, source| parse(unit, source).unwrap_err();
        assert!(message(&ADD, "//@ op 1'b0 fadd").contains("no circuit for fsub"));
        assert!(message(&ADD, "//@ op 1'b0 fadd\n//@ op 2'b01 fsub").contains("differs in width"));
        assert!(message(&ADD, "//@ op 1'b0 fadd fsub fadd").contains("two codes"));
        assert!(message(&ADD, "//@ op 1'b0 fmul").contains("not an instruction that the unit `add`"));
        assert!(message(&ADD, "//@ op 1'd0 fadd").contains("expected"));
        assert!(message(&MULTIPLY, "").contains("no circuit for fmul"));
        assert!(message(&MULTIPLY, "//@ as fused").contains("no circuit rtl/units/fused.v"));
    }
}
