// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ways from pin to pin, as their parts.

/// A part of the way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The step in words.
    pub text: String,
    /// Cycles that it takes at least.
    pub best: u64,
    /// Cycles that it takes at most.
    pub worst: u64,
}

impl Part {
    pub(super) fn new(text: impl Into<String>, best: u64, worst: u64) -> Part {
        Part { text: text.into(), best, worst }
    }

    /// Parts one after the other.
    pub fn sum<'a>(text: &str, parts: impl IntoIterator<Item = &'a Part>) -> Part {
        let add = |sum: Part, part: &Part| Part {
            best: sum.best + part.best,
            worst: sum.worst + part.worst,
            ..sum
        };
        parts.into_iter().fold(Part::new(text, 0, 0), add)
    }
}

/// The kind of a pin's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// An edge: the parts of the way end with it.
    Edge,
    /// A stream of pulses whose density is the value: one pulse says nothing, and the first that differs can come at any time. The parts
    /// of the way end where the modulator takes the value on.
    Density,
}

/// The parts between a register and its pin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct End {
    /// The peripheral.
    pub peripheral: String,
    /// The port that is its register, as the wiring names it.
    pub port: String,
    /// The steps between.
    pub parts: Vec<Part>,
    /// Of an output, what its pin answers with.
    pub answer: Answer,
}

/// A way from pins to pins: from each of its inputs to each of its outputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Way {
    /// Of a system, the cores that it leads through.
    pub cores: Vec<String>,
    /// Of a system, the links before, between and after these cores.
    pub links: Vec<String>,
    /// From an edge at a pin to the register that a program reads.
    pub inputs: Vec<End>,
    /// From there to the registers that a program writes, if no deadline is missed.
    pub between: Vec<Part>,
    /// All of `between` together. Over several cores, the worst of one part may exclude the worst of another: then this is less than the
    /// sum of the parts.
    pub periods: Part,
    /// From there to an edge at a pin.
    pub outputs: Vec<End>,
    /// True if the worst is certain: otherwise branches, or addresses of data memory, can put the first response off, and the worst is that
    /// of the fewest states that it can come through.
    pub is_certain: bool,
}

impl Way {
    /// From pin to pin, over all inputs and all outputs that answer with an edge; `None` if there are no such outputs.
    pub fn total(&self) -> Option<Part> {
        self.total_to(Answer::Edge, "from pin to pin")
    }

    /// From pin to the modulators of all outputs that answer with a density; `None` if there are none.
    pub fn total_to_modulator(&self) -> Option<Part> {
        self.total_to(Answer::Density, "from pin to modulator")
    }

    fn total_to(&self, answer: Answer, text: &str) -> Option<Part> {
        let outputs = self.outputs.iter().filter(|end| end.answer == answer);
        let outputs: Vec<Part> = outputs.map(|end| Part::sum("", &end.parts)).collect();
        let inputs: Vec<Part> = self.inputs.iter().map(|end| Part::sum("", &end.parts)).collect();
        let all = |edge: fn(&Part) -> u64, pick: fn(u64, u64) -> u64| {
            let [input, output] = [&inputs, &outputs].map(|ends| ends.iter().map(edge).reduce(pick));
            Some(input? + output? + edge(&self.periods))
        };
        Some(Part::new(text, all(|part| part.best, u64::min)?, all(|part| part.worst, u64::max)?))
    }
}

/// The ways through a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ways {
    /// The ways. Of a program, they differ in the states between their inputs and outputs.
    pub ways: Vec<Way>,
    /// Peripherals whose ports have no edge to count from or to, such as converters.
    pub others: Vec<String>,
    /// FIFOs on ways from pin to pin of a system. Such ways are not among `ways`, because their latency depends on what is queued.
    pub queues: Vec<String>,
    /// Deadlines that can be missed, in words; the bounds do not include that.
    pub late: Vec<String>,
}

/// The periods that states take, in words; nothing for none.
pub(super) fn states_text(least: u32, most: u32) -> Option<String> {
    match (least, most) {
        (0, 0) => None,
        (1, 1) => Some("through a period of states".to_owned()),
        (least, most) if least == most => Some(format!("through {most} periods of states")),
        (least, most) => Some(format!("through {least} to {most} periods of states")),
    }
}
