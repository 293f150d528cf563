// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cache entries: read back unchanged, or not at all.

use crate::{Folder, pipe};
use std::fs;
use std::os::unix::fs::{MetadataExt, chown, symlink};
use takt_cache::{copy, discard, is_whole, keep, plain, prune, read, seal_program};

/// All single-bit corruptions of `bytes`.
fn flips(bytes: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    (0..bytes.len() * 8).map(|bit| {
        let mut damaged = bytes.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        damaged
    })
}

#[test]
fn every_flipped_bit_is_noticed() {
    let root = Folder::new("flips");
    let path = root.0.join("below/entry");
    for contents in [b"".to_vec(), b"0.1".to_vec(), (0..=255).collect()] {
        keep(&path, contents.clone()).unwrap();
        assert_eq!(read(&path), Some(contents));
        let whole = fs::read(&path).unwrap();
        for damaged in flips(&whole) {
            fs::write(&path, damaged).unwrap();
            assert_eq!(read(&path), None);
            assert!(!path.exists(), "a damaged entry is removed");
        }
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(read(&path), None);
        }
    }
}

#[test]
fn every_flipped_bit_of_a_program_is_noticed() {
    let root = Folder::new("programs");
    let path = root.0.join("program");
    let code: Vec<u8> = (0..300_u32).map(|i| (i * 37) as u8).collect();
    fs::write(&path, &code).unwrap();
    assert!(!is_whole(&path), "without a checksum");
    seal_program(&path).unwrap();
    assert!(is_whole(&path));
    for damaged in flips(&code).chain([code[1..].to_vec(), Vec::new()]) {
        fs::write(&path, damaged).unwrap();
        assert!(!is_whole(&path));
    }
    fs::write(&path, &code).unwrap();
    let sum = root.0.join("program.sum");
    let text = fs::read(&sum).unwrap();
    // The last byte, a newline, is not part of the checksum.
    for damaged in flips(&text[..16]) {
        fs::write(&sum, damaged).unwrap();
        // Upper-case digits denote the same number.
        let is_same = fs::read(&sum).unwrap().eq_ignore_ascii_case(&text[..16]);
        assert_eq!(is_whole(&path), is_same);
    }
}

#[test]
fn pipes_links_and_folders_are_no_entries() {
    let root = Folder::new("kinds-of-entries");
    let path = root.0.join("entry");
    pipe(&path);
    assert_eq!((read(&path), plain(&path), is_whole(&path)), (None, None, false));
    keep(&path, b"one".to_vec()).unwrap();
    assert_eq!(read(&path).unwrap(), b"one");
    fs::rename(&path, root.0.join("other")).unwrap();
    symlink(root.0.join("other"), &path).unwrap();
    assert_eq!(read(&path), None);
    keep(&path, b"two".to_vec()).unwrap();
    assert_eq!(
        (read(&path).unwrap(), read(&root.0.join("other")).unwrap()),
        (b"two".to_vec(), b"one".to_vec())
    );
    discard(&path);
    fs::create_dir_all(path.join("below")).unwrap();
    assert_eq!(read(&path), None);
    keep(&path, b"three".to_vec()).unwrap();
    assert_eq!(read(&path).unwrap(), b"three");
    discard(&path);
    pipe(&path);
    copy(&path, b"four").unwrap();
    copy(&path, b"four").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"four");
    // A pipe in place of the checksum file.
    pipe(&root.0.join("entry.sum"));
    assert!(!is_whole(&path));
}

/// Needs the right to change a file's owner; without it, prints a note and passes.
#[test]
fn a_file_of_another_user_is_no_entry() {
    let root = Folder::new("foreign");
    let path = root.0.join("entry");
    keep(&path, b"one".to_vec()).unwrap();
    let user = fs::metadata(&path).unwrap().uid();
    if chown(&path, Some(user + 1000), None).is_err() {
        eprintln!("skipped: this user cannot give a file to another one");
        return;
    }
    assert_eq!(read(&path), None);
    seal_program(&path).unwrap();
    assert!(!is_whole(&path));
    chown(&path, Some(user), None).unwrap();
    assert!(is_whole(&path));
}

#[test]
fn pruning_keeps_the_newest() {
    let root = Folder::new("pruned");
    for i in 0..5_u64 {
        let path = root.0.join(i.to_string());
        keep(&path, vec![0]).unwrap();
        let time = std::time::UNIX_EPOCH + std::time::Duration::from_secs(i * 100);
        fs::File::options().write(true).open(&path).unwrap().set_modified(time).unwrap();
    }
    prune(&root.0, 2);
    let mut left: Vec<_> = fs::read_dir(&root.0).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["3", "4"]);
}
