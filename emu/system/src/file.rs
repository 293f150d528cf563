// SPDX-License-Identifier: MIT OR Apache-2.0
//! Serde model of a system's file: tables and keys, each value with its place.

use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    pub(crate) tick: Spanned<i64>,
    #[serde(default)]
    pub(crate) core: Vec<CoreTable>,
    #[serde(default)]
    pub(crate) wire: Vec<WireTable>,
    #[serde(default)]
    pub(crate) snapshot: Vec<SnapshotTable>,
    #[serde(default)]
    pub(crate) fifo: Vec<FifoTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CoreTable {
    pub(crate) name: Spanned<String>,
    pub(crate) program: Spanned<String>,
    pub(crate) machine: Option<Spanned<String>>,
    pub(crate) tick: Option<Spanned<i64>>,
    pub(crate) offset: Option<Spanned<i64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WireTable {
    pub(crate) from: Spanned<String>,
    pub(crate) to: Spanned<String>,
    pub(crate) latency: Option<Spanned<i64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SnapshotTable {
    pub(crate) name: Spanned<String>,
    pub(crate) from: Spanned<String>,
    pub(crate) to: Spanned<String>,
    pub(crate) ports: Spanned<Vec<Spanned<String>>>,
    pub(crate) strobe: Option<Spanned<String>>,
    pub(crate) latency: Option<Spanned<i64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FifoTable {
    pub(crate) name: Spanned<String>,
    pub(crate) from: Spanned<String>,
    pub(crate) to: Spanned<String>,
    pub(crate) depth: Spanned<i64>,
    pub(crate) ports: Spanned<Vec<Spanned<String>>>,
    pub(crate) push: Option<Spanned<String>>,
    pub(crate) pop: Option<Spanned<String>>,
    pub(crate) sender: Option<StatusTable>,
    pub(crate) receiver: Option<StatusTable>,
    pub(crate) latency: Option<Spanned<i64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StatusTable {
    pub(crate) empty: Option<Spanned<String>>,
    pub(crate) full: Option<Spanned<String>>,
    pub(crate) count: Option<Spanned<String>>,
    pub(crate) overflow: Option<Spanned<String>>,
    pub(crate) underflow: Option<Spanned<String>>,
}
