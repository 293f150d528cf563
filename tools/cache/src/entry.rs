// SPDX-License-Identifier: MIT OR Apache-2.0
//! Entries: files that end in a checksum of their contents.

use crate::folder::is_own;
use std::fs::{self, File};
use std::hash::{DefaultHasher, Hasher};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

/// Largest size of an entry, in bytes.
const LONGEST: u64 = 1 << 28;

/// 64-bit checksum (SipHash): a corrupted file passes with a probability of 2⁻⁶⁴.
pub(crate) fn sum(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    hasher.finish()
}

/// Appends the checksum to contents.
pub fn seal(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = sum(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

/// Contents of a sealed entry; `None` if they are damaged.
pub fn unseal(bytes: &[u8]) -> Option<&[u8]> {
    let (contents, expected) = bytes.split_last_chunk::<8>()?;
    (sum(contents) == u64::from_le_bytes(*expected)).then_some(contents)
}

/// Reads a regular file of this user. Any other file counts as missing: a pipe would block, and another user's file is not trusted.
pub fn plain(path: &Path) -> Option<Vec<u8>> {
    let about = fs::symlink_metadata(path).ok()?;
    if !about.is_file() || !is_own(&about) || about.len() > LONGEST {
        return None;
    }
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(LONGEST).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Reads an entry, if it exists. Removes a damaged entry.
pub fn read(path: &Path) -> Option<Vec<u8>> {
    let mut bytes = plain(path)?;
    let length = unseal(&bytes).map(<[u8]>::len);
    let Some(length) = length else {
        discard(path);
        return None;
    };
    bytes.truncate(length);
    Some(bytes)
}

/// Stores contents as an entry, atomically, replacing whatever is at the path. Creates the folder.
///
/// # Errors
/// If the file cannot be written.
pub fn keep(path: &Path, contents: Vec<u8>) -> io::Result<()> {
    write(path, &seal(contents))
}

/// Writes contents without a checksum, for other programs, unless the file already has these contents.
///
/// # Errors
/// If the file cannot be written.
pub fn copy(path: &Path, contents: &[u8]) -> io::Result<()> {
    if plain(path).is_some_and(|known| known == contents) { Ok(()) } else { write(path, contents) }
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let mut partial = path.to_owned().into_os_string();
    partial.push(format!(".{}.{number}.partial", std::process::id()));
    let partial = PathBuf::from(partial);
    if path.is_dir() {
        discard(path);
    }
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    if written.is_err() {
        discard(&partial);
    }
    written
}

/// Removes a file, pipe, link or folder, if it exists.
pub fn discard(path: &Path) {
    let _ = match fs::symlink_metadata(path) {
        Ok(about) if about.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(_) => Ok(()),
    };
}

/// Keeps the newest `most` entries of a folder and removes the others.
pub fn prune(folder: &Path, most: usize) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut kept: Vec<(SystemTime, PathBuf)> =
        entries.filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()))).collect();
    kept.sort();
    for (_, path) in kept.iter().take(kept.len().saturating_sub(most)) {
        discard(path);
    }
}
