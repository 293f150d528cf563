// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files beside a model that hold its numbers.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Reads `length` bytes at `offset` of a file in the folder or below it.
///
/// # Errors
/// If the file is missing, too short, or a link that leads out of the folder.
pub fn external_data(folder: &Path, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, String> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let told = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => {
            format!("`{name}`, in which its numbers lie, is not beside the model")
        }
        _ => format!("`{name}`, in which its numbers lie, cannot be read: {error}"),
    };
    let path = folder.join(name).canonicalize().map_err(told)?;
    if !path.starts_with(folder.canonicalize().map_err(told)?) {
        return Err(format!("`{name}` is a link that leaves the folder of the model"));
    }
    let mut file = File::open(path).map_err(told)?;
    let end = offset.saturating_add(length as u64);
    let size = file.metadata().map_err(told)?.len();
    if end > size {
        return Err(format!("`{name}` has {size} bytes, and its numbers are those from {offset} to {end}"));
    }
    let mut bytes = vec![0; length];
    file.seek(SeekFrom::Start(offset)).and_then(|_| file.read_exact(&mut bytes)).map_err(told)?;
    Ok(bytes)
}
