// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files as found in practice: blemishes in ignored parts, encodings, spreadsheets, Python's JSON; and the tables of docs/readers.md.

use std::path::Path;
use takt_front::fpcore;
use takt_front::mpc::{self, penalty};
use takt_front::robot::{self, dh, mjcf, urdf};
use takt_front::{Error, no_files};
use takt_text::readers::{self, Row};

/// Tables of the readers, by the name of their marks in the document.
const TABLES: [(&str, &[Row]); 5] = [
    ("fpcore", fpcore::TABLE),
    ("urdf", urdf::TABLE),
    ("mjcf", mjcf::TABLE),
    ("dh", dh::TABLE),
    ("mpc", mpc::TABLE),
];

#[test]
fn the_document_has_the_tables_of_the_readers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/readers.md");
    let mut text = std::fs::read_to_string(&path).expect("docs/readers.md");
    for (name, rows) in TABLES {
        let (begin, end) = (format!("<!-- table: {name} -->\n"), "<!-- end -->");
        let start =
            text.find(&begin).unwrap_or_else(|| panic!("docs/readers.md has no `{begin}`")) + begin.len();
        let stop = start + text[start..].find(end).expect("an end");
        let table = readers::markdown(rows);
        if std::env::var_os("TAKT_BLESS").is_some() {
            text.replace_range(start..stop, &table);
        } else {
            assert_eq!(text[start..stop], table, "TAKT_BLESS=1 rewrites the table of {name}");
        }
    }
    if std::env::var_os("TAKT_BLESS").is_some() {
        std::fs::write(path, text).expect("docs/readers.md");
    }
}

#[test]
fn no_part_stands_in_a_table_twice() {
    for (name, rows) in TABLES {
        let mut seen = std::collections::HashSet::new();
        for row in rows {
            for part in row.parts.split_ascii_whitespace() {
                assert!(seen.insert((row.of, part)), "{name}: `{part}` of `{}`", row.of);
            }
        }
    }
}

/// Two joints, with places for blemishes.
fn arm(head: &str, link: &str, joint: &str, rest: &str) -> String {
    format!(
        "{head}<robot name=\"two\">\n<link name=\"base\"/>\n<link name=\"l1\"><inertial><origin xyz=\"0.1 0.02 0.03\"/><mass value=\"2\"/>\
         <inertia ixx=\"0.02\" ixy=\"0\" ixz=\"0\" iyy=\"0.03\" iyz=\"0\" izz=\"0.04\"/></inertial>{link}</link>\n\
         <joint name=\"a\" type=\"revolute\"><parent link=\"base\"/><child link=\"l1\"/><axis xyz=\"0 1 0\"/>{joint}</joint>{rest}</robot>"
    )
}

fn notes(source: &str) -> Vec<String> {
    match robot::read(source, urdf::SNAP, &no_files).and_then(|tree| tree.robot(None, None)) {
        Ok(robot) => robot.notes,
        Err(error) => panic!("{}: {source}", error.located_text("arm.urdf")),
    }
}

/// Blemishes in elements that cannot affect motion are ignored.
#[test]
fn tolerates_mistakes_in_ignored_parts() {
    let none: &[&str] = &[];
    for (source, expected) in [
        (arm("", "", "", ""), none),
        (arm("", "<visual/>", "", ""), &["passed over: `visual`"]),
        (
            arm(
                "",
                "<visual><geometry><box size=\"1 1\"/></geometry><material><color rgba=\"1\"/></material></visual>",
                "",
                "",
            ),
            &["passed over: `visual`"],
        ),
        (
            arm(
                "",
                "<collision><geometry/></collision><visual><geometry><mesh scale=\"0.001\"/></geometry></visual>",
                "",
                "",
            ),
            &["passed over: `collision`, `visual`"],
        ),
        (
            arm("", "", "<limit lower=\"x\"/><limit/>", "<material/><transmission/>"),
            &["passed over: `limit`, `material`, `transmission`"],
        ),
        (arm("", "", "<dynamics damping=\"\" friction=\"\"/>", ""), &["passed over: `dynamics`"]),
        (
            arm("", "", "<dynamics damping=\"1\"/>", ""),
            &["damping and friction (`dynamics`) are left out: of `a`", "passed over: `dynamics`"],
        ),
        (
            arm("", "<contact/>", "", "<frame/>"),
            &["passed over, unknown here: `contact` of `link`, `frame` of `robot`"],
        ),
        (arm("<!DOCTYPE robot>\n", "", "", ""), none),
        (arm("\n\n<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>", "", "", ""), none),
        (arm("<!-- a --><?xml version='1.1'?>", "", "", ""), none),
    ] {
        assert_eq!(notes(&source), expected, "{source}");
    }
    // Line numbers of mistakes are still right.
    let broken = arm("\n<?xml version=\"1.0\"\n?>", "", "", "").replace("0 1 0", "0 1");
    let error = robot::read(&broken, urdf::SNAP, &no_files).expect_err("two numbers");
    assert_eq!(error.line, Some(6));
}

#[test]
fn a_floating_base_of_urdf_is_held() {
    let base = "<link name=\"world\"/><link name=\"foot\"/>\
        <joint name=\"free\" type=\"floating\"><parent link=\"foot\"/><child link=\"base\"/></joint>\
        <joint name=\"weld\" type=\"fixed\"><parent link=\"world\"/><child link=\"foot\"/></joint>";
    let tree = robot::read(&arm("", "", "", base), urdf::SNAP, &no_files).expect("URDF");
    let refused = tree.robot(None, None).expect_err("it floats").to_string();
    assert!(refused.starts_with("`free`: a floating joint: only revolute,"), "{refused}");
    let notes = tree.held().robot(None, None).expect("a robot").notes;
    assert_eq!(notes, ["the base is held, though it floats: `free` (`--floating error` refuses)"]);
}

#[test]
fn an_element_of_many_attributes_is_refused_at_once() {
    let many: String = (0..40_000).map(|number| format!(" a{number}=\"\"")).collect();
    for source in [arm("", &format!("<visual{many}/>"), "", ""), format!("<mujoco{many}/>")] {
        let error = robot::read(&source, urdf::SNAP, &no_files).expect_err("too many");
        assert!(
            error.to_string().contains("an element has more than 256 attributes") && error.line.is_some()
        );
    }
}

const HEAD: &str = "joint,kind,a,alpha,d,theta";

fn table(source: &str) -> Result<usize, String> {
    let told = |error: Error| error.located_text("t.csv");
    dh::read(source, "t", urdf::SNAP).map(|tree| tree.joints.len() / 2).map_err(told)
}

/// Tables as saved by Excel and LibreOffice, in English and in German.
#[test]
fn tables_of_spreadsheets_are_read() {
    let rows = "# convention: modified\njoint,kind,a,alpha,d,theta\nj1,revolute,0,0,0.333,0\nj2,revolute,0,-pi/2,0,2*pi\n";
    assert_eq!(table(rows), Ok(2));
    for source in [
        format!("\u{feff}{rows}"),
        rows.replace('\n', "\r\n"),
        rows.replace(',', ";"),
        rows.replace(',', "\t"),
        format!("sep=;\n{}", rows.replace(',', ";")),
        rows.replace("modified", "modified,,,,,") + ",,,,,\n",
        rows.replace("revolute", "\"revolute\""),
    ] {
        assert_eq!(table(&source), Ok(2), "{source}");
    }
    let degrees = rows
        .replace("alpha", "alpha_deg")
        .replace("-pi/2", "-90")
        .replace("theta", "theta_deg")
        .replace("2*pi", "360");
    let [rad, deg] = [rows, &degrees].map(|source| dh::read(source, "t", urdf::SNAP).expect("a table"));
    for (rad, deg) in rad.joints.iter().zip(&deg.joints) {
        assert_eq!((rad.rotation, rad.origin), (deg.rotation, deg.origin));
    }
}

#[test]
fn rejects_ambiguous_tables() {
    let told = |head: &str, row: &str| {
        table(&format!("# convention: standard\n{head}\n{row}\n")).expect_err("refused")
    };
    for (head, row, expected) in [
        (
            HEAD,
            "j1,revolute,0,90,0.3,0",
            "t.csv:3: `alpha`: 90 rad is more than a turn; if it is in degrees, call the column `alpha_deg`",
        ),
        (
            HEAD,
            "j1,revolute,0,0,0.3,-180",
            "t.csv:3: `theta`: -180 rad is more than a turn; if it is in degrees, call the column `theta_deg`",
        ),
        (
            "joint;kind;a;alpha;d;theta",
            "j1;revolute;0;0;0,333;0",
            "t.csv:3: `d`: `0,333` has a comma: numbers have a decimal point, as 0.5",
        ),
        (
            HEAD,
            "j1,revolute,0,0,0,333,0",
            "t.csv:3: 7 fields; the header has 6 (numbers have a decimal point, as 0.5)",
        ),
        (
            "joint,kind,a,alpha,alpha_deg,d,theta",
            "",
            "t.csv:2: columns `alpha` and `alpha_deg` exclude each other: leave one out",
        ),
        (
            "joint,kind,a_deg,alpha,d,theta",
            "",
            "t.csv:2: column `a_deg` is not known; the columns are joint, kind, a,",
        ),
        (
            "joint,kind,a,d,theta",
            "",
            "t.csv:2: the header has no column `alpha`; needed are joint, kind, a, alpha, d, theta",
        ),
    ] {
        let found = told(head, row);
        assert!(found.starts_with(expected), "{found}");
    }
}

const PROBLEM: &str = "{\"format\": \"takt-mpc 1\", \"A\": [[1, 0.1], [0, 1]],\n \"B\": [[0.005], [0.1]], \"Q\": [10, 1], \"R\": [1],\n \
                       \"u_min\": -1, \"u_max\": 1, \"horizon\": 8}";

fn problem(from: &str, to: &str) -> Result<mpc::System, String> {
    assert!(PROBLEM.contains(from), "{from}");
    let text = PROBLEM.replacen(from, to, 1);
    assert!(mpc::is_system(&text));
    mpc::read(&text, "p", &no_files).map_err(|error| error.located_text("p.json"))
}

/// `json.dumps` writes numbers that JSON lacks; an infinite limit means no limit.
#[test]
fn infinities_of_python_are_no_limits() {
    for value in ["Infinity", "null", "\"inf\"", "[Infinity]", "[null]", "[\"Infinity\"]", "\"+inf\""] {
        let system = problem("\"u_max\": 1", &format!("\"u_max\": {value}")).expect("a problem");
        assert_eq!(system.u_limits, [(-1.0, f64::INFINITY)], "{value}");
    }
    let system = problem("\"u_min\": -1", "\"u_min\": -Infinity").expect("a problem");
    assert_eq!(system.u_limits, [(f64::NEG_INFINITY, 1.0)]);
    for (from, to, expected) in [
        (
            "\"u_max\": 1",
            "\"u_max\": -Infinity",
            "p.json:3: `u_max`: -inf is not a limit; write `null` for no limit",
        ),
        (
            "\"u_max\": 1",
            "\"u_max\": NaN",
            "p.json:3: `u_max`: NaN is not a limit; write `null` for no limit",
        ),
        ("[10, 1]", "[NaN, 1]", "p.json:2: `Q`: expected a finite number, found NaN"),
        ("[1, 0.1]", "[1, Infinity]", "p.json:1: `A`: expected a finite number, found inf"),
        (
            "8}",
            "NaN}",
            "p.json:3: this is not a control problem: `NaN` is not a JSON number, though Python's json.dumps writes it",
        ),
        ("8}", "8,}", "p.json:3: this is not a control problem: trailing comma"),
        ("8}", "8", "p.json:3: this is not a control problem: EOF while parsing an object"),
    ] {
        assert_eq!(problem(from, to).expect_err("refused"), expected);
    }
    assert!(mpc::read(&format!("\u{feff}{PROBLEM}"), "p", &no_files).is_ok());
}

/// Decimal commas never become extra columns.
#[test]
fn decimal_commas_are_no_columns() {
    let text = PROBLEM.replace("[[0.005], [0.1]]", "\"B.csv\"").replace("\"R\": [1]", "\"R\": 1");
    let read = |file: &'static str| {
        let files = move |_: &str| Ok(file.to_owned());
        mpc::read(&text, "p", &files).map(|system| system.b).map_err(|error| error.to_string())
    };
    for file in ["0.005\n0.1\n", "0.005;\n0.1;\n", "\u{feff}0.005,\r\n0.1,\r\n", "% b\n 5e-3\n.1"] {
        assert_eq!(read(file).expect("a matrix").as_slice(), [0.005, 0.1], "{file}");
    }
    for file in ["0,005;\n0,1;", "0,005\n0,1", "0,005\t\n0,1\t", "0,5\n0,1", "\"0,005\"\n\"0,1\""] {
        let error = read(file).expect_err("refused");
        assert!(
            error.starts_with("`B`:")
                && (error.contains("decimal point") || error.contains("not a finite number")),
            "{error}"
        );
    }
}

/// A problem whose input of small weight hardly moves with a penalty of 1.
const ILL: &str = "{\"format\": \"takt-mpc 1\", \"A\": [[0.9, 0.05, 0], [0, 0.7, 0.1], [0.02, 0, 0.8]], \"B\": [[0.05, 1e-05], \
    [0.01, 2e-06], [0.1, 0.0003]], \"Q\": [0.2, 1, 0.5], \"R\": [0.5, 5e-07], \"u_min\": [-50, -50], \"u_max\": [50, 50], \"horizon\": 6,\
    \"iterations\": 30}";

#[test]
fn chooses_a_penalty_for_the_weights() {
    let read = |text: &str| mpc::read(text, "ill", &no_files).expect("a problem");
    let system = read(ILL);
    assert_eq!((system.rho, penalty(&system)), (1e-3, 1e-3));
    let x = vec![20.0, -3.0, 40.0].into();
    let first = |system| {
        let controller = mpc::Controller::new(system).expect("factors");
        let u = controller.period(&x, &controller.rest(), &mut controller.cold()).u.swap_remove(0);
        (u, mpc::hint(&controller))
    };
    // The optimum, with the cost-to-go of this penalty as the last weight.
    let (u, hint) = first(system);
    assert!((u[0] + 11.9775).abs() < 1e-3 && u[1] == -50.0, "{u}");
    assert!(hint.is_some_and(|hint| hint.rho == 1e-3 && hint.spread.is_some()), "{hint:?}");
    let (u, hint) = first(read(&ILL.replace("\"iterations\"", "\"rho\": 1, \"iterations\"")));
    let hint = hint.expect("advice");
    assert!(u[1] > -1.0 && hint.rho == 1e-3 && hint.rate.is_some_and(|rate| rate < 0.9996), "{u} {hint:?}");
    // If only the penalty is far off, the hint mentions nothing else; if the penalty works, there is no hint.
    let hint = |rho: &str| first_hint(&problem("8}", &format!("8, \"rho\": {rho}}}")).expect("a problem"));
    assert_eq!(hint("2"), None);
    assert!(hint("1e5").is_some_and(|hint| hint.rho == 2.0 && hint.spread.is_none()));
    // Limits on states leave no rate.
    let limited = problem("8}", "8, \"rho\": 1e5, \"x_max\": 1}").expect("a problem");
    assert!(first_hint(&limited).is_some_and(|hint| hint.rho == 2.0 && hint.rate.is_none()));
}

fn first_hint(system: &mpc::System) -> Option<mpc::Hint> {
    mpc::hint(&mpc::Controller::new(system.clone()).expect("factors"))
}
