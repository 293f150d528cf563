//! Abstract value of a register or data word: how many periods ago the input was read on which it depends.

use super::{MAX_PERIODS, Periods};

/// No dependence that is known of.
const NEVER: u16 = u16::MAX;
const CAP: u16 = MAX_PERIODS as u16;

/// The dependence of one register or word on one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    /// No dependence is on a read of fewer periods ago: over all ways to here, and all operands.
    least: u16,
    /// On every way to here there is a dependence on a read of at most so many periods ago.
    most: u16,
    /// True if the value may depend on a read of an earlier period.
    lasting: bool,
}

impl Cell {
    /// Independent of the input.
    pub(super) const NONE: Cell = Cell { least: NEVER, most: NEVER, lasting: false };
    /// The input itself.
    pub(super) const INPUT: Cell = Cell { least: 0, most: 0, lasting: false };
    /// Before any way has led here.
    pub(super) const BOTTOM: Cell = Cell { most: 0, ..Cell::NONE };

    /// Joins the dependence of a further operand into that of a result.
    pub(super) fn with(self, operand: Cell) -> Cell {
        Cell {
            least: self.least.min(operand.least),
            most: self.most.min(operand.most),
            lasting: self.lasting || operand.lasting,
        }
    }

    /// Join of two control-flow paths.
    pub(super) fn or(self, other: Cell) -> Cell {
        Cell { most: self.most.max(other.most), ..self.with(other) }
    }

    /// Joins a control dependence: it adds to the possible reads, and nothing to the certain ones.
    pub(super) fn under(self, condition: Cell) -> Cell {
        Cell { most: self.most, ..self.with(condition) }
    }

    /// A value of which nothing is certain.
    pub(super) fn uncertain(self) -> Cell {
        Cell { most: NEVER, ..self }
    }

    /// A period later.
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
