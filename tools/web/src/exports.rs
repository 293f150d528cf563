// SPDX-License-Identifier: MIT OR Apache-2.0
//! WebAssembly exports of the playground: bytes in, bytes out, called by a dozen lines of JavaScript.
//!
//! The page requests a buffer with [`takt_input`], writes a method, a line feed and JSON parameters to it, and calls [`takt_call`] or
//! [`takt_image`]. The result is the length of the answer in bytes; the answer is at [`takt_output`], as `{"ok": …}` or `{"error": "…"}`.
//! The only unsafe part is the export of symbol names.
#![allow(
    unsafe_code,
    unreachable_pub,
    reason = "an exported name is an unsafe attribute, and seen from outside the crate only"
)]

use crate::Playground;
use serde_json::{Value, json};
use std::cell::RefCell;

#[derive(Default)]
struct Exchange {
    playground: Playground,
    input: Vec<u8>,
    output: Vec<u8>,
}

thread_local! {
    static EXCHANGE: RefCell<Exchange> = RefCell::default();
}

/// Allocates a request buffer of `length` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn takt_input(length: usize) -> *mut u8 {
    EXCHANGE.with_borrow_mut(|exchange| {
        exchange.input = vec![0; length];
        exchange.input.as_mut_ptr()
    })
}

/// Answers the request; returns the answer's length in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn takt_call() -> usize {
    EXCHANGE.with_borrow_mut(|exchange| {
        let request = String::from_utf8_lossy(&exchange.input).into_owned();
        let (method, params) = request.split_once('\n').unwrap_or((&request, ""));
        let params = serde_json::from_str(params).unwrap_or(Value::Null);
        let answer = match exchange.playground.call(method, params) {
            Ok(answer) => json!({ "ok": answer }),
            Err(error) => json!({ "error": error }),
        };
        exchange.output = answer.to_string().into_bytes();
        exchange.output.len()
    })
}

/// Writes the program's image; returns its length in bytes, or 0 if there is no program.
#[unsafe(no_mangle)]
pub extern "C" fn takt_image() -> usize {
    EXCHANGE.with_borrow_mut(|exchange| {
        exchange.output = exchange.playground.image().unwrap_or_default();
        exchange.output.len()
    })
}

/// Address of the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn takt_output() -> *const u8 {
    EXCHANGE.with_borrow(|exchange| exchange.output.as_ptr())
}
