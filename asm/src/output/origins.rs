// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lines that a translator wrote, with the lines that they come from: `takt cc` writes the place in C beside the first line of each
//! statement, as a comment `; speed.c:43: …`.

use takt_diagnostics::source::Sources;
use takt_isa::Program;
use takt_isa::program::Location;

/// Words in the first line of a source by `takt cc`.
const TRANSLATED: &str = ", by takt cc: ";

/// The places that the comments of a program's sources name, with the lines up to the next such comment.
pub(crate) fn add(sources: &Sources, program: &mut Program) {
    let translated = sources.files().iter().filter(|file| {
        file.text.starts_with(';') && file.text.lines().next().is_some_and(|line| line.contains(TRANSLATED))
    });
    for source in translated {
        let Some(file) = program.files.iter().position(|name| **name == *source.name) else { continue };
        let mut from = None;
        for (line, number) in source.text.lines().zip(1..) {
            let code = line.trim_start();
            let comment = line.split_once(';').and_then(|(_, comment)| place(comment.trim_start()));
            if let Some((name, line)) = comment {
                let known = program.files.iter().position(|known| known == name);
                let file = known.unwrap_or_else(|| {
                    program.files.push(name.to_owned());
                    program.files.len() - 1
                });
                from = Some(Location { file: file as u32, line });
            } else if code.is_empty() || code.starts_with(';') {
                from = None;
            }
            if let Some(from) = from.filter(|_| !code.starts_with("wait ")) {
                program.origins.push((Location { file: file as u32, line: number }, from));
            }
        }
    }
    program.origins.sort_unstable();
}

/// Name and line at the beginning of a comment.
fn place(comment: &str) -> Option<(&str, u32)> {
    let (name, rest) = comment.split_once(':')?;
    let (line, _) = rest.split_once(':')?;
    let is_name = !name.is_empty() && !name.contains(char::is_whitespace);
    line.parse().ok().filter(|line| *line > 0 && is_name).map(|line| (name, line))
}
