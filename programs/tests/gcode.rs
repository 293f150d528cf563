// SPDX-License-Identifier: MIT OR Apache-2.0
//! G-code reader: accepted programs, errors for the rest, and robustness against any input.

use std::collections::HashSet;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;

use proptest::prelude::*;
use takt_programs::gcode::{self, GcodeErrorKind};
use takt_programs::path::{MoveKind, Path};
use takt_programs::trajectory::Trajectory;

const START: &str = "G0 X0 Y0 Z700\n";

fn read(text: &str) -> gcode::Program {
    gcode::read(&format!("{START}{text}")).expect("a sound program")
}

#[test]
fn numbers_keep_their_binary64_digits() {
    let program = read("G1 X - 12.345678901 y+.5 Z707. F 1234.5");
    let piece = program.moves[0];
    assert_eq!(piece.to.position, [-12.345678901 / 1000.0, 0.0005, 0.707]);
    assert_eq!(piece.feed_m_per_s, 1234.5 / 1000.0 / 60.0);
    assert_eq!((piece.kind, piece.line), (MoveKind::Cut, 2));
}

#[test]
fn state_is_modal() {
    let program =
        read("g01 f600\nX10\n\nY10 (to the corner) A90 ; and tilt\r\nN40 G0 Z720\nX0 G1\nM30\nG20 ???");
    let moves = &program.moves;
    assert_eq!(moves.iter().map(|piece| piece.line).collect::<Vec<_>>(), [3, 5, 6, 7]);
    let kinds = [MoveKind::Cut, MoveKind::Cut, MoveKind::Rapid, MoveKind::Cut];
    assert_eq!(moves.iter().map(|piece| piece.kind).collect::<Vec<_>>(), kinds);
    assert_eq!(moves.iter().map(|p| p.feed_m_per_s).collect::<Vec<_>>(), [0.01, 0.01, 0.2, 0.01]);
    assert_eq!(moves[1].to.angle, [FRAC_PI_2, 0.0]);
    for pair in moves.windows(2) {
        assert_eq!(pair[0].to, pair[1].from);
    }
}

#[test]
fn code_and_words_come_in_any_order() {
    assert_eq!(read("X10 F600 G1").moves, read("G1 X10 F600").moves);
    assert_eq!(read("G21 X10 F600 G90 G1 Y5 G17").moves, read("G1 X10 Y5 F600").moves);
}

#[test]
fn arcs_by_centre_and_by_radius_agree() {
    let arc = |text: &str| match read(&format!("G0 X40 F600\n{text}")).moves[1].path {
        Path::Arc(arc) => arc,
        Path::Line => panic!("not an arc"),
    };
    for (by_centre, by_radius, sweep) in [
        ("G3 X0 Y40 I-40", "G3 X0 Y40 R40", 0.25 * TAU),
        ("G2 X0 Y40 I0 J40", "G2 X0 Y40 R40", -0.25 * TAU),
        ("G2 X0 Y40 I-40", "G2 X0 Y40 R-40", -0.75 * TAU),
        ("G3 X0 Y40 J40", "G3 X0 Y40 R-40", 0.75 * TAU),
    ] {
        let (centre, radius) = (arc(by_centre), arc(by_radius));
        assert!((centre.sweep - sweep).abs() < 1e-12, "{by_centre}: {}", centre.sweep);
        assert!((radius.sweep - sweep).abs() < 1e-12, "{by_radius}: {}", radius.sweep);
        for i in 0..2 {
            assert!((centre.centre[i] - radius.centre[i]).abs() < 1e-12, "{by_radius}");
            assert!((centre.radius[i] - 0.04).abs() < 1e-12, "{by_centre}");
        }
    }
    assert_eq!(arc("G3 I-40").sweep, TAU);
    assert_eq!(arc("G2 X40 Y0 I-40 J0").sweep, -TAU);
}

/// Programs that must be refused, without a preceding start.
const BAD: &[&str] = &[
    "",
    "; only a comment",
    "G21 G90\nF100",
    "G20\nG0 X0 Y0 Z10",
    "G91",
    "G18",
    "G429496730 X1",
    "G1.5",
    "G54.2",
    "G-1",
    "M104 S200",
    "G90.1",
    "G41 D1",
    "G42",
    "G43.1 Z5",
    "G44 H1",
    "G55",
    "G59.3",
    "G10 L2 P1 X0",
    "G92 X0",
    "G28",
    "G53 G0 Z0",
    "G0 X0 Y0 Z700\nG28 Z0",
    "G0 X0 Y0 Z700\nG53 G0 Z0",
    "G0 X0 Y0 Z700\nG91 G28 Z0",
    "G28 G91 Z0\nG0 X0 Y0 Z700",
    "G0 X0 Y0 G28\nG0 Z700",
    "G0 Z700\nG28 Z0\nG0 X0 Y0",
    "G0 Z700\nG1 X1 F100",
    "G68 R45",
    "G81 X1 Z-2 R1",
    "G5 I1 J1",
    "G38.2 Z-1",
    "G93",
    "G95",
    "M0",
    "M98 P100",
    "G0 X0 Y0 Z700\nT2 M6",
    "G4 X1",
    "G4 P1 X1",
    "G0 X0 Y0 Z700 P1",
    "G64 H1",
    "D1",
    "O100 sub",
    "O100 G0",
    "O",
    "*",
    "G80\nX1",
    "G0 X0 Y0 Z700\nG80\nX1",
    "G0 X[1+1]",
    "#1=2",
    "G0 S1 S2 X0 Y0 Z700",
    "%\nG21\n%\nG0 X0 Y0 Z700",
    "G0 X0 Y0 Z700 B90",
    "G0 X0 Y0 Z700\nG1 X1 F100 E0.5",
    "G0 X0 Y0 Z1e3",
    "X1",
    "G1 X0 Y0 Z700 F100",
    "G0 X0 Z700",
    "G0 X0 Y0 Z700\nG1 X1",
    "G0 X0 Y0 Z700\nG1 X1 F0",
    "G0 X0 Y0 Z700\nG1 X1 F-100",
    "G0 X0 Y0 Z700 X1",
    "G0 G1 X0 Y0 Z700",
    "G0 X0 Y0 Z700\nG1 X1 F100 I5",
    "G0 X0 Y0 Z700 F100\nG2 X1",
    "G0 X0 Y0 Z700 F100\nG2 X1 I1 R1",
    "G0 X0 Y0 Z700 F100\nG2 I0 J0",
    "G0 X0 Y0 Z700 F100\nG2 X1 R0",
    "G0 X0 Y0 Z700 F100\nG2 X10 I4.98",
    "G0 X0 Y0 Z700 F100\nG2 X10 R4.98",
    "G0 X0 Y0 Z700 F100\nG2 R4",
    "G0 X0 Y0 Z0",
    "G0 X0 Y0 Z700\nG0 Z-1",
    "G0 X99999999 Y0 Z700",
    "G0 X0 Y0 Z700 A181",
    "G0 X0 Y0 Z700 C-3000000",
    "G0 X123456789 Y0 Z700",
    "G0 X0 Y0 Z700 (open\nG0 X1",
    "G0 X0 Y0 Z700)",
    "G0 X0\rY0 Z700",
    "G",
    "G0 X",
    "G0 Xinf",
    "G0 X1.2.3",
    "G0 X--1",
    "G0 X#1",
    "G0 X0 Y0 Z700 \u{b5}m",
    "G0 12 X0",
    "NaN",
];

#[test]
fn errors_name_the_place_and_the_mend() {
    let mut table = String::new();
    for source in BAD {
        match gcode::read(source) {
            Ok(program) => panic!("{source:?} was accepted: {program:?}"),
            Err(error) => writeln!(table, "{source:?}\n    {error}").expect("a string"),
        }
    }
    insta::assert_snapshot!(table);
}

/// Heads of post-processors, by maker: comments and modes, and moves to positions of the machine itself. Sources: FreeCAD's and Vectric's
/// post-processors; for others, quotations in public repositories.
const HEADS: &str = include_str!("data/heads.txt");

fn heads() -> Vec<(&'static str, &'static str)> {
    HEADS
        .split("\n== ")
        .map(|head| head.trim_start_matches("== "))
        .map(|head| head.split_once('\n').expect("a title"))
        .collect()
}

#[test]
fn heads_of_cam_programs_leave_the_path_as_it_is() {
    let path = "G0 X0 Y0 Z700\nG1 X5 F600\nG3 X0 Y5 I-5\nM5\nM30\n%\n";
    let bare = gcode::read(path).expect("a sound program");
    let key = |program: &gcode::Program| {
        let moves = program.moves.iter().map(|piece| (piece.path, piece.to, piece.feed_m_per_s));
        (program.start, moves.collect::<Vec<_>>())
    };
    let mut notes = String::new();
    for (title, head) in heads() {
        for newline in ["\n", "\r\n"] {
            let text = format!("{head}\n{path}").replace('\n', newline);
            let program = gcode::read(&text).unwrap_or_else(|error| panic!("{title}: {error}"));
            assert_eq!(key(&program), key(&bare), "{title}");
        }
        let before = gcode::read(&format!("{head}\nG0 X0 Y0 Z700\n")).expect("a sound head");
        notes += &format!("{title}: {}\n", before.note().unwrap_or_default());
    }
    let makers: HashSet<&str> =
        heads().iter().map(|(title, _)| title.split(',').next().unwrap_or(title)).collect();
    assert!(heads().len() >= 30 && makers.len() >= 6, "{} heads of {} makers", heads().len(), makers.len());
    insta::assert_snapshot!(notes);
}

#[test]
fn positioning_by_axis_places_the_robot() {
    for start in [
        "G0 Z700\nG0 X0 Y0",
        "G0 Z500\nG43 Z700 H1\nX0 Y0 S3000 M3",
        "G53 G0 Z0\nG0 X0 Y0\nZ700",
        "G0 X0\nG28 X0\nG0 X0 Y0 Z700",
    ] {
        let program =
            gcode::read(&format!("{start}\nG1 X5 F600")).unwrap_or_else(|error| panic!("{start}: {error}"));
        assert_eq!(program.start.position, [0.0, 0.0, 0.7], "{start}");
        assert_eq!(program.moves.len(), 1, "{start}");
    }
}

#[test]
fn lines_with_a_slash_are_carried_out() {
    assert_eq!(read("F600\n/G1 X5\nG1 X3").moves.len(), 2);
}

#[test]
fn text_after_the_second_percent_is_ignored() {
    let program = gcode::read("(before)\n% 1000\nG0 X0 Y0 Z700\n%\nG20 ???").expect("a sound program");
    assert!(program.moves.is_empty());
}

#[test]
fn codes_may_have_a_point() {
    assert_eq!(read("G1. X1 F100").moves, read("G01 X1 F100").moves);
    assert_eq!(read("G1.0 X1 F100").moves, read("G1 X1 F100").moves);
}

#[test]
fn the_document_lists_every_code() {
    crate::common::check_table("docs/readers.md", "gcode", &gcode::reference());
}

#[test]
fn bytes_that_are_no_text_are_located() {
    let error = gcode::read_bytes(b"G0 X0\nY\xff").expect_err("not UTF-8");
    assert_eq!((error.line, error.column, error.kind), (2, 2, GcodeErrorKind::NotUtf8));
    assert!(gcode::read_bytes(b"\xef\xbb\xbfG0 X0 Y0 Z700\r\n").is_ok());
}

#[test]
fn long_inputs_take_linear_time() {
    // A quadratic reader would exceed any time limit.
    let n = 300_000;
    for hostile in [
        "(".repeat(n),
        "()".repeat(n),
        "G".repeat(n),
        "G1".repeat(n),
        "X1 ".repeat(n),
        "1".repeat(n),
        "-".repeat(n),
        " ".repeat(n),
        "\n".repeat(n),
        ";\n".repeat(n),
        "\u{b5}".repeat(n),
        format!("G0 X0.{}1 Y0 Z700", "0".repeat(n)),
        format!("{START}{}", "X1\nX0\n".repeat(n)),
    ] {
        let _ = gcode::read(&hostile);
    }
}

/// Reads a text; plans and samples an accepted program.
fn exercise(source: &str) {
    if let Ok(program) = gcode::read(source)
        && let Ok(trajectory) = Trajectory::plan(&program)
    {
        for sample in trajectory.samples().step_by(997) {
            assert!(sample.reference.to_array().iter().all(|value| value.is_finite()), "{sample:?}");
        }
    }
}

/// Text that resembles G-code to some depth.
fn near_gcode() -> impl Strategy<Value = String> {
    let number = prop_oneof!["-?[0-9]{1,3}(\\.[0-9]{0,4})?", "[0-9.+-]{0,12}"];
    let word = ("[GgMXYZACIJRFNTOSHPQ;( )%/:*#]", number).prop_map(|(letter, number)| letter + &number);
    let code = prop::sample::select(vec!["G0", "G1", "G2", "G3", "G21", "M2", "F900", " ", "(a)", ";"]);
    let item = prop_oneof![word, code.prop_map(str::to_owned), Just("\n".to_owned())];
    prop::collection::vec(item, 0..40).prop_map(|items| items.concat())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_string_panics(source in any::<String>()) {
        exercise(&source);
    }

    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = gcode::read_bytes(&bytes);
    }

    #[test]
    fn no_near_gcode_panics(source in near_gcode()) {
        exercise(&source);
        exercise(&format!("{START}{source}"));
    }

    #[test]
    fn errors_are_inside_the_text(source in near_gcode()) {
        if let Err(error) = gcode::read(&source) {
            let line = source.split('\n').nth(error.line - 1).expect("an existing line");
            prop_assert!(error.column <= line.chars().count() + 1, "{}", error);
        }
    }
}
