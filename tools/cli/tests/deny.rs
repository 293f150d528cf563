// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `--deny` and its events.

use crate::common::Folder;
use serde_json::{Value, json};

/// Divides by its input, then clears the flags; raised flags must count nevertheless.
const LAW: &str = "\
.input x, y
.output q, p
.once
        wait    period
.period
period: fdiv    q, 1.0, x
        fmul    p, y, y
        clrflags
        wait    period
";

/// Period 1 divides by zero, period 2 overflows, period 4 does both.
const ROWS: &str = "x,y\n1,1\n0,1\n1,3e38\n1,1\n0,3e38\n";

#[test]
fn reports_event_first_place_and_count() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    folder.write("in.csv", ROWS);
    let deny = |what: &str| {
        let done = folder.line(&format!("run law.s --inputs in.csv --json --deny {what}"));
        let json: Value = serde_json::from_str(&done.stdout).unwrap();
        (done.status, json["denied"].clone(), done.stderr)
    };
    // Reference: the trace shows which operation raised a flag, and when.
    folder.line("run law.s --inputs in.csv --trace all.jsonl").ok();
    let events = folder.read_text("all.jsonl");
    let events: Vec<Value> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let found = |what: &str, period: u64, operation: &str| {
        let raised = events.iter().filter(|event| event["flags"] == what).collect::<Vec<_>>();
        let Value::Object(first) = raised[0] else { panic!("{}", raised[0]) };
        let (cycle, bundle, place, count) =
            (&first["cycle"], &first["bundle"], &first["source"], raised.len());
        assert_eq!(first["op"], operation);
        let text = format!(
            "error: denied: {what} raised {count} times, first in period {period}, cycle {cycle}, by {operation} in \
             bundle {bundle} ({})\n",
            place.as_str().unwrap()
        );
        let first = json!({"period": period, "cycle": cycle, "bundle": bundle, "place": place});
        (json!({"what": what, "count": count, "first": first}), text)
    };
    let (by_zero, by_zero_text) = found("divide-by-zero", 1, "fdiv");
    let (overflow, overflow_text) = found("overflow", 2, "fmul");
    assert_eq!((&by_zero["count"], &by_zero["first"]["place"]), (&2.into(), &"law.s:6".into()));
    assert_eq!(deny("divide-by-zero"), (Some(3), json!([by_zero]), by_zero_text.clone()));
    assert_eq!(deny("overflow,nan"), (Some(3), json!([overflow]), overflow_text.clone()));
    assert_eq!(deny("all"), (Some(3), json!([by_zero, overflow]), format!("{by_zero_text}{overflow_text}")));
    assert_eq!(deny("missed,invalid,nan"), (Some(0), json!([]), String::new()));
    // A trace of any part of the run does not change the result.
    for options in ["", "--trace-cycles 60..70"] {
        let done = folder.line(&format!("run law.s --inputs in.csv --deny all --trace t.jsonl {options}"));
        assert_eq!((done.status, done.stderr), (Some(3), format!("{by_zero_text}{overflow_text}")));
    }
    // Results are complete whether or not --deny is given.
    let with = folder.line("run law.s --inputs in.csv --outputs with.csv --deny all");
    assert_eq!(with.stdout, folder.line("run law.s --inputs in.csv --outputs without.csv").ok());
    assert_eq!(folder.read_text("with.csv"), folder.read_text("without.csv"));
}

#[test]
fn deadlines() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    folder.write("in.csv", "x,y\n1,1\n1,1\n1,1\n");
    let run =
        |tick: u64| folder.line(&format!("run law.s --inputs in.csv --json --deny missed --tick {tick}"));
    // Late ticks, and ticks just after the `wait`.
    run(1000).ok();
    let bounds: Value = serde_json::from_str(&folder.line("bound law.s --json").ok()).unwrap();
    let worst = |key: &str| bounds["sections"][1][key]["worst"].as_u64().unwrap();
    run(worst("in_time") + 1).ok();
    let done = run(worst("cycles"));
    let json: Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!((done.status, &json["denied"][0]["count"]), (Some(3), &json["deadlines_missed"]));
    assert_eq!(
        (&json["denied"][0]["what"], &json["denied"][0]["first"]["period"]),
        (&"missed".into(), &0.into())
    );
    let text = done.stderr.split_once("times, first in period 0, cycle ");
    assert!(text.is_some_and(|(what, _)| what.starts_with("error: denied: deadline missed ")));
    // Lost ticks count as missed.
    let done = run(4);
    let json: Value = serde_json::from_str(&done.stdout).unwrap();
    assert!(json["denied"][0]["count"].as_u64() > Some(3), "{json}");
    assert_eq!(json["denied"][0]["count"], json["deadlines_missed"]);
}

#[test]
fn without_periods_and_after_the_last() {
    let folder = Folder::new();
    folder.write("once.s", ".output F\n.reg z\n fsub z, zero, zero\n fdiv F, z, z\n halt\n");
    let done = folder.line("run once.s --deny invalid,nan");
    assert_eq!(done.status, Some(3));
    let errors: Vec<&str> = done.stderr.lines().filter(|line| line.starts_with("error")).collect();
    let place = "by fdiv in bundle 1 (once.s:4)";
    let cycle = errors[0].split("cycle ").nth(1).unwrap().split(',').next().unwrap();
    assert_eq!(
        errors,
        [
            format!("error: denied: invalid raised once, cycle {cycle}, {place}"),
            format!("error: denied: NaN written to an output port once, cycle {cycle}, to F {place}"),
        ]
    );
    // This operation issues with the last `wait`, and is written after the end of the run.
    let late = ".input x\n.output F\n.once\n wait p\n.period\np: wait p || fmul F, x, inf\n";
    folder.write("late.s", late);
    let done = folder.line("run late.s --periods 1 --deny all");
    assert_eq!(done.status, Some(3), "{}", done.stderr);
    assert!(done.stderr.contains("denied: invalid raised once") && done.stderr.contains("denied: NaN"));
    folder.line("run late.s --periods 1").ok();
}

#[test]
fn track_denies_too() {
    let folder = Folder::new();
    folder.line("track -q --periods 30 --deny all --json").ok();
    let done = folder.line("track -q --periods 30 --deny all --json --clock 1");
    let json: Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!((done.status, &json["denied"][0]["what"]), (Some(3), &"missed".into()));
    assert_eq!(json["denied"][0]["count"], json["deadlines_missed"]);
    assert!(done.stderr.starts_with("error: denied: deadline missed "), "{}", done.stderr);
    assert!(done.stderr.contains("hybrid/tracking.s:"), "{}", done.stderr);
}

#[test]
fn names() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    for (what, reason) in
        [("mised", "did you mean `missed`?"), ("fault", "(events: missed, "), ("", "(events: ")]
    {
        let done = folder.takt(&["run", "law.s", "--periods", "1", "--deny", what]);
        assert_eq!(done.status, Some(2), "{what}");
        assert!(done.stderr.contains(reason), "{}", done.stderr);
    }
    // A fault remains an error.
    folder.write("falls.s", ".output F\n fadd F, zero, zero\n");
    assert_eq!(folder.line("run falls.s --deny all").status, Some(1));
}

/// Ranges that the source promises: of an input, of a state at the end of a period, of a value.
#[test]
fn promised_ranges() {
    let law = "\
.input  x
.range  x = -1, 1
.state  s
.range  s = -2, 2
.output y
.reg    d
.once
        s = 0
        wait    p
.period
p:      d = 2 + x
        .assume d >= 1.5
        s = s + x
        y = s*d
        wait    p
";
    let folder = Folder::new();
    folder.write("law.s", law);
    let deny = |rows: &str, what: &str| {
        folder.write("in.csv", format!("x\n{rows}"));
        let done = folder.line(&format!("run law.s --inputs in.csv --json --deny {what}"));
        let json: Value = serde_json::from_str(&done.stdout).unwrap();
        (done.status, json["denied"].clone(), done.stderr)
    };
    assert_eq!(deny("1\n-0.5\n0.5\n", "all").0, Some(0));
    let (status, json, text) = deny("0\n-1\n0\n", "range");
    assert_eq!(
        (status, &json[0]["count"], &json[0]["first"]["place"]),
        (Some(3), &1.into(), &"law.s:11:13-17".into())
    );
    assert!(
        text.contains("a promised range left once, in period 1") && text.contains("to d by fadd"),
        "{text}"
    );
    // The state leaves its range in period 2 and is back in period 4.
    let (status, json, text) = deny("1\n1\n0.5\n0\n-0.5\n", "range");
    assert_eq!(
        (status, &json[0]["count"], &json[0]["first"]["place"]),
        (Some(3), &2.into(), &"law.s:13:13-17".into())
    );
    assert!(text.contains("left 2 times, first in period 2") && text.contains("to s by fadd"), "{text}");
    let (status, _, text) = deny("0\n1.5\n", "range");
    assert!(status == Some(3) && text.contains("in period 1") && text.contains("by the input x"), "{text}");
    assert_eq!(deny("0\n1.5\n", "missed,nan").0, Some(0));
}
