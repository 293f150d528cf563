// SPDX-License-Identifier: MIT OR Apache-2.0
//! Batches (`takt run --batch`, `takt track --monte-carlo`): each run gives the same result as a single run.

use crate::common;
use crate::common::Folder;
use serde_json::Value;

/// A control law with a state, a data-dependent branch, and a division that may fail.
const LAW: &str = "\
.input x, limit
.output y, count:int
.reg    sum n:int big
.once
        fadd    sum, zero, zero
        li      n, 0
        wait    period
.period
period: fadd    sum, sum, x
        flt     big, limit, sum
        bz      big, small
        iadd    n, n, 1
        fdiv    sum, sum, x
small:  fadd    y, sum, zero
        mov     count, n
        wait    period
";

/// Inputs of the runs: names and rows.
fn runs() -> Vec<(String, Vec<String>)> {
    (0..21)
        .map(|run| {
            let rows = (0..5 + run % 4).map(|row| format!("{},{}", (row * run) % 7, 4 + run % 3));
            (format!("r{run:02}"), rows.collect())
        })
        .collect()
}

/// A cycle limit ends a run of a batch in the same period as a single run.
#[test]
fn cycle_limit_acts_as_in_a_single_run() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    std::fs::create_dir(folder.path().join("runs")).unwrap();
    for (name, rows) in runs() {
        folder.write(format!("runs/{name}.csv"), format!("x,limit\n{}\n", rows.join("\n")));
    }
    let mut stopped = 0;
    for most in [90, 150, 10_000] {
        let mut expected = String::new();
        let mut failed = Vec::new();
        for (name, _) in runs() {
            let line = format!("run law.s --inputs runs/{name}.csv --outputs - --max-cycles {most}");
            let alone = folder.line(&line);
            let mut lines = alone.stdout.lines();
            let header = lines.next().unwrap();
            if expected.is_empty() {
                expected = format!("run,{header}\n");
            }
            lines.for_each(|line| expected += &format!("{name},{line}\n"));
            if alone.status != Some(0) {
                assert!(
                    alone.stderr.contains(&format!("limit of {most} cycles reached")),
                    "{}",
                    alone.stderr
                );
                failed.push(name);
            }
        }
        stopped += failed.len();
        let batch = folder.line(&format!("run law.s --batch runs --outputs - --max-cycles {most}"));
        assert_eq!(batch.stdout, expected, "{most}");
        assert_eq!(batch.status, Some(i32::from(!failed.is_empty())));
        if let Some(first) = failed.first() {
            let said = format!("run `{first}`, period");
            assert!(
                batch.stderr.contains(&said) && batch.stderr.contains(&format!("limit of {most} cycles")),
                "{}",
                batch.stderr
            );
        }
    }
    assert!(stopped > 10 && stopped < 3 * runs().len(), "{stopped}");
}

#[test]
fn each_run_of_a_batch_equals_a_single_run() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    std::fs::create_dir(folder.path().join("runs")).unwrap();
    let mut expected = String::new();
    for (name, rows) in runs() {
        let csv = format!("x,limit\n{}\n", rows.join("\n"));
        folder.write(format!("runs/{name}.csv"), &csv);
        let alone = folder.line(&format!("run law.s --tick 500 --inputs runs/{name}.csv --outputs -"));
        let alone = alone.stdout;
        let mut lines = alone.lines();
        let header = lines.next().unwrap();
        if expected.is_empty() {
            expected = format!("run,{header}\n");
        }
        lines.for_each(|line| expected += &format!("{name},{line}\n"));
    }
    let of_folder = folder.line("run law.s --tick 500 --batch runs --outputs -").ok();
    assert_eq!(of_folder, expected);

    // Rows of the same runs, interleaved in one file.
    let mut csv = "limit,run,x\n".to_owned();
    for row in 0..8 {
        for (name, rows) in runs() {
            if let Some(row) = rows.get(row) {
                let (x, limit) = row.split_once(',').unwrap();
                csv += &format!("{limit},{name},{x}\n");
            }
        }
    }
    folder.write("all.csv", csv);
    assert_eq!(folder.line("run law.s --tick 500 --batch all.csv --outputs -").ok(), expected);

    // The JSON names the runs that raised a flag.
    let json = folder.line("run law.s --tick 500 --batch all.csv --json").ok();
    let json: Value = serde_json::from_str(&json).unwrap();
    for run in json["runs"].as_array().unwrap() {
        let name = run["run"].as_str().unwrap();
        let alone = folder.line(&format!("run law.s --tick 500 --inputs runs/{name}.csv --json")).stdout;
        let alone: Value = serde_json::from_str(&alone).unwrap();
        for what in ["periods", "flags", "nan_writes", "deadlines_missed"] {
            assert_eq!(run[what], alone[what], "{name}");
        }
        for what in ["min", "max"] {
            assert_eq!(run["cycles"][what], alone["cycles"][what], "{name}");
        }
    }
    let text = folder.line("run law.s --batch runs").ok();
    assert!(text.starts_with("21 runs on t3, 135 periods in all: "), "{text}");
}

#[test]
fn names_a_failed_run_and_completes_the_others() {
    let folder = Folder::new();
    folder.write("law.s", ".input n:int\n.output y\n.once\nwait p\n.period\np: ld y, 0[n]\nwait p\n");
    folder.write("in.csv", "run,n\ngood,1\nbad,2\ngood,3\nbad,-9\ngood,4\nbad,5\n");
    let done = folder.line("run law.s --batch in.csv --outputs out.csv");
    assert_eq!(done.status, Some(1));
    assert!(done.stderr.contains("run `bad`, period 1"), "{}", done.stderr);
    assert!(done.stderr.contains("reads data word -9"), "{}", done.stderr);
    let rows = folder.read_text("out.csv");
    assert_eq!(rows.lines().filter(|line| line.starts_with("good,")).count(), 3);
    assert_eq!(rows.lines().filter(|line| line.starts_with("bad,")).count(), 1);
}

#[test]
fn mistakes_in_batches() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    folder.write("no_run.csv", "x,limit,runs\n1,2,3\n");
    folder.write("short.csv", "x,limit,run\n1,2\n");
    folder.write("comma.csv", "x,limit,run\n1,2,\"a,b\"\n");
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    for (line, status, expected) in [
        ("--batch no_run.csv", 1, "no_run.csv: no column `run`; did you mean `runs`?"),
        ("--batch short.csv", 1, "short.csv:2: the row has 2 fields, the header 3"),
        ("--batch comma.csv", 1, "the run `a,b` has a comma"),
        ("--batch empty", 1, "empty has no .csv file"),
        ("--batch nowhere", 1, "cannot open nowhere"),
        ("--batch empty --inputs short.csv", 2, "cannot be used with"),
    ] {
        let done = folder.line(&format!("run law.s {line}"));
        assert_eq!(done.status, Some(status), "{line}: {}", done.stderr);
        assert!(done.stderr.contains(expected), "{line}: {}", done.stderr);
    }
}

/// JSON output of a command, which must succeed.
fn json(folder: &Folder, line: &str) -> Value {
    serde_json::from_str(&folder.line(line).ok()).unwrap()
}

#[test]
fn robots_do_not_depend_on_threads_and_return_by_their_seeds() {
    let folder = Folder::new();
    folder.write("spread.toml", "mass = 0.05\narm_offset = 2e-6\ndistribution = \"uniform\"\n");
    let line = "track -q --json --periods 400 --monte-carlo 40 --seed 100 --spread spread.toml";
    let drives = |threads: &str| {
        let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
        command.env("RAYON_NUM_THREADS", threads);
        common::RunOutput::of(command).ok()
    };
    let one = drives("1");
    assert_eq!(one, drives("3"));

    let all: Value = serde_json::from_str(&one).unwrap();
    assert_eq!(all["robots"], 40);
    assert_eq!(all["failed"], 0);
    let worst = &all["worst"][0];
    let largest = all["drives"]
        .as_array()
        .unwrap()
        .iter()
        .map(|drive| drive["tracking_error_m"]["cutting"].as_f64().unwrap());
    assert_eq!(worst["tracking_error_m"]["cutting"].as_f64(), largest.reduce(f64::max));
    for drive in [worst, &all["drives"][17], &all["drives"][39]] {
        let seed = &drive["seed"];
        let alone =
            json(&folder, &format!("track -q --json --periods 400 --seed {seed} --spread spread.toml"));
        assert_eq!(alone["tracking_error_m"], drive["tracking_error_m"], "seed {seed}");
    }
    // A different seed gives a different robot.
    assert_ne!(all["drives"][0]["tracking_error_m"], all["drives"][1]["tracking_error_m"]);
}

#[test]
fn a_robot_opens_in_the_debugger() {
    let folder = Folder::new();
    let all = json(&folder, "track -q --json --periods 300 --monte-carlo 3 --seed 5");
    let drive = &all["drives"][1];
    let (seed, period) = (&drive["seed"], &drive["period"]);
    assert_eq!(*seed, 6);
    let done = folder.fed(&format!("debug --track --periods 300 --seed {seed}"), b"quit\n");
    assert!(done.stdout.contains(&format!("in period {period} ")), "{period}: {}", done.stdout);
}

#[test]
fn the_histogram_counts_every_robot() {
    let folder = Folder::new();
    let text = folder.line("track -q --periods 2000 --monte-carlo 20 --plot errors.svg").ok();
    assert!(text.contains("20 robots (seeds 1 to 20)"), "{text}");
    assert!(text.contains("of 20 (") && text.contains("keep 10 µm while cutting"), "{text}");
    let svg = folder.read_text("errors.svg");
    assert!(svg.contains("largest tracking error while cutting") && svg.contains("20 robots"));
}

#[test]
fn mistakes_in_spreads() {
    let folder = Folder::new();
    for (text, expected) in [
        ("mass = 0.9\n", "spread.toml: `mass` must be 0 to 0.3, relative to the mean"),
        ("\nmas = 0.1\n", "spread.toml:2: unknown field `mas`"),
        ("mass = \"much\"\n", "spread.toml:1: invalid type"),
        ("jitter = nan\n", "`jitter` must be"),
        ("mass = \n", "spread.toml:1: "),
        ("distribution = \"cauchy\"\n", "unknown variant `cauchy`"),
    ] {
        folder.write("spread.toml", text);
        let done = folder.line("track -q --periods 10 --monte-carlo 2 --spread spread.toml");
        assert_eq!(done.status, Some(1), "{text}");
        assert!(done.stderr.contains(expected), "{text}: {}", done.stderr);
    }
    let alone = folder.line("track -q --periods 10 --spread spread.toml");
    assert_eq!(alone.status, Some(2));
    assert!(alone.stderr.contains("give --seed"), "{}", alone.stderr);
    let none = folder.line("track -q --periods 10 --monte-carlo 0");
    assert_eq!(none.status, Some(2));
    let with_csv = folder.line("track -q --periods 10 --monte-carlo 2 --csv out.csv");
    assert_eq!(with_csv.status, Some(2));
}
