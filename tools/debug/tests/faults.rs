// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fault messages: at the source line, or without the source by file, line and bundle.

use takt_asm::{MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::console::Console;
use takt_debug::fault::diagnose;
use takt_debug::session::{Options, Session};
use takt_emu::Emulator;
use takt_isa::{F3, Program};

/// Assembles a program that contains a macro, a bundle of two operations, a tab and comments; also returns the source texts.
fn assembled(body: &str) -> (Program, Vec<(String, String)>) {
    let files = [
        ("a.s", &*format!(".include \"word.s\"\n.reg r:int\n.state s:int\n.once\n{body}")),
        ("word.s", "; reads\n.macro word d, at\n\tld d, [at]  ; here\n.endm\n"),
    ];
    let options = AsmOptions { machine: &F3, ..AsmOptions::default() };
    let assembled = assemble("a.s", &MemoryLoader::new(&files), &options);
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let sources = assembled.debug_info().sources;
    (assembled.program, sources)
}

#[test]
fn faults_at_their_lines() {
    let mut text = String::new();
    for body in [
        " nop\n fmul s, s, s || iadd r, r, r ; of two operations\n halt\n",
        " li s, 4000\n word r, s\n halt\n",
        "again: call again ; for ever\n",
        " ret\n",
        " .loop_bound 1\nhead: li s, 1\n bnz s, head\n halt\n",
        " nop\n",
    ] {
        let (program, sources) = assembled(body);
        let fault = Emulator::new(&program).expect("it fits").run().expect_err("it faults");
        let with = diagnose(&fault, &program, &sources);
        let without = diagnose(&fault, &program, &[]);
        text += &format!("{}\n{}\n", with.render(false), without.render(false));
        assert!(with.has_errors() && without.has_errors());
        // A different, shorter text lacks the line.
        let other: Vec<_> = sources.iter().map(|(name, _)| (name.clone(), String::new())).collect();
        let shown = diagnose(&fault, &program, &other).render(false);
        assert!(shown == without.render(false) || shown == with.render(false), "{shown}");
    }
    insta::assert_snapshot!(text);
}

#[test]
fn the_console_stops_with_the_line() {
    let (program, sources) = assembled(" li s, 4000\n word r, s\n halt\n");
    let session = Session::new(&program, Options { sources, ..Options::default() }).expect("it fits");
    insta::assert_snapshot!(Console::new(session).execute("continue").expect("it runs"));
}
