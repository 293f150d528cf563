// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod encoding;
mod fp_apfloat;
mod fp_common;
mod fp_digest;
mod fp_fused;
mod fp_host;
mod fp_kernels;
mod fp_screened;
mod fp_trig;
mod fp_unary;
mod machines;
mod manual;
mod numbers;
mod timing;
