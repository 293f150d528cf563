// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems of several cores on the command line.

use crate::common;
use crate::common::Folder;
use serde_json::Value;

/// Path of a file of the repository's example system.
fn speed(name: &str) -> String {
    format!("{}/../../programs/systems/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn run_drives_a_system_by_base_ticks() {
    let folder = Folder::new();
    let (toml, csv) = (speed("speed.toml"), speed("speed.csv"));
    let text = folder.line(&format!("run {toml} --inputs {csv} --stats")).ok();
    assert!(text.starts_with("10 base ticks of 125000 cycles\n"), "{text}");
    assert!(text.contains("\n  moves: 2 entries in"), "{text}");
    let rows = folder.line(&format!("run {toml} --inputs {csv} --outputs -")).ok();
    assert!(rows.starts_with("u,seen.peak,seen.values\n"), "{rows}");
    assert_eq!(rows.lines().count(), 11, "{rows}");
    let json: Value =
        serde_json::from_str(&folder.line(&format!("run {toml} --inputs {csv} --json")).ok()).unwrap();
    assert_eq!(json["ticks"], 10);
    assert_eq!(json["fifos"]["moves"]["pushed"], 2);
    let core = &json["cores"]["servo"];
    let stalls: u64 =
        core["stalls"].as_object().unwrap().values().map(|cycles| cycles.as_u64().unwrap()).sum();
    assert_eq!(core["bundles"].as_u64().unwrap() + stalls, core["cycles"]["total"].as_u64().unwrap());
}

#[test]
fn bound_follows_a_command_through_the_cores() {
    let folder = Folder::new();
    let toml = speed("speed.toml");
    let text = folder.line(&format!("bound {toml}")).ok();
    assert!(text.contains("through profile, servo, watch"), "{text}");
    let json: Value = serde_json::from_str(&folder.line(&format!("bound {toml} --json")).ok()).unwrap();
    let ways = json["latencies"].as_array().unwrap();
    let worst = |end: &str| {
        let way = ways.iter().find(|way| way["inputs"][0] == "moves.target" && way["outputs"][0] == end);
        way.unwrap()["worst"].as_u64().unwrap()
    };
    // A command that comes just too late for a tick waits for the next one.
    assert!(worst("u") > 125_000 && worst("u") < 2 * 125_000, "{}", worst("u"));
    let late = folder.line(&format!("bound {toml} --deadline {} --empty-fifos", worst("u") - 1));
    assert_eq!(late.status, Some(1));
    folder.line(&format!("bound {toml} --deadline {} --empty-fifos", worst("seen.peak"))).ok();
    // Entries that are already queued are served first.
    let queued = folder.line(&format!("bound {toml} --deadline {}", worst("seen.peak")));
    assert_eq!(queued.status, Some(1));
    assert!(queued.stdout.contains("if nothing is queued in moves: not certain to be kept\n"), "{queued:?}");
    let single = folder.line(&format!("bound {} --deadline 100 --empty-fifos", speed("watch.s")));
    assert!(single.status == Some(2) && single.stderr.contains("--empty-fifos is for systems"), "{single:?}");
}

#[test]
fn bound_counts_the_periods_of_states() {
    let folder = Folder::new();
    let system = |outputs: &str| {
        let wires =
            outputs.split(' ').map(|name| format!("[[wire]]\nfrom = \"a.{name}\"\nto = \"host.{name}\"\n"));
        let core = "tick = 200\n[[core]]\nname = \"a\"\nprogram = \"a.s\"\n[[wire]]\nfrom = \"host.x\"\nto = \"a.x\"\n";
        format!("{core}{}", wires.collect::<String>())
    };
    folder.write(
        "a.s",
        ".input x:int\n.output direct:int delayed:int ring:int same:int\n.state s1:int s2:int s3:int n:int\n.data\nd: .space 4\n.once\n\
         mov s1, zero\n mov s2, zero\n mov s3, zero\n mov n, zero\n mov direct, zero\n mov delayed, zero\n mov ring, zero\n\
         mov same, 1\n wait p\n.period\np: mov delayed, s3\n mov s3, s2\n mov s2, s1\n mov s1, x\n iadd direct, x, s3\n\
         ld ring, d[n]\n st d[n], x\n iadd n, n, 1\n iand n, n, 3\n wait p\n",
    );
    folder.write("direct.toml", system("direct"));
    folder.write("delayed.toml", system("direct delayed"));
    folder.write("ring.toml", system("ring"));
    folder.write("same.toml", system("same"));
    // The delay line responds after three periods; without it, the response comes within one.
    assert!(
        folder
            .line("bound direct.toml --deadline 250")
            .ok()
            .contains("the direct path; states can carry the command on")
    );
    let late = folder.line("bound delayed.toml --deadline 250");
    assert_eq!(late.status, Some(1), "{late:?}");
    assert!(late.stdout.contains("    through states: a 3 periods\n    59"), "{late:?}");
    let json = |line: &str| -> Value { serde_json::from_str(&folder.line(line).stdout).unwrap() };
    let way = &json("bound delayed.toml --deadline 250 --json")["latencies"][1];
    assert_eq!((&way["states"]["least"][0], &way["kept"]), (&Value::from(3), &Value::from(false)));
    let worst = way["worst"].as_u64().unwrap();
    folder.line(&format!("bound delayed.toml --deadline {worst}")).ok();
    assert_eq!(folder.line(&format!("bound delayed.toml --deadline {}", worst - 1)).status, Some(1));
    // The length of a ring buffer depends on its addresses, so no deadline is certain.
    let ring = folder.line("bound ring.toml --deadline 1ms");
    assert!(
        ring.status == Some(1) && ring.stdout.contains("with the fewest states: not certain to be kept\n"),
        "{ring:?}"
    );
    let way = &json("bound ring.toml --deadline 1ms --json")["latencies"][0];
    assert_eq!(
        (&way["worst"], &way["kept"], &way["states"]["most"]),
        (&Value::Null, &Value::Null, &Value::Null)
    );
    let none = folder.line("bound same.toml --deadline 1ms");
    assert!(none.status == Some(1) && none.stderr.contains("needs a path from an input"), "{none:?}");
}

#[test]
fn a_session_sees_all_cores() {
    let folder = Folder::new();
    let (toml, csv) = (speed("speed.toml"), speed("speed.csv"));
    folder.write(
        "script.txt",
        "cores\nbreak link moves pushed\ncontinue\nlinks moves\ncore servo\nstep period\nprint u\nstep bundle 3\nback bundle\n\
         goto cycle 126000\ncheck cycle == 126000\ncore watch\ncheck cycle == 126000\nreverse\nreverse\n",
    );
    let text = folder.line(&format!("debug {toml} --inputs {csv} --script script.txt")).ok();
    assert!(text.contains("> profile") && text.contains("stop 1: break link moves pushed"), "{text}");
    assert!(text.contains("moves: 1 of 8 entries (") && text.contains("core servo: "), "{text}");
    assert!(text.trim_end().contains("the beginning of the run"), "{text}");
    folder.write("wrong.txt", "stp\n");
    let wrong = folder.line(&format!("debug {toml} --script wrong.txt"));
    assert!(wrong.stderr.contains("wrong.txt:1: there is no command `stp`"), "{}", wrong.stderr);
    let wrong = folder.line(&format!("debug {toml} --tick 5 --script script.txt"));
    assert!(wrong.stderr.contains("--tick cannot be used with a system"), "{}", wrong.stderr);
}

#[test]
fn analyse_accounts_for_each_cores_cycles() {
    let folder = Folder::new();
    let (toml, csv) = (speed("speed.toml"), speed("speed.csv"));
    let text = folder.line(&format!("analyse {toml} --inputs {csv}")).ok();
    assert!(text.starts_with("10 base ticks, ") && text.contains("\nservo, t3: "), "{text}");
    let json: Value = serde_json::from_str(&folder.line(&format!("analyse {toml} --json")).ok()).unwrap();
    for core in ["profile", "servo", "watch"] {
        let core = &json["cores"][core];
        let stalls: u64 =
            core["stalls"].as_object().unwrap().values().map(|cycles| cycles.as_u64().unwrap()).sum();
        assert_eq!(core["bundles"].as_u64().unwrap() + stalls, core["cycles"].as_u64().unwrap());
    }
    let wrong = folder.line(&format!("analyse {toml} --machine t1"));
    assert!(wrong.stderr.contains("--machine cannot be used with a system"), "{}", wrong.stderr);
}

/// A core divides by values from another core: source line, period and cycle are reported as if it ran alone.
#[test]
fn deny_applies_to_every_core() {
    let folder = Folder::new();
    folder.write("send.s", ".input x\n.output y\n.once\n wait p\n.period\np: mov y, x\n wait p\n");
    folder.write("divide.s", ".input y\n.output q\n.once\n wait p\n.period\np: fdiv q, 1.0, y\n wait p\n");
    folder.write(
        "two.toml",
        "tick = 500\n[[core]]\nname = \"a\"\nprogram = \"send.s\"\n[[core]]\nname = \"b\"\nprogram = \"divide.s\"\n\
         offset = 100\n[[wire]]\nfrom = \"host.x\"\nto = \"a.x\"\n[[wire]]\nfrom = \"a.y\"\nto = \"b.y\"\n\
         [[wire]]\nfrom = \"b.q\"\nto = \"host.q\"\n",
    );
    folder.write("in.csv", "x\n2\n4\n0\n8\n0\n");
    let run = |what: &str| folder.line(&format!("run two.toml --inputs in.csv --json --deny {what}"));
    // The code that runs once does not divide.
    let done = run("divide-by-zero");
    let json: Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(done.status, Some(3), "{done:?}");
    assert!(
        done.stderr.contains("denied: divide-by-zero raised in core b 2 times, first in period 2, cycle ")
    );
    assert!(done.stderr.contains("by fdiv in bundle") && done.stderr.contains("(divide.s:6)"), "{done:?}");
    let denied = |core: &str| json["cores"][core]["denied"].clone();
    assert_eq!((denied("a"), denied("b")[0]["count"].as_u64()), (Value::Array(Vec::new()), Some(2)));
    run("overflow,nan,missed").ok();
}

/// The errors of each core equal those of its program run alone on the inputs from the system.
#[test]
fn accuracy_of_each_core() {
    let folder = Folder::new();
    let (toml, csv) = (speed("speed.toml"), speed("speed.csv"));
    let json = |line: &str| -> Value {
        let done = folder.line(&format!("accuracy {line} --json"));
        serde_json::from_str(&done.stdout).unwrap_or_else(|error| panic!("{line}: {error} {done:?}"))
    };
    let measured = &json(&format!("{toml} --inputs {csv}"))["cores"];
    assert_eq!((&measured["servo"]["periods"], &measured["watch"]["periods"]), (&10.into(), &5.into()));
    // A system of one core has the same errors as its program.
    folder.write("pass.s", ".input x\n.output y\n.once\n wait p\n.period\np: fmul y, x, 0.1\n wait p\n");
    folder.write(
        "one.toml",
        "tick = 500\n[[core]]\nname = \"a\"\nprogram = \"pass.s\"\n[[wire]]\nfrom = \"host.x\"\nto = \"a.x\"\n\
         [[wire]]\nfrom = \"a.y\"\nto = \"host.y\"\n",
    );
    folder.write("in.csv", "x\n1.7\n-3.3\n1e9\n0\n0.123\n");
    for options in ["", "--each-period", "--periods 3"] {
        let (alone, within) = (
            json(&format!("pass.s --inputs in.csv {options}")),
            json(&format!("one.toml --inputs in.csv {options}")),
        );
        assert_eq!(alone["outputs"], within["cores"]["a"]["outputs"], "{options}");
        assert_eq!(alone["periods"], within["cores"]["a"]["periods"], "{options}");
    }
    // Bounds of a core with ranges, and the reason why a core without ranges has none.
    let done = folder.line(&format!("accuracy {toml}"));
    assert_eq!(done.status, Some(0));
    assert!(done.stdout.contains("\nservo, ../examples/pi.s:\none period on t3"), "{done:?}");
    let done = folder.line("accuracy one.toml");
    assert_eq!(done.status, Some(1));
    assert!(done.stdout.contains("a, pass.s:\nno bound: pass.s:6"), "{done:?}");
    let bounds = json(&toml);
    assert_eq!(bounds["cores"]["servo"]["outputs"], json(&speed("../examples/pi.s"))["outputs"]);
}

#[test]
fn a_trace_shows_all_cores_on_one_axis() {
    let folder = Folder::new();
    let (toml, csv) = (speed("speed.toml"), speed("speed.csv"));
    let run = |more: &str| folder.line(&format!("run {toml} --inputs {csv} --periods 2 {more}"));
    run("--trace out.vcd --trace-cycles 124900..126100").ok();
    let text = folder.read_text("out.vcd");
    for scope in ["takt", "profile", "servo", "watch", "links"] {
        assert_eq!(text.matches(&format!("$scope module {scope} $end")).count(), 1, "{scope}");
    }
    assert_eq!(text.matches("$scope").count(), text.matches("$upscope").count());
    // On the common time axis, each core sees its first tick in a different cycle.
    let identifier = |scope: &str| {
        let rest = &text[text.find(&format!("$scope module {scope} ")).unwrap()..];
        let line = rest.lines().find(|line| line.ends_with(" tick $end")).unwrap();
        line.split(' ').nth(3).unwrap().to_owned()
    };
    for (core, tick) in [("profile", 125_000), ("servo", 125_500), ("watch", 126_000)] {
        let wanted = format!("1{}", identifier(core));
        let mut time = 0;
        let found = text.lines().find_map(|line| {
            if let Some(cycle) = line.strip_prefix('#') {
                time = cycle.parse::<u64>().unwrap();
            }
            (line == wanted).then_some(time)
        });
        assert_eq!(found, Some(tick), "{core}");
    }
    run("--trace few.fst --trace-cycles 0..1000 --trace-signals servo.outputs.u,links.moves.count").ok();
    assert!(run("--trace x.kanata").stderr.contains("a system is traced as .vcd or .fst"));
    assert!(run("--trace x.vcd --trace-signals servo.nix").stderr.contains("no signal is named `servo.nix`"));
}

#[test]
fn rejects_program_options_for_a_system() {
    let folder = Folder::new();
    folder.write("a.s", ".input x\n.output y\n.once\n wait p\n.period\np: mov y, x\n wait p\n");
    folder.write(
        "loads.s",
        ".input x\n.output y\n.state far: int\n.preset far = 4000\n.once\n wait p\n.period\np: ld y, [far]\n wait p\n",
    );
    let system = |program: &str| {
        format!(
            "tick = 500\n\n[[core]]\nname = \"a\"\nprogram = \"{program}\"\n\n[[wire]]\nfrom = \"host.x\"\nto = \"a.x\"\n\n\
             [[wire]]\nfrom = \"a.y\"\nto = \"host.y\"\n"
        )
    };
    folder.write("right.toml", system("a.s"));
    folder.write("missing.toml", system("b.s"));
    folder.write("faults.toml", system("loads.s"));
    folder.write("asm.toml", system("wrong.s"));
    folder.write("wrong.s", ".output y\n fadd y, q, 1\n halt\n");
    for (line, said) in [
        ("run missing.toml --periods 1", "there is no program b.s"),
        ("run right.toml", "runs from tick to tick"),
        ("run right.toml --periods 1 --tick 5", "--tick cannot be used with a system"),
        ("run right.toml --periods 1 --machine t1", "--machine cannot be used with a system"),
        ("run faults.toml --periods 1", "core a"),
        ("run asm.toml --periods 1", "wrong.s"),
        ("run nowhere.toml --periods 1", "nowhere.toml"),
        ("run right.toml --batch .", "--batch cannot be used with a system"),
        (
            "run right.toml --periods 1 --deny all --trace t.vcd",
            "--deny and --trace cannot be used with a system",
        ),
        ("run right.toml --outputs out.csv", "--outputs has a row for each period"),
        ("analyse right.toml --periods 0", "--periods 0 cannot be used with a system"),
        ("cosim right.toml --machine t1", "--machine cannot be used with a system"),
        ("accuracy right.toml --machine t1", "--machine cannot be used with a system"),
        ("bound missing.toml", "there is no program b.s"),
        ("bound right.toml --machine t1", "--machine cannot be used with a system"),
        ("asm right.toml", "is a system, but this command needs a single program"),
    ] {
        let done = folder.line(line);
        assert_ne!(done.status, Some(0), "{line}");
        assert!(done.stderr.contains(said), "{line}: {}", done.stderr);
    }
}

#[test]
fn the_hybrid_robot_on_two_processors() {
    let folder = Folder::new();
    let two = common::source("two.toml");
    let json = |line: &str| -> serde_json::Value {
        serde_json::from_str(&folder.line(&format!("track -q --json --periods 28000 {line}")).ok()).unwrap()
    };
    let (one, both) = (json(""), json(&format!("--system {two}")));
    let number = |value: &serde_json::Value| value.as_f64().unwrap_or_else(|| panic!("{value} in {both}"));
    // A core computes the points, beyond the first move of the table (period 26958): the robot follows them as it follows the host's.
    let overall = |run: &serde_json::Value| number(&run["tracking_error_m"]["overall"]);
    assert!((overall(&one) - overall(&both)).abs() < 1e-7, "{both} {one}");
    assert_eq!(both["missed"], 0);
    // The point arrives before the tick of the tracking core, 400 cycles later.
    assert!(both["cores"][0]["longest"].as_u64() < Some(400), "{both}");
    assert!(number(&both["points"][0]["largest_error"]) < 6.2e-8, "{both}");
    let text = folder.line(&format!("track -q --periods 10 --deny all --system {two}")).ok();
    assert_eq!(folder.line(&format!("track -q --periods 10 --program {two}")).ok(), text);
    assert!(text.contains("\n  n1, n2, n3 -> F1, F2, F3, through tracking\n"), "{text}");
    folder.write(
        "other.toml",
        "tick = 500\n[[core]]\nname = \"a\"\nprogram = \"a.s\"\n[[wire]]\nfrom = \"a.y\"\nto = \"host.y\"\n",
    );
    folder.write("a.s", ".output y\n.once\n wait p\n.period\np: mov y, zero\n wait p\n");
    for (line, said) in [
        ("track --system other.toml", "base tick is 500 cycles"),
        ("track --system other.toml --clock 5", "it has no input `n1`"),
        ("track --system other.toml --machine t1", "--machine cannot be used with a system"),
        ("track --system other.toml --monte-carlo 3", "--monte-carlo cannot be used with a system"),
    ] {
        let done = folder.line(line);
        assert_ne!(done.status, Some(0), "{line}");
        assert!(done.stderr.contains(said), "{line}: {}", done.stderr);
    }
}

/// The recorded host actions of a run are a table with which the system repeats the run; with `TAKT_FULL=1`, so does its circuit.
#[test]
fn host_actions_are_recorded_as_a_table() {
    let folder = Folder::new();
    let two = common::source("two.toml");
    folder.line(&format!("track -q --periods 40 --system {two} --csv in.csv")).ok();
    // The block that places the robot has a tick of its own.
    assert_eq!(folder.read_text("in.csv").lines().count(), 1 + 41);
    let run = |line: &str| folder.line(&format!("run {two} --inputs in.csv {line}")).ok();
    let text = run("");
    assert!(text.contains("41 base ticks") && text.contains("; 0 refused when full"), "{text}");
    // The core has received the first block: the path begins at its position.
    let json: Value = serde_json::from_str(&run("--json")).unwrap();
    assert!(json["fifos"]["blocks"]["pushed"].as_u64() > Some(8), "{json}");
    assert!(json["outputs"]["progress.block"].as_u64() > Some(1), "{json}");
    if std::env::var_os("TAKT_FULL").is_some() {
        let mut command = folder.command(&["cosim", &two, "--inputs", "in.csv"]);
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        let text = common::RunOutput::of(command).ok();
        assert!(text.contains("no difference"), "{text}");
    }
}

/// A late read of a FIFO's head is reported at its source line; no system in the repository has one.
#[test]
fn warns_of_a_head_read_after_its_pop() {
    let folder = Folder::new();
    for system in ["hybrid/two.toml", "three/controller.toml", "systems/speed.toml"] {
        let done = folder.line(&format!("bound {}", speed(&format!("../{system}"))));
        assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""), "{system}");
    }
    // A former mistake in the generation: no constraint kept the reads before the pop.
    for name in ["two.toml", "generation.s", "tracking.s", "robot.s"] {
        let text = std::fs::read_to_string(speed(&format!("../hybrid/{name}"))).unwrap();
        let without = text.lines().filter(|line| !line.starts_with(".order") || !line.ends_with(", pop"));
        let text: String = without.map(|line| format!("{line}\n")).collect();
        // On t4, the schedule moves a read behind the pop.
        folder.write(
            name,
            text.replace("program = \"generation.s\"", "program = \"generation.s\"\nmachine = \"t4\""),
        );
    }
    let done = folder.line("bound two.toml");
    assert_eq!(done.status, Some(0));
    insta::assert_snapshot!("head_after_pop", done.stderr);
    let denied = folder.line("bound two.toml -W error=next-head");
    assert_eq!(denied.status, Some(1));
    assert!(denied.stderr.contains("error"), "{}", denied.stderr);
    let allowed = folder.line("bound two.toml -W allow=next-head");
    assert_eq!((allowed.status, allowed.stderr.as_str()), (Some(0), ""));
}
