// SPDX-License-Identifier: MIT OR Apache-2.0
//! Texts from outside: control characters, and line ends of other systems.

use crate::common::{bad, good};
use takt_asm::{MemoryLoader, Options, assemble, disasm, format, image, listing, names, tokens};
use takt_isa::F3;
use takt_isa::text::is_hidden;

/// Sets the title of a terminal, clears it, goes back to the line's beginning; the same in one character, and a change of direction.
const COMMANDS: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m\u{202e}";

#[track_caller]
fn assert_visible(text: &str) {
    assert!(!text.contains(is_hidden), "{text:?}");
}

#[test]
fn diagnostics_escape_terminal_commands() {
    let name = format!("a{COMMANDS}b.s");
    let text = format!(
        ".output y\n.period\n.error \"{COMMANDS}\" ; {COMMANDS}\np:\tmov \"{COMMANDS}\" y, nothing ; {COMMANDS}\n mov y, \u{9b}x\n wait q\n"
    );
    let report = assemble(&name, &MemoryLoader::of(&name, text), &Options::default()).unwrap_err();
    for text in [report.render(false), report.render(true).replace("\u{1b}[", "").replace("\u{1b}", "?")] {
        assert_visible(&text);
    }
    let shown = report.render(false);
    assert!(shown.contains("┌─ a\\u001b]0;owned\\u0007\\u001b[2J\\u009b31m\\u202eb.s:3:1\n"), "{shown}");
    assert!(shown.contains("error[user]: \\u001b]0;owned"), "{shown}");
    // Columns count the characters of the source; the caret stands under the shown text.
    let text = format!(".output y\n.period\np: ;{COMMANDS}\n wait q ; {COMMANDS}\n.error \"\u{1b}\" 3\n");
    let report = bad(&text, &F3).render(false);
    let lines: Vec<&str> = report.lines().collect();
    let quoted = lines.iter().position(|line| line.ends_with(".error \"\\u001b\" 3")).expect("it is quoted");
    let column = lines[quoted].chars().count() - 1;
    assert_eq!(lines[quoted + 1].chars().position(|c| c == '^'), Some(column), "{report}");
    assert!(report.contains("test.s:5:12\n"), "{report}");
}

#[test]
fn listings_and_disassembly_escape_terminal_commands() {
    let text = format!(
        ".output y\n.period\n.loc \"x\\u001b]0;owned\\u0007.s\" 3\np: mov y, 1 ; {COMMANDS}\n.loc \"other.s\" 1\n wait p\n"
    );
    let assembled = good(&text);
    assert_eq!(assembled.program.files[0], "x\u{1b}]0;owned\u{7}.s");
    let again = disasm::disassemble(&assembled.program);
    assert_visible(&again);
    assert!(again.contains("\"x\\u001b]0;owned\\u0007.s\""), "{again}");
    assert_eq!(good(&again).program, assembled.program);
    // A `u` without a code stays a `u`.
    assert_eq!(good(&text.replace("\\u001b]0;owned\\u0007", "\\u12\\ux")).program.files[0], "xu12ux.s");
    let text = format!(".output y\n.period\np: mov y, 1 ; {COMMANDS}\n wait p ; {COMMANDS}\n");
    let listing = listing::listing(&good(&text));
    assert_visible(&listing);
    assert!(listing.contains("p: mov y, 1 ; \\u001b]0;owned"), "{listing}");
}

/// A source of an old Mac begins with a comment that ends at its first carriage return.
#[test]
fn lone_carriage_returns_end_lines() {
    let lines = [
        "; old",
        ".input x",
        ".output y",
        ".const K = 2 ; c",
        ".period",
        "p: fmul y, x, K ||",
        "   nop",
        " wait p",
        "",
    ];
    let unix = good(&lines.join("\n"));
    for end in ["\r", "\r\n"] {
        let text = lines.join(end);
        let other = good(&text);
        assert_eq!(other.program, unix.program);
        assert_eq!(listing::listing(&other), listing::listing(&unix));
        assert_eq!(tokens::lines(&text).len(), lines.len());
        let broken = text.replace("x, K", "x, L").replace("wait p", "wait q");
        let places: Vec<(usize, usize)> = bad(&broken, &F3)
            .messages()
            .iter()
            .map(|message| (message.places[0].line, message.places[0].column))
            .collect();
        assert_eq!(places, [(2, 8), (6, 15), (8, 7)][1..], "{end:?}");
        let shown = bad(&broken, &F3).render(false);
        assert!(!shown.contains('\r') && shown.contains("8 │  wait q\n"), "{shown}");
    }
    let old = lines.join("\r");
    assert_eq!(format::format(&old), format::format(&lines.join("\n")));
    // Mixed line ends, as an editor leaves them; and invalid bytes, which are reported in the right line.
    assert_eq!(good(&old.replacen('\r', "\n", 3)).program, unix.program);
    let mut bytes = old.clone().into_bytes();
    bytes[8] = 0xff;
    let report = assemble("t.s", &MemoryLoader::of("t.s", bytes), &Options::default()).unwrap_err();
    assert!(report.render(false).contains("line 2, byte 3 of the line"), "{}", report.render(false));
    // A debugger's source has the lines that the program names.
    let assembled = good(&old);
    let written = image::write_with(&assembled.program, Some(&assembled.debug_info())).expect("it fits");
    let names::DebugInfo { sources, .. } =
        image::read_with(&written).expect("it was written").1.expect("it is there");
    assert_eq!(sources[0].1.lines().nth(7), Some(" wait p"));
}
