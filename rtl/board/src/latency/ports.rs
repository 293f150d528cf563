// SPDX-License-Identifier: MIT OR Apache-2.0
//! The ways through a core without links.

use super::peripherals::{inputs, others, outputs};
use super::way::{End, Part, Way, Ways, states_text};
use crate::wiring::Wiring;
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::dependence::{Dependence, Sent};
use takt_isa::Program;
use takt_isa::program::Port;
use takt_isa::timing::Span;

/// `takt_exchange`: from the board's tick to the core's, with no input.
const BEGIN: u64 = 5;
/// From the cycle in which `wait` issues to the one in which `put` is high, with no output: the core's `waiting`, `takt_exchange` and the
/// rounding of the last output.
const END: u64 = 14;

/// The ways of a program, with the periods that states add: inputs and outputs with the same states share one. Outputs that follow none of
/// the inputs are left out.
pub(super) fn ways(wiring: &Wiring, program: &Program, span: Span) -> Ways {
    let way = undivided(wiring, span);
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
    let busy = way.as_ref().map_or(0, |way| Part::sum("", &way.between[1..]).worst);
    let late = (busy >= u64::from(wiring.period))
        .then(|| format!("{busy} cycles from the tick, of {}", wiring.period));
    Ways {
        ways: way.into_iter().flat_map(split).collect(),
        others: others(wiring),
        queues: Vec::new(),
        late: late.into_iter().collect(),
    }
}

/// The way from all inputs of a wiring to all of its outputs, whatever depends on what, through a core without links whose periods take
/// the cycles of `span` from tick to `wait`, the next tick coming after the `wait`; `None` if there is no such input or output.
pub fn undivided(wiring: &Wiring, span: Span) -> Option<Way> {
    let inputs: Vec<_> = wiring.peripherals.iter().flat_map(inputs).collect();
    let outputs: Vec<_> = wiring.peripherals.iter().flat_map(outputs).collect();
    let (reads, writes) = (inputs.len() as u64, outputs.len() as u64);
    let between = vec![
        Part::new("until the tick", 0, u64::from(wiring.period) - 1),
        Part::new(format!("registers to input ports ({reads})"), reads + BEGIN, reads + BEGIN),
        Part::new("the program, from tick to `wait`", span.best, span.worst),
        Part::new(format!("output ports to registers ({writes})"), writes + END, writes + END),
    ];
    let [inputs, outputs] =
        [inputs, outputs].map(|ends| ends.into_iter().filter_map(|(_, end)| end).collect::<Vec<_>>());
    let periods = Part::sum("", &between);
    let way =
        Way { cores: Vec::new(), links: Vec::new(), inputs, between, periods, outputs, is_certain: true };
    Some(way).filter(|way| !way.inputs.is_empty() && !way.outputs.is_empty())
}
