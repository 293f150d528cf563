// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units on a HyperQueue server with two workers; kills a worker and then the server in mid-run. Results must equal those of a local run.
//!
//! HyperQueue is in the Python environment that `cargo xtask test` creates (`TAKT_VENV`, or `.venv`).

#![allow(clippy::print_stdout)]

use crate::units::{folder, unit};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use takt_work::{Client, Cluster, Event, Place, Unit, WorkError, has_package, run};

static NEVER: AtomicBool = AtomicBool::new(false);

fn client() -> Client {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let venv = std::env::var_os("TAKT_VENV").map_or_else(|| root.join(".venv"), PathBuf::from);
    let python = venv.join("bin/python3");
    let has = has_package(&python);
    assert!(has, "{} has no {}; `cargo xtask test` installs it", python.display(), takt_work::HYPERQUEUE);
    Client::Python(python)
}

fn end(process: u32) {
    let ended = Command::new("kill").args(["-9", &process.to_string()]).status();
    assert!(ended.is_ok_and(|status| status.success()), "process {process} is no more");
}

#[test]
fn worker_and_server_may_end() {
    let folder = folder("queue");
    let client = client();
    let cluster = Cluster::start(&client, &folder.join("server"), 2).expect("a server starts");
    let script = "echo x >> $R.count; sleep 0.4; basename $R > $R.partial; mv $R.partial $R";
    let mut units: Vec<Unit> = (0..30).map(|index| unit(&folder, &format!("{index:02}"), script)).collect();
    units.push(unit(&folder, "wrong", "echo 'as it was told' >&2; exit 7"));
    let place = Place::Queue { client, server: cluster.server().to_owned() };
    let (mut ended, mut notes) = (0, Vec::new());
    let failures = run(&units, &place, &NEVER, &mut |event| match event {
        Event::Done(4..) if ended == 0 => {
            ended = 1;
            end(cluster.processes().workers[0]);
        }
        Event::Done(12..) if ended == 1 => {
            ended = 2;
            end(cluster.processes().server);
        }
        Event::Done(_) => {}
        Event::Note(note) => notes.push(note.to_owned()),
    })
    .expect("the server answers");
    assert_eq!(ended, 2, "nothing was ended");
    assert!(notes.iter().any(|note| note.contains("the server is lost")), "{notes:?}");
    assert_eq!(failures.len(), 1, "{failures:?}");
    assert!(failures[0].name == "wrong" && failures[0].reason.ends_with("as it was told"), "{failures:?}");
    for unit in units.iter().filter(|unit| unit.name != "wrong") {
        let text = std::fs::read_to_string(&unit.result).expect("every unit is done");
        assert_eq!(text.trim(), unit.name);
    }
}

#[test]
fn reports_a_folder_without_a_server() {
    let folder = folder("nobody");
    let place = Place::Queue { client: client(), server: folder.join("server") };
    let error = run(&[unit(&folder, "one", "touch $R")], &place, &NEVER, &mut |_| {});
    let Err(WorkError::Queue(text)) = error else { panic!("{error:?}") };
    assert!(text.contains("no server has its files in") && text.contains("--hq-server"), "{text}");
}

/// CPU time of a process without its children, in seconds (`proc_pid_stat(5)`: fields 14 and 15, in hundredths of a second).
fn taken(process: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("it runs");
    let fields = text.rsplit_once(')').expect("its name is in parentheses").1.split_whitespace();
    fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("a number") / 100.0).sum()
}

/// Figure of docs/campaigns.md: overhead of the scheduler for 10,000 units.
///
/// ```text
/// cargo test --release -p takt-work --test suite -- --ignored --nocapture queue::ten_thousand_units
/// ```
#[test]
#[ignore = "takes minutes"]
fn ten_thousand_units() {
    let folder = folder("many");
    let client = client();
    let cluster = Cluster::start(&client, &folder.join("server"), 2).expect("a server starts");
    let units: Vec<Unit> = (0..10_000).map(|index| unit(&folder, &format!("{index:05}"), ": > $R")).collect();
    let place = Place::Queue { client, server: cluster.server().to_owned() };
    let begin = std::time::Instant::now();
    let failures = run(&units, &place, &NEVER, &mut |_| {}).expect("the server answers");
    assert_eq!((failures.len(), units.iter().filter(|unit| unit.is_done()).count()), (0, units.len()));
    let processes = cluster.processes();
    let workers: f64 = processes.workers.iter().map(|worker| taken(*worker)).sum();
    println!(
        "{} units in {:.0} s; CPU time of the server {:.1} s, of the workers {workers:.1} s",
        units.len(),
        begin.elapsed().as_secs_f64(),
        taken(processes.server),
    );
}
