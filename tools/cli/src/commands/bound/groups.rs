// SPDX-License-Identifier: MIT OR Apache-2.0
//! Grouping of similar paths through a system, and conversion of cycles to time, for tables.

use takt_isa::timing::Cycle;

/// Time for a number of cycles at a clock in MHz.
pub(crate) fn microseconds(cycles: Cycle, clock: f64) -> String {
    format!("{:.3} µs", cycles as f64 / clock)
}

/// Number of names shown from a long list.
const SHOWN: usize = 3;

/// List of names, abbreviated if long.
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        many if many.len() > SHOWN => format!("{}, … ({})", many[..SHOWN].join(", "), many.len()),
        few => few.join(", "),
    }
}

/// Functions for one end of a group: access the names, and merge those of another group.
type Side<G> = (fn(&G) -> &Vec<String>, fn(&mut G, G));

/// Groups paths that differ only in the names of their ends: within a group, every head has a path to every tail.
pub(crate) fn grouped<G>(
    ways: impl Iterator<Item = G>,
    alike: impl Fn(&G, &G) -> bool,
    (heads, with_heads): Side<G>,
    (tails, with_tails): Side<G>,
) -> Vec<G> {
    let merged = |groups: Vec<G>, same: fn(&G) -> &Vec<String>, with: fn(&mut G, G)| {
        let mut merged: Vec<G> = Vec::new();
        for group in groups {
            match merged.iter_mut().find(|other| alike(other, &group) && same(other) == same(&group)) {
                Some(other) => with(other, group),
                None => merged.push(group),
            }
        }
        merged
    };
    // Merge groups with equal heads first, then groups with equal tails.
    merged(merged(ways.collect(), heads, with_tails), tails, with_heads)
}
