// SPDX-License-Identifier: MIT OR Apache-2.0
//! Vector types of a batch: one word, or one Boolean, for each lane of a group.

/// Number of lanes in a group: a multiple of the widest vectors of any host, so that the dispatch of an operation costs little in relation
/// to its execution.
pub(crate) const LANES: usize = 16;

/// Vector with one word of every lane.
pub(crate) type Row = [u32; LANES];

/// Set of lanes, one Boolean each.
pub(crate) type Mask = [bool; LANES];
