// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnosis of invalid rows for readers of files: the faulty part of the row, and the mend.

use super::check::{LAST, MAX_LOOPS, MAX_SLOTS, MachineReason};
use super::instructions::Function;
use super::row::RowPlace;
use crate::number::Register;

impl MachineReason {
    /// The faulty part of the row.
    pub fn place(&self) -> RowPlace<'static> {
        use MachineReason::*;
        match *self {
            Slots { .. } | NoSequencer => RowPlace::Slots,
            Name { what: "slot", name } | Twice { what: "slot", name } => RowPlace::Slot(name),
            Name { what: "bank", name } | Twice { name, .. } => RowPlace::Bank(name),
            Name { .. } => RowPlace::Name,
            BankName { bank }
            | BankDepth { bank, .. }
            | RegisterSpace { bank, .. }
            | Overlap { bank, .. }
            | Zero { bank, .. } => RowPlace::Bank(bank),
            Outputs { .. } => RowPlace::Field("outputs_per_bank"),
            Depth { what, .. } | Wait { what, .. } => RowPlace::Field(what),
            Latency { slot, unit, .. }
            | NoLatency { slot, unit }
            | IdleLatency { slot, unit, .. }
            | Interval { slot, unit, .. }
            | Idle { slot, unit }
            | NoFunction { slot, unit }
            | TwoUnits { slot, unit, .. } => RowPlace::Unit(slot, unit),
            LoopDepth { .. } => RowPlace::Field("loop_depth"),
            TwoSlots { slot, .. } | Ports { slot } | LoadAfterStore { slot, .. } => RowPlace::Slot(slot),
        }
    }

    /// Advice on mending the row.
    pub fn mend(&self) -> String {
        use MachineReason::*;
        match self {
            Slots { count: 0 } => {
                "each `[[slot]]` is an operation of a bundle, with a bank and units".to_owned()
            }
            Slots { count } => {
                format!("leave out {} of them, and put their units into others", *count as usize - MAX_SLOTS)
            }
            Name { .. } => "another name".to_owned(),
            BankName { .. } => "letters only: its registers are called by it and a number".to_owned(),
            Twice { what, .. } => format!("rename one {what}"),
            BankDepth { most, .. } => format!("a depth of 1 to {most}; circuits have powers of two"),
            RegisterSpace { .. } => format!("all banks together have the registers 0 to {LAST}"),
            Overlap { other, end, .. } => {
                format!("bank `{other}` goes on to {}: begin at {end} or behind", end - 1)
            }
            Zero { .. } => {
                format!(
                    "the inputs' `base` and `depth` are {} together: the bank is the last",
                    Register::COUNT
                )
            }
            Outputs { depth, .. } => {
                format!("1 to {depth} here; circuits have powers of two up to half a bank")
            }
            Depth { most, .. } => format!("1 to {most}; circuits have powers of two"),
            Wait { what: "refill", .. } => "circuits have 6".to_owned(),
            Wait { .. } => "circuits have 2".to_owned(),
            Latency { .. } | Interval { .. } | NoLatency { .. } | IdleLatency { .. } => {
                "leave it out: the unit's own cycles are those of its circuit".to_owned()
            }
            Idle { .. } => "leave out `idle`".to_owned(),
            NoFunction { .. } => {
                "leave out the unit, or `functions`: then it offers all of its own".to_owned()
            }
            TwoUnits { unit, other, function, .. } => format!(
                "leave one of them out, move one to another slot, or say which functions `{unit}` or `{other}` has here, without \
                 `{}`: `{{ unit = \"{unit}\", functions = […] }}`",
                function.name().to_lowercase()
            ),
            NoSequencer => "`\"sequencer\"` in the `units` of one slot".to_owned(),
            LoopDepth { counts: false, .. } => {
                "`loop_depth = 0`, or a sequencer with `functions = [\"control\", \"loop\"]`".to_owned()
            }
            LoopDepth { counts: true, .. } => {
                format!("`loop_depth = 4`, or another depth of 1 to {MAX_LOOPS}")
            }
            TwoSlots { function: Function::Store, .. } => {
                "a second port of the data memory only loads: `{ unit = \"memory\", functions = [\"load\"] }`"
                    .to_owned()
            }
            TwoSlots { .. } => "leave the sequencer out of one of them".to_owned(),
            Ports { slot } => format!("leave the memory out of slot `{slot}`"),
            LoadAfterStore { slot, store } => format!("place slot `{slot}` before slot `{store}`"),
        }
    }
}
