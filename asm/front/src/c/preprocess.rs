// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C preprocessor: gcc's, or another that takes its options, with headers of our own for C's library.

use super::Source;
use crate::Error;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Headers of the supported part of C's library: name and text.
pub const HEADERS: &[(&str, &str)] = &[
    ("assert.h", include_str!("headers/assert.h")),
    ("float.h", include_str!("headers/float.h")),
    ("inttypes.h", include_str!("headers/inttypes.h")),
    ("limits.h", include_str!("headers/limits.h")),
    ("math.h", include_str!("headers/math.h")),
    ("stdarg.h", include_str!("headers/stdarg.h")),
    ("stdbool.h", include_str!("headers/stdbool.h")),
    ("stddef.h", include_str!("headers/stddef.h")),
    ("stdint.h", include_str!("headers/stdint.h")),
    ("stdio.h", include_str!("headers/stdio.h")),
    ("stdlib.h", include_str!("headers/stdlib.h")),
    ("string.h", include_str!("headers/string.h")),
];

/// Maximum number of names tried for a folder in a process.
const FOLDERS: usize = 10_000;

/// Programs that are tried, in order.
const PROGRAMS: [&str; 3] = ["gcc", "cpp", "clang"];

/// Makes a new folder for temporary files. A folder that another user made under the same name is not used.
fn own_folder() -> std::io::Result<PathBuf> {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    loop {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("takt-cc-{}-{count}", std::process::id()));
        match std::fs::create_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists && count < FOLDERS => {}
            made => return made.map(|()| folder),
        }
    }
}

/// A call of the preprocessor, with the headers in a folder of the same lifetime.
pub struct Preprocessor {
    folder: PathBuf,
    options: Vec<String>,
}

impl Preprocessor {
    /// Writes the headers; `options` are `-D…`, `-U…` and `-I…`.
    ///
    /// # Errors
    /// If no folder for temporary files can be written.
    pub fn new(options: &[String]) -> Result<Preprocessor, Error> {
        let folder = own_folder().map_err(|error| {
            Error::plain(format!("{}: no folder can be made: {error}", std::env::temp_dir().display()))
        })?;
        let written = HEADERS.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text));
        match written {
            Ok(()) => Ok(Preprocessor { folder, options: options.to_vec() }),
            Err(error) => {
                Err(Error::plain(format!("{}: headers cannot be written: {error}", folder.display())))
            }
        }
    }

    /// Preprocesses a file.
    ///
    /// # Errors
    /// If no preprocessor is found or it fails, with its messages.
    pub fn run(&self, file: &Path) -> Result<Source, Error> {
        let name = file.display().to_string();
        let wrong = match std::fs::metadata(file) {
            Ok(of) if of.is_dir() => Some("this is a folder, not a C file".to_owned()),
            Ok(_) => None,
            Err(error) => Some(error.to_string()),
        };
        if let Some(text) = wrong {
            return Err(Error { file: Some(name), line: None, text, place: None });
        }
        for program in PROGRAMS {
            let mut command = Command::new(program);
            if program != "cpp" {
                command.arg("-E");
            }
            command.args(["-std=c99", "-nostdinc", "-undef", "-D__TAKT__=1"]);
            if program == "clang" {
                // `-undef` removes the standard's own macros, too; gcc warns of another definition.
                command.args(["-D__STDC__=1", "-D__STDC_VERSION__=199901L"]);
            }
            command.args(&self.options).arg("-isystem").arg(&self.folder).arg(file);
            let done = match command.output() {
                Ok(done) => done,
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                Err(error) => return Err(Error::plain(format!("{program}: {error}"))),
            };
            let text = String::from_utf8_lossy(&done.stdout).into_owned();
            if done.status.success() {
                return Ok(Source { name, text });
            }
            let messages = String::from_utf8_lossy(&done.stderr);
            return Err(Error::plain(self.explained(messages.trim())));
        }
        Err(Error::plain(format!(
            "no C preprocessor found: install gcc or clang (Debian, Ubuntu: `apt install gcc`); looked for {}",
            PROGRAMS.join(", ")
        )))
    }

    /// The preprocessor's messages; if a header is missing, with a list of the available ones.
    fn explained(&self, messages: &str) -> String {
        let folder = self.folder.display().to_string();
        let text = messages.replace(&folder, "takt");
        if text.contains("No such file") || text.contains("file not found") {
            let names: Vec<&str> = HEADERS.iter().map(|(name, _)| *name).collect();
            return format!(
                "{text}\nheaders of C's library are {}; give folders of others with -I; for a header of which nothing is needed, an empty file does",
                names.join(", ")
            );
        }
        text
    }
}

impl Drop for Preprocessor {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

#[cfg(test)]
mod tests {
    use super::own_folder;

    #[test]
    fn a_folder_that_exists_is_not_used() {
        let first = own_folder().expect("a folder");
        let name = first.display().to_string();
        let (front, count) = name.rsplit_once('-').expect("a number");
        let next = format!("{front}-{}", count.parse::<usize>().expect("a number") + 1);
        // Another test's call may have made it.
        let planted = std::fs::create_dir(&next).is_ok();
        let second = own_folder().expect("a folder");
        assert!(second.display().to_string() != next && second != first);
        if planted {
            std::fs::remove_dir(next).expect("it was there");
        }
        for folder in [first, second] {
            std::fs::remove_dir(folder).expect("it was there");
        }
    }
}
