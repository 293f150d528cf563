// SPDX-License-Identifier: MIT OR Apache-2.0
//! The known name nearest to a misspelt one.

use crate::limits;
use std::cmp::Ordering;

/// The candidate most like a misspelt name, if one is near enough to be meant.
pub fn nearest<'n>(name: &str, candidates: impl IntoIterator<Item = &'n str>) -> Option<String> {
    all_nearest(name, candidates).first().map(|nearest| (*nearest).to_owned())
}

/// All candidates that are similar enough to be the intended name and equally near to it, in their order.
pub fn all_nearest<'n>(name: &str, candidates: impl IntoIterator<Item = &'n str>) -> Vec<&'n str> {
    let length = name.chars().count();
    let allowed = match length {
        0 => return Vec::new(),
        // Comparison takes quadratic time, and long names are seldom typed.
        length if length > limits::COMPARED_CHARACTERS => return Vec::new(),
        1..=4 => 1,
        5..=8 => 2,
        _ => 3,
    };
    let mut best: (usize, Vec<&str>) = (usize::MAX, Vec::new());
    for candidate in candidates {
        if candidate.len().abs_diff(name.len()) > allowed || candidate == name {
            continue;
        }
        let mut distance = strsim::osa_distance(name, candidate);
        if candidate.eq_ignore_ascii_case(name) {
            distance = 0;
        }
        // A name of two letters with one wrong shares one letter: it must be the first.
        let same_start = candidate.chars().next() == name.chars().next();
        if distance > allowed || (distance > 0 && distance * 2 > length && !same_start) {
            continue;
        }
        match distance.cmp(&best.0) {
            Ordering::Less => best = (distance, vec![candidate]),
            Ordering::Equal if !best.1.contains(&candidate) => best.1.push(candidate),
            _ => {}
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_suggests_similar_names_only() {
        let names = ["fadd", "fsub", "qprev", "q", "KP", "period"];
        let nearest = |name| nearest(name, names);
        assert_eq!(nearest("fad").as_deref(), Some("fadd"));
        assert_eq!(nearest("kp").as_deref(), Some("KP"));
        assert_eq!(nearest("qperv").as_deref(), Some("qprev"));
        assert_eq!(nearest("perod").as_deref(), Some("period"));
        assert_eq!(nearest("z"), None);
        assert_eq!(all_nearest("qsub", ["fsub", "fadd", "isub"]), ["fsub", "isub"]);
        assert_eq!(nearest("completely_different"), None);
    }
}
