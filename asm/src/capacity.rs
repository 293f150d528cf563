// SPDX-License-Identifier: MIT OR Apache-2.0
//! Help for a program that does not fit: the machine's option that makes room, and the block RAMs that it takes.

use takt_isa::Machine;
use takt_isa::memory::KBIT_18;
use takt_isa::spec::check::{MAX_CODE, MAX_DATA};

fn blocks(count: u64) -> String {
    format!("{count} block RAM{}", if count == 1 { "" } else { "s" })
}

/// Advice to set the option that makes the program memory hold `bundles` bundles.
pub(crate) fn for_bundles(machine: &'static Machine, bundles: usize) -> String {
    match machine.holding(bundles as u64, machine.data_depth.into()) {
        Some(larger) => format!(
            "`{}` makes room for it: {} for program memory in place of {}",
            larger.directive(),
            blocks(larger.code_block_rams(&KBIT_18)),
            machine.code_block_rams(&KBIT_18)
        ),
        None => format!("no machine holds more than {} bundles", MAX_CODE - 1),
    }
}

/// Advice to set the option that makes the data memory hold `words` words.
pub(crate) fn for_words(machine: &'static Machine, words: u64) -> String {
    match machine.holding(1, words) {
        Some(larger) => format!(
            "`{}` makes room for it: {} for data memory in place of {}",
            larger.directive(),
            blocks(larger.data_block_rams(&KBIT_18)),
            machine.data_block_rams(&KBIT_18)
        ),
        None => format!("no machine holds more than {MAX_DATA} words"),
    }
}
