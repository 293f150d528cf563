// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every limit of the assembler, by name. The limits keep an unreasonable source from taking unreasonable time or memory; a source
//! that exceeds one gets a single clear error. No real program comes near one.

pub use takt_diagnostics::limits::*;

/// Bytes of one source file.
pub const FILE_BYTES: usize = 64 << 20;
/// Bytes of all source files of a program together, each counted once.
pub const SOURCE_BYTES: usize = 256 << 20;
/// Bytes of one line, its continuations included.
pub const LINE_BYTES: usize = 1 << 20;
/// Nesting of parentheses, brackets, prefix operators and powers in one operand.
pub const EXPRESSION_DEPTH: usize = 128;
/// Macro arguments and name templates that depend on one another.
pub const EVALUATION_DEPTH: usize = EXPRESSION_DEPTH + 32;
/// Operands and operators of one expression.
pub const EXPRESSION_NODES: usize = 1 << 16;
/// Elements of one array of registers, and of all arrays together.
pub const ARRAY_ELEMENTS: usize = 1 << 16;
/// Indices of an array.
pub const ARRAY_INDICES: usize = 8;
/// Registers that one statement writes, such as `a, b = …`.
pub const EQUATION_TARGETS: usize = 64;
/// Depth of `.include` within `.include`.
pub const INCLUDE_DEPTH: usize = 32;
/// `.include`s met during expansion.
pub const INCLUDES: usize = 1 << 16;
/// Depth of macro uses within macros' bodies.
pub const MACRO_DEPTH: usize = 64;
/// Nesting depth of blocks (`.macro`, `.rep`, `.for`, `.if`) in one file.
pub const BLOCK_DEPTH: usize = 64;
/// Nesting depth of counted loops at run time, on every machine.
pub const LOOP_DEPTH: usize = 4;
/// Iterations of a counted loop.
pub const LOOP_COUNT: u32 = 65_535;
/// Repetitions of one `.rep`.
pub const REPETITIONS: i64 = 1 << 20;
/// Statements met during expansion, each repetition and each macro use counted (fewer in the fuzz targets, where each
/// takes a hundred times as long, and every limit is worth reaching).
pub const STATEMENTS: usize = if cfg!(fuzzing) { 1 << 12 } else { 4 << 20 };
/// Operations of the expanded program, whatever the machine's program memory.
pub const OPERATIONS: usize = 4 << 20;
/// Operations of one bundle, on a machine that issues them one after another.
pub const BUNDLE_OPERATIONS: usize = 64;
/// Words of the expanded data memory, whatever the machine's.
pub const DATA_WORDS: usize = 1 << 20;
/// Bytes of a name.
pub const NAME_BYTES: usize = 255;
/// Names that a program may use, including macros' locals and expanded name templates.
pub const NAMES: usize = 1 << 24;
/// Names in the source, each expansion counted, that an index of names keeps.
pub const REFERENCES: usize = 1 << 20;
/// Names that are compared with a misspelt one.
pub const CANDIDATES: usize = 1 << 14;
/// Files of the library that an error lists.
pub const LISTED: usize = 50;
/// Bytes of an image.
pub const IMAGE_BYTES: usize = 256 << 20;
