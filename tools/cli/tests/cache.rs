// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembled programs that are kept: the same results with them and without, and none for what has changed.

use crate::common::{Done, Folder};

const TRACKING: &str = include_str!("../../../programs/hybrid/tracking.s");

const ROBOT: &str = include_str!("../../../programs/hybrid/robot.s");

/// A run whose cache lies in the folder.
fn takt(folder: &Folder, line: &str) -> String {
    let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
    command.env("XDG_CACHE_HOME", folder.path().join("cache"));
    Done::of(command).ok()
}

/// The files that are kept.
fn kept(folder: &Folder) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder.path().join("cache/takt/programs"));
    let mut paths: Vec<_> = entries.into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

#[test]
fn results_are_the_same_from_the_cache() {
    let folder = Folder::new();
    folder.write("t.s", TRACKING);
    folder.write("robot.s", ROBOT);
    let lines = ["bound t.s --json", "accuracy t.s --json"];
    // Whichever command comes first fills it for the others.
    let first = lines.map(|line| takt(&folder, line));
    let files = kept(&folder);
    assert_eq!(files.len(), 1, "{files:?}");
    assert_eq!(lines.map(|line| takt(&folder, line)), first);

    // A file that is damaged is replaced.
    let whole = std::fs::read(&files[0]).unwrap();
    let own = folder.line("bound t.s").ok();
    for damaged in [&whole[..whole.len() / 2], b"", &whole[1..]] {
        std::fs::write(&files[0], damaged).unwrap();
        assert_eq!(takt(&folder, "bound t.s"), own);
    }
    assert_eq!(std::fs::read(&files[0]).unwrap(), whole);

    // A changed source, another machine and another option have files of their own.
    folder.write("t.s", format!("{TRACKING}\n; changed"));
    assert_eq!(takt(&folder, "bound t.s"), own);
    let small = takt(&folder, "bound t.s -m t1");
    assert!(small != own && small == takt(&folder, "bound t.s -m t1"));
    takt(&folder, "bound t.s --contract on -m t4");
    assert_eq!(kept(&folder).len(), 4);

    // So has a changed source that is included.
    folder.write("robot.s", format!("{ROBOT}\n; changed"));
    takt(&folder, "bound t.s");
    assert_eq!(kept(&folder).len(), 5);

    // What is assembled at once is not kept.
    folder.write("small.s", ".output y\n.period\np: mov y, zero\n wait p\n");
    takt(&folder, "bound small.s");
    assert_eq!(kept(&folder).len(), 5);
}
