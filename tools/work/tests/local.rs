// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units on this computer: completion, retries and failure, checked against counters that the units write.

use crate::units::{folder, unit};
use std::fs;
use std::sync::atomic::AtomicBool;
use takt_work::{ATTEMPTS, Event, Failure, Place, Unit, run};

static NEVER: AtomicBool = AtomicBool::new(false);

fn here(units: &[Unit]) -> (Vec<Failure>, Vec<u64>) {
    let mut counts = Vec::new();
    let failures = run(units, &Place::Here(2), &NEVER, &mut |event| {
        if let Event::Done(count) = event {
            counts.push(count);
        }
    });
    (failures.expect("units can be run here"), counts)
}

#[test]
fn units_are_run_once_and_not_again() {
    let folder = folder("once");
    let count = "echo x >> $R.count; echo $R > $R.partial; mv $R.partial $R";
    let units: Vec<Unit> = (0..7).map(|index| unit(&folder, &index.to_string(), count)).collect();
    let (failures, counts) = here(&units);
    assert_eq!((failures, counts.last()), (Vec::new(), Some(&7)));
    fs::remove_file(folder.join("3")).expect("it is there");
    let (failures, counts) = here(&units);
    assert_eq!((failures, counts), (Vec::new(), vec![1]));
    for unit in &units {
        let runs =
            fs::read_to_string(folder.join(format!("{}.count", unit.name))).expect("it ran").lines().count();
        assert_eq!(runs, if unit.name == "3" { 2 } else { 1 }, "unit {}", unit.name);
        assert!(!unit.log().exists());
    }
}

#[test]
fn failing_units_are_retried_and_reported() {
    let folder = folder("fails");
    let units = [
        unit(&folder, "always", "echo x >> $R.count; echo 'no luck' >&2; exit 3"),
        unit(&folder, "first", "echo x >> $R.count; [ $(wc -l < $R.count) -ge 2 ] && touch $R"),
        unit(&folder, "silent", "true"),
        Unit { command: vec!["/no/such/program".to_owned()], ..unit(&folder, "nothing", "") },
    ];
    let (failures, _) = here(&units);
    let named: Vec<&str> = failures.iter().map(|failure| failure.name.as_str()).collect();
    assert_eq!(named, ["always", "nothing", "silent"]);
    assert!(failures[0].reason.contains("exit status: 3") && failures[0].reason.ends_with("no luck"));
    assert!(failures[1].reason.contains("`/no/such/program` cannot be started"), "{}", failures[1].reason);
    assert_eq!(failures[2].reason, "it wrote no result");
    let runs = |name: &str| fs::read_to_string(folder.join(name)).expect("it ran").lines().count();
    assert_eq!((runs("always.count"), runs("first.count")), (ATTEMPTS as usize, 2));
}

#[test]
fn nothing_is_begun_after_the_end() {
    let folder = folder("stopped");
    let units: Vec<Unit> = (0..4).map(|index| unit(&folder, &index.to_string(), "touch $R")).collect();
    let stop = AtomicBool::new(true);
    let failures = run(&units, &Place::Here(2), &stop, &mut |_| {}).expect("units can be run here");
    assert_eq!((failures, units.iter().filter(|unit| unit.is_done()).count()), (Vec::new(), 0));
}

#[test]
fn results_are_complete_or_absent() {
    let folder = folder("whole");
    let file = folder.join("result");
    takt_work::write(&file, b"all of it").expect("it can be written");
    assert_eq!(fs::read(&file).expect("it is there"), b"all of it");
    assert_eq!(fs::read_dir(&folder).expect("a folder").count(), 1);
    assert!(takt_work::write(&folder.join("no/such/folder"), b"").is_err());
}
