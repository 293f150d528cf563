// SPDX-License-Identifier: MIT OR Apache-2.0
//! The file of an FMU, unpacked into a temporary folder that lives as long as the FMU.

use crate::FmuError;
use crate::description::{Causality, Description, Version};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use takt_programs::plants::Interface;
use zip::ZipArchive;

/// Bytes of all unpacked files, at most.
const BYTES: u64 = 1 << 30;
/// Bytes of the description, at most.
const DESCRIPTION_BYTES: u64 = 64 << 20;
/// Files, at most.
const FILES: usize = 100_000;

/// Name of the description.
pub(crate) const DESCRIPTION: &str = "modelDescription.xml";

/// Folder of the libraries for this platform, and their extension; `None` if the standard has no name for it.
fn platform(version: Version) -> Option<(&'static str, &'static str)> {
    match (version, std::env::consts::OS, std::env::consts::ARCH) {
        (Version::Two, "linux", "x86_64") => Some(("linux64", "so")),
        (Version::Three, "linux", "x86_64") => Some(("x86_64-linux", "so")),
        (Version::Three, "linux", "aarch64") => Some(("aarch64-linux", "so")),
        (Version::Two, "macos", "x86_64") => Some(("darwin64", "dylib")),
        (Version::Three, "macos", "x86_64") => Some(("x86_64-darwin", "dylib")),
        (Version::Three, "macos", "aarch64") => Some(("aarch64-darwin", "dylib")),
        _ => None,
    }
}

/// Path of the library within an FMU.
pub(crate) fn library(description: &Description) -> Option<PathBuf> {
    let (folder, extension) = platform(description.version)?;
    Some(Path::new("binaries").join(folder).join(format!("{}.{extension}", description.identifier)))
}

/// Unpacked FMU; its folder is removed at the end.
#[derive(Debug)]
pub struct Fmu {
    /// Path of the file, for messages.
    pub name: String,
    /// What the FMU is.
    pub description: Description,
    pub(crate) folder: PathBuf,
}

impl Drop for Fmu {
    fn drop(&mut self) {
        // A folder that stays is harmless.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Fmu {
    /// Reads and unpacks a file.
    ///
    /// # Errors
    /// If it is no FMU that can run here.
    pub fn open(path: &Path) -> Result<Fmu, FmuError> {
        let name = path.display().to_string();
        let wrong = |text: String| FmuError::File { name: name.clone(), text };
        let file = File::open(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
        let mut archive = ZipArchive::new(file)
            .map_err(|error| wrong(format!("it is no FMU, which is a zip archive: {error}")))?;
        let description = description(&mut archive).map_err(wrong)?;
        let library = check_platform(&archive, &description).map_err(wrong)?;
        let folder = temporary().map_err(|error| wrong(format!("cannot be unpacked: {error}")))?;
        // From here on, the folder is removed whatever happens.
        let fmu = Fmu { name: name.clone(), description, folder };
        unpack(&mut archive, &library, &fmu.folder).map_err(wrong)?;
        Ok(fmu)
    }

    /// Signals of the FMU as a plant; its outputs are also its states.
    pub fn interface(&self) -> Interface {
        let names = |causality| self.description.of(causality).map(|(_, variable)| variable.name.clone());
        Interface {
            name: self.description.name.clone(),
            inputs: names(Causality::Input).map(|name| (name, false)).collect(),
            sensors: names(Causality::Output).collect(),
            states: names(Causality::Output).collect(),
        }
    }
}

fn description(archive: &mut ZipArchive<File>) -> Result<Description, String> {
    let file = archive.by_name(DESCRIPTION);
    let file = file.map_err(|error| format!("it is no FMU: it has no {DESCRIPTION} ({error})"))?;
    let mut text = String::new();
    file.take(DESCRIPTION_BYTES + 1)
        .read_to_string(&mut text)
        .map_err(|error| format!("{DESCRIPTION} cannot be read: {error}"))?;
    if text.len() as u64 > DESCRIPTION_BYTES {
        return Err(format!("{DESCRIPTION} is larger than {} MiB", DESCRIPTION_BYTES >> 20));
    }
    Description::read(&text)
}

/// Path of the library for this platform.
fn check_platform(archive: &ZipArchive<File>, description: &Description) -> Result<PathBuf, String> {
    let here = format!("{} on {}", std::env::consts::OS, std::env::consts::ARCH);
    let library = library(description).ok_or_else(|| format!("FMUs of its version cannot run on {here}"))?;
    // A name that is no text is that of no library.
    let names: Vec<String> = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned())).collect();
    if names.iter().any(|name| Path::new(name) == library) {
        return Ok(library);
    }
    let platforms = names.iter().filter_map(|name| name.strip_prefix("binaries/")?.split_once('/'));
    let mut platforms: Vec<&str> =
        platforms.filter(|(_, file)| !file.is_empty()).map(|(platform, _)| platform).collect();
    platforms.sort_unstable();
    platforms.dedup();
    let found = if platforms.is_empty() {
        "no library at all".to_owned()
    } else {
        format!("libraries for {}", platforms.join(", "))
    };
    Err(format!("it cannot run on {here}: it has {found}, and no {}", library.display()))
}

/// A new folder that nobody else uses.
fn temporary() -> io::Result<PathBuf> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("takt-fmu-{}-{number}", std::process::id()));
    // `create_dir` fails if somebody else made it.
    fs::create_dir(&folder)?;
    Ok(folder)
}

/// Unpacks description, resources, and what lies beside the library.
fn unpack(archive: &mut ZipArchive<File>, library: &Path, folder: &Path) -> Result<(), String> {
    if archive.len() > FILES {
        return Err(format!("it has more than {FILES} files"));
    }
    let binaries = library.parent().unwrap_or(library);
    let mut left = BYTES;
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).map_err(|error| format!("it is damaged: {error}"))?;
        // Without `..` and roots.
        let Some(path) = file.enclosed_name() else {
            let name = file.name().map(|name| name.into_owned()).unwrap_or_default();
            return Err(format!("it has a file outside of its folder: {name}"));
        };
        let is_wanted =
            path == Path::new(DESCRIPTION) || path.starts_with("resources") || path.starts_with(binaries);
        if !is_wanted || file.is_dir() {
            continue;
        }
        let target = folder.join(&path);
        let written = fs::create_dir_all(target.parent().unwrap_or(folder))
            .and_then(|()| File::create(&target))
            .and_then(|mut out| io::copy(&mut (&mut file).take(left + 1), &mut out));
        let written = written.map_err(|error| format!("cannot unpack {}: {error}", path.display()))?;
        left = left
            .checked_sub(written)
            .ok_or_else(|| format!("it unpacks to more than {} MiB", BYTES >> 20))?;
    }
    // Some libraries expect the folder.
    fs::create_dir_all(folder.join("resources")).map_err(|error| format!("cannot be unpacked: {error}"))
}
