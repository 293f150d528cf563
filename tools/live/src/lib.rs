// SPDX-License-Identifier: MIT OR Apache-2.0
//! A board while it runs: state, values, parameters and recordings, read and set over one line.
//!
//! [`Session`] owns the board and serves pages: it reads the state several times a second and carries out requests. The line and the way to
//! the pages are the caller's: `takt live PORT serve` has a serial port, and a WebSocket for each page; a page that opens the port itself
//! (Web Serial) has this crate as WebAssembly, whose exports are in `exports`.

#[cfg(any(target_arch = "wasm32", test))]
mod application;
mod control;
#[cfg(target_arch = "wasm32")]
mod exports;
mod message;
pub mod parameters;
mod recorder;
pub mod recording;
pub mod report;
mod session;
mod shown;
pub mod value;

pub use control::{Control, set, setting};
pub use session::{EVERY, Pages, Session, Target};

use takt_asm::names::{NamedArray, Names};
use takt_board::Array;

/// A program's arrays, as an [`Application`](takt_board::Application) has them.
pub fn arrays(names: &Names) -> Vec<Array> {
    let array = |NamedArray { name, base, sizes, ty }: NamedArray| Array { name, base, sizes, ty };
    names.arrays.iter().cloned().map(array).collect()
}
