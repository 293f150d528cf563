// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images of the standard controller's programs, assembled ahead of time: the assembler's search takes ten seconds for them.
//!
//! `standard/*.takt` are the images, `standard/sources.txt` has the checksums of their sources. An image whose sources have changed is not
//! used: the program is assembled instead. A test keeps the images up to date.

use std::fmt::Write as _;
use takt_asm::diag::Diagnostics;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Search, assemble, image};
use takt_isa::{Machine, Program, T3};

/// Images by the names of their programs.
const IMAGES: [(&str, &[u8]); 3] = [
    ("communication.s", include_bytes!("standard/communication.takt")),
    ("dynamic.s", include_bytes!("standard/dynamic.takt")),
    ("kinematic.s", include_bytes!("standard/kinematic.takt")),
];

/// Line per program: its name, its machine, then the name and the checksum of each source.
const SOURCES: &str = include_str!("standard/sources.txt");

/// Assembles a program of the controller, for a machine or the default one.
fn assembled(name: &str, machine: Option<&'static Machine>) -> Result<AssembledProgram, Diagnostics> {
    let loader = Search::new(MemoryLoader::new(takt_programs::THREE)).library(takt_programs::LIBRARY);
    assemble(name, &loader, &Options { machine: machine.unwrap_or(&T3), ..Options::default() })
}

/// Program of an image, if the image was made for that machine from the present sources.
fn ready(name: &str, machine: Option<&'static Machine>) -> Option<Program> {
    let mut words =
        SOURCES.lines().map(str::split_whitespace).find(|line| line.clone().next() == Some(name))?.skip(1);
    let of = words.next()?;
    let words: Vec<&str> = words.collect();
    let fresh = |pair: &[&str]| {
        let [source, checksum] = pair else { return false };
        text(source).is_some_and(|text| checksum_of(text) == *checksum)
    };
    if words.is_empty() || !words.chunks(2).all(fresh) || machine.unwrap_or(&T3).name != of {
        return None;
    }
    let (_, bytes) = IMAGES.iter().find(|(known, _)| *known == name)?;
    image::read(bytes).ok()
}

/// Text of a source, by its name in diagnostics.
fn text(name: &str) -> Option<&'static str> {
    let (sources, name) = match name.strip_prefix('<').and_then(|name| name.strip_suffix('>')) {
        Some(name) => (takt_programs::LIBRARY, name),
        None => (takt_programs::THREE, name),
    };
    sources.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

fn checksum_of(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

/// Program of the controller, from its image or assembled.
///
/// # Errors
/// If the program must be assembled and is wrong; the text renders the mistakes.
pub(crate) fn program(name: &str, machine: Option<&'static Machine>) -> Result<Program, String> {
    match ready(name, machine) {
        Some(program) => Ok(program),
        None => assembled(name, machine)
            .map(|assembled| assembled.program)
            .map_err(|mistakes| mistakes.render(false)),
    }
}

/// Expected contents of the files in the folder `standard`, by their names; takes as long as assembling.
///
/// # Errors
/// If a program is wrong, or does not fit an image; the text says why.
pub fn files() -> Result<Vec<(String, Vec<u8>)>, String> {
    let machine = |name: &str| if name == "kinematic.s" { "t3" } else { "t1" };
    let (mut files, mut sources) = (Vec::new(), String::new());
    for (name, _) in IMAGES {
        let wanted = machine(name);
        let machine = takt_isa::MACHINES.iter().copied().find(|machine| machine.name == wanted);
        let assembled = assembled(name, machine).map_err(|mistakes| mistakes.render(false))?;
        let bytes = image::write(&assembled.program).map_err(|error| error.to_string())?;
        files.push((name.replace(".s", ".takt"), bytes));
        let _ = write!(sources, "{name} {wanted}");
        for source in assembled.sources.files() {
            let _ = write!(sources, " {} {}", source.name, checksum_of(&source.text));
        }
        sources.push('\n');
    }
    files.push(("sources.txt".to_owned(), sources.into_bytes()));
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up-to-date images: without them, every start of the robot assembles.
    #[test]
    fn images_are_ready() {
        let t1 = takt_isa::MACHINES.iter().copied().find(|machine| machine.name == "t1");
        assert!(t1.is_some());
        for (name, machine) in [("communication.s", t1), ("dynamic.s", t1), ("kinematic.s", Some(&T3))] {
            let program = ready(name, machine).unwrap_or_else(|| panic!("{name}: its image is stale"));
            assert_eq!(Some(program.machine), machine, "{name}");
        }
        // Images for another machine or another program are not used.
        assert!(ready("kinematic.s", t1).is_none() && ready("packets.s", t1).is_none());
    }
}
