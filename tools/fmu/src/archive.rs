// SPDX-License-Identifier: MIT OR Apache-2.0
//! The file of an FMU: a zip archive of description, resources and library. Equal programs give equal bytes.

use crate::description::{self, Fmi};
use crate::model::{IMAGE, Model, SETTINGS};
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Reason why an FMU cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The library is for another platform, or no library.
    #[error("the library is no shared library for Linux on x86-64")]
    Platform,
    /// The library is another one.
    #[error("the library is not Takt's: it does not export {0}")]
    Foreign(&'static str),
    /// The archive cannot be made.
    #[error("the archive cannot be made: {0}")]
    Zip(#[from] zip::result::ZipError),
    /// The archive cannot be made.
    #[error("the archive cannot be made: {0}")]
    Write(#[from] std::io::Error),
}

/// Contents of an FMU.
#[derive(Clone, Copy, Debug)]
pub struct Fmu<'a> {
    /// Program and settings.
    pub model: &'a Model,
    /// Name that a master shows.
    pub name: &'a str,
    /// Version of the standard.
    pub fmi: Fmi,
    /// Bytes of the shared library of this crate.
    pub library: &'a [u8],
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
    /// If the library is another one.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ArchiveError> {
        self.check_library()?;
        let identifier = identifier(self.name);
        let folder = match self.fmi {
            Fmi::Two => "linux64",
            Fmi::Three => "x86_64-linux",
        };
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
        add(&format!("resources/{IMAGE}"), &self.model.image, 0o644)?;
        add(&format!("resources/{SETTINGS}"), self.model.settings_text.as_bytes(), 0o644)?;
        add(&format!("binaries/{folder}/{identifier}.so"), self.library, 0o755)?;
        Ok(zip.finish()?.into_inner())
    }

    fn check_library(&self) -> Result<(), ArchiveError> {
        // ELF of 64 bits, little-endian; a shared object (3) for x86-64 (62).
        let is_elf = self.library.starts_with(b"\x7fELF\x02\x01")
            && self.library.get(16..20).is_some_and(|kind| kind == [3, 0, 62, 0]);
        if !is_elf {
            return Err(ArchiveError::Platform);
        }
        let exports = |name: &str| self.library.windows(name.len()).any(|text| text == name.as_bytes());
        let missing = ["fmi2DoStep", "fmi3DoStep", SETTINGS].into_iter().find(|name| !exports(name));
        missing.map_or(Ok(()), |name| Err(ArchiveError::Foreign(name)))
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
