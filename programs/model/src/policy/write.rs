// SPDX-License-Identifier: MIT OR Apache-2.0
//! A policy as source: a counted loop over the rows of each layer, the vector that they share in registers.

use super::{Activation, Network, Step};
use crate::Error;
use crate::arrays::{Arrays, Names, machine_for, number};
use std::fmt::Write;
use takt_isa::Machine;

/// The most weights of a layer that is written out, where a loop would take many cycles before and after its rows; the most results
/// of such a layer, which stay in registers; and the most weights of all such layers, which take a bundle each.
const WRITTEN_OUT: usize = 300;
const WRITTEN_ROWS: usize = 32;
const ALL_WRITTEN_OUT: usize = 600;

/// The elements of a vector that are in registers at a time, at most: half of a bank, and what remains holds the products.
const COLUMNS: usize = 128;

/// Elements of a vector whose activation functions of the library are computed side by side: one waits for itself most of the time.
const UNROLL: usize = 4;

/// Sums of a row, which are added at its end: an adder's result takes several cycles.
const SUMS: usize = 4;

/// A policy's source.
pub struct Source {
    /// Its text.
    pub text: String,
    /// The machine that it is for, with the memories that it takes.
    pub machine: &'static Machine,
    /// Words of its arrays.
    pub words: usize,
    /// Names of the arrays of ports.
    pub input: String,
    /// The same for the output.
    pub output: String,
}

/// Where the elements of a vector are.
#[derive(Clone)]
enum Place {
    /// In an array of ports or registers: its name.
    Registers(String),
    /// In data memory.
    Memory(String),
}

struct Writer<'a> {
    network: &'a Network,
    names: Names,
    /// The name of the output's ports.
    output: String,
    arrays: Arrays,
    /// Arrays between layers.
    vectors: Arrays,
    code: String,
    layers: usize,
    /// The registers of the vector that a loop reads: their name, which all loops share, and their number.
    shared: (String, usize),
    /// Registers of single numbers.
    scalars: Vec<String>,
    /// Weights of layers that were written out.
    written_out: usize,
}

/// A part of the chain: a layer and what is done with its results, or what is done with the input.
struct Stage<'a> {
    dense: Option<(&'a [f64], &'a [f64])>,
    behind: Vec<&'a Step>,
}

/// The source of a policy for a machine, with the memories that its weights and so many bundles of code take. With a range, the source
/// states that every number of the input lies between these.
///
/// # Errors
/// If the machine has too few ports or its memories cannot be so deep, with the numbers.
pub fn source(
    network: &Network,
    machine: &'static Machine,
    range: Option<(f64, f64)>,
    bundles: usize,
) -> Result<Source, Error> {
    for (vector, kind, most) in [
        (&network.input, "input", usize::from(machine.input_count())),
        (&network.output, "output", usize::from(machine.outputs_per_bank)),
    ] {
        if vector.length > most {
            return Err(Error::plain(format!(
                "it does not fit: `{}` has {} numbers, {} has {most} {kind} ports",
                vector.name, vector.length, machine.name
            )));
        }
    }
    let mut names = Names::new();
    let (input, output) = (names.unique(&network.input.name), names.unique(&network.output.name));
    let shared = (names.unique("v"), 0);
    let mut writer = Writer {
        network,
        names,
        shared,
        scalars: Vec::new(),
        written_out: 0,
        output: output.clone(),
        arrays: Arrays::default(),
        vectors: Arrays::default(),
        code: String::new(),
        layers: 0,
    };
    writer.stages(&input)?;
    let words = writer.arrays.words() + writer.vectors.words();
    let machine = machine_for(machine, bundles, words)?;
    Ok(Source { text: writer.text(&input, machine, range)?, machine, words, input, output })
}

impl Writer<'_> {
    fn text(&self, input: &str, machine: &Machine, range: Option<(f64, f64)>) -> Result<String, Error> {
        let Network { name, input: from, output: to, notes, .. } = self.network;
        let mut text = String::new();
        let _ =
            writeln!(text, "; {name}: a policy {}, {} weights", self.network.shape(), self.network.weights());
        for note in notes {
            let _ = writeln!(text, "; {note}");
        }
        // A file's machine is named to the assembler (`-m`), not by the source.
        let comment = if machine.is_builtin() { "" } else { "; " };
        let _ = writeln!(text, "\n{comment}{}", machine.directive());
        if self.network.steps.iter().any(of_library) {
            text += ".include <math.s>\n";
        }
        let _ = writeln!(text, ".input  {input}[{}] ; {}", from.length, from.name);
        let _ = writeln!(text, ".output {}[{}] ; {}", self.output, to.length, to.name);
        let _ = writeln!(text, ".ports  latched\n{}", self.vectors.text());
        if self.shared.1 > 0 {
            let _ = writeln!(text, ".reg    {}[{}]", self.shared.0, self.shared.1);
        }
        if !self.scalars.is_empty() {
            let _ = writeln!(text, ".reg    {}", self.scalars.join(" "));
        }
        if let Some((low, high)) = range {
            let _ = writeln!(text, ".range  {input} = {}, {}", number(low)?, number(high)?);
        }
        text += ".schedule on\n.contract on\n.once\n        wait    period\n.period\nperiod:\n";
        let _ = writeln!(
            text,
            "{}        wait    period\n\n; Weights, by rows.\n{}",
            self.code,
            self.arrays.text()
        );
        Ok(text)
    }

    fn stages(&mut self, input: &str) -> Result<(), Error> {
        let mut stages = vec![Stage { dense: None, behind: Vec::new() }];
        for step in &self.network.steps {
            match step {
                Step::Dense { weights, bias } => {
                    stages.push(Stage { dense: Some((weights, bias)), behind: Vec::new() });
                }
                _ => stages.last_mut().into_iter().for_each(|stage| stage.behind.push(step)),
            }
        }
        let mut place = Place::Registers(input.to_owned());
        let (mut length, count) = (self.network.input.length, stages.len());
        for (index, stage) in stages.iter().enumerate() {
            let is_last = index + 1 == count;
            place = match stage.dense {
                None if stage.behind.is_empty() => place,
                None => self.normalised(&place, length, &stage.behind)?,
                Some((weights, bias)) => self.layer(&place, length, weights, bias, &stage.behind, is_last)?,
            };
            length = stage.dense.map_or(length, |(_, bias)| bias.len());
        }
        Ok(())
    }

    /// The input with what is done to it before the first layer: in registers, if they are not too many.
    fn normalised(&mut self, from: &Place, length: usize, steps: &[&Step]) -> Result<Place, Error> {
        // Those that loops load are written by another slot.
        let place = if length <= COLUMNS {
            let name = self.names.unique("v0");
            let _ = writeln!(self.code, ".reg    {name}[{length}]");
            Place::Registers(name)
        } else {
            let name = self.names.unique("h0");
            self.vectors.zeros(&name, &[length]);
            Place::Memory(name)
        };
        let (Place::Registers(from) | Place::Memory(from)) = from;
        let (Place::Registers(to) | Place::Memory(to)) = &place;
        let _ = writeln!(self.code, "; The input.\n.rep j, 1, {length}");
        self.behind(&format!("{from}[j]"), &format!("{to}[j]"), "j", length, steps)?;
        self.code += ".endr\n";
        Ok(place)
    }

    /// The registers that all loops use in turn, at least so many.
    fn shared(&mut self, length: usize) -> String {
        self.shared.1 = self.shared.1.max(length);
        self.shared.0.clone()
    }

    /// A layer; the last one's results are the output ports.
    fn layer(
        &mut self,
        from: &Place,
        columns: usize,
        weights: &[f64],
        bias: &[f64],
        behind: &[&Step],
        is_last: bool,
    ) -> Result<Place, Error> {
        let rows = bias.len();
        self.layers += 1;
        let number = self.layers;
        let w = self.names.unique(&format!("W{number}"));
        let b = self.names.unique(&format!("b{number}"));
        self.arrays.values(&b, &[rows], bias)?;
        self.arrays.values(&w, &[rows, columns], weights)?;
        let names: String = behind
            .iter()
            .filter_map(
                |step| if let Step::Activation(f) = step { Some(format!(", {}", f.name())) } else { None },
            )
            .collect();
        let _ = writeln!(self.code, "; Layer {number}: {rows} from {columns}{names}.");
        let is_written_out = weights.len() <= WRITTEN_OUT
            && rows <= WRITTEN_ROWS
            && columns <= COLUMNS
            && self.written_out + weights.len() <= ALL_WRITTEN_OUT;
        if is_written_out {
            self.written_out += weights.len();
        }
        // As few parts as possible, of the same length or one less.
        let parts = if is_written_out { 1 } else { columns.div_ceil(COLUMNS) };
        let to = match (is_last, is_written_out) {
            (true, true) => Place::Registers(self.output.clone()),
            (false, true) => Place::Registers(self.names.unique(&format!("h{number}"))),
            (_, false) => Place::Memory(self.names.unique(&format!("h{number}"))),
        };
        match &to {
            Place::Registers(name) if !is_last => {
                let _ = writeln!(self.code, ".reg    {name}[{rows}]");
            }
            Place::Registers(_) => {}
            Place::Memory(name) => self.vectors.zeros(name, &[rows]),
        }
        let (Place::Registers(target) | Place::Memory(target)) = &to;
        // A function of the library is longer than a row, whose loop it would keep from being pipelined.
        let split = behind.iter().position(|step| of_library(step));
        let (behind, later) = behind.split_at(split.filter(|_| !is_written_out).unwrap_or(behind.len()));
        let mut first = 0;
        for part in 0..parts {
            let count = (columns - first).div_ceil(parts - part);
            let x = match from {
                Place::Registers(name) => name.clone(),
                Place::Memory(name) => self.loaded(name, first, count),
            };
            // A vector in registers is there as a whole; of one in memory, this part is.
            let offset = if matches!(from, Place::Registers(_)) { first } else { 0 };
            let (open, close) = if is_written_out { (".rep", ".endr") } else { (".for", ".endfor") };
            let _ = writeln!(self.code, "{open} i, 1, {rows}");
            let start = if part == 0 { format!("{b}[i]") } else { format!("{target}[i]") };
            let sum = row(&w, first, &x, offset, count);
            let value = format!("{start} + {sum}");
            let steps = if part + 1 == parts { behind } else { &[] };
            self.behind(&value, &format!("{target}[i]"), "i", rows, steps)?;
            let _ = writeln!(self.code, "{close}");
            first += count;
        }
        let Place::Memory(name) = &to else { return Ok(to) };
        let from = format!("{name}[i]");
        let (is_short, output) = (is_last && rows <= 2 * UNROLL, format!("{}[i]", self.output));
        if !later.is_empty() && !is_short {
            let _ = writeln!(self.code, ".for i, 1, {rows} unroll {UNROLL}");
            self.behind(&from, &from, "i", rows, later)?;
            self.code += ".endfor\n";
        }
        if is_last {
            let _ = writeln!(self.code, ".rep i, 1, {rows}");
            self.behind(&from, &output, "i", rows, if is_short { later } else { &[] })?;
            self.code += ".endr\n";
        }
        Ok(to)
    }

    /// A part of a vector in memory, loaded into registers, whose name is given back.
    fn loaded(&mut self, name: &str, first: usize, count: usize) -> String {
        let v = self.shared(count);
        let at = if first > 0 { format!("{first}+j") } else { "j".to_owned() };
        let _ = writeln!(self.code, ".rep j, 1, {count}\n        {v}[j] = {name}[{at}]\n.endr");
        v
    }

    /// Equations from a value to the element of an array, with steps on the way.
    fn behind(
        &mut self,
        value: &str,
        to: &str,
        index: &str,
        length: usize,
        steps: &[&Step],
    ) -> Result<(), Error> {
        let mut value = value.to_owned();
        for step in steps {
            let by = |writer: &mut Self, by: &[f64]| writer.parameter(by, index, length);
            value = match step {
                Step::Add(numbers) => format!("{value} + {}", by(self, numbers)?),
                Step::Multiply(numbers) => format!("({value})*{}", by(self, numbers)?),
                Step::Divide(numbers) => format!("({value})/{}", by(self, numbers)?),
                Step::Dense { .. } => return Err(Error::plain("a layer stands behind a layer")),
                Step::Activation(Activation::Relu) => format!("max({value}, 0)"),
                Step::Activation(Activation::Tanh) if self.network.exact => format!("tanh({value})"),
                // Beyond, it is ±1.
                Step::Activation(Activation::Tanh) => format!("1 - 2/(1 + exp(sat(2*({value}), 20.0)))"),
                // Beyond, it is 1, or 0 to within 10⁻³⁷.
                Step::Activation(Activation::Sigmoid) => format!("1/(1 + exp(-sat({value}, 85.0)))"),
                Step::Activation(Activation::Clip(low, high)) => {
                    let (low, high) = (number(*low)?, number(*high)?);
                    format!("min(max({value}, {low}), {high})")
                }
                Step::Activation(Activation::Elu(alpha)) => {
                    let t = self.names.unique("t");
                    let _ = writeln!(self.code, "        {t} = {value}");
                    let text = format!("max({t}, 0) + {}*(exp(min({t}, 0)) - 1)", number(*alpha)?);
                    self.scalars.push(t);
                    text
                }
            };
        }
        let _ = writeln!(self.code, "        {to} = {value}");
        Ok(())
    }

    /// A number for each element: the number itself, if they are all the same, or an array's element.
    fn parameter(&mut self, by: &[f64], index: &str, length: usize) -> Result<String, Error> {
        if by.iter().all(|value| *value == by[0]) {
            let text = number(by[0])?;
            return Ok(if by[0] < 0.0 { format!("({text})") } else { text });
        }
        let name = self.names.unique("c1");
        self.arrays.values(&name, &[length], by)?;
        Ok(format!("{name}[{index}]"))
    }
}

/// True of the functions that are macros of `<math.s>`, or use one.
fn of_library(step: &Step) -> bool {
    matches!(step, Step::Activation(Activation::Tanh | Activation::Sigmoid | Activation::Elu(_)))
}

/// The products of a row's weights from `first` on with `count` elements of the vector from `offset` on, as [`SUMS`] sums.
fn row(w: &str, first: usize, x: &str, offset: usize, count: usize) -> String {
    let plus = |offset: usize| if offset > 0 { format!("{offset}+") } else { String::new() };
    let (w_at, x_at) = (plus(first), plus(offset));
    if count < 2 * SUMS {
        return format!("sum(j, 1, {count}, {w}[i,{w_at}j]*{x}[{x_at}j])");
    }
    let last = match count % SUMS {
        0 => (count / SUMS - 1).to_string(),
        _ => format!("int(({count} - g)/{SUMS})"),
    };
    format!("sum(g, 1, {SUMS}, sum(j, 0, {last}, {w}[i,{w_at}{SUMS}*j+g]*{x}[{x_at}{SUMS}*j+g]))")
}
