// SPDX-License-Identifier: MIT OR Apache-2.0
//! The straight runs of a program: control enters one at its first bundle only, and leaves it after its last only.

use crate::ir::Ir;
use takt_isa::Effect;
use takt_isa::program::Space;

/// A straight run of bundles: control enters at the first only, and leaves after the last only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    /// Index of the first bundle.
    pub(crate) start: usize,
    /// Index of the bundle after the last.
    pub(crate) end: usize,
    /// The scheduler may move the bundles.
    pub(crate) scheduled: bool,
}

/// Cuts the program into runs: at labels, at heads of loops and at bundles that are jumped to by number, at the period's start,
/// after redirections, and around immovable bundles.
pub(crate) fn runs(ir: &Ir) -> Vec<Run> {
    let count = ir.bundles.len();
    let mut cut = vec![false; count + 1];
    cut[(ir.period as usize).min(count)] = true;
    for label in ir.labels.iter().filter(|label| label.space == Space::Code) {
        if let Some(cut) = cut.get_mut(label.position as usize) {
            *cut = true;
        }
    }
    for bound in &ir.loop_bounds {
        cut[bound.position as usize] = true;
    }
    let mut before = ir.bundles.first().is_some_and(|bundle| bundle.scheduled);
    let has_raw = !ir.raw.is_empty();
    for (i, bundle) in ir.bundles.iter().enumerate() {
        // The status register sees every operation before and none after: a fence.
        let (mut is_wall, mut redirects) = (has_raw && bundle.is_opaque(), false);
        for operation in &bundle.operations {
            let effect = operation.row().effect;
            is_wall |= matches!(effect, Effect::ReadFlags | Effect::ClearFlags);
            redirects |= effect.redirects();
            if let Some(cut) = operation.target_number().and_then(|address| cut.get_mut(address as usize)) {
                *cut = true;
            }
        }
        cut[i] |= is_wall || bundle.scheduled != before;
        cut[i + 1] |= is_wall || redirects;
        before = bundle.scheduled;
    }
    let mut runs = Vec::new();
    let mut start = 0;
    for (end, cut) in cut.into_iter().enumerate().skip(1) {
        if cut || end == count {
            runs.push(Run { start, end, scheduled: ir.bundles[start].scheduled });
            start = end;
        }
    }
    runs
}

/// A target is a number, so every bundle must keep its address.
pub(crate) fn jumps_to_numbers(ir: &Ir) -> bool {
    ir.operations().any(|operation| operation.target_number().is_some())
}
