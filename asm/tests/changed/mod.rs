// SPDX-License-Identifier: MIT OR Apache-2.0
//! Right texts with one change, for tests of mistakes; shared with other crates' tests.

/// Text with the first `from` replaced by `to`. A test whose text has lost `from` would test nothing: it fails.
#[track_caller]
pub(crate) fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the text has no `{from}`");
    text.replacen(from, to, 1)
}
