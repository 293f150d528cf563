// SPDX-License-Identifier: MIT OR Apache-2.0
//! Jog in its three modes.

use super::bench::{
    ACCEPTED, Bench, FINISHED, HOME, MOVE, PeriodObservation, REFUSED, STOP, STOPPED, apart, fast,
};
use takt_programs::three::kinematics::pose;
use takt_programs::three::profile::Profile;
use takt_programs::three::{HIGHEST, PERIOD, SixValues};

const TOOL: [f64; 3] = [0.0; 3];

/// Jogs for a number of ticks, then runs until the robot stands; returns the observations.
fn jog(bench: &mut Bench, mode: u32, rates: SixValues, ticks: u64) -> Vec<PeriodObservation> {
    let first = bench.seen.len();
    let sequence = bench.jog(mode, rates);
    bench.until(ACCEPTED, sequence);
    bench.run(ticks);
    assert_eq!(bench.last().mode, 2);
    let end = bench.jog(mode, [0.0; 6]);
    bench.until(FINISHED, end);
    bench.run(8);
    assert_eq!((bench.last().mode, bench.last().v()), (0, [0.0; 6]));
    bench.seen[first..].to_vec()
}

/// Consistency of the reference: velocities are the derivative of angles, accelerations of velocities.
fn consistent(seen: &[PeriodObservation], velocity: f64) {
    for pair in seen.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        for i in 0..6 {
            let mean = (a.v()[i] + b.v()[i]) / 2.0;
            assert!(((b.q()[i] - a.q()[i]) / PERIOD - mean).abs() < velocity, "joint {i}: {pair:?}");
            assert!((b.v()[i] - a.v()[i]).abs() < 0.05, "joint {i}: a step of the velocity");
        }
    }
}

#[test]
fn joints_turn_at_the_requested_rates() {
    let mut bench = Bench::new();
    let rates = [0.5, 0.0, -0.3, 1.0, 0.0, -2.0];
    let seen = jog(&mut bench, 0, rates, 800);
    let middle = &seen[seen.len() / 2];
    assert!(apart(&middle.v(), &rates) < 1e-6, "{:?}", middle.v());
    // Rounding: an ulp of an angle over a period is 6e-4 rad/s.
    consistent(&seen, 1e-3);
}

#[test]
fn the_tool_moves_along_the_axes_of_the_world() {
    let mut bench = Bench::new();
    let from = pose(&bench.last().q(), &TOOL).0;
    let seen = jog(&mut bench, 1, [0.1, 0.0, -0.05, 0.0, 0.0, 0.0], 1200);
    let end = pose(&seen.last().expect("some").q(), &TOOL).0;
    let gone = end[0] - from[0];
    assert!(gone > 0.01, "{gone}");
    for seen in &seen {
        let here = pose(&seen.q(), &TOOL).0;
        assert!((here[1] - from[1]).abs() < 2e-5, "along x and z only");
        assert!((0..3).all(|i| (here[3 + i] - from[3 + i]).abs() < 5e-5), "it does not turn");
        assert!(
            (here[2] - from[2] + (here[0] - from[0]) / 2.0).abs() < 0.002,
            "at the rates' ratio but for ramps"
        );
    }
    consistent(&seen, 3e-3);
    // Rotation about the world's vertical axis: the tool point stays, yaw turns.
    let from = pose(&bench.last().q(), &TOOL).0;
    let seen = jog(&mut bench, 1, [0.0, 0.0, 0.0, 0.0, 0.0, 0.5], 800);
    let here = pose(&seen.last().expect("some").q(), &TOOL).0;
    assert!((0..3).all(|i| (here[i] - from[i]).abs() < 2e-5), "{here:?} {from:?}");
    assert!(here[5] - from[5] > 0.015 && (here[4] - from[4]).abs() < 5e-5);
}

#[test]
fn the_tool_moves_along_its_own_axes() {
    let mut bench = Bench::new();
    let from = pose(&bench.last().q(), &TOOL).0;
    let axis = [from[4].cos() * from[5].cos(), from[4].cos() * from[5].sin(), from[4].sin()];
    let seen = jog(&mut bench, 2, [0.0, 0.0, 0.08, 0.0, 0.0, 0.0], 800);
    let end = pose(&seen.last().expect("some").q(), &TOOL).0;
    let gone: [f64; 3] = std::array::from_fn(|i| end[i] - from[i]);
    let way: f64 = (0..3).map(|i| gone[i] * axis[i]).sum();
    assert!(way > 0.004, "{way}");
    assert!((0..3).all(|i| (gone[i] - way * axis[i]).abs() < 2e-5), "{gone:?}");
    // Rotation about the tool's own axis: only the last joint needs to turn, and the tool point stays.
    let from = pose(&bench.last().q(), &TOOL).0;
    let seen = jog(&mut bench, 2, [0.0, 0.0, 0.0, 0.0, 0.0, 0.6], 800);
    let end = pose(&seen.last().expect("some").q(), &TOOL).0;
    assert!((0..3).all(|i| (end[i] - from[i]).abs() < 2e-5));
    assert!((end[3] - from[3]).abs() > 0.02 && (end[4] - from[4]).abs() < 5e-5);
}

#[test]
fn a_jog_ends_before_a_joints_range_does() {
    let mut bench = Bench::at([2.7, 1.0, 0.1, 0.2, -1.1, 0.3]);
    let sequence = bench.jog(0, [1.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let report = bench.until(STOPPED, sequence);
    assert_eq!((report.cause, report.value), (7, 1.0));
    bench.until_mode(0);
    let (here, limit) = (bench.last().q()[0], HIGHEST[0].to_radians());
    assert!(here < limit && here > limit - 0.1, "{here} {limit}");
    // Jogging back needs no reset.
    let back = bench.jog(0, [-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
    bench.until(ACCEPTED, back);
    bench.run(400);
    assert!(bench.last().q()[0] < here);
    // Motions are refused during a jog.
    let refused = bench.motion(MOVE, HOME, fast(Profile::Cosine));
    assert_eq!(bench.until(REFUSED, refused).cause, 16);
    let stop = bench.send(STOP, &[]);
    bench.until(STOPPED, stop);
    assert_eq!((bench.last().mode, bench.last().v()), (0, [0.0; 6]));
}

#[test]
fn a_jog_in_the_world_stops_short_of_the_wrists_singularity() {
    let mut bench = Bench::at([0.1, 1.0, 0.1, 0.0, -0.25, 0.3]);
    // The tool tilts until the wrist is straight.
    let sequence = bench.jog(2, [0.0, 0.0, 0.0, 0.8, 0.8, 0.0]);
    bench.until(ACCEPTED, sequence);
    for _ in 0..12_000 {
        if bench.reports.iter().any(|report| report.kind == STOPPED) {
            break;
        }
        bench.run(1);
    }
    let report = *bench.reports.iter().find(|report| report.kind == STOPPED).expect("it stops");
    assert!([7, 9, 10].contains(&report.cause), "{report:?}");
    bench.until_mode(0);
    assert!(bench.last().q().iter().all(|q| q.is_finite()));
}
