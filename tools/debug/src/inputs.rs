// SPDX-License-Identifier: MIT OR Apache-2.0
//! Input ports from a CSV table: one named column per port, one row per period.

use std::io::{self, Read};
use takt_asm::nearest;
use takt_emu::{Row, Rows};
use takt_isa::Type;
use takt_isa::program::Port;

/// Parses the text of a table into rows, with a column for each of `ports`, and perhaps for some of `optional`; more than `most` rows are an
/// error.
///
/// # Errors
/// If the table is malformed; the message has the table's name, line and column.
pub fn rows(name: &str, text: &[u8], ports: &[Port], optional: &[Port], most: usize) -> Result<Rows, String> {
    let source = io::Cursor::new(text.to_vec());
    let mut table = Table::with_optional(name.to_owned(), Box::new(source), ports, optional)?;
    let mut rows = Rows::new();
    while let Some(row) = table.next()? {
        if rows.len() >= most {
            return Err(format!("{name} has more than {most} rows"));
        }
        rows.push(row.clone());
    }
    Ok(rows)
}

/// Parses a CSV field into bits.
///
/// # Errors
/// If the text is not a value of the type.
pub fn parse(ty: Type, text: &str) -> Result<u32, String> {
    match ty {
        Type::F => {
            let value: f32 = text.parse().map_err(|_| format!("`{}` is not a number", field_start(text)))?;
            if value.is_nan() {
                return Err("NaN is not an input for a controller".to_owned());
            }
            if value.is_infinite() {
                let largest = f32::MAX;
                return Err(format!(
                    "`{}` does not fit binary32, whose largest is {largest:e}",
                    field_start(text)
                ));
            }
            Ok(value.to_bits())
        }
        Type::I => text.parse().map(i32::cast_unsigned).map_err(|_| {
            format!("`{}` is not an integer between {} and {}", field_start(text), i32::MIN, i32::MAX)
        }),
        Type::B => text
            .strip_prefix("0x")
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .or_else(|| text.parse().ok())
            .ok_or_else(|| format!("`{}` is not a 32-bit number (0x… or decimal)", field_start(text))),
    }
}

/// Start of a possibly long field, for messages.
fn field_start(text: &str) -> String {
    let mut start: String = text.chars().take(40).collect();
    if start.len() < text.len() {
        start.push('…');
    }
    start
}

/// Rows of input values from a CSV file with a named column for each input port; other columns are ignored.
pub struct Table {
    name: String,
    reader: csv::Reader<BudgetReader>,
    record: csv::StringRecord,
    /// Number of columns in the header row.
    width: usize,
    /// Ports with the index of their column.
    ports: Vec<(Port, usize)>,
    row: Row,
    /// No row has been read yet.
    begins: bool,
    /// Columns that belong to no port, where a port that may have one has none.
    note: Option<String>,
}

/// Maximum size of a row in bytes: a file without line ends, or with an unclosed quote, must not fill the memory.
pub const ROW_LIMIT: usize = 1 << 20;

impl Table {
    /// Reads the header of a table. `name` identifies the table in messages.
    ///
    /// # Errors
    /// If the header does not have exactly one column for each port.
    pub fn new(name: String, source: Box<dyn Read>, ports: &[Port]) -> Result<Table, String> {
        Table::with_optional(name, source, ports, &[])
    }

    /// Reads the header of a table like [`Table::new`]; it may also have columns for other ports.
    ///
    /// # Errors
    /// If the header does not have exactly one column for each of `ports`, or more than one for one of `optional`.
    pub fn with_optional(
        name: String,
        source: Box<dyn Read>,
        ports: &[Port],
        optional: &[Port],
    ) -> Result<Table, String> {
        let all = [ports, optional].concat();
        let OpenTable { reader, header, found, mut missing } = OpenTable::of(&name, source, &all)?;
        missing.retain(|name| ports.iter().any(|port| port.name == *name));
        if let [first, ..] = missing[..] {
            // A title that is the name of a port is not a misspelling of another port.
            let near =
                suggest(first, header.iter().filter(|title| ports.iter().all(|port| port.name != **title)));
            let ports = if missing.len() == 1 { "input port" } else { "input ports" };
            let separator = separator(&header);
            let is_parted = first.contains(',') && header.iter().any(|title| title.contains('['));
            let quoted = if is_parted {
                format!("; a name with a comma is quoted: `\"{first}\"`")
            } else {
                String::new()
            };
            let missing = missing.join(", ");
            return Err(format!("{name}: no column for the {ports} {missing}{near}{separator}{quoted}"));
        }
        let note = passed_over(&name, &header, &all, &found);
        Ok(Table { note, ..Table::with(name, reader, &header, found) })
    }

    /// Note on columns that belong to no port, while a port that may have a column has none: one of them may be its misspelt name.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Reads the header of a table that may omit ports but has no other columns. `name` identifies the table in messages.
    ///
    /// # Errors
    /// If a column belongs to no port, or if the header is empty.
    pub fn of_some(name: String, source: Box<dyn Read>, ports: &[Port]) -> Result<Table, String> {
        let OpenTable { reader, header, found, .. } = OpenTable::of(&name, source, ports)?;
        if let Some(other) = header.iter().find(|title| ports.iter().all(|port| port.name != **title)) {
            let names = ports.iter().map(|port| port.name.as_str());
            let (near, separator) = (suggest(other, names.clone()), separator(&header));
            let names = names.collect::<Vec<_>>().join(", ");
            let other = field_start(other);
            return Err(format!("{name}: a column `{other}`{near}; there can be {names}{separator}"));
        }
        Ok(Table::with(name, reader, &header, found))
    }

    fn with(
        name: String,
        reader: csv::Reader<BudgetReader>,
        header: &csv::StringRecord,
        ports: Vec<(Port, usize)>,
    ) -> Table {
        let (record, row) = (csv::StringRecord::new(), Row::new());
        Table { name, reader, record, width: header.len(), ports, row, begins: true, note: None }
    }

    /// Name of the table in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Titles of the columns, from the header.
    pub fn titles(&mut self) -> Vec<String> {
        // Cannot fail: the constructor has read the header row.
        let titles = self.reader.headers().map(|header| header.iter().map(str::to_owned).collect());
        titles.unwrap_or_default()
    }

    /// Place of the last row in messages: `NAME:LINE`.
    pub fn place(&self) -> String {
        place(&self.name, &self.record)
    }

    /// Text of a field in the last row.
    pub fn field(&self, column: usize) -> &str {
        self.record.get(column).unwrap_or_default()
    }

    /// Inputs of the next period; `None` at the end of the table. A table must have at least one row.
    ///
    /// # Errors
    /// If the row's number of fields differs from the header's, or if a field is not a value of its port's type.
    #[allow(clippy::should_implement_trait, reason = "what it gives is borrowed")]
    pub fn next(&mut self) -> Result<Option<&Row>, String> {
        self.reader.get_mut().left = ROW_LIMIT;
        if !self.reader.read_record(&mut self.record).map_err(|error| explain(&self.name, error))? {
            if self.begins {
                return Err(format!("{} has a header and no row, so there is no period to run", self.name));
            }
            return Ok(None);
        }
        self.begins = false;
        let place = || place(&self.name, &self.record);
        if self.record.len() != self.width {
            let (width, separator) = (self.width, separator(&self.record));
            return Err(format!(
                "{}: the row has {}, the header {width}{separator}",
                place(),
                fields(self.record.len())
            ));
        }
        self.row.clear();
        for (port, column) in &self.ports {
            let field = self.record.get(*column).ok_or("a row without a field")?;
            let bits = parse(port.ty, field)
                .map_err(|reason| format!("{}: column {}: {reason}", place(), port.name))?;
            self.row.push((port.register, bits));
        }
        Ok(Some(&self.row))
    }
}

/// Place of a row in messages: `NAME:LINE`.
fn place(name: &str, record: &csv::StringRecord) -> String {
    format!("{name}:{}", record.position().map_or(0, csv::Position::line))
}

/// A table whose header has been read.
struct OpenTable<'a> {
    reader: csv::Reader<BudgetReader>,
    header: csv::StringRecord,
    /// Ports found in the header, with their columns.
    found: Vec<(Port, usize)>,
    /// Ports without a column.
    missing: Vec<&'a str>,
}

impl<'a> OpenTable<'a> {
    fn of(name: &str, source: Box<dyn Read>, ports: &'a [Port]) -> Result<OpenTable<'a>, String> {
        let source = BudgetReader { source, left: ROW_LIMIT };
        // Accept rows of any length here; `next` reports a wrong length with a more helpful message.
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(source);
        let header = reader.headers().map_err(|error| explain(name, error))?.clone();
        if header.is_empty() {
            return Err(format!("{name} is empty: it needs a header with a column for each input port"));
        }
        let (mut found, mut missing) = (Vec::new(), Vec::new());
        for port in ports {
            let titles = header.iter().enumerate();
            let columns: Vec<usize> =
                titles.filter(|(_, title)| *title == port.name).map(|(i, _)| i).collect();
            match columns[..] {
                [column] => found.push((port.clone(), column)),
                [] => missing.push(port.name.as_str()),
                _ => return Err(format!("{name}: two columns are named `{}`", port.name)),
            }
        }
        Ok(OpenTable { reader, header, found, missing })
    }
}

/// Note on the columns that belong to none of the ports; `None` if there are none, or if each port has a column.
fn passed_over(
    name: &str,
    header: &csv::StringRecord,
    ports: &[Port],
    found: &[(Port, usize)],
) -> Option<String> {
    let others: Vec<&str> =
        header.iter().filter(|title| ports.iter().all(|port| port.name != **title)).collect();
    let absent = || {
        let has = |port: &Port| found.iter().any(|(other, _)| other.name == port.name);
        ports.iter().filter(move |port| !has(port)).map(|port| port.name.as_str())
    };
    let (first, _) = (others.first()?, absent().next()?);
    let near = others.iter().find_map(|title| nearest(title, absent()).map(|near| (title, near)));
    let near = match near {
        Some((title, near)) if others.len() > 1 => {
            format!("; is `{}` meant to be `{near}`?", field_start(title))
        }
        Some((_, near)) => format!("; did you mean `{near}`?"),
        None => String::new(),
    };
    let columns = match others.len() {
        1 => format!("the column `{}` belongs to no input port and is", field_start(first)),
        count => format!("{count} columns belong to no input port (`{}`, …) and are", field_start(first)),
    };
    Some(format!("{name}: {columns} passed over{near}"))
}

/// Hint for a row that seems to use a separator other than the comma.
fn separator(record: &csv::StringRecord) -> String {
    let others = [(';', "`;`"), ('\t', "a tab"), ('|', "`|`")];
    let found = others.iter().find(|(other, _)| record.iter().any(|field| field.contains(*other)));
    found.map_or_else(String::new, |(_, name)| {
        format!("; columns are separated by `,`, here there is {name} (and numbers have a decimal point)")
    })
}

/// Suffix `; did you mean …?` if a similar name exists.
fn suggest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

fn fields(count: usize) -> String {
    format!("{count} field{}", if count == 1 { "" } else { "s" })
}

/// Converts an error of the CSV reader to a message with place and expectation.
fn explain(name: &str, error: csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Utf8 { pos, err } => {
            let line = pos.as_ref().map_or(0, csv::Position::line);
            format!("{name}:{line}: field {} is not UTF-8 text", err.field() + 1)
        }
        csv::ErrorKind::Io(error) => format!("cannot read {name}: {error}"),
        _ => format!("cannot read {name}: {error}"),
    }
}

/// Reader with a byte budget: returns an error once `left` bytes are read, unless the budget is raised.
struct BudgetReader {
    source: Box<dyn Read>,
    left: usize,
}

impl Read for BudgetReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(io::Error::other(format!("a row is longer than {} MiB", ROW_LIMIT >> 20)));
        }
        let allowed = buffer.len().min(self.left);
        let count = self.source.read(&mut buffer[..allowed])?;
        self.left -= count;
        Ok(count)
    }
}
