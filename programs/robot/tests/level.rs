// SPDX-License-Identifier: MIT OR Apache-2.0
//! Command level on a stand-in for the cores: effects of programs, and messages for mistakes.

use crate::common::{lines, session};
use takt_robot::language::table::{COMMANDS, FUNCTIONS};
use takt_robot::level::Answer;
use takt_robot::limits;
use takt_robot::packet::{Cause, Kind};

/// Runs a program; returns its messages and its error.
fn run(text: &str) -> (Vec<String>, String) {
    let (mut session, _) = session();
    let error = match session.run("test.robot", text).and_then(|()| session.finish()) {
        Ok(()) => String::new(),
        Err(mistakes) => mistakes.render(false),
    };
    (lines(session.take_messages()), error)
}

fn says(text: &str) -> Vec<String> {
    let (said, error) = run(text);
    assert_eq!(error, "", "{said:?}");
    said
}

#[test]
fn values_and_control_flow() {
    let said = says(
        "let n = 0\nrepeat 3\n  let n = n + 2 * 2\nend\nsay \"n is \", n\n\
         while n > 0 and not n == 4\n let n = n - 4\nend\nsay n\n\
         if n == 3\n say \"three\"\nelse if n == 4\n say \"four\"\nelse\n say \"other\"\nend\n\
         say -2 - -3 * 2, \" \", 7 / 2, \" \", 1 + 2 < 4 or 1 / 0 > 1\n\
         say min(3, 2), max(3, 2), floor(-1.5), abs(-1), sqrt(9), atan2(1, 1)\n",
    );
    assert_eq!(said, ["say: n is 12", "say: 4", "say: four", "say: 4 3.5 1", "say: 23-21345"]);
}

#[test]
fn subprograms_have_values_of_their_own() {
    let said = says(
        "let a = 1\nsub twice(x)\n let a = 2 * x\n say a\n if x < 3\n  call twice(x + 1)\n  return\n end\n say \"end\"\nend\n\
         call twice(2)\nsay a\n",
    );
    assert_eq!(said, ["say: 4", "say: 6", "say: end", "say: 1"]);
}

#[test]
fn frames_and_poses() {
    let said = says(
        "let table = frame(100, 0, 0, 0, 0, 90)\nlet p = table * pose(10, 20, 30, 0, -40, 0)\nsay p\n\
         say inverse(table) * p\nsay (p * frame(0, 0, 5, 0, 0, 0)).z\nsay frame(p) * inverse(frame(p))\n\
         say joints(1, 2, 3, 4, 5, 6) + 2 * joints(1, 1, 1, 1, 1, 1)\nsay joints(1, _, 3, 4, 5, 6).q3\n",
    );
    assert_eq!(said[0], "say: pose(80, 10, 30, 0, -40, 90)");
    assert_eq!(said[1], "say: pose(10, 20, 30, 0, -40, 0)");
    assert_eq!(said[2], "say: 26.786");
    assert_eq!(said[3], "say: frame(0, 0, 0, 0, 0, 0)");
    assert_eq!(said[4..], ["say: joints(3, 4, 5, 6, 7, 8)", "say: 3"]);
}

#[test]
fn motions_reach_their_target() {
    let said = says(
        "move joints(30, _, _, _, _, 10) in 1\nsay joints()\nlet t = time()\n\
         move joints(10, _, _, _, _, _) at 40\nsay time() - t < 0.6\n\
         let p = pose()\nmove joints(0, 90, 0, 0, -45, 0)\nmove p\nsay joints()\nmovel pose(_, _, p.z - 20, _, _, _)\n\
         say pose().z - p.z\ncheck move joints(20, _, _, _, _, _) in 2\nsay joints().q1\n\
         start move joints(20, _, _, _, _, _) in 2\nwait 1\nsay joints().q1\nstop\nsay joints().q1\n",
    );
    assert_eq!(said[0], "say: joints(30, 90, 0, 0, -45, 10)");
    assert_eq!(said[1], "say: 1");
    assert_eq!(said[2], "say: joints(10, 90, 0, 0, -45, 10)");
    assert_eq!(said[3], "say: -20");
    assert_eq!(said[4..6], ["check: possible, in 2 s", "say: 10"]);
    for half in &said[6..] {
        let angle: f64 = half.trim_start_matches("say: ").parse().expect("a number");
        assert!((angle - 15.0).abs() < 0.1, "{said:?}");
    }
}

#[test]
fn via_points_fill_the_queue_and_must_not_run_dry() {
    let (mut session, robot) = session();
    let text = "let home = joints()\nrepeat 6\n via move home + joints(5, 0, 0, 0, 0, 0) in 0.2\n via move home in 0.2\nend\nmove home in 0.2\n";
    session.run("via", text).expect("it runs");
    assert_eq!(robot.packets(), [Kind::Move; 13]);
    let (said, error) = run("via move joints(5, _, _, _, _, _) in 0.2\nwait 1\nsay \"no\"\n");
    assert!(error.contains("no motion followed one that was to go on"), "{error}");
    assert!(error.contains("test.robot:2:1") && error.contains("in this motion"), "{error}");
    assert_eq!(said.len(), 1, "{said:?}");
}

#[test]
fn signals_and_waits() {
    let said = says(
        "simulate input 3 on after 0.5\nsimulate analogue 1, 2.5\nwait input 3 on for 1\nsay time() < 0.6, input(3), analogue(1)\n\
         signal 2 on\nlevel 1, 0.25\nwait until analogue(1) > 2\ntry\n wait input 4 on for 0.2\nelse\n say \"none \", cause()\nend\n",
    );
    assert_eq!(said[0], "say: 112.5");
    assert_eq!(said[1..3], ["signal: output 2 on", "signal: level 1 is 0.25"]);
    assert_eq!(said[3..], ["caught: test.robot:9: waited 0.2 s without success: input 4 on", "say: none 0"]);
}

#[test]
fn errors_are_caught_with_their_cause() {
    let said = says(
        "try\n movel pose(2000, _, _, _, _, _)\nelse\n say cause()\nend\n\
         sub far()\n repeat 2\n  move pose(0, 2000, _, _, _, _)\n end\nend\ntry\n call far()\nelse\n say cause()\nend\nsay \"on\"\n",
    );
    assert_eq!(said[1], "say: 8");
    assert!(said[2].contains("test.robot:8: refused: the target is out of reach"), "{said:?}");
    assert_eq!(said[3..], ["say: 8", "say: on"]);
}

#[test]
fn faults_of_the_link_stop_the_robot() {
    for (fault, cause) in [("corrupt", 1), ("order", 2), ("late", 4), ("silent", 5)] {
        let said = says(&format!(
            "try\n simulate {fault} after 0.1\n move joints(40, _, _, _, _, _) in 3\nelse\n say cause()\n reset\nend\n\
             move joints(10, _, _, _, _, _) in 0.2\nsay joints().q1\n"
        ));
        let last: Vec<&str> = said.iter().rev().take(2).map(String::as_str).collect();
        assert_eq!(last, ["say: 10", &format!("say: {cause}")], "{fault}: {said:?}");
    }
}

/// An unanswered reset leaves the robot stopped: the wait ends, and another reset recovers.
#[test]
fn a_reset_without_an_answer_ends() {
    let (mut session, _) = session();
    let mut enter = |text: &str| {
        let error = session.enter("prompt", text, true).err().map(|mistakes| mistakes.render(false));
        (error.unwrap_or_default(), session.host().time())
    };
    enter("simulate late");
    let (error, _) = enter("move joints(30, _, _, _, _, _)");
    assert!(error.contains("a packet was begun and did not arrive in time"), "{error}");
    enter("simulate corrupt");
    let (error, since) = enter("reset");
    assert!(error.contains("the controller did not answer the reset: try it again"), "{error}");
    let (error, time) = enter("wait done");
    assert!(error.contains("`reset` lets it move again") && time - since < 0.1, "{time} s: {error}");
    for text in ["reset", "move joints(10, _, _, _, _, _) in 0.2"] {
        let (error, _) = enter(text);
        assert_eq!(error, "", "{text}");
    }
}

/// An unreported error ends a wait as well.
#[test]
fn an_error_that_is_not_reported_ends_a_wait() {
    let (mut session, robot) = session();
    robot.mute();
    session.enter("prompt", "start move joints(30, _, _, _, _, _) in 3", true).expect("it moves");
    session.enter("prompt", "simulate silent", true).expect("it is one");
    let since = session.host().time();
    let error = session.enter("prompt", "wait done", true).expect_err("it does not come to its end");
    assert!(error.render(false).contains("that was not reported; `reset` ends this state"));
    assert!(session.host().time() - since < 5.0);
    session.enter("prompt", "reset", true).expect("it is answered");
}

#[test]
fn jogs() {
    let said = says(
        "jog joints 10, 0, 0, 0, 0, 0 for 1\nsay floor(joints().q1 + 0.5)\njog world 0, 0, 0, 0, 0, 1\nwait 0.1\njog off\n",
    );
    assert_eq!(said, ["say: 10"]);
    let (_, error) = run("jog joints 1, 0, 0, 0, 0, 0\nwait done\n");
    assert!(error.contains("`jog off` ends it"), "{error}");
}

#[test]
fn a_session_records_steps_checks_and_saves() {
    let (mut session, _) = session();
    let enter = |session: &mut takt_robot::level::Session<_>, text: &str| {
        session.enter("prompt", text, true).unwrap_or_else(|error| panic!("{text}: {}", error.render(false)))
    };
    enter(&mut session, "record on");
    enter(&mut session, "move joints(10, _, _, _, _, _)");
    enter(&mut session, "teach here");
    assert_eq!(enter(&mut session, "sub back()"), Answer::More);
    enter(&mut session, "sub back()\n  move joints(0, _, _, _, _, _)\nend");
    enter(&mut session, "record off");
    enter(&mut session, "call back()");
    session.take_messages();
    enter(&mut session, "list");
    enter(&mut session, "check");
    let said = lines(session.take_messages());
    assert!(
        said[0].contains("   1  move joints(10") && said[0].contains("   2  let here = pose("),
        "{said:?}"
    );
    assert!(said[1].starts_with("check: program can run: it takes 0."), "{said:?}");
    enter(&mut session, "say joints().q1");
    enter(&mut session, "step");
    enter(&mut session, "say joints().q1");
    enter(&mut session, "save \"mine\"");
    enter(&mut session, "new");
    enter(&mut session, "load \"mine\"");
    enter(&mut session, "step");
    enter(&mut session, "continue");
    enter(&mut session, "check \"mine\"");
    let said = lines(session.take_messages());
    assert_eq!((said[0].as_str(), said[2].as_str()), ("say: 0", "say: 10"), "{said:?}");
    assert!(said[1].starts_with("note: next: line 2: let here"), "{said:?}");
    let error = session.enter("prompt", "load \"other\"", true).expect_err("there is none");
    assert!(error.render(false).contains("there is no file other"));
}

#[test]
fn a_check_does_not_move_the_robot() {
    let (mut session, robot) = session();
    session.check("c", "if 1 == 1\n wait input 5 on\nend\n").expect("it can run");
    let said = lines(session.take_messages());
    assert!(said[0].ends_with("taken to come: input 5 on"), "{said:?}");
    assert!(robot.packets().is_empty());
}

#[test]
fn every_command_has_an_example() {
    for command in COMMANDS {
        let parsed = takt_robot::language::parse(command.example, 0);
        assert!(parsed.mistakes.is_empty() && !parsed.open, "{}: {:?}", command.name, parsed.mistakes);
        assert!(command.syntax.contains(command.name));
    }
    for function in FUNCTIONS {
        assert!(function.syntax.starts_with(function.name));
    }
    let text = include_str!("../../../docs/robot-commands.md");
    // Ignore line breaks of the document.
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let items = one_line(text);
    let rows = COMMANDS.iter().map(|row| (row.syntax, row.text));
    for (syntax, text_of) in rows.chain(FUNCTIONS.iter().map(|row| (row.syntax, row.text))) {
        let row = one_line(&format!("- `{syntax}`: {text_of}"));
        assert!(items.contains(&row), "docs/robot-commands.md lacks\n{row}");
    }
    for cause in Cause::ALL {
        let row = format!("| {} | {cause} |\n", cause.number());
        assert!(text.contains(&row), "docs/robot-commands.md lacks\n{row}");
    }
}

/// Programs in the documentation parse, and its examples run.
#[test]
fn the_documents_program_is_one() {
    let text = include_str!("../../../docs/robot-commands.md");
    let listing =
        text.split("```robot\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a listing");
    let (mut session, _) = session();
    session.check("docs", listing).unwrap_or_else(|error| panic!("{}", error.render(false)));
}

/// Mistakes: each gives one error, at its place, with a suggested fix.
#[test]
fn mistakes() {
    let mut all = String::new();
    for text in [
        "mov joints()",
        "move",
        "move 3",
        "move jonts(0, 0, 0, 0, 0, 0)",
        "move joints(1, 2)",
        "move joints() at 10 in 3",
        "move joints() profile round",
        "let x = 1\nsay xx",
        "say y",
        "let speed = 3",
        "let x = _",
        "say pose(1, 2, 3, 4, 5, 6) * pose(1, 2, 3, 4, 5, 6)",
        "say pose(1, 2, 3, 4, 5, 6).q1",
        "say joints().roll",
        "say 1 / 0",
        "say 12ab",
        "say 1e999",
        "say \"open",
        "say (1",
        "if 1\nsay 1",
        "end",
        "call nothing()",
        "sub f(a)\nend\ncall f(1, 2)",
        "sub f(a, a)\nend",
        "sub f()\nend\nsub f()\nend",
        "if 1\nsub f()\nend\nend",
        "return",
        "signal 40 on",
        "signal 1.5 on",
        "signal 1 maybe",
        "wait -1",
        "repeat 2\nlist\nend",
        "limits speed 1, 2, 3",
        "if 0\nlet z = 1\nend\nsay z",
        "sub f(n)\ncall f(n + 1)\nend\ncall f(0)",
        "while 1\nend",
        "say input(0)",
        "say joints",
        "simulate flood",
        "jog sideways 1, 2, 3, 4, 5, 6",
        "say 1 ? 2",
    ] {
        let (_, error) = run(text);
        assert!(!error.is_empty(), "{text}");
        assert_eq!(error.matches("error[").count(), 1, "{text}\n{error}");
        all.push_str(&error);
    }
    insta::assert_snapshot!(all);
}

#[test]
fn depth_is_limited() {
    let deep = limits::EXPRESSION_DEPTH + 1;
    for text in [
        format!("say {}1{}", "(".repeat(deep), ")".repeat(deep)),
        format!("say {}1", "-".repeat(deep)),
        format!("say 1{}", " + 1".repeat(limits::EXPRESSION_SIZE)),
        "if 1\n".repeat(limits::BLOCK_DEPTH + 1),
        "if 1\n".repeat(50_000),
        format!("say {}", "(".repeat(100_000)),
        "#".repeat(limits::PROGRAM_BYTES + 1),
    ] {
        let (_, error) = run(&text);
        assert!(error.contains("error[limit]"), "{error}");
    }
    // Expressions at the limit of depth are executed.
    let deep = limits::EXPRESSION_DEPTH - 2;
    assert_eq!(says(&format!("say {}1{}", "(".repeat(deep), ")".repeat(deep))), ["say: 1"]);
}
