// SPDX-License-Identifier: MIT OR Apache-2.0
//! Positions in the source's order, by which debuggers find the value of a name.

use std::num::NonZeroU32;

/// The position of a line in the source, macros and repetitions written out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Index in source order, macros and repetitions written out.
    pub order: u32,
    /// Number of the scope, plus 1: an `Option` of a position then takes no more room.
    scope: NonZeroU32,
}

impl Position {
    /// The position `order` in source order, in a use of a macro, `scope`: an index into
    /// [`Names::scopes`](crate::names::Names::scopes), below 2³² - 1.
    pub const fn new(order: u32, scope: u32) -> Position {
        Position { order, scope: NonZeroU32::MIN.saturating_add(scope) }
    }

    /// The use of a macro: an index into [`Names::scopes`](crate::names::Names::scopes).
    pub const fn scope(self) -> u32 {
        self.scope.get() - 1
    }
}

impl Default for Position {
    fn default() -> Position {
        Position::new(0, 0)
    }
}
