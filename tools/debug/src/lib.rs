// SPDX-License-Identifier: MIT OR Apache-2.0
//! Traces of running programs, and debug sessions on them, as plain data; the crate prints nothing.

mod accuracy;
pub mod console;
pub mod fault;
mod info;
pub mod inputs;
pub mod panes;
pub mod parameters;
pub mod remote;
mod samples;
pub mod session;
pub mod stale_reads;
pub mod system;
mod target;
pub mod trace;
pub mod value;
#[cfg(feature = "tui")]
pub mod view;

/// Matches a name against a pattern in which `*` stands for any number of characters.
fn matches(pattern: &str, name: &str) -> bool {
    let Some((head, rest)) = pattern.split_once('*') else { return pattern == name };
    let Some(mut name) = name.strip_prefix(head) else { return false };
    // Match each part as far left as possible, which leaves the most text for later parts; the last part must match at the end.
    let mut parts = rest.split('*').peekable();
    while let Some(part) = parts.next() {
        if parts.peek().is_none() {
            return name.ends_with(part);
        }
        let Some(at) = name.find(part) else { return false };
        name = &name[at + part.len()..];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn patterns() {
        for (pattern, name, expected) in [
            ("a", "a", true),
            ("a", "ab", false),
            ("*", "", true),
            ("a*", "abc", true),
            ("*c", "abc", true),
            ("a*c", "abc", true),
            ("a*c", "ac", true),
            ("a*b*c", "axxbyyc", true),
            ("a*b*c", "acb", false),
            ("ab*ba", "aba", false),
            ("*ab*", "xaab", true),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }
}
