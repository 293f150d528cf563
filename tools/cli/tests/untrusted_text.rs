// SPDX-License-Identifier: MIT OR Apache-2.0
//! Untrusted text in the output of `takt`: terminal control sequences are escaped, and generated files stay well-formed.

use crate::common::{Folder, RunOutput};
use takt_isa::text::is_hidden;

/// Control sequences that set a terminal's title and clear its screen.
const COMMANDS: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m";

const PROGRAM: &str = ".input x\n.output y\n.period\np: fadd y, x, 1.0\n wait p\n";

#[track_caller]
fn shown(done: RunOutput) -> String {
    let text = done.stdout + &done.stderr;
    assert!(!text.contains(is_hidden), "{text:?}");
    assert!(text.contains("\\u001b]0;owned\\u0007\\u001b[2J\\u009b31m"), "{text}");
    text
}

/// Sources, tables, systems and commands with mistakes.
#[test]
fn mistakes_are_quoted_as_text() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM);
    folder.write("evil.s", format!("{PROGRAM} mov z, {COMMANDS}1\n"));
    shown(folder.line("asm evil.s"));
    folder.write("in.csv", format!("x\n{COMMANDS}\n"));
    shown(folder.line("run p.s --inputs in.csv"));
    folder.write("system.toml", format!("tick = \"{COMMANDS}\"\n"));
    shown(folder.line("run system.toml"));
    folder.write("system.toml", format!("tick = 1 {COMMANDS}\n"));
    shown(folder.line("run system.toml"));
    shown(folder.takt(&["run", &format!("no{COMMANDS}.s")]));
    shown(folder.fed("debug p.s", format!("{COMMANDS}\n").as_bytes()));
    // Only takt's own colours pass; other sequences are escaped.
    let coloured = folder.line("--color always asm evil.s").stderr;
    assert!(coloured.contains("\u{1b}[0m"));
    let rest: String =
        coloured.split('\u{1b}').map(|part| part.split_once('m').map_or(part, |(_, rest)| rest)).collect();
    assert!(!rest.contains(is_hidden) && coloured.contains("]0;owned\\u0007"), "{coloured:?}");
}

/// Valid inputs with such text: listings, the debugger, images of others, file names.
#[test]
fn results_are_text() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM.replace("1.0", &format!("1.0 ; {COMMANDS}")));
    shown(folder.line("asm p.s --listing - -o p.takt"));
    shown(folder.fed("debug p.s", b"step\nlist\n"));
    shown(folder.fed("debug p.takt", b"step\nlist\n"));
    folder.write(
        "loc.s",
        PROGRAM.replace("p: ", ".loc \"f\\u001b]0;owned\\u0007\\u001b[2J\\u009b31m.s\" 3\np: "),
    );
    folder.line("asm loc.s -o loc.takt").ok();
    shown(folder.line("disasm loc.takt"));
    shown(folder.line("analyse loc.takt"));
    let name = format!("n{COMMANDS}.s");
    folder.write(&name, PROGRAM);
    shown(folder.takt(&["asm", &name]));
    shown(folder.takt(&["analyse", &name]));
    // The contents of a file, written to standard output, are not escaped.
    let source = format!("; {COMMANDS}\n{PROGRAM}");
    let done = folder.fed("fmt -", source.as_bytes());
    assert!(done.ok().starts_with(&format!("; {COMMANDS}\n")));
    // JSON decodes to the original text.
    let json = folder.takt(&["analyse", &name, "--json"]).ok();
    assert!(!json.contains(is_hidden));
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(value.to_string().contains("owned"), "{json}");
}

/// A name never extends beyond its comment line, in headers and in circuits.
#[test]
fn names_stay_in_their_comments() {
    let folder = Folder::new();
    let stem = "a\nint injected;\n#error \u{2028}b";
    folder.write(format!("{stem}.s"), PROGRAM);
    for language in ["c", "rust", "svd"] {
        let text = folder.takt(&["asm", &format!("{stem}.s"), "--header", language]).ok();
        assert!(text.contains("a\\nint injected;\\n#error \\u2028b"), "{language}: {text}");
        assert!(
            !text.lines().any(|line| line.starts_with("int injected") || line.starts_with("#error")),
            "{text}"
        );
    }
}

/// Browsers end a script at `</script>`, so the data must contain neither that nor `<!--`.
#[test]
fn names_leave_pages_whole() {
    let folder = Folder::new();
    let name = "<!--<script>.s";
    folder.write(name, PROGRAM);
    folder.takt(&["analyse", name, "--html", "page.html"]);
    let page = folder.read_text("page.html");
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    let (data, _) = data.split_once("</script>").unwrap();
    assert!(!data.contains('<'), "{data}");
    let value: serde_json::Value = serde_json::from_str(data).unwrap();
    assert!(value.to_string().contains(name), "{data}");
}

/// A carriage return alone ends a line of a source.
#[test]
fn sources_of_old_macs_are_read() {
    let folder = Folder::new();
    folder.write("old.s", format!("; comment\n{PROGRAM}").replace('\n', "\r"));
    let done = folder.line("asm old.s");
    assert_eq!(done.status, Some(0), "{done:?}");
    assert!(folder.line("disasm old.takt").ok().contains("fadd"));
}
