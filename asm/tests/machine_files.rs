// SPDX-License-Identifier: MIT OR Apache-2.0
//! Machines of files: a printed file reads back as the same machine, each mistake has its place and mend, images carry the row.

use crate::changed::changed;
use crate::rows;
use std::fmt::Write as _;
use takt_asm::machine::{about, machine_file, read};
use takt_asm::{MemoryLoader, Options, assemble, image};
use takt_isa::{F1, F3, Function, MACHINES, Machine, RowPlace, T3};

/// The fixture's file with another name and one part replaced.
fn file(from: &str, to: &str) -> String {
    let text = F3.to_toml().replace("name = \"f3\"", "name = \"mine\"");
    changed(&text, from, to)
}

fn good(text: &str) -> &'static Machine {
    read("my.toml", text).unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)))
}

/// t3's row as a file: a second adder.
fn second_adder() -> String {
    file("\"alu\",", "\"alu\",\n    \"add\",")
}

#[test]
fn a_printed_row_is_the_machine_again() {
    for machine in MACHINES.iter().chain(&[&F1, &F3]) {
        assert!(std::ptr::eq(good(&machine.to_toml()), *machine), "{}", machine.name);
    }
    let mut state = 1_u64;
    let mut below = move |limit: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) % limit
    };
    for machine in rows::all().iter().chain((0..50).map(|_| rows::random(&mut below))) {
        let again = good(&machine.to_toml());
        assert_eq!(again, machine, "{}", machine.to_toml());
        assert!(std::ptr::eq(again, good(&machine.to_toml())));
    }
    // Characters that TOML escapes.
    let odd = Machine { name: "odd", text: "a \"b\" \\ c\nπ\u{1}", ..F3 };
    assert_eq!(good(&odd.to_toml()).text, odd.text);
}

#[test]
fn one_name_may_have_two_rows() {
    let (one, two) = (good(&file("refill = 6", "refill = 6")), good(&second_adder()));
    assert_eq!((one.name, two.name), ("mine", "mine"));
    assert_ne!(one, two);
    let deep = |machine: &'static Machine| machine.with_options([("data", "4096")]).unwrap();
    assert_ne!(deep(one), deep(two));
    assert_eq!((deep(two).row(), deep(two).name), (two, "mine,data=4096"));
    assert_eq!(deep(two).with_options([("data", "1024")]).unwrap(), two);
}

/// A machine that counts no loops has a sequencer without them, whether its file states that once or twice.
#[test]
fn a_depth_of_no_loops_leaves_them_out() {
    let text =
        T3.to_toml().replace("name = \"t3\"", "name = \"plain\"").replace("loop_depth = 4", "loop_depth = 0");
    assert!(text.contains("    \"sequencer\","), "{text}");
    let machine = good(&text);
    assert!(machine.hosts(Function::Loop).is_empty() && machine.loop_depth == 0);
    assert!(std::ptr::eq(good(&machine.to_toml()), machine), "{}", machine.to_toml());
    // Functions that the file lists are kept: a sequencer's loops without a depth are a mistake.
    let listed = text
        .replace("    \"sequencer\",", "    { unit = \"sequencer\", functions = [\"control\", \"loop\"] },");
    let mistake = read("my.toml", &listed).expect_err("it counts loops and does not").render(false);
    assert!(mistake.contains("loop_depth is 0"), "{mistake}");
    let source =
        ".array A[9]\n.output y\n.period\np:\n .for i, 1, 9\n A[i] = 2.5\n .endfor\n y = A[9]\n wait p\n";
    let options = Options { machine, ..Options::default() };
    let program = assemble("a.s", &MemoryLoader::of("a.s", source), &options);
    assert!(program.is_ok_and(|assembled| !assembled.program.loop_bounds.is_empty()));
}

#[test]
fn names_of_files() {
    assert_eq!(machine_file("my.toml"), Some(("my.toml", "")));
    assert_eq!(machine_file("a,b/My.TOML, data=4"), Some(("a,b/My.TOML", " data=4")));
    assert_eq!(machine_file("x.tomlish.toml"), Some(("x.tomlish.toml", "")));
    for name in ["t3", "t3,data=4096", "my.tom", "x.toml/t3", ""] {
        assert_eq!(machine_file(name), None, "{name}");
    }
}

#[test]
fn mistakes_have_place_and_mend() {
    let t3 = file("name = \"mine\"", "name = \"t3\"").replace("refill = 6", "refill = 7");
    let slots = "[[slot]]\nname = \"s\"\nbank = \"b\"\nbase = 0\ndepth = 1\nunits = []\n".repeat(6);
    let many = file("\n[[slot]]\nname = \"add\"", &format!("\n{slots}[[slot]]\nname = \"add\""));
    let files = [
        ("unknown unit", file("\"alu\"", "\"alo\"")),
        ("unknown function", file("\"alu\"", "{ unit = \"alu\", functions = [\"al\"] }")),
        ("unknown key of a unit", file("\"alu\"", "{ unit = \"alu\", latencey = 2 }")),
        ("no unit", file("\"alu\"", "7")),
        ("two units of one function", file("\"alu\"", "\"alu\",\n    \"alu_late\"")),
        ("too many banks", many),
        ("two banks of one name", file("bank = \"a\"", "bank = \"m\"")),
        ("overlap", file("base = 256", "base = 128")),
        ("register space", file("base = 512", "base = 1000")),
        ("latency", file("\"alu\"", "{ unit = \"alu\", latency = 64 }")),
        ("no latency", file("\"alu\"", "{ unit = \"alu\", latency = 0 }")),
        ("interval", file("\"alu\"", "{ unit = \"alu\", interval = 0 }")),
        ("negative", file("base = 256", "base = -1")),
        ("refill", file("refill = 6", "refill = 1000")),
        ("loops", file("loop_depth = 0", "loop_depth = 4")),
        ("two sequencers", file("    \"add\",", "    \"add\",\n    \"sequencer\",")),
        ("no sequencer", file("    { unit = \"sequencer\", functions = [\"control\"] },\n", "")),
        ("a name of ours", t3),
        ("missing key", file("resolve = 2\n", "")),
        ("unknown key", file("resolve = 2", "resolves = 2")),
        ("no TOML", file("resolve = 2", "resolve = ")),
        ("long name", file("\"mine\"", &format!("\"{}\"", "n".repeat(41)))),
        ("a system", "tick = 100\n[[core]]\nname = \"a\"\n".to_owned()),
        ("long file", "#".repeat(1 << 17)),
    ];
    let mut out = String::new();
    for (what, text) in files {
        let mistakes = read("my.toml", &text).expect_err(what);
        let mut shown = mistakes.render(false);
        shown.truncate(shown.floor_char_boundary(1500));
        let _ = writeln!(out, "--- {what}\n{shown}");
    }
    insta::assert_snapshot!(out);
}

#[test]
fn a_later_stage_points_into_the_file() {
    let text = second_adder().replace("\"mine\"", "\"pointed\"");
    let machine = good(&text).with_options([("data", "4096")]).unwrap();
    let place = |place| about(machine.name, place, "said", "mend").expect("it is of a file").messages();
    let line =
        |place: &[takt_asm::diag::Message]| text.lines().nth(place[0].places[0].line - 1).unwrap().to_owned();
    assert_eq!(line(&place(RowPlace::Unit("aux", "divroot"))), "    \"divroot\",");
    assert_eq!(line(&place(RowPlace::Bank("x"))), "bank = \"x\"");
    assert_eq!(line(&place(RowPlace::Field("refill"))), "refill = 6");
    // Other tests read files with the rows of the table, so this name is of no machine.
    assert!(about("nowhere", RowPlace::Name, "", "").is_none());
}

#[test]
fn a_source_names_a_file() {
    let mut files =
        MemoryLoader::of("a.s", ".machine \"sub/my.toml\" data=4096\n.output y\nfadd y, zero, zero\nhalt\n");
    files.add("sub/my.toml", second_adder().as_str());
    let program = assemble("a.s", &files, &Options::default()).expect("it is right").program;
    assert_eq!((program.machine.name, program.machine.row()), ("mine,data=4096", good(&second_adder())));
    let told = |source: &str| {
        let mut files = MemoryLoader::of("a.s", source);
        files.add("bad.toml", file("\"alu\"", "\"alo\"").as_str());
        assemble("a.s", &files, &Options::default()).expect_err("it is wrong").render(false)
    };
    let all = ["none.toml", "bad.toml", "../my.toml", "t3"]
        .map(|name| told(&format!(".machine \"{name}\"\nhalt\n")));
    insta::assert_snapshot!(all.join("\n"));
}

#[test]
fn images_carry_the_row() {
    let machine = good(&second_adder()).with_options([("code", "2048")]).unwrap();
    let source = ".output y\n.reg a b\nfadd a, zero, zero\n fadd.aux y, a, a\nhalt\n";
    let options = Options { machine, ..Options::default() };
    let program = assemble("a.s", &MemoryLoader::of("a.s", source), &options);
    let program = program.unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false))).program;
    let bytes = image::write(&program).expect("it fits");
    let read = image::read(&bytes).expect("it is one");
    assert!(std::ptr::eq(read.machine, machine));
    assert_eq!(read, program);
    // A row that is wrong, or is not the machine's, is refused; both keep the length of the file.
    let tampered = |from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
        let mut bytes = bytes.clone();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        image::read(&bytes).expect_err(to).to_string()
    };
    assert_eq!(
        tampered("\\\"divroot", "\\\"divrood"),
        "the image's description of its machine is invalid: there is no unit `divrood`"
    );
    assert_eq!(
        tampered("\"mine,", "\"many,"),
        "the image's description of its machine is invalid: it is called `mine`, and `machine` is `many`"
    );
    // Images of the table's machines have no row.
    let plain =
        assemble("a.s", &MemoryLoader::of("a.s", "halt\n"), &Options::default()).expect("right").program;
    let plain = image::write(&plain).expect("it fits");
    assert!(!plain.windows(5).any(|window| window == b"\"row\""));
}
