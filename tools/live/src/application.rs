// SPDX-License-Identifier: MIT OR Apache-2.0
//! The program on a board, and its wiring, from files that a person has chosen in a browser.

use anyhow::{Context, Result, anyhow, bail};
use std::collections::BTreeMap;
use takt_asm::names::DebugInfo;
use takt_asm::{MemoryLoader, Options, Search, image};
use takt_board::{Application, Board, Mistake, Wiring};
use takt_diagnostics::diag::Diagnostics;
use takt_isa::{Machine, Program};
use takt_system::{ProgramError, ReadError, Request};

/// Chosen files, by name.
pub(crate) struct Files(pub(crate) BTreeMap<String, Vec<u8>>);

/// A program, or a system, with its sources.
pub(crate) struct Loaded {
    pub(crate) application: Application<'static>,
    /// Source texts of each core, by file name.
    pub(crate) sources: Vec<Vec<(String, String)>>,
}

fn told(mistakes: &Diagnostics) -> anyhow::Error {
    anyhow!("{}", mistakes.render(false))
}

/// The mistakes of a file of boards or wirings as one error, a line each.
fn right<T>(result: Result<T, Vec<Mistake>>) -> Result<T> {
    let lines =
        |mistakes: Vec<Mistake>| mistakes.iter().map(Mistake::to_string).collect::<Vec<_>>().join("\n");
    result.map_err(|mistakes| anyhow!("{}", lines(mistakes)))
}

impl Files {
    fn bytes(&self, name: &str) -> Result<&[u8]> {
        let bytes = self.0.get(name).map(Vec::as_slice);
        bytes.with_context(|| format!("the file {name} is not among the chosen ones"))
    }

    fn text(&self, name: &str) -> Result<&str> {
        let bytes = self.bytes(name)?;
        std::str::from_utf8(bytes).map_err(|_| anyhow!("{name} is not text"))
    }

    /// A program, from an image or from sources, which are assembled for a machine unless they name theirs.
    fn program(&self, name: &str, machine: &'static Machine) -> Result<(Program, DebugInfo)> {
        let bytes = self.bytes(name)?;
        if image::is_image(bytes) {
            let (program, debug) =
                image::read_with(bytes).with_context(|| format!("{name} is not an image that can run"))?;
            return Ok((program, debug.unwrap_or_default()));
        }
        if let Some(why) = takt_asm::foreign(name, bytes) {
            bail!("{why}");
        }
        let mut files = MemoryLoader::default();
        for (name, bytes) in &self.0 {
            files.add(name, bytes.clone());
        }
        let loader = Search::new(files).library(takt_programs::LIBRARY);
        let options = Options { machine, ..Options::default() };
        let assembled = takt_asm::assemble(name, &loader, &options).map_err(|mistakes| told(&mistakes))?;
        let debug = assembled.debug_info();
        Ok((assembled.program, debug))
    }

    /// The application whose file has this name: a system if that ends in `.toml`, otherwise a program.
    pub(crate) fn application(&self, name: &str, machine: &'static Machine) -> Result<Loaded> {
        let mut about = Vec::new();
        let application: Application<'static> = if name.ends_with(".toml") {
            let read = takt_system::read(name, self.text(name)?, |request: &Request<'_>| {
                let loaded = self.program(request.path, request.machine.unwrap_or(machine));
                let (program, debug) = loaded.map_err(ProgramError::Invalid)?;
                about.push(debug);
                Ok(program)
            });
            let description = read.map_err(|error| match error {
                ReadError::Mistakes(mistakes) => told(&mistakes),
                ReadError::Program(error) => error,
            })?;
            Application::from(&description).into_owned()
        } else {
            let (program, debug) = self.program(name, machine)?;
            if program.bundles() == 0 {
                bail!("{name} has no instruction");
            }
            about.push(debug);
            Application::from(&program).into_owned()
        };
        let (mut sources, mut arrays) = (Vec::new(), Vec::new());
        for DebugInfo { sources: texts, names, .. } in about {
            sources.push(texts);
            arrays.push(crate::arrays(&names));
        }
        Ok(Loaded { application: application.with_arrays(arrays), sources })
    }

    /// The wiring whose file has this name, checked against the application.
    pub(crate) fn wiring(&self, name: &str, application: &Application<'static>) -> Result<Wiring> {
        let text = self.text(name)?;
        let board = right(Wiring::board(name, text))?.with_context(|| {
            let names: Vec<&str> = Board::names().collect();
            format!(
                "{name} does not name a board: begin it with a line `board = \"NAME\"`; there are {}",
                names.join(", ")
            )
        })?;
        let board = Board::from_name(&board).with_context(|| {
            format!("{name}: `{board}` is none of Takt's boards; one in a file is for `takt live PORT serve`")
        })?;
        let wiring = right(Wiring::read(name, text, &right(board)?))?;
        right(wiring.check(name, text, application.clone()))?;
        Ok(wiring)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_isa::T1;

    const DRIVE: &str = ".include \"gain.s\"\n.param kp = 2 range 0..5 ; V\n.input x\n.output u\n.period\np: u = kp*GAIN*x\n wait p\n";
    const WIRING: &str = "board = \"ulx3s-85f\"\nclock = 50\nperiod = 400\nbaud = 1000000\n[peripheral.motor]\nkind = \"pwm\"\n\
                          pins = { high = \"gp2\" }\nhalf = 100\nports = { duty = \"u\" }\nscale = { duty = 1 }\n";
    const SYSTEM: &str = "tick = 1000\n[[core]]\nname = \"a\"\nprogram = \"drive.s\"\nmachine = \"t1\"\n\
                          [[wire]]\nfrom = \"host.x\"\nto = \"a.x\"\n";

    fn files(more: &[(&str, &[u8])]) -> Files {
        let all: [(&str, &[u8]); 4] = [
            ("drive.s", DRIVE.as_bytes()),
            ("gain.s", b".const GAIN = 3\n"),
            ("drive.toml", WIRING.as_bytes()),
            ("system.toml", SYSTEM.as_bytes()),
        ];
        Files(all.iter().chain(more).map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec())).collect())
    }

    fn error<T>(result: Result<T>) -> String {
        result.err().expect("a mistake").to_string()
    }

    #[test]
    fn programs_systems_and_images_are_read() {
        let source = files(&[]);
        let loaded = source.application("drive.s", &T1).expect("a program");
        assert!(loaded.application.is_program());
        assert_eq!(loaded.sources[0].len(), 2);
        let wiring = source.wiring("drive.toml", &loaded.application).expect("a wiring");
        assert_eq!(wiring.clock, 50.0);
        let system = source.application("system.toml", &T1).expect("a system");
        assert!(!system.application.is_program() && system.sources.len() == 1);
        let (program, debug) = source.program("drive.s", &T1).expect("a program");
        let written = image::write_with(&program, Some(&debug)).expect("an image");
        let image = files(&[("drive.elf", &written)]);
        let image = image.application("drive.elf", &T1).expect("an image");
        assert_eq!((image.application.names(), image.sources), (loaded.application.names(), loaded.sources));
    }

    #[test]
    fn mistakes_are_told() {
        let wrong = files(&[
            ("wrong.s", b".period\np: fadd y, x\n wait p\n"),
            ("empty.s", b""),
            ("bytes.toml", b"\xff"),
        ]);
        let program = wrong.application("drive.s", &T1).expect("a program").application;
        assert!(error(wrong.application("none.s", &T1)).contains("none.s is not among the chosen"));
        assert!(error(wrong.application("wrong.s", &T1)).contains("wrong.s:2"));
        assert!(error(wrong.application("empty.s", &T1)).contains("has no instruction"));
        assert!(error(wrong.application("bytes.toml", &T1)).contains("is not text"));
        assert!(error(wrong.application("drive.toml", &T1)).contains("found a board's wiring"));
        let wiring = |text: String| files(&[("w.toml", text.as_bytes())]).wiring("w.toml", &program);
        assert!(
            error(wiring(WIRING.replace("board = \"ulx3s-85f\"\n", ""))).contains("does not name a board")
        );
        assert!(error(wiring(WIRING.replace("ulx3s-85f", "mine"))).contains("none of Takt's boards"));
        assert!(error(wiring(WIRING.replace("duty = \"u\"", "duty = \"v\""))).starts_with("w.toml:9:"));
    }
}
