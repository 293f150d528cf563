// SPDX-License-Identifier: MIT OR Apache-2.0
//! Upper limits on the cycles of this repository's programs on the machines, so that no change lengthens them unnoticed. No other
//! test has a table of such figures; documents get theirs from `cargo xtask docs`.

use crate::common;
use std::path::Path;
use takt_asm::{Contract, FileLoader, Options, Search};
use takt_isa::{Machine, T1, T3, T4};

/// Cycles of the block at the label `period`, or else of the longest block.
fn cycles(folder: &str, name: &str, machine: &'static Machine, contract: Contract) -> u32 {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../programs");
    let loader = Search::new(FileLoader::new(root.join(folder))).folder(root.join("library"));
    let assembled = takt_asm::assemble(name, &loader, &Options { contract, ..common::options(machine) });
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let period = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    let longest = assembled.blocks.iter().map(|block| block.cycles).max();
    period.map(|block| block.cycles).or(longest).expect("it has a scheduled block")
}

/// A separate test for each figure, so that an increase fails only that test.
macro_rules! no_longer {
    ($($name:ident: $folder:literal $file:literal $machine:ident $contract:ident $most:literal;)*) => {$(
        #[test]
        fn $name() {
            let found = cycles($folder, $file, &$machine, Contract::$contract);
            assert!(found <= $most, "{} on {}: {found} cycles, {} before", $file, $machine.name, $most);
        }
    )*};
}

no_longer! {
    tracking_on_t3: "hybrid" "tracking.s" T3 AsWritten 112;
    tracking_literal_on_t3: "hybrid" "tracking_literal.s" T3 AsWritten 275;
    tracking_literal_on_t1: "hybrid" "tracking_literal.s" T1 AsWritten 873;
    tracking_on_t1: "hybrid" "tracking.s" T1 AsWritten 314;
    tracking_on_t4: "hybrid" "tracking.s" T4 All 79;
    tracking_friction_on_t3: "hybrid" "tracking_friction.s" T3 AsWritten 257;
    tracking_friction_on_t1: "hybrid" "tracking_friction.s" T1 AsWritten 658;
    forward_on_t3: "arm" "forward.s" T3 AsWritten 96;
    inverse_on_t3: "arm" "inverse.s" T3 AsWritten 190;
    kalman_on_t4: "examples" "kalman.s" T4 All 89;
}
