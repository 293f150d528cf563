// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt run --trace` as users run it.

use crate::common::{Folder, source};

#[test]
fn traces() {
    let folder = Folder::new();
    folder.line("track --periods 5 --csv rec.csv -q").ok();
    let run = format!("run {} -m f3 --inputs rec.csv", source("tracking.s"));
    let plain = folder.line(&run).ok();
    for (extension, start) in [
        ("vcd", &b"$comment machine f3"[..]),
        ("fst", b"\0"),
        ("kanata", b"Kanata\t0004\nC=\t200\n"),
        ("jsonl", b"{\"cycle\":200,"),
    ] {
        let traced = folder.line(&format!("{run} --trace out.{extension} --trace-cycles 200..300")).ok();
        assert_eq!(traced, plain, "the run is the same");
        assert!(folder.read(&format!("out.{extension}")).starts_with(start), "{extension}");
    }
    // A program that halts, and one that faults: the trace shows the events before the fault.
    folder.write("halts.s", ".output F\n fadd F, zero, zero\n halt\n");
    folder.line("run halts.s --trace halts.jsonl").ok();
    assert!(folder.read_text("halts.jsonl").contains(r#""event":"halt""#));
    folder.write("falls.s", ".output F\n fadd F, zero, zero\n");
    assert_eq!(folder.line("run falls.s --trace falls.jsonl").status, Some(1));
    assert!(folder.read_text("falls.jsonl").contains(r#""event":"fault""#));
}

#[test]
fn mistakes() {
    let folder = Folder::new();
    folder.write("halts.s", ".output F\n fadd F, zero, zero\n halt\n");
    std::os::unix::fs::symlink("/dev/full", folder.path().join("full.vcd")).unwrap();
    let mut text = String::new();
    for line in [
        "run halts.s --trace out.wav",
        "run halts.s --trace none/out.vcd",
        "run halts.s --trace full.vcd",
        "run halts.s --trace out.vcd --trace-signals f",
        "run halts.s --trace out.kanata --trace-signals F",
        "run halts.s --trace out.vcd --trace-cycles 9..3",
        "run halts.s --trace-cycles 3..9",
        "run halts.s -m f3 --trace out.vcd --trace-cycles 100..",
    ] {
        let done = folder.line(line);
        text.push_str(&format!("$ takt {line}\n[{}]\n{}\n", done.status.unwrap(), done.stderr));
    }
    insta::assert_snapshot!("traces", text);
    assert_eq!(folder.list(), ["full.vcd", "halts.s", "out.vcd"], "no remains");
}
