// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters (`.param`) from the command line: at the start of runs, on a simulated board, in files.
#![cfg(unix)]

use crate::common::{Folder, SimulatedBoard};

/// A gain and an offset; `K` has two elements.
const LAW: &str = "\
.param  kp = 2.0 range 0..50
.param  K[2] = 1, 3 range -10..10
.param  bias:int = 0 range -100..100
.input  n:int, wanted:int
.output duty, error:int
        mov     duty, zero
        mov     error, zero
        wait    period
.period
period: error = wanted - n + bias
        duty = kp*K[2] + K[1]
        wait    period
";

#[test]
fn a_run_starts_with_other_values() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    folder.write("tuned.toml", "kp = 4\n\"K[1]\" = -0.5\nbias = -7\n");
    let run = |options: &str| folder.line(format!("run law.s --periods 1 {options}").trim());
    let ends = |options: &str, duty: &str, error: &str| {
        let text = run(options).ok();
        assert!(
            text.contains(&format!("duty = {duty}")) && text.contains(&format!("error = {error}")),
            "{text}"
        );
    };
    ends("", "7.0", "0");
    ends("--param kp=3 --param bias=-2", "10.0", "-2");
    ends("--params tuned.toml", "11.5", "-7");
    ends("--params tuned.toml --param kp=1e0", "2.5", "-7");
    for (options, message) in [
        ("--param kp=51", "51 is no value of the parameter `kp`: the source states the range 0 to 50"),
        ("--param kp=much", "parameter `kp`: `much` is not a number"),
        ("--param bias=1.5", "parameter `bias`: `1.5` is not an integer"),
        ("--param kq=1", "no parameter `kq`; there are `kp`, `K[1]`, `K[2]`, `bias`"),
        ("--param kp", "`kp` is not `name=value`"),
        ("--param kp=1 --param kp=2", "--param sets `kp` twice"),
        ("--params law.s", "law.s"),
        ("--params none.toml", "none.toml"),
    ] {
        let refused = run(options);
        assert!(refused.status != Some(0) && refused.stdout.is_empty(), "{options}: {refused:?}");
        assert!(refused.stderr.contains(message), "{options}: {}", refused.stderr);
    }
    // The debugger begins with the values, shows them with the ports, and sets them.
    let commands = b"step period\nprint kp\nports\nset kp = 60\nprint kp\nset kp = 4\nprint kp\nquit\n";
    let text = folder.fed("debug law.s --param kp=3", commands).stdout;
    assert!(text.contains("in   kp"), "{text}");
    let shown: Vec<&str> = text.lines().filter(|line| line.starts_with("kp = ")).collect();
    let values: Vec<&str> = shown.iter().filter_map(|line| line.split_whitespace().nth(2)).collect();
    assert_eq!(values, ["3.0", "3.0", "4.0", "4.0"], "60 lies outside of the range: {text}");
    folder.write(
        "ranged.s",
        format!(
            ".range n, wanted = -100, 100\n{}",
            LAW.replace(" + bias", "").replace(".param  bias:int = 0 range -100..100\n", "")
        ),
    );
    let text = folder.line("accuracy ranged.s").ok();
    assert!(text.contains("[-510, 510]"), "the whole range counts: {text}");
    folder.line("asm law.s -o law.takt").ok();
    assert!(folder.line("disasm law.takt").ok().contains(".param  kp @ i2 = 2.0"));
    folder.line("verify law.takt law.s").ok();
}

#[test]
fn a_system_names_the_core() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    folder.write(
        "system.toml",
        "tick = 1000\n[[core]]\nname = \"servo\"\nprogram = \"law.s\"\nmachine = \"t1\"\n\
         [[wire]]\nfrom = \"host.n\"\nto = \"servo.n\"\n[[wire]]\nfrom = \"host.wanted\"\nto = \"servo.wanted\"\n\
         [[wire]]\nfrom = \"servo.duty\"\nto = \"host.duty\"\n[[wire]]\nfrom = \"servo.error\"\nto = \"host.error\"\n",
    );
    let run = |options: &str| folder.line(format!("run system.toml --periods 3 {options}").trim());
    assert!(run("").ok().contains("duty = 7.0"));
    assert!(run("--param servo.kp=3").ok().contains("duty = 10.0"));
    folder.write("tuned.toml", "servo.kp = 4.0\n");
    assert!(run("--params tuned.toml").ok().contains("duty = 13.0"));
    let refused = run("--param kp=3");
    assert!(refused.stderr.contains("in a system it begins with `servo.`"), "{}", refused.stderr);
    let refused = run("--param servo.kp=-1");
    assert!(refused.stderr.contains("-1 is no value of the parameter `kp`"), "{}", refused.stderr);
}

/// On a board: several at once, in files, refused outside of their ranges; the program is not stopped.
#[test]
fn a_board_is_tuned_while_it_runs() {
    let folder = Folder::new();
    folder.write("law.s", LAW);
    let wiring = format!("{}/../../programs/examples/board/position.toml", env!("CARGO_MANIFEST_DIR"));
    let wiring = std::fs::read_to_string(wiring).unwrap().replace("baud = 1_000_000", "baud = 10_000_000");
    folder.write("wiring.toml", wiring);
    let board = SimulatedBoard::start(
        "board sim --board ulx3s-85f --wiring wiring.toml --program law.s --machine t1 --param kp=0.125",
        folder.path(),
    );
    let (port, baud) = (board.port.clone(), board.baud.clone());
    let live = |command: &str| {
        folder.line(&format!("live {port} --baud {baud} --program law.s --machine t1 {command}"))
    };
    let text = live("param").ok();
    let wanted =
        "kp = 0.125   0 to 50\nK[1] = 1.0   -10 to 10\nK[2] = 3.0   -10 to 10\nbias = 0   -100 to 100\n";
    assert_eq!(text, wanted);
    let text = live("param bias=-5 kp=0.25").ok();
    assert_eq!(text, "kp = 0.25   0 to 50\nbias = -5   -100 to 100\n", "those between keep their values");
    live("param --save tuned.toml").ok();
    assert_eq!(folder.read_text("tuned.toml"), "kp = 0.25\n\"K[1]\" = 1.0\n\"K[2]\" = 3.0\nbias = -5\n");
    live("param kp=0.5").ok();
    live("param --load tuned.toml K[1]=-1").ok();
    let text = live("read kp K bias duty").ok();
    assert_eq!(text, "kp = 0.25\nK[1] = -1\nK[2] = 3\nbias = -5\nduty = -0.25\n");
    for (command, message) in [
        ("param kp=50.5", "50.5 is no value of the parameter `kp`"),
        ("set kp=50.5", "50.5 is no value of the parameter `kp`"),
        ("param n=1", "no parameter `n`"),
        ("param kp=nan", "NaN"),
    ] {
        let refused = live(command);
        assert!(refused.status == Some(1) && refused.stderr.contains(message), "{command}: {refused:?}");
    }
    assert_eq!(live("read kp").ok(), "kp = 0.25\n", "a refused set changes nothing");
    let status = live("status").ok();
    assert!(status.contains("the program runs"), "{status}");
    // The emulator beside it reads the parameters from the board.
    assert!(live("shadow wanted=3 --periods 5").ok().contains("no difference"));
}
