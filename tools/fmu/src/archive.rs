// SPDX-License-Identifier: MIT OR Apache-2.0
//! The file of an FMU: a zip archive of description, resources and libraries. Equal programs give equal bytes.

use crate::description::{self, Fmi};
use crate::model::{Model, SETTINGS, SIMULATION};
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Platform of a shared library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Platform {
    /// Linux on x86-64.
    Linux,
    /// Windows on x86-64.
    Windows,
}

impl Platform {
    /// Platform of a shared library, by its first bytes; `None` for all that is no such library.
    fn of(library: &[u8]) -> Option<Platform> {
        let has = |at: usize, bytes: &[u8]| library.get(at..).is_some_and(|rest| rest.starts_with(bytes));
        // ELF of 64 bits, little-endian; a shared object (3) for x86-64 (62).
        if has(0, b"\x7fELF\x02\x01") && has(16, &[3, 0, 62, 0]) {
            return Some(Platform::Linux);
        }
        // Header of DOS, which says where that of PE is: machine x86-64 (0x8664), and among its characteristics DLL (0x2000).
        let header = library.get(0x3c..0x40).filter(|_| has(0, b"MZ"))?;
        let header = u32::from_le_bytes([header[0], header[1], header[2], header[3]]) as usize;
        let is_dll = library.get(header.checked_add(23)?).is_some_and(|flags| flags & 0x20 != 0);
        (has(header, b"PE\0\0\x64\x86") && is_dll).then_some(Platform::Windows)
    }

    /// Folder of the library in an FMU, and end of its name.
    fn place(self, fmi: Fmi) -> (&'static str, &'static str) {
        match (self, fmi) {
            (Platform::Linux, Fmi::Two) => ("linux64", "so"),
            (Platform::Linux, Fmi::Three) => ("x86_64-linux", "so"),
            (Platform::Windows, Fmi::Two) => ("win64", "dll"),
            (Platform::Windows, Fmi::Three) => ("x86_64-windows", "dll"),
        }
    }

    /// Name of the platform.
    pub fn name(self) -> &'static str {
        match self {
            Platform::Linux => "Linux",
            Platform::Windows => "Windows",
        }
    }
}

/// Reason why an FMU cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The library is for another platform, or no library.
    #[error("no shared library for Linux or Windows on x86-64")]
    Platform,
    /// The library is another one.
    #[error("not Takt's library: it does not export {0}")]
    Foreign(&'static str),
    /// Two libraries are for one platform.
    #[error("two libraries are for {}, and an FMU holds one for each platform", .0.name())]
    Twice(Platform),
    /// No library is there.
    #[error("an FMU needs a library")]
    Missing,
    /// The archive cannot be made.
    #[error("the archive cannot be made: {0}")]
    Zip(#[from] zip::result::ZipError),
    /// The archive cannot be made.
    #[error("the archive cannot be made: {0}")]
    Write(#[from] std::io::Error),
}

/// Shared library of this crate.
#[derive(Clone, Debug)]
pub struct Library {
    platform: Platform,
    bytes: Vec<u8>,
}

impl Library {
    /// Library of its file's bytes.
    ///
    /// # Errors
    /// If they are no library, or another one.
    pub fn new(bytes: Vec<u8>) -> Result<Library, ArchiveError> {
        let platform = Platform::of(&bytes).ok_or(ArchiveError::Platform)?;
        let exports = |name: &str| bytes.windows(name.len()).any(|text| text == name.as_bytes());
        let missing = ["fmi2DoStep", "fmi3DoStep", SETTINGS].into_iter().find(|name| !exports(name));
        missing.map_or(Ok(()), |name| Err(ArchiveError::Foreign(name)))?;
        Ok(Library { platform, bytes })
    }

    /// Platform of the library.
    pub fn platform(&self) -> Platform {
        self.platform
    }
}

/// Contents of an FMU.
#[derive(Clone, Copy, Debug)]
pub struct Fmu<'a> {
    /// Program or system, and settings.
    pub model: &'a Model,
    /// Name that a master shows.
    pub name: &'a str,
    /// Version of the standard.
    pub fmi: Fmi,
    /// Libraries, one for each platform on which the FMU runs.
    pub libraries: &'a [Library],
}

/// A name as an identifier of C, as the standards demand of a library's name.
fn identifier(name: &str) -> String {
    let mut identifier: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if !identifier.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        identifier.insert(0, '_');
    }
    identifier
}

impl Fmu<'_> {
    /// Bytes of the file.
    ///
    /// # Errors
    /// If there is no library, or two are for one platform.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ArchiveError> {
        if self.libraries.is_empty() {
            return Err(ArchiveError::Missing);
        }
        let identifier = identifier(self.name);
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let mut add = |path: &str, bytes: &[u8], mode: u32| -> Result<(), ArchiveError> {
            // Without a feature for time, the time of each file is that of the format's first day.
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Deflated)
                .unix_permissions(mode);
            zip.start_file(path, options)?;
            Ok(zip.write_all(bytes)?)
        };
        let description = description::write(self.model, self.name, &identifier, self.fmi);
        add("modelDescription.xml", description.as_bytes(), 0o644)?;
        for (name, bytes) in &self.model.files {
            let mode = if name == SIMULATION { 0o755 } else { 0o644 };
            add(&format!("resources/{name}"), bytes, mode)?;
        }
        for platform in [Platform::Linux, Platform::Windows] {
            let mut libraries = self.libraries.iter().filter(|library| library.platform == platform);
            let Some(library) = libraries.next() else { continue };
            if libraries.next().is_some() {
                return Err(ArchiveError::Twice(platform));
            }
            let (folder, end) = platform.place(self.fmi);
            add(&format!("binaries/{folder}/{identifier}.{end}"), &library.bytes, 0o755)?;
        }
        Ok(zip.finish()?.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::identifier;

    #[test]
    fn names_become_identifiers() {
        let names = [("pi", "pi"), ("my law-2", "my_law_2"), ("2x", "_2x"), ("", "_"), ("größe", "gr__e")];
        for (name, expected) in names {
            assert_eq!(identifier(name), expected);
        }
    }
}
