// SPDX-License-Identifier: MIT OR Apache-2.0
//! Input ports from a table (CSV): one named column for each port, one row for each period.

use std::io::{self, Read};
use takt_asm::nearest;
use takt_emu::{Row, Rows};
use takt_isa::Type;
use takt_isa::program::Port;

/// Every row of a table's text, at most `most`.
///
/// # Errors
/// If something is wrong with it; the message has the table's name, line and column.
pub fn rows(name: &str, text: &[u8], ports: &[Port], most: usize) -> Result<Rows, String> {
    let source = io::Cursor::new(text.to_vec());
    let mut table = Table::new(name.to_owned(), Box::new(source), ports)?;
    let mut rows = Rows::new();
    while let Some(row) = table.next()? {
        if rows.len() >= most {
            return Err(format!("{name} has more than {most} rows"));
        }
        rows.push(row.clone());
    }
    Ok(rows)
}

/// The bits of a CSV field.
///
/// # Errors
/// If it is no value of the type.
pub fn parse(ty: Type, text: &str) -> Result<u32, String> {
    match ty {
        Type::F => {
            let value: f32 = text.parse().map_err(|_| format!("`{}` is no number", shown(text)))?;
            if value.is_nan() {
                return Err("NaN is no input for a controller".to_owned());
            }
            if value.is_infinite() {
                let largest = f32::MAX;
                return Err(format!("`{}` does not fit binary32, whose largest is {largest:e}", shown(text)));
            }
            Ok(value.to_bits())
        }
        Type::I => text
            .parse()
            .map(i32::cast_unsigned)
            .map_err(|_| format!("`{}` is no integer between {} and {}", shown(text), i32::MIN, i32::MAX)),
        Type::B => text
            .strip_prefix("0x")
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .or_else(|| text.parse().ok())
            .ok_or_else(|| format!("`{}` is no 32-bit number (0x… or decimal)", shown(text))),
    }
}

/// The beginning of a field that may be long.
fn shown(text: &str) -> String {
    let mut start: String = text.chars().take(40).collect();
    if start.len() < text.len() {
        start.push('…');
    }
    start
}

/// Rows of input values from a CSV with one named column for each input port; further columns are left alone.
pub struct Table {
    name: String,
    reader: csv::Reader<Rationed>,
    record: csv::StringRecord,
    /// Number of columns.
    width: usize,
    /// The ports, each with its column.
    ports: Vec<(Port, usize)>,
    row: Row,
    /// True before the first row.
    begins: bool,
}

/// Bytes of one row; more is an error, so that a file without line ends, or with an open quote, cannot fill the memory.
pub const ROW_LIMIT: usize = 1 << 20;

impl Table {
    /// Reads the header of a table; errors call it `name`.
    ///
    /// # Errors
    /// If it has not one column for each port.
    pub fn new(name: String, source: Box<dyn Read>, ports: &[Port]) -> Result<Table, String> {
        let Begun { reader, header, found, missing } = Begun::of(&name, source, ports)?;
        if let [first, ..] = missing[..] {
            // A column that is a port's is not another's misspelt.
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
        Ok(Table::with(name, reader, &header, found))
    }

    /// Reads the header of a table that has columns for some of the ports, and no others; errors call it `name`.
    ///
    /// # Errors
    /// If a column is no port's, or there is none.
    pub fn of_some(name: String, source: Box<dyn Read>, ports: &[Port]) -> Result<Table, String> {
        let Begun { reader, header, found, .. } = Begun::of(&name, source, ports)?;
        if let Some(other) = header.iter().find(|title| ports.iter().all(|port| port.name != **title)) {
            let names = ports.iter().map(|port| port.name.as_str());
            let (near, separator) = (suggest(other, names.clone()), separator(&header));
            let names = names.collect::<Vec<_>>().join(", ");
            let other = shown(other);
            return Err(format!("{name}: a column `{other}`{near}; there can be {names}{separator}"));
        }
        Ok(Table::with(name, reader, &header, found))
    }

    fn with(
        name: String,
        reader: csv::Reader<Rationed>,
        header: &csv::StringRecord,
        ports: Vec<(Port, usize)>,
    ) -> Table {
        let (record, row) = (csv::StringRecord::new(), Row::new());
        Table { name, reader, record, width: header.len(), ports, row, begins: true }
    }

    /// The name that errors have for it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The titles of its columns.
    pub fn titles(&mut self) -> Vec<String> {
        // It was read before.
        let titles = self.reader.headers().map(|header| header.iter().map(str::to_owned).collect());
        titles.unwrap_or_default()
    }

    /// The place of the last row: the table's name and the line.
    pub fn place(&self) -> String {
        place(&self.name, &self.record)
    }

    /// A field of the last row.
    pub fn field(&self, column: usize) -> &str {
        self.record.get(column).unwrap_or_default()
    }

    /// The inputs of the next period; `None` at the end of the table, which has a row at least.
    ///
    /// # Errors
    /// If the row has another number of fields than the header, or one that is no value of its port.
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

/// The line of a row.
fn place(name: &str, record: &csv::StringRecord) -> String {
    format!("{name}:{}", record.position().map_or(0, csv::Position::line))
}

/// A table whose header was read.
struct Begun<'a> {
    reader: csv::Reader<Rationed>,
    header: csv::StringRecord,
    /// Ports with their columns.
    found: Vec<(Port, usize)>,
    /// Names of ports without one.
    missing: Vec<&'a str>,
}

impl<'a> Begun<'a> {
    fn of(name: &str, source: Box<dyn Read>, ports: &'a [Port]) -> Result<Begun<'a>, String> {
        let source = Rationed { source, left: ROW_LIMIT };
        // Rows of another length are found later, with a better message.
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
        Ok(Begun { reader, header, found, missing })
    }
}

/// A hint for a row that seems to be separated by something else than commas.
fn separator(record: &csv::StringRecord) -> String {
    let others = [(';', "`;`"), ('\t', "a tab"), ('|', "`|`")];
    let found = others.iter().find(|(other, _)| record.iter().any(|field| field.contains(*other)));
    found.map_or_else(String::new, |(_, name)| {
        format!("; columns are separated by `,`, here there is {name} (and numbers have a decimal point)")
    })
}

/// `; did you mean …?` if one of the names is near.
fn suggest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

fn fields(count: usize) -> String {
    format!("{count} field{}", if count == 1 { "" } else { "s" })
}

/// An error of the CSV reader in the form of ours.
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

/// A reader that gives so many bytes and then an error, unless it is granted more.
struct Rationed {
    source: Box<dyn Read>,
    left: usize,
}

impl Read for Rationed {
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
