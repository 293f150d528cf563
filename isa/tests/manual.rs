// SPDX-License-Identifier: MIT OR Apache-2.0
//! The manual, as text: a change of the specification shows here as a change of the manual.

#[test]
fn machines_as_text() {
    insta::assert_snapshot!(takt_isa::manual::machines_text());
}

#[test]
fn one_entry() {
    let manual = takt_isa::manual::manual();
    let entry = manual.instructions.iter().find(|entry| entry.mnemonic == "fdiv").expect("fdiv is a row");
    insta::assert_snapshot!(takt_isa::manual::entry_text(entry));
}
