// SPDX-License-Identifier: MIT OR Apache-2.0
//! Source in the assembler's language. Every front end ends here: this folder writes heads of sources, and spells numbers, names, values
//! and equations.

mod arrays;
mod equations;
mod head;
mod layout;
mod terms;

pub(crate) use arrays::{Arrays, Names, machine_for, number};
pub use equations::{constants, inputs_read, source};
pub(crate) use head::{Head, Period};
pub use layout::Layout;
pub(crate) use terms::{Terms, expression, of_library};
