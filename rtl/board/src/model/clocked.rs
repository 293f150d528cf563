// SPDX-License-Identifier: MIT OR Apache-2.0
//! The trait of all models, and the functions with which models read their inputs.

/// A behavioural model, which runs a cycle at a time.
pub trait Model {
    /// The values on the model's outputs, in the order of [`Kind::ports`](crate::Kind::ports).
    fn outputs(&self) -> Vec<u32>;

    /// Takes the effects of inputs that wait for no clock, given as for [`clock`](Model::clock). Few models have such inputs.
    fn settle(&mut self, _inputs: &[u32]) {}

    /// Takes the clock's edge, with the values on the model's inputs, in the order of [`Kind::ports`](crate::Kind::ports).
    fn clock(&mut self, inputs: &[u32]);
}

/// The signal at index `at` is high; a missing signal is low.
pub(super) fn high(inputs: &[u32], at: usize) -> bool {
    inputs.get(at).is_some_and(|&value| value != 0)
}

/// Signal of 32 bits at index `at`; a missing signal is 0.
pub(super) fn word(inputs: &[u32], at: usize) -> u32 {
    inputs.get(at).copied().unwrap_or(0)
}
