// SPDX-License-Identifier: MIT OR Apache-2.0
//! Waveforms in VCD and FST, from the same samples. One time unit is one cycle.

use super::signal::{Signal, SignalType};
use super::{CompletedCycle, Writer};
use fst_writer::{
    FstBodyWriter, FstFileType, FstHeaderWriter, FstInfo, FstScopeType, FstSignalId, FstSignalType,
    FstVarDirection, FstVarType, FstWriteError,
};
use std::fmt::Write as _;
use std::io::{self, Cursor, Write};
use takt_isa::timing::Cycle;

/// A waveform file; accepts value changes in chronological order.
trait File {
    fn time(&mut self, cycle: Cycle) -> io::Result<()>;
    fn real(&mut self, signal: usize, value: f64) -> io::Result<()>;
    /// `digits` are 0, 1 or x, one for each bit of the signal.
    fn bits(&mut self, signal: usize, digits: &str) -> io::Result<()>;
    fn finish(self: Box<Self>) -> io::Result<()>;
    fn buffered_bytes(&self) -> u64;
}

/// Waveform writer: samples the signals in each cycle and writes the changes.
pub(super) struct Wave<'w> {
    file: Box<dyn File + 'w>,
    signals: Vec<Signal>,
    /// Last written value of each signal.
    last: Vec<Option<Option<u32>>>,
    digits: String,
}

impl Writer for Wave<'_> {
    /// Writes the changes of a cycle.
    fn cycle(&mut self, cycle: Cycle, passed: CompletedCycle<'_>) -> io::Result<()> {
        let mut timed = false;
        for (i, signal) in self.signals.iter().enumerate() {
            let value = signal.value(passed);
            if self.last[i].replace(value) == Some(value) {
                continue;
            }
            if !timed {
                self.file.time(cycle)?;
                timed = true;
            }
            match signal.ty {
                SignalType::Real => {
                    // Reals have no unknown value; NaN stands for it.
                    self.file.real(i, value.map_or(f64::NAN, |bits| f32::from_bits(bits).into()))?;
                }
                SignalType::Bits(width) => {
                    self.digits.clear();
                    match value {
                        Some(value) => write!(self.digits, "{value:0width$b}", width = width as usize),
                        None => write!(self.digits, "{:x>width$}", "", width = width as usize),
                    }
                    .map_err(io::Error::other)?;
                    self.file.bits(i, &self.digits)?;
                }
            }
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>, cycle: Cycle) -> io::Result<()> {
        self.file.time(cycle)?;
        self.file.finish()
    }

    fn buffered_bytes(&self) -> u64 {
        self.file.buffered_bytes()
    }
}

fn wave<'w>(file: Box<dyn File + 'w>, signals: Vec<Signal>) -> Box<Wave<'w>> {
    Box::new(Wave { file, last: vec![None; signals.len()], signals, digits: String::new() })
}

/// Visits each signal, and the beginning and end of each group.
fn hierarchy<E>(signals: &[Signal], mut visit: impl FnMut(ScopeItem<'_>) -> Result<(), E>) -> Result<(), E> {
    // Open groups: core of the system, and group within it.
    let mut inside: (Option<&str>, Option<&str>) = (None, None);
    visit(ScopeItem::Begin(super::signal::TOP))?;
    for (i, signal) in signals.iter().enumerate() {
        let own = (signal.part.as_deref(), signal.scope);
        if own != inside {
            if inside.1.is_some() {
                visit(ScopeItem::End)?;
            }
            if own.0 != inside.0 {
                if inside.0.is_some() {
                    visit(ScopeItem::End)?;
                }
                own.0.map_or(Ok(()), |name| visit(ScopeItem::Begin(name)))?;
            }
            own.1.map_or(Ok(()), |name| visit(ScopeItem::Begin(name)))?;
            inside = own;
        }
        visit(ScopeItem::Signal(i, signal))?;
    }
    for _ in [inside.0, inside.1].into_iter().flatten() {
        visit(ScopeItem::End)?;
    }
    visit(ScopeItem::End)
}

enum ScopeItem<'s> {
    Begin(&'s str),
    End,
    Signal(usize, &'s Signal),
}

/// Identifier code of a signal in VCD: its number in base 94, in printable characters.
fn identifier(mut signal: usize) -> String {
    let mut text = String::new();
    loop {
        text.push(char::from(b'!' + (signal % 94) as u8));
        signal /= 94;
        if signal == 0 {
            return text;
        }
        signal -= 1;
    }
}

struct Vcd<'w> {
    target: Box<dyn Write + 'w>,
    identifiers: Vec<String>,
}

/// A VCD writer for these signals.
pub(super) fn vcd<'w>(
    of: &str,
    signals: Vec<Signal>,
    mut target: Box<dyn Write + 'w>,
) -> io::Result<Box<Wave<'w>>> {
    writeln!(target, "$comment {of}; one time unit is one cycle $end")?;
    writeln!(target, "$version takt {} $end\n$timescale 1 ns $end", env!("CARGO_PKG_VERSION"))?;
    let identifiers: Vec<String> = (0..signals.len()).map(identifier).collect();
    hierarchy(&signals, |part| match part {
        ScopeItem::Begin(name) => writeln!(target, "$scope module {name} $end"),
        ScopeItem::End => writeln!(target, "$upscope $end"),
        ScopeItem::Signal(i, Signal { name, ty, .. }) => match ty {
            SignalType::Real => writeln!(target, "$var real 64 {} {name} $end", identifiers[i]),
            SignalType::Bits(width) => writeln!(target, "$var wire {width} {} {name} $end", identifiers[i]),
        },
    })?;
    writeln!(target, "$enddefinitions $end")?;
    Ok(wave(Box::new(Vcd { target, identifiers }), signals))
}

impl File for Vcd<'_> {
    fn time(&mut self, cycle: Cycle) -> io::Result<()> {
        writeln!(self.target, "#{cycle}")
    }

    fn real(&mut self, signal: usize, value: f64) -> io::Result<()> {
        // The standard specifies the notation of C's printf.
        let text = if value.is_nan() { "nan".to_owned() } else { format!("{value:e}") };
        writeln!(self.target, "r{text} {}", self.identifiers[signal])
    }

    fn bits(&mut self, signal: usize, digits: &str) -> io::Result<()> {
        let (mark, gap) = if digits.len() == 1 { ("", "") } else { ("b", " ") };
        writeln!(self.target, "{mark}{digits}{gap}{}", self.identifiers[signal])
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.target.flush()
    }

    fn buffered_bytes(&self) -> u64 {
        0
    }
}

struct Fst<'w> {
    body: FstBodyWriter<Cursor<Vec<u8>>>,
    ids: Vec<FstSignalId>,
    target: Box<dyn Write + 'w>,
}

/// An FST writer for these signals. The file is built in memory, because the format needs seeks and the target may be a pipe.
pub(super) fn fst<'w>(
    start: Cycle,
    signals: Vec<Signal>,
    target: Box<dyn Write + 'w>,
) -> io::Result<Box<Wave<'w>>> {
    let info = FstInfo {
        // Time 0, with unknown values before the window.
        start_time: 0,
        timescale_exponent: -9,
        version: format!("takt {}", env!("CARGO_PKG_VERSION")),
        // Equal runs yield equal files.
        date: String::new(),
        file_type: FstFileType::Verilog,
    };
    let mut header = FstHeaderWriter::write_to_mem(&info).map_err(failed)?;
    let mut ids = Vec::new();
    hierarchy(&signals, |part| match part {
        ScopeItem::Begin(name) => header.scope(name, "", FstScopeType::Module),
        ScopeItem::End => header.up_scope(),
        ScopeItem::Signal(_, Signal { name, ty, .. }) => {
            let (ty, kind) = match *ty {
                SignalType::Real => (FstSignalType::real(), FstVarType::Real),
                SignalType::Bits(width) => (FstSignalType::bit_vec(width), FstVarType::Wire),
            };
            header.var(name, ty, kind, FstVarDirection::Implicit, None).map(|id| ids.push(id))
        }
    })
    .map_err(failed)?;
    let body = header.finish().map_err(failed)?;
    let mut file = Fst { body, ids, target };
    if start > 0 {
        for (i, signal) in signals.iter().enumerate() {
            match signal.ty {
                SignalType::Real => file.real(i, f64::NAN)?,
                SignalType::Bits(width) => file.bits(i, &"x".repeat(width as usize))?,
            }
        }
    }
    Ok(wave(Box::new(file), signals))
}

fn failed(error: FstWriteError) -> io::Error {
    match error {
        FstWriteError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

impl File for Fst<'_> {
    fn time(&mut self, cycle: Cycle) -> io::Result<()> {
        self.body.time_change(cycle).map_err(failed)
    }

    fn real(&mut self, signal: usize, value: f64) -> io::Result<()> {
        self.body.signal_change(self.ids[signal], &value.to_le_bytes()).map_err(failed)
    }

    fn bits(&mut self, signal: usize, digits: &str) -> io::Result<()> {
        self.body.signal_change(self.ids[signal], digits.as_bytes()).map_err(failed)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        let Fst { body, mut target, .. } = *self;
        let bytes = body.finish().map_err(failed)?.into_inner();
        target.write_all(&bytes)?;
        target.flush()
    }

    fn buffered_bytes(&self) -> u64 {
        self.body.size() as u64
    }
}
