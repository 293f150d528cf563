//! `takt board`, `load` and `live` as commands: what they print, what they refuse, and the loop through a simulated board's pins.
#![cfg(unix)]

mod common;

use common::{Folder, SimulatedBoard};
use std::process::Stdio;

fn example(name: &str) -> String {
    format!("{}/../programs/examples/board/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The example's wiring and program, as arguments.
fn position() -> String {
    format!("--wiring {} --program {} --machine t1", example("position.toml"), example("position.s"))
}

#[test]
fn boards_and_their_pins_are_listed() {
    let folder = Folder::new();
    let list = folder.line("board list").ok();
    assert!(list.contains("ulx3s-85f") && list.contains("colorlight-i5"), "{list}");
    let wiring = format!("--wiring {}", example("position.toml"));
    let pins = folder.line(&format!("board pins ulx3s-85f {wiring}")).ok();
    assert!(pins.contains("gp0      B11   encoder.a\n") && pins.contains("gp10"), "{pins}");
    let pins = folder.line(&format!("board pins ulx3s-85f --json {wiring}")).ok();
    assert!(serde_json::from_str::<serde_json::Value>(&pins).is_ok_and(|pins| pins.is_array()), "{pins}");
}

#[test]
fn the_example_fits_its_board_and_a_circuit_is_written() {
    let folder = Folder::new();
    let text = folder.line(&format!("board check --board ulx3s-85f {}", position())).ok();
    assert_eq!(
        text,
        "ulx3s-85f, t1: 2 peripherals, 2 of the program's ports on pins, a period of 5000 cycles at 50 MHz\n"
    );
    folder.line(&format!("board build --board ulx3s-85f {} --sources -o out", position())).ok();
    let pins = folder.read_text("out/pins.lpf");
    assert!(pins.contains("LOCATE COMP \"encoder_a\" SITE \"B11\";"), "{pins}");
}

#[test]
fn a_program_alone_is_a_circuit_too() {
    let folder = Folder::new();
    let program = format!("--program {} --machine t1", example("position.s"));
    folder.line(&format!("board build --board colorlight-i5 {program} --sources -o out")).ok();
    // Another tool reads all of it; the device's own cells it does not know.
    let lint = "find . -name '*.v' -exec verilator --lint-only -Wno-fatal -Wno-lint -Wno-style --top-module takt_board {} +";
    let out = folder.path().join("out");
    let done = std::process::Command::new("/bin/sh").args(["-c", lint]).current_dir(out).output().unwrap();
    let text = String::from_utf8_lossy(&done.stderr);
    let known = |line: &str| {
        ["EHXPLLL", "MULT18X18D", "DP16KD"].iter().any(|cell| line.contains(&format!("module: '{cell}'")))
            || line.contains("there's no search path specified")
            || line.contains("Exiting due to")
    };
    let errors: Vec<&str> = text.lines().filter(|line| line.starts_with("%Error") && !known(line)).collect();
    assert!(errors.is_empty(), "{text}");
}

#[test]
fn wrong_boards_wirings_and_ports_are_refused() {
    let folder = Folder::new();
    let refused = |line: &str, says: &str| {
        let done = folder.line(line);
        assert_eq!(done.status, Some(1), "{line}: {done:?}");
        assert!(done.stderr.contains(says) && done.stdout.is_empty(), "{line}: {}", done.stderr);
    };
    refused("board pins ulx3s", "there is no board `ulx3s`, and no file of that name");
    refused(
        &format!("board check --board colorlight-i5 {}", position()),
        "position.toml:3:9: this wiring is for the board `ulx3s-85f`, not for `colorlight-i5`",
    );
    let twice = std::fs::read_to_string(example("position.toml")).unwrap().replace("\"gn2\"", "\"gp0\"");
    folder.write("twice.toml", twice);
    refused(
        &format!("board check --board ulx3s-85f --wiring twice.toml --program {}", example("position.s")),
        "pin `gp0` is used twice: line 16 has it for `encoder`",
    );
    folder.write("other.s", ".output y\n.once\n mov y, zero\n wait period\n.period\nperiod: wait period\n");
    refused(
        &format!("board check --board ulx3s-85f --wiring {} --program other.s", example("position.toml")),
        "the program has no input port `n`",
    );
    refused("live /dev/nothing status", "cannot open /dev/nothing: is the board plugged in");
    refused(&format!("load /dev/nothing {}", example("position.s")), "cannot open /dev/nothing");
}

#[test]
fn the_loop_closes_through_the_pins_of_a_simulated_board() {
    let folder = Folder::new();
    let line = format!("board sim --board ulx3s-85f {} --axis motor,encoder,20000", position());
    let board = SimulatedBoard::start(&line, folder.path());
    let (port, baud) = (board.port.clone(), board.baud.clone());
    let program = example("position.s");
    let live = |what: &str| {
        folder.line(&format!("live {port} --baud {baud} --program {program} --machine t1 {what}")).ok()
    };
    live("set wanted=30");
    // It comes nearer by a third of the error in a millisecond of the board's time, until dead time swallows the pulses.
    let error = || -> i32 { live("read error").trim().trim_start_matches("error = ").parse().unwrap() };
    assert!((0..200).any(|_| error().abs() <= 2), "{}", live("read"));
    // Frames may be lost where requests take the line: then it says so.
    let stream = folder.line(&format!(
        "live {port} --baud {baud} --program {program} --machine t1 stream n --every 20 --count 3"
    ));
    assert_eq!((stream.status, stream.stdout.lines().count()), (Some(0), 3), "{stream:?}");
    assert!(live("status").contains("the program runs; outputs drive"), "{}", live("status"));
    // Held, it stays where it is; a period at a time it goes on.
    live("hold");
    live("set wanted=-30");
    assert!(error().abs() <= 2);
    live("step");
    assert!((-62..=-58).contains(&error()), "{}", live("read"));
    // Beside the emulator, from the beginning: the program that runs there, then one that differs where the board had 0.02.
    let same = live("shadow wanted=7 --periods 12");
    assert_eq!(same, "12 periods, 2 input ports, 2 output ports: no difference; the board is held\n");
    let status = live("status");
    assert!(status.contains("the program held; outputs are safe"), "{status}");
    let planted = std::fs::read_to_string(&program).unwrap().replace("gain = 0.02", "gain = 0.03");
    folder.write("planted.s", planted);
    let shadow =
        format!("live {port} --baud {baud} --program planted.s --machine t1 shadow wanted=7 --periods 12");
    let different = folder.line(&shadow);
    assert_eq!((different.status, different.stdout.as_str()), (Some(1), ""), "{different:?}");
    let says = "period 1: output port `duty` is ";
    assert!(
        different.stderr.contains(says) && different.stderr.contains("wanted = 7"),
        "{}",
        different.stderr
    );
    // The data memory, which this program leaves zero.
    assert_eq!(live("read [0] [1023]"), "[0] = 0\n[1023] = 0\n");
    let beyond =
        folder.line(&format!("live {port} --baud {baud} --program {program} --machine t1 read [1024]"));
    assert!(beyond.stderr.contains("no port, register or data word `[1024]`"), "{}", beyond.stderr);
    let without = folder.line(&format!("live {port} --baud {baud} shadow"));
    assert!(without.stderr.contains("ports have names in the program: --program FILE"), "{}", without.stderr);
    let loaded = folder.line(&format!("load {port} --baud {baud} {program} --machine t1 --stopped")).ok();
    assert!(loaded.contains("records loaded and compared; stopped"), "{loaded}");
    let broken = folder.line(&format!("live {port} --baud {baud} --program {program} set nothing=1"));
    assert_eq!(broken.status, Some(1));
    assert!(
        broken.stderr.contains("the program has no port, register or data word `nothing`"),
        "{}",
        broken.stderr
    );

    // Unplugged: the board ends while a host is at its port. (What the host has open is read from Linux' list.)
    let mut host = std::process::Command::new(env!("CARGO_BIN_EXE_takt"));
    let shadow =
        format!("live {port} --baud {baud} --program {program} --machine t1 shadow --periods 1000000");
    host.args(shadow.split_whitespace()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut host = host.spawn().unwrap();
    let open = std::path::PathBuf::from(format!("/proc/{}/fd", host.id()));
    let is_at_the_port = || {
        let files = std::fs::read_dir(&open).into_iter().flatten().flatten();
        files
            .filter_map(|file| std::fs::read_link(file.path()).ok())
            .any(|file| file.as_os_str() == port.as_str())
    };
    while host.try_wait().unwrap().is_none() && !is_at_the_port() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    drop(board);
    let done = host.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&done.stderr);
    let says = "the line is gone: the port was unplugged, or the simulated board has ended";
    assert!(done.status.code() == Some(1) && stderr.contains(says), "{done:?}");
    assert!(done.stdout.is_empty(), "{done:?}");
}

fn hybrid(name: &str) -> String {
    format!("{}/../programs/hybrid/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The tracking error through encoders, PWMs and UART of the complete top level is that of the emulator, and what the pins add: forces in
/// steps of 0.5 N, a PWM's period later.
#[test]
fn the_hybrid_robot_closes_its_loop_through_pins() {
    let folder = Folder::new();
    let sim = |wiring: &str, more: &str| {
        let program = hybrid("tracking.s");
        folder.line(&format!(
            "board sim --board ulx3s-85f --wiring {wiring} --program {program} --robot {more}"
        ))
    };
    let wiring = std::fs::read_to_string(hybrid("board.toml")).unwrap();
    for (what, by, says) in [
        (
            "start = 3572338 ",
            "start = 3572000 ",
            "the robot stands at 3572338 counts of `n1`, and `encoder1` starts at 3572000",
        ),
        ("{ count = \"n5\" }", "{}", "the wiring has no quadrature whose `count` is the port `n5`"),
        (
            "{ duty = \"tau5\" }\nscale = { duty = 8 }",
            "{}",
            "the wiring has no pwm whose `duty` is the port `tau5`",
        ),
        ("tick = \"gp23\"", "", "the robot needs the signal `tick` on a pin"),
        ("period = 100 ", "period = 200 ", "the robot's period is 100 µs, the wiring's 200 µs"),
        (", low = \"gn7\"", "", "`motor1`: a force in both directions needs a signed pwm with both pins"),
        ("deadlines = 2", "autostart = true", "the host starts the robot: leave out `autostart`"),
    ] {
        assert_eq!(wiring.matches(what).count().min(1), 1, "{what}");
        folder.write("wrong.toml", wiring.replacen(what, by, 1));
        let done = sim("wrong.toml", "");
        assert!(done.status == Some(1) && done.stderr.contains(says), "{by}: {done:?}");
    }
    let done = sim(&hybrid("board.toml"), "--periods 400");
    assert_eq!((done.status, done.stderr.as_str()), (Some(0), "compiling the circuit …\n"));
    let text = done.stdout;
    assert!(
        text.starts_with("tracking.s on ulx3s-85f, simulated: t3 at 60 MHz, 400 periods of agh.ngc"),
        "{text}"
    );
    assert!(text.contains("0 deadlines missed; 0 points of the path late"), "{text}");
    let overall = text.lines().find(|line| line.starts_with("  overall")).unwrap_or_else(|| panic!("{text}"));
    let errors: Vec<f64> = overall.split_whitespace().skip(1).map(|error| error.parse().unwrap()).collect();
    let [pins, alone] = errors[..] else { panic!("{text}") };
    assert!(alone > 5.0 && (pins / alone - 1.0).abs() < 0.1, "{text}");
}

#[test]
fn the_way_from_pin_to_pin_has_a_bound() {
    let folder = Folder::new();
    let program = hybrid("tracking.s");
    let bound = |more: &str| folder.line(&format!("bound {program} --pins {more}"));
    let wiring = hybrid("board.toml");
    let text = bound(&format!("--wiring {wiring}")).ok();
    for says in [
        "  edge to `count`                                   6 ",
        "encoder4 (n4), encoder5 (n5)\n",
        "motor5 (tau5)\n",
    ] {
        assert!(text.contains(says), "{says}: {text}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&bound(&format!("--wiring {wiring} --json")).ok()).unwrap();
    let sum = |edge: &str| {
        let parts = [&json["inputs"][0]["parts"], &json["between"], &json["outputs"][0]["parts"]];
        parts
            .iter()
            .flat_map(|parts| parts.as_array().unwrap())
            .map(|part| part[edge].as_u64().unwrap())
            .sum::<u64>()
    };
    assert_eq!(json["total"]["best"], sum("best"));
    assert_eq!(json["total"]["worst"], sum("worst"));
    let refused = |more: &str, says: &str| {
        let done = bound(more);
        assert!(done.status == Some(1) && done.stderr.contains(says), "{more}: {done:?}");
    };
    refused(&format!("--wiring {wiring} --board colorlight-i5"), "this wiring is for the board `ulx3s-85f`");
    refused(&format!("--wiring {wiring} --deadline 100us"), "--deadline is not for --pins");
    folder.write("none.toml", "period = 100\n");
    refused("--wiring none.toml", "none.toml names no board: --board NAME");
    // One message, whether the board is named or would be the file's.
    folder.write("system.toml", "[core.one]\nmachine = \"t1\"\n");
    for board in ["", " --board ulx3s-85f"] {
        refused(
            &format!("--wiring system.toml{board}"),
            "system.toml:1:2: this is a system of several cores, and a wiring is wanted",
        );
    }
    folder.write("broken.toml", "period = \n");
    refused("--wiring broken.toml", "broken.toml:1:10:");
    refused("--wiring none.toml --board ulx3s-85f", "none.toml: no path from pin to pin");
}
