// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C preprocessor: gcc's, or another that takes its options, with headers of our own for C's library.

use super::Source;
use crate::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Headers of the supported part of C's library: name and text.
pub const HEADERS: &[(&str, &str)] = &[
    ("float.h", include_str!("headers/float.h")),
    ("limits.h", include_str!("headers/limits.h")),
    ("math.h", include_str!("headers/math.h")),
    ("stdbool.h", include_str!("headers/stdbool.h")),
    ("stddef.h", include_str!("headers/stddef.h")),
    ("stdint.h", include_str!("headers/stdint.h")),
    ("stdlib.h", include_str!("headers/stdlib.h")),
    ("string.h", include_str!("headers/string.h")),
];

/// Programs that are tried, in order.
const PROGRAMS: [&str; 3] = ["gcc", "cpp", "clang"];

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
        static COUNT: std::sync::atomic::AtomicUsize = std::sync::atomic::AtomicUsize::new(0);
        let count = COUNT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("takt-cc-{}-{count}", std::process::id()));
        let written = std::fs::create_dir_all(&folder).and_then(|()| {
            HEADERS.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))
        });
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
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => continue,
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
                "{text}\nheaders of C's library are {}; give folders of others with -I",
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
