// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units through the program `hq`, which a script replaces that records its calls.

use crate::units::{folder, unit};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use takt_work::{Client, Cluster, Event, Place, Unit, WorkError, run};

static NEVER: AtomicBool = AtomicBool::new(false);
const WRITES: &str = "basename $R > $R";

fn client() -> Client {
    Client::Program(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fake_hq.py"))
}

fn text(path: PathBuf) -> String {
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn units_state_cpus_and_time() {
    let folder = folder("program");
    let cluster = Cluster::start(&client(), &folder.join("server"), 2).expect("it starts");
    assert!(cluster.processes().server > 0 && cluster.processes().workers.len() == 2);
    let wide = Unit {
        cpus: 3,
        time: Duration::from_secs(90),
        ..unit(&folder, "wide", "echo $RAYON_NUM_THREADS > $R")
    };
    let wrong = unit(&folder, "wrong", "echo 'as it was \"told\"' >&2; exit 7");
    let units = [wide, unit(&folder, "one", WRITES), wrong];
    let place = Place::Queue { client: client(), server: cluster.server().to_owned() };
    let mut done = 0;
    let failures = run(&units, &place, &NEVER, &mut |event| {
        if let Event::Done(count) = event {
            done = count;
        }
    })
    .expect("the server answers");
    assert_eq!((text(units[0].result.clone()).trim(), text(units[1].result.clone()).trim()), ("3", "one"));
    assert_eq!((done, failures.len()), (2, 1), "{failures:?}");
    assert_eq!(failures[0].reason, "Program terminated with exit code 7\nas it was \"told\"");
    assert!(!units[0].log().exists() && units[2].log().exists());
    let server = cluster.server().to_owned();
    drop(cluster);
    let (calls, jobs) = (text(server.join("calls")), text(server.join("jobs.toml")));
    assert_eq!(calls.matches("worker start --cpus 1 --on-server-lost stop\n").count(), 2, "{calls}");
    // A failed unit is submitted three times.
    assert_eq!(calls.matches("submit-file").count(), 3, "{calls}");
    assert!(jobs.contains("resources = { cpus = 3 }\ntime_request = \"90s\""), "{jobs}");
    assert!(jobs.contains("resources = { cpus = 1 }\ntime_request = \"5s\""), "{jobs}");
}

#[test]
fn a_lost_server_gets_the_rest_again() {
    let folder = folder("lost");
    let server = folder.join("server");
    std::fs::create_dir_all(&server).expect("the folder can be made");
    for file in ["hq-current", "lose"] {
        std::fs::write(server.join(file), "").expect("the file can be written");
    }
    let script = "echo x >> $R.count; basename $R > $R";
    let units: Vec<Unit> = (0..4).map(|index| unit(&folder, &index.to_string(), script)).collect();
    let mut notes = Vec::new();
    let place = Place::Queue { client: client(), server };
    let failures = run(&units, &place, &NEVER, &mut |event| {
        if let Event::Note(note) = event {
            notes.push(note.to_owned());
        }
    })
    .expect("the server answers");
    assert!(failures.is_empty(), "{failures:?}");
    let lost = "the server is lost (the connection is gone); what is not done is submitted again";
    assert_eq!(notes, [lost]);
    // Finished units are not run again.
    assert!(units.iter().all(|unit| text(unit.result.with_extension("count")) == "x\n"));
}

#[test]
fn a_folder_without_a_server_is_an_error() {
    let folder = folder("program-nobody");
    let place = Place::Queue { client: client(), server: folder.join("server") };
    let error = run(&[unit(&folder, "one", WRITES)], &place, &NEVER, &mut |_| {});
    let Err(WorkError::Queue(text)) = error else { panic!("{error:?}") };
    assert!(text.contains("no server has its files in") && text.contains("--hq-server"), "{text}");
}
