//! Input ports from CSV, output ports to CSV and JSON.

use crate::files;
use crate::select::suggest;
use anyhow::{Context, Result, anyhow, bail};
use std::io::{self, Read, Write};
use std::path::Path;
use takt_emu::{Row, Rows};
use takt_isa::Type;
use takt_isa::program::Port;

/// A value as CSV and as JSON have it.
pub(crate) use takt_debug::value::{json, text as format};

/// Writes a row of CSV. No field has a comma or a quote: they are names of ports, and numbers.
pub(crate) fn write_row(out: &mut impl Write, fields: impl IntoIterator<Item = String>) -> io::Result<()> {
    let mut row = String::new();
    for (i, field) in fields.into_iter().enumerate() {
        if i > 0 {
            row.push(',');
        }
        row.push_str(&field);
    }
    row.push('\n');
    out.write_all(row.as_bytes())
}

/// The bits of a CSV field.
fn parse(ty: Type, text: &str) -> Result<u32, String> {
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

/// Inputs of one period after the other: the rows of a CSV, or zeros where there is none. Every command reads them here.
pub(crate) enum Inputs {
    /// All ports are 0, for as many periods as are asked for.
    Zero(Row),
    Table(Box<Table>),
}

impl Inputs {
    /// Opens a file, `-` being standard input, and reads its header.
    pub(crate) fn open(path: Option<&Path>, ports: &[Port]) -> Result<Inputs> {
        match path {
            Some(path) => Ok(Inputs::Table(Box::new(Table::open(path, ports)?))),
            None => Ok(Inputs::Zero(ports.iter().map(|port| (port.register, 0)).collect())),
        }
    }

    /// The inputs of the next period; `None` at the end of the file, which has a row at least.
    pub(crate) fn next(&mut self) -> Result<Option<&Row>> {
        match self {
            Inputs::Zero(row) => Ok(Some(row)),
            Inputs::Table(table) => table.next(),
        }
    }
}

/// Periods that [`rows`] makes up without a CSV.
const MOST_PERIODS: u64 = 10_000_000;

/// Inputs of each period, at most `periods`; without a CSV `otherwise` of them unless `periods` says how many.
pub(crate) fn rows(
    path: Option<&Path>,
    periods: Option<u64>,
    otherwise: u64,
    ports: &[Port],
) -> Result<Rows> {
    let most = if path.is_some() { periods.unwrap_or(u64::MAX) } else { periods.unwrap_or(otherwise) };
    if path.is_none() && most > MOST_PERIODS {
        bail!("{most} periods: without --inputs there are at most {MOST_PERIODS}");
    }
    let mut inputs = Inputs::open(path, ports)?;
    let mut rows = Rows::new();
    while (rows.len() as u64) < most
        && let Some(row) = inputs.next()?
    {
        rows.push(row.clone());
    }
    Ok(rows)
}

/// The column that says which run a row belongs to.
const RUN: &str = "run";

/// Inputs of many runs from one CSV with a column `run`, in the order in which the runs begin: their names, and their rows.
pub(crate) fn runs(
    path: &Path,
    ports: &[Port],
    most: usize,
    most_periods: usize,
) -> Result<Vec<(String, Rows)>> {
    let mut table = Table::open(path, ports)?;
    let name = table.name.clone();
    if ports.iter().any(|port| port.name == RUN) {
        bail!("{name}: column `{RUN}` would be an input port's; give a folder with a file for each run");
    }
    let header = table.reader.headers().map_err(|error| explain(&name, error))?;
    let Some(column) = header.iter().position(|title| title == RUN) else {
        let near = suggest(RUN, header.iter());
        bail!("{name}: no column `{RUN}`{near}; it says which run a row belongs to");
    };
    let mut runs: Vec<(String, Rows)> = Vec::new();
    let mut numbers = std::collections::HashMap::new();
    let mut periods = 0;
    while let Some(row) = table.next()?.cloned() {
        let label = table.record.get(column).unwrap_or_default().to_owned();
        let number = *numbers.entry(label.clone()).or_insert(runs.len());
        if number == runs.len() {
            runs.push((label, Rows::new()));
        }
        runs[number].1.push(row);
        periods += 1;
        if runs.len() > most {
            bail!("{name}: more than {most} runs");
        }
        if periods > most_periods {
            bail!("{name}: more than {most_periods} periods in all runs together");
        }
    }
    Ok(runs)
}

/// Rows of input values from a CSV with one named column for each input port; further columns are left alone.
pub(crate) struct Table {
    name: String,
    reader: csv::Reader<Rationed>,
    record: csv::StringRecord,
    /// Number of columns.
    width: usize,
    /// The ports, each with its column.
    ports: Vec<(Port, usize)>,
    row: Row,
    /// Whether there was no row yet.
    begins: bool,
}

/// Bytes of one row; more is an error, so that a file without line ends, or with an open quote, cannot fill the memory.
const ROW_LIMIT: usize = 1 << 20;

impl Table {
    fn open(path: &Path, ports: &[Port]) -> Result<Table> {
        let name = files::input_name(path);
        let source = Rationed { source: files::open(path)?, left: ROW_LIMIT };
        // Rows of another length are found here, with a better message.
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(source);
        let header = reader.headers().map_err(|error| explain(&name, error))?.clone();
        if header.is_empty() {
            bail!("{name} is empty: it needs a header with a column for each input port");
        }
        let columns = |port: &Port| -> Vec<usize> {
            header.iter().enumerate().filter(|(_, title)| *title == port.name).map(|(i, _)| i).collect()
        };
        let mut found = Vec::new();
        let mut missing = Vec::new();
        for port in ports {
            match columns(port)[..] {
                [column] => found.push((port.clone(), column)),
                [] => missing.push(port.name.as_str()),
                _ => bail!("{name}: two columns are named `{}`", port.name),
            }
        }
        if let [first, ..] = missing[..] {
            // A column that is a port's is not another's misspelt.
            let near =
                suggest(first, header.iter().filter(|title| ports.iter().all(|port| port.name != **title)));
            let ports = if missing.len() == 1 { "input port" } else { "input ports" };
            let separator = separator(&header);
            bail!("{name}: no column for the {ports} {}{near}{separator}", missing.join(", "));
        }
        let (record, row) = (csv::StringRecord::new(), Row::new());
        Ok(Table { name, reader, record, width: header.len(), ports: found, row, begins: true })
    }

    fn next(&mut self) -> Result<Option<&Row>> {
        self.reader.get_mut().left = ROW_LIMIT;
        if !self.reader.read_record(&mut self.record).map_err(|error| explain(&self.name, error))? {
            if self.begins {
                bail!("{} has a header and no row, so there is no period to run", self.name);
            }
            return Ok(None);
        }
        self.begins = false;
        let place = || format!("{}:{}", self.name, self.record.position().map_or(0, csv::Position::line));
        if self.record.len() != self.width {
            let (width, separator) = (self.width, separator(&self.record));
            bail!("{}: the row has {}, the header {width}{separator}", place(), fields(self.record.len()));
        }
        self.row.clear();
        for (port, column) in &self.ports {
            let field = self.record.get(*column).context("a row without a field")?;
            let bits = parse(port.ty, field)
                .map_err(|reason| anyhow!("{}: column {}: {reason}", place(), port.name))?;
            self.row.push((port.register, bits));
        }
        Ok(Some(&self.row))
    }
}

/// What to say of a row that seems to be separated by something else than commas.
fn separator(record: &csv::StringRecord) -> String {
    let others = [(';', "`;`"), ('\t', "a tab"), ('|', "`|`")];
    let found = others.iter().find(|(other, _)| record.iter().any(|field| field.contains(*other)));
    found.map_or_else(String::new, |(_, name)| {
        format!("; columns are separated by `,`, here there is {name} (and numbers have a decimal point)")
    })
}

fn fields(count: usize) -> String {
    format!("{count} field{}", if count == 1 { "" } else { "s" })
}

/// An error of the CSV reader in the form of ours.
fn explain(name: &str, error: csv::Error) -> anyhow::Error {
    match error.kind() {
        csv::ErrorKind::Utf8 { pos, err } => {
            let line = pos.as_ref().map_or(0, csv::Position::line);
            anyhow!("{name}:{line}: field {} is not UTF-8 text", err.field() + 1)
        }
        csv::ErrorKind::Io(error) => anyhow!("cannot read {name}: {error}"),
        _ => anyhow::Error::from(error).context(format!("cannot read {name}")),
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
