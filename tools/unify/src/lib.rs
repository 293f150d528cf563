// SPDX-License-Identifier: MIT OR Apache-2.0
//! Crate without code that only selects features; see Cargo.toml.
//!
//! Cargo compiles a crate once for each set of features. Crates that only tests use enable more features of crates that `takt` and
//! `xtask` also use. Since both depend on this crate, which enables these features, `cargo xtask test` reuses every crate that `cargo run
//! --release` has compiled. `cargo xtask lint` checks this.
