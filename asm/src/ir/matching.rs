// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bipartite matching of a bundle's operations to slots.

use takt_isa::spec::check::MAX_SLOTS;
use takt_isa::{SlotIndex, Slots};

/// A set of operations for which there are too few slots.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Conflict {
    /// The operations, by index, ascending.
    pub(crate) operations: Vec<usize>,
    /// Slots that can take at least one of the operations.
    pub(crate) slots: Slots,
}

/// A slot for each operation, given the slots that can take it, no slot twice. The result is the lexicographically first: the
/// first operation gets the first slot that it can have, then the second, and so on.
///
/// # Errors
/// If there is no such matching: the operations in conflict, of which the last is the first that finds no slot.
pub(crate) fn assign(sets: &[Slots]) -> Result<Vec<SlotIndex>, Conflict> {
    let mut owner = [None; MAX_SLOTS];
    for index in 0..sets.len() {
        let mut seen = Slots::default();
        if !place(sets, index, &mut owner, &mut seen) {
            let mut operations: Vec<usize> =
                seen.iter().filter_map(|slot| owner[slot.index()]).chain([index]).collect();
            operations.sort_unstable();
            return Err(Conflict { operations, slots: seen });
        }
    }
    // Give each operation in turn the first slot that leaves a matching for the rest.
    let mut fixed = sets.to_vec();
    for index in 0..fixed.len() {
        let all = fixed[index];
        for slot in all.iter() {
            fixed[index] = Slots::of(slot);
            if is_possible(&fixed) {
                break;
            }
        }
    }
    Ok(fixed.iter().filter_map(|set| set.first()).collect())
}

/// A matching gives every operation a slot.
pub(crate) fn is_possible(sets: &[Slots]) -> bool {
    let mut owner = [None; MAX_SLOTS];
    (0..sets.len()).all(|index| place(sets, index, &mut owner, &mut Slots::default()))
}

/// Enumerates assignments of slots to operations, up to `most`.
pub(crate) fn all(sets: &[Slots], most: usize) -> Vec<Vec<SlotIndex>> {
    let mut found = Vec::new();
    extend(sets, &mut Vec::new(), most, &mut found);
    found
}

fn extend(sets: &[Slots], chosen: &mut Vec<SlotIndex>, most: usize, found: &mut Vec<Vec<SlotIndex>>) {
    let Some(set) = sets.get(chosen.len()) else {
        found.push(chosen.clone());
        return;
    };
    for slot in set.iter() {
        if found.len() < most && !chosen.contains(&slot) {
            chosen.push(slot);
            extend(sets, chosen, most, found);
            chosen.pop();
        }
    }
}

/// Finds an augmenting path: a slot for an operation, moving others if need be. `seen` collects the slots that were tried.
fn place(sets: &[Slots], index: usize, owner: &mut [Option<usize>; MAX_SLOTS], seen: &mut Slots) -> bool {
    for slot in sets[index].iter() {
        if seen.contains(slot) {
            continue;
        }
        *seen = seen.or(Slots::of(slot));
        let before = owner[slot.index()];
        if before.is_none_or(|other| place(sets, other, owner, seen)) {
            owner[slot.index()] = Some(index);
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slot(digit: char) -> SlotIndex {
        digit.to_digit(10).and_then(|digit| SlotIndex::new(digit as usize)).expect("it is below 8")
    }

    fn sets(text: &[&str]) -> Vec<Slots> {
        text.iter().map(|set| set.chars().map(slot).collect()).collect()
    }

    fn slots(text: &str) -> Result<Vec<SlotIndex>, Conflict> {
        Ok(text.chars().map(slot).collect())
    }

    #[test]
    fn finds_the_first_assignment_by_moving_earlier_ones() {
        assert_eq!(assign(&sets(&["01", "0"])), slots("10"));
        assert_eq!(assign(&sets(&["012", "01", "0"])), slots("210"));
        assert_eq!(assign(&sets(&["12", "012", "01"])), slots("120"));
        assert_eq!(assign(&[]), slots(""));
    }

    #[test]
    fn conflict_names_exactly_the_blocking_operations() {
        let conflict = |operations: &[usize], slots: &str| {
            Err(Conflict { operations: operations.to_vec(), slots: sets(&[slots])[0] })
        };
        assert_eq!(assign(&sets(&["2", "1", "1"])), conflict(&[1, 2], "1"));
        assert_eq!(assign(&sets(&["0", "12", "12", "12"])), conflict(&[1, 2, 3], "12"));
        assert_eq!(assign(&sets(&["0", ""])), conflict(&[1], ""));
    }

    /// Compares with exhaustive search.
    #[test]
    fn assignments_and_conflicts_are_right() {
        for code in 0..1u32 << 12 {
            let able = |i: u8| {
                let takes = |slot: &SlotIndex| code >> (3 * i + slot.get()) & 1 == 1;
                SlotIndex::all().take(3).filter(takes).collect()
            };
            let sets: Vec<Slots> = (0..4).map(able).collect();
            for sets in [&sets[..3], &sets[..]] {
                let every = all(sets, usize::MAX);
                assert_eq!(is_possible(sets), !every.is_empty());
                match assign(sets) {
                    Ok(slots) => assert_eq!(Some(&slots), every.first()),
                    Err(Conflict { operations, slots }) => {
                        assert!(every.is_empty());
                        assert_eq!(operations.len(), slots.len() + 1);
                        assert!(operations.iter().all(|index| sets[*index].is_within(slots)));
                    }
                }
            }
        }
    }
}
