// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod carrier;
mod clock;
mod consistency;
mod devices;
mod drive;
mod ecc;
mod emulated;
mod families;
mod family;
mod files;
mod flash;
mod harness;
mod observe;
mod peripherals;
mod pins;
mod project;
mod scope;
mod second_core;
mod selftest;
mod sensors;
mod system;
mod top;
