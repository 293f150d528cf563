// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stages: vectors that a program stores; all other vectors become parts of equations.

use super::{Network, Operand, Step};

/// A stored vector, with the steps that are computed inside its equations.
pub(super) struct Stage {
    /// Step whose vector is stored.
    pub(super) root: usize,
    /// By step: its elements are part of the root's equations.
    pub(super) inside: Vec<bool>,
    /// The dense layer among the inside steps, if any.
    pub(super) layer: Option<usize>,
}

/// Stages of a network, in the order of its steps.
pub(super) fn stages(network: &Network) -> Vec<Stage> {
    let uses = network.uses();
    let count = network.steps.len();
    // For each step, the root whose equations contain its elements.
    let mut root: Vec<usize> = (0..count).collect();
    let mut layer: Vec<Option<usize>> = vec![None; count];
    for index in (0..count).rev().filter(|index| uses[*index] > 0) {
        let step = &network.steps[index];
        let is_layer = matches!(step, Step::Dense { .. });
        if index != network.result
            && (is_layer || matches!(step, Step::Each { .. }))
            && let Some(user) = one_root(network, &uses, &root, index)
        {
            let reduces = matches!(network.steps[user], Step::Reduce { .. });
            let fits = if reduces { is_short(step) } else { !is_layer || layer[user].is_none() };
            if fits {
                root[index] = user;
            }
        }
        if is_layer {
            layer[root[index]] = Some(index);
        }
    }
    let kept = (1..count).filter(|index| uses[*index] > 0 && root[*index] == *index);
    kept.map(|kept| {
        let inside = (0..count).map(|index| uses[index] > 0 && root[index] == kept).collect();
        Stage { root: kept, inside, layer: layer[kept] }
    })
    .collect()
}

/// Root of the only stage that reads a step's vector, if it reads element by element.
fn one_root(network: &Network, uses: &[u32], root: &[usize], index: usize) -> Option<usize> {
    let length = network.lengths[index];
    let mut found = None;
    for user in (index + 1..network.steps.len()).filter(|user| uses[*user] > 0) {
        let reads = match &network.steps[user] {
            Step::Each { operands, .. } => {
                let mine = operands.iter().filter(|operand| operand.vector() == Some(index));
                let whole = Operand::Vector { vector: index, first: 0 };
                let mut mine =
                    mine.map(|operand| *operand == whole && network.lengths[user] == length).peekable();
                mine.peek().is_some().then(|| mine.all(|whole| whole))
            }
            Step::Reduce { vector, .. } => (*vector == index).then_some(true),
            other => other.reads().contains(&index).then_some(false),
        };
        match reads {
            None => {}
            Some(true) if found.is_none_or(|root_before| root_before == root[user]) => {
                found = Some(root[user])
            }
            Some(_) => return None,
        }
    }
    // Only the reduction itself can read the terms of its sum.
    found.filter(|user| !matches!(network.steps[*user], Step::Reduce { vector, .. } if vector != index))
}

/// The step may be a term of a sum: no macro, no layer, no array of its own.
fn is_short(step: &Step) -> bool {
    match step {
        Step::Each { function, parameters, operands } => {
            let has_array = |operand: &Operand| operand.vector().is_none() && operand.uniform().is_none();
            !function.is_long(parameters) && !operands.iter().any(has_array)
        }
        _ => false,
    }
}
