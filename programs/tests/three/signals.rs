// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tracking of inputs, and a kinematic core that misses its periods.

use super::bench::{Bench, READY, STOPPED, TICK, description};
use takt_system::System;

/// Ticks per communication period.
const PERIOD: u64 = 16;

#[test]
fn analogue_inputs_are_smoothed_over_four_periods() {
    let mut bench = Bench::new();
    bench.input("analogue1", 1f32.to_bits());
    bench.input("analogue2", (-8f32).to_bits());
    let mut seen = vec![[0f32; 2]];
    for _ in 0..12 * PERIOD {
        bench.run(1);
        let now = ["smooth1", "smooth2"].map(|name| f32::from_bits(bench.output(name)));
        if seen.last() != Some(&now) {
            seen.push(now);
        }
    }
    // First-order filter: each period reduces the difference by a quarter.
    for (period, pair) in seen.windows(2).enumerate() {
        let [expected1, expected2] = [1f32, -8.0].map(|goal| [goal, goal * 0.75f32.powi(period as i32)]);
        for ([goal, missing], (before, now)) in
            [expected1, expected2].into_iter().zip(pair[0].into_iter().zip(pair[1]))
        {
            assert!((goal - before - missing).abs() < 1e-6 * goal.abs(), "{seen:?}");
            assert!((goal - now - 0.75 * missing).abs() < 1e-6 * goal.abs(), "{seen:?}");
        }
    }
    assert!(seen.len() >= 11, "{seen:?}");
}

#[test]
fn a_digital_input_counts_once_it_has_stood_for_two_periods() {
    let mut bench = Bench::new();
    let mut tracked = |bits: u32, ticks: u64| {
        bench.input("inputs", bits);
        let mut seen = Vec::new();
        for _ in 0..ticks {
            bench.run(1);
            seen.push(bench.output("tracked"));
        }
        seen
    };
    // Bit 1 bounces within a period; bit 0 stays.
    assert!(tracked(0b11, PERIOD).iter().all(|bits| *bits == 0));
    let seen = tracked(0b01, 3 * PERIOD);
    assert_eq!(seen.last(), Some(&1));
    assert!(seen.iter().all(|bits| bits & 0b10 == 0), "{seen:?}");
    assert!(
        tracked(0b10, PERIOD / 2).iter().all(|bits| *bits == 1),
        "what has stood stays until the other has"
    );
    assert_eq!(tracked(0b10, 3 * PERIOD).last(), Some(&0b10));
}

/// A kinematic core that ticks a quarter as often misses half of the requested periods.
#[test]
fn a_kinematic_core_behind_its_time_is_an_error() {
    let mut description = description().clone();
    description.cores[1].every *= 4;
    let reports = description.link_named("reports").expect("the FIFO");
    let mut system = System::new(&description).expect("the programs fit their machines");
    let start = system.run_to_start(200_000).expect("no fault").expect("it starts");
    let mut told = Vec::new();
    for tick in 0..8 * PERIOD {
        system.run_until(start + tick * TICK).expect("no fault");
        told.extend(system.pop(reports).expect("a FIFO").map(|report| [report[0], report[2]]));
    }
    assert_eq!(told, [[READY, 0], [STOPPED, 17]]);
}
