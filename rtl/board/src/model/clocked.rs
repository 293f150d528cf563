// SPDX-License-Identifier: MIT OR Apache-2.0
//! The trait of all models, and how they read their inputs.

/// A behavioural model, a cycle at a time.
pub trait Model {
    /// The values on its outputs, in the order of [`Kind::ports`](crate::Kind::ports).
    fn outputs(&self) -> Vec<u32>;

    /// Takes the clock's edge, with the values on its inputs, in the order of [`Kind::ports`](crate::Kind::ports).
    fn clock(&mut self, inputs: &[u32]);
}

/// True if a signal is high.
pub(super) fn high(inputs: &[u32], at: usize) -> bool {
    inputs.get(at).is_some_and(|&value| value != 0)
}

/// A signal of 32 bits.
pub(super) fn word(inputs: &[u32], at: usize) -> u32 {
    inputs.get(at).copied().unwrap_or(0)
}
