// SPDX-License-Identifier: MIT OR Apache-2.0
//! Abstract value of a register or data word: the age of the input that it depends on, in periods since the read.

use super::{MAX_PERIODS, Periods};

/// Sentinel age: no dependence (as `least`), or no certain dependence (as `most`).
const NEVER: u16 = u16::MAX;
const CAP: u16 = MAX_PERIODS as u16;

/// Abstract value of one storage place with respect to one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    /// Least age of a read on which the value may depend, over all paths and operands.
    least: u16,
    /// Certain age: on every path, the value depends on a read at most this old.
    most: u16,
    /// The value may depend on a read of an earlier period.
    lasting: bool,
}

impl Cell {
    /// Independent of the input.
    pub(super) const NONE: Cell = Cell { least: NEVER, most: NEVER, lasting: false };
    /// Value of the input port itself, read in this period.
    pub(super) const INPUT: Cell = Cell { least: 0, most: 0, lasting: false };
    /// Bottom element: the value of a place that no path has reached so far. Joining it changes nothing.
    pub(super) const BOTTOM: Cell = Cell { most: 0, ..Cell::NONE };

    /// Combines the operands of an operation: a certain dependence of one operand is certain for the result, hence the minimum.
    pub(super) fn with(self, operand: Cell) -> Cell {
        Cell {
            least: self.least.min(operand.least),
            most: self.most.min(operand.most),
            lasting: self.lasting || operand.lasting,
        }
    }

    /// Joins two control-flow paths: a dependence is certain only if it is certain on both, hence the maximum.
    pub(super) fn or(self, other: Cell) -> Cell {
        Cell { most: self.most.max(other.most), ..self.with(other) }
    }

    /// Joins a control dependence: it adds possible reads, and no certain ones.
    pub(super) fn under(self, condition: Cell) -> Cell {
        Cell { most: self.most, ..self.with(condition) }
    }

    /// Drops the certain dependence and keeps the possible ones.
    pub(super) fn uncertain(self) -> Cell {
        Cell { most: NEVER, ..self }
    }

    /// Ages the value by one period.
    pub(super) fn later(self) -> Cell {
        let least = if self.least == NEVER { NEVER } else { (self.least + 1).min(CAP) };
        let most = if self.most >= CAP { NEVER } else { self.most + 1 };
        Cell { least, most, lasting: least != NEVER }
    }

    pub(super) fn periods(self) -> Option<Periods> {
        (self.least != NEVER).then(|| Periods {
            least: self.least.into(),
            most: (self.most != NEVER).then(|| self.most.into()),
            lasting: self.lasting,
        })
    }
}

const _: () = assert!(MAX_PERIODS < NEVER as u32);
