// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writes a policy as source: a counted loop over the rows of each layer, with the vector that the rows share in registers. Elements of
//! other vectors are unrolled, or computed in loops if they call macros.

mod element;
mod layer;

use super::stages::{Stage, stages};
use super::{Element, Network, Operand, Reduction, Step};
use crate::Error;
use crate::sink::{Arrays, Head, Names, Period, machine_for, number};
use std::collections::HashMap;
use std::fmt::Write;
use takt_isa::Machine;

/// Maximum number of a vector's elements in registers at a time: half of a bank; the other half holds products.
const COLUMNS: usize = 128;

/// Unrolling factor of loops that call macros: a macro's chain leaves most cycles idle.
const UNROLL: usize = 4;

/// Partial sums of a row, which hide the adder's latency.
const SUMS: usize = 4;

/// Source of a policy, and its interface.
pub struct Source {
    /// Text of the program.
    pub text: String,
    /// Machine with the memory sizes that the program needs.
    pub machine: &'static Machine,
    /// Data words of the arrays.
    pub words: usize,
    /// Name of the array of input ports.
    pub input: String,
    /// Name of the array of output ports.
    pub output: String,
}

/// Location of a vector's elements.
#[derive(Clone)]
enum Place {
    /// Name of an array of ports or registers.
    Registers(String),
    /// Name of an array in data memory.
    Memory(String),
}

impl Place {
    fn name(&self) -> &str {
        let (Place::Registers(name) | Place::Memory(name)) = self;
        name
    }
}

struct Writer<'a> {
    network: &'a Network,
    names: Names,
    /// Name of the array of output ports.
    output: String,
    arrays: Arrays,
    /// Arrays of data memory that hold vectors.
    vectors: Arrays,
    code: String,
    /// Locations of the steps' vectors, and of their copies in memory for loops.
    places: HashMap<usize, Place>,
    copies: HashMap<usize, String>,
    layers: usize,
    /// Name and length of the register array into which all loops load their vectors.
    shared: (String, usize),
    /// Scalar registers, each for a shared subexpression.
    scalars: Vec<String>,
    /// Total of weights of unrolled layers.
    written_out: usize,
    /// Registers used by vectors other than layers' results.
    kept: usize,
    /// A macro is called, so the library is included.
    library: bool,
}

/// Writes the source of a policy for a machine with memory for its weights and `bundles` bundles of code. With a range, the source declares
/// it for every number of the input.
///
/// # Errors
/// If the machine has too few ports or too little memory, with the numbers.
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
        places: HashMap::from([(0, Place::Registers(input.clone()))]),
        copies: HashMap::new(),
        layers: 0,
        kept: 0,
        library: false,
    };
    for stage in stages(network) {
        writer.stage(&stage)?;
    }
    let words = writer.arrays.words() + writer.vectors.words();
    let machine = machine_for(machine, bundles, words)?;
    Ok(Source { text: writer.text(&input, machine, range)?, machine, words, input, output })
}

impl Writer<'_> {
    fn text(&self, input: &str, machine: &Machine, range: Option<(f64, f64)>) -> Result<String, Error> {
        let Network { name, input: from, output: to, notes, .. } = self.network;
        let mut head = Head::default();
        head.comment(&format!(
            "{name}: a policy {}, {} weights",
            self.network.shape(),
            self.network.weights()
        ));
        for note in notes {
            head.comment(note);
        }
        head.blank();
        head.machine(machine);
        if self.library {
            head.include("math.s");
        }
        head.input(input, &[from.length], &from.name);
        head.output(&self.output, &[to.length], &to.name);
        head.latched();
        head.lines(self.vectors.text());
        head.blank();
        let (shared, length) = &self.shared;
        if *length > 0 {
            head.registers(&[format!("{shared}[{length}]")]);
        }
        head.registers(&self.scalars);
        if let Some(range) = range {
            head.range(input, range)?;
        }
        let program = head.into_program(&Period { code: &self.code, contracted: true });
        Ok(format!("{program}\n; Weights, by rows.\n{}", self.arrays.text()))
    }

    fn stage(&mut self, stage: &Stage) -> Result<(), Error> {
        let place = match (&self.network.steps[stage.root], stage.layer) {
            (_, Some(layer)) => self.layer(stage, layer)?,
            (Step::Gather(elements), None) => self.gathered(stage.root, elements)?,
            (Step::Reduce { reduction, vector, group }, None) => {
                self.reduced(stage, *reduction, *vector, *group)?
            }
            _ => self.elements(stage)?,
        };
        self.places.insert(stage.root, place);
        Ok(())
    }

    /// The step computes the output, and no other step reads its vector.
    fn is_output(&self, step: usize) -> bool {
        step == self.network.result && self.network.uses()[step] == 1
    }

    /// Allocates a vector that is written element by element: output ports, registers while some are left, or memory.
    fn allocate_vector(&mut self, step: usize, loops: bool) -> Place {
        let length = self.network.lengths[step];
        if self.is_output(step) && !loops {
            return Place::Registers(self.output.clone());
        }
        if loops || self.kept + length > COLUMNS {
            let name = self.names.unique("h0");
            self.vectors.zeros(&name, &[length]);
            return Place::Memory(name);
        }
        self.kept += length;
        // A declaration of its own: the registers that loops load are written by another slot.
        let name = self.names.unique("v0");
        let _ = writeln!(self.code, ".reg    {name}[{length}]");
        Place::Registers(name)
    }

    /// Copies the output's vector to the output ports.
    fn put_out(&mut self, step: usize, place: &Place) {
        if let (true, Place::Memory(name)) = (step == self.network.result, place) {
            let (output, length) = (&self.output, self.network.lengths[step]);
            let _ = writeln!(self.code, ".rep i, 1, {length}\n        {output}[i] = {name}[i]\n.endr");
        } else if let (true, Place::Registers(name)) = (step == self.network.result, place)
            && *name != self.output
        {
            let (output, length) = (&self.output, self.network.lengths[step]);
            let _ = writeln!(self.code, ".rep i, 1, {length}\n        {output}[i] = {name}[i]\n.endr");
        }
    }

    /// Name of a vector in memory, for use in loops: a copy, if the vector is in registers.
    fn in_memory(&mut self, step: usize) -> String {
        match self.places.get(&step) {
            Some(Place::Memory(name)) => name.clone(),
            Some(Place::Registers(from)) => {
                if let Some(copy) = self.copies.get(&step) {
                    return copy.clone();
                }
                let name = self.names.unique("m0");
                let length = self.network.lengths[step];
                self.vectors.zeros(&name, &[length]);
                let _ = writeln!(self.code, ".rep j, 1, {length}\n        {name}[j] = {from}[j]\n.endr");
                self.copies.insert(step, name.clone());
                name
            }
            None => String::new(),
        }
    }

    /// Stored vectors that the steps inside a stage read element by element.
    fn read_by(&self, stage: &Stage) -> Vec<usize> {
        let mut vectors = Vec::new();
        for (step, _) in self.network.steps.iter().zip(&stage.inside).filter(|(_, inside)| **inside) {
            let Step::Each { operands, .. } = step else { continue };
            for operand in operands {
                if let Operand::Vector { vector, .. } = operand
                    && !stage.inside[*vector]
                    && !vectors.contains(vector)
                {
                    vectors.push(*vector);
                }
            }
        }
        vectors
    }

    /// Writes a stage without a layer: unrolled, or as a loop if it calls macros or all its operands are in memory.
    fn elements(&mut self, stage: &Stage) -> Result<Place, Error> {
        let length = self.network.lengths[stage.root];
        let read = self.read_by(stage);
        let in_memory = |step: &usize| matches!(self.places.get(step), Some(Place::Memory(_)));
        let loops = length > 2 * UNROLL && (self.is_long(stage) || read.iter().all(in_memory));
        let names: Vec<&str> = self.functions(stage).iter().map(|function| function.name).collect();
        let _ = writeln!(self.code, "; {length} elements: {}.", names.join(", "));
        if loops {
            for step in read {
                let name = self.in_memory(step);
                self.copies.insert(step, name);
            }
        }
        let place = self.allocate_vector(stage.root, loops);
        let index = if loops { "i" } else { "j" };
        let (open, close) = if loops { (".for", ".endfor") } else { (".rep", ".endr") };
        let unroll = if loops { format!(" unroll {UNROLL}") } else { String::new() };
        let _ = writeln!(self.code, "{open} {index}, 1, {length}{unroll}");
        let to = format!("{}[{index}]", place.name());
        self.element(stage, stage.root, &HashMap::new(), &to, index, loops)?;
        let _ = writeln!(self.code, "{close}");
        self.put_out(stage.root, &place);
        Ok(place)
    }

    /// Writes a vector put together from elements of others.
    fn gathered(&mut self, step: usize, elements: &[Element]) -> Result<Place, Error> {
        let place = self.allocate_vector(step, false);
        let to = place.name().to_owned();
        let _ = writeln!(self.code, "; {} elements, put together.", elements.len());
        let mut index = 0;
        while index < elements.len() {
            let (vector, at) = match elements[index] {
                Element::Number(value) => {
                    let _ = writeln!(self.code, "        {to}[{}] = {}", index + 1, number(value)?);
                    index += 1;
                    continue;
                }
                Element::Of { vector, at } => (vector, at),
            };
            let run = elements[index..].iter().enumerate();
            let run = run.take_while(|(k, element)| **element == Element::Of { vector, at: at + k }).count();
            let from = self.places.get(&vector).map(|place| place.name().to_owned()).unwrap_or_default();
            let _ = match run {
                1 => writeln!(self.code, "        {to}[{}] = {from}[{}]", index + 1, at + 1),
                _ => writeln!(
                    self.code,
                    ".rep j, 1, {run}\n        {to}[{}] = {from}[{}]\n.endr",
                    plus(index, "j"),
                    plus(at, "j")
                ),
            };
            index += run;
        }
        self.put_out(step, &place);
        Ok(place)
    }

    /// Writes a reduction: one number for each group of elements.
    fn reduced(
        &mut self,
        stage: &Stage,
        reduction: Reduction,
        vector: usize,
        group: usize,
    ) -> Result<Place, Error> {
        let place = self.allocate_vector(stage.root, false);
        let count = self.network.lengths[stage.root];
        let _ = writeln!(self.code, "; {count} of {group} elements each: {reduction:?}.");
        for index in 0..count {
            let from = index * group;
            let element = |writer: &mut Self, place: &str| writer.term(stage, vector, &plus(from, place));
            let value = match reduction {
                Reduction::Sum | Reduction::Mean => {
                    let sum = if group < 2 * SUMS {
                        format!("sum(j, 1, {group}, {})", element(self, "j")?)
                    } else {
                        let last = turns(group);
                        format!(
                            "sum(g, 1, {SUMS}, sum(j, 0, {last}, {}))",
                            element(self, &format!("{SUMS}*j+g"))?
                        )
                    };
                    match reduction {
                        Reduction::Mean => format!("({sum})*{}", number(1.0 / group as f64)?),
                        _ => sum,
                    }
                }
                Reduction::Max | Reduction::Min => {
                    let name = if reduction == Reduction::Max { "max" } else { "min" };
                    let mut terms = (1..=group)
                        .map(|at| element(self, &at.to_string()))
                        .collect::<Result<Vec<_>, _>>()?;
                    while terms.len() > 1 {
                        terms = terms
                            .chunks(2)
                            .map(|pair| match pair {
                                [a, b] => format!("{name}({a}, {b})"),
                                rest => rest.concat(),
                            })
                            .collect();
                    }
                    terms.concat()
                }
            };
            let _ = writeln!(self.code, "        {}[{}] = {value}", place.name(), index + 1);
        }
        self.put_out(stage.root, &place);
        Ok(place)
    }
}

/// Text of an index plus a constant offset.
fn plus(offset: usize, index: &str) -> String {
    if offset > 0 { format!("{offset}+{index}") } else { index.to_owned() }
}

/// Upper limit of the inner loop of a sum in [`SUMS`] parts, as a function of the part `g`.
fn turns(count: usize) -> String {
    match count % SUMS {
        0 => (count / SUMS - 1).to_string(),
        _ => format!("int(({count} - g)/{SUMS})"),
    }
}
