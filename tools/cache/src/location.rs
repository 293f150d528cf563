// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results by content key: an entry contains its whole key, so that a hash collision is detected as a miss.

use crate::entry::{keep, prune, read};
use crate::folder::folder;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Path of a result in the cache, with its key.
#[derive(Clone, Debug)]
pub struct CacheLocation {
    path: PathBuf,
    key: Vec<u8>,
}

impl CacheLocation {
    /// Location of the result for `key` among the results of `kind`; `None` without a cache folder.
    pub fn of(kind: &str, key: Vec<u8>) -> Option<CacheLocation> {
        let mut hasher = DefaultHasher::new();
        key.hash(&mut hasher);
        let path = folder().ok()?.join(kind).join(format!("{:016x}", hasher.finish()));
        Some(CacheLocation { path, key })
    }

    /// Reads the parts of the result, if it is stored.
    pub fn read(&self) -> Option<Vec<Vec<u8>>> {
        let bytes = read(&self.path)?;
        let (mut rest, mut parts) = (bytes.as_slice(), Vec::new());
        while !rest.is_empty() {
            let (length, after) = rest.split_first_chunk::<8>()?;
            let (part, after) = after.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
            parts.push(part.to_vec());
            rest = after;
        }
        let own = parts.first().is_some_and(|key| *key == self.key);
        own.then(|| parts.split_off(1))
    }

    /// Stores the parts of a result, and keeps the newest `most` results of its kind. Errors are ignored: a missing result is computed
    /// again.
    pub fn keep(&self, parts: &[&[u8]], most: usize) {
        let mut bytes = Vec::new();
        for part in std::iter::once(self.key.as_slice()).chain(parts.iter().copied()) {
            bytes.extend_from_slice(&(part.len() as u64).to_le_bytes());
            bytes.extend_from_slice(part);
        }
        if keep(&self.path, bytes).is_ok()
            && let Some(folder) = self.path.parent()
        {
            prune(folder, most);
        }
    }
}

/// Identification of a build of a program or library: size and time of its file.
pub fn build(file: &Path) -> Option<String> {
    let about = std::fs::metadata(file).ok()?;
    let built = about.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    Some(format!("{} {}", about.len(), built.as_nanos()))
}
