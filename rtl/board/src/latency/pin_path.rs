// SPDX-License-Identifier: MIT OR Apache-2.0
//! Paths from pin to pin, as lists of parts.

/// Step of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The step in words.
    pub text: String,
    /// Cycles that the step takes at least.
    pub best: u64,
    /// Cycles that the step takes at most.
    pub worst: u64,
}

impl Part {
    pub(super) fn new(text: impl Into<String>, best: u64, worst: u64) -> Part {
        Part { text: text.into(), best, worst }
    }

    /// Sum of consecutive parts.
    pub fn sum<'a>(text: &str, parts: impl IntoIterator<Item = &'a Part>) -> Part {
        let add = |sum: Part, part: &Part| Part {
            best: sum.best + part.best,
            worst: sum.worst + part.worst,
            ..sum
        };
        parts.into_iter().fold(Part::new(text, 0, 0), add)
    }
}

/// Kind of a pin's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The pin answers with an edge: the parts of the path end with the edge.
    Edge,
    /// The pin answers with a stream of pulses whose density is the value. A single pulse tells nothing, and the first pulse that differs
    /// can come at any time, so the parts of the path end where the modulator takes the new value.
    Density,
}

/// The parts between a register and its pin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct End {
    /// The name of the pin's peripheral.
    pub peripheral: String,
    /// Port in the wiring that the register drives, or takes its value from.
    pub port: String,
    /// The steps between pin and register.
    pub parts: Vec<Part>,
    /// The kind of an output pin's answer; an input has `Edge`.
    pub answer: Answer,
    /// For an input, the part from these steps to the board's tick.
    pub until: Part,
    /// For an input, the sample if a carrier triggers one.
    pub sample: Option<Sample>,
    /// Slack of half bridges on a carrier, where an update waits for a place of the carrier: cycles by which the sum of all parts is
    /// below the least time, and above the greatest. The last part then begins at the instant at which the duty acts. `None` for other
    /// ends.
    pub update: Option<[u64; 2]>,
}

/// Sample at a place of a carrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sample {
    /// Sample of a converter at the beginning of its frame, where the path begins.
    Frame,
    /// Sample by a filter, the centre of its window, where the path begins.
    Window,
    /// Sample of a register; the path begins with the pin's edge before it.
    Latch,
}

/// End of a path from a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// The instant from which the duty acts.
    Acts,
    /// First edge at a pin that differs.
    Edge,
}

/// Path from pins to pins: from each of its inputs to each of its outputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PinPath {
    /// Cores of a system on the path.
    pub cores: Vec<String>,
    /// Links of a system before, between and after the path's cores.
    pub links: Vec<String>,
    /// The parts from an edge at a pin to the register that a program reads.
    pub inputs: Vec<End>,
    /// The parts from the read registers to the registers that a program writes, if no deadline is missed.
    pub between: Vec<Part>,
    /// Sum of `between`. Over several cores, the worst case of one part may exclude the worst case of another: `periods` is then less
    /// than the sum of the parts.
    pub periods: Part,
    /// The parts from the written registers to an edge at a pin.
    pub outputs: Vec<End>,
    /// The worst case is an upper bound. If branches or data-memory addresses can delay the first response, there is none: the worst case
    /// then assumes that the response passes through the fewest states.
    pub is_certain: bool,
}

impl PinPath {
    /// Sum from pin to pin, over all inputs and all outputs that answer with an edge; `None` if no output does.
    pub fn total(&self) -> Option<Part> {
        self.total_to(Answer::Edge, "from pin to pin")
    }

    /// Sum from the pins to the modulators of all outputs that answer with a density; `None` if no output does.
    pub fn total_to_modulator(&self) -> Option<Part> {
        self.total_to(Answer::Density, "from pin to modulator")
    }

    /// Sum from a sample at a place of a carrier to half bridges on a carrier; `None` without such a sample or half bridges.
    pub fn from_sample(&self, until: Until) -> Option<Part> {
        let sample = self.inputs.first()?.sample?;
        let outputs = self.outputs.iter().filter(|end| end.update.is_some()).map(|end| match until {
            Until::Acts => end.total(end.parts.len().saturating_sub(1)),
            Until::Edge => end.total(end.parts.len()),
        });
        let text = match until {
            Until::Acts => "from the sample until the duty acts",
            Until::Edge => "from the sample to its first edge",
        };
        self.total_of(outputs.collect(), sample != Sample::Latch, text)
    }

    fn total_to(&self, answer: Answer, text: &str) -> Option<Part> {
        let outputs = self.outputs.iter().filter(|end| end.answer == answer);
        self.total_of(outputs.map(|end| end.total(end.parts.len())).collect(), true, text)
    }

    /// Sum over all inputs (their parts, or from the sample on) and these outputs.
    fn total_of(&self, outputs: Vec<[i64; 2]>, has_inputs: bool, text: &str) -> Option<Part> {
        let inputs = self.inputs.iter().map(|end| end.total(if has_inputs { end.parts.len() } else { 0 }));
        let inputs: Vec<[i64; 2]> = inputs.collect();
        let least = |ends: &[[i64; 2]]| ends.iter().map(|end| end[0]).min();
        let most = |ends: &[[i64; 2]]| ends.iter().map(|end| end[1]).max();
        let sum = |input: i64, periods: u64, output: i64| {
            u64::try_from(input + i64::try_from(periods).unwrap_or(i64::MAX) + output).unwrap_or(0)
        };
        let best = sum(least(&inputs)?, self.periods.best, least(&outputs)?);
        let worst = sum(most(&inputs)?, self.periods.worst, most(&outputs)?);
        Some(Part::new(text, best, worst))
    }
}

impl End {
    /// Sum of the first `parts` parts, plus the slack of an update in the least time, minus its slack in the greatest.
    fn total(&self, parts: usize) -> [i64; 2] {
        let Part { best, worst, .. } = Part::sum("", self.parts.iter().take(parts));
        let [more, less] = self.update.unwrap_or_default();
        let signed = |cycles: u64| i64::try_from(cycles).unwrap_or(i64::MAX);
        [signed(best) + signed(more), signed(worst) - signed(less)]
    }
}

/// Paths through a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PinPaths {
    /// Paths; the paths of a program differ in the states between their inputs and outputs.
    pub ways: Vec<PinPath>,
    /// Peripherals whose ports have no edge to count from or to, such as converters.
    pub others: Vec<String>,
    /// FIFOs on paths from pin to pin of a system. Paths over FIFOs are not among `ways`, because their latency depends on the number of
    /// queued entries.
    pub queues: Vec<String>,
    /// Deadlines that can be missed, as text; the bounds assume that none is missed.
    pub late: Vec<String>,
}

/// Operation that publishes the outputs of a program: a `publish`, if one comes before the `wait` on some path.
pub(super) fn publisher(is_early: bool) -> &'static str {
    if is_early { "`publish`" } else { "`wait`" }
}

/// Number of periods that states take, as text; `None` for no period.
pub(super) fn states_text(least: u32, most: u32) -> Option<String> {
    match (least, most) {
        (0, 0) => None,
        (1, 1) => Some("through a period of states".to_owned()),
        (least, most) if least == most => Some(format!("through {most} periods of states")),
        (least, most) => Some(format!("through {least} to {most} periods of states")),
    }
}
