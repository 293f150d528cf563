// SPDX-License-Identifier: MIT OR Apache-2.0
//! The machine of a name that a user gave.

use crate::nearest;
use takt_isa::Machine;

/// The machine of a name, with options if it has any: `t3,data=32768`.
///
/// # Errors
/// The mistake in words, with the name that was perhaps meant and those that there are.
pub fn machine(name: &str) -> Result<&'static Machine, String> {
    Machine::from_name(name).map_err(|error| match error.unknown() {
        Some((unknown, known)) => {
            let near = nearest(unknown, known.iter().copied());
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            format!("{error}{near} ({}: {})", error.kind(), known.join(", "))
        }
        None => error.to_string(),
    })
}
