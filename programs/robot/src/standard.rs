// SPDX-License-Identifier: MIT OR Apache-2.0
//! The programs of the standard controller, assembled ahead of time: the assembler's search takes ten seconds for them.
//!
//! `standard/*.takt` are their images, `standard/sources.txt` has the checksum of each source that they were made from. An image
//! whose sources have changed since is not used: the program is assembled. A test keeps the images up to date.

use std::fmt::Write as _;
use takt_asm::diag::Diagnostics;
use takt_asm::{Assembled, MemoryLoader, Options, Search, assemble, image};
use takt_isa::{Machine, Program, T3};

/// The images, by the names of their programs.
const IMAGES: [(&str, &[u8]); 3] = [
    ("communication.s", include_bytes!("standard/communication.takt")),
    ("dynamic.s", include_bytes!("standard/dynamic.takt")),
    ("kinematic.s", include_bytes!("standard/kinematic.takt")),
];

/// For each program a line: its name, its machine, then the name and the checksum of each source that it was made from.
const SOURCES: &str = include_str!("standard/sources.txt");

/// Assembles a program of the controller, for a machine or the default one.
fn assembled(name: &str, machine: Option<&'static Machine>) -> Result<Assembled, Diagnostics> {
    let loader = Search::new(MemoryLoader::new(takt_programs::THREE)).library(takt_programs::LIBRARY);
    assemble(name, &loader, &Options { machine: machine.unwrap_or(&T3), ..Options::default() })
}

/// The program in an image, if the image was made for that machine from the sources as they are now.
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

/// A source's text, by the name that diagnostics have for it.
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

/// A program of the controller.
///
/// # Errors
/// If it has to be assembled and is wrong, in words.
pub(crate) fn program(name: &str, machine: Option<&'static Machine>) -> Result<Program, String> {
    match ready(name, machine) {
        Some(program) => Ok(program),
        None => assembled(name, machine)
            .map(|assembled| assembled.program)
            .map_err(|mistakes| mistakes.render(false)),
    }
}

/// The contents that the files of the folder `standard` should have, by their names; takes as long as assembling does.
///
/// # Errors
/// If a program is wrong, or does not fit an image, in words.
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

    /// Without this, every start of the robot assembles.
    #[test]
    fn images_are_ready() {
        let t1 = takt_isa::MACHINES.iter().copied().find(|machine| machine.name == "t1");
        assert!(t1.is_some());
        for (name, machine) in [("communication.s", t1), ("dynamic.s", t1), ("kinematic.s", Some(&T3))] {
            let program = ready(name, machine).unwrap_or_else(|| panic!("{name}: its image is stale"));
            assert_eq!(Some(program.machine), machine, "{name}");
        }
        // One for another machine is not taken, nor one for a program of another name.
        assert!(ready("kinematic.s", t1).is_none() && ready("packets.s", t1).is_none());
    }
}
