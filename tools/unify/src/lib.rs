// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nothing but features; see Cargo.toml.
//!
//! Cargo compiles a crate once for each set of its features. The crates that only tests use turn on more of them in crates
//! that `takt` and `xtask` use too. Because both depend on this one, which turns these on, `cargo xtask test` finds every
//! crate that `cargo run --release` compiled. `cargo xtask lint` checks that it stays so.
