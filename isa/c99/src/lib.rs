// SPDX-License-Identifier: MIT OR Apache-2.0
//! The five C99 `<stdint.h>` "fast" types that `softfloat-sys` names, as on x86-64 Linux (glibc: 8 bits stay 8, wider types
//! become 64).
//!
//! The published `c99` crate finds these types by running CMake, which these machines lack: a build of Takt must need only Rust
//! and a C compiler.
#![no_std]
#![allow(non_camel_case_types)]

// The fast types of musl, macOS and Windows are 32 bits wide: wrong widths here would be undefined behaviour there.
#[cfg(not(all(target_arch = "x86_64", target_os = "linux", target_env = "gnu", target_pointer_width = "64")))]
compile_error!(
    "these widths are those of x86-64 Linux with glibc; on other targets leave takt-isa's SoftFloat out, or use the published c99 crate"
);

/// `int_fast32_t`: at least 32 bits, signed.
pub type int_fast32_t = i64;
/// `int_fast64_t`: at least 64 bits, signed.
pub type int_fast64_t = i64;
/// `uint_fast8_t`: at least 8 bits, unsigned.
pub type uint_fast8_t = u8;
/// `uint_fast32_t`: at least 32 bits, unsigned.
pub type uint_fast32_t = u64;
/// `uint_fast64_t`: at least 64 bits, unsigned.
pub type uint_fast64_t = u64;
