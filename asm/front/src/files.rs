// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files that are included by name.

/// Reads an included file, given its name relative to the including file's folder; the error says why the file is missing or unreadable.
pub type Files<'a> = &'a dyn Fn(&str) -> Result<String, String>;

/// Refuses every included file: for texts that come from memory.
///
/// # Errors
/// Always.
pub fn no_files(name: &str) -> Result<String, String> {
    Err(format!(
        "`{name}` is the name of a file, but this text comes from memory: replace the name by the file's content"
    ))
}
