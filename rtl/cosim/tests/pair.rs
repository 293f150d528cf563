// SPDX-License-Identifier: MIT OR Apache-2.0
//! A core with a second one beside it does in every cycle what the core does alone, and the two never differ.

use crate::common::{assemble, folder};
use crate::lockstep::track;
use takt_cosim::{Lockstep, Model, Simulation, random};
use takt_isa::{Machine, Program, T1, T3};
use takt_rtl::{Design, Library, Safety, export};

/// Cycles by which second cores are later.
pub(crate) const DELAY: u32 = 2;

pub(crate) fn pair(machine: &'static Machine, latched: u16) -> Design {
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    let safety = Safety { second_core: Some(DELAY), ..Safety::default() };
    design.latching(latched).and_then(|design| design.with(safety)).expect("every core can be a pair")
}

/// A simulation of a design.
pub(crate) fn start(design: &Design) -> Simulation {
    let model = Model::build(design, &folder(), false).unwrap_or_else(|error| panic!("{error}"));
    model.start(&[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs random programs and tracking on a design in lockstep with the emulator.
pub(crate) fn runs_as_the_emulator(machine: &'static Machine, design: &Design) {
    let mut simulation = start(design);
    let mut coverage = random::Coverage::default();
    for seed in 0..100 {
        simulation = random::run(seed, machine, simulation, &mut coverage)
            .and_then(|simulation| random::run_short(seed, machine, simulation, &mut coverage))
            .unwrap_or_else(|error| panic!("{} seed {seed}: {error}", machine.name));
    }
    assert!(coverage.missed > 100 && coverage.faults.len() > 4, "{coverage:?}");
    track(&assemble(machine, "hybrid/tracking.s"), simulation, 50);
}

#[test]
fn no_cycle_of_any_program_changes() {
    for machine in [&T1, &T3] {
        runs_as_the_emulator(machine, &pair(machine, 0));
    }
}

#[test]
fn latched_ports_of_a_pair_are_those_of_a_core() {
    let program = Program { latched: true, ..assemble(&T1, "hybrid/tracking.s") };
    track(&program, start(&pair(&T1, program.latched_inputs())), 20);
}

/// A second core that reads another input is told from the first one, in each compared group of nets by a program of its own.
#[test]
fn a_difference_is_seen() {
    let program = assemble(&T1, "hybrid/tracking.s");
    let changed = |from: &str, to: &str| {
        let mut design = pair(&T1, 0);
        let file = design.files.iter_mut().find(|file| file.base() == format!("{}.v", design.top));
        let text = &mut file.expect("the pair").text;
        let second = text.find("second (").expect("the second core");
        assert!(text[second..].contains(from), "{text}");
        *text = format!("{}{}", &text[..second], text[second..].replacen(from, to, 1));
        let mut lockstep =
            Lockstep::new(&program, start(&design), &[]).unwrap_or_else(|error| panic!("{error}"));
        let inputs: Vec<_> = program.inputs.iter().map(|port| (port.register, 1.5_f32.to_bits())).collect();
        (0..3).try_for_each(|_| {
            assert!(lockstep.run_period(&inputs));
            lockstep.compare()
        })
    };
    for (from, to) in [
        (".tick(later_tick)", ".tick(tick)"),
        (".input_value(later_input_value)", ".input_value(later_input_value ^ 32'd1)"),
        (".load_value(later_load_value)", ".load_value(later_load_value ^ 48'd1)"),
    ] {
        let error = changed(from, to).expect_err(from).to_string();
        assert!(error.contains("the cores of the pair differ"), "{from}: {error}");
    }
}
