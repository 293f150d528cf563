//! From an edge at a pin to an edge at a pin, in cycles: the contracts of the modules on the way, added up.
//!
//! `board/tests/top.rs` measures them in the complete top level.

use crate::wiring::{Peripheral, Wiring};

/// A part of the way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// What happens.
    pub text: String,
    /// Cycles that it takes at least.
    pub best: u64,
    /// Cycles that it takes at most.
    pub worst: u64,
}

impl Part {
    fn new(text: impl Into<String>, best: u64, worst: u64) -> Part {
        Part { text: text.into(), best, worst }
    }

    /// Parts one after the other.
    pub fn sum<'a>(text: &str, parts: impl IntoIterator<Item = &'a Part>) -> Part {
        let add = |sum: Part, part: &Part| Part {
            best: sum.best + part.best,
            worst: sum.worst + part.worst,
            ..sum
        };
        parts.into_iter().fold(Part::new(text, 0, 0), add)
    }
}

/// The parts between a register and its pin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct End {
    /// The peripheral.
    pub peripheral: String,
    /// The program's port that is its register.
    pub port: String,
    /// What happens between.
    pub parts: Vec<Part>,
}

/// The ways through a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ways {
    /// From an edge at a pin to the register that the program reads.
    pub inputs: Vec<End>,
    /// From there to the registers that it writes, if no deadline is missed.
    pub between: Vec<Part>,
    /// From there to an edge at a pin.
    pub outputs: Vec<End>,
    /// Peripherals with ports that have no edge to count from or to, as a converter's.
    pub others: Vec<String>,
}

/// `takt_exchange`: from the board's tick to the core's, with no input.
const BEGIN: u64 = 5;
/// From the cycle in which `wait` issues to the one in which `put` is high, with no output: the core's `waiting`, `takt_exchange` and the
/// rounding of the last output.
const END: u64 = 14;

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

/// From the register to the pin's edge.
fn edge_out(peripheral: &Peripheral) -> Option<Vec<Part>> {
    match peripheral.kind.name {
        // One cycle more of an odd pulse moves its end only, and the longest one that has an end ends with the period. A long dead time
        // can move the beginning of the shortest pulse that it leaves, dead + 1 cycles about the middle, beyond that.
        "pwm" => {
            let (half, dead) = (parameter(peripheral, "half"), parameter(peripheral, "dead"));
            Some(vec![
                Part::new("to the next period of the PWM", 2, 2 * half + 1),
                Part::new("its first edge that moves", 1, (2 * half).max(half + 1 + dead - (dead + 2) / 2)),
            ])
        }
        "digital-out" => Some(vec![Part::new("to the pin", 1, 1)]),
        "sigma-delta" => Some(vec![Part::new("to the stream's first bit", 2, 2)]),
        _ => None,
    }
}

/// The ways of a program whose periods, from its tick to its `wait`, take so many cycles, with the tick after the `wait`.
pub fn ways(wiring: &Wiring, (best, worst): (u64, u64)) -> Ways {
    let (mut inputs, mut outputs, mut others) = (Vec::new(), Vec::new(), Vec::new());
    let (mut reads, mut writes) = (0, 0);
    for peripheral in &wiring.peripherals {
        let name = || peripheral.name.clone();
        let mut is_way = false;
        for (register, port) in peripheral.kind.reads.iter().zip(&peripheral.reads) {
            let Some(port) = port else { continue };
            reads += 1;
            if let Some(parts) = edge_in(peripheral, register.name) {
                is_way = true;
                inputs.push(End { peripheral: name(), port: port.clone(), parts });
            }
        }
        for write in peripheral.writes.iter().flatten() {
            writes += 1;
            if let Some(parts) = edge_out(peripheral) {
                is_way = true;
                outputs.push(End { peripheral: name(), port: write.port.clone(), parts });
            }
        }
        if !is_way {
            others.push(name());
        }
    }
    let between = vec![
        Part::new("until the tick", 0, u64::from(wiring.period) - 1),
        Part::new(format!("registers to input ports ({reads})"), reads + BEGIN, reads + BEGIN),
        Part::new("the program, from tick to `wait`", best, worst),
        Part::new(format!("output ports to registers ({writes})"), writes + END, writes + END),
    ];
    Ways { inputs, between, outputs, others }
}
