// SPDX-License-Identifier: MIT OR Apache-2.0
//! Playground methods as the page calls them, but without a browser.

use serde_json::{Value, json};
use takt_programs::plants::Plant as _;
use takt_web::{CYCLES, Playground};

fn call(playground: &mut Playground, method: &str, params: Value) -> Value {
    playground.call(method, params).unwrap_or_else(|error| panic!("{method}: {error}"))
}

fn assemble(playground: &mut Playground, source: &str, inputs: &str) -> Value {
    let params = json!({ "name": "a.s", "source": source, "machine": "t3", "inputs": inputs });
    call(playground, "assemble", params)
}

const DOUBLE: &str = ".input x\n.output y\n.period\nstart:\n    fadd y, x, x\n    wait start\n";

/// Without a table, a port whose range leaves 0 out begins at its nearest end: a division by it gives numbers.
#[test]
fn ports_without_inputs_rest_in_their_ranges() {
    const RATIO: &str = ".input x, udc, n:int\n.range x = -1, 1\n.range udc = 18, 32\n.range n = -9, -3\n\
        .output y\n.period\np: fdiv y, x, udc\n wait p\n";
    let mut playground = Playground::default();
    for table in ["", "other\n1\n"] {
        let told = assemble(&mut playground, RATIO, table);
        assert_eq!(told["resting"], json!({ "udc": 18.0, "n": -3 }));
        let ran = call(&mut playground, "run", json!({ "begin": true }));
        assert_eq!((&ran["outputs"]["y"][19], &ran["inputs"]["udc"][19]), (&json!(0.0), &json!(18.0)));
        let shown = &told["view"]["inputs"];
        let udc = shown.as_array().and_then(|all| all.iter().find(|one| one["name"] == "udc"));
        assert_eq!(udc.expect("the debugger shows the ports")["value"], "18.0");
    }
    let told = assemble(&mut playground, RATIO, "x,udc,n\n1,0,0\n");
    assert_eq!(told["rows"], 1);
    assert_eq!(call(&mut playground, "run", json!({ "begin": true }))["outputs"]["y"], json!(["inf"]));
    assert_eq!(assemble(&mut playground, DOUBLE, "")["resting"], json!({}));
}

/// A parameter acts without another assembly, is checked against its range, and has the source's value again when nothing else is wanted.
#[test]
fn parameters_are_set() {
    const GAIN: &str =
        ".param k = 2.0 range 0..50 ; V\n.input x\n.output y\n.period\np: fmul y, x, k\n wait p\n";
    let mut playground = Playground::default();
    let mut asked = |parameters: Value| {
        let params = json!({
            "name": "a.s", "source": GAIN, "machine": "t3", "inputs": "x\n3\n", "parameters": parameters,
        });
        let told = call(&mut playground, "assemble", params);
        let y = call(&mut playground, "run", json!({ "begin": true }))["outputs"]["y"][0].clone();
        (told, y)
    };
    let (told, y) = asked(json!({}));
    assert_eq!(y, 6.0);
    let wanted = json!([{ "name": "k", "value": 2.0, "unit": "V", "integer": true, "whole": false, "low": 0.0, "high": 50.0 }]);
    assert_eq!((&told["parameters"], &told["parameter_error"]), (&wanted, &Value::Null));
    let (told, y) = asked(json!({ "k": 1.5 }));
    assert_eq!((&told["parameters"][0]["value"], y), (&json!(1.5), json!(4.5)));
    for (parameters, says) in
        [(json!({ "k": 60 }), "the source states the range 0 to 50"), (json!({ "q": 1 }), "`q`")]
    {
        let (told, y) = asked(parameters);
        let error = told["parameter_error"].as_str().expect("it cannot be");
        assert!(error.contains(says) && y == 6.0, "{error}, {y}");
    }
}

/// A parameter that changes during a run acts from its period on: in the plots, the debugger and the loop of a plant.
#[test]
fn parameters_change_during_a_run() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let example =
        about["examples"].as_array().and_then(|all| all.iter().find(|one| one["name"] == "gains.s"));
    let example = example.expect("it has parameters");
    let mut asked = |inputs: &str, plant: &Value, changes: Value| {
        let params = json!({
            "name": "gains.s", "source": example["source"], "machine": "t3", "inputs": inputs, "plant": plant,
            "changes": changes, "periods": 60,
        });
        let told = call(&mut playground, "assemble", params);
        let ran = call(&mut playground, "run", json!({ "begin": true }));
        (told, ran["outputs"]["u"].clone(), ran["inputs"]["w"].clone())
    };
    let change = |period: u32, value: f64| json!([{ "period": period, "name": "kp", "value": value }]);
    let (told, u, _) = asked("w_ref,w\n1,0\n1,0\n1,0\n", &Value::Null, change(2, 3.0));
    assert_eq!(told["parameter_error"], Value::Null);
    let values: Vec<f64> = u.as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    // The integrator adds 0.004 a period.
    assert!((values[0] - 0.3).abs() < 1e-6 && (values[1] - 3.004).abs() < 1e-6, "{values:?}");
    assert!((values[2] - 3.008).abs() < 1e-6, "the value stays: {values:?}");
    // Without a table, the plant's file gives the reference; before the change, the curves are those without it.
    let closed = &example["plant"];
    let (told, _, before) = asked("", closed, json!([]));
    assert_eq!((&told["plant"]["name"], &told["rows"]), (&json!("dc_motor"), &json!(60)));
    let (_, _, after) = asked("", closed, change(31, 2.0));
    let same = |period: usize| before[period] == after[period];
    assert!((0..=30).all(same) && !(31..40).all(same), "period 31 is the first with the new gain");
    let (told, u, _) = asked("", &Value::Null, change(1, 1.0));
    assert_eq!((&told["rows"], u.as_array().map(Vec::len)), (&json!(60), Some(60)), "all ports are 0");
    let (told, _, same) = asked("", closed, change(31, 9.0));
    let error = told["parameter_error"].as_str().expect("it is out of range");
    assert!(error.contains("range 0 to 4") && same == before, "{error}");
    asked("", closed, change(31, 2.0));
    let at = |playground: &mut Playground, period: u32| {
        let line = format!("goto period {period}");
        let shown = call(playground, "execute", json!({ "line": line }))["view"]["inputs"].clone();
        let named = shown.as_array().and_then(|all| all.iter().find(|one| one["name"] == "kp"));
        named.expect("the debugger shows parameters")["value"].clone()
    };
    // After `goto period n`, n periods have passed, and the inputs are those of the next.
    assert_eq!((at(&mut playground, 29), at(&mut playground, 30)), (json!("0.3"), json!("2.0")));
    assert_eq!(at(&mut playground, 29), json!("0.3"), "and back");
    // So does the test bench: index of the parameter among the inputs, and 2.0.
    let told = call(&mut playground, "verilog", Value::Null);
    let bench = told["files"].as_array().and_then(|all| all.iter().find(|one| one["name"] == "inputs.hex"));
    let periods = bench.and_then(|one| one["text"].as_str()).expect("it is there").split("2000").nth(30);
    assert!(periods.is_some_and(|text| text.contains("40000000")), "{periods:?}");
}

/// The picture of the machine: its row, the operands of the next bundle, and the operations in flight.
#[test]
fn the_machine_shows_activity() {
    let mut playground = Playground::default();
    assert!(
        playground.call("activity", Value::Null).is_err() && playground.call("bundles", Value::Null).is_err()
    );
    let source = ".input x\n.output y\n.reg a b\n.schedule on\n.period\nstart:\n    fadd a, x, x\n    fmul b, a, x\n    fadd y, b, b\n    wait start\n";
    assemble(&mut playground, source, "x\n1\n");
    call(&mut playground, "execute", json!({ "line": "goto cycle 8" }));
    let first = call(&mut playground, "activity", Value::Null);
    assert_eq!(first["machine"]["slots"][1]["units"][0]["name"], "add");
    assert_eq!(first["machine"]["slots"][1]["units"][0]["latency"], 5);
    assert_eq!(first["flight"][0]["writes"], "a");
    assert_eq!((&first["flight"][0]["slot"], &first["flight"][0]["bank"]), (&json!(1), &json!(1)));
    // The product waits for the sum, and takes it from the result bus in the cycle of its writeback.
    let product = &first["operations"][0];
    assert_eq!((&product["unit"], &product["writes"]), (&json!(0), &json!("b")), "{first}");
    let reads = json!([{ "bank": 1, "text": "a", "forwarded": true }, { "bank": 3, "text": "x", "forwarded": false }]);
    assert_eq!(product["reads"], reads);
    assert!(first["cause"].as_str().is_some_and(|cause| cause.contains('a')), "{}", first["cause"]);
    let told = call(&mut playground, "bundles", Value::Null);
    assert_eq!(told["slots"], json!(["mul", "add", "aux"]));
    let bundles = told["bundles"].as_array().expect("there are some");
    assert_eq!(bundles[0]["labels"], json!(["start"]));
    let operations: Vec<&Value> = bundles
        .iter()
        .flat_map(|one| one["operations"].as_array())
        .flatten()
        .filter(|one| !one.is_null())
        .collect();
    assert_eq!(operations.len(), 4);
    assert_eq!((&operations[0]["place"], &operations[0]["unit"]), (&json!("a.s:7"), &json!("add")));
}

/// Example of a name, of those that `about` lists.
fn example(about: &Value, name: &str) -> Value {
    let mut examples = about["examples"].as_array().expect("there are some").iter();
    examples.find(|example| example["name"] == name).expect("it is there").clone()
}

#[test]
fn every_example_assembles_and_runs() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let examples = about["examples"].as_array().expect("there are some");
    assert_eq!(examples[0]["name"], "gains.s", "the README's example comes first");
    assert_eq!(examples.iter().filter(|example| example["track"] == true).count(), 1);
    for example in examples {
        assert_ne!(example["title"], "", "{}", example["name"]);
        let short = example["short"].as_str().map(|title| title.chars().count());
        assert!(short.is_some_and(|count| (1..=25).contains(&count)), "{}: {short:?}", example["name"]);
        let params = json!({
            "name": example["name"], "source": example["source"], "machine": "t3",
            "inputs": example["inputs"].as_str().unwrap_or_default(), "plant": example["plant"],
            "periods": example["periods"],
        });
        let told = call(&mut playground, "assemble", params);
        assert_eq!(told["plant_error"], Value::Null, "{}", example["name"]);
        assert_eq!(told["assembled"], true, "{}: {}", example["name"], told["text"]);
        assert_eq!(told["inputs_error"], Value::Null, "{}", example["name"]);
        assert!(told["bounds"].is_array(), "{}", example["name"]);
        // The bound of the schedule is that of the whole period: 122 of a block, 5 times 47 of a kernel, 28 of its end, 12 times 6 of a loop.
        let bounds = told["bounds"].as_array().expect("checked above");
        let least: Vec<u64> = bounds.iter().filter_map(|section| section["least"].as_u64()).collect();
        match example["name"].as_str() {
            Some("statespace.s") => assert_eq!(least, [122 + 5 * 47 + 28 + 12 * 6]),
            Some("pi.s") => assert_eq!(least.last(), Some(&38)),
            // The first period of tracking.s is a section of its own.
            Some("tracking.s") => assert_eq!(least, [108]),
            _ => {}
        }
        assert_eq!(told["tracks"], example["track"], "{}", example["name"]);
        let has_inputs = told["inputs"].as_array().is_some_and(|ports| !ports.is_empty());
        // The file of a plant has the inputs that the plant leaves.
        let has_table = example["inputs"].is_string() || !example["plant"].is_null();
        assert_eq!(has_inputs, has_table, "{}: inputs for its ports", example["name"]);
        let ran = call(&mut playground, "run", json!({ "begin": true, "periods": 3 }));
        assert_eq!(ran["fault"], Value::Null, "{}", example["name"]);
        let outputs = ran["outputs"].as_object().expect("ports by name");
        for (port, values) in outputs {
            let numbers = values.as_array().expect("a value for each period");
            let all = numbers.iter().all(Value::is_number);
            assert!(all && !numbers.is_empty(), "{}: {port} is {values}", example["name"]);
        }
        // An example without inputs must change its lamp within its default number of periods.
        if !has_inputs {
            let mut lit = Vec::new();
            for begin in [true, false] {
                let params = json!({ "begin": begin, "periods": example["periods"] });
                let ran = call(&mut playground, "run", params);
                lit.extend(ran["outputs"]["lamp"].as_array().cloned().unwrap_or_default());
            }
            let changes = lit.windows(2).filter(|pair| pair[0] != pair[1]).count();
            assert!(changes >= 3, "{}: {changes} changes in {} periods", example["name"], lit.len());
        }
        if example["track"] == false {
            let worst = &told["bounds"][1]["cycles"]["worst"];
            assert!(
                ran["cycles"]
                    .as_array()
                    .expect("a list")
                    .iter()
                    .all(|cycles| cycles.as_u64() <= worst.as_u64())
            );
        }
    }
}

#[test]
fn run_returns_the_values_of_the_ports() {
    let mut playground = Playground::default();
    assemble(&mut playground, DOUBLE, "x,other\n1,5\n-2.5,6\n");
    let ran = call(&mut playground, "run", json!({ "begin": true }));
    assert_eq!(ran["outputs"]["y"], json!([2.0, -5.0]));
    assert_eq!(ran["inputs"]["x"], json!([1.0, -2.5]));
    assert_eq!(ran["over"], true);
    assemble(&mut playground, DOUBLE, "");
    let ran = call(&mut playground, "run", json!({ "begin": true, "periods": 4 }));
    assert_eq!(ran["outputs"]["y"], json!([0.0, 0.0, 0.0, 0.0]));
}

#[test]
fn reports_values_that_are_not_numbers() {
    let mut playground = Playground::default();
    let source = ".input x\n.output y, z\n.period\nstart:\n    fdiv y, x, x\n    fdiv z, one, x\n.const one = 1\n    wait start\n";
    assemble(&mut playground, source, "x\n0\n2\n");
    let ran = call(&mut playground, "run", json!({ "begin": true }));
    assert_eq!((&ran["outputs"]["y"], &ran["outputs"]["z"]), (&json!(["NaN", 1.0]), &json!(["inf", 0.5])));
}

#[test]
fn ports_have_units_and_limits() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let pi = example(&about, "pi.s");
    let params = json!({ "name": "pi.s", "source": pi["source"], "machine": "t3" });
    let told = call(&mut playground, "assemble", params);
    assert_eq!((&told["outputs"][0]["unit"], &told["outputs"][0]["limit"]), (&json!("V"), &json!(24.0)));
    assert_eq!((&told["inputs"][0]["unit"], &told["inputs"][0]["limit"]), (&json!("rad/s"), &Value::Null));
    let told = assemble(&mut playground, DOUBLE, "");
    assert_eq!((&told["outputs"][0]["unit"], &told["outputs"][0]["limit"]), (&Value::Null, &Value::Null));
}

#[test]
fn the_longest_chain_is_marked_on_operations() {
    let mut playground = Playground::default();
    let source = ".input x\n.output y, z\n.schedule on\n.period\nstart:\n    fmul a, x, x\n.reg a b\n    fadd b, a, x\n    mov z, x\n    mov y, b\n    wait start\n";
    assemble(&mut playground, source, "");
    let told = call(&mut playground, "picture", json!({ "period": 1 }));
    let bundles = told["picture"]["bundles"].as_array().expect("a list").clone();
    let operations = bundles.iter().flat_map(|bundle| bundle["operations"].as_array().expect("a list"));
    let of = |wanted: bool| -> Vec<String> {
        let marked = operations.clone().filter(|one| one["critical"] == wanted);
        marked.filter_map(|one| Some(one["text"].as_str()?.split(' ').next()?.to_owned())).collect()
    };
    assert!(["fmul", "fadd"].iter().all(|name| of(true).contains(&(*name).to_owned())), "{:?}", of(true));
    assert_eq!(of(false), ["mov"], "what nothing waits for is not on it");
}

#[test]
fn long_runs_come_in_slices() {
    let mut playground = Playground::default();
    assemble(&mut playground, DOUBLE, "");
    let (mut periods, mut calls, mut begin) = (0, 0, true);
    loop {
        let ran = call(&mut playground, "run", json!({ "begin": begin, "periods": 5000 }));
        periods += ran["cycles"].as_array().map_or(0, Vec::len);
        (calls, begin) = (calls + 1, false);
        if ran["over"] == true {
            break;
        }
    }
    assert_eq!((periods, calls), (5000, 3));
}

#[test]
fn reports_mistakes() {
    let mut playground = Playground::default();
    let told = assemble(&mut playground, "    fmull y, x, x\n", "");
    assert_eq!(told["assembled"], false);
    assert!(told["text"].as_str().is_some_and(|text| text.contains("a.s:1")), "{told}");
    let error = playground.call("run", json!({ "begin": true })).expect_err("there is no program");
    assert_eq!(error, "no program is assembled yet");
    let told = assemble(&mut playground, DOUBLE, "x\n1\ntwo\n");
    assert_eq!(told["inputs_error"], "inputs:3: column x: `two` is not a number");
    // The table was made for other ports, so it belongs to another program: the program runs with zeros.
    let told = assemble(&mut playground, DOUBLE, "a,b\n1,2\n");
    assert_eq!((&told["inputs_error"], &told["rows"]), (&Value::Null, &Value::Null));
    assert_eq!(told["inputs_of_others"], "inputs: no column for the input port x");
    assert_eq!(
        call(&mut playground, "run", json!({ "begin": true, "periods": 2 }))["outputs"]["y"],
        json!([0.0, 0.0])
    );
    assert_eq!(assemble(&mut playground, DOUBLE, " \n")["inputs_of_others"], Value::Null);
    assert_eq!(assemble(&mut playground, DOUBLE, "x\n1\n")["inputs_of_others"], Value::Null);
    // Messages must not suggest command-line options, which a page does not have.
    let told = assemble(&mut playground, ".include \"no.s\"\n", "");
    let text = told["text"].as_str().unwrap_or_default();
    assert!(text.contains("robot.s") && !text.contains("-I"), "{text}");
    let own = takt_isa::T1.to_toml().replace("\"t1\"", "\"mine\"");
    let params = json!({ "name": "a.s", "source": "halt\n", "machine": own });
    assert_eq!(playground.call("assemble", params).expect("it is a machine")["machine"], "mine");
    let params = json!({ "name": "a.s", "source": "", "machine": own.replace("alu_late", "alo") });
    assert!(playground.call("assemble", params).is_err_and(|error| error.contains("machine.toml:")));
    let params = json!({ "name": "a.s", "source": "", "machine": "t9" });
    assert!(playground.call("assemble", params).is_err_and(|error| error.contains("machines: ")));
    assert!(
        playground
            .call("assemble", Value::Null)
            .is_err_and(|error| error.contains("parameters of `assemble`"))
    );
    assert!(playground.call("nothing", Value::Null).is_err());
    let params = json!({ "name": "", "source": "x".repeat(takt_web::SOURCE_BYTES + 1), "machine": "t3" });
    assert_eq!(playground.call("assemble", params), Err("the source has more than 4 MiB".to_owned()));
    // An empty source is not a program: every method fails with a message.
    assemble(&mut playground, "", "");
    for method in ["run", "track", "picture", "execute", "listing", "header", "verilog"] {
        let params = json!({ "begin": true, "periods": 1, "period": 1, "line": "step", "language": "c" });
        let _ = playground.call(method, params);
    }
}

#[test]
fn a_loop_without_end_stops_at_the_limit() {
    let mut playground = Playground::default();
    assemble(&mut playground, "start:\n    jmp start\n", "");
    let ran = call(&mut playground, "run", json!({ "begin": true, "periods": 3 }));
    let fault = ran["fault"].as_str().expect("it does not end").to_owned();
    assert!(fault.contains(&CYCLES.to_string()) && fault.contains("a.s:"), "{fault}");
    let stopped = call(&mut playground, "execute", json!({ "line": "continue" }));
    assert!(stopped["text"].as_str().is_some_and(|text| text.contains("cycles")), "{}", stopped["text"]);
}

#[test]
fn steps_forward_and_back() {
    let mut playground = Playground::default();
    let told = assemble(&mut playground, DOUBLE, "x\n1\n3\n");
    let step = |playground: &mut Playground, line: &str| {
        call(playground, "execute", json!({ "line": line }))["view"].take()
    };
    let mut views = vec![told["view"].clone()];
    for _ in 0..4 {
        views.push(step(&mut playground, "step"));
    }
    assert!(views.windows(2).all(|pair| pair[0]["cycle"].as_u64() < pair[1]["cycle"].as_u64()));
    for view in views.iter().rev().skip(1) {
        let back = step(&mut playground, "back");
        assert_eq!(
            (&back["cycle"], &back["line"], &back["outputs"][0]["value"]),
            (&view["cycle"], &view["line"], &view["outputs"][0]["value"])
        );
    }
    let end = step(&mut playground, "goto period 2");
    assert_eq!(end["outputs"][0]["value"], "6.0");
}

#[test]
fn breakpoints_are_reported_with_their_lines() {
    let mut playground = Playground::default();
    assemble(&mut playground, DOUBLE, "x\n1\n3\n");
    let told = call(&mut playground, "execute", json!({ "line": "break a.s:6" }));
    let stop = told["view"]["breaks"][0].clone();
    assert_eq!((&stop["file"], &stop["line"]), (&json!("a.s"), &json!(6)));
    let error = playground.call("execute", json!({ "line": "break a.s:1" })).expect_err("no code is there");
    assert!(error.contains("line 1 of a.s has no instruction"), "{error}");
    let told = call(&mut playground, "execute", json!({ "line": "continue" }));
    assert_eq!(told["view"]["line"], 6);
    let told = call(&mut playground, "execute", json!({ "line": format!("delete {}", stop["id"]) }));
    assert_eq!(told["view"]["breaks"], json!([]));
}

#[test]
fn included_files_can_be_read() {
    let mut playground = Playground::default();
    for (name, word) in [("robot.s", ".const"), ("<math.s>", ".macro")] {
        let text = call(&mut playground, "source", json!({ "name": name }));
        assert!(text.as_str().is_some_and(|text| text.contains(word)), "{name}");
    }
    let error = playground.call("source", json!({ "name": "none.s" })).expect_err("there is none");
    assert_eq!(error, "there is no file `none.s` to be shown");
}

#[test]
fn the_robot_follows_the_path() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let tracking =
        about["examples"].as_array().and_then(|list| list.iter().find(|one| one["track"] == true)).cloned();
    let source = tracking.expect("one of them is")["source"].clone();
    let params = json!({ "name": "tracking.s", "source": source, "machine": "f3" });
    call(&mut playground, "assemble", params);
    let first = call(&mut playground, "track", json!({ "begin": true, "periods": 150 }));
    // The first period includes work that the controller does only once.
    assert_eq!((&first["done"], &first["cycles"]), (&json!(150), &json!(112)));
    assert!(first["longest"].as_u64() >= first["cycles"].as_u64(), "{}", first["longest"]);
    assert_eq!(first["poses"].as_array().map(Vec::len), Some(2));
    let more = call(&mut playground, "track", json!({ "periods": 150 }));
    assert_eq!(more["done"], 300);
    assert!(
        more["overall"].as_f64().is_some_and(|error| (0.0..1e-5).contains(&error)),
        "{}",
        more["overall"]
    );
    assemble(&mut playground, DOUBLE, "");
    let error =
        playground.call("track", json!({ "begin": true, "periods": 1 })).expect_err("it has other ports");
    assert!(error.contains("not a tracking program"), "{error}");
}

#[test]
fn downloads_equal_the_command_lines_output() {
    let mut playground = Playground::default();
    assemble(&mut playground, DOUBLE, "x\n1\n");
    let image = playground.image().expect("it fits");
    assert_eq!(takt_asm::image::read(&image).expect("it was just written").inputs[0].name, "x");
    let verilog = call(&mut playground, "verilog", Value::Null);
    assert_eq!(verilog["top"], "takt_t3");
    let program =
        verilog["files"].as_array().and_then(|files| files.iter().find(|file| file["name"] == "program.hex"));
    assert!(program.is_some_and(|file| file["text"].as_str().is_some_and(|text| text.lines().count() > 2)));
    for (language, word) in
        [("c", "#ifndef"), ("rust", "pub const"), ("json", "\"schema\""), ("svd", "<device")]
    {
        let header = call(&mut playground, "header", json!({ "language": language }));
        assert!(header.as_str().is_some_and(|text| text.contains(word)), "{language}: {header}");
    }
    let picture = call(&mut playground, "picture", json!({ "period": 1 }));
    assert_eq!(picture["picture"]["program"], "a.s");
}

#[test]
fn constants_of_the_text_can_be_set() {
    let mut playground = Playground::default();
    let source = "; µ, 𝜇\n.const T = 1e-3 ; s, the period\n.const TF = 1e-3 ; s, of a filter\n.const N = 3\n.const K = 12 ; V/rad, gain\n.const w = 2*pi*50 ; rad/s\n\
                  .const derived = K*T\n.const pi = 3\n.const own = 2*pi\n.if N > 2\n.const hidden = 5\n.endif\n.rep i, 1, 2\n.const c{i} = 4\n.endr\n\
                  .include \"robot.s\"\n.output last\n.period\nstart:\n    mov last, zero\n    wait start\n";
    let told = assemble(&mut playground, &source.replace(".const pi = 3\n.const own = 2*pi\n", ""), "");
    let of = |told: &Value| -> Vec<String> {
        let list = told["settable"].as_array().unwrap_or_else(|| panic!("{told}"));
        list.iter().filter_map(|one| Some(one["name"].as_str()?.to_owned())).collect()
    };
    assert_eq!(of(&told), ["TF", "K", "w"], "neither the sampling period nor a count");
    let [filter, gain, speed] = [0, 1, 2].map(|at| told["settable"][at].clone());
    assert_eq!(
        (&filter["value"], &filter["unit"], &filter["low"]),
        (&json!(1e-3), &json!("s"), &json!(1e-4))
    );
    assert_eq!((&gain["low"], &speed["low"]), (&Value::Null, &Value::Null));
    assert_eq!((&gain["integer"], &gain["text"]), (&json!(true), &json!("V/rad, gain")));
    assert!(speed["value"].as_f64().is_some_and(|value| (value - 314.159).abs() < 0.001), "{speed}");
    // Places are in UTF-16 units.
    let units: Vec<u16> = source.encode_utf16().collect();
    let text = |one: &Value| {
        let place = |key: &str| one[key].as_u64().and_then(|at| usize::try_from(at).ok()).expect("a place");
        String::from_utf16(&units[place("from")..place("to")]).expect("whole characters")
    };
    assert_eq!((text(&filter), text(&speed)), ("1e-3".to_owned(), "2*pi*50".to_owned()));
    let told = assemble(&mut playground, source, "");
    assert!(!of(&told).contains(&"own".to_owned()), "its pi is the program's: {:?}", of(&told));
}

/// A slider begins at zero, or, of a divisor or a time, at a tenth of the value. There, every example still assembles, except where a
/// sensor's divider would have no resistance, or less voltage than the sensor gives.
#[test]
fn examples_assemble_at_the_least_value_of_each_slider() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let mut refused = Vec::new();
    for example in about["examples"].as_array().expect("a list") {
        let source = example["source"].as_str().expect("a text");
        let wanted = |source: &str| json!({ "name": example["name"], "source": source, "machine": "t3", "inputs": "", "plant": example["plant"] });
        let told = call(&mut playground, "assemble", wanted(source));
        let units: Vec<u16> = source.encode_utf16().collect();
        for one in told["settable"].as_array().expect("a list") {
            let place =
                |key: &str| one[key].as_u64().and_then(|at| usize::try_from(at).ok()).expect("a place");
            let (value, low) = (one["value"].as_f64().expect("a number"), one["low"].as_f64());
            let least = low.unwrap_or(if value > 0.0 { 0.0 } else { 2.0 * value });
            let [before, after] = [&units[..place("from")], &units[place("to")..]]
                .map(|part| String::from_utf16(part).expect("whole characters"));
            let told = call(&mut playground, "assemble", wanted(&format!("{before}{least:?}{after}")));
            if told["assembled"] != true {
                refused.push(format!("{} {}", example["name"], one["name"]));
            }
        }
    }
    assert_eq!(refused, ["\"table.s\" \"UREF\"", "\"table.s\" \"RPULL\""]);
}

/// The loops of the examples have the bits of `takt run --plant` (`tools/cli/tests/plant.rs` compares with the same files).
#[test]
fn loops_have_the_bits_of_takt_run() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let tables = [
        ("pi.s", include_str!("../../../programs/tests/loops/pi.csv")),
        ("foc.s", include_str!("../../../programs/tests/loops/foc.csv")),
        ("foc_early.s", include_str!("../../../programs/tests/loops/foc_early.csv")),
        ("pendulum.s", include_str!("../../../programs/tests/loops/pendulum.csv")),
    ];
    for (name, table) in tables {
        let examples = about["examples"].as_array().expect("a list");
        let example = examples.iter().find(|example| example["name"] == name).expect("an example");
        let params = json!({ "name": name, "source": example["source"], "machine": "t3", "inputs": example["inputs"].as_str().unwrap_or_default(), "plant": example["plant"], "periods": example["periods"].as_u64().expect("a number").min(400) });
        let told = call(&mut playground, "assemble", params);
        assert_eq!(told["plant_error"], Value::Null, "{name}");
        let ran = call(&mut playground, "run", json!({ "begin": true }));
        let mut lines = table.lines();
        let titles: Vec<&str> = lines.next().expect("a header").split(',').collect();
        let columns: Vec<&Value> = titles
            .iter()
            .map(|title| {
                if ran["outputs"][title].is_array() { &ran["outputs"][title] } else { &ran["inputs"][title] }
            })
            .collect();
        assert!(table.lines().count() > 300, "{name}");
        for (period, line) in lines.enumerate() {
            for ((title, column), text) in titles.iter().zip(&columns).zip(line.split(',')) {
                let expected: f32 = text.parse().expect("a number");
                let found = column[period].as_f64().map(|value| (value as f32).to_bits());
                assert_eq!(found, Some(expected.to_bits()), "{name}, {title} of period {period}");
            }
        }
    }
}

/// A table gives what the plant does not, as `takt run --plant --inputs` reads it; other columns may be there.
#[test]
fn a_table_needs_no_columns_for_what_a_plant_gives() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let pi = example(&about, "pi.s");
    let mut speeds = Vec::new();
    for head in ["w_ref", "w_ref,w"] {
        let row = if head == "w_ref" { "50\n" } else { "50,7\n" };
        let table = format!("{head}\n{}", row.repeat(100));
        let asked = json!({ "name": "pi.s", "source": pi["source"], "machine": "t3", "inputs": table, "plant": pi["plant"] });
        let told = call(&mut playground, "assemble", asked);
        assert_eq!((&told["inputs_of_others"], &told["rows"]), (&Value::Null, &json!(100)), "{head}");
        let ran = call(&mut playground, "run", json!({ "begin": true }));
        speeds.push(ran["inputs"]["w"][99].as_f64().expect("a speed"));
    }
    assert!((speeds[0] - 50.0).abs() < 2.0, "{speeds:?}");
    assert_eq!(speeds[0], speeds[1]);
    let asked = json!({ "name": "pi.s", "source": pi["source"], "machine": "t3", "inputs": "w\n1\n", "plant": Value::Null });
    let told = call(&mut playground, "assemble", asked);
    assert_eq!(told["inputs_of_others"], "inputs: no column for the input port w_ref");
}

#[test]
fn a_plant_closes_the_loop() {
    let mut playground = Playground::default();
    let about = call(&mut playground, "about", Value::Null);
    let pi = example(&about, "pi.s");
    assert_eq!(pi["plant"]["name"], "dc_motor", "the example closes its loop");
    let with = |plant: Value, source: &str, inputs: &Value| json!({ "name": "pi.s", "source": source, "machine": "t3", "inputs": inputs, "plant": plant, "periods": 400 });
    let source = pi["source"].as_str().expect("a text");
    let told = call(&mut playground, "assemble", with(pi["plant"].clone(), source, &json!("")));
    assert_eq!((&told["plant"]["name"], &told["plant_error"]), (&json!("dc_motor"), &Value::Null));
    assert_eq!(told["plants"][0]["gives"], json!(["w"]));
    assert_eq!(told["rows"], 400);
    let ran = call(&mut playground, "run", json!({ "begin": true }));
    let column = |kind: &str, name: &str| -> Vec<f64> {
        let values = ran[kind][name].as_array().unwrap_or_else(|| panic!("{kind} {name}"));
        values.iter().filter_map(Value::as_f64).collect()
    };
    // Each speed is what the voltages before have made of the motor.
    let text = include_str!("../../../programs/examples/plant/dc_motor.toml");
    let file = takt_programs::plants::PlantFile::read("dc_motor.toml", text).expect("it is right");
    let (mut motor, _) = file.simulation(1e-3).expect("it is slow enough");
    let (speeds, voltages) = (column("inputs", "w"), column("outputs", "u"));
    for (period, (speed, voltage)) in speeds.iter().zip(&voltages).enumerate() {
        assert_eq!(*speed as f32, motor.sensors()[0] as f32, "period {period}");
        let load = if period >= 100 { 0.4 } else { 0.0 };
        motor.advance(&[*voltage, load]).expect("it cannot fail");
    }
    assert!((speeds[99] - 100.0).abs() < 3.0, "the controller reaches its reference: {}", speeds[99]);
    assert!(speeds[120] < speeds[99] - 1.0, "the load comes after 0.1 s: {}", speeds[120]);
    // A plant's slider begins where its number makes sense, and a negative time makes none.
    let setting = |name: &str| {
        let all = told["plants"][0]["parameters"].as_array().expect("numbers");
        all.iter().find(|one| one["name"] == name).unwrap_or_else(|| panic!("{name}")).clone()
    };
    assert_eq!(
        setting("J")["low"],
        setting("J")["value"].as_f64().map_or(Value::Null, |value| json!(value / 10.0))
    );
    assert_eq!((&setting("load")["low"], &setting("load.at")["low"]), (&Value::Null, &json!(0.0)));
    // The debugger and the pipeline see the same inputs.
    let end = call(&mut playground, "execute", json!({ "line": "goto period 140" }));
    let shown = end["view"]["inputs"][1]["value"].as_str().and_then(|text| text.parse::<f32>().ok());
    assert_eq!(shown, Some(speeds[140] as f32), "{}", end["view"]["inputs"]);
    // Another load gives another speed; without a table, the other inputs are 0.
    let heavy = json!({ "name": "dc_motor", "parameters": { "load": 0.8 } });
    call(&mut playground, "assemble", with(heavy.clone(), source, &json!("")));
    let loaded = call(&mut playground, "run", json!({ "begin": true }));
    assert!(loaded["inputs"]["w"][120].as_f64() < Some(speeds[120] - 1.0));
    let told = call(&mut playground, "assemble", with(heavy, source, &json!("w_ref,w\n100,0\n100,0\n")));
    assert_eq!(told["rows"], 2, "a table says how many periods there are");
    let error = |playground: &mut Playground, plant: Value, source: &str| {
        let told = call(playground, "assemble", with(plant, source, &json!("")));
        assert_eq!(told["plant"], Value::Null);
        told["plant_error"].as_str().unwrap_or_default().to_owned()
    };
    let named = |name: &str| json!({ "name": name });
    assert!(error(&mut playground, named("train"), source).contains("no plant `train`"));
    assert!(
        error(&mut playground, named("dc_motor"), DOUBLE)
            .contains("the plant dc_motor is for other ports; no plant has this program's")
    );
    let timeless = source.replace("T    = 1e-3  ", "T    = 1e-3 ;");
    assert!(error(&mut playground, named("dc_motor"), &timeless).contains("`.const T = …"), "{timeless}");
    let wild = json!({ "name": "dc_motor", "parameters": { "J": -1.0 } });
    assert!(error(&mut playground, wild, source).contains("positive number"));
    // A program that never ends its period ends the loop, and the run says why.
    let endless =
        source.replace("        fsub    e, w_ref, w\n", "turn: jmp turn\n        fsub    e, w_ref, w\n");
    call(&mut playground, "assemble", with(named("dc_motor"), &endless, &json!("")));
    let ran = call(&mut playground, "run", json!({ "begin": true }));
    assert!(
        ran["fault"].as_str().is_some_and(|fault| fault.contains(&CYCLES.to_string())),
        "{}",
        ran["fault"]
    );
}
