// SPDX-License-Identifier: MIT OR Apache-2.0
//! An error with its causes as one line.

use std::error::Error;

/// Text of an error with its causes, on one line. A cause that the text of its parent repeats appears once, and numbers of system errors are
/// removed.
pub fn describe(error: &(dyn Error + 'static)) -> String {
    let (mut text, mut next) = (String::new(), Some(error));
    while let Some(error) = next {
        let cause = error.to_string();
        if !text.contains(&cause) {
            let colon = if text.is_empty() { "" } else { ": " };
            text.push_str(colon);
            text.push_str(&cause);
        }
        next = error.source();
    }
    while let Some((before, after)) =
        text.split_once(" (os error ").map(|(a, b)| (a.to_owned(), b.to_owned()))
    {
        let rest = after.split_once(')').map_or("", |(_, rest)| rest);
        text = before + rest;
    }
    text
}
