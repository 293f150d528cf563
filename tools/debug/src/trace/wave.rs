// SPDX-License-Identifier: MIT OR Apache-2.0
//! Waveforms: VCD and FST, from the same samples. A time unit is a cycle.

use super::signal::{Signal, SignalType};
use super::{Passed, Writer};
use fst_writer::{
    FstBodyWriter, FstFileType, FstHeaderWriter, FstInfo, FstScopeType, FstSignalId, FstSignalType,
    FstVarDirection, FstVarType, FstWriteError,
};
use std::fmt::Write as _;
use std::io::{self, Cursor, Write};
use takt_isa::timing::Cycle;

/// A file that takes changes of values.
trait File {
    fn time(&mut self, cycle: Cycle) -> io::Result<()>;
    fn real(&mut self, signal: usize, value: f64) -> io::Result<()>;
    /// `digits` are 0, 1 and x, as many as the signal is wide.
    fn bits(&mut self, signal: usize, digits: &str) -> io::Result<()>;
    fn finish(self: Box<Self>) -> io::Result<()>;
    fn kept(&self) -> u64;
}

/// Samples signals and writes those that changed.
pub(super) struct Wave<'w> {
    file: Box<dyn File + 'w>,
    signals: Vec<Signal>,
    /// The value that was last written for each.
    last: Vec<Option<Option<u32>>>,
    digits: String,
}

impl Writer for Wave<'_> {
    /// Writes what has changed in a cycle.
    fn cycle(&mut self, cycle: Cycle, passed: Passed<'_>) -> io::Result<()> {
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
                    // A real has no unknown value; NaN is as near as it gets.
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

    fn kept(&self) -> u64 {
        self.file.kept()
    }
}

fn wave<'w>(file: Box<dyn File + 'w>, signals: Vec<Signal>) -> Box<Wave<'w>> {
    Box::new(Wave { file, last: vec![None; signals.len()], signals, digits: String::new() })
}

/// Calls `signal` for each signal and `scope` where a group begins (with its name) and ends.
fn hierarchy<E>(signals: &[Signal], mut visit: impl FnMut(ScopeItem<'_>) -> Result<(), E>) -> Result<(), E> {
    // The groups that are open: of a system's core, and in it.
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

/// A VCD's short name of a signal: its number in the printable characters.
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

/// A VCD of these signals.
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
        // As C's printf writes them, which is how the standard has them.
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

    fn kept(&self) -> u64 {
        0
    }
}

struct Fst<'w> {
    body: FstBodyWriter<Cursor<Vec<u8>>>,
    ids: Vec<FstSignalId>,
    target: Box<dyn Write + 'w>,
}

/// An FST of these signals. It is made in memory, since its format needs to go back in its file and targets may be pipes.
pub(super) fn fst<'w>(
    start: Cycle,
    signals: Vec<Signal>,
    target: Box<dyn Write + 'w>,
) -> io::Result<Box<Wave<'w>>> {
    let info = FstInfo {
        // The writer's own start; before the window, values are unknown.
        start_time: 0,
        timescale_exponent: -9,
        version: format!("takt {}", env!("CARGO_PKG_VERSION")),
        // Equal runs give equal files.
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

    fn kept(&self) -> u64 {
        self.body.size() as u64
    }
}
