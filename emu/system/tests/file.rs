// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mistakes in a system's file: one clear error each, at its line, with a suggested fix.

use std::convert::Infallible;
use std::fmt::Write as _;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_system::{ProgramError, ReadError, read};

const A: &str =
    ".input x, n:int\n.output y, k:int\n.once\n wait p\n.period\np: mov y, x\n mov k, n\n wait p\n";

/// Rendered mistakes of a file.
fn told(text: &str) -> String {
    let read = read::<Infallible>("system.toml", text, |request| {
        let missing = || ProgramError::Missing {
            message: format!("there is no program {}", request.path),
            help: Some("did you mean `a.s`?".to_owned()),
        };
        let source = match request.path {
            "a.s" => A.to_owned(),
            _ => return Err(missing()),
        };
        let options = Options { machine: request.machine.unwrap_or(&takt_isa::F3), ..Options::default() };
        Ok(assemble("a.s", &MemoryLoader::of("a.s", source), &options).expect("it is right").program)
    });
    match read {
        Ok(description) => format!("{} cores, {} links\n", description.cores.len(), description.links.len()),
        Err(ReadError::Mistakes(mistakes)) => mistakes.render(false),
        Err(ReadError::Program(never)) => match never {},
    }
}

const CORES: &str =
    "tick = 1000\n[[core]]\nname = \"a\"\nprogram = \"a.s\"\n[[core]]\nname = \"b\"\nprogram = \"a.s\"\n";
const RIGHT: &str = "[[wire]]\nfrom = \"host.n\"\nto = \"a.n\"\n[[wire]]\nfrom = \"host.m\"\nto = \"b.n\"\n\
                     [[wire]]\nfrom = \"a.y\"\nto = \"b.x\"\nlatency = 9\n[[wire]]\nfrom = \"b.y\"\nto = \"a.x\"\n";

#[test]
fn a_right_file_is_read() {
    assert_eq!(told(&format!("{CORES}{RIGHT}")), "2 cores, 4 links\n");
}

#[test]
fn mistakes() {
    let with = |links: &str| format!("{CORES}{links}");
    let changed = |from: &str, to: &str| {
        let text = format!("{CORES}{RIGHT}");
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    let fifo = |rest: &str| {
        with(&format!("[[fifo]]\nname = \"q\"\nfrom = \"a\"\nto = \"b\"\nports = [\"y -> x\"]\n{rest}"))
    };
    let cases: Vec<(&str, String)> = vec![
        ("an empty file", String::new()),
        ("no TOML", "tick = = 3".to_owned()),
        ("no core", "tick = 5".to_owned()),
        ("a board's wiring", include_str!("../../../programs/examples/board/position.toml").to_owned()),
        ("an unknown key", changed("latency", "latencey")),
        ("a missing key", changed("program = \"a.s\"\n", "")),
        ("a missing program", changed("\"a.s\"", "\"b.s\"")),
        ("an unknown machine", changed("program", "machine = \"t33\"\nprogram")),
        ("a base tick of 0", changed("tick = 1000", "tick = 0")),
        ("a negative tick", changed("tick = 1000", "tick = -1")),
        ("a core's tick of 0", changed("program", "tick = 0\nprogram")),
        ("an offset beyond the period", changed("program", "offset = 1000\nprogram")),
        ("two cores of one name", changed("\"b\"", "\"a\"")),
        ("a core named host", changed("name = \"b\"", "name = \"host\"")),
        ("a name that is none", changed("name = \"b\"", "name = \"b c\"")),
        ("no such core", changed("from = \"a.y\"", "from = \"c.y\"")),
        ("no such port", changed("from = \"a.y\"", "from = \"a.yy\"")),
        ("an input as a source", changed("from = \"a.y\"", "from = \"a.x\"")),
        ("no port at all", changed("from = \"a.y\"", "from = \"a\"")),
        ("two drivers", changed("to = \"a.x\"", "to = \"b.x\"")),
        ("no driver", with(RIGHT.rsplit_once("[[wire]]").unwrap().0)),
        ("another type", changed("from = \"a.y\"", "from = \"a.k\"")),
        ("a latency of 3", changed("latency = 9", "latency = 3")),
        ("a latency of 0", changed("latency = 9", "latency = 0")),
        ("a loop of zero latency", changed("latency = 9", "latency = 0") + "latency = 0\n"),
        ("a FIFO of depth 0", fifo("depth = 0\npush = \"k\"\npop = \"k\"\n")),
        ("a FIFO without push", fifo("depth = 1\npop = \"k\"\n")),
        (
            "a FIFO with its status on a float port",
            fifo("depth = 1\npush = \"k\"\npop = \"k\"\nsender = { full = \"x\" }\n"),
        ),
        ("a link named like a core", fifo("").replacen("\"q\"", "\"a\"", 1) + "depth = 1\n"),
        ("a link from host to host", changed("to = \"a.n\"", "to = \"host.k\"")),
        (
            "a snapshot without ports",
            with("[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"b\"\nports = []\n"),
        ),
        (
            "a tick too short for its snapshots",
            changed("tick = 1000", "tick = 16").replace(
                "[[wire]]\nfrom = \"a.y\"\nto = \"b.x\"\nlatency = 9\n",
                "[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"b\"\nports = [\"y -> x\"]\n",
            ),
        ),
    ];
    let mut all = String::new();
    for (what, text) in cases {
        let told = told(&text);
        assert!(told.starts_with("error["), "{what}: {told}");
        let _ = writeln!(all, "---- {what}\n{told}");
    }
    insta::assert_snapshot!(all);
}
