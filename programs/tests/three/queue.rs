// SPDX-License-Identifier: MIT OR Apache-2.0
//! Queue between communication and kinematic core, filled to its end.

use super::bench::{
    ACCEPTED, Bench, CHECKED, FINISHED, HOME, JOG, MOVE, MotionFields, READY, REFUSED, RESET, STARTED, STOP,
    STOPPED, bits,
};
use takt_programs::three::profile::Profile;

const OUTPUT: u32 = 5;
const LEVEL: u32 = 6;
const TOOL: u32 = 8;
const LIMITS: u32 = 9;
/// Capacity of the queue in items.
const QUEUE: u32 = 32;
const FULL: u32 = 12;

#[test]
fn queue_depth_agrees_in_both_sources() {
    let text =
        |name: &str| takt_programs::THREE.iter().find(|(known, _)| *known == name).expect("the file").1;
    let after = |text: &str, key: &str| -> u32 {
        let (_, rest) = text.split_once(key).unwrap_or_else(|| panic!("no {key}"));
        rest.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
    };
    let (_, items) = text("controller.toml").split_once("name = \"items\"").expect("the FIFO");
    assert_eq!(after(text("packets.s"), "QUEUE ="), QUEUE);
    assert_eq!(after(items, "depth ="), QUEUE);
}

/// Starts a motion of three seconds, with `outputs` outputs that wait for its end.
fn filled(bench: &mut Bench, outputs: u32) -> u32 {
    bench.reports.clear();
    let mut to = HOME;
    to[0] += if bench.last().q()[0] > HOME[0] + 0.2 { 0.0 } else { 0.5 };
    let slow = MotionFields { profile: Profile::Trapezoidal, how: 0, amount: 3.0, flags: 0 };
    let motion = bench.motion(MOVE, to, slow);
    bench.until(STARTED, motion);
    for i in 0..outputs {
        bench.send(OUTPUT, &[1, i & 1]);
    }
    // The host sends four words per tick; the cores need some more.
    bench.run(u64::from(outputs) * 5 / 4 + 40);
    assert!(bench.reports.iter().all(|report| report.kind != REFUSED), "{:?}", bench.reports);
    motion
}

/// Packets of each kind are answered by a full queue; checks and stops, which need no room in it, take effect.
#[test]
fn every_packet_is_answered() {
    let mut bench = Bench::new();
    filled(&mut bench, QUEUE);
    let target = bits(&HOME);
    let motion = |flags: u32| [target.clone(), vec![0, 2, 0, flags]].concat();
    let jog = [vec![0], bits(&[0.1; 6])].concat();
    let limits = bits(&[1.0; 12]);
    for (kind, payload) in [
        (OUTPUT, vec![1, 1]),
        (LEVEL, vec![1, 0]),
        (MOVE, motion(0)),
        (JOG, jog),
        (LIMITS, limits),
        (TOOL, bits(&[0.0; 3])),
    ] {
        let sequence = bench.send(kind, &payload);
        assert_eq!(bench.until(REFUSED, sequence).cause, FULL, "kind {kind}");
    }
    // Checked motions need no room.
    let check = bench.send(MOVE, &motion(2));
    assert_eq!(bench.until(CHECKED, check).cause, 0);
    let stop = bench.send(STOP, &[]);
    assert_eq!(bench.until(STOPPED, stop).cause, 0);
    bench.until_mode(0);
    // Operation continues after the stop.
    bench.run(60);
    let output = bench.send(OUTPUT, &[2, 2]);
    bench.until(FINISHED, output);
    assert_eq!(bench.output("outputs"), 2, "what waited before the stop was dropped");

    filled(&mut bench, QUEUE);
    let reset = bench.send(RESET, &[]);
    bench.until(READY, reset);
    let output = bench.send(OUTPUT, &[1, 1]);
    bench.until(FINISHED, output);
    assert_eq!(bench.output("outputs"), 3);
}

/// Limits take two items, which are accepted or refused together.
#[test]
fn limits_need_room_for_both_halves() {
    let mut bench = Bench::new();
    filled(&mut bench, QUEUE - 1);
    let limits = bits(&[1.0; 12]);
    let refused = bench.send(LIMITS, &limits);
    assert_eq!(bench.until(REFUSED, refused).cause, FULL);
    // Single items still fit.
    let output = bench.send(OUTPUT, &[2, 2]);
    bench.run(60);
    assert!(bench.reports.iter().all(|report| report.sequence != output), "{:?}", bench.reports);
    let stop = bench.send(STOP, &[]);
    bench.until(STOPPED, stop);
    bench.until_mode(0);
    filled(&mut bench, QUEUE - 2);
    let taken = bench.send(LIMITS, &limits);
    bench.until(ACCEPTED, taken);
    assert_eq!(bench.overflows(), 0);
}

/// A motion planned while outputs wait begins where the robot stands: after power-up, and after a stop during a motion.
#[test]
fn a_motion_behind_an_output_begins_where_the_robot_stands() {
    let mut bench = Bench::new();
    let mut to = HOME;
    for round in 0..2 {
        bench.reports.clear();
        let output = bench.send(OUTPUT, &[1, round & 1]);
        to[0] += 0.02;
        let how = MotionFields { profile: Profile::Cosine, how: 0, amount: 0.3, flags: 0 };
        let motion = bench.motion(MOVE, to, how);
        bench.until(FINISHED, output);
        bench.until(STARTED, motion);
        if round == 0 {
            bench.run(1000);
            let stop = bench.send(STOP, &[]);
            bench.until(STOPPED, stop);
            bench.until_mode(0);
        } else {
            bench.until(FINISHED, motion);
        }
        assert!(bench.reports.iter().all(|report| report.cause == 0), "{:?}", bench.reports);
        let seen = bench.since(motion);
        let steps = seen.windows(2).map(|pair| (pair[1].q()[0] - pair[0].q()[0]).abs());
        assert!(steps.fold(0.0, f64::max) < 2e-4, "it jumps");
    }
    assert!((bench.last().q()[0] - to[0]).abs() < 1e-6);
}
