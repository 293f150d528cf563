//! What a user reads who makes a mistake: every `mistakes/err_*.s` with the errors that it gets, as a snapshot.

mod common;

use takt_asm::diag::Severity;

#[test]
fn every_mistake_is_explained() {
    let sources = common::sources("mistakes", "err_");
    assert!(sources.len() >= 35, "sources went missing: {}", sources.len());
    for (name, machine) in sources {
        let Err(report) = common::assemble_file("mistakes", &name, machine) else {
            panic!("{name} is accepted");
        };
        assert!(report.has_errors(), "{name}");
        let text = report.render(false);
        let snapshot = name.trim_end_matches(".s");
        insta::assert_snapshot!(snapshot, text);
        // Colour changes nothing but the colour.
        assert_eq!(without_escapes(&report.render(true)), text, "{name}");
        // Every error has a place, but for a file that cannot be read at all.
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

#[test]
fn json_says_the_same() {
    let report = common::bad(".reg a\n.period\n fad a, 1, 2 ; é\n/* é */ \n mov a, bé\n", &takt_isa::T3);
    insta::assert_snapshot!("json", report.to_json());
    let messages = report.messages();
    assert!(messages.iter().all(|message| message.severity == Severity::Error));
    assert_eq!(messages.len(), report.list.len());
}

#[test]
fn places_count_characters_and_lines() {
    let report = common::bad("; ä€𝄞\n.reg a\n.period\n\tmov a, b ; ä\n", &takt_isa::T3);
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
