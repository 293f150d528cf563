// SPDX-License-Identifier: MIT OR Apache-2.0
//! Specified contents of the units' tables for `rtl/formal/tables.py`, which calls `cargo evidence tables`.

use anyhow::{Result, anyhow};
use serde_json::{Map, Value, json};
use takt_rtl::tables::checked;

/// Entry of `cargo evidence tables`: checks the error bounds of every table, and prints the words by output name.
pub(crate) fn tables() -> Result<()> {
    let mut all = Map::new();
    for table in checked().map_err(|error| anyhow!(error))? {
        let memories = table.memories.into_iter().map(|memory| {
            (memory.name.to_owned(), json!({ "address": memory.address, "words": memory.words }))
        });
        all.insert(table.name.to_owned(), Value::Object(memories.collect()));
    }
    println!("{}", Value::Object(all));
    Ok(())
}
