// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cache of assembled programs: scheduling several hundred operations takes seconds, and the result depends only on sources, options and
//! this binary.
//!
//! An entry contains the image and the data that images lack. If the cache cannot be used, the program is assembled silently.

use crate::run::loaded_program::LoadedProgram;
use crate::run::spills::spilled;
use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use takt_asm::diag::Diagnostics;
use takt_asm::names::DebugInfo;
use takt_asm::schedule::BlockReport;
use takt_asm::{AssembledProgram, FileLoader, LoadError, Loader, Options, image};
use takt_cache::CacheLocation;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Machine};

/// Minimum assembly time for a program to be cached.
const SLOW: Duration = Duration::from_millis(100);
/// Maximum number of cached programs; the newest are kept.
const MOST: usize = 400;

/// A program with, for each scheduled block, its first bundle and the cycles above the lower bound.
pub(crate) struct CacheEntry {
    pub(crate) loaded: LoadedProgram,
    pub(crate) spare: Vec<(BundleAddress, Cycle)>,
}

impl CacheEntry {
    fn of(assembled: AssembledProgram) -> CacheEntry {
        let above = |block: &BlockReport| Cycle::from(block.cycles.saturating_sub(block.bound.cycles()));
        let spare = assembled.blocks.iter().map(|block| (block.address, above(block))).collect();
        CacheEntry { loaded: assembled.into(), spare }
    }
}

/// First source, in memory, with a loader for the project's other files.
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

/// Assembles the program that starts with the source at `path`, or loads it from the cache. Warnings go to `warn`.
pub(crate) fn assembled(
    path: &str,
    loader: &dyn Loader,
    options: &Options,
    warn: impl FnOnce(&Diagnostics),
) -> Result<CacheEntry, Diagnostics> {
    // Reading and checking takes milliseconds, and determines which files belong to the program.
    let checked = takt_asm::check(path, loader, options);
    let key = SELF.as_ref().map(|build| checked.key(build, options));
    let place = key.and_then(|key| CacheLocation::of("programs", key));
    if let Some(place) = &place
        && checked.diagnostics().is_empty()
        && let Some(kept) = read(place, checked.machine())
    {
        return Ok(kept);
    }
    let begin = Instant::now();
    let assembled = checked.finish()?;
    let is_slow = begin.elapsed() >= SLOW;
    warn(&assembled.warnings);
    let (is_quiet, debug) = (assembled.warnings.is_empty(), assembled.debug_info());
    let spilled = spilled(&assembled);
    let kept = CacheEntry::of(assembled);
    if let Some(place) = place
        && is_slow
        && is_quiet
    {
        write(&place, &kept, &debug, &spilled);
    }
    Ok(kept)
}

/// Identification of this binary: another build may assemble differently.
pub(crate) static SELF: LazyLock<Option<String>> = LazyLock::new(|| {
    let build = takt_cache::build(&std::env::current_exe().ok()?)?;
    Some(format!("{} {build}", env!("CARGO_PKG_VERSION")))
});

fn read(place: &CacheLocation, machine: &'static Machine) -> Option<CacheEntry> {
    let parts = place.read()?;
    let [known, image] = &parts[..] else { return None };
    let (spilled, spare): (Vec<String>, Vec<(u32, Cycle)>) = serde_json::from_slice(known).ok()?;
    let (mut program, debug) = image::read_with(image).ok()?;
    // An image stores only its machine's name, and a variant with a faster unit, used in analyses, has the name of its original.
    if machine.name == program.machine.name {
        program.machine = machine;
    }
    let DebugInfo { sources, constants, names } = debug?;
    let spare = spare.into_iter().map(|(address, above)| (BundleAddress::new(address), above)).collect();
    let loaded = LoadedProgram { program, constants, sources, folder: PathBuf::new(), names, spilled };
    Some(CacheEntry { loaded, spare })
}

fn write(place: &CacheLocation, kept: &CacheEntry, debug: &DebugInfo, spilled: &[String]) {
    let spare: Vec<(u32, Cycle)> =
        kept.spare.iter().map(|(address, above)| (address.get(), *above)).collect();
    let Ok(known) = serde_json::to_vec(&(spilled, spare)) else { return };
    let Ok(image) = image::write_with(&kept.loaded.program, Some(debug)) else { return };
    place.keep(&[&known, &image], MOST);
}
