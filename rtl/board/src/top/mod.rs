// SPDX-License-Identifier: MIT OR Apache-2.0
//! The circuit that is generated for a wiring: the module around cores and peripherals, the board's top level, the image in block RAM, the
//! pins.

mod board;
mod design;
mod error;
mod image;
mod links;
mod memory;
mod peripherals;
mod ports;
mod scope;
mod shadow_memory;
mod template;
mod wrapper;

pub(crate) use board::constraints;
pub(crate) use board::simulated_oscillator;
pub use board::{OSCILLATOR, RESET, TOP};
pub use design::circuit_number;
pub use error::TopError;
pub use image::{Contents, RECORDS, image};
pub(crate) use peripherals::{OwnPin, own_pins};
pub use scope::ScopeSize;
pub(crate) use scope::recorded;
pub use wrapper::AROUND;

use crate::VERILOG;
use crate::application::Application;
use crate::boards::Board;
use crate::kind::Strobes;
use crate::wiring::Wiring;
use design::Design;
use takt_rtl::Library;
use takt_rtl::export::DesignFile;

/// A circuit for a board.
#[derive(Clone, Debug)]
pub struct Circuit {
    /// Verilog files and `image.hex`.
    pub files: Vec<DesignFile>,
    /// The places of the top's ports, for place and route: the file's name and text.
    pub pins: (&'static str, String),
    /// The core's clock in MHz.
    pub clock: f64,
    /// Records of the program.
    pub records: usize,
    /// Records that the image has room for.
    pub room: usize,
    /// The scope.
    pub scope: Option<ScopeSize>,
}

/// The complete circuit of a program, or a system, on a board.
///
/// # Errors
/// If the program is too big, the clock cannot be made, or the machine has no circuit.
pub fn circuit<'a>(
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
) -> Result<Circuit, TopError> {
    let (application, library) = (application.into(), Library::builtin());
    let contents = contents(wiring, &application)?;
    let left = memory::check(board, wiring, &application, &contents, &library)?;
    let scope = ScopeSize::of(board, wiring, &application, left)?;
    let mut design = Design::of(&application, &library, wiring.safety)?;
    let around = wrapper::wrapper(wiring, &application, &design, (&contents, scope), &library);
    let mut files = std::mem::take(&mut design.files);
    let mut put = |name: &str, text: String| {
        if !files.iter().any(|file| file.name.rsplit('/').next() == name.rsplit('/').next()) {
            files.push(DesignFile { name: name.to_owned(), text });
        }
    };
    for name in ["convert.v", "common/takt_leading_zeros.v"] {
        let own = name.rsplit('/').next().unwrap_or(name);
        let own = if own.starts_with("takt_") { own.to_owned() } else { format!("takt_{own}") };
        put(&format!("units/{own}"), library.text(name).unwrap_or_default().to_owned());
    }
    let others: &[&str] = match application.is_program() {
        true => &["takt_tick_divider.v", "takt_output_latch.v"],
        false => &["takt_exchange.v"],
    };
    let unused = unused(wiring);
    let is_needed = |name: &&str| !others.contains(name) && !unused.contains(name);
    for (name, text) in VERILOG.iter().filter(|(name, _)| is_needed(name)) {
        put(&format!("board/{name}"), (*text).to_owned());
    }
    put(&format!("{AROUND}.v"), around);
    put(&format!("{TOP}.v"), board::top(board, wiring)?);
    if let Some(text) = board::oscillator(board, wiring) {
        put(OSCILLATOR, text);
    }
    put("image.hex", contents.file(application.description().cores.len()));
    Ok(Circuit {
        files,
        pins: (board.pinout.file, (board.pinout.constraints)(&board::constraints(board, wiring))),
        clock: wiring.clock,
        records: contents.records.len(),
        room: contents.room,
        scope,
    })
}

/// The scope of a program, or a system, on a board; `None` without one.
///
/// # Errors
/// The mistakes of [`circuit`].
pub fn scope<'a>(
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
) -> Result<Option<ScopeSize>, TopError> {
    let (application, library) = (application.into(), Library::builtin());
    let left = memory::check(board, wiring, &application, &contents(wiring, &application)?, &library)?;
    ScopeSize::of(board, wiring, &application, left)
}

/// The image on a board with this wiring: without a host that writes others, it has no room beyond its records.
fn contents(wiring: &Wiring, application: &Application<'_>) -> Result<Contents, TopError> {
    let mut contents = image(application.clone())?;
    if !wiring.uart {
        contents.room = contents.records.len().next_power_of_two();
    }
    Ok(contents)
}

/// The files of the host's UART, carriers, filters, trips and watchdogs that a wiring does not need.
fn unused(wiring: &Wiring) -> Vec<&'static str> {
    let has = |strobe: fn(&Strobes) -> bool| {
        wiring.peripherals.iter().any(|peripheral| strobe(&peripheral.kind.strobes))
    };
    let needed = [
        ("takt_carrier.v", !wiring.carriers.is_empty()),
        ("takt_align.v", wiring.tick.is_some()),
        ("takt_pwm3.v", has(|strobes| strobes.carrier)),
        ("takt_pwm_phase.v", has(|strobes| strobes.carrier)),
        ("takt_sinc3.v", has(|strobes| strobes.window)),
        ("takt_bridge.v", wiring.uart),
        ("takt_uart_receive.v", wiring.uart),
        ("takt_uart_send.v", wiring.uart),
        ("takt_scope.v", wiring.scope.is_some()),
        ("takt_trip.v", has(|strobes| strobes.trips)),
        ("takt_watchdog.v", wiring.signal("watchdog").is_some()),
        ("takt_clock_watch.v", wiring.clock_watch),
        ("takt_flash.v", wiring.flash.is_some()),
    ];
    needed.into_iter().filter(|(_, is_needed)| !is_needed).map(|(name, _)| name).collect()
}
