// SPDX-License-Identifier: MIT OR Apache-2.0
//! Packets from the host: valid ones, and every kind of invalid ones.

use super::bench::{
    Bench, FINISHED, HOME, MOVE, MotionFields, READY, REFUSED, RESET, STARTED, STOPPED, bits, checksum, fast,
    packet,
};
use takt_programs::three::profile::Profile;

#[test]
fn the_checksum_is_zlibs() {
    assert_eq!(checksum(&[0x5400_0000, 1]), 0x100d_d107);
    assert_eq!(checksum(&[0x5404_0000, 2]), 0x9929_3cff);
}

/// Sends words while the robot moves; it must stop for the cause, report it once, refuse further commands, and continue after a reset.
fn stops(bench: &mut Bench, words: &[u32], cause: u32, forward: bool) {
    bench.reports.clear();
    let mut to = HOME;
    to[0] += if forward { 0.3 } else { 0.0 };
    let how = MotionFields { profile: Profile::Trapezoidal, how: 1, amount: 0.5, flags: 0 };
    let motion = bench.motion(MOVE, to, how);
    bench.until(STARTED, motion);
    bench.run(200);
    bench.send_words(words);
    for _ in 0..3000 {
        if bench.reports.iter().any(|report| report.kind == STOPPED) {
            break;
        }
        bench.run(1);
    }
    let stopped: Vec<_> = bench.reports.iter().filter(|report| report.kind == STOPPED).copied().collect();
    assert_eq!(stopped.len(), 1, "{words:x?}: {:?}", bench.reports);
    assert_eq!(stopped[0].cause, cause, "{words:x?}");
    bench.until_mode(4);
    assert_eq!(bench.last().v(), [0.0; 6]);
    // A stopped robot accepts only a reset.
    if cause != 2 {
        let refused = bench.motion(MOVE, HOME, how);
        assert_eq!(bench.until(REFUSED, refused).cause, 13);
    }
    // Resets set the sequence number, whatever it was.
    bench.sequence += 1000;
    let reset = bench.send(RESET, &[]);
    bench.until(READY, reset);
    bench.until_mode(0);
    assert_eq!(bench.reports.iter().filter(|report| report.kind == STOPPED).count(), 1, "{words:x?}");
}

#[test]
fn bad_packets_stop_the_robot() {
    let mut bench = Bench::new();
    // Packets with an inverted bit.
    for (number, word) in [2, 5, 12].into_iter().enumerate() {
        let mut words = packet(MOVE, bench.sequence + 2, &[0; 10]);
        words[word] ^= 1 << (7 * number);
        stops(&mut bench, &words, 1, number % 2 == 0);
    }
    // Missing packet, repeated packet.
    let words = packet(0, bench.sequence + 3, &[]);
    stops(&mut bench, &words, 2, false);
    let words = packet(0, bench.sequence, &[]);
    stops(&mut bench, &words, 2, true);
    // Unknown kind, wrong length for the kind, wrong magic, reserved bits set.
    let kind = packet(10, bench.sequence + 2, &[]);
    stops(&mut bench, &kind, 3, false);
    let length = packet(MOVE, bench.sequence + 2, &[0; 9]);
    stops(&mut bench, &length, 3, true);
    stops(&mut bench, &[0x5500_0000], 3, false);
    stops(&mut bench, &[0x5400_0100], 3, true);
    // Packet without its remaining words.
    stops(&mut bench, &packet(MOVE, 1, &[0; 10])[..4], 4, false);
}

#[test]
fn a_silent_host_stops_the_robot() {
    let mut bench = Bench::new();
    let mut to = HOME;
    to[0] += 1.0;
    let slow = MotionFields { profile: Profile::Trapezoidal, how: 0, amount: 3.0, flags: 0 };
    let motion = bench.motion(MOVE, to, slow);
    bench.until(STARTED, motion);
    // Signs of life keep the robot moving.
    bench.run(6000);
    assert_eq!(bench.last().mode, 1);
    bench.alive = false;
    bench.run(6500);
    let stopped = bench.reports.iter().find(|report| report.kind == STOPPED).expect("it stops");
    assert_eq!(stopped.cause, 5);
    bench.until_mode(4);
    assert!(bench.last().q()[0] < to[0] - 0.2);
}

#[test]
fn rejects_contradictory_demands() {
    let mut bench = Bench::new();
    let good = fast(Profile::Cosine);
    let refused =
        |bench: &mut Bench, target: [f64; 6], how: u32, amount: f64, profile: u32, flags: u32, cause: u32| {
            let mut payload = bits(&target);
            payload.extend([profile, how, (amount as f32).to_bits(), flags]);
            let sequence = bench.send(MOVE, &payload);
            assert_eq!(bench.until(REFUSED, sequence).cause, cause);
        };
    let mut infinite = HOME;
    infinite[4] = f64::INFINITY;
    refused(&mut bench, infinite, good.how, 0.0, 0, 0, 6);
    refused(&mut bench, HOME, 0, 0.0, 0, 0, 6);
    refused(&mut bench, HOME, 0, f64::NAN, 0, 0, 6);
    refused(&mut bench, HOME, 1, -1.0, 0, 0, 6);
    refused(&mut bench, HOME, 0, 1e6, 0, 0, 6);
    refused(&mut bench, HOME, 3, 1.0, 0, 0, 3);
    refused(&mut bench, HOME, 2, 1.0, 4, 0, 3);
    refused(&mut bench, HOME, 2, 1.0, 0, 4, 3);
    // Speed beyond a joint's limit; the report names the joint.
    let mut to = HOME;
    to[0] += 0.5;
    let sequence = bench.motion(MOVE, to, MotionFields { how: 1, amount: 3.5, ..good });
    let report = bench.until(REFUSED, sequence);
    assert_eq!((report.cause, report.value), (10, 1.0));
    let jog = bench.send(3, &[vec![0], bits(&[f64::NAN; 6])].concat());
    assert_eq!(bench.until(REFUSED, jog).cause, 6);
    let jog = bench.send(3, &[vec![3], bits(&[0.0; 6])].concat());
    assert_eq!(bench.until(REFUSED, jog).cause, 3);
    // Refusals are not errors: the next motion runs.
    let mut near = HOME;
    near[5] += 0.01;
    let sequence = bench.motion(MOVE, near, good);
    bench.until(FINISHED, sequence);
}
