// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scheduler stays within its effort for every row and program, measured in steps rather than time.

use crate::common;
use crate::random_source::{Random, source, source_with_loops};
use crate::rows;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, assemble, schedule};
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::{Machine, Slot, Unit};

fn assembled(text: &str, machine: &'static Machine, effort: u32) -> AssembledProgram {
    let options = Options { machine, effort, schedule: Schedule::All, ..Options::default() };
    assemble("effort.s", &MemoryLoader::of("effort.s", text), &options)
        .unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)))
}

/// Asserts that the steps of a program are no more than the effort allows. Returns them.
#[track_caller]
fn keeps_to(effort: u32, assembled: &AssembledProgram, what: &str) -> u64 {
    let operations = assembled.blocks.iter().map(|block| u64::from(block.operations)).sum();
    let most = schedule::most_steps(effort, operations);
    assert!(assembled.steps <= most, "{} steps at effort {effort}, {most} allowed\n{what}", assembled.steps);
    assembled.steps
}

/// A row with other latencies and intervals: short and long ones, up to the longest.
fn slower(row: &Machine, below: &mut impl FnMut(u64) -> u64) -> &'static Machine {
    let mut cycles = |usual: u32| match below(3) {
        0 => usual,
        1 => 1 + below(8) as u32,
        _ => 1 + below(u64::from(MAX_LATENCY) - 1) as u32,
    };
    let mut slot = |slot: &Slot| {
        // The sequencer, which alone writes no register, has no latency.
        let units = slot.units.iter().map(|unit| match unit.latency {
            0 => *unit,
            latency => Unit { latency: cycles(latency), interval: cycles(unit.interval), cuts: &[], ..*unit },
        });
        Slot { units: Vec::leak(units.collect()), ..*slot }
    };
    let slots: Vec<Slot> = row.slots.iter().map(&mut slot).collect();
    let machine = Machine { name: "slower", slots: Vec::leak(slots), ..*row };
    assert_eq!(machine.error(), None);
    Box::leak(Box::new(machine))
}

#[test]
fn long_latencies_keep_to_the_effort() {
    let machine = takt_asm::machine::read("long_latencies.toml", include_str!("long_latencies.toml"));
    let machine = machine.unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
    let text = include_str!("long_latencies.s");
    for effort in [0, 1, 2] {
        keeps_to(effort, &assembled(text, machine, effort), "");
    }
}

#[test]
fn random_rows_keep_to_the_effort() {
    let random = &mut Random::new(907);
    for seed in 0..common::programs(2, 24) {
        let row = rows::random(|n| random.below(n));
        let machine = slower(row, &mut |n| random.below(n));
        let text = if seed % 2 == 0 { source_with_loops(seed) } else { source(seed) }.replace(" || ", "\n ");
        for effort in [0, 1] {
            keeps_to(effort, &assembled(&text, machine, effort), &format!("{text}\n{}", machine.to_toml()));
        }
    }
}

/// Many blocks that no search finishes share one pool of steps.
#[test]
fn blocks_share_the_effort() {
    let random = &mut Random::new(908);
    let row = slower(rows::named("second_adder"), &mut |n| random.below(n));
    let text = |blocks: u64| {
        let mut text = String::from(".input x, y\n.output z\n.reg a b c d\n.period\nperiod:\n");
        for block in 0..blocks {
            text += &format!(
                " fadd a, x, y\n fadd b, x, x\n fmul c, a, b\n fadd d, c, y\n fadd a, d, b\n fadd z, a, c\n bz x, l{block}\nl{block}:\n"
            );
        }
        text + " wait period\n"
    };
    let [few, many] = [8, 120].map(|blocks| keeps_to(1, &assembled(&text(blocks), row, 1), "blocks"));
    // With a budget for each block, these would take fifteen times as many.
    assert!(many < 12 * few, "{few} steps for 8 blocks, {many} for 120");
}
