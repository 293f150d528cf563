// SPDX-License-Identifier: MIT OR Apache-2.0
//! A loaded program with its debug information.

use crate::run::spills::spilled;
use std::path::PathBuf;
use takt_asm::AssembledProgram;
use takt_asm::expr::Value;
use takt_asm::names::{DebugInfo, Names};
use takt_isa::Program;

/// A program with constants, sources and names, if it was assembled here or its image contains them.
pub(crate) struct LoadedProgram {
    pub(crate) program: Program,
    /// Named constants in the source.
    pub(crate) constants: Vec<(String, Value)>,
    /// Source texts, keyed by the program's file names.
    pub(crate) sources: Vec<(String, String)>,
    /// Folder of the sources, which their names do not have; empty for an image and for built-in programs.
    pub(crate) folder: PathBuf,
    /// Meanings of names in the source.
    pub(crate) names: Names,
    /// Cost of spilled registers, as lines of text; empty for an image.
    pub(crate) spilled: Vec<String>,
}

impl From<AssembledProgram> for LoadedProgram {
    fn from(assembled: AssembledProgram) -> LoadedProgram {
        let DebugInfo { sources, constants, names } = assembled.debug_info();
        let spilled = spilled(&assembled);
        LoadedProgram {
            program: assembled.program,
            constants,
            sources,
            folder: PathBuf::new(),
            names,
            spilled,
        }
    }
}
