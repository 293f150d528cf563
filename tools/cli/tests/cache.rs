// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cache of assembled programs: results are the same with and without it, and a change causes a miss.
#![allow(clippy::print_stderr)]

use crate::common::{Folder, RunOutput};

const TRACKING: &str = include_str!("../../../programs/hybrid/tracking.s");

const ROBOT: &str = include_str!("../../../programs/hybrid/robot.s");

/// Runs a command with its cache in the folder.
fn takt(folder: &Folder, line: &str) -> String {
    let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
    command.env("XDG_CACHE_HOME", folder.path().join("cache"));
    RunOutput::of(command).ok()
}

/// Files in the cache.
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
    // The first command fills the cache for the others.
    let first = lines.map(|line| takt(&folder, line));
    let files = kept(&folder);
    assert_eq!(files.len(), 1, "{files:?}");
    assert_eq!(lines.map(|line| takt(&folder, line)), first);

    // A damaged file is replaced.
    let whole = std::fs::read(&files[0]).unwrap();
    let own = folder.line("bound t.s").ok();
    for damaged in [&whole[..whole.len() / 2], b"", &whole[1..]] {
        std::fs::write(&files[0], damaged).unwrap();
        assert_eq!(takt(&folder, "bound t.s"), own);
    }
    assert_eq!(std::fs::read(&files[0]).unwrap(), whole);

    // A changed source, another machine and another option have separate entries.
    folder.write("t.s", format!("{TRACKING}\n; changed"));
    assert_eq!(takt(&folder, "bound t.s"), own);
    let small = takt(&folder, "bound t.s -m t1");
    assert!(small != own && small == takt(&folder, "bound t.s -m t1"));
    takt(&folder, "bound t.s --contract on -m t4");
    assert_eq!(kept(&folder).len(), 4);

    // A changed include also has a separate entry.
    folder.write("robot.s", format!("{ROBOT}\n; changed"));
    takt(&folder, "bound t.s");
    assert_eq!(kept(&folder).len(), 5);

    // Programs that assemble quickly are not cached.
    folder.write("small.s", ".output y\n.period\np: mov y, zero\n wait p\n");
    takt(&folder, "bound small.s");
    assert_eq!(kept(&folder).len(), 5);
}

/// Parts of a cache entry.
fn parts(entry: &[u8]) -> Vec<Vec<u8>> {
    let (mut rest, mut parts) = (takt_cache::unseal(entry).unwrap(), Vec::new());
    while let Some((length, after)) = rest.split_first_chunk::<8>() {
        let (part, after) = after.split_at(u64::from_le_bytes(*length) as usize);
        parts.push(part.to_vec());
        rest = after;
    }
    parts
}

fn entry(parts: &[Vec<u8>]) -> Vec<u8> {
    let part = |part: &Vec<u8>| [&(part.len() as u64).to_le_bytes()[..], part].concat();
    takt_cache::seal(parts.iter().flat_map(part).collect())
}

/// Path of one program's entry, the entries of two programs, and the correct output of the first.
fn two_entries(folder: &Folder) -> (std::path::PathBuf, [Vec<u8>; 2], String) {
    folder.write("t.s", TRACKING);
    folder.write("robot.s", ROBOT);
    let right = takt(folder, "bound t.s");
    let path = kept(folder).remove(0);
    let own = std::fs::read(&path).unwrap();
    folder.write("other.s", format!("{TRACKING}\n; other"));
    takt(folder, "bound other.s -m t1");
    let other = kept(folder).into_iter().find(|other| *other != path).unwrap();
    let other = std::fs::read(other).unwrap();
    (path, [own, other], right)
}

#[test]
fn a_flipped_bit_is_no_hit() {
    let folder = Folder::new();
    let (path, [whole, _], right) = two_entries(&folder);
    // The tests of `takt-cache` flip every bit.
    for i in 0..12 {
        let at = (whole.len() - 1) * i / 11;
        let mut damaged = whole.clone();
        damaged[at] ^= 1 << (i % 8);
        std::fs::write(&path, damaged).unwrap();
        assert_eq!(takt(&folder, "bound t.s"), right, "byte {at} of {}", whole.len());
        assert_eq!(std::fs::read(&path).unwrap(), whole);
    }
}

#[cfg(unix)]
mod owned {
    use super::*;
    use std::fs;
    use std::os::unix::fs::{MetadataExt, chown};

    /// Runs a command with other environment variables, and with `tmp` as folder for temporary files.
    fn bound(folder: &Folder, variables: &[(&str, &str)]) -> RunOutput {
        let mut command = folder.command(&["bound", "t.s"]);
        command.env_remove("HOME").env_remove("XDG_CACHE_HOME").env("TMPDIR", folder.path().join("tmp"));
        command.envs(variables.iter().copied());
        RunOutput::of(command)
    }

    #[test]
    fn a_pipe_does_not_hang() {
        let folder = Folder::new();
        let (path, [whole, _], right) = two_entries(&folder);
        fs::remove_file(&path).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert_eq!(takt(&folder, "bound t.s"), right);
        assert_eq!(fs::read(&path).unwrap(), whole);
    }

    #[test]
    fn a_relative_path_is_ignored() {
        let folder = Folder::new();
        folder.write("t.s", TRACKING);
        folder.write("robot.s", ROBOT);
        let home = folder.path().join("home");
        bound(&folder, &[("XDG_CACHE_HOME", "cache"), ("HOME", home.to_str().unwrap())]).ok();
        assert!(!folder.path().join("cache").exists());
        assert_eq!(fs::read_dir(home.join(".cache/takt/programs")).unwrap().count(), 1);
    }

    #[test]
    fn a_program_of_another_user_is_not_used() {
        let folder = Folder::new();
        let (path, [own, other], right) = two_entries(&folder);
        // An entry with the key of this program, but the code of another.
        let wrong = [parts(&own)[..1].to_vec(), parts(&other)[1..].to_vec()].concat();
        let user = fs::metadata(folder.path()).unwrap().uid();
        let cache = folder.path().join(format!("tmp/takt-{user}"));
        let planted = cache.join("programs").join(path.file_name().unwrap());
        assert_eq!(bound(&folder, &[]).ok(), right);
        takt_cache::keep(&planted, takt_cache::unseal(&entry(&wrong)).unwrap().to_vec()).unwrap();
        // The entry would be used if it belonged to this user.
        assert_ne!(bound(&folder, &[]).ok(), right);
        if chown(&planted, Some(user + 1000), None).is_err() {
            eprintln!("skipped: this user cannot give a file to another one");
            return;
        }
        assert_eq!(bound(&folder, &[]).ok(), right);
        takt_cache::keep(&planted, takt_cache::unseal(&entry(&wrong)).unwrap().to_vec()).unwrap();
        chown(&cache, Some(user + 1000), None).unwrap();
        assert_eq!(bound(&folder, &[]).ok(), right);
        // Circuits are compiled to native code, which is refused unless the folder belongs to the user.
        let mut command = folder.command(&["cosim", "t.s"]);
        command.env_remove("HOME").env_remove("XDG_CACHE_HOME").env("TMPDIR", folder.path().join("tmp"));
        let text = RunOutput::of(command).stderr;
        assert!(text.contains(&format!("belongs to user {}", user + 1000)), "{text}");
    }
}
