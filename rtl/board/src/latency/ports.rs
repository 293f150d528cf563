// SPDX-License-Identifier: MIT OR Apache-2.0
//! Paths through a core without links.

use super::peripherals::{inputs, outputs, peripherals_without_path};
use super::pin_path::{End, Part, PinPath, PinPaths, publisher, states_text};
use crate::wiring::Wiring;
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::dependence::{Dependence, OutputEvent};
use takt_analysis::{Bounds, SectionBounds};
use takt_isa::Program;
use takt_isa::program::Port;
use takt_isa::timing::Span;

/// Cycles that `takt_exchange` takes, without any input, from the board's tick to the core's tick.
const BEGIN: u64 = 2;
/// Cycles, without any output, from the issue of `wait` to the cycle in which `put` is high: the core's `waiting`, `takt_exchange` and
/// the rounding of the last output.
const END: u64 = 9;

/// Cycles from the issue of `wait`, and the core's delay of the tick, to the first cycle in which the board's tick begins a period, if the
/// outputs have been copied before.
const WAITS: u64 = 3;

/// Cycles of a program's periods, from the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProgramCycles {
    /// To the `wait`.
    pub period: Span,
    /// To the publication of the outputs, if a `publish` comes before the `wait`.
    pub published: Option<Span>,
}

impl From<Span> for ProgramCycles {
    fn from(period: Span) -> ProgramCycles {
        ProgramCycles { period, published: None }
    }
}

impl ProgramCycles {
    /// Cycles of the periods that start with a tick after the `wait`; `None` without periods.
    pub fn new(bounds: &Bounds) -> Option<ProgramCycles> {
        let sections = || bounds.sections.iter().filter(|section| !section.once);
        let period = sections().map(|section| section.cycles).reduce(Span::or)?;
        let publishes = sections().any(|section| section.published.is_some());
        let published = sections().map(SectionBounds::to_outputs).reduce(Span::or).filter(|_| publishes);
        Some(ProgramCycles { period, published })
    }

    /// Cycles to the publication of the outputs, by a `publish` or by the `wait`.
    pub fn to_outputs(self) -> Span {
        self.published.unwrap_or(self.period)
    }

    /// Cycles from the board's tick to the cycle in which the peripherals take the outputs on: `reads` registers become input ports, and
    /// output ports become `writes` registers.
    pub(crate) fn to_put(self, reads: u64, writes: u64) -> Span {
        self.to_outputs().after(reads + BEGIN + writes + END)
    }

    /// Cycles from the board's tick to the first cycle in which the next one begins a period.
    pub(crate) fn to_idle(self, reads: u64, writes: u64) -> Span {
        let (put, waits) = (self.to_put(reads, writes), self.period.after(reads + BEGIN + WAITS));
        Span { best: put.best.max(waits.best), worst: put.worst.max(waits.worst) }
    }
}

/// Cycles from the board's tick to the peripherals' new values, of a program that takes `cycles` from its tick to its `wait`: the register
/// `cycles`.
pub(crate) fn to_outputs(cycles: u64, reads: u64, writes: u64) -> u64 {
    ProgramCycles::from(Span { best: cycles, worst: cycles }).to_put(reads, writes).worst
}

/// Paths of a program, with the periods that states add: inputs and outputs with equal states share a path. Outputs that follow no input
/// are left out.
pub(super) fn ways(wiring: &Wiring, program: &Program, cycles: ProgramCycles) -> PinPaths {
    let ways = undivided(wiring, cycles);
    let dependence = Dependence::new(program, &BTreeSet::new()).unwrap_or_else(|_| Dependence::unknown());
    let sent = if program.latched { OutputEvent::AtWait } else { OutputEvent::Written };
    let register =
        |ports: &[Port], name: &str| ports.iter().find(|port| port.name == name).map(|port| port.register);
    let split = |way: PinPath| {
        // The first map has the outputs of each input, by equal states; the second has all inputs, by equal states and outputs.
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
                // The states' part comes after the program's, before the output registers.
                between.insert(
                    between.len() - 1,
                    Part::new(text, u64::from(least) * period, u64::from(latest) * period),
                );
            }
            let periods = Part::sum("", &between);
            let [inputs, outputs] = [of(&way.inputs, &inputs), of(&way.outputs, &outputs)];
            PinPath { inputs, outputs, between, periods, is_certain: most.is_some(), ..way.clone() }
        };
        inputs.into_iter().map(each).collect::<Vec<_>>()
    };
    let busy = if ways.is_empty() { 0 } else { cycles.to_idle(reads(wiring), writes(wiring)).worst };
    let late = (busy >= u64::from(wiring.period))
        .then(|| format!("{busy} cycles from the tick, of {}", wiring.period));
    PinPaths {
        ways: ways.into_iter().flat_map(split).collect(),
        others: peripherals_without_path(wiring),
        queues: Vec::new(),
        late: late.into_iter().collect(),
    }
}

/// Paths from all inputs of a wiring to all its outputs, regardless of dependences, through a core without links: one for the inputs that
/// wait for a tick, and one for each time from a carrier's sample to the tick. The periods of the core take `cycles`, and the next tick
/// comes after the `wait`. Empty if the wiring has no such input, or no such output.
pub fn undivided(wiring: &Wiring, cycles: impl Into<ProgramCycles>) -> Vec<PinPath> {
    let cycles = cycles.into();
    let span = cycles.to_outputs();
    let inputs: Vec<_> = wiring.peripherals.iter().flat_map(|of| inputs(wiring, of)).collect();
    let (reads, writes) = (reads(wiring), writes(wiring));
    let after = [
        Part::new(format!("registers to input ports ({reads})"), reads + BEGIN, reads + BEGIN),
        Part::new(
            format!("the program, from tick to {}", publisher(cycles.published.is_some())),
            span.best,
            span.worst,
        ),
        Part::new(format!("output ports to registers ({writes})"), writes + END, writes + END),
    ];
    let busy = Part::sum("", &after);
    let busy = Some([busy.best, busy.worst]);
    let outputs = wiring.peripherals.iter().flat_map(|of| outputs(wiring, of, busy));
    let outputs: Vec<End> = outputs.filter_map(|(_, end)| end).collect();
    if outputs.is_empty() {
        return Vec::new();
    }
    let mut ways: Vec<PinPath> = Vec::new();
    for input in inputs.into_iter().filter_map(|(_, end)| end) {
        let key = |end: &End| (end.until.clone(), end.sample);
        if let Some(way) = ways.iter_mut().find(|way| key(&way.inputs[0]) == key(&input)) {
            way.inputs.push(input);
            continue;
        }
        let between: Vec<Part> = std::iter::once(input.until.clone()).chain(after.clone()).collect();
        let periods = Part::sum("", &between);
        ways.push(PinPath {
            cores: Vec::new(),
            links: Vec::new(),
            inputs: vec![input],
            between,
            periods,
            outputs: outputs.clone(),
            is_certain: true,
        });
    }
    ways
}

/// Number of registers that become input ports at the tick.
fn reads(wiring: &Wiring) -> u64 {
    wiring.peripherals.iter().map(|of| of.reads.iter().flatten().count() as u64).sum()
}

/// Number of output ports that become registers.
fn writes(wiring: &Wiring) -> u64 {
    wiring.peripherals.iter().map(|of| of.writes.iter().flatten().count() as u64).sum()
}
