//! The vector types of a batch: one word, or one truth value, for each lane of a group.

/// Lanes of a group: vectors as wide as the widest hosts', several of them, so that choosing what to do costs little beside
/// doing it.
pub(crate) const LANES: usize = 16;

/// One word of every lane.
pub(crate) type Row = [u32; LANES];

/// A set of lanes.
pub(crate) type Mask = [bool; LANES];
