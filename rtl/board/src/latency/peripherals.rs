// SPDX-License-Identifier: MIT OR Apache-2.0
//! The parts of a way within peripherals: from a pin's edge to a register, and from a register to a pin.

use super::way::{Answer, End, Part};
use crate::wiring::{Peripheral, Wiring};

fn parameter(peripheral: &Peripheral, name: &str) -> u64 {
    peripheral.parameter(name).into()
}

/// From a pin's edge to the register, of peripherals that have such a pin.
fn edge_in(peripheral: &Peripheral, register: &str) -> Option<Vec<Part>> {
    let cycles = match (peripheral.kind.name, register) {
        ("quadrature" | "step", _) => parameter(peripheral, "filter") + 3,
        ("digital-in", "level") => parameter(peripheral, "hold") + 2,
        ("digital-in", _) => parameter(peripheral, "hold") + 3,
        _ => return None,
    };
    Some(vec![Part::new(format!("edge to `{register}`"), cycles, cycles)])
}

/// From the register to what the pin answers with.
fn answer(peripheral: &Peripheral) -> Option<(Vec<Part>, Answer)> {
    let edge = |parts| Some((parts, Answer::Edge));
    match peripheral.kind.name {
        // One cycle more of an odd pulse moves its end only, and the longest one that has an end ends with the period. A long dead time
        // can move the beginning of the shortest pulse that it leaves, dead + 1 cycles about the middle, beyond that; and, by dead / 2
        // into the next period, the rise of the lower switch in the shortest gap that it leaves. Where one switch is to stay on, it comes
        // on after the dead time.
        "pwm" => {
            let (half, dead) = (parameter(peripheral, "half"), parameter(peripheral, "dead"));
            let has_low = peripheral.pins.get(1).is_some_and(Option::is_some);
            let high = (2 * half).max(half + 1 + dead - (dead + 2) / 2);
            let low = if has_low { 2 * half + dead.div_ceil(2) } else { 0 };
            // A longer dead time leaves no pulse and no gap.
            let moves = if dead < 2 * half { high.max(low) } else { 0 }.max(dead + 1);
            edge(vec![
                Part::new("to the next period of the PWM", 2, 2 * half + 1),
                Part::new("its first edge that moves", 1, moves),
            ])
        }
        "digital-out" => edge(vec![Part::new("to the pin", 1, 1)]),
        "sigma-delta" => Some((vec![Part::new("to the modulator", 1, 1)], Answer::Density)),
        // A converter's frames begin at ticks, or with the outputs, whatever their values.
        _ => None,
    }
}

/// The input ports of a peripheral, with the end of ways at each; none if there is no edge to count from.
pub(super) fn inputs(peripheral: &Peripheral) -> impl Iterator<Item = (&str, Option<End>)> {
    let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
    registers.filter_map(|(register, port)| {
        let port = port.as_deref()?;
        let parts = edge_in(peripheral, register.name);
        Some((port, parts.map(|parts| end(peripheral, port, (parts, Answer::Edge)))))
    })
}

/// The output ports of a peripheral, with the end of ways at each; none if there is no edge to count to.
pub(super) fn outputs(peripheral: &Peripheral) -> impl Iterator<Item = (&str, Option<End>)> {
    peripheral.writes.iter().flatten().map(|write| {
        (write.port.as_str(), answer(peripheral).map(|answer| end(peripheral, &write.port, answer)))
    })
}

fn end(peripheral: &Peripheral, port: &str, (parts, answer): (Vec<Part>, Answer)) -> End {
    End { peripheral: peripheral.name.clone(), port: port.to_owned(), parts, answer }
}

/// Peripherals of a wiring with no port that is an end of a way.
pub(super) fn others(wiring: &Wiring) -> Vec<String> {
    let is_other = |peripheral: &&Peripheral| {
        !inputs(peripheral).chain(outputs(peripheral)).any(|(_, end)| end.is_some())
    };
    wiring.peripherals.iter().filter(is_other).map(|peripheral| peripheral.name.clone()).collect()
}
