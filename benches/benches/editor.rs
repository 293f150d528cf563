// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language server: time from a keystroke in 10,000 lines to the diagnostics, compared with the assembly of these lines. On a busy machine,
//! processor time says more than wall-clock time.
#![allow(missing_docs, clippy::print_stdout)]

use crossbeam_channel::RecvTimeoutError;
use lsp_server::{Connection, Message, Notification, Request};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::time::{Duration, Instant};
use takt_asm::{MemoryLoader, Options};
use takt_editor::lsp::{Settings, serve};
use takt_isa::{Machine, T3};

/// t3 with a larger program memory.
static DEEP: Machine = Machine { name: "t3-deep", code_depth: 1 << 21, ..T3 };
const LINES: usize = 10_000;
const KEYS: usize = 60;
const URI: &str = "untitled:bench";

/// A source with `lines` lines, in a realistic mix.
fn source(lines: usize) -> String {
    let mut text = String::from(
        ".const k = 2*pi*80\n.input n:int, x, y\n.output F\n.reg a b c d t\n.macro scale to, by\n fmul to, to, by\n.endm\n\
         .once\n wait period\n.period\nperiod:\n",
    );
    let mut label = 0;
    while text.lines().count() + 12 < lines {
        for _ in 0..64 {
            let _ = write!(
                text,
                "; block {label}: a proportional controller\n\nstep{label}:\n        fmul    a, x, k\n        fmul    b, y, 0.25e-6         ; m\n\
                 \x20       fadd    c, a, b || mov d, x\n        scale   a, 2*k + {label}\n        fsub    c, c, a\n\
                 \x20       sel     d, d, x, y\n        itof    t, n\n        fsqrt   a, x\n        fadd    F, c, t\n"
            );
            label += 1;
        }
    }
    text.push_str("        wait period\n");
    text
}

/// Median and maximum, in milliseconds.
fn shown(mut times: Vec<f64>) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    (1e3 * times[times.len() / 2], 1e3 * times[times.len() - 1])
}

/// Wall-clock seconds, and processor seconds of all threads of this process, where the system counts them.
#[derive(Clone, Copy)]
struct ElapsedTime {
    clock: f64,
    processor: Option<f64>,
}

/// Start of a measurement.
struct StartTime(Instant, Option<f64>);

impl StartTime {
    fn now() -> StartTime {
        StartTime(Instant::now(), processor())
    }

    fn spent(&self) -> ElapsedTime {
        let processor = self.1.zip(processor()).map(|(begin, end)| end - begin);
        ElapsedTime { clock: self.0.elapsed().as_secs_f64(), processor }
    }
}

/// Processor seconds of the live threads, from Linux's nanosecond counters.
fn processor() -> Option<f64> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let of = |task: std::fs::DirEntry| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<u64>().ok()
    };
    Some(1e-9 * tasks.flatten().filter_map(of).sum::<u64>() as f64)
}

/// Prints a row of the table. `whole`: seconds of a complete assembly.
fn print(what: &str, times: &[ElapsedTime], whole: f64) {
    let (median, longest) = shown(times.iter().map(|spent| spent.clock).collect());
    let processor: Option<Vec<f64>> = times.iter().map(|spent| spent.processor).collect();
    let processor = processor.map_or("-".to_owned(), |times| format!("{:.1}", shown(times).0));
    println!("{what:>44}{processor:>22}{median:>12.1}{longest:>12.1}{:>24.2}", median / whole);
}

fn main() {
    let text = source(LINES);
    let (server, client) = Connection::memory();
    let settings = Settings { machine: &DEEP, ..Settings::default() };
    let serving = std::thread::spawn(move || serve(&server, settings));
    let notify = |method: &str, params: Value| {
        client.sender.send(Notification::new(method.to_owned(), params).into()).expect("the server is there");
    };
    let told = || loop {
        match client.receiver.recv_timeout(Duration::from_secs(60)) {
            Ok(Message::Notification(one)) if one.method == "textDocument/publishDiagnostics" => return,
            Ok(_) => {}
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => panic!("no diagnostics"),
        }
    };
    let initialize = Request::new(1.into(), "initialize".to_owned(), json!({ "capabilities": {} }));
    client.sender.send(initialize.into()).expect("the server is there");
    let document = json!({ "uri": URI, "languageId": "takt", "version": 1, "text": text });
    notify("textDocument/didOpen", json!({ "textDocument": document }));
    told();
    let line = text.lines().position(|line| line == "step400:").expect("there is one") + 1;
    let mut keys = Vec::new();
    for key in 0..KEYS {
        // Alternately misspells and corrects a mnemonic.
        let letter = if key % 2 == 0 { "k" } else { "l" };
        let range =
            json!({ "start": { "line": line, "character": 11 }, "end": { "line": line, "character": 12 } });
        let change = json!({ "range": range, "text": letter });
        let begin = StartTime::now();
        notify(
            "textDocument/didChange",
            json!({ "textDocument": { "uri": URI, "version": key + 2 }, "contentChanges": [change] }),
        );
        told();
        keys.push(begin.spent());
    }
    notify("exit", Value::Null);
    drop(client);
    let _ = serving.join();

    let loader = MemoryLoader::of("bench.s", text.as_str());
    let options = Options { machine: &DEEP, ..Options::default() };
    let spent = |run: &dyn Fn()| -> Vec<ElapsedTime> {
        let one = || {
            let begin = StartTime::now();
            run();
            begin.spent()
        };
        (0..KEYS).map(|_| one()).collect()
    };
    let assemble = spent(&|| drop(takt_asm::assemble("bench.s", &loader, &options)));
    let check = spent(&|| drop(takt_asm::check("bench.s", &loader, &options)));
    let (whole, _) = shown(assemble.iter().map(|spent| spent.clock).collect());
    println!(
        "{:>44}{:>22}{:>12}{:>12}{:>24}",
        "in 10,000 lines", "median of CPU, ms", "median, ms", "longest, ms", "of assembling them"
    );
    print("read, check, index", &check, whole);
    print("keystroke to diagnostics, 10 ms of it a pause", &keys, whole);
    print("assemble", &assemble, whole);
}
