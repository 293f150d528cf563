// SPDX-License-Identifier: MIT OR Apache-2.0
//! Commands with their options, one module each; code that several commands share is in `run` and `terminal`.

pub(crate) mod accuracy;
pub(crate) mod analyse;
pub(crate) mod arm;
pub(crate) mod asm;
#[cfg(feature = "board")]
pub(crate) mod board;
pub(crate) mod bound;
#[cfg(feature = "model")]
pub(crate) mod cc;
pub(crate) mod completions;
pub(crate) mod cosim;
#[cfg(feature = "editor")]
pub(crate) mod dap;
pub(crate) mod debug;
pub(crate) mod disasm;
pub(crate) mod editor;
pub(crate) mod eval;
pub(crate) mod explore;
pub(crate) mod fmt;
#[cfg(feature = "fmu")]
pub(crate) mod fmu;
#[cfg(all(unix, feature = "fmu"))]
pub(crate) mod fmu_process;
pub(crate) mod friction;
pub(crate) mod isa;
pub(crate) mod left_out;
#[cfg(feature = "board")]
pub(crate) mod live;
#[cfg(feature = "editor")]
pub(crate) mod lsp;
pub(crate) mod machines;
pub(crate) mod man;
#[cfg(feature = "model")]
pub(crate) mod model;
pub(crate) mod monte_carlo;
pub(crate) mod report;
#[cfg(feature = "robot")]
pub(crate) mod robot;
pub(crate) mod rtl;
pub(crate) mod run;
pub(crate) mod track;
pub(crate) mod verify;

#[cfg(not(feature = "fmu"))]
pub(crate) use left_out::fmu;
#[cfg(not(feature = "robot"))]
pub(crate) use left_out::robot;
#[cfg(not(feature = "board"))]
pub(crate) use left_out::{board, live};
#[cfg(not(feature = "model"))]
pub(crate) use left_out::{cc, model};
#[cfg(not(feature = "editor"))]
pub(crate) use left_out::{dap, lsp};
