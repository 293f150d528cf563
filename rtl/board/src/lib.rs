// SPDX-License-Identifier: MIT OR Apache-2.0
//! Takt's cores on FPGA boards, with the ports of their programs connected to pins through peripherals.
//!
//! [`kind`] is the table of peripherals. Each is a Verilog file in `rtl/board/verilog/` and a behavioural model in [`model`]. [`boards`]
//! holds the boards, as data. A user writes a [`Wiring`]: which peripherals are on which pins, and which ports of the program, or of a
//! system's cores, are connected to their registers; [`Application`] is that program or system.

mod application;
pub mod boards;
pub mod build;
pub mod carrier;
mod consistency;
pub mod device;
mod document;
pub mod emulated;
pub mod endpoints;
pub mod flash;
pub mod host;
mod interlock;
pub mod kind;
pub mod latency;
pub mod model;
pub mod netlist;
pub mod place;
pub mod project;
pub mod protocol;
mod safety_watch;
pub mod scope;
pub mod selftest;
#[cfg(not(target_arch = "wasm32"))]
pub mod serial;
pub mod simulation;
mod sinks;
mod stream;
#[cfg(unix)]
pub mod terminal;
pub mod tools;
pub mod top;
pub mod wiring;

pub use application::{Application, Array};
pub use boards::Board;
pub use consistency::Findings;
pub use document::Mistake;
pub use host::Host;
pub use kind::Kind;
pub use protocol::Place;
pub use scope::Scope;
pub use stream::{STREAMED, Stream};
pub use wiring::Wiring;

/// The Verilog of the peripherals, and of the modules around the core, by file name.
pub const VERILOG: &[(&str, &str)] = &[
    ("takt_align.v", include_str!("../verilog/takt_align.v")),
    ("takt_biss_c.v", include_str!("../verilog/takt_biss_c.v")),
    ("takt_boot.v", include_str!("../verilog/takt_boot.v")),
    ("takt_bridge.v", include_str!("../verilog/takt_bridge.v")),
    ("takt_carrier.v", include_str!("../verilog/takt_carrier.v")),
    ("takt_digital_in.v", include_str!("../verilog/takt_digital_in.v")),
    ("takt_digital_out.v", include_str!("../verilog/takt_digital_out.v")),
    ("takt_exchange.v", include_str!("../verilog/takt_exchange.v")),
    ("takt_filter.v", include_str!("../verilog/takt_filter.v")),
    ("takt_hall.v", include_str!("../verilog/takt_hall.v")),
    ("takt_interlock.v", include_str!("../verilog/takt_interlock.v")),
    ("takt_output_latch.v", include_str!("../verilog/takt_output_latch.v")),
    ("takt_pwm.v", include_str!("../verilog/takt_pwm.v")),
    ("takt_pwm3.v", include_str!("../verilog/takt_pwm3.v")),
    ("takt_pwm_phase.v", include_str!("../verilog/takt_pwm_phase.v")),
    ("takt_quadrature.v", include_str!("../verilog/takt_quadrature.v")),
    ("takt_scale.v", include_str!("../verilog/takt_scale.v")),
    ("takt_scope.v", include_str!("../verilog/takt_scope.v")),
    ("takt_shadow_memory.v", include_str!("../verilog/takt_shadow_memory.v")),
    ("takt_sigma_delta.v", include_str!("../verilog/takt_sigma_delta.v")),
    ("takt_sinc3.v", include_str!("../verilog/takt_sinc3.v")),
    ("takt_spi.v", include_str!("../verilog/takt_spi.v")),
    ("takt_ssi.v", include_str!("../verilog/takt_ssi.v")),
    ("takt_step.v", include_str!("../verilog/takt_step.v")),
    ("takt_tick.v", include_str!("../verilog/takt_tick.v")),
    ("takt_tick_divider.v", include_str!("../verilog/takt_tick_divider.v")),
    ("takt_trip.v", include_str!("../verilog/takt_trip.v")),
    ("takt_watchdog.v", include_str!("../verilog/takt_watchdog.v")),
    ("takt_clock_watch.v", include_str!("../verilog/takt_clock_watch.v")),
    ("takt_flash.v", include_str!("../verilog/takt_flash.v")),
    ("takt_uart_receive.v", include_str!("../verilog/takt_uart_receive.v")),
    ("takt_uart_send.v", include_str!("../verilog/takt_uart_send.v")),
];
