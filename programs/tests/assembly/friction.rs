// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of `tracking_friction.s` alone; it also takes part in the tests of all programs.

use super::inputs::{moves, recorded};
use super::processor::{FRICTION, Processor, source};
use takt_asm::{MemoryLoader, Options, Search};
use takt_isa::{Program, T1};
use takt_programs::hybrid::friction::{Friction, IDENTIFIED};
use takt_programs::hybrid::{ClosedLoop, Controller, Identification};
use takt_programs::trajectory::Trajectory;
use takt_programs::{LIBRARY, SOURCES, gcode};

/// The parameters equal the fit to a run of the nominal robot with its own controller, to the digits in the source.
#[test]
fn parameters_equal_the_identified_ones() {
    let path = gcode::read(takt_programs::FRICTION).expect("the embedded path is sound");
    let trajectory = Trajectory::plan(&path).expect("the embedded path is short");
    let mut identification = Identification::new();
    for record in ClosedLoop::new(&trajectory, Controller::<f64>::new()) {
        identification.add(&record.expect("the loop is stable"));
    }
    for (axis, (fit, written)) in identification.fit().iter().zip(IDENTIFIED).enumerate() {
        let found = fit.expect("every axis moves").friction;
        // Tolerance: the table's encoders are coarse, and under a binary32 controller the robot moves slightly differently.
        let tolerance = if axis < 3 { 2e-3 } else { 2e-2 };
        let near = |found: f64, written: f64| (found - written).abs() <= tolerance * written.abs();
        assert!(near(found.coulomb, written.coulomb), "axis {}: {found:?}", axis + 1);
        assert!(near(found.sign_speed, written.sign_speed), "axis {}: {found:?}", axis + 1);
        assert!(near(found.viscous, written.viscous), "axis {}: {found:?}", axis + 1);
        assert_eq!(found.stribeck, written.stribeck, "axis {}", axis + 1);
    }
}

/// Assembles `tracking_friction.s` with its lines changed.
fn assembled(change: impl Fn(&str) -> String) -> Program {
    let mut loader = MemoryLoader::new(SOURCES);
    let lines: Vec<String> = source(FRICTION).lines().map(change).collect();
    loader.add(FRICTION, lines.join("\n"));
    let options = Options { machine: &T1, ..Options::default() };
    let assembled = takt_asm::assemble(FRICTION, &Search::new(loader).library(LIBRARY), &options);
    assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

/// Stribeck's term: the shipped source with parameters for an axis that sticks.
#[test]
fn sticking_is_fed_forward() {
    let plain = IDENTIFIED[4];
    let sticking = Friction { stribeck: 0.05, stribeck_speed: 0.04, ..plain };
    let row = |friction: &Friction| {
        let Friction { coulomb, stribeck, stribeck_speed, sign_speed, viscous } = friction;
        format!(
            "friction ff5, omega_gamma, {coulomb}, {stribeck}, {stribeck_speed:?}, {sign_speed:?}, {viscous}"
        )
    };
    let program = |friction: &Friction| {
        assembled(
            |line| {
                if line.trim().starts_with("friction ff5") { row(friction) } else { line.to_owned() }
            },
        )
    };
    let [mut before, mut after] = [&plain, &sticking].map(|friction| Processor::new(&program(friction)));
    let mut largest = 0.0f64;
    // The table turns in the moves at the beginning of the letter G.
    for inputs in recorded(&moves(super::inputs::LETTER_G..), 3000) {
        let words = inputs.to_words();
        let torque = |processor: &mut Processor| {
            f64::from(f32::from_bits(processor.period(&words).expect("no input makes the program fault")[4]))
        };
        let found = torque(&mut after) - torque(&mut before);
        let speed = f64::from(inputs.reference.angular_velocity[1]);
        let expected = sticking.at(speed) - plain.at(speed);
        assert!((found - expected).abs() < 1e-5, "{speed}: {found} instead of {expected}");
        largest = largest.max(expected);
    }
    assert!(largest > 0.03, "{largest}");
}
