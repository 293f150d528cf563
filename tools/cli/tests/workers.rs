// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `--hq`: units in other processes give the same results as a single process, with HyperQueue from `PATH` and no silent
//! installation.
//!
//! A script replaces the program `hq`; the tests of takt-work run the real package.

use crate::common::{Folder, RunOutput};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;

const PROGRAM: &str = ".input x\n.output y\n.period\np: fadd y, x, x\n wait p\n";

/// A folder with a subfolder `bin` for `PATH`, which contains `hq`.
fn workshop() -> Folder {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("bin")).unwrap();
    let fake = Path::new(env!("CARGO_MANIFEST_DIR")).join("../work/tests/fake_hq.py");
    symlink(fake, folder.path().join("bin/hq")).unwrap();
    folder
}

fn takt(folder: &Folder, line: &str) -> RunOutput {
    let mut command = folder.command(&line.split(' ').collect::<Vec<_>>());
    let path = format!("{}:/usr/local/bin:/usr/bin:/bin", folder.path().join("bin").display());
    command.env("XDG_CACHE_HOME", folder.path().join("cache")).env("TAKT_VENV", folder.path().join("venv"));
    RunOutput::of({
        command.env("PATH", path);
        command
    })
}

#[test]
fn robots_of_other_processes_are_the_same() {
    let folder = workshop();
    let line = "track -q --json --monte-carlo 70 --seed 5 --periods 300";
    let here = takt(&folder, line).ok();
    assert_eq!(takt(&folder, &format!("{line} --hq")).ok(), here);
    // Nothing was installed, and the server's folder and the units have been removed.
    assert!(!folder.path().join("venv").exists());
    let left: Vec<_> = std::fs::read_dir(folder.path().join("cache/takt/track/units")).unwrap().collect();
    assert_eq!(left.len(), 0, "{left:?}");
}

#[test]
fn a_running_server_gets_units_with_cpus_and_time() {
    let folder = workshop();
    std::fs::create_dir(folder.path().join("server")).unwrap();
    folder.write("server/hq-current", "");
    takt(&folder, "track -q --monte-carlo 70 --periods 100 --hq-server server").ok();
    let jobs = folder.read_text("server/jobs.toml");
    assert_eq!(jobs.matches("[[task]]").count(), 2, "{jobs}");
    assert!(jobs.contains("cpus = 1") && jobs.contains("time_request = \""), "{jobs}");
    let calls = folder.read_text("server/calls");
    assert!(!calls.contains("server start") && !calls.contains("worker start"), "{calls}");
}

#[test]
fn images_are_verified_by_other_processes() {
    let folder = workshop();
    folder.write("a.s", PROGRAM);
    folder.write("b.s", PROGRAM.replace("fadd y, x, x", "fmul y, x, x"));
    for name in ["a", "b"] {
        takt(&folder, &format!("asm {name}.s -o {name}.takt")).ok();
    }
    let line = "verify a.takt a.s b.takt a.s b.takt b.s b.s b.s";
    let here = takt(&folder, line);
    assert_eq!(here.status, Some(1));
    let verified =
        here.stdout.lines().filter(|line| line.contains("verified: the image is its source")).count();
    assert_eq!(verified, 2, "{}", here.stdout);
    assert!(here.stdout.contains("b.takt: not verified: a.s:4: output `y`"), "{}", here.stdout);
    assert!(here.stdout.contains("b.s: cannot be checked: b.s is not an image"), "{}", here.stdout);
    for more in ["", " --json"] {
        let (here, elsewhere) =
            (takt(&folder, &format!("{line}{more}")), takt(&folder, &format!("{line}{more} --hq")));
        assert_eq!((here.stdout, here.status), (elsewhere.stdout, elsewhere.status), "{}", elsewhere.stderr);
    }
    assert!(takt(&folder, "verify a.takt a.s b.takt").stderr.contains("b.takt has no source"));
}

#[test]
fn robots_of_one_run_are_not_given_away() {
    let folder = workshop();
    let done = takt(&folder, "track --hq");
    assert!(
        done.stderr.contains("--hq and --hq-server distribute the robots of --monte-carlo"),
        "{}",
        done.stderr
    );
    let done = takt(&folder, "track --monte-carlo 3 --gcode - --hq");
    assert!(done.stderr.contains("units read programs from files"), "{}", done.stderr);
}

/// Another program called `hq` is not used; an installation is announced, and if it fails the message states how to do without a network.
#[test]
fn an_installation_is_announced() {
    let folder = workshop();
    std::fs::remove_file(folder.path().join("bin/hq")).unwrap();
    for (name, script) in [("hq", "#!/bin/sh\necho hq 1.2\n"), ("python3", "#!/bin/sh\nexit 1\n")] {
        let path = format!("bin/{name}");
        folder.write(&path, script);
        std::fs::set_permissions(folder.path().join(&path), PermissionsExt::from_mode(0o755)).unwrap();
    }
    let done = takt(&folder, "track -q --monte-carlo 3 --periods 10 --hq");
    assert_eq!(done.status, Some(1), "{}", done.stderr);
    for part in ["HyperQueue is not on PATH", "installing hyperqueue==", "docs/campaigns.md"] {
        assert!(done.stderr.contains(part), "{part}: {}", done.stderr);
    }
}
