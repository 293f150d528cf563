// SPDX-License-Identifier: MIT OR Apache-2.0
//! The commands `takt rtl` and `takt cosim`: exported circuits, and lockstep with the emulator.

use crate::common::{Folder, RunOutput};

const PROGRAM: &str = ".input in0\n.output out0\n.period\nloop: fadd out0, in0, in0\nwait loop\n";

fn cosim(folder: &Folder, line: &str) -> RunOutput {
    let arguments: Vec<&str> = line.split_whitespace().collect();
    let mut command = folder.command(&arguments);
    // Share compiled circuits between test runs.
    command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    RunOutput::of(command)
}

#[test]
fn design_is_complete() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM);
    assert!(folder.line("rtl -o out --machine t1 --program p.s").ok().contains("takt_t1.v"));
    for line in folder.read_text("out/takt_t1.f").lines() {
        let module =
            line.rsplit('/').next().and_then(|name| name.strip_suffix(".v")).expect("a Verilog file");
        assert!(folder.read_text(&format!("out/{line}")).contains(&format!("module {module}")), "{line}");
    }
    assert!(folder.read_text("out/program.hex").lines().count() > 2048);
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("rtl -o out2 --json").ok()).expect("JSON");
    assert_eq!(json["top"], "takt_t3");
}

#[test]
fn test_bench_runs_the_rows() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM);
    folder.write("in.csv", "in0\n1.5\n-2\n0.25\n");
    let stimuli = |line: &str| {
        folder.line(line).ok();
        folder.read_text("out/inputs.hex").lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let tick = "200000000000";
    let two = stimuli("rtl -o out --program p.s --inputs in.csv --periods 2");
    assert_eq!(two, ["10003fc00000", tick, "1000c0000000", tick]);
    assert_eq!(stimuli("rtl -o out --program p.s"), ["100000000000", tick].repeat(3));
    // A new export removes the results of an earlier one.
    assert!(stimuli("rtl -o out").is_empty());
    assert_eq!(folder.read_text("out/program.hex").lines().count(), 1);
    let many = folder.line("rtl -o out --program p.s --periods 40000");
    assert!(many.stderr.contains("--periods 32768"), "{}", many.stderr);
    for line in ["rtl -o out --program p.s --periods 1000000000000", "cosim p.s --periods 1000000000000"] {
        let done = folder.line(line);
        assert!(done.status == Some(1) && done.stderr.contains("at most 10000000"), "{}", done.stderr);
    }
    folder.write("none.csv", "in0\n");
    for line in ["rtl -o out --program p.s --inputs none.csv", "cosim p.s --inputs none.csv"] {
        let done = folder.line(line);
        assert!(done.status == Some(1) && done.stderr.contains("a header and no row, so"), "{}", done.stderr);
    }
}

#[test]
fn circuit_and_emulator_agree() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM);
    folder.write("in.csv", "in0\n1.5\n-2\n0.25\n");
    let text = cosim(&folder, "cosim p.s --inputs in.csv").ok();
    assert!(text.starts_with("3 periods on t3") && text.contains("no difference"), "{text}");
    let json = cosim(&folder, "cosim --seed 3 --programs 4 --json").ok();
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((&json["programs"], &json["seeds"]), (&4.into(), &serde_json::json!([3, 6])));
}

#[test]
fn without_verilator_its_package_is_named() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM);
    let mut command = folder.command(&["cosim", "p.s"]);
    command.env("PATH", "");
    let done = RunOutput::of(command);
    assert_eq!(done.status, Some(1));
    assert!(done.stderr.contains("apt-get install verilator"), "{}", done.stderr);
}

/// The circuit's ports are latched exactly if the program's are.
#[test]
fn latched_ports_come_from_the_program() {
    let folder = Folder::new();
    folder.write("p.s", format!(".ports latched\n{PROGRAM}"));
    folder.write("in.csv", "in0\n1.5\n-2\n0.25\n");
    folder.line("rtl -o out --machine t1 --program p.s --inputs in.csv").ok();
    for file in ["takt_t1.v", "takt_t1_wishbone.v"] {
        let text = folder.read_text(&format!("out/{file}"));
        let parameter = |line: &str| line.trim().trim_end_matches(',') == "parameter LATCHED = 2";
        assert!(text.lines().any(parameter), "{file}");
    }
    folder.line("rtl -o out --machine t1").ok();
    assert!(folder.read_text("out/takt_t1.v").contains("parameter LATCHED = 0,\n"));
    let text = cosim(&folder, "cosim p.s --machine t1 --inputs in.csv").ok();
    assert!(text.contains("3 periods on t1") && text.contains("no difference"), "{text}");
}

/// Mechanisms against faults of the circuit, and what they cost in block RAMs.
#[test]
fn a_core_has_the_mechanisms_that_are_asked_for() {
    let folder = Folder::new();
    let text = folder.line("rtl -m t1 --ecc -o ecc").ok();
    assert!(text.contains("the core is takt_t1.v") && text.ends_with("are 23, without it 21\n"), "{text}");
    assert!(text.contains("(7 block RAMs), 1024 words of data memory (3 block RAMs)"), "{text}");
    let core = folder.read_text("ecc/takt_t1.v");
    assert!(core.contains("output wire        upset") && core.contains("takt_ecc_scrub"), "{core}");
    let list = folder.read_text("ecc/takt_t1.f");
    assert!(list.contains("ecc/takt_ecc_program.v") && !list.contains("core/takt_program.v"), "{list}");
    let text = folder.line("rtl -m t1 --ecc --second-core 3 -o both").ok();
    assert!(text.contains("block RAMs of each core are 23"), "{text}");
    assert!(folder.read_text("both/takt_t1_pair.v").contains("upset"));
    // Files of an earlier export are told.
    let again = folder.line("rtl -m t1 -o both");
    assert!(again.stderr.contains("not of this export, such as ecc/takt_ecc_code.v"), "{again:?}");
    assert_eq!(folder.line("rtl -m t1 --second-core 3 -o other").stderr, "");
    let refused = folder.line("rtl --second-core system.toml -o out");
    assert!(refused.status == Some(2) && refused.stderr.contains("stand in its wiring"), "{refused:?}");
    let refused = folder.line("rtl system.toml --ecc -o out");
    assert!(refused.status == Some(2) && refused.stderr.contains("--ecc"), "{refused:?}");
}

/// The repository's system with three cores on two machines.
#[test]
fn a_system_is_a_circuit() {
    let folder = Folder::new();
    let file = |name: &str| format!("{}/../../programs/systems/{name}", env!("CARGO_MANIFEST_DIR"));
    let (toml, csv) = (file("speed.toml"), file("speed.csv"));
    assert!(folder.line(&format!("rtl {toml} -o out")).ok().contains("the system is takt_system_speed.v"));
    for line in folder.read_text("out/takt_system_speed.f").lines() {
        let module =
            line.rsplit('/').next().and_then(|name| name.strip_suffix(".v")).expect("a Verilog file");
        assert!(folder.read_text(&format!("out/{line}")).contains(&format!("module {module}")), "{line}");
    }
    let family = takt_family::REFERENCE.name;
    let list = folder.read_text(&format!("out/takt_system_speed_{family}.f"));
    assert!(list.contains(&format!("{family}/takt_bank.v")) && !list.contains("core/takt_bank.v"), "{list}");
    let text = cosim(&folder, &format!("cosim {toml} --inputs {csv} --periods 2")).ok();
    assert!(text.starts_with("2 base ticks on ") && text.contains(", no difference\n"), "{text}");
}

#[test]
fn rejects_program_options_for_a_systems_circuit() {
    let folder = Folder::new();
    folder.write("p.s", PROGRAM);
    let wire = |from: &str, to: &str| format!("[[wire]]\nfrom = \"{from}\"\nto = \"{to}\"\n");
    let core = "tick = 500\n[[core]]\nname = \"a\"\nprogram = \"p.s\"\n";
    folder.write("right.toml", format!("{core}{}{}", wire("host.in0", "a.in0"), wire("a.out0", "host.y")));
    // Pins of two wires, and of a snapshot to the host.
    let snapshot = "[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"host\"\nports = [\"out0 -> x\"]\n";
    folder.write(
        "twice.toml",
        format!("{core}{}{}{snapshot}", wire("host.in0", "a.in0"), wire("a.out0", "host.s_x")),
    );
    for (line, text) in [
        ("rtl twice.toml -o out", "two modules or nets named `out_s_x`"),
        ("rtl p.s -o out", "p.s is not a system (`.toml`); for the core of a program, write --program p.s"),
        ("rtl right.toml -o out -m t1", "cannot be used with"),
        ("cosim right.toml -m t1", "the system's file names each core's"),
        ("rtl none.toml -o out", "none.toml"),
    ] {
        let done = folder.line(line);
        assert!(done.status != Some(0) && done.stderr.contains(text), "{line}: {}", done.stderr);
    }
}
