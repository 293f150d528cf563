// SPDX-License-Identifier: MIT OR Apache-2.0
//! Messages for a user's mistakes: every `mistakes/err_*.s` with the errors that it gets, as a snapshot.

use crate::common;
use takt_asm::diag::{Diagnostics, Severity};
use takt_asm::levels::{LevelSetting, WARNINGS};
use takt_asm::{MemoryLoader, Options};

#[test]
fn every_mistake_is_explained() {
    let sources = common::sources("mistakes", "err_");
    assert!(sources.len() >= 35, "sources went missing: {}", sources.len());
    for (name, machine) in sources {
        let Err(report) = common::assemble_file("mistakes", &name, machine) else {
            panic!("{name} is accepted");
        };
        assert!(report.has_errors(), "{name}");
        let text = report.render_all(false);
        let snapshot = name.trim_end_matches(".s");
        insta::assert_snapshot!(snapshot, text);
        // Colour changes nothing but the colour.
        assert_eq!(without_escapes(&report.render_all(true)), text, "{name}");
        // Every error has a place, except for a file that cannot be read at all.
        for message in report.messages() {
            let place =
                message.places.first().unwrap_or_else(|| panic!("{name}: no place: {}", message.message));
            assert!(place.line > 0 && place.column > 0, "{name}");
        }
    }
}

#[test]
fn warnings_do_not_stop() {
    for (name, machine) in common::sources("mistakes", "warn_") {
        let assembled = match common::assemble_file("mistakes", &name, machine) {
            Ok(assembled) => assembled,
            Err(report) => panic!("{}", report.render(false)),
        };
        assert!(!assembled.warnings.has_errors());
        insta::assert_snapshot!(name.trim_end_matches(".s"), assembled.warnings.render(false));
    }
}

/// Options choose the level of warnings, not their number.
#[test]
fn warnings_can_be_errors_or_nothing() {
    let text = "; machine f3\n.input x, n:int\n.output F\n.reg a\n.once\n wait p\n.period\np: fadd F, x, n\n wait p\n";
    let assemble = |wishes: &[&str]| {
        let levels = wishes.iter().map(|wish| wish.parse::<LevelSetting>().expect("it is one")).collect();
        let options = Options { levels, ..common::options(&takt_isa::F3) };
        takt_asm::assemble("test.s", &MemoryLoader::of("test.s", text), &options)
    };
    let codes = |report: &Diagnostics| {
        report.list.iter().map(|d| (d.severity, d.code)).collect::<Vec<(Severity, &str)>>()
    };
    use Severity::{Error, Warning};
    let warned = |wishes: &[&str]| codes(&assemble(wishes).expect("there are warnings only").warnings);
    let failed = |wishes: &[&str]| codes(&assemble(wishes).expect_err("a warning is an error"));
    assert_eq!(warned(&[]), [(Warning, "unused"), (Warning, "types")]);
    assert_eq!(warned(&["allow=types"]), [(Warning, "unused")]);
    assert_eq!(failed(&["error"]), [(Error, "unused"), (Error, "types")]);
    assert_eq!(failed(&["error=types"]), [(Warning, "unused"), (Error, "types")]);
    assert_eq!(failed(&["error", "allow=unused"]), [(Error, "types")]);
    assert_eq!(warned(&["error", "allow=unused", "allow=types"]), []);
    // Beyond the shown diagnostics, a warning that counts as an error is counted as one.
    let many = format!("{text}.reg {}\n", (0..150).map(|i| format!("r{i} ")).collect::<String>());
    let levels = ["error=unused".parse::<LevelSetting>().expect("it is one")].into_iter().collect();
    let options = Options { levels, ..common::options(&takt_isa::F3) };
    let report = takt_asm::assemble("test.s", &MemoryLoader::of("test.s", many), &options);
    let report = report.expect_err("a warning is an error");
    assert_eq!((report.list.len(), report.more_errors, report.more_warnings), (100, 52, 0));
}

/// The list of warnings and the manual's table.
#[test]
fn the_documentation_lists_every_warning() {
    let document = include_str!("../../docs/language.md");
    for (name, about) in WARNINGS {
        assert!(document.contains(&format!("| `{name}` | {about}")), "{name}");
    }
}

#[test]
fn json_equals_the_text() {
    let report = common::bad(".reg a\n.period\n fad a, 1, 2 ; é\n/* é */ \n mov a, bé\n", &takt_isa::F3);
    insta::assert_snapshot!("json", report.to_json());
    let messages = report.messages();
    assert!(messages.iter().all(|message| message.severity == Severity::Error));
    assert_eq!(messages.len(), report.list.len());
}

#[test]
fn places_count_characters_and_lines() {
    let report = common::bad("; ä€𝄞\n.reg a\n.period\n\tmov a, b ; ä\n", &takt_isa::F3);
    let message = &report.messages()[0];
    let place = &message.places[0];
    assert_eq!((place.file.as_str(), place.line, place.column), ("test.s", 4, 9));
    assert_eq!((place.end_line, place.end_column), (4, 10));
}

fn without_escapes(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find('\u{1b}') {
        out.push_str(&rest[..start]);
        let end = rest[start..].find('m').map_or(rest.len(), |end| start + end + 1);
        rest = &rest[end..];
    }
    out + rest
}
