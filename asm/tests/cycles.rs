// SPDX-License-Identifier: MIT OR Apache-2.0
//! The cycles of this repository's programs on the machines, measured: no change makes them longer unseen. The one table of such
//! figures in tests; documents have theirs from `cargo xtask docs`.

use crate::common;
use std::path::Path;
use takt_asm::{Contract, FileLoader, Options, Search};
use takt_isa::{Machine, T1, T3, T4};

/// Cycles of the block at the label `period`, or else of the longest.
fn cycles(folder: &str, name: &str, machine: &'static Machine, contract: Contract) -> u32 {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../programs");
    let loader = Search::new(FileLoader::new(root.join(folder))).folder(root.join("library"));
    let assembled = takt_asm::assemble(name, &loader, &Options { contract, ..common::options(machine) });
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let period = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    let longest = assembled.blocks.iter().map(|block| block.cycles).max();
    period.map(|block| block.cycles).or(longest).expect("it has a scheduled block")
}

#[test]
fn programs_take_no_longer() {
    let written = Contract::AsWritten;
    let figures = [
        ("hybrid", "tracking.s", &T3, written, 112),
        ("hybrid", "tracking_literal.s", &T3, written, 275),
        ("hybrid", "tracking_literal.s", &T1, written, 873),
        ("hybrid", "tracking.s", &T1, written, 314),
        ("hybrid", "tracking.s", &T4, Contract::All, 79),
        ("hybrid", "tracking_friction.s", &T3, written, 257),
        ("hybrid", "tracking_friction.s", &T1, written, 658),
        ("arm", "forward.s", &T3, written, 96),
        ("arm", "inverse.s", &T3, written, 190),
        ("examples", "kalman.s", &T4, Contract::All, 89),
    ];
    for (folder, name, machine, contract, most) in figures {
        let found = cycles(folder, name, machine, contract);
        assert!(found <= most, "{name} on {}: {found} cycles, {most} before", machine.name);
    }
}
