// SPDX-License-Identifier: MIT OR Apache-2.0
//! The known name nearest to a misspelt one.

use crate::limits;

/// The candidate most like a misspelt name, if one is near enough to be meant.
pub fn nearest<'n>(name: &str, candidates: impl IntoIterator<Item = &'n str>) -> Option<String> {
    let length = name.chars().count();
    let allowed = match length {
        0 => return None,
        // Comparison takes quadratic time, and long names are seldom typed.
        length if length > limits::COMPARED_CHARACTERS => return None,
        1..=4 => 1,
        5..=8 => 2,
        _ => 3,
    };
    let mut best: Option<(usize, &str)> = None;
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
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate.to_owned())
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
        assert_eq!(nearest("completely_different"), None);
    }
}
