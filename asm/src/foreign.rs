// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files that are neither source nor image, recognised by their names and first bytes, so that one error says so instead of hundreds about
//! their lines.

use crate::Directive;
use crate::expand::load::is_source;

/// Kinds of files: extensions, name of the kind, and the command that takes such a file, `{}` being its name.
const KINDS: &[(&[&str], &str, &str)] = &[
    (&["takt"], "an image that is damaged in its first bytes", "`takt asm PROGRAM.s` writes it again"),
    (&["csv", "tsv"], "a table", "`takt run PROGRAM.s --inputs {}` reads it as inputs"),
    (&["urdf", "xml", "onnx", "fpcore"], "a model", "`takt model {}` makes a program of it"),
    (&["json"], "JSON", "`takt model {}` makes a program of expressions or of a control problem"),
    (&["c"], "C", "`takt cc {}` makes a program of it"),
    (&["fmu"], "a plant", "`takt run PROGRAM.s --plant {}` closes the loop with it"),
    (&["ngc", "nc", "gcode"], "G-code", "`takt track --gcode {}` follows it"),
    (&["md", "rst", "html", "pdf"], "a document", ""),
    (&["v", "sv", "vhd", "vhdl"], "a circuit", ""),
    (&["py", "rs", "cpp", "js", "m", "lua"], "a program in another language", ""),
    (&["svg", "png", "vcd"], "a picture or a trace", ""),
];

/// First bytes of formats that no source begins with.
const BEGINNINGS: &[(&[u8], &str)] = &[
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1f\x8b", "compressed by gzip"),
    (b"\x89PNG", "a picture"),
    (b"\xff\xd8\xff", "a picture"),
    (b"%PDF", "a document in PDF"),
    (b"\0asm", "WebAssembly"),
    (b"<", "XML or HTML"),
];

/// Directives of GNU's assembler that Takt lacks, with which its sources begin.
const GNU: [&str; 9] = [
    ".text",
    ".globl",
    ".global",
    ".section",
    ".type",
    ".cfi_startproc",
    ".intel_syntax",
    ".syntax",
    ".option",
];

/// A source that is GNU assembly for another processor: it has one of [`GNU`], and no directive that only Takt has.
fn is_gnu(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let mut words =
        text.lines().filter_map(|line| line.split_whitespace().next()).filter(|word| word.starts_with('.'));
    let own = [
        Directive::Period,
        Directive::Once,
        Directive::Input,
        Directive::Output,
        Directive::Reg,
        Directive::Schedule,
    ];
    words.clone().any(|word| GNU.contains(&word))
        && !words.any(|word| own.iter().any(|own| own.name() == word))
}

/// Kind of a file that is neither source nor image, and the command that takes it, `{}` being its name; `None` if it may be a source.
pub(crate) fn kind(name: &str, bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
    let by_name = KINDS
        .iter()
        .find(|(endings, ..)| extension.as_deref().is_some_and(|extension| endings.contains(&extension)));
    match by_name {
        Some((_, kind, command)) => Some((kind, command)),
        None => {
            let beginning = BEGINNINGS.iter().find(|(first, _)| bytes.starts_with(first));
            // The assembler has better words for a source with a byte that is none of a text.
            let by_contents = || match is_source(name) {
                true => is_gnu(bytes).then_some("GNU assembly for another processor"),
                false => bytes.contains(&0).then_some("binary data"),
            };
            Some((beginning.map(|(_, kind)| *kind).or_else(by_contents)?, ""))
        }
    }
}

/// Says what a file seems to be that is neither source nor image, and what to do; `None` if it may be a source.
pub fn foreign(name: &str, bytes: &[u8]) -> Option<String> {
    let (kind, command) = kind(name, bytes)?;
    let command = command.replace("{}", name);
    let then = if command.is_empty() { command } else { format!("; {command}") };
    Some(format!(
        "{name} is no program: it seems to be {kind}; expected a source (.s, .tks) or an image (.takt){then}"
    ))
}

#[cfg(test)]
mod tests {
    use super::foreign;

    #[test]
    fn a_file_that_is_no_program_is_named() {
        let of = |name: &str, bytes: &[u8]| foreign(name, bytes).unwrap_or_default();
        assert!(
            of("a/pi.CSV", b"x\n1\n").ends_with("`takt run PROGRAM.s --inputs a/pi.CSV` reads it as inputs")
        );
        assert!(of("README.md", b"# Takt\n").contains("it seems to be a document; expected a source"));
        assert!(of("pi.takt", b"\x7fELG").contains("an image that is damaged"));
        assert!(of("prog", b"PK\x03\x04").contains("a ZIP archive"));
        assert!(of("standard input", b"<robot>").contains("XML"));
        assert!(of("prog", b"ab\0c").contains("binary data"));
        assert!(of("a.s", b"PK\x03\x04").contains("a ZIP archive"));
        assert!(of("a.s", b"\t.text\n\t.globl f\nf:\tret\n").contains("GNU assembly"));
    }

    #[test]
    fn a_source_is_left_to_the_assembler() {
        for (name, bytes) in [
            ("a.s", &b"\0\0"[..]),
            ("a.s", b".text\n.period\n"),
            ("a.tks", b"nop"),
            ("a.txt", b"nop"),
            ("-", b"; a"),
            ("a.s", b""),
        ] {
            assert_eq!(foreign(name, bytes), None, "{name}");
        }
    }
}
