// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembled programs, kept in the user's cache folder: the scheduler's search takes seconds for a program of some hundred operations, and
//! its result depends on nothing but sources, options and this program.
//!
//! A file holds its key (all of these), what is known beyond an image, and the image. The key is compared whole, so that a file that
//! belongs to something else, or is damaged, is no hit. What cannot be read or written is assembled, without a word.

use crate::files;
use crate::load::Loaded;
use crate::spills::spilled;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::{Duration, Instant, SystemTime};
use takt_asm::diag::Diagnostics;
use takt_asm::names::DebugInfo;
use takt_asm::schedule::BlockReport;
use takt_asm::{Assembled, Checked, FileLoader, LoadError, Loader, Options, image};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Machine};

/// What is assembled faster than this is not kept.
const SLOW: Duration = Duration::from_millis(100);
/// Files that are kept, the newest.
const MOST: usize = 400;

/// A program, and for each block that was scheduled its first bundle and its cycles above the lower bound.
pub(crate) struct Kept {
    pub(crate) loaded: Loaded,
    pub(crate) spare: Vec<(BundleAddress, Cycle)>,
}

impl Kept {
    fn of(assembled: Assembled) -> Kept {
        let above = |block: &BlockReport| Cycle::from(block.cycles.saturating_sub(block.bound.cycles()));
        let spare = assembled.blocks.iter().map(|block| (block.address, above(block))).collect();
        Kept { loaded: assembled.into(), spare }
    }
}

/// A source in memory, and a project's folder with the others.
pub(crate) struct First {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    pub(crate) others: FileLoader,
}

impl Loader for First {
    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError> {
        if path == self.name { Ok(self.bytes.clone()) } else { self.others.load(path) }
    }
}

/// Assembles the program that begins with the source at `path`, or finds it among those kept. Warnings go to `warn`.
pub(crate) fn assembled(
    path: &str,
    loader: &dyn Loader,
    options: &Options,
    warn: impl FnOnce(&Diagnostics),
) -> Result<Kept, Diagnostics> {
    // Reading and checking takes milliseconds, and says what the program consists of.
    let checked = takt_asm::check(path, loader, options);
    let file = key(&checked, options).map(|key| (place(&key), key));
    if let Some((place, key)) = &file
        && checked.diagnostics().is_empty()
        && let Some(kept) = read(place, key, checked.machine())
    {
        return Ok(kept);
    }
    let begin = Instant::now();
    let assembled = checked.finish()?;
    let is_slow = begin.elapsed() >= SLOW;
    warn(&assembled.warnings);
    let (is_quiet, debug) = (assembled.warnings.is_empty(), assembled.debug_info());
    let spilled = spilled(&assembled);
    let kept = Kept::of(assembled);
    if let Some((place, key)) = file
        && is_slow
        && is_quiet
    {
        write(&place, &key, &kept, &debug, &spilled);
    }
    Ok(kept)
}

/// This program: another build may assemble otherwise.
pub(crate) static SELF: LazyLock<Option<String>> = LazyLock::new(|| {
    let about = std::fs::metadata(std::env::current_exe().ok()?).ok()?;
    let built = about.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    Some(format!("{} {} {}", env!("CARGO_PKG_VERSION"), about.len(), built.as_nanos()))
});

/// All that a program depends on.
fn key(checked: &Checked, options: &Options) -> Option<Vec<u8>> {
    let mut key = format!("{}\n{options:?}\n{:?}\n", SELF.as_ref()?, checked.machine()).into_bytes();
    for source in checked.sources().files() {
        key.extend_from_slice(format!("{} {}\n", source.name, source.text.len()).as_bytes());
        key.extend_from_slice(source.text.as_bytes());
    }
    Some(key)
}

fn place(key: &[u8]) -> PathBuf {
    let mut hasher = DefaultHasher::new();
    key.hash(&mut hasher);
    folder().join(format!("{:016x}", hasher.finish()))
}

fn folder() -> PathBuf {
    takt_rtl::verilator::cache_folder().join("programs")
}

/// A part of a file: its length, then its bytes.
fn part<'a>(bytes: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let (part, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    *bytes = rest;
    Some(part)
}

fn read(place: &Path, key: &[u8], machine: &'static Machine) -> Option<Kept> {
    let bytes = std::fs::read(place).ok()?;
    let mut rest = bytes.as_slice();
    if part(&mut rest)? != key {
        return None;
    }
    let (spilled, spare): (Vec<String>, Vec<(u32, Cycle)>) = serde_json::from_slice(part(&mut rest)?).ok()?;
    let (mut program, debug) = image::read_with(part(&mut rest)?).ok()?;
    // An image names its machine; one of an analysis, with a faster unit, has the name of the machine that it was made of.
    if machine.name == program.machine.name {
        program.machine = machine;
    }
    let DebugInfo { sources, constants, names } = debug?;
    let spare = spare.into_iter().map(|(address, above)| (BundleAddress::new(address), above)).collect();
    Some(Kept { loaded: Loaded { program, constants, sources, names, spilled }, spare })
}

/// Keeps a program. If that fails, the next run assembles again.
fn write(place: &Path, key: &[u8], kept: &Kept, debug: &DebugInfo, spilled: &[String]) {
    let spare: Vec<(u32, Cycle)> =
        kept.spare.iter().map(|(address, above)| (address.get(), *above)).collect();
    let Ok(known) = serde_json::to_vec(&(spilled, spare)) else { return };
    let Ok(image) = image::write_with(&kept.loaded.program, Some(debug)) else { return };
    let mut bytes = Vec::with_capacity(key.len() + known.len() + image.len() + 24);
    for part in [key, &known, &image] {
        bytes.extend_from_slice(&(part.len() as u64).to_le_bytes());
        bytes.extend_from_slice(part);
    }
    if std::fs::create_dir_all(folder()).is_ok() && files::write(place, &bytes).is_ok() {
        prune();
    }
}

/// Removes the oldest files where there are too many.
fn prune() {
    let entries = std::fs::read_dir(folder()).into_iter().flatten().flatten();
    let mut kept: Vec<(SystemTime, PathBuf)> =
        entries.filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()))).collect();
    kept.sort();
    for (_, path) in kept.iter().take(kept.len().saturating_sub(MOST)) {
        let _ = std::fs::remove_file(path);
    }
}
