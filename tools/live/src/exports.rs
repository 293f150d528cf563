// SPDX-License-Identifier: MIT OR Apache-2.0
//! WebAssembly exports for a page that opens the port itself: bytes in, bytes out.
//!
//! The caller asks for a buffer with [`live_input`], writes a request to it and calls one of the other exports; an answer lies at
//! [`live_output`]. [`live_open`], [`live_ask`] and [`live_poll`] wait for the line: the caller runs them through JavaScript Promise
//! Integration, which suspends them inside the import `receive`, and calls one at a time. The only unsafe parts are the names of exports
//! and imports.
#![allow(
    unsafe_code,
    unreachable_pub,
    reason = "an exported name is an unsafe attribute, and seen from outside the crate only; an import is a foreign function"
)]

use crate::application::Files;
use crate::session::{Pages, Session, Target};
use anyhow::{Context, Result, anyhow, ensure};
use serde::Deserialize;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use takt_board::Host;
use takt_board::protocol::Line;
use takt_diagnostics::describe;

/// The page's functions.
mod page {
    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        /// Sends bytes over the line; 0 if the port is gone.
        pub(super) safe fn send(bytes: *const u8, length: usize) -> u32;
        /// Waits a little for bytes, and puts up to `length` of them there; returns their number, or -1 if the port is gone.
        pub(super) safe fn receive(bytes: *mut u8, length: usize) -> i32;
        /// Time in milliseconds since an arbitrary start.
        pub(super) safe fn time() -> f64;
        /// Takes a message, as JSON.
        pub(super) safe fn tell(bytes: *const u8, length: usize);
        /// The page has asked for something that waits for its answer.
        pub(super) safe fn is_asked() -> u32;
    }
}

/// Reads without a byte after which a request counts as lost.
const SILENT: u32 = 5;
/// Most bytes that one read takes.
const READ: usize = 4096;
/// Most bytes of the files together.
const BYTES: usize = 16 << 20;
/// Number of the only page.
const PAGE: u64 = 0;

/// The port that the page has opened.
struct WebSerial;

fn gone() -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, "the port was unplugged, or closed")
}

impl Line for WebSerial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if page::send(bytes.as_ptr(), bytes.len()) == 0 { Err(gone()) } else { Ok(()) }
    }

    fn receive(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; READ];
        let count = usize::try_from(page::receive(bytes.as_mut_ptr(), READ)).map_err(|_| gone())?;
        bytes.truncate(count);
        Ok(bytes)
    }

    fn patience(&self) -> u32 {
        SILENT
    }

    fn time(&self) -> Duration {
        Duration::from_secs_f64(page::time().max(0.0) / 1e3)
    }
}

struct OnePage;

impl Pages for OnePage {
    fn send(&mut self, _page: u64, text: &Arc<str>) -> bool {
        page::tell(text.as_ptr(), text.len());
        true
    }

    fn is_asked(&mut self) -> bool {
        page::is_asked() != 0
    }
}

/// Request to open a board: the lengths of the files follow one another in the buffer behind the JSON.
#[derive(Deserialize)]
struct Opening {
    /// Names and lengths of the files.
    files: Vec<(String, usize)>,
    /// File of the program, or of the system.
    program: String,
    /// Machine of a source that does not name its own.
    machine: String,
    /// File of the wiring.
    wiring: Option<String>,
    /// Name of the port, and its baud rate.
    port: String,
    baud: u32,
    /// Number of the first request; it should differ from the last one of an earlier host.
    number: u8,
}

#[derive(Default)]
struct State {
    session: Option<Session<WebSerial, OnePage>>,
    input: Vec<u8>,
    output: Vec<u8>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

/// Allocates a request buffer of `length` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn live_input(length: usize) -> *mut u8 {
    STATE.with_borrow_mut(|state| {
        state.input = vec![0; length];
        state.input.as_mut_ptr()
    })
}

/// Address of the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn live_output() -> *const u8 {
    STATE.with_borrow(|state| state.output.as_ptr())
}

/// Opens the board at the page's line; the request is a line of JSON, with the files behind it. Returns the length of the error, or 0.
#[unsafe(no_mangle)]
pub extern "C" fn live_open() -> usize {
    STATE.with_borrow_mut(|state| {
        state.session = None;
        let opened = open(&std::mem::take(&mut state.input));
        let text = match opened {
            Ok(session) => {
                state.session = Some(session);
                String::new()
            }
            Err(error) => describe(error.as_ref()),
        };
        state.output = text.into_bytes();
        state.output.len()
    })
}

fn open(request: &[u8]) -> Result<Session<WebSerial, OnePage>> {
    let split = request.iter().position(|byte| *byte == b'\n').context("the request has no end")?;
    let (head, mut rest) = (&request[..split], &request[split + 1..]);
    let Opening { files, program, machine, wiring, port, baud, number } = serde_json::from_slice(head)?;
    ensure!(rest.len() <= BYTES, "the files have more than {} MiB", BYTES >> 20);
    let mut all = BTreeMap::new();
    for (name, length) in files {
        let (bytes, others) = rest.split_at_checked(length).context("a file is shorter than stated")?;
        all.insert(name, bytes.to_vec());
        rest = others;
    }
    let files = Files(all);
    let machine = takt_asm::machine(&machine).map_err(|text| anyhow!("{text}"))?;
    let loaded = files.application(&program, machine)?;
    let wiring = wiring.map(|name| files.wiring(&name, &loaded.application)).transpose()?;
    let host = Host::connect(WebSerial, number)?;
    let target =
        Target { program, port, baud, application: loaded.application, sources: loaded.sources, wiring };
    let mut session = Session::new(host, target, OnePage)?;
    session.join(PAGE);
    Ok(session)
}

/// Carries out the page's message in the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn live_ask() {
    STATE.with_borrow_mut(|state| {
        let text = String::from_utf8_lossy(&state.input).into_owned();
        if let Some(session) = &mut state.session {
            session.answer(PAGE, &text);
        }
    });
}

/// Reads the board's state, or looks for a board that has gone; returns the milliseconds until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn live_poll(number: u32) -> u32 {
    STATE.with_borrow_mut(|state| {
        let Some(session) = &mut state.session else { return 0 };
        let pause = session.poll(|| Ok(Host::connect(WebSerial, number as u8)?));
        u32::try_from(pause.as_millis()).unwrap_or(u32::MAX)
    })
}
