// SPDX-License-Identifier: MIT OR Apache-2.0
//! Native code: programs and object files with the checksum in a separate file, because some systems reject a program with trailing bytes.

use crate::entry::{plain, sum};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Path of a program's checksum file.
fn checksum_path(program: &Path) -> PathBuf {
    let mut path = program.to_owned().into_os_string();
    path.push(".sum");
    PathBuf::from(path)
}

/// Writes the checksum file of a program.
///
/// # Errors
/// If the program cannot be read, or the checksum cannot be written.
pub fn seal_program(program: &Path) -> io::Result<()> {
    fs::write(checksum_path(program), format!("{:016x}\n", sum(&fs::read(program)?)))
}

/// The program is a regular file of this user and matches its checksum.
pub fn is_whole(program: &Path) -> bool {
    let expected = plain(&checksum_path(program)).and_then(|text| String::from_utf8(text).ok());
    let expected = expected.and_then(|text| u64::from_str_radix(text.trim_end(), 16).ok());
    expected.is_some_and(|expected| plain(program).is_some_and(|bytes| sum(&bytes) == expected))
}
