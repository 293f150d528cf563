// SPDX-License-Identifier: MIT OR Apache-2.0
//! The playground as WebAssembly exports it: bytes in, bytes out, so that the JavaScript beside it is a dozen lines.
//!
//! The page asks for room with [`takt_input`], writes a method, a line feed and its parameters there, and calls [`takt_call`] or
//! [`takt_image`]; the answer has as many bytes as they return, at [`takt_output`]. An answer is `{"ok": …}` or `{"error": "…"}`.
//! Nothing here is unsafe but that names are exported.
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

/// Room for a request of so many bytes.
#[unsafe(no_mangle)]
pub extern "C" fn takt_input(length: usize) -> *mut u8 {
    EXCHANGE.with_borrow_mut(|exchange| {
        exchange.input = vec![0; length];
        exchange.input.as_mut_ptr()
    })
}

/// Answers the request; the number of bytes of the answer.
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

/// The image of the program; the number of its bytes, 0 if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn takt_image() -> usize {
    EXCHANGE.with_borrow_mut(|exchange| {
        exchange.output = exchange.playground.image().unwrap_or_default();
        exchange.output.len()
    })
}

/// The address of the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn takt_output() -> *const u8 {
    EXCHANGE.with_borrow(|exchange| exchange.output.as_ptr())
}
