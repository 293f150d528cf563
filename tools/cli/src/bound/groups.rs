// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ways in groups that are alike, and cycles as time, for tables.

use takt_isa::timing::Cycle;

/// Cycles as a time.
pub(crate) fn microseconds(cycles: Cycle, clock: f64) -> String {
    format!("{:.3} µs", cycles as f64 / clock)
}

/// Names that are shown of a list with many.
const SHOWN: usize = 3;

/// Names one after the other, of many the first ones.
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        many if many.len() > SHOWN => format!("{}, … ({})", many[..SHOWN].join(", "), many.len()),
        few => few.join(", "),
    }
}

/// The name of one end, or the merging of another group's ends of that side into one's own.
type Side<G> = (fn(&G) -> &Vec<String>, fn(&mut G, G));

/// Groups of ways that are alike but for the names of their ends: each of one group's heads leads to each of its tails.
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
    // First the tails of the same heads, then the heads of the same tails.
    merged(merged(ways.collect(), heads, with_tails), tails, with_heads)
}
