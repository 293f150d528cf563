// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards with second cores: no pin changes, and outputs are safe before a wrong value reaches a pin.

use crate::system::{safe as system_is_safe, ulx3s, unchanged, wiring_with};
use crate::top::{PERIOD, WIRING, have_the_same_pins, periods, runs_talks_and_fails_safe, safe, target};
use std::path::Path;
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::{Host, Wiring, top};
use takt_isa::Program;
use takt_rtl::export::DesignFile;

/// The wiring of [`top`](crate::top) with a second core.
fn wiring(delay: u32) -> Wiring {
    let text = WIRING.replace("[signals]", &format!("[second_core]\ndelay = {delay}\n\n[signals]"));
    Wiring::read("wiring.toml", &text, &ulx3s()).expect("a right wiring")
}

/// A board whose first core takes 7 for an input of 6.
fn with_a_difference(delay: u32, program: &Program, folder: &Path) -> Simulation {
    let (board, wiring) = (ulx3s(), wiring(delay));
    let mut files = top::circuit(&board, &wiring, program).expect("a circuit").files;
    differ(&mut files, "takt_t1_pair.v", "32'd6", "32'd7");
    Simulation::of(&files, &board, &wiring, folder).unwrap_or_else(|error| panic!("{error}"))
}

/// Lets the first core of a pair take another value for an input.
fn differ(files: &mut [DesignFile], name: &str, value: &str, other: &str) {
    let file = files.iter_mut().find(|file| file.name == name).expect("a pair");
    let port = ".input_value(input_value)";
    assert!(file.text.find(port) < file.text.find("second ("), "{}", file.text);
    let instead = format!(".input_value(input_value == {value} ? {other} : input_value)");
    file.text = file.text.replacen(port, &instead, 1);
}

#[test]
fn the_board_runs_talks_and_fails_safe_with_a_second_core() {
    let (board, _, program, folder) = target("board-second");
    let wiring = wiring(2);
    let sim = Simulation::new(&board, &wiring, &program, &folder).unwrap_or_else(|error| panic!("{error}"));
    runs_talks_and_fails_safe(sim, &wiring, &program);
}

/// Cycle by cycle, all pins are those of the board without a second core, from power-up on.
#[test]
fn a_second_core_changes_no_pin() {
    let (board, alone, program, folder) = target("board-pins");
    let start = |wiring: &Wiring, name: &str| {
        let sim = Simulation::new(&board, wiring, &program, &folder.join(name));
        sim.unwrap_or_else(|error| panic!("{error}"))
    };
    let mut both = [start(&alone, "one"), start(&wiring(2), "two")];
    have_the_same_pins(&mut both);
}

/// Turns the encoder of two boards, the first a right one, to 6: until the outputs of the second are safe, all pins are alike, cycle by cycle.
pub(crate) fn is_safe_before_a_pin_is_wrong(both: &mut [Simulation; 2], name: &str) {
    for sim in both.iter_mut() {
        periods(sim, 8);
        let pins = ["encoder_a", "encoder_b"].map(|pin| sim.input(pin).expect("a pin"));
        sim.turns = vec![EncoderMotion { pins, from: 0, by: 5 }];
        periods(sim, 2);
        sim.turns = vec![EncoderMotion { pins, from: 5, by: 1 }];
    }
    let mut safe_for = 0;
    for cycle in 0..4 * PERIOD {
        let [right, wrong] = both.each_mut().map(|sim| {
            sim.run(1, &[]).expect("it runs");
            sim.outputs().iter().cloned().zip(sim.output_levels().map(|(level, _)| level)).collect::<Vec<_>>()
        });
        let level = |pins: &[(String, bool)], name: &str| pins.iter().any(|(pin, high)| pin == name && *high);
        assert!(level(&right, "signal_drive"), "cycle {cycle}");
        if level(&wrong, "signal_drive") {
            assert_eq!(right, wrong, "{name}, cycle {cycle}");
        } else {
            // A pin follows a cycle later.
            assert!(!level(&wrong, "lamp_out") || safe_for == 0, "cycle {cycle}");
            safe_for += 1;
        }
    }
    assert!(safe_for > PERIOD, "{safe_for}");
}

/// With the longest delay, too, the outputs are safe before a pin shows what a wrong first core computes; the host reads the cause, and a
/// start lets the board drive again.
#[test]
fn a_difference_makes_outputs_safe_before_a_pin_is_wrong() {
    let (board, _, program, folder) = target("board-differs");
    for delay in [2, 4] {
        let right = wiring(delay);
        let right = Simulation::new(&board, &right, &program, &folder.join("right")).expect("it starts");
        let mut both = [right, with_a_difference(delay, &program, &folder.join("wrong"))];
        is_safe_before_a_pin_is_wrong(&mut both, &format!("delay {delay}"));
        let [_, mut wrong] = both;
        assert!(safe(&mut wrong));
        let mut host = Host::connect(wrong, 3).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(host.status().expect("status").causes().collect::<Vec<_>>(), ["cores differ"]);
        let reasons = host.safe_reasons(None).expect("it answers");
        assert_eq!(reasons, ["cores differ: the second core did not do what the first one did"]);
        let pins = ["encoder_a", "encoder_b"].map(|pin| host.line.input(pin).expect("a pin"));
        host.line.turns = vec![EncoderMotion { pins, from: 6, by: 1 }];
        periods(&mut host.line, 1);
        host.set("control", 0x105).expect("it starts");
        periods(&mut host.line, 8);
        assert!(host.status().expect("status").drives());
    }
}

/// Every core of a system has a second one: a difference in one pair makes all outputs safe, and names the core to the host.
#[test]
fn each_core_of_a_system_has_a_second_one() {
    let description = unchanged();
    let folder = |name: &str| Path::new(env!("CARGO_TARGET_TMPDIR")).join("system-second").join(name);
    let (alone, paired) = (wiring_with(&description, ""), wiring_with(&description, "\n[second_core]\n"));
    let start = |wiring: &Wiring, name: &str| {
        let sim = Simulation::new(&ulx3s(), wiring, &description, &folder(name));
        sim.unwrap_or_else(|error| panic!("{error}"))
    };
    let mut both = [start(&alone, "one"), start(&paired, "two")];
    let mut drove = 0;
    for run in 0..200 {
        let levels: Vec<Vec<(bool, u32)>> = both
            .iter_mut()
            .map(|board| {
                let pins = ["encoder_a", "encoder_b"].map(|pin| board.input(pin).expect("a pin"));
                board.turns = vec![EncoderMotion { pins, from: 3 * run, by: 3 }];
                board.run(1009, &[]).expect("it runs");
                board.output_levels().collect()
            })
            .collect();
        if run * 1009 > 2 * top::RESET as i32 {
            assert_eq!(levels[0], levels[1], "run {run}");
        }
        drove += levels[1].iter().map(|(_, high)| high).sum::<u32>();
    }
    assert!(drove > 0);

    let mut files = top::circuit(&ulx3s(), &paired, &description).expect("a circuit").files;
    let second = description.cores.iter().position(|core| core.name == "servo").expect("a core");
    // Only one core of the system gets counts of the encoder.
    differ(&mut files, "takt_t1_pair.v", "32'd70", "32'd71");
    let sim = Simulation::of(&files, &ulx3s(), &paired, &folder("wrong"));
    let mut sim = sim.unwrap_or_else(|error| panic!("{error}"));
    let pins = ["encoder_a", "encoder_b"].map(|pin| sim.input(pin).expect("a pin"));
    sim.run(100_000, &[]).expect("it runs");
    assert!(sim.output("signal_drive").expect("a pin").0);
    sim.turns = vec![EncoderMotion { pins, from: 0, by: 70 }];
    sim.run(20_000, &[]).expect("it runs");
    sim.run(20_000, &[]).expect("it runs");
    let is_safe = system_is_safe(&mut sim);
    let mut host = Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"));
    let causes: Vec<Vec<&str>> =
        (0..3).map(|core| host.status_of(core).expect("status").causes().collect()).collect();
    assert_eq!(causes[second], ["cores differ"], "{causes:?}");
    assert!(is_safe);
}
