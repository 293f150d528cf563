// SPDX-License-Identifier: MIT OR Apache-2.0
//! Wrong inputs: each gives exactly one clear error on standard error, a nonzero status and nothing on standard output, and leaves all
//! files unchanged. The texts are in `snapshots/`.

use crate::common::{Folder, RunOutput, source};

const PD: &str = "\
.input a, n:int
.output F, k:int
.once
        wait period
.period
period: fadd F, a, a
        iadd k, n, n
        wait period
";

/// A folder with valid and invalid sources and tables.
fn workshop() -> Folder {
    let folder = Folder::new();
    let files: [(&str, &[u8]); 40] = [
        ("pd.s", PD.as_bytes()),
        ("empty.s", b""),
        ("comment.s", b"; nothing yet\n"),
        ("garbage", b"\x80\x02\xff\x00\xfe garbage"),
        (
            "typos.s",
            b".reg a b\n fad a, b, b\n fadd a, b\n fadd a, bb, a\n .quux\n fadd a, (1+, 2\n jmp nowhere\n",
        ),
        ("escapes.s", b".include \"../secret.s\"\n"),
        ("absent.s", b".include \"none.s\"\n"),
        ("cycle.s", b".include \"cycle2.s\"\n"),
        ("cycle2.s", b".include \"cycle.s\"\n"),
        ("falls.s", b".output F\n fadd F, zero, zero\n"),
        ("spins.s", b"here: jmp here\n"),
        ("halts.s", b".input a, n:int\n.output F\n.once\n wait p\n.period\np: fadd F, a, a\n halt\n"),
        ("unwritten.s", b".reg r\n.output F\n.input z\n bz z, over\n mov r, zero\nover: mov F, r\n halt\n"),
        ("ok.csv", b"a,n\n1,2\n"),
        ("missing.csv", b"a,m\n1,2\n"),
        ("none.csv", b"b,c\n1,2\n"),
        ("twice.csv", b"a,n,a\n1,2,3\n"),
        ("short.csv", b"a,n\n1,2\n1\n"),
        ("long.csv", b"a,n\n1,2,3\n"),
        ("nan.csv", b"a,n\nNaN,1\n"),
        ("inf.csv", b"a,n\ninf,1\n"),
        ("large.csv", b"a,n\n1e39,1\n"),
        ("text.csv", b"a,n\nten,1\n"),
        ("blank.csv", b"a,n\n,1\n"),
        ("fraction.csv", b"a,n\n1,1.5\n"),
        ("wide.csv", b"a,n\n1,4294967296\n"),
        ("semicolon.csv", b"a;n\n1,5;2\n"),
        ("mixed.csv", b"a,n\n1;2\n"),
        ("tab.csv", b"a\tn\n1\t2\n"),
        ("header.csv", b"a,n\n"),
        ("empty.csv", b""),
        ("latin.csv", b"a,n,caf\xe9\n1,2,3\n"),
        ("feed.ngc", b"G0 X0 Y0 Z700\nG1 X10\n"),
        ("far.ngc", b"G0 X0 Y0 Z700\nG1 X9000 F2000\n"),
        ("word.ngc", b"G0 X0 Y0 Z700\nthe quick brown fox\n"),
        ("still.ngc", b"G0 X0 Y0 Z700\n"),
        ("notes.md", b"# Notes\n\nNo source.\n"),
        ("steps.csv", b"w_ref,w\n1,0\n"),
        ("damaged.takt", b"\x7fELG\x01\x01"),
        ("archive", b"PK\x03\x04"),
    ];
    for (name, contents) in files {
        folder.write(name, contents);
    }
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    folder.line("asm pd.s -o pd.takt").ok_with("wrote pd.takt: 4 bundles");
    let image = folder.read("pd.takt");
    folder.write("cut.takt", &image[..image.len() / 2]);
    folder.write("stub.takt", &image[..10]);
    folder.line("asm unwritten.s -m f3 -o unwritten.takt").ok_with("wrote unwritten.takt: ");
    folder.line("asm unwritten.s -m f3 --strip -o stripped.takt").ok_with("wrote stripped.takt: ");
    folder
}

impl RunOutput {
    #[track_caller]
    fn ok_with(self, beginning: &str) {
        let text = self.ok();
        assert!(text.starts_with(beginning), "{text}");
    }

    /// Error text for the snapshots, after the checks that apply to all mistakes.
    #[track_caller]
    fn mistake(&self, line: &str) -> String {
        let RunOutput { status, stdout, stderr } = self;
        assert!(matches!(status, Some(1 | 2)), "{line}: {self:?}");
        assert_eq!(stdout, "", "{line}");
        let is_usage = stderr.contains("Usage: takt") || stderr.contains("try '--help'");
        assert!(!is_usage || *status == Some(2), "{line}: {self:?}");
        assert!(!stderr.contains("panicked"), "{line}: {stderr}");
        format!("$ takt {line}\n{}[{}]\n\n", stderr, status.unwrap())
    }
}

/// Number of lines that begin an error.
fn errors(stderr: &str) -> usize {
    stderr.lines().filter(|line| line.starts_with("error")).count()
}

/// Runs commands and snapshots their messages; each must report one error.
fn check(snapshot: &str, lines: &[&str]) {
    let folder = workshop();
    let before = folder.list();
    let mut text = String::new();
    for line in lines {
        let done = folder.line(line);
        text.push_str(&done.mistake(line));
        assert_eq!(errors(&done.stderr), 1, "{line}: {}", done.stderr);
        assert_eq!(folder.list(), before, "{line} left or removed a file");
    }
    insta::assert_snapshot!(snapshot, text);
}

#[test]
fn rejects_files_that_are_not_programs() {
    check(
        "programs",
        &[
            "run folder",
            "run nowhere.s",
            "run empty.s",
            "asm empty.s",
            "run comment.s",
            "run garbage",
            "asm garbage",
            "asm pd.takt",
            "disasm empty.s",
            "run escapes.s",
            "run absent.s",
            "run cycle.s",
            "run stub.takt",
            "run cut.takt",
            "disasm cut.takt",
            "run pd.takt --machine t1",
            "run pd.s/pd.s",
            "asm notes.md",
            "run steps.csv",
            "run damaged.takt",
            "debug archive",
            "track --program trackin",
            "track --program folder",
            "track --program pd.s",
        ],
    );
}

#[test]
fn programs_that_go_wrong() {
    check(
        "running",
        &[
            "run falls.s -m f3",
            "run spins.s --max-cycles 1000000",
            "run spins.s",
            "run unwritten.s -m f3",
            "run unwritten.takt",
            "run stripped.takt",
            "run unwritten.s -m f3 --periods 1",
            "run pd.s",
            "run halts.s --inputs ok.csv",
        ],
    );
}

#[test]
fn programs_that_cannot_be_analysed() {
    check(
        "analyse",
        &[
            "analyse spins.s",
            "analyse falls.s -m f3",
            "analyse halts.s --periods 3",
            "analyse pd.s --periods 2 --inputs ok.csv",
            "analyse pd.s --inputs header.csv",
            "analyse pd.s --periods 10000000",
            "analyse pd.s --html pd.s",
            "analyse pd.s --html - --json",
            "analyse pd.s --html folder",
            "analyse pd.takt --reassemble",
        ],
    );
}

#[test]
fn programs_that_cannot_be_bounded() {
    check(
        "bounds",
        &[
            "bound spins.s",
            "bound falls.s",
            "bound unwritten.s --deadline 100us",
            "bound pd.s --deadline 100kg",
            "bound pd.s --deadline 0",
            "bound pd.s --deadline -5us",
            "bound pd.s --deadline 0us",
            "bound pd.s --deadline nan",
            "bound pd.s --deadline 1e400s",
            "bound pd.s --deadline --json",
            "bound pd.s --deadline 100us --clock 125kg",
            "bound garbage",
            "bound pd.takt --machine t1",
        ],
    );
}

/// Programs that have the ports of a tracking program but do not work; the unused robot file causes warnings.
#[test]
fn controllers_that_go_wrong() {
    let folder = Folder::new();
    folder.write("robot.s", std::fs::read(source("robot.s")).unwrap());
    for (text, message) in [
        ("p: wait p", "agh.ngc: period 0: controller failed: the program has not written output port `F1`"),
        (
            "p: fdiv F1, zero, zero\n fdiv F2, zero, zero\n halt",
            "agh.ngc: period 0: controller failed: the machine has halted; each period must end with `wait`",
        ),
        (
            "p: wait p\n.input extra",
            "bad.s: not a tracking program: the tracking algorithm does not drive input port `extra`",
        ),
    ] {
        folder.write("bad.s", format!(".include \"robot.s\"\n.once\n wait p\n.period\n{text}\n"));
        let done = folder.line("track --program bad.s --csv out.csv");
        done.mistake(text);
        assert_eq!(errors(&done.stderr), 1);
        assert_eq!(done.stderr.lines().last(), Some(format!("error: {message}").as_str()));
        assert_eq!(folder.list(), ["bad.s", "robot.s"]);
    }
    // A fault is shown at its source line.
    folder.write("bad.s", ".include \"robot.s\"\n.once\n wait p\n.period\np: ret\n");
    let done = folder.line("track --program bad.s --csv out.csv");
    done.mistake("ret");
    let fault = &done.stderr[done.stderr.find("error").unwrap()..];
    insta::assert_snapshot!("controller", fault);
    assert_eq!(folder.list(), ["bad.s", "robot.s"]);
    // A force that is NaN; every output is written once.
    let outputs = "F1 F2 F3 tau4 tau5 l1d l2d l3d v1d v2d v3d a1d a2d a3d th4d th5d om4d om5d ep4d ep5d";
    let writes: String = outputs.split(' ').map(|port| format!(" fdiv {port}, zero, zero\n")).collect();
    folder.write("bad.s", format!(".include \"robot.s\"\n.once\n wait p\n.period\np:\n{writes} wait p\n"));
    let done = folder.line("track --program bad.s");
    done.mistake("NaN");
    assert_eq!(done.stderr.lines().last(), Some("error: agh.ngc: period 0: F1 is not finite"));
}

#[test]
fn tables_of_inputs() {
    let tables = [
        "nowhere",
        "missing",
        "none",
        "twice",
        "short",
        "long",
        "nan",
        "inf",
        "large",
        "text",
        "blank",
        "fraction",
        "wide",
        "header",
        "empty",
        "latin",
        "semicolon",
        "mixed",
        "tab",
    ];
    let lines: Vec<String> = tables.iter().map(|table| format!("run pd.s --inputs {table}.csv")).collect();
    let mut lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    lines.push("run pd.s --inputs folder");
    // Other commands report mistakes in tables in the same way.
    lines.extend([
        "analyse pd.s --inputs semicolon.csv",
        "debug pd.s --inputs header.csv",
        "rtl -o x --program pd.s --inputs header.csv",
    ]);
    check("tables", &lines);
}

#[test]
fn tool_paths() {
    check(
        "paths",
        &[
            "track --gcode nowhere.ngc",
            "track --gcode folder",
            "track --gcode empty.csv",
            "track --gcode garbage",
            "track --gcode feed.ngc",
            "track --gcode far.ngc",
            "track --gcode word.ngc",
            "track --gcode still.ngc",
        ],
    );
}

#[test]
fn command_lines() {
    check(
        "usage",
        &[
            "run pd.s --machine t5",
            "run pd.s --machine riscv",
            "run pd.s --periods 0",
            "run pd.s --periods -1",
            "run pd.s --max-cycles 0",
            "run pd.s --tick 0",
            "run pd.s --tick 1e3",
            "run pd.s --tick -5us",
            "run pd.s --tick 100us",
            "run pd.s --periods 99999999999999999999",
            "run pd.s --periods 2 --deny mised",
            "run pd.s --trace x.vcd --trace-cycles -5..10",
            "analyse pd.s --periods -1",
            "cosim --seed -1",
            "arm --seed 1.5",
            "run pd.s --tick 1000000000",
            "run pd.s --outputs out.csv",
            "run - --inputs -",
            "run pd.s --inputs ok.csv --outputs ok.csv",
            "run pd.s --inputs ok.csv --outputs folder/../ok.csv",
            "run pd.s --inputs ok.csv --outputs - --json",
            "track --periods 0",
            "track --clock 0",
            "track --clock -5",
            "track --clock nan",
            "track --clock fast",
            "track --csv out --plot out",
            "track --csv - --plot -",
            "track --csv - --json",
            "track --gcode ok.ngc --csv ./folder/../ok.ngc",
            "track --plot path.png",
            "track --program - --gcode -",
            "asm -",
            "asm pd.takt -o pd.takt",
            "asm pd.s -o pd.s",
            "asm pd.s --check -o x.takt",
            "asm pd.s --listing x --symbols x",
            "asm pd.s --effort 1000000",
            "eval fad",
            "eval ld",
            "eval halt",
            "isa fad",
            "man trak",
            "completions tcsh",
            "trac",
            "run",
            "run pd.s pd.s",
            "run pd.s --input ok.csv",
        ],
    );
}

#[test]
fn reports_unwritable_outputs() {
    check(
        "outputs",
        &[
            "run pd.s --inputs ok.csv --outputs folder",
            "run pd.s --inputs ok.csv --outputs nowhere/out.csv",
            "run pd.s --inputs ok.csv --outputs ok.csv/out.csv",
            "run pd.s --inputs ok.csv --outputs /dev/full",
            "run pd.s --inputs ok.csv --outputs ..",
            "track --periods 10 --csv folder",
            "track --periods 10 --csv /dev/full",
            "track --periods 10 --plot /dev/full",
            "track --periods 10 --plot nowhere/p.svg",
            "asm pd.s -o /dev/full",
            "asm pd.s --listing nowhere/x",
            "asm pd.s --readmemh ok.csv",
            "disasm pd.takt -o /dev/full",
        ],
    );
}

#[test]
fn operands_of_eval() {
    let folder = Folder::new();
    let mut text = String::new();
    for (operation, input) in [
        ("fadd", "3F800000\n"),
        ("fsqrt", "3F80000g\n"),
        ("fadd", "3F800000 0123456789 3\n"),
        ("fadd", "1.5 2.5\n"),
        ("fadd", "\u{fffd}\u{1f600} 1\n"),
        ("sel", "1 2"),
    ] {
        let line = format!("eval {operation}");
        let done = folder.fed(&line, input.as_bytes());
        text.push_str(&done.mistake(&format!("{line} < {input:?}")));
        assert_eq!(errors(&done.stderr), 1, "{input:?}");
    }
    insta::assert_snapshot!("operands", text);

    // Lines before the mistake are answered.
    let done = folder.fed("eval fadd", b"3F800000 3F800000\n\nxyz 1\n");
    assert_eq!(done.stdout, "40000000 00\n");
    assert_eq!(
        done.stderr,
        "error: standard input:3: `xyz` is not a hexadecimal number of at most 8 digits\n"
    );
    assert_eq!(done.status, Some(1));
}

/// All errors of a source are reported together, and nothing is written.
#[test]
fn all_errors_of_a_source() {
    let folder = workshop();
    let before = folder.list();
    let done = folder.line("asm typos.s");
    assert_eq!(errors(&done.stderr), 6, "{}", done.stderr);
    insta::assert_snapshot!("source", done.mistake("asm typos.s"));
    let done = folder.line("asm typos.s --json");
    assert_eq!((done.status, done.stderr.as_str()), (Some(1), ""));
    let json: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(json["messages"].as_array().unwrap().len(), 6);
    assert_eq!(json["messages"][0]["places"][0]["line"], 2);
    assert_eq!(folder.list(), before);
}

/// Endless lines from standard input.
#[test]
fn lines_of_a_hundred_megabytes() {
    let folder = workshop();
    let mut text = String::new();
    for (line, head) in [
        ("asm - -o x.takt", ""),
        ("run -", ""),
        ("run pd.s --inputs -", ""),
        ("run pd.s --inputs -", "a,n\n"),
        ("run pd.s --inputs -", "a,n\n\""),
        ("track --gcode -", ""),
        ("eval fadd", ""),
    ] {
        // Inside an open quote, line breaks do not end the row.
        let megabyte =
            if head.ends_with('"') { "1234567\n".repeat(1 << 17) } else { "12345678".repeat(1 << 17) };
        let done = folder.fed_by(line, |stdin| {
            let _ = stdin.write_all(head.as_bytes());
            let _ = (0..100).try_for_each(|_| stdin.write_all(megabyte.as_bytes()));
        });
        text.push_str(&done.mistake(&format!("{line} < {head:?} and 100 MiB")));
        assert_eq!(errors(&done.stderr), 1, "{line}: {}", done.stderr);
    }
    insta::assert_snapshot!("endless", text);
}

/// An image that is truncated anywhere, or has any byte changed, either runs or is rejected, without a crash.
#[test]
fn damaged_images() {
    let folder = workshop();
    let image = folder.read("pd.takt");
    let mut refused = 0;
    for length in (0..image.len()).step_by(37) {
        folder.write("damaged", &image[..length]);
        let done = folder.line("run damaged --inputs ok.csv");
        done.mistake(&format!("of {length} bytes"));
        refused += usize::from(done.stderr.contains("not an image that can run"));
    }
    assert!(refused > 10, "only {refused}");
    for (position, bit) in (0..image.len()).step_by(11).zip((0..8).cycle()) {
        let mut bytes = image.clone();
        bytes[position] ^= 1 << bit;
        folder.write("damaged", &bytes);
        let done = folder.line("run damaged --inputs ok.csv --max-cycles 100000");
        if done.status != Some(0) {
            done.mistake(&format!("with byte {position} changed"));
        }
    }
}

/// A file keeps its contents until the command succeeds, and no temporary file remains.
#[test]
fn outputs_are_never_half_written() {
    let folder = workshop();
    folder.write("rows.csv", "a,n\n1,2\n1,2\nten,2\n");
    folder.write("out.csv", "precious");
    folder.write("typos.takt", "precious");
    let before = folder.list();
    for line in [
        "run pd.s --inputs rows.csv --outputs out.csv",
        "run halts.s --inputs rows.csv --outputs out.csv",
        "asm typos.s",
        "asm typos.s -o out.csv",
    ] {
        folder.line(line).mistake(line);
        assert_eq!(folder.read_text("out.csv"), "precious", "{line}");
        assert_eq!(folder.read_text("typos.takt"), "precious", "{line}");
        assert_eq!(folder.list(), before, "{line}");
    }
    folder.line("run pd.s -m f3 --inputs ok.csv --outputs out.csv").ok();
    assert_eq!(folder.read_text("out.csv"), "F,k,cycles\n2.0,4,6\n");
    assert_eq!(folder.list(), before);
}

#[test]
fn survives_closed_standard_error() {
    let folder = workshop();
    for line in ["asm typos.s", "run nowhere", "run --foo", "run pd.s"] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = folder.command(&line.split(' ').collect::<Vec<_>>());
        let done = RunOutput::of({
            command.stderr(full);
            command
        });
        assert!(matches!(done.status, Some(1 | 2)), "{line}: {:?}", done.status);
    }
}
