// SPDX-License-Identifier: MIT OR Apache-2.0
//! Records that the loader writes into the cores in reset, after clearing their memories.

use super::SystemPlan;
use crate::export::DesignFile;
use std::fmt::Write as _;
use takt_isa::load::{LoadRecord, Space, load_records};
use takt_isa::system::{Description, Mailbox};

/// A record, with the index of its core.
pub(super) type Record = (usize, LoadRecord);

/// Programs, data, presets and initial values of input ports. Zeros of cleared memories are left out.
pub(super) fn records(description: &Description, mailboxes: &[Vec<Mailbox>]) -> Vec<Record> {
    let mut records = Vec::new();
    for (number, core) in description.cores.iter().enumerate() {
        let cleared =
            |record: &LoadRecord| matches!(record.space, Space::Program | Space::Data) && record.value == 0;
        let loaded = load_records(&core.program).into_iter().filter(|record| !cleared(record));
        records.extend(loaded.map(|record| (number, record)));
        let machine = core.program.machine;
        for mailbox in mailboxes.get(number).into_iter().flatten() {
            let Some(index) = machine.inputs.index(mailbox.register) else { continue };
            let value = description.initial(mailbox.source).into();
            records.push((number, LoadRecord { space: Space::Input, slot: 0, address: index.get(), value }));
        }
    }
    records
}

/// Text of the records for `$readmemh`, padded to `count` by repeating the last record.
pub(super) fn file(plan: &SystemPlan, records: &[Record], count: usize) -> DesignFile {
    let mut text =
        String::from("// {core, space, slot, address, value}: what takt_loader writes into the cores\n");
    let more = records.last().into_iter().cycle().take(count.saturating_sub(records.len()));
    for &(core, LoadRecord { space, slot, address, value }) in records.iter().chain(more) {
        let place = (core as u128) << 5 | (space as u128) << 3 | u128::from(slot);
        let word = place << 64 | u128::from(address) << 48 | u128::from(value);
        let _ = writeln!(text, "{word:019x}");
    }
    DesignFile { name: format!("{}.hex", plan.top), text }
}
