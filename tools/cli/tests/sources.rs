// SPDX-License-Identifier: MIT OR Apache-2.0
//! Search path of sources in all commands that assemble: `-I` and the built-in library; also `-W`.

use crate::common::Folder;

const MAIN: &str = "\
.include \"twice.s\"
.include <math.s>
.input  x
.output F
.reg    t
.once
        wait    period
.period
period: twice   t, x
        clamp   F, t, -1, 1
        wait    period
";

const TWICE: &str = ".macro twice y, x\n        fadd    y, x, x\n.endm\n";

/// A controller that needs a folder besides its own, with inputs.
fn project() -> Folder {
    let folder = Folder::new();
    for name in ["app", "lib", "other"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    folder.write("app/main.s", MAIN);
    folder.write("lib/twice.s", TWICE);
    folder.write("other/twice.s", TWICE.replace("fadd    y, x, x", "fmul    y, x, 4"));
    folder.write("in.csv", "x\n0.25\n0.75\n");
    folder
}

#[test]
fn every_assembling_command_searches_folders_and_library() {
    let folder = project();
    let run = |line: &str| folder.line(line).ok();
    assert!(run("run app/main.s -I lib --inputs in.csv --outputs -").contains("\n0.5,"));
    assert!(run("asm app/main.s -I lib --listing -").contains("./lib/twice.s:2"));
    assert!(run("asm app/main.s -I lib --listing -").contains("<math.s>:"));
    assert!(run("disasm app/main.s -I lib").contains(".loc \"./lib/twice.s\" 2"));
    for line in ["bound", "analyse"] {
        assert!(run(&format!("{line} app/main.s -I lib")).contains("period"));
    }
    run("rtl -o rtl --machine t1 --program app/main.s -I lib");
    // The first folder that contains the file is used.
    assert!(run("run app/main.s -I other -I lib --inputs in.csv --outputs -").contains("\n1.0,"));
    let track = folder.line("track --program app/main.s -I lib");
    assert!(track.stderr.contains("port"), "it assembles, and has not the robot's ports: {}", track.stderr);
    for command in ["asm", "disasm", "verify", "run", "debug", "track", "bound", "analyse", "rtl", "cosim"] {
        let help = run(&format!("{command} --help"));
        assert!(help.contains("-I, --include <DIR>") && help.contains("-W, --warnings <LEVEL>"), "{command}");
    }
}

/// Messages name a program's files by the paths that open them: errors, warnings and faults, of a program and of a system's core.
#[test]
fn messages_name_files_by_paths_that_open_them() {
    const TABLE: &str = ".input i:int\n.output y\n.reg unused\n.once\n wait loop\n.period\nloop: ld y, table[i]\n wait loop\n.data\ntable: .float 1.0\n";
    const SYSTEM: &str = "tick = 100\n[[core]]\nname = \"c\"\nprogram = \"table.s\"\nmachine = \"t3\"\n[[wire]]\nfrom = \"host.i\"\nto = \"c.i\"\n[[wire]]\nfrom = \"c.y\"\nto = \"host.y\"\n";
    let folder = project();
    folder.write("app/part.s", " fad y, y, y\n");
    folder.write("lib/bad.s", ".none\n");
    folder.write("app/wrong.s", ".include \"part.s\"\n.include \"bad.s\"\n.reg 9\n");
    folder.write("app/table.s", TABLE);
    folder.write("app/core.toml", SYSTEM);
    folder.write("i.csv", "i\n99999\n");
    for (line, places) in [
        ("asm app/wrong.s -I lib", &["app/part.s:1:2", "./lib/bad.s:1:1", "app/wrong.s:3:6"][..]),
        ("run app/table.s --inputs i.csv", &["app/table.s:3:6", "app/table.s:7:1"]),
        ("run app/core.toml --inputs i.csv", &["app/table.s:3:6", "app/table.s:7:1"]),
        ("run app/main.s --inputs in.csv", &["app/main.s:1:1"]),
    ] {
        let text = folder.line(line).stderr;
        for place in places {
            assert!(text.contains(&format!("┌─ {place}\n")), "{line}: {place} in {text}");
        }
    }
}

#[test]
fn the_debugger_shows_the_text_of_library_and_folder() {
    let folder = project();
    let debug = |script: &[u8]| {
        let done = folder.fed("debug app/main.s -I lib --inputs in.csv --script -", script);
        assert_eq!(done.status, Some(0), "{}", done.stderr);
        done.stdout
    };
    let text = debug(b"break math.s:5\ncontinue\nlist\n");
    assert!(text.contains(">    5          fmax    y, x, low"), "{text}");
    let text = debug(b"break ./lib/twice.s:2\ncontinue\nlist\n");
    assert!(text.contains(">    2          fadd    y, x, x"), "{text}");
}

#[test]
fn missing_file_lists_the_existing_ones() {
    let folder = project();
    let fails = |line: &str, status: i32| {
        let done = folder.line(line);
        assert_eq!((done.status, done.stdout.as_str()), (Some(status), ""), "{}", done.stderr);
        done.stderr
    };
    let text = fails("asm app/main.s -I app --check", 1);
    assert!(text.contains("`twice.s` cannot be read: there is no such file"), "{text}");
    assert!(text.contains("nor is it in `./app/`"), "{text}");
    folder.write("app/typo.s", ".include <maths.s>\n");
    let text = fails("asm app/typo.s --check", 1);
    assert!(
        text.contains("there are <arrays.s>, <c.s>, <control.s>, <math.s>")
            && text.contains("did you mean `.include <math.s>`?"),
        "{text}"
    );
    assert!(fails("asm app/main.s -I nowhere", 2).contains("there is no such folder"));
    assert!(fails("run app/main.s -I in.csv", 2).contains("it is a file, not a folder"));
}

#[test]
fn warnings_can_be_errors() {
    let folder = Folder::new();
    folder.write("a.s", ".input x, n:int\n.output F\n.once\n wait p\n.period\np: fadd F, x, n\n wait p\n");
    let done = folder.line("asm a.s");
    assert_eq!(done.status, Some(0));
    assert!(
        done.stderr.starts_with("warning[types]: `n` is an integer, and `fadd` reads a float"),
        "{}",
        done.stderr
    );
    folder.line("asm a.s -W error -W allow=types -o b.takt").ok();
    std::fs::remove_file(folder.path().join("a.takt")).unwrap();
    for line in ["asm a.s -W error", "asm a.s -W error=types", "run a.s --periods 1 -W error"] {
        let done = folder.line(line);
        assert_eq!((done.status, done.stdout.as_str()), (Some(1), ""), "{line}");
        assert!(done.stderr.starts_with("error[types]: `n` is an integer"), "{}", done.stderr);
        assert_eq!(folder.list(), ["a.s", "b.takt"], "{line}: no image of what failed");
    }
    let done = folder.line("asm a.s --check --json -W error");
    assert_eq!(done.status, Some(1));
    assert!(done.stdout.contains("\"severity\": \"error\"") && done.stderr.is_empty(), "{done:?}");
    let done = folder.line("asm a.s -W error=type");
    assert_eq!(done.status, Some(2));
    assert!(done.stderr.contains("there is no warning `type`; did you mean `types`?"), "{}", done.stderr);
}

/// More live values than registers in a bank: every command that shows a program's cost reports spilled values.
#[test]
fn reports_spilled_values() {
    let folder = Folder::new();
    let count = 236;
    let mut text = ".schedule on\n.input a, b\n.output y\n".to_owned();
    (0..count).for_each(|i| text += &format!(".reg v{i} s{i}\n"));
    text += ".once\n wait p\n.period\np: v0 = a*b\n";
    (1..count).for_each(|i| text += &format!(" v{i} = v{} + b\n", i - 1));
    text += &format!(" s{} = v{}*a\n", count - 1, count - 1);
    (0..count - 1).rev().for_each(|i| text += &format!(" s{i} = v{i} - s{}\n", i + 1));
    folder.write("many.s", text + " y = s0\n wait p\n");
    for line in ["asm many.s --check", "asm many.s --listing -", "analyse many.s", "analyse many.s --json"] {
        let out = folder.line(line).ok();
        assert!(
            out.contains("values kept in data memory") && out.contains("from bank a to word 0"),
            "{line}: {out}"
        );
    }
    let json = folder.line("asm many.s --check --json").ok();
    assert!(json.contains("\"spills\"") && json.contains("\"loads\": 1"), "{json}");
}
