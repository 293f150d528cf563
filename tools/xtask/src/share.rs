// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks that the tests find every crate that takt with all features compiled: `tools/unify`'s purpose.
//!
//! cargo-hakari, which writes such crates, leaves out the workspace's own crates, whose features differ too, and takes minutes to
//! install; cargo's own plan shows both kinds in a second.

use crate::cargo;
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::collections::BTreeSet;

/// The units that cargo would compile: package, target, mode and features of each.
fn units(arguments: &[&str]) -> Result<BTreeSet<String>> {
    let mut command = cargo();
    command.args(arguments).args(["--release", "--unit-graph", "-Zunstable-options"]);
    // Cargo's plan is unstable; the variable admits it on the stable compiler.
    let output = command.env("RUSTC_BOOTSTRAP", "1").output().context("cannot start cargo")?;
    if !output.status.success() {
        bail!("cargo gave no plan: {}", String::from_utf8_lossy(&output.stderr));
    }
    let plan: Value = serde_json::from_slice(&output.stdout).context("cargo's plan is no JSON")?;
    let units = plan["units"].as_array().context("cargo's plan has no units")?;
    let text = |unit: &Value| {
        let target = &unit["target"];
        format!("{} {} {} {}", unit["pkg_id"], target["kind"], unit["mode"], unit["features"])
    };
    Ok(units.iter().map(text).collect())
}

/// # Errors
/// If the tests would compile a crate again, with other features.
pub(crate) fn check() -> Result<()> {
    let tests = units(&["test", "--workspace", "--features", crate::EVERYTHING])?;
    let takt = units(&["build", "--package", "takt", "--features", "full"])?;
    let again: Vec<String> = takt.difference(&tests).cloned().collect();
    if !again.is_empty() {
        bail!(
            "the tests compile these again, with other features; name those in tools/unify/Cargo.toml:\n{}",
            again.join("\n")
        );
    }
    Ok(())
}
