//! From an edge at a pin to an edge at a pin, in cycles: the contracts of the modules on the way, added up.
//!
//! `rtl/board/tests/top.rs`, `rtl/board/tests/system.rs` and `rtl/board/tests/pins.rs` measure these cycles in the complete top level.

mod system;

pub use system::system_ways;

use crate::wiring::{Peripheral, Wiring};
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::dependence::{Dependence, Sent};
use takt_isa::Program;
use takt_isa::program::Port;

/// A part of the way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// What happens.
    pub text: String,
    /// Cycles that it takes at least.
    pub best: u64,
    /// Cycles that it takes at most.
    pub worst: u64,
}

impl Part {
    fn new(text: impl Into<String>, best: u64, worst: u64) -> Part {
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
    /// What happens between.
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
    /// Whether the worst is: otherwise branches, or addresses of data memory, can put the first response off, and the worst is that of the
    /// fewest states that it can come through.
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
}

/// `takt_exchange`: from the board's tick to the core's, with no input.
const BEGIN: u64 = 5;
/// From the cycle in which `wait` issues to the one in which `put` is high, with no output: the core's `waiting`, `takt_exchange` and the
/// rounding of the last output.
const END: u64 = 14;

fn parameter(peripheral: &Peripheral, name: &str) -> u64 {
    peripheral.parameter(name).into()
}

/// From a pin's edge to the register, of peripherals that have such a pin.
fn edge_in(peripheral: &Peripheral, register: &str) -> Option<Vec<Part>> {
    let cycles = match (peripheral.kind.name, register) {
        ("quadrature" | "step", _) => parameter(peripheral, "filter") + 3,
        ("digital-in", "level") => parameter(peripheral, "hold") + 2,
        ("digital-in", _) => parameter(peripheral, "hold") + 3,
        _ => return None,
    };
    Some(vec![Part::new(format!("edge to `{register}`"), cycles, cycles)])
}

/// From the register to what the pin answers with.
fn answer(peripheral: &Peripheral) -> Option<(Vec<Part>, Answer)> {
    let edge = |parts| Some((parts, Answer::Edge));
    match peripheral.kind.name {
        // One cycle more of an odd pulse moves its end only, and the longest one that has an end ends with the period. A long dead time
        // can move the beginning of the shortest pulse that it leaves, dead + 1 cycles about the middle, beyond that; and, by dead / 2
        // into the next period, the rise of the lower switch in the shortest gap that it leaves. Where one switch is to stay on, it comes
        // on after the dead time.
        "pwm" => {
            let (half, dead) = (parameter(peripheral, "half"), parameter(peripheral, "dead"));
            let has_low = peripheral.pins.get(1).is_some_and(Option::is_some);
            let high = (2 * half).max(half + 1 + dead - (dead + 2) / 2);
            let low = if has_low { 2 * half + dead.div_ceil(2) } else { 0 };
            // A longer dead time leaves no pulse and no gap.
            let moves = if dead < 2 * half { high.max(low) } else { 0 }.max(dead + 1);
            edge(vec![
                Part::new("to the next period of the PWM", 2, 2 * half + 1),
                Part::new("its first edge that moves", 1, moves),
            ])
        }
        "digital-out" => edge(vec![Part::new("to the pin", 1, 1)]),
        "sigma-delta" => Some((vec![Part::new("to the modulator", 1, 1)], Answer::Density)),
        // A converter's frames begin at ticks, or with the outputs, whatever their values.
        _ => None,
    }
}

/// What a peripheral gives a program: each port, and the end of ways there; none if there is no edge to count from.
fn inputs(peripheral: &Peripheral) -> impl Iterator<Item = (&str, Option<End>)> {
    let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
    registers.filter_map(|(register, port)| {
        let port = port.as_deref()?;
        let parts = edge_in(peripheral, register.name);
        Some((port, parts.map(|parts| end(peripheral, port, (parts, Answer::Edge)))))
    })
}

fn outputs(peripheral: &Peripheral) -> impl Iterator<Item = (&str, Option<End>)> {
    peripheral.writes.iter().flatten().map(|write| {
        (write.port.as_str(), answer(peripheral).map(|answer| end(peripheral, &write.port, answer)))
    })
}

fn end(peripheral: &Peripheral, port: &str, (parts, answer): (Vec<Part>, Answer)) -> End {
    End { peripheral: peripheral.name.clone(), port: port.to_owned(), parts, answer }
}

/// Peripherals of a wiring with no port that is an end of a way.
fn others(wiring: &Wiring) -> Vec<String> {
    let is_other = |peripheral: &&Peripheral| {
        !inputs(peripheral).chain(outputs(peripheral)).any(|(_, end)| end.is_some())
    };
    wiring.peripherals.iter().filter(is_other).map(|peripheral| peripheral.name.clone()).collect()
}

/// The periods that states take, in words; nothing for none.
fn states_text(least: u32, most: u32) -> Option<String> {
    match (least, most) {
        (0, 0) => None,
        (1, 1) => Some("through a period of states".to_owned()),
        (least, most) if least == most => Some(format!("through {most} periods of states")),
        (least, most) => Some(format!("through {least} to {most} periods of states")),
    }
}

/// The ways of a program, as [`ways`] has them, and the periods that states add: those of inputs and outputs with the same states
/// together. Outputs that follow none of the inputs are left out.
pub fn program_ways(wiring: &Wiring, program: &Program, span: (u64, u64)) -> Ways {
    let mut all = ways(wiring, span);
    let dependence = Dependence::new(program, &BTreeSet::new()).unwrap_or_else(|_| Dependence::unknown());
    let sent = if program.latched { Sent::AtWait } else { Sent::Written };
    let register =
        |ports: &[Port], name: &str| ports.iter().find(|port| port.name == name).map(|port| port.register);
    let split = |way: Way| {
        // For the same states, each input's outputs; for the same of both, all inputs.
        let (mut outputs, mut inputs) = (BTreeMap::<_, Vec<usize>>::new(), BTreeMap::<_, Vec<usize>>::new());
        for (number, input) in way.inputs.iter().enumerate() {
            let Some(input) = register(&program.inputs, &input.port) else { continue };
            let on = dependence.on(input);
            for (end, output) in way.outputs.iter().enumerate() {
                let output = register(&program.outputs, &output.port);
                if let Some(periods) = output.and_then(|output| on.output(output, sent)) {
                    outputs.entry((periods.least, periods.most, number)).or_default().push(end);
                }
            }
        }
        for ((least, most, input), outputs) in outputs {
            inputs.entry((least, most, outputs)).or_default().push(input);
        }
        let period = u64::from(wiring.period);
        let of =
            |ends: &[End], numbers: &[usize]| numbers.iter().map(|number| ends[*number].clone()).collect();
        let each = move |((least, most, outputs), inputs): ((u32, Option<u32>, Vec<usize>), Vec<usize>)| {
            let latest = most.unwrap_or(least);
            let mut between = way.between.clone();
            if let Some(text) = states_text(least, latest) {
                // Behind the program, before the output registers.
                between.insert(
                    between.len() - 1,
                    Part::new(text, u64::from(least) * period, u64::from(latest) * period),
                );
            }
            let periods = Part::sum("", &between);
            let [inputs, outputs] = [of(&way.inputs, &inputs), of(&way.outputs, &outputs)];
            Way { inputs, outputs, between, periods, is_certain: most.is_some(), ..way.clone() }
        };
        inputs.into_iter().map(each).collect::<Vec<_>>()
    };
    all.ways = all.ways.into_iter().flat_map(split).collect();
    all
}

/// The ways of a program whose periods take between `best` and `worst` cycles from tick to `wait`, the next tick coming after the `wait`.
pub fn ways(wiring: &Wiring, (best, worst): (u64, u64)) -> Ways {
    let inputs: Vec<_> = wiring.peripherals.iter().flat_map(inputs).collect();
    let outputs: Vec<_> = wiring.peripherals.iter().flat_map(outputs).collect();
    let (reads, writes) = (inputs.len() as u64, outputs.len() as u64);
    let between = vec![
        Part::new("until the tick", 0, u64::from(wiring.period) - 1),
        Part::new(format!("registers to input ports ({reads})"), reads + BEGIN, reads + BEGIN),
        Part::new("the program, from tick to `wait`", best, worst),
        Part::new(format!("output ports to registers ({writes})"), writes + END, writes + END),
    ];
    let [inputs, outputs] =
        [inputs, outputs].map(|ends| ends.into_iter().filter_map(|(_, end)| end).collect::<Vec<_>>());
    let periods = Part::sum("", &between);
    let way =
        Way { cores: Vec::new(), links: Vec::new(), inputs, between, periods, outputs, is_certain: true };
    let is_way = !way.inputs.is_empty() && !way.outputs.is_empty();
    Ways { ways: is_way.then_some(way).into_iter().collect(), others: others(wiring), queues: Vec::new() }
}
