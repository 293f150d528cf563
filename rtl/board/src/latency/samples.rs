// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instants at which peripherals sample what the program reads.

use super::peripherals::{Frame, Window, frame, rate, window};
use crate::carrier::Instant;
use crate::wiring::{Peripheral, Starts, Wiring};

/// Sampling of a peripheral.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Name of the peripheral.
    pub peripheral: String,
    /// Input ports of the program with what is sampled.
    pub ports: Vec<String>,
    /// The instant, and the frame that brings the sample, in words.
    pub text: String,
}

/// A number with four significant digits, without zeros at its end.
pub(super) fn significant(number: f64) -> String {
    let digits = 3 - number.abs().max(1e-9).log10().floor() as i32;
    let text = format!("{number:.*}", digits.clamp(0, 9) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A number of cycles, with its unit.
fn cycles(number: u64) -> String {
    format!("{number} cycle{}", if number == 1 { "" } else { "s" })
}

/// A position of a carrier in words, some cycles later.
fn position(wiring: &Wiring, instant: Instant, later: u64) -> String {
    let carrier = &wiring.carriers[instant.carrier];
    let at = (u64::from(instant.at) + later) % u64::from(carrier.period());
    let half = u64::from(carrier.half);
    let (place, behind) = if at < half { ("valley", at) } else { ("peak", at - half) };
    match behind {
        0 => format!("{}.{place}", carrier.name),
        _ => format!("{} after {}.{place}", cycles(behind), carrier.name),
    }
}

/// Sampling by a frame.
fn framed(wiring: &Wiring, peripheral: &Peripheral, frame: &Frame) -> String {
    let instant = match peripheral.starts {
        Starts::At(instant) => position(wiring, instant, 1),
        Starts::Lead if wiring.lead > 1 => format!("{} before the tick", cycles(u64::from(wiring.lead) - 1)),
        Starts::Lead if wiring.lead == 1 => "at the tick".to_owned(),
        Starts::Lead => "1 cycle after the tick".to_owned(),
        Starts::Publish | Starts::Never => "1 cycle after the outputs".to_owned(),
    };
    let [least, most] = frame.cycles;
    let length = if least == most { cycles(most) } else { format!("{least} to {}", cycles(most)) };
    let rate = rate(wiring, peripheral).map_or_else(String::new, significant);
    format!("{instant}, by a frame of {length} at {rate} MHz")
}

/// Sampling by a filter's window.
fn windowed(wiring: &Wiring, peripheral: &Peripheral, window: &Window) -> String {
    let delay = cycles(window.delay);
    let rate = rate(wiring, peripheral).map_or_else(String::new, significant);
    let by = format!("by a window of {} at {rate} MHz, group delay {delay}", cycles(3 * window.every));
    match peripheral.starts {
        Starts::At(centre) if window.spread == 0 => format!("about {}, {by}", position(wiring, centre, 0)),
        Starts::At(centre) => {
            format!("about {}, {} before or after, {by}", position(wiring, centre, 0), cycles(window.spread))
        }
        _ => format!("every {}, {by}", cycles(window.every)),
    }
}

/// The sampling of all peripherals that sample at another time than the tick.
pub fn samples(wiring: &Wiring) -> Vec<Sampling> {
    let of = |peripheral: &Peripheral| {
        let (frame, window) = (frame(peripheral), window(peripheral));
        let text = match (&frame, &window, peripheral.latch) {
            (Some(frame), ..) => framed(wiring, peripheral, frame),
            (_, Some(window), _) => windowed(wiring, peripheral, window),
            (.., Some(instant)) => position(wiring, instant, 0),
            _ => return None,
        };
        let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
        let sampled = registers
            .filter(|(register, _)| match (&frame, &window) {
                (Some(_), _) => Frame::has(peripheral, register.name),
                (_, Some(_)) => register.name == "value",
                _ => true,
            })
            .filter_map(|(_, port)| port.clone());
        let ports: Vec<String> = sampled.collect();
        (!ports.is_empty()).then(|| Sampling { peripheral: peripheral.name.clone(), ports, text })
    };
    wiring.peripherals.iter().filter_map(of).collect()
}
