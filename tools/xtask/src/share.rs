// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks `tools/unify`: the tests must reuse every crate that takt with all features, xtask, evidence and the wheel compile.
//!
//! cargo-hakari generates such crates, but leaves out the workspace's own crates, whose features also differ, and takes minutes to
//! install; cargo's build plan shows both kinds in a second.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use takt_automation::command::{EVERYTHING, cargo};

/// Units of cargo's build plan with their features, by package, target and mode.
fn units(arguments: &[&str]) -> Result<BTreeMap<String, BTreeSet<String>>> {
    let mut command = cargo();
    command.args(arguments).args(["--release", "--unit-graph", "-Zunstable-options"]);
    // The build plan is unstable; RUSTC_BOOTSTRAP enables it on the stable compiler.
    let output = command.env("RUSTC_BOOTSTRAP", "1").output().context("cannot start cargo")?;
    if !output.status.success() {
        bail!("cargo gave no plan: {}", String::from_utf8_lossy(&output.stderr));
    }
    let plan: Value = serde_json::from_slice(&output.stdout).context("cargo's plan is not JSON")?;
    let mut units: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for unit in plan["units"].as_array().context("cargo's plan has no units")? {
        let name = format!("{} {} {}", unit["pkg_id"], unit["target"]["kind"], unit["mode"]);
        units.entry(name).or_default().insert(unit["features"].to_string());
    }
    Ok(units)
}

/// # Errors
/// If the tests would compile a crate again with other features, and hence all its dependents.
pub(crate) fn check() -> Result<()> {
    let tests = units(&["test", "--workspace", "--features", EVERYTHING])?;
    let mut again = Vec::new();
    for (package, features) in
        [("takt", &["--features", "full"][..]), ("xtask", &[]), ("evidence", &[]), ("takt-python", &[])]
    {
        for (unit, features) in units(&[&["build", "--package", package], features].concat())? {
            // Intended difference: the wheel has no full-screen debugger.
            let is_meant =
                package == "takt-python" && ["takt-debug", "unify"].iter().any(|name| unit.contains(name));
            let with = tests.get(&unit);
            if with.is_some_and(|with| !with.is_superset(&features)) && !is_meant {
                again.push(format!("{package}: {unit}: {features:?}, in the tests {with:?}"));
            }
        }
    }
    if !again.is_empty() {
        bail!(
            "the tests compile these again, with other features; name those in tools/unify/Cargo.toml:\n{}",
            again.join("\n")
        );
    }
    Ok(())
}
