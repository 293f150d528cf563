// SPDX-License-Identifier: MIT OR Apache-2.0
//! Commands of `takt` as users run them.

use crate::common::{Folder, RunOutput, source};
use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use takt_isa::fp::HAS_SOFTFLOAT;

/// Columns of a CSV text, by title.
fn columns(csv: &str) -> BTreeMap<String, Vec<String>> {
    let mut lines = csv.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let titles = lines.next().unwrap();
    let rows: Vec<Vec<String>> = lines.collect();
    assert!(rows.iter().all(|row| row.len() == titles.len()));
    let column = |i: usize| rows.iter().map(|row| row[i].clone()).collect();
    titles.into_iter().enumerate().map(|(i, title)| (title, column(i))).collect()
}

/// Rounds floating-point numbers to three digits; further digits depend on the host's sine function.
fn round(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(map) => map.values_mut().for_each(round),
        serde_json::Value::Array(list) => list.iter_mut().for_each(round),
        serde_json::Value::Number(number) if number.is_f64() => {
            let text = format!("{:.2e}", number.as_f64().unwrap());
            *value = text.parse::<f64>().unwrap().into();
        }
        _ => {}
    }
}

#[test]
fn track() {
    let folder = Folder::new();
    let text = folder.line("track -m f3 --periods 200").ok();
    assert_eq!(folder.line("track -m f3 --periods 200").ok(), text, "the same every time");
    // Place and route is recorded separately, in rtl/synthesis.json.
    let steady: String = text
        .split_inclusive('\n')
        .filter(|line| !line.to_lowercase().contains("placed and routed"))
        .collect();
    insta::assert_snapshot!("track", steady);

    let json = folder.line("track -m f3 --periods 200 --json").ok();
    let mut json: serde_json::Value = serde_json::from_str(&json).unwrap();
    round(&mut json);
    json.as_object_mut().unwrap().remove("placed");
    insta::assert_json_snapshot!("track_json", json);
    assert_eq!(folder.list(), [""; 0]);
}

#[test]
fn arm() {
    let folder = Folder::new();
    let text = folder.line("arm -m f3 --poses 200").ok();
    assert_eq!(folder.line("arm -m f3 --poses 200 -q").ok(), text, "the same every time");
    insta::assert_snapshot!("arm", text);

    // Keys promised in issue 5.
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("arm -m f3 --poses 200 --json").ok()).unwrap();
    let number = |pointer: &str| json.pointer(pointer).and_then(serde_json::Value::as_f64).unwrap();
    assert!(number("/forward/cycles/max") <= 107.0 && number("/inverse/cycles/max") <= 240.0, "{json}");
    for error in ["/forward/max_error_mm", "/forward/max_error_deg", "/inverse/max_error_deg"] {
        assert!((1e-6..=0.0005).contains(&number(error)), "{error}");
    }
    for (example, names) in [("forward", ["x", "y", "z"]), ("inverse", ["th1", "th2", "th3"])] {
        for name in names {
            let value = |whose: &str| number(&format!("/{example}/example/{whose}/{name}"));
            assert!((value("takt") - value("binary64")).abs() < 0.0005, "{example} {name}");
            assert!((value("takt") - value("paper")).abs() < 0.02, "{example} {name}");
        }
    }
    for trip in ["forward_of_inverse", "inverse_of_forward"] {
        let tried = json["round_trips"][trip]["tried_by_configuration"].as_array().unwrap();
        assert!(tried.len() == 8 && tried.iter().all(|tried| tried.as_u64().unwrap() > 0), "{json}");
    }
    assert_eq!((number("/poses"), number("/disagreements")), (200.0, 0.0));
    assert_eq!(folder.list(), [""; 0]);
}

/// Joint angles along a closed square in space, and the plot of them.
#[test]
fn the_arm_draws_a_square() {
    let folder = Folder::new();
    let text = folder.line("arm --poses 1 --csv s.csv --plot s.svg").ok();
    assert!(text.contains("The square of 200 mm, 4001 periods of 1 ms"), "{text}");
    let table = columns(&folder.read_text("s.csv"));
    let number = |name: &str, row: usize| table[name][row].parse::<f64>().unwrap();
    assert_eq!(table["period"].len(), 4001);
    for name in ["x", "y", "z", "th1", "th2", "th3", "th4", "th5", "th6"] {
        assert_eq!(number(name, 0), number(name, 4000), "{name} ends where it began");
        assert!((0..4000).all(|row| (number(name, row) - number(name, row + 1)).abs() < 0.5), "{name} jumps");
    }
    assert!((number("y", 2000) - number("y", 1000) - 200.0).abs() < 1e-3);
    let svg = folder.read_text("s.svg");
    assert!(svg.starts_with("<svg") && svg.matches("<polyline").count() >= 7 && svg.contains("θ6"));
    // The tool path is the line that returns to its start: projected, the square is a parallelogram.
    let points = |line: &str| -> Vec<(f64, f64)> {
        let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap().split_whitespace();
        let point = |point: &str| {
            let (x, y) = point.split_once(',').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        };
        points.map(point).collect()
    };
    let lines = svg.lines().filter(|line| line.starts_with("<polyline")).map(points);
    let closed: Vec<_> = lines.filter(|line| line.len() > 100 && line.first() == line.last()).collect();
    let [square] = &closed[..] else { panic!("{} closed lines", closed.len()) };
    let corner = |quarter: usize| square[quarter * (square.len() - 1) / 4];
    let [a, b, c, d] = [0, 1, 2, 3].map(corner);
    assert!(
        (a.0 + c.0 - b.0 - d.0).abs() < 10.0 && (a.1 + c.1 - b.1 - d.1).abs() < 10.0,
        "{a:?} {b:?} {c:?} {d:?}"
    );
    let area = (c.0 - a.0) * (d.1 - b.1) - (d.0 - b.0) * (c.1 - a.1);
    assert!(area.abs() > 1e6, "not from the side: {area}");
    for text in ["The tool along a square of 200 mm in space", "x, mm", "y, mm", "z, mm", "Joint angles"] {
        assert!(svg.contains(text), "{text}");
    }
    assert_eq!(folder.line("arm --poses 1 --plot -").ok(), svg);
}

#[test]
fn the_small_machine_has_no_arctangent() {
    let refused = Folder::new().line("arm --machine f1");
    assert_eq!((refused.status, refused.stdout.as_str()), (Some(1), ""));
    assert_eq!(refused.stderr, "error: f1 has no arctangent, which the arm's programs need; t3 has\n");
}

/// Keys promised in issue 2, on every program and machine.
#[test]
fn track_as_json() {
    let folder = Folder::new();
    for (program, machine) in [("tracking", "t1"), ("tracking_literal", "t3"), ("tracking_literal", "t1")] {
        let line = format!("track --periods 20 --json --program {program} --machine {machine}");
        let json: serde_json::Value = serde_json::from_str(&folder.line(&line).ok()).unwrap();
        assert_eq!(json["program"], format!("programs/hybrid/{program}.s"));
        assert_eq!(json["machine"], machine);
        assert_eq!(json["periods"], 20);
        let cycles = |key| json["cycles"][key].as_u64().unwrap();
        assert!(cycles("min") > 100 && cycles("min") <= cycles("max"), "{json}");
        assert_eq!(json["operations"]["fsat"], 5);
        for key in "l1 l2 l3 th4 th5 v1 v2 v3 om4 om5 a1 a2 a3 ep4 ep5".split(' ') {
            assert!(json["max_error"][key].is_f64(), "{key}");
        }
        assert_eq!(json["max_error"].as_object().unwrap().len(), 15);
        assert!(json["tracking_error_m"]["cutting"].is_f64() && json["tracking_error_m"]["overall"].is_f64());
        // Each cycle of the last period either issues a bundle or is charged to a cause.
        let stalls: u64 =
            json["stalls"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
        assert_eq!(json["bundles"].as_u64().unwrap() + stalls, 12_500, "125 MHz, 100 µs");
    }
}

/// The source contains the lines that --fit-friction prints, each table names its program, and a run without friction is rejected.
#[test]
fn friction_is_identified_from_a_run() {
    let folder = Folder::new();
    let text = folder.line("track -m f3 --fit-friction -q").ok();
    let (_, lines) = text.split_once("\nFor tracking_friction.s:\n").expect("the lines of the source");
    let words =
        |line: &str| line.split([' ', ',']).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
    let source = std::fs::read_to_string(source("tracking_friction.s")).unwrap();
    let written: Vec<String> = source.lines().map(words).collect();
    assert_eq!(lines.lines().count(), 5);
    for line in lines.lines() {
        assert!(written.contains(&words(line)), "{line}");
    }
    let headings = text.lines().filter(|line| line.contains("tracking on f3")).count();
    assert_eq!(headings, 6, "{text}");
    let refused = folder.line("track -m f3 --fit-friction --periods 3000 -q");
    assert_eq!(refused.status, Some(1));
    assert!(
        refused.stderr.starts_with("error: friction.ngc: no friction of arm 1 in this run"),
        "{}",
        refused.stderr
    );
}

#[test]
fn run_reproduces_track_from_recorded_inputs() {
    let folder = Folder::new();
    for (program, machine) in [("tracking", "t3"), ("tracking", "t1"), ("tracking_literal", "t3")] {
        folder
            .line(&format!("track --periods 300 --program {program} --machine {machine} --csv rec.csv"))
            .ok();
        let source = source(&format!("{program}.s"));
        let line = format!("run {source} --machine {machine} --inputs rec.csv --outputs out.csv");
        folder.line(&line).ok();
        let (recorded, run) = (columns(&folder.read_text("rec.csv")), columns(&folder.read_text("out.csv")));
        assert_eq!(run.len(), 21, "20 outputs and the cycles");
        for (title, values) in &run {
            assert_eq!(values.len(), 300);
            assert_eq!(values, &recorded[title], "{program} on {machine}: {title}");
        }
        assert!(run["F1"].iter().any(|value| *value != run["F1"][0]), "the robot moves");
    }
}

#[test]
fn images_run_like_their_sources() {
    let folder = Folder::new();
    folder.line("track --periods 50 --csv rec.csv -q").ok();
    for program in ["tracking", "tracking_literal"] {
        for machine in ["t3", "t1"] {
            let source = source(&format!("{program}.s"));
            folder.line(&format!("asm {source} --machine {machine} -o image")).ok();
            let table = folder.line(&format!("run {source} -m {machine} --inputs rec.csv --outputs -")).ok();
            assert_eq!(folder.line("run image --inputs rec.csv --outputs -").ok(), table);
            let mut stats = folder.line(&format!("run {source} -m {machine} --inputs rec.csv --stats")).ok();
            assert_eq!(folder.line("run image --inputs rec.csv --stats").ok(), stats);
            // The program may also come from standard input.
            let image = folder.read("image");
            stats = folder.fed("run - --inputs rec.csv --stats", &image).ok();
            assert!(stats.starts_with("50 periods on "), "{stats}");

            folder.line("disasm image -o again.s").ok();
            folder.line(&format!("asm again.s -m {machine} --strip -o again")).ok();
            folder.line(&format!("asm {source} -m {machine} --strip -o stripped")).ok();
            assert!(folder.read("again") == folder.read("stripped"), "{program} on {machine}");
            assert_eq!(folder.line("run stripped --inputs rec.csv --stats").ok(), stats);
        }
    }
}

#[test]
fn an_image_is_proved_to_be_its_source() {
    let folder = Folder::new();
    let text =
        ".schedule on\n.input a, b\n.output y\n.period\np:\n.reg t\n fmul t, a, b\n fadd y, t, b\n wait p\n";
    folder.write("a.s", text);
    folder.write("b.s", text.replace("fmul t, a, b", "fmul t, a, a"));
    let verified = "verified: the image is its source";
    assert!(folder.line("asm a.s -m f3 --verify").ok().contains(verified));
    assert!(folder.line("verify a.takt a.s").ok().starts_with(verified));
    let json = folder.line("verify a.takt a.s --json").ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["verified"], &json["sections_compared"]), (&true.into(), &1.into()));

    let done = folder.line("verify a.takt b.s");
    assert_eq!(done.status, Some(1));
    assert!(
        done.stdout.starts_with("not verified: b.s:7: output `y` gets another value in b.s:8"),
        "{}",
        done.stdout
    );
    let done = folder.line("verify a.takt b.s --json");
    let json: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!((done.status, &json["verified"], &json["place"]["line"]), (Some(1), &false.into(), &7.into()));
    assert!(folder.line("verify a.s a.s").stderr.contains("a.s is not an image"));
}

/// A program with everything that the tracking programs lack: data, branches, calls, integers, bits, manual bundles.
#[test]
fn a_program_that_halts() {
    let folder = Folder::new();
    let text = "\
.output sum, count:int, pattern:bits, never
.reg i:int n:int p:int x
        li      n, 3
        li      p, table
        mov     i, zero
        fadd    sum, zero, zero
next:   call    add
        iadd    i, i, 1
        ilt     x, i, n
        bnz     x, next
        mov     count, i
        mov     pattern, sum
        halt
add:    iadd    x, p, i
        ld      x, 0[x]
        fadd    sum, sum, x
        ret
_never: fadd    never, sum, sum
.data
table:  .float  0.5, 0.25, -1.75
";
    folder.write("sum.s", text);
    insta::assert_snapshot!("halts", folder.line("run sum.s -m f3 --stats").ok());
    let json: serde_json::Value = serde_json::from_str(&folder.line("run sum.s --json").ok()).unwrap();
    assert_eq!(
        json["outputs"],
        serde_json::json!({"sum": -1.0, "count": 3, "pattern": "0xbf800000", "never": null})
    );
    assert_eq!((&json["periods"], &json["cycles"]["min"]), (&0.into(), &serde_json::Value::Null));
    for machine in ["t3", "t1"] {
        folder.line(&format!("asm sum.s -m {machine} --strip")).ok();
        folder.line("disasm sum.takt -o again.s").ok();
        folder.line(&format!("asm again.s -m {machine} --strip -o again.takt")).ok();
        assert!(folder.read("again.takt") == folder.read("sum.takt"), "{machine}");
    }
}

#[test]
fn bounds_of_the_programs() {
    let folder = Folder::new();
    let mut text = String::new();
    for program in ["tracking", "tracking_literal"] {
        for machine in ["f3", "f1"] {
            let line = format!("bound {} -m {machine} --deadline 100us", source(&format!("{program}.s")));
            text += &format!("{program} {}\n", folder.line(&line).ok());
            folder.line(&format!("asm {} -m {machine} -o image", source(&format!("{program}.s")))).ok();
            let line = "bound image --deadline 100us --clock 125MHz";
            assert!(text.ends_with(&format!("{}\n", folder.line(line).ok())), "an image as its source");
        }
    }
    insta::assert_snapshot!("bounds", text);
}

#[test]
fn analyse_accounts_for_the_cycles_of_a_period() {
    let folder = Folder::new();
    let text = folder.line(&format!("analyse {} -m f3", source("tracking.s"))).ok();
    folder.line(&format!("asm {} -m f1 -o small", source("tracking.s"))).ok();
    insta::assert_snapshot!("analyse", format!("{text}\n{}", folder.line("analyse small").ok()));
    // With --reassemble: the same output, with an additional column and without the hint.
    let again = folder.line(&format!("analyse {} -m f3 --reassemble", source("tracking.s"))).ok();
    let (same, table) = again.split_once("\none cycle less in").unwrap();
    assert!(text.starts_with(same));
    insta::assert_snapshot!("analyse_reassembled", table);
    // The account equals the run's cycles for recorded inputs; an image has no source to reassemble.
    folder.line("track --periods 4 --csv rec.csv -q").ok();
    folder.line(&format!("asm {} -o image", source("tracking.s"))).ok();
    let run: serde_json::Value =
        serde_json::from_str(&folder.line("run image --inputs rec.csv --json").ok()).unwrap();
    for (periods, cycles) in [("--periods 1", "max"), ("", "min"), ("--periods 3", "min")] {
        let json = folder.line(&format!("analyse image --inputs rec.csv --json {periods}")).ok();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["cycles"], run["cycles"][cycles], "{periods}");
        assert_eq!(json["one_cycle_less"][0]["reassembled"], serde_json::Value::Null);
    }
    // A change that costs cycles is reported with the reason: each additional cycle is a stall of some kind.
    let json: serde_json::Value = serde_json::from_str(&folder.line("analyse small --json").ok()).unwrap();
    let less = json["one_cycle_less"].as_array().unwrap();
    let cycles = |value: &serde_json::Value| value.as_i64().unwrap();
    let worse = less.iter().filter(|unit| cycles(&unit["as_it_is"]) > cycles(&json["cycles"]));
    let told = worse.map(|unit| {
        let stalls: i64 = unit["stalls"].as_object().unwrap().values().map(cycles).sum();
        assert_eq!(cycles(&unit["as_it_is"]) - cycles(&json["cycles"]), stalls, "{unit}");
        // Except for a single cycle, the reason is the write port.
        assert!(stalls == 1 || cycles(&unit["stalls"]["write port"]) > 0, "{unit}");
    });
    assert!(told.count() > 2);
    // From standard input to standard output.
    let page = folder.fed("analyse - --html -", &folder.read("image")).ok();
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    const HALTS: &str = ".output y\n mov y, zero\n halt\n";
    let read = folder.fed("analyse - --reassemble", HALTS.as_bytes());
    assert!(read.stderr.contains("reads the source again: name its file"), "{}", read.stderr);
    folder.write("halts.s", HALTS);
    assert!(folder.line("analyse halts.s -m f3").ok().starts_with("what runs once on f3: "));
}

/// A loop with an early or late end and a branch inside: best and worst case, and a deadline exactly at the limit.
#[test]
fn a_deadline_decides_the_status() {
    let folder = Folder::new();
    let text = "\
.input x, n:int
.output y
.reg i:int sum
.once
        wait    period
.period
period: mov     i, n
        fadd    sum, x, x
        .loop_bound 8
next:   bz      x, skip
        fadd    sum, sum, x
skip:   isub    i, i, 1
        bnz     i, next
        fadd    y, sum, x
        wait    period
";
    folder.write("loop.s", text);
    insta::assert_snapshot!("bound_loop", folder.line("bound loop.s -m f3").ok());
    let json: serde_json::Value = serde_json::from_str(&folder.line("bound loop.s --json").ok()).unwrap();
    let worst = json["sections"][1]["in_time"]["worst"].as_u64().unwrap();
    assert_eq!(json["deadline"], serde_json::Value::Null);
    let kept = folder.line(&format!("bound loop.s --deadline {}", worst + 1)).ok();
    assert!(kept.ends_with("kept, 0 to spare\n"), "{kept}");
    for json in ["", " --json"] {
        let RunOutput { status, stdout, stderr } =
            folder.line(&format!("bound loop.s --deadline {worst}{json}"));
        assert_eq!((status, stderr.as_str()), (Some(1), ""));
        assert!(stdout.contains("not kept") || stdout.contains("\"kept\": false"), "{stdout}");
    }
    // One cycle takes eight nanoseconds.
    let time = |cycles: u64| folder.line(&format!("bound loop.s --deadline {}ns", cycles * 8)).status;
    assert_eq!((time(worst), time(worst + 1)), (Some(1), Some(0)));
}

#[test]
fn eval_in_the_format_of_testfloat() {
    let folder = Folder::new();
    // Operands, result, flags; further columns of TestFloat are ignored.
    let cases: [(&str, &[(&str, &str)]); 8] = [
        (
            "fadd",
            &[
                ("3F800000 40000000 40400000 00", "40400000 00"),
                ("00000001 00000001", "00000002 00"),
                ("7F7FFFFF 7F7FFFFF 7F800000 05", "7F800000 04"),
                ("7F800000 FF800000", "7FC00000 10"),
                ("7F800001 00000000", "7FC00000 10"),
                ("FFC12345 00000000", "7FC00000 00"),
                ("80000000 80000000", "80000000 00"),
                ("  0x3f800000\tbf800000\r", "00000000 00"),
            ],
        ),
        ("fmul", &[("00800000 3F000000", "00400000 00"), ("7F800000 00000000", "7FC00000 10")]),
        (
            "fdiv",
            &[
                ("3F800000 00000000", "7F800000 08"),
                ("00000000 00000000", "7FC00000 10"),
                ("1 1", "3F800000 00"),
            ],
        ),
        (
            "fsqrt",
            &[
                ("40800000 40000000 00", "40000000 00"),
                ("BF800000", "7FC00000 10"),
                ("80000000", "80000000 00"),
            ],
        ),
        ("itof", &[("FFFFFFFF", "BF800000 00"), ("7FFFFFFF", "4F000000 00")]),
        ("ftoi", &[("40200000", "00000002 00"), ("40600000", "00000004 00"), ("7F800000", "7FFFFFFF 10")]),
        ("fsat", &[("40400000 BF800000", "3F800000 00"), ("C0400000 3F800000", "BF800000 00")]),
        ("sel", &[("1 2 3", "00000002 00"), ("0 2 3", "00000003 00")]),
    ];
    for (operation, lines) in cases {
        let input: String = lines.iter().flat_map(|(operands, _)| [operands, "\n"]).collect();
        let output: String = lines.iter().flat_map(|(_, result)| [result, "\n"]).collect();
        for options in ["", "--reference", "--machine t1"] {
            if options == "--reference" && !HAS_SOFTFLOAT {
                let stderr = folder.fed(&format!("eval {operation} {options}"), b"").stderr;
                assert!(stderr.starts_with("error: --reference needs Berkeley SoftFloat"), "{stderr}");
                continue;
            }
            let line = format!("eval {operation} {options}");
            assert_eq!(folder.fed(&line, input.as_bytes()).ok(), output, "{line}");
            assert_eq!(
                folder.fed(&line, input.trim_end().as_bytes()).ok(),
                output,
                "without the last line end"
            );
        }
    }
    // Input longer than any buffer, split at arbitrary positions.
    let many = "3F800000 40000000\n".repeat(100_000);
    assert_eq!(folder.fed("eval fsub", many.as_bytes()).ok(), "BF800000 00\n".repeat(100_000));
    // Answers come before the end of the input.
    let mut command = folder.command(&["eval", "fneg"]);
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    let (mut stdin, stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    std::io::Write::write_all(&mut stdin, b"00000000\n").unwrap();
    let mut answer = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut answer).unwrap();
    assert_eq!(answer, "80000000 00\n");
    drop(stdin);
    assert!(child.wait().unwrap().success());
}

/// Replaces `in cycle 12` by `in cycle N`: cycles depend on latencies, which this test does not cover.
fn without_cycles(text: &str) -> String {
    let mut pieces = text.split("in cycle ");
    let mut out = pieces.next().unwrap().to_owned();
    for piece in pieces {
        out.push_str("in cycle N");
        out.push_str(piece.trim_start_matches(|c: char| c.is_ascii_digit()));
    }
    out
}

#[test]
fn nan_on_an_output_is_a_warning() {
    let folder = Folder::new();
    let text = ".input a\n.output F\n.once\n wait p\n.period\np: fdiv F, a, zero\n wait p\n";
    folder.write("nan.s", text);
    folder.write("in.csv", format!("a\n{}1\n", "0\n".repeat(7)));
    let done = folder.line("run nan.s --inputs in.csv --outputs out.csv");
    assert_eq!(done.status, Some(0));
    insta::assert_snapshot!("nan", without_cycles(&done.stderr));
    assert_eq!(columns(&folder.read_text("out.csv"))["F"], [["NaN"; 7].as_slice(), &["inf"]].concat());
    let json = folder.line("run nan.s --inputs in.csv --json").stdout;
    assert!(json.contains("\"nan_writes\": 7"), "{json}");
    // Programs without periods behave in the same way.
    folder.write("once.s", ".output F\n fdiv F, zero, zero\n halt\n");
    let done = folder.line("run once.s");
    assert_eq!(without_cycles(&done.stderr), "warning: NaN written to F in cycle N by bundle 0 (once.s:2)\n");
}

/// Rows have a maximum length, tables do not; any source and any line endings are accepted.
#[test]
fn long_tables() {
    let folder = Folder::new();
    folder.write("sum.s", ".input n:int\n.state s:int\n.output k:int\n.once\n mov s, zero\n wait p\n.period\np: iadd s, s, n\n mov k, s\n wait p\n");
    let rows = 300_000;
    let table = format!("\u{feff}other, n\r\n{}", "ignored,1\r\n".repeat(rows));
    let json = folder.fed("run sum.s --inputs - --json", table.as_bytes()).ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["periods"], &json["outputs"]["k"]), (&rows.into(), &rows.into()));
    // --periods ends the run earlier.
    let text = folder.fed("run sum.s --inputs - --outputs - --periods 3", table.as_bytes()).ok();
    assert_eq!(columns(&text)["k"], ["1", "2", "3"]);
}

/// Input ports without values are 0, in all commands that run programs.
#[test]
fn without_inputs_the_ports_are_zero() {
    let folder = Folder::new();
    folder.write("law.s", ".input a, n:int\n.output F, k:int\n.once\n iadd k, n, 7\n wait p\n.period\np: fadd F, a, 1.0\n iadd k, n, 2\n wait p\n");
    let text = folder.line("run law.s --periods 2").ok();
    assert!(text.contains("without --inputs the input ports are 0\n  F = 1.0\n  k = 2\n"), "{text}");
    folder.line("run law.s --periods 2 --outputs zero.csv").ok();
    folder.write("in.csv", "a,n\n0,0\n0,0\n");
    folder.line("run law.s --inputs in.csv --outputs given.csv").ok();
    assert_eq!(folder.read_text("zero.csv"), folder.read_text("given.csv"));
    assert_eq!(
        folder.line("analyse law.s --json").ok(),
        folder.line("analyse law.s --inputs in.csv --json").ok()
    );
    let debug = folder.fed("debug law.s", b"goto period 1\nprint F, k, a\n").ok();
    assert!(debug.contains("F = 1.0") && debug.contains("k = 2"), "{debug}");
    // Programs without periods behave in the same way.
    folder.write("once.s", ".input a\n.output F\n fadd F, a, 1.0\n halt\n");
    assert!(folder.line("run once.s").ok().contains("F = 1.0"));
}

#[test]
fn a_missed_deadline_is_counted() {
    let folder = Folder::new();
    let json = |line: &str| -> serde_json::Value { serde_json::from_str(&folder.line(line).ok()).unwrap() };
    assert_eq!(json("track --periods 20 --json")["deadlines_missed"], 0);
    // 100 cycles take 100 µs at this clock.
    assert!(json("track --periods 20 --json --clock 1")["deadlines_missed"].as_u64().unwrap() >= 19);
}

#[test]
fn asm_reports_transformations_of_the_source() {
    let folder = Folder::new();
    let source = source("tracking.s");
    let text = folder.line(&format!("asm {source} -o image")).ok();
    let json = folder.line(&format!("asm {source} -o image --json")).ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["messages"], serde_json::json!([]));
    let blocks = json["blocks"].as_array().unwrap();
    let period = blocks.iter().find(|block| block["name"] == "period").unwrap();
    assert!(period["cycles"].as_u64() >= period["bound"].as_u64(), "{period}");
    let row: Vec<&str> =
        text.lines().find(|line| line.starts_with("  period ")).unwrap().split_whitespace().collect();
    for (text, key) in row[1..5].iter().zip(["operations", "bundles", "cycles", "bound"]) {
        assert_eq!(*text, period[key].to_string());
    }

    let listing = folder.line(&format!("asm {source} --listing -")).ok();
    assert!(listing.starts_with("; ") && listing.contains("tracking.s:"), "{listing}");
    assert_eq!(folder.list(), ["image"], "a listing asks for no image");
    let symbols = folder.line(&format!("asm {source} --symbols -")).ok();
    assert!(symbols.contains("period"), "{symbols}");
    folder.line(&format!("asm {source} --check")).ok();
    assert_eq!(folder.list(), ["image"]);
    folder.line(&format!("asm {source} --readmemh memories")).ok();
    let code = folder.read_text("memories/code_mul.hex");
    assert_eq!(code.lines().count() as u64, json["bundles"].as_u64().unwrap());
    // For unscheduled code, only size and memories are printed; there are no blocks.
    let unscheduled = folder.line(&format!("asm {source} -o image --schedule off")).ok();
    assert_eq!(unscheduled.lines().count(), 2, "{unscheduled}");
}

#[test]
fn the_plot_shows_the_path() {
    let folder = Folder::new();
    folder.write("square.ngc", "G0 X0 Y0 Z700\nG1 X10 F6000\nG1 Y10\nG1 X0\nG1 Y0\nG0 X5 Y5\n");
    folder.line("track --gcode square.ngc --plot p.svg").ok();
    let svg = folder.read_text("p.svg");
    assert!(
        svg.starts_with("<svg width=\"720\" height=\"700\" viewBox=\"0 0 5760 5600\""),
        "{}",
        &svg[..200]
    );
    assert!(svg.trim_end().ends_with("</svg>"));
    for text in [
        "Tool path of square.ngc",
        "tool, deviation × 1,000",
        "x, mm",
        "y, mm",
        "time, s",
        "error, µm",
        "required while cutting: 10 µm",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    // The cutting moves form one polyline that is as wide as high; the legend's is shorter.
    let lines = svg.lines().filter(|line| line.starts_with("<polyline") && line.contains("1F4E9C"));
    let line = lines.max_by_key(|line| line.len()).unwrap();
    let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
    let points: Vec<(f64, f64)> = points
        .split_whitespace()
        .map(|point| point.split_once(',').unwrap())
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect();
    let extent = |pick: fn(&(f64, f64)) -> f64| {
        points.iter().map(pick).fold(f64::MIN, f64::max) - points.iter().map(pick).fold(f64::MAX, f64::min)
    };
    assert!(extent(|p| p.0) > 500.0, "{points:?}");
    assert!(
        (extent(|p| p.0) / extent(|p| p.1) - 1.0).abs() < 0.005,
        "{} by {}",
        extent(|p| p.0),
        extent(|p| p.1)
    );
    assert_eq!(folder.line("track --gcode square.ngc --plot -").ok(), svg);
    // Deviations are lines some millimetres beside the path, so their end points are not on it.
    let deviating = svg.lines().filter(|line| line.starts_with("<polyline") && line.contains("D08810"));
    let longest = deviating.map(|line| line.matches(',').count()).max().unwrap_or(0);
    assert!(longest > 20, "{longest} points");
    // The plot for the terminal, in dots; without colours in a pipe.
    let drawn = folder.line("track --gcode square.ngc --plot").ok();
    for text in [
        "Tool path of square.ngc",
        "tool, deviation × 1,000",
        "x, mm",
        "time, s",
        "required while cutting: 10 µm",
        "⡇",
        "└─",
    ] {
        assert!(drawn.contains(text), "{text}:\n{drawn}");
    }
    assert!(!drawn.contains('\x1b') && drawn.contains("Time of one period"));
    let refused = folder.line("track --plot --json");
    assert_eq!(refused.status, Some(2));
    assert!(refused.stderr.contains("--plot with --json needs the name of a file"), "{}", refused.stderr);
}

#[test]
fn references() {
    let folder = Folder::new();
    let manual = folder.line("isa --format markdown").ok();
    assert!(manual.starts_with("# Takt's instruction set\n") && manual.contains("### fadd\n"));
    insta::assert_snapshot!("isa", folder.line("isa").ok());
    let isa: serde_json::Value = serde_json::from_str(&folder.line("isa --json").ok()).unwrap();
    assert_eq!(
        isa["instructions"].as_array().unwrap().iter().filter(|row| row["mnemonic"] == "fadd").count(),
        1
    );
    assert!(folder.line("isa fadd").ok().contains("d = a + b"));
    let one: serde_json::Value = serde_json::from_str(&folder.line("isa fadd --json").ok()).unwrap();
    assert_eq!(one["mnemonic"], "fadd");
    let machines: serde_json::Value = serde_json::from_str(&folder.line("machines --json").ok()).unwrap();
    let names: Vec<&str> = machines.as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, takt_isa::MACHINES.iter().map(|machine| machine.name).collect::<Vec<_>>());
    let text = folder.line("machines").ok();
    assert!(names.iter().all(|name| text.contains(*name)), "{text}");
    assert!(folder.line("man").ok().contains(".TH takt 1"));
    assert!(folder.line("man track").ok().contains("\\-\\-gcode"));
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        assert!(folder.line(&format!("completions {shell}")).ok().contains("track"), "{shell}");
    }
}

/// Memory depths in the name of a machine, on the command line or in the source, from assembler to circuit.
#[test]
fn memories_of_other_depths() {
    let folder = Folder::new();
    let source = ".output y\n.data\ntable: .space 5000\nlast: .float 2\n.period\np: ld y, last\n wait p\n";
    folder.write("deep.s", source);
    folder.write("named.s", format!(".machine t3 data=8192\n{source}"));
    let refused = folder.line("asm deep.s");
    assert!(
        refused.status != Some(0)
            && refused.stderr.contains("`.machine t3 data=8192` makes room for it: 16 block RAMs"),
        "{refused:?}"
    );
    for asked in [
        "asm deep.s -m t3,data=8192 -o deep.takt",
        "asm named.s -m t3,data=8192 -o named.takt",
        "asm named.s",
    ] {
        let text = folder.line(asked).ok();
        let memories = "\nmemories: 1024 bundles of program memory (7 block RAMs), 8192 words of data memory (16 block RAMs)\n";
        assert!(text.contains("5001 data words for t3,data=8192\n") && text.contains(memories), "{text}");
    }
    assert!(folder.line("run deep.takt --periods 1").ok().contains("y = 2.0"));
    for (line, told) in [
        ("run deep.takt -m t3", "deep.takt is for t3,data=8192, not for t3"),
        ("asm named.s -m t1", "named.s is for t3,data=8192, not for t1"),
        ("run named.s -m t3,data=16384", "named.s is for t3,data=8192, not for t3,data=16384"),
        ("machines t3,dat=8192", "a machine has no option `dat`; did you mean `data`? (options: code, data)"),
        (
            "asm deep.s -m t3,data=5001",
            "`data=5001`: a depth is a power of two from 2 to 65536; the next is 8192",
        ),
    ] {
        let done = folder.line(line);
        assert!(done.status != Some(0) && done.stderr.contains(told), "{line}: {}", done.stderr);
    }
    let text = folder.line("machines t1,code=4096").ok();
    assert!(
        text.starts_with("t1,code=4096: ") && text.contains("4096 bundles of program memory (12 block RAMs)"),
        "{text}"
    );
    folder.line("rtl -m t3,data=8192 -o circuit").ok();
    assert!(folder.read_text("circuit/takt_t3_data_8192.v").contains("module takt_t3_data_8192 "));
}

/// Options and operands that a help text introduces, and whether an explanation follows beside or below each.
fn explained(help: &str) -> BTreeMap<String, bool> {
    let lines: Vec<&str> = help.lines().collect();
    let begins = |line: &str, what: &[&str]| what.iter().any(|what| line.starts_with(what));
    let indent = |line: &str| line.len() - line.trim_start().len();
    let entries = lines
        .iter()
        .enumerate()
        .filter(|(_, line)| matches!(indent(line), 2 | 6) && begins(line.trim_start(), &["-", "<", "["]));
    let entry = |(i, line): (usize, &&str)| {
        let (spelling, beside) = line.trim_start().split_once("  ").unwrap_or((line.trim_start(), ""));
        let below = lines.get(i + 1).is_some_and(|next| indent(next) >= 10 && !next.trim().is_empty());
        (spelling.to_owned(), below || !beside.trim().is_empty())
    };
    entries.map(entry).collect()
}

/// Options that a text names, without their values: `--gcode`, `-m`, `-D` of `-DNDEBUG`.
fn options(text: &str) -> Vec<&str> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-'));
    let options = words.filter(|word| word.starts_with('-') && !word.trim_start_matches('-').is_empty());
    options.map(|word| if word.starts_with("--") { word } else { &word[..2] }).collect()
}

/// A certificate proves the bounds that are printed; a changed one, or one of another program, is refused with status 1 and the place.
#[test]
fn bounds_are_certified_and_checked() {
    let folder = Folder::new();
    let law = ".input n:int, x\n.output y\n.reg k:int\n.period\np: li k, 4\n.loop_bound 4\nnext: isub k, k, 1\n bnz k, next\n \
               bz n, skip\n fdiv y, x, x\nskip: wait p\n";
    folder.write("law.s", law);
    folder.write("other.s", law.replace("fdiv", "fmul"));
    let bounds = folder.line("bound law.s").ok();
    assert_eq!(folder.line("bound law.s --certificate law.json").ok(), bounds);
    let json = folder.line("bound law.s --json").ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let proved = folder.line("verify --bound law.json law.s").ok();
    let worst = json["sections"][0]["cycles"]["worst"].to_string();
    assert!(proved.starts_with("proved: ") && proved.contains(&format!("{worst}\n")), "{proved}");
    folder.line("asm law.s").ok();
    assert_eq!(folder.line("verify law.takt --bound law.json").ok(), proved, "an image, too");
    let json = folder.line("verify --bound law.json law.s --json").ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["proved"], true);
    assert_eq!(json["sections"].as_array().map(Vec::len), Some(2));

    let refused = |line: &str| {
        let done = folder.line(line);
        assert_eq!(done.status, Some(1), "{line}: {}", done.stderr);
        done.stdout + &done.stderr
    };
    assert!(refused("verify --bound law.json other.s").contains("not proved: the certificate is of another"));
    assert!(refused("verify --bound law.json law.s -m t1").contains("is for machine `t3`"));
    let text = folder.read_text("law.json");
    let worst = text.find("\"pending\":[[").unwrap();
    let changed = text[worst..].find(']').map(|at| worst + at).unwrap();
    folder.write("less.json", format!("{}9{}", &text[..changed], &text[changed..]));
    let shown = refused("verify --bound less.json law.s");
    assert!(shown.starts_with("not proved: "), "{shown}");
    let json: serde_json::Value =
        serde_json::from_str(&refused("verify --bound less.json law.s --json")).unwrap();
    assert_eq!(json["proved"], false);
    folder.write("cut.json", &text[..text.len() / 2]);
    assert!(refused("verify --bound cut.json law.s").contains("not proved: this is no certificate: EOF"));
    folder.write("endless.s", ".input n:int\na: bnz n, a\n halt\n");
    assert!(refused("bound endless.s --certificate endless.json").contains("has no bound"));
    for (line, why) in [
        ("verify --bound law.json law.s law.takt", "expected one program"),
        ("verify law.s", "has no source: expected pairs"),
        ("bound law.s --certificate law.s", "law.s"),
    ] {
        let done = folder.line(line);
        assert!(done.status == Some(2) && done.stderr.contains(why), "{line}: {}", done.stderr);
    }
    let files = ["cut.json", "endless.s", "law.json", "law.s", "law.takt", "less.json", "other.s"];
    assert_eq!(folder.list(), files);
}

/// Commands that a help text lists.
fn commands(help: &str) -> Vec<&str> {
    let list = help.split_once("\nUsage: ").unwrap().1.split_once("\nOptions:\n").unwrap().0;
    let names = list.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.map(|line| line.split_whitespace().next().unwrap()).filter(|name| *name != "help").collect()
}

/// Help has one width: that of the terminal, or, in a pipe, of the environment's `COLUMNS`.
#[test]
fn help_has_the_width_that_the_environment_states() {
    let folder = Folder::new();
    for (stated, most) in [("60", 60), ("200", 110)] {
        for line in ["--help", "run --help", "board sim --help"] {
            let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
            command.env("COLUMNS", stated);
            let longest = RunOutput::of(command).ok().lines().map(|line| line.chars().count()).max();
            assert!(
                longest.is_some_and(|longest| longest > most - 12 && longest <= most),
                "{line}: {longest:?}"
            );
        }
    }
}

/// A message about missing inputs names the table beside the program; one about a missing table names those in the folder.
#[test]
fn messages_name_the_tables_that_lie_near() {
    let folder = Folder::new();
    folder.write("law.s", ".input x\n.output y\n.period\np: mov y, x\n wait p\n");
    let bare = folder.line("run law.s").stderr;
    assert!(bare.ends_with("--inputs or --periods\n"), "{bare}");
    folder.write("law.csv", "x\n1\n");
    let refused = folder.line("run law.s").stderr;
    assert!(refused.ends_with("such as `--inputs law.csv`\n"), "{refused}");
    let missing = folder.line("run law.s --inputs recorded.csv").stderr;
    assert!(missing.ends_with("; this folder has law.csv\n"), "{missing}");
    let counted = folder.line("run law.s --inputs law.csv").ok();
    assert!(
        counted.starts_with("1 period on t3: ") && counted.contains(" cycles, 0 deadlines missed\n"),
        "{counted}"
    );
}

/// Editors' files are listed, written when asked for, and not written twice; an own configuration stays.
#[test]
fn an_editor_is_set_up_once() {
    let folder = Folder::new();
    let line = |line: &str| {
        let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
        command.env("HOME", folder.path()).env_remove("XDG_CONFIG_HOME");
        RunOutput::of(command).ok()
    };
    let listed = line("editor neovim");
    assert!(listed.starts_with("create ") && listed.contains(".config/nvim/plugin/takt.lua\n"), "{listed}");
    assert!(
        listed.ends_with("nothing is written; --write does it\n") && folder.list().is_empty(),
        "{listed}"
    );
    std::fs::create_dir_all(folder.path().join(".config/helix")).unwrap();
    folder.write(".config/helix/languages.toml", "# mine");
    for (editor, file) in [
        ("neovim", ".config/nvim/plugin/takt.lua"),
        ("helix", ".config/helix/languages.toml"),
        ("emacs", ".emacs.d/takt.el"),
    ] {
        let written = line(&format!("editor {editor} --write"));
        assert!(written.contains("\nwritten. ") && folder.read_text(file).contains("takt"), "{written}");
        assert!(written.contains("\nNext: `"), "{written}");
        let again = line(&format!("editor {editor} --write"));
        assert!(again.contains(" as it is\n") && again.contains("nothing to do. "), "{again}");
    }
    let helix = folder.read_text(".config/helix/languages.toml");
    assert!(helix.starts_with("# mine\n") && !helix.contains("/path/to"), "{helix}");
    assert!(folder.read_text(".emacs.d/init.el").contains("(load (expand-file-name \"takt\""));
}

/// A file that is no source has an error in each line: the first ones are enough.
#[test]
fn many_errors_are_counted() {
    let folder = Folder::new();
    folder.write("text.s", "This is no source.\n".repeat(60));
    let refused = folder.line("run text.s").stderr;
    assert_eq!(refused.matches("error[").count(), 20, "{refused}");
    assert!(refused.ends_with("… and 40 more errors\n"), "{refused}");
}

/// Every command has short and long help; each option and operand is explained; examples use existing options; and no line exceeds the
/// promised width.
#[test]
fn help() {
    let folder = Folder::new();
    let top = folder.line("--help").ok();
    insta::assert_snapshot!("help", top);
    assert_eq!(folder.line("help").ok(), top);
    assert_eq!(folder.line("--version").ok(), format!("takt {}\n", env!("CARGO_PKG_VERSION")));

    let commands = commands(&top);
    assert!(commands.contains(&"track") && commands.contains(&"man"), "{commands:?}");
    let long = |command: &str| folder.line(&format!("{command} --help")).ok();
    let texts: BTreeMap<&str, String> = commands.iter().map(|command| (*command, long(command))).collect();
    for (command, text) in &texts {
        assert!(text.starts_with(|c: char| c.is_ascii_uppercase()), "{command} says what it does: {text}");
        assert!(text.contains(&format!("\nUsage: takt {command}")), "{text}");
        let short = folder.line(&format!("{command} -h")).ok();
        assert!(short.lines().count() <= text.lines().count(), "{command}");
        let spelled = explained(text);
        assert!(spelled.len() >= 2, "{command}: at least --color and --help: {spelled:?}");
        for entry in spelled.iter().chain(&explained(&short)) {
            assert!(*entry.1, "{command}: nothing explains {}", entry.0);
        }
        assert!(spelled.keys().eq(explained(&short).keys()), "{command}: -h and --help list the same");
    }
    for text in texts.values().chain([&top]) {
        for line in text.lines() {
            assert!(line.chars().count() <= 100, "{line}");
        }
        // Text beside an example is a comment; a vertical bar separates programs.
        let programs = text.lines().filter_map(|line| line.trim().split("  ").next()?.split(" | ").into());
        for example in programs.flatten().filter_map(|program| program.strip_prefix("takt ")) {
            let command = example.split(' ').next().unwrap();
            let known = explained(texts.get(command).unwrap_or_else(|| panic!("no command: takt {example}")));
            let known: Vec<&str> = known.keys().flat_map(|spelling| options(spelling)).collect();
            for option in options(example) {
                assert!(known.contains(&option), "no {option}: takt {example}");
            }
        }
    }
}

const WORDY: [&str; 9] = [
    "isa",
    "isa --json",
    "machines --json",
    "man",
    "completions bash",
    "--help",
    "track --help",
    "track --periods 2000 --csv -",
    "track --periods 20 --json",
];

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = Folder::new();
    for line in WORDY {
        let mut command = folder.command(&line.split(' ').collect::<Vec<_>>());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        let done = RunOutput::from(child.wait_with_output().unwrap());
        assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""), "{line}");
    }
    // Interrupt the command while it is working.
    let mut child = folder.command(&["eval", "fneg"]).stdin(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    drop(child.stdout.take());
    let feed = || {
        (0..1000)
            .try_for_each(|_| std::io::Write::write_all(&mut stdin, "00000000\n".repeat(1000).as_bytes()))
    };
    assert!({ feed }().is_err(), "it has stopped reading");
    let done = RunOutput::from(child.wait_with_output().unwrap());
    assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""));
}

#[test]
fn a_full_disk_is_an_error() {
    let folder = Folder::new();
    for line in WORDY {
        let mut command = folder.command(&line.split(' ').collect::<Vec<_>>());
        command.stdout(std::fs::File::options().write(true).open("/dev/full").unwrap());
        let done = RunOutput::of(command);
        let text = "error: cannot write standard output: No space left on device\n";
        assert_eq!((done.status, done.stderr.as_str()), (Some(1), text), "{line}");
    }
}

#[test]
fn colour_is_for_terminals() {
    let folder = Folder::new();
    folder.write("bad.s", " fad a, b, b\n");
    for line in ["asm bad.s", "run nowhere"] {
        assert!(!folder.line(line).stderr.contains('\x1b'), "{line}");
        assert!(!folder.line(&format!("{line} --color never")).stderr.contains('\x1b'));
        let coloured = folder.line(&format!("{line} --color always")).stderr;
        assert!(coloured.contains("\x1b["), "{coloured}");
    }
}

#[cfg(unix)]
#[test]
fn names_of_files_need_not_be_text() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let program = OsStr::from_bytes(b"pro\xffgram.s");
    let table = OsStr::from_bytes(b"\xfe.csv");
    folder.write(program, ".input a\n.output F\n.once\n wait p\n.period\np: fadd F, a, a\n wait p\n");
    folder.write(table, "a\n1\n");
    let line = [
        OsStr::new("run"),
        program,
        OsStr::new("-mf3"),
        OsStr::new("--inputs"),
        table,
        OsStr::new("--outputs"),
        OsStr::new("-"),
    ];
    assert_eq!(folder.takt(&line).ok(), "F,cycles\n2.0,6\n");
    folder.takt(&[OsStr::new("asm"), program]).ok();
    assert!(folder.path().join(OsStr::from_bytes(b"pro\xffgram.takt")).exists());
    let done = folder.takt(&[OsStr::new("run"), OsStr::from_bytes(b"no\xff")]);
    assert_eq!(done.stderr, "error: cannot open no\u{fffd}: No such file or directory\n");
}

/// An output through a symbolic link replaces the target and keeps its permissions; devices are written directly.
#[cfg(unix)]
#[test]
fn outputs_go_to_the_named_files() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = Folder::new();
    folder.write("prog.s", " halt\n");
    folder.write("real", "");
    let real = folder.path().join("real");
    std::fs::set_permissions(&real, std::fs::Permissions::from_mode(0o640)).unwrap();
    symlink("real", folder.path().join("link")).unwrap();
    folder.line("asm prog.s -o link").ok();
    assert!(folder.path().join("link").is_symlink());
    assert!(folder.read("real").starts_with(b"\x7fELF"));
    assert_eq!(std::fs::metadata(&real).unwrap().permissions().mode() & 0o777, 0o640);
    // Files other than regular ones are written, never replaced. The test uses a pipe, since a bug would destroy /dev/null.
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read(pipe).unwrap()
    });
    folder.line("asm prog.s -o pipe").ok();
    assert!(!std::fs::metadata(&pipe).unwrap().is_file());
    assert!(reader.join().unwrap().starts_with(b"\x7fELF"));

    std::fs::set_permissions(&real, std::fs::Permissions::from_mode(0o440)).unwrap();
    let done = folder.line("asm prog.s -o real --schedule on");
    assert_eq!((done.status, done.stderr.as_str()), (Some(1), "error: cannot write real: it is read-only\n"));
}

/// Rows completed before a fault are written, to files and to pipes; without rows, and after a mistake in the inputs, a file is left
/// unchanged.
#[test]
fn keeps_rows_completed_before_a_fault() {
    const TABLE: &str = ".input i:int\n.output y\n.once\n wait loop\n.period\nloop: ld y, table[i]\n wait loop\n.data\ntable: .float 1.0, 2.0\n";
    let folder = Folder::new();
    folder.write("table.s", TABLE);
    folder.write("core.toml", "tick = 100\n[[core]]\nname = \"c\"\nprogram = \"table.s\"\nmachine = \"t3\"\n[[wire]]\nfrom = \"host.i\"\nto = \"c.i\"\n[[wire]]\nfrom = \"c.y\"\nto = \"host.y\"\n");
    folder.write("faults.csv", "i\n0\n1\n0\n99999\n1\n");
    folder.write("at-once.csv", "i\n99999\n1\n");
    folder.write("wrong.csv", "i\n1\n0\nx\n");
    // Program, inputs, completed rows, and whether the rows are kept.
    for (program, inputs, rows, keeps) in [
        ("table.s", "faults.csv", 3, true),
        ("table.s", "wrong.csv", 2, false),
        ("table.s --periods 9", "faults.csv", 3, true),
        ("table.s --max-cycles 40", "faults.csv", 3, true),
        ("core.toml", "faults.csv", 3, true),
        ("core.toml", "wrong.csv", 2, false),
        ("table.s", "at-once.csv", 0, false),
    ] {
        folder.write("out.csv", "as it was\n");
        let piped = folder.line(&format!("run {program} --inputs {inputs} --outputs -"));
        let filed = folder.line(&format!("run {program} --inputs {inputs} --outputs out.csv"));
        assert_eq!((piped.status, filed.status), (Some(1), Some(1)), "{program} {inputs}");
        assert_eq!(piped.stderr, filed.stderr);
        assert_eq!(piped.stdout.lines().count(), rows + 1, "{program} {inputs}: {}", piped.stdout);
        let expected = if keeps { piped.stdout } else { "as it was\n".to_owned() };
        assert_eq!(folder.read_text("out.csv"), expected, "{program} {inputs}");
    }
    assert!(folder.list().iter().all(|name| !name.contains("partial")), "{:?}", folder.list());
}

/// Identical loop iterations share a line, with a count.
#[test]
fn stalls_of_a_loop_are_one_line() {
    const LOOP: &str = ".input x\n.output y\n.reg n:int s\n.once\n wait p\n.period\np: li n, 12\n mov s, x\nturn: fmul s, s, x\n fadd s, s, x\n isub n, n, 1\n bnz n, turn\n mov y, s\n wait p\n";
    let folder = Folder::new();
    folder.write("loop.s", LOOP);
    let text = folder.line("analyse loop.s -m f3").ok();
    let (_, stalls) = text.split_once("the longest:\n").unwrap();
    let (stalls, links) = stalls.split_once("\n\n").unwrap();
    let (_, links) = links.split_once("its longest links:\n").unwrap();
    let (links, _) = links.split_once("\n\n").unwrap();
    for list in [stalls, links] {
        let what: Vec<&str> = list.lines().map(|line| line.split_once("bundle").unwrap().1).collect();
        let once: std::collections::BTreeSet<&&str> = what.iter().collect();
        assert_eq!(once.len(), what.len(), "{list}");
    }
    assert!(stalls.contains("awaits s.1 from bundle 3 (loop.s:9) (12 times 4)\n"), "{stalls}");
    assert!(links.contains("s.2 through add (12 times 5)"), "{links}");
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("analyse loop.s -m f3 --json").ok()).unwrap();
    let all: u64 =
        stalls.lines().map(|line| line.split_whitespace().next().unwrap().parse::<u64>().unwrap()).sum();
    let total = text.split_once("stalls: ").unwrap().1.split(' ').nth(1).unwrap();
    assert_eq!(total.parse::<u64>().unwrap(), all, "nothing is left out: {text}");
    assert!(json["cycles"].as_u64().unwrap() > all);
}

/// For a command name from another tool, or one of similar meaning, the error suggests Takt's command.
#[test]
fn unknown_commands_suggest_existing_ones() {
    let folder = Folder::new();
    for (wrong, tip) in [
        ("simulate x.s", "`takt run` runs a program on the emulator"),
        ("--color never WCET x.s", "`takt bound` bounds the cycles of each section"),
        ("monte-carlo", "`takt track --monte-carlo` drives robots that differ"),
        ("analize x.s", "a similar subcommand exists: 'analyse'"),
    ] {
        let done = folder.line(wrong);
        assert_eq!((done.status, done.stdout.as_str()), (Some(2), ""));
        assert!(done.stderr.contains(&format!("tip: {tip}\n")), "{}", done.stderr);
    }
    let done = folder.line("board simulate");
    assert!(!done.stderr.contains("takt run"), "{}", done.stderr);
}

/// States outside their ranges at the start, and hazards, are reported and determine the exit status.
#[test]
fn hidden_rows_count_for_the_status_of_accuracy() {
    let folder = Folder::new();
    let program = |once: &str, period: &str| {
        format!(
            ".input x\n.range x = 0, 4\n.output y, z\n.state s\n.range s = -1, 1\n.once\n{once}\n wait p\n.period\n\
             p: {period}\n mov y, s\n mov z, x\n mov s, 0.5\n wait p\n"
        )
    };
    folder.write("holds.s", program(" mov s, 1.0", "nop"));
    let holds = folder.line("accuracy holds.s");
    assert_eq!((holds.status, holds.stderr.as_str()), (Some(0), ""));
    let text = "no conversion out of range is possible\nno integer sum wraps, no shift and no index is out of range\n";
    assert!(holds.stdout.contains(text), "{}", holds.stdout);

    folder.write("first.s", program(" mov s, 2.0", "nop"));
    let first = folder.line("accuracy first.s");
    let text = "then nothing above holds\n  s: [-1, 1], begins in [2, 2]\n";
    assert_eq!((first.status, first.stdout.ends_with(text)), (Some(1), true), "{}", first.stdout);
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("accuracy first.s --json").stdout).unwrap();
    assert_eq!(json["assumed"][0]["when"], "first period begins");

    folder.write("fits.s", program(".reg n:int\n mov s, 0.0", "fmul s, x, 1e9\n ftoi n, s"));
    let fits = folder.line("accuracy fits.s");
    assert_eq!(fits.status, Some(1));
    assert!(fits.stdout.contains(": the result may not fit a 32-bit integer: s.1 in ["), "{}", fits.stdout);
}

#[test]
fn accuracy_shows_literals_by_their_values() {
    let folder = Folder::new();
    folder.write(
        "literal.s",
        ".input x\n.output y\n.range x = 0, 1\n.schedule on\n.period\np: y = 0.3 / (x - 0.5)\n wait p\n",
    );
    let done = folder.line("accuracy literal.s");
    assert_eq!(done.status, Some(1));
    assert!(done.stdout.contains("6:8-22: the divisor may be zero: 0.3, "), "{}", done.stdout);
    assert!(!done.stdout.contains("x14"), "{}", done.stdout);
    // The output's row says which condition is missing.
    let row = done.stdout.lines().find(|line| line.starts_with("  y ")).expect("the row of y");
    assert!(row.contains(" bounded if ") && row.ends_with(" is never 0 at literal.s:6:8-22"), "{row}");
    let condition =
        "\nconditions that exclude these\n  `max(x, least)` keeps a divisor from zero; `.assume x >= least`";
    assert!(done.stdout.contains(condition), "{}", done.stdout);
    // Literals in a sum of integers are integers; a parameter has its name.
    folder.write(
        "sum.s",
        ".param n:int = 2 range 0..3\n.output k:int\n.period\np: k = n + 2147483647\n wait p\n",
    );
    let done = folder.line("accuracy sum.s");
    assert!(done.stdout.contains("the integer sum may wrap: n in [0, 3], 2147483647"), "{}", done.stdout);
}

/// With `--constants real`, 0.1, a named constant and one that is computed count as rounded; 0.5 is a binary32 number.
#[test]
fn constants_stand_for_reals_where_asked() {
    let folder = Folder::new();
    let of = |expression: &str| {
        let constant = if expression.contains('K') { ".const K = 0.3\n" } else { "" };
        let text = format!(
            "{constant}.ports latched\n.input x\n.output y\n.range x = 1, 8\n.period\np: y = {expression}\n wait p\n"
        );
        folder.write("c.s", text);
        let error = |line: &str| {
            let done = folder.line(line);
            assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""), "{line}");
            let json: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
            json["outputs"][0]["error"].as_f64().unwrap()
        };
        (error("accuracy c.s --json"), error("accuracy c.s --json --constants real"))
    };
    for (expression, real) in [("0.1*x", 0.1), ("K*x", 0.3), ("(1/3)*x", 1.0 / 3.0)] {
        let (exact, rounded) = of(expression);
        let by = 8.0 * (f64::from(real as f32) - real).abs();
        assert!((rounded - exact - by).abs() < 1e-12, "{expression}: {exact} {rounded} {by}");
    }
    let (exact, rounded) = of("0.5*x");
    assert_eq!(exact, rounded);
    folder.line("asm c.s -o c.elf");
    for (line, text) in [
        ("accuracy c.elf --constants real", "an image already"),
        ("accuracy s.toml --constants real", "name the source of one core"),
        ("accuracy c.s --inputs in.csv --constants real", "cannot be used with"),
    ] {
        let done = folder.line(line);
        assert!(done.status != Some(0) && done.stderr.contains(text), "{line}: {}", done.stderr);
    }
}

/// A root near zero makes the bound of one output, and nothing makes that of the other much larger than what runs show.
#[test]
fn accuracy_puts_bounds_beside_what_it_measures() {
    let folder = Folder::new();
    folder.write(
        "root.s",
        ".ports latched\n.input x\n.output y, z\n.range x = 0.1, 1\n.period\np: y = sqrt(max(x*x - 0.01, 0))\n z = 3*x\n wait p\n",
    );
    folder.write("in.csv", "x\n0.5\n0.7\n1\n");
    let done = folder.line("accuracy root.s --inputs in.csv --bound");
    assert_eq!(done.status, Some(0), "{}", done.stderr);
    let row = |name: &str| {
        let table = done.stdout.split("beside its bound").nth(1).expect("the table");
        let row = table.lines().find(|line| line.trim_start().starts_with(name)).expect("a row");
        row.split_whitespace()
            .skip(1)
            .take(3)
            .map(|cell| cell.parse().expect("a number"))
            .collect::<Vec<f64>>()
    };
    for (name, is_loose) in [("y", true), ("z", false)] {
        let row = row(name);
        assert!(
            (row[1] / row[0] / row[2] - 1.0).abs() < 1e-2 && (row[2] > 100.0) == is_loose,
            "{name}: {row:?}"
        );
    }
    for text in [
        "where bounds are lost",
        "warning[lost-bound]: the bound of `y` is ",
        "root.s:6:8",
        "^ fsqrt: error up to ",
        "a root is infinitely steep at zero; the operand is never below 0.2 in this run: `max(x, 0.2)`",
    ] {
        assert!(done.stdout.contains(text), "{text}: {}", done.stdout);
    }
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("accuracy root.s --inputs in.csv --bound --json").stdout).unwrap();
    assert_eq!((&json["bounds"][1]["name"], &json["each_period"]), (&"z".into(), &true.into()));
    let lost = &json["lost"];
    assert_eq!((lost.as_array().map(Vec::len), &lost[0]["places"][0]["line"]), (Some(1), &6.into()));
    assert_eq!((&lost[0]["places"][0]["column"], &lost[0]["code"]), (&8.into(), &"lost-bound".into()));
    assert!(lost[0]["help"].as_str().is_some_and(|help| help.contains("max(x, 0.2)")), "{lost}");
    let done = folder.line("accuracy root.s --bound");
    assert!(done.stderr.contains("--inputs"), "{}", done.stderr);

    // An output without a bound: the divisor's values in the run, of either sign. An image has no source to point into.
    for (rows, help) in [
        (
            "0.5\n0.7\n",
            "`d` is never below 0.2 in this run: `max(d, 0.2)` keeps it there, or `.assume d >= 0.2`",
        ),
        (
            "-0.5\n-0.7\n",
            "`d` is never above -0.7 in this run: `min(d, -0.7)` keeps it there, or `.assume d <= -0.7`",
        ),
    ] {
        folder.write(
            "open.s",
            ".ports latched\n.input x\n.output y\n.reg d\n.range x = -1, 1\n.period\np: d = x - 0.25\n y = 1/d\n wait p\n",
        );
        folder.write("in.csv", format!("x\n{rows}"));
        let done = folder.line("accuracy open.s --inputs in.csv --bound");
        assert_eq!(done.status, Some(0), "{}", done.stderr);
        for text in [
            "warning[lost-bound]: no bound for `y`: the divisor may be zero",
            "open.s:8:",
            "no bound out",
            help,
        ] {
            assert!(done.stdout.contains(text), "{text}: {}", done.stdout);
        }
        folder.line("asm open.s -o open.elf");
        let done = folder.line("accuracy open.elf --inputs in.csv --bound");
        assert!(done.stdout.contains("open.s:8") && done.stdout.contains(help), "{}", done.stdout);
    }
}

#[test]
fn run_shows_words_of_data_memory() {
    let folder = Folder::new();
    folder.write(
        "sums.s",
        ".input x\n.output y\n.array P[2,2] = 1, 2, 3, 4\n.array k[2]:int = 7, -8\n.data\ntable: .float 5, 6\n.once\n wait period\n.period\nperiod:\n k[1] = k[1] + 1\n P[2,1] = P[2,1] + x\n \
         y = P[2,1]\n wait period\n",
    );
    folder.write("in.csv", "x\n1\n10\n");
    let done =
        folder.line("run sums.s --inputs in.csv --outputs - --memory P[2,1] --memory P --memory k[2]").ok();
    assert_eq!(
        done.lines().map(|line| line.rsplit_once(',').unwrap().0).collect::<Vec<_>>(),
        [
            "y,\"P[2,1]\",\"P[1,1]\",\"P[1,2]\",\"P[2,1]\",\"P[2,2]\",k[2]",
            "4.0,4.0,1.0,2.0,4.0,4.0,-8",
            "14.0,14.0,1.0,2.0,14.0,4.0,-8"
        ]
    );
    assert!(folder.line("run sums.s --periods 1 --memory P").ok().contains("  P[2,2] = 4.0\n"));
    // Words after a label are counted from 0, like addresses.
    let table = folder.line("run sums.s --periods 1 --memory table --memory table[1]").ok();
    assert!(table.contains("  table[0] = 5.0\n  table[1] = 6.0\n  table[1] = 6.0\n"), "{table}");
    for (name, says) in [
        ("P[0,1]", "`P` has no element `P[0,1]`; there are `P[1,1]` to `P[2,2]`"),
        ("P[3]", "`P` has no element `P[3]`; there are `P[1,1]` to `P[2,2]`"),
        ("table[2]", "`table` has no element `table[2]`; there are `table[0]` to `table[1]`"),
        ("P+2", "nothing in data memory is called `P+2`"),
    ] {
        let done = folder.line(&format!("run sums.s --periods 1 --memory {name}"));
        assert!(done.status == Some(2) && done.stderr.contains(says), "{}", done.stderr);
    }
    let done = folder.line("run sums.s --periods 1 --memory p");
    assert_eq!(done.status, Some(2));
    assert!(
        done.stderr.contains("nothing in data memory is called `p`; did you mean `P`?"),
        "{}",
        done.stderr
    );
}
