// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dense layers, and the elementwise steps on their results.

use super::super::stages::Stage;
use super::super::{Operand, Step};
use super::SUMS;
use super::{COLUMNS, Place, UNROLL, Writer, plus, turns};
use crate::Error;
use std::collections::HashMap;
use std::fmt::Write;

/// Limits for unrolling a layer, which spares the loop's prologue and epilogue: most weights of the layer; most results, which stay in
/// registers; and most weights of all unrolled layers, which take a bundle each.
const WRITTEN_OUT: usize = 300;
const WRITTEN_ROWS: usize = 32;
const ALL_WRITTEN_OUT: usize = 600;

impl Writer<'_> {
    /// Writes a layer and the steps inside its stage; the last layer writes to the output ports.
    pub(super) fn layer(&mut self, stage: &Stage, layer: usize) -> Result<Place, Error> {
        let Step::Dense { vector, first: offset, weights, bias } = &self.network.steps[layer] else {
            return Err(Error::plain("a stage without a layer"));
        };
        let (rows, columns) = (bias.len(), weights.len() / bias.len());
        self.layers += 1;
        let number = self.layers;
        let w = self.names.unique(&format!("W{number}"));
        let b = self.names.unique(&format!("b{number}"));
        self.arrays.values(&b, &[rows], bias)?;
        self.arrays.values(&w, &[rows, columns], weights)?;
        let names: String = self.functions(stage).iter().map(|f| format!(", {}", f.name)).collect();
        let _ = writeln!(self.code, "; Layer {number}: {rows} from {columns}{names}.");
        let is_written_out = weights.len() <= WRITTEN_OUT
            && rows <= WRITTEN_ROWS
            && columns <= COLUMNS
            && self.written_out + weights.len() <= ALL_WRITTEN_OUT;
        if is_written_out {
            self.written_out += weights.len();
        }
        let is_last = self.is_output(stage.root);
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
        if !is_written_out {
            for step in self.read_by(stage) {
                let name = self.in_memory(step);
                self.copies.insert(step, name);
            }
        }
        let cut = if is_written_out { stage.root } else { self.cut(stage, layer) };
        let from = self.places.get(vector).cloned();
        self.rows(stage, layer, cut, (&w, &b), (from, *offset), to.name(), is_written_out)?;
        self.steps_after_rows(stage, cut, &to, is_last)?;
        if !is_last {
            self.put_out(stage.root, &to);
        }
        Ok(to)
    }

    /// Writes the rows of a layer, including the steps up to `cut`, into the elements of `target`.
    #[allow(clippy::too_many_arguments)]
    fn rows(
        &mut self,
        stage: &Stage,
        layer: usize,
        cut: usize,
        (w, b): (&str, &str),
        (from, offset): (Option<Place>, usize),
        target: &str,
        is_written_out: bool,
    ) -> Result<(), Error> {
        let Step::Dense { weights, bias, .. } = &self.network.steps[layer] else { return Ok(()) };
        let (rows, columns) = (bias.len(), weights.len() / bias.len());
        // The fewest parts, with lengths that differ by one at most.
        let parts = if is_written_out { 1 } else { columns.div_ceil(COLUMNS) };
        let mut first = 0;
        for part in 0..parts {
            let count = (columns - first).div_ceil(parts - part);
            let (x, at) = match &from {
                // Registers hold the whole vector; from memory, only this part is loaded.
                Some(Place::Registers(name)) => (name.clone(), offset + first),
                Some(Place::Memory(name)) => (self.loaded(name, offset + first, count), 0),
                None => return Err(Error::plain("a layer reads values that are not computed yet")),
            };
            let (open, close) = if is_written_out { (".rep", ".endr") } else { (".for", ".endfor") };
            let _ = writeln!(self.code, "{open} i, 1, {rows}");
            let start = if part == 0 { format!("{b}[i]") } else { format!("{target}[i]") };
            let sum = format!("{start} + {}", row(w, first, &x, at, count));
            let to = format!("{target}[i]");
            if part + 1 == parts && cut != layer {
                let known = HashMap::from([(layer, format!("({sum})"))]);
                self.element(stage, cut, &known, &to, "i", !is_written_out)?;
            } else {
                let _ = writeln!(self.code, "        {to} = {sum}");
            }
            let _ = writeln!(self.code, "{close}");
            first += count;
        }
        Ok(())
    }

    /// Writes the steps after `cut` of a layer in a loop, and the output if the layer is the last.
    fn steps_after_rows(
        &mut self,
        stage: &Stage,
        cut: usize,
        to: &Place,
        is_last: bool,
    ) -> Result<(), Error> {
        let Place::Memory(name) = to else { return Ok(()) };
        let rows = self.network.lengths[stage.root];
        let from = format!("{name}[i]");
        let known = HashMap::from([(cut, from.clone())]);
        let (is_short, output) = (is_last && rows <= 2 * UNROLL, format!("{}[i]", self.output));
        if cut != stage.root && !is_short {
            let _ = writeln!(self.code, ".for i, 1, {rows} unroll {UNROLL}");
            self.element(stage, stage.root, &known, &from, "i", true)?;
            self.code += ".endfor\n";
        }
        if is_last {
            let _ = writeln!(self.code, ".rep i, 1, {rows}");
            if is_short && cut != stage.root {
                self.element(stage, stage.root, &known, &output, "i", true)?;
            } else {
                let _ = writeln!(self.code, "        {output} = {from}");
            }
            self.code += ".endr\n";
        }
        Ok(())
    }

    /// Last step that the loop over rows computes. Macros come after the loop: they are longer than a row and would prevent its pipelining.
    fn cut(&self, stage: &Stage, layer: usize) -> usize {
        if !self.is_long(stage) {
            return stage.root;
        }
        let mut cut = layer;
        while cut != stage.root {
            let whole = Operand::Vector { vector: cut, first: 0 };
            let users = (cut + 1..self.network.steps.len()).filter(|step| stage.inside[*step]);
            let mut users = users.filter(|step| self.network.steps[*step].reads().contains(&cut));
            let (Some(user), None) = (users.next(), users.next()) else { return cut };
            let Step::Each { function, parameters, operands } = &self.network.steps[user] else { return cut };
            let others = operands.iter().filter(|operand| **operand != whole);
            let alone = others.clone().count() + 1 == operands.len()
                && others.into_iter().all(|operand| matches!(operand, Operand::Numbers(_)));
            if function.is_long(parameters) || !alone {
                return cut;
            }
            cut = user;
        }
        cut
    }

    /// Name of the register array that all loops share, grown to `length`.
    fn shared(&mut self, length: usize) -> String {
        self.shared.1 = self.shared.1.max(length);
        self.shared.0.clone()
    }

    /// Loads a part of a vector in memory into registers; returns their name.
    fn loaded(&mut self, name: &str, first: usize, count: usize) -> String {
        let v = self.shared(count);
        let _ =
            writeln!(self.code, ".rep j, 1, {count}\n        {v}[j] = {name}[{}]\n.endr", plus(first, "j"));
        v
    }
}

/// Products of a row's weights from `first` on with `count` elements from `offset` on, as [`SUMS`] partial sums.
fn row(w: &str, first: usize, x: &str, offset: usize, count: usize) -> String {
    if count < 2 * SUMS {
        return format!("sum(j, 1, {count}, {w}[i,{}]*{x}[{}])", plus(first, "j"), plus(offset, "j"));
    }
    let place = format!("{SUMS}*j+g");
    let last = turns(count);
    format!(
        "sum(g, 1, {SUMS}, sum(j, 0, {last}, {w}[i,{}]*{x}[{}]))",
        plus(first, &place),
        plus(offset, &place)
    )
}
