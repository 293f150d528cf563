// SPDX-License-Identifier: MIT OR Apache-2.0
//! Vector types of a batch: one word, or one Boolean, for each lane of a group.

/// Lanes of a group: a multiple of the widest vectors of any host, so that the dispatch of an operation costs little in relation to
/// its execution.
pub(crate) const LANES: usize = 16;

/// One word of every lane.
pub(crate) type Row = [u32; LANES];

/// A set of lanes.
pub(crate) type Mask = [bool; LANES];
