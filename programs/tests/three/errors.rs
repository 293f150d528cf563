// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks during motion, the queue, signals.

use super::bench::{
    ACCEPTED, Bench, FINISHED, HOME, JOG, MOVE, MotionFields, READY, REFUSED, RESET, STARTED, STOP, STOPPED,
    apart, bits, fast,
};
use takt_programs::three::profile::Profile;

const SLOW: MotionFields = MotionFields { profile: Profile::Parabolic, how: 0, amount: 0.2, flags: 0 };

fn near(by: f64) -> [f64; 6] {
    let mut to = HOME;
    to[5] += by;
    to
}

#[test]
fn a_queue_that_runs_dry_is_reported() {
    let mut bench = Bench::new();
    let sequence = bench.motion(MOVE, near(0.2), MotionFields { flags: 1, amount: 0.4, ..SLOW });
    let report = bench.until(STOPPED, sequence);
    assert_eq!(report.cause, 15);
    bench.until_mode(0);
    assert!(apart(&bench.last().q(), &near(0.2)) < 1e-6, "it stands where it should have gone on");
    let sequence = bench.motion(MOVE, near(0.0), SLOW);
    bench.until(FINISHED, sequence);
}

#[test]
fn a_joint_that_does_not_follow_stops_the_robot() {
    let mut bench = Bench::new();
    bench.motion(MOVE, near(0.5), fast(Profile::Cosine));
    bench.block(true);
    let report = bench.until(STOPPED, 1);
    assert_eq!((report.cause, report.value), (14, 6.0));
    bench.until_mode(4);
    let reset = bench.send(RESET, &[]);
    bench.until(READY, reset);
    bench.until_mode(0);
    // The reset has set the reference to the joints' position.
    bench.run(40);
    assert!(apart(&bench.last().q(), &HOME) < 3e-5, "{:?}", bench.last().q());
    assert_eq!(
        bench.reports.iter().filter(|report| report.kind == STOPPED).count(),
        1,
        "{:?}",
        bench.reports
    );
}

#[test]
fn outputs_wait_for_their_turn() {
    let mut bench = Bench::new();
    let first = bench.motion(MOVE, near(0.2), SLOW);
    let output = bench.send(5, &[0b110, 0b010]);
    let level = bench.send(6, &[2, 0.75f32.to_bits()]);
    let second = bench.motion(MOVE, near(0.0), SLOW);
    bench.until(STARTED, first);
    assert_eq!(bench.output("outputs"), 0);
    bench.until(FINISHED, output);
    assert_eq!(bench.output("outputs"), 0b010);
    bench.until(FINISHED, level);
    assert_eq!(f32::from_bits(bench.output("level2")), 0.75);
    bench.until(FINISHED, second);
    let order: Vec<(u32, u32)> = bench.reports.iter().map(|report| (report.kind, report.sequence)).collect();
    let place = |what| order.iter().position(|seen| *seen == what).expect("it was reported");
    assert!(place((FINISHED, first)) < place((FINISHED, output)));
    assert!(place((FINISHED, level)) < place((STARTED, second)));
}

#[test]
fn a_full_queue_refuses_and_a_stop_empties_it() {
    let mut bench = Bench::new();
    let mut first = None;
    for number in 0..40 {
        let sequence = bench.motion(
            MOVE,
            near(if number % 2 == 0 { 0.1 } else { 0.0 }),
            MotionFields { amount: 5.0, ..SLOW },
        );
        first = first.or(Some(sequence));
        bench.run(20);
    }
    bench.run(100);
    let refused: Vec<_> = bench.reports.iter().filter(|report| report.kind == REFUSED).collect();
    assert!(refused.len() >= 6 && refused.iter().all(|report| report.cause == 12), "{refused:?}");
    // Requests for a jog are refused while the queue is full.
    let jog = bench.send(JOG, &[vec![0], bits(&[0.1; 6])].concat());
    assert_eq!(bench.until(REFUSED, jog).cause, 12);
    let stop = bench.send(STOP, &[]);
    assert_eq!(bench.until(STOPPED, stop).cause, 0);
    bench.run(400);
    assert_eq!(bench.last().mode, 0);
    let started = bench.reports.iter().filter(|report| report.kind == STARTED).count();
    assert_eq!(started, 1, "nothing of the queue has run after the stop");
    let jog = bench.send(JOG, &[vec![0], bits(&[0.1; 6])].concat());
    bench.until(ACCEPTED, jog);
    // At a standstill, a stop is answered at once.
    let stop = bench.send(STOP, &[]);
    bench.until(STOPPED, stop);
    let stop = bench.send(STOP, &[]);
    bench.until(STOPPED, stop);
}
