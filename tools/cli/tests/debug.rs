// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt debug` as users run it.

use crate::common::{Folder, SUM, source};

#[test]
fn a_script() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    folder.write(
        "good.txt",
        "# what the program is to do\nbreak add if i == 2\nwatch sum\ncontinue\ncontinue\nstops\nflight\nprint sum, i, table[i], @m0\n\
         list\nstep out\nback line\nreverse\ndelete\ndisplay sum\nuntil count == 3\ncheck sum == -1.0\nulp sum, -1.0000001\nregisters *\nports\nmemory table 3\nstalls\nhelp until\n",
    );
    let said = folder.line("debug sum.s -m f3 --script good.txt").ok();
    insta::assert_snapshot!("script", &said);
    let script = folder.read("good.txt");
    assert_eq!(
        folder.fed("debug sum.s -m f3", &script).ok(),
        folder.fed("debug sum.s -m f3 --script -", &script).ok()
    );
    // An image contains everything from its source.
    folder.line("asm sum.s -m f3 -o sum.takt").ok();
    assert_eq!(folder.line("debug sum.takt --script good.txt").ok(), said);
}

/// An image contains the assembled source, independent of later changes to the file, unless it is stripped.
#[test]
fn the_source_of_an_image() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    folder.line("asm sum.s").ok();
    folder.line("asm sum.s --strip -o bare.takt").ok();
    let listed = |image: &str| folder.fed(&format!("debug {image}"), b"break add\nc\nlist\np sum\n");
    let fresh = listed("sum.takt");
    assert!(
        fresh.stderr.is_empty() && fresh.stdout.contains("\n>   12  add:    ld      x, table[i]\n"),
        "{fresh:?}"
    );

    let bare = listed("bare.takt");
    assert_eq!(bare.status, Some(1));
    let message = "error: standard input:3: the program carries no source of sum.s: an image has its sources unless it was assembled with --strip\n";
    assert_eq!(bare.stderr, message);
    assert!(bare.stdout.contains("sum = 0.0 "), "the rest is there: {}", bare.stdout);

    folder.write("sum.s", SUM.replace("table[i]", "table[0]"));
    let stale = listed("sum.takt");
    assert_eq!((stale.status, &stale.stdout), (Some(0), &fresh.stdout));
    assert_eq!(
        stale.stderr,
        "warning: sum.s has changed since sum.takt was made; the listing shows its text of that time\n"
    );
    std::fs::remove_file(folder.path().join("sum.s")).unwrap();
    let moved = listed("sum.takt");
    assert_eq!((moved.status, moved.stdout, moved.stderr), (Some(0), fresh.stdout, fresh.stderr));
}

#[test]
fn help() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let text = folder.fed("debug sum.s", b"help\nquit\nnever read\n").ok();
    insta::assert_snapshot!("commands", text.split_once("(takt) help\n").unwrap().1);
}

#[test]
fn mistakes() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    folder.write("typo.txt", "step\nprnt sum\n");
    let mut text = String::new();
    for line in [
        "debug",
        "debug sum.s --script typo.txt",
        "debug sum.s --script none.txt",
        "debug -",
        "debug none.s",
        "debug sum.s --gcode a",
        "debug --track sum.s --periods 3",
    ] {
        let done = folder.line(line);
        assert_eq!(done.stdout, "", "{line}");
        text.push_str(&format!("$ takt {line}\n[{}]\n{}\n", done.status.unwrap(), done.stderr));
    }
    // A wrong command does not end the session, but determines the exit status.
    for command in [
        "step sideways",
        "break nowhere",
        "break :99",
        "break bundle 1000",
        "print smu",
        "print sum +",
        "set zero = 1",
        "set sum = 1e60",
        "set i = 1.5",
        "set add = 1",
        "delete 7",
        "goto somewhere",
        "memory 5000",
        "ulp sum",
        "check i == 1",
        "list x",
        "until",
        "watch",
    ] {
        let done = folder.fed("debug sum.s -m f3", format!("step 4\n{command}\necho alive\n").as_bytes());
        assert_eq!(done.status, Some(1), "{command}");
        assert!(done.stdout.ends_with("alive\n"), "{command}: {}", done.stdout);
        text.push_str(&format!("(takt) {command}\n{}\n", done.stderr));
    }
    insta::assert_snapshot!("mistakes", text);
}

#[test]
fn in_the_closed_loop() {
    let folder = Folder::new();
    let text = folder.fed("debug --track --periods 300", b"print F1, x\nback period\nstep period\n").ok();
    // The schedule of the program is not under test.
    let worst = "programs/hybrid/tracking.s along agh.ngc, 300 periods: the largest tracking error is 5.53";
    assert!(text.starts_with(worst) && text.contains("in period 115 (not cutting)"), "{text}");
    let places: Vec<&str> = text.lines().filter(|line| line.starts_with("cycle ")).collect();
    let [begin, back, on] = places[..] else { panic!("{text}") };
    assert!(begin.contains(", period 115: bundle ") && begin.ends_with(", period issues"), "{begin}");
    assert!(back.contains(", period 115: waits for the tick"), "{back}");
    assert!(on.contains(", period 116: waits for the tick"), "{on}");
    // The session uses the recorded inputs.
    folder.line("track --periods 300 --csv rec.csv -q").ok();
    let rows = folder.read_text("rec.csv");
    let (title, row) = (rows.lines().next().unwrap(), rows.lines().nth(201).unwrap());
    let column = title.split(',').position(|title| title == "F2").unwrap();
    let force = row.split(',').nth(column).unwrap();
    let commands = format!("goto period 201\ncheck bits(F2) == bits({force})\n");
    folder.fed("debug --track --periods 300", commands.as_bytes()).ok();
    let inputs = format!("debug {} --inputs rec.csv", source("tracking.s"));
    folder.fed(&inputs, commands.as_bytes()).ok();
}
