// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parts of a path within peripherals: from a pin's edge to a register, and from a register to a pin.

use super::pin_path::{Answer, End, Part, Sample};
use super::samples::significant;
use crate::carrier::Instant;
use crate::wiring::{Peripheral, Starts, Wiring};

/// Registers of `spi` with what the data lines bring.
pub(crate) const RECEIVED: &[&str] =
    &["received", "received2", "received3", "received4", "received5", "received6", "received7", "received8"];

/// Cycles from the put of a duty to the first cycle in which it can act.
const ACTS: u64 = 2;

fn parameter(peripheral: &Peripheral, name: &str) -> u64 {
    peripheral.parameter(name).into()
}

/// Frame of a converter or an encoder. The fall of the select pin, or of the clock, in the cycle after its start, is the sample.
pub(crate) struct Frame {
    /// Least and greatest cycles from the sample to the new values of the registers.
    pub(crate) cycles: [u64; 2],
    /// Cycles from the new values to the first cycle in which a start is not dropped.
    pub(crate) rest: u64,
    /// The greatest cycles, and the rest, as formulas.
    pub(crate) formulas: [&'static str; 2],
    /// Registers with what was sampled.
    registers: &'static [&'static str],
}

impl Frame {
    /// The register has what a frame of this peripheral samples.
    pub(crate) fn has(peripheral: &Peripheral, register: &str) -> bool {
        frame(peripheral).is_some_and(|frame| frame.registers.contains(&register))
    }
}

/// The frame of a peripheral, if the kind has frames.
pub(crate) fn frame(peripheral: &Peripheral) -> Option<Frame> {
    let [half, bits] = ["half", "bits"].map(|name| parameter(peripheral, name));
    Some(match peripheral.kind.name {
        "spi" => Frame {
            cycles: [half * (2 * bits + 1); 2],
            rest: 0,
            formulas: ["half · (2 · bits + 1)", ""],
            registers: RECEIVED,
        },
        "ssi" => {
            let is_double = parameter(peripheral, "double") == 1;
            let (line_bits, formula) = match is_double {
                true => (2 * bits + 1, "2 · half · (2 · bits + 1)"),
                false => (bits, "2 · half · bits"),
            };
            Frame {
                cycles: [2 * half * line_bits; 2],
                rest: parameter(peripheral, "pause"),
                formulas: [formula, "pause"],
                registers: &["position", "turns"],
            }
        }
        "biss-c" => Frame {
            // The shortest has no line and an acknowledge of one bit; the longest has its start bit as late as it may.
            cycles: [
                2 * half * (bits + 12) + 3,
                half * (2 * (parameter(peripheral, "wait") + bits) + 21) + 1,
            ],
            rest: half + parameter(peripheral, "timeout"),
            formulas: ["half · (2 · (wait + bits) + 21) + 1", "half + timeout"],
            registers: &["position", "turns", "error", "warning"],
        },
        _ => return None,
    })
}

/// Windows of a filter. Their centre is the sample.
pub(crate) struct Window {
    /// Cycles from a start to the centre of the window that begins.
    pub(crate) from_start: u64,
    /// Cycles from the centre to the new value.
    pub(crate) delay: u64,
    /// Cycles by which the centre may be off its place: the modulator's own clock.
    pub(crate) spread: u64,
    /// Cycles from window to window.
    pub(crate) every: u64,
}

/// The windows of a peripheral, if the kind has windows.
pub(crate) fn window(peripheral: &Peripheral) -> Option<Window> {
    if !peripheral.kind.strobes.window {
        return None;
    }
    let [half, osr, clock_in] = ["half", "osr", "clock"].map(|name| parameter(peripheral, name));
    // A bit is sampled at a rise of the clock, and taken at the next. The synchroniser delays the modulator's own clock by two cycles;
    // its first rise after a start comes half a period later on average.
    Some(Window {
        from_start: half * (3 * osr + 1) + if clock_in == 1 { half - 1 } else { 1 },
        delay: half * (3 * osr - 1) + 6 + 2 * clock_in,
        spread: half * clock_in,
        every: 2 * half * osr,
    })
}

/// Instant of a carrier at which windows start that are centred at the given one.
pub(crate) fn window_start(wiring: &Wiring, peripheral: &Peripheral, centre: Instant) -> Instant {
    let period = u64::from(wiring.carriers[centre.carrier].period());
    let before = window(peripheral).map_or(0, |window| window.from_start) % period;
    Instant { at: ((u64::from(centre.at) + period - before) % period) as u32, ..centre }
}

/// Parts from the centre of a filter's window to the board's tick.
fn filtered(wiring: &Wiring, peripheral: &Peripheral, window: &Window) -> Option<(Vec<Part>, Part)> {
    let Window { delay, spread, every, .. } = *window;
    let until = match peripheral.starts {
        Starts::At(centre) => {
            let to_tick = |cycles: u64| wiring.cycles_to_tick(centre, cycles as u32);
            let ((best, _), (_, worst)) = (to_tick(delay - spread), to_tick(delay + spread));
            [u64::from(best).saturating_sub(delay + spread), u64::from(worst) + spread - delay]
        }
        _ => [0, every - 1],
    };
    let text = format!("from the sample: group delay, {} MHz", significant(rate(wiring, peripheral)?));
    Some((vec![Part::new(text, delay, delay)], Part::new("until the tick", until[0], until[1])))
}

/// Rate of a peripheral's bits in MHz; `None` without frames.
pub(crate) fn rate(wiring: &Wiring, peripheral: &Peripheral) -> Option<f64> {
    let is_half_bit = peripheral.kind.parameters.iter().position(|parameter| parameter.is_half_bit)?;
    Some(wiring.clock / f64::from(2 * peripheral.parameters.get(is_half_bit).copied()?))
}

/// Cycles from the start of a frame to the first tick at least `least` cycles later; `None` for a start that follows the program.
fn start_to_tick(wiring: &Wiring, starts: Starts, least: u32) -> Option<(u32, u32)> {
    match starts {
        Starts::At(instant) => Some(wiring.cycles_to_tick(instant, least)),
        Starts::Lead => {
            let periods = least.saturating_sub(wiring.lead).div_ceil(wiring.period);
            let cycles = wiring.lead + periods * wiring.period;
            Some((cycles, cycles))
        }
        Starts::Publish | Starts::Never => None,
    }
}

/// Parts from the sample of a frame to the board's tick.
fn sampled(wiring: &Wiring, peripheral: &Peripheral, frame: &Frame) -> Option<(Vec<Part>, Part)> {
    let [least, most] = frame.cycles;
    // The sample comes a cycle after the start.
    let to_tick = |cycles: u64| start_to_tick(wiring, peripheral.starts, cycles as u32 + 1);
    let ((best, _), (_, worst)) = (to_tick(least)?, to_tick(most)?);
    let until = [best, worst].map(|cycles| u64::from(cycles) - 1 - least);
    let rate = rate(wiring, peripheral)?;
    let text = format!("from the sample: frame at {} MHz", significant(rate));
    Some((vec![Part::new(text, least, least)], Part::new("until the tick", until[0], until[1])))
}

/// Parts from a pin's edge to the register, and then to the board's tick, for peripherals with such an edge; and the sample that a
/// carrier starts, if any.
fn edge_in(
    wiring: &Wiring,
    peripheral: &Peripheral,
    register: &str,
) -> Option<(Vec<Part>, Part, Option<Sample>)> {
    if let Some(frame) = frame(peripheral).filter(|frame| frame.registers.contains(&register)) {
        let (parts, until) = sampled(wiring, peripheral, &frame)?;
        return Some((parts, until, Some(Sample::Frame)));
    }
    if let Some(window) = window(peripheral).filter(|_| register == "value") {
        let (parts, until) = filtered(wiring, peripheral, &window)?;
        return Some((parts, until, Some(Sample::Window)));
    }
    let cycles = match (peripheral.kind.name, register) {
        ("quadrature" | "step" | "hall", _) => parameter(peripheral, "filter") + 3,
        ("digital-in", "level") => parameter(peripheral, "hold") + 2,
        ("digital-in", _) => parameter(peripheral, "hold") + 3,
        _ => return None,
    };
    let mut parts = vec![Part::new(format!("edge to `{register}`"), cycles, cycles)];
    let Some(instant) = peripheral.latch else {
        return Some((parts, Part::new("until the tick", 0, u64::from(wiring.period) - 1), None));
    };
    let period = u64::from(wiring.carriers[instant.carrier].period());
    parts.push(Part::new("until the carrier's sample", 0, period - 1));
    let (best, worst) = wiring.cycles_to_tick(instant, 0);
    let until = Part::new("from the sample to the tick", best.into(), worst.into());
    Some((parts, until, Some(Sample::Latch)))
}

/// Update of half bridges on a carrier: the least and greatest cycles from a put to the instant at which it acts. The second pair is the
/// slack of the sums with `busy` (the least and greatest cycles from tick to put) against the cycles from the tick; 0 if `busy` is
/// unknown.
pub(crate) fn update(
    wiring: &Wiring,
    peripheral: &Peripheral,
    busy: Option<[u64; 2]>,
) -> ([u64; 2], [u64; 2]) {
    let Some(carrier) = peripheral.carrier else { return ([ACTS; 2], [0; 2]) };
    let half = u64::from(wiring.carriers[carrier].half);
    // Places at which an update acts: `from`, and every `every` cycles.
    let (from, every) = match parameter(peripheral, "update") {
        0 => return ([ACTS; 2], [0; 2]),
        1 => (0, 2 * half),
        2 => (half, 2 * half),
        _ => (0, half),
    };
    let wait = |at: u64| ACTS + (from + 2 * half * (at / half + 2) - at - ACTS) % every;
    let (Some([best, worst]), Some(ticks)) = (busy, wiring.tick_positions(carrier)) else {
        return ([ACTS, ACTS + every - 1], [0; 2]);
    };
    let (mut waits, mut acts) = ([u64::MAX, 0], [u64::MAX, 0]);
    for tick in ticks.into_iter().map(u64::from) {
        let [first, last] = [best, worst].map(|busy| busy + wait(tick + busy));
        let [least, most] = match first == last {
            true => [last - worst, first - best],
            // The puts lie before a place and after it.
            false => [ACTS, (first - best).max(ACTS + every - 1)],
        };
        waits = [waits[0].min(least), waits[1].max(most)];
        acts = [acts[0].min(first), acts[1].max(last)];
    }
    (waits, [acts[0] - (best + waits[0]), worst + waits[1] - acts[1]])
}

/// Cycles from the register to the pin's answer.
fn answer(
    wiring: &Wiring,
    peripheral: &Peripheral,
    register: &str,
    busy: Option<[u64; 2]>,
) -> Option<(Vec<Part>, Answer, Option<[u64; 2]>)> {
    let edge = |parts| Some((parts, Answer::Edge, None));
    match peripheral.kind.name {
        // An additional cycle of an odd pulse moves only its end, and the longest pulse with an end ends with the period. A long dead time
        // can move the beginning of the shortest remaining pulse, dead + 1 cycles about the middle, beyond that; and, by dead / 2 into the
        // next period, the rise of the lower switch in the shortest remaining gap. A switch that is to stay on comes on after the dead
        // time.
        "pwm" => {
            let (half, dead) = (parameter(peripheral, "half"), parameter(peripheral, "dead"));
            let has_low = peripheral.pins.get(1).is_some_and(Option::is_some);
            let high = (2 * half).max(half + 1 + dead - (dead + 2) / 2);
            let low = if has_low { 2 * half + dead.div_ceil(2) } else { 0 };
            // A longer dead time leaves neither pulse nor gap.
            let moves = if dead < 2 * half { high.max(low) } else { 0 }.max(dead + 1);
            edge(vec![
                Part::new("to the next period of the PWM", 2, 2 * half + 1),
                Part::new("its first edge that moves", 1, moves),
            ])
        }
        // A duty that differs by one cycle moves an edge of one half alone, which may just be past. A switch goes off at once; without the
        // low switches' pins an edge is seen after the dead time.
        // Switches that are on go off; what was stopped goes on at a valley.
        "pwm3" if register == "stop" => edge(vec![Part::new("until the switches go off", 2, 2)]),
        "pwm3" => {
            let half = peripheral.carrier.map_or(0, |carrier| u64::from(wiring.carriers[carrier].half));
            let has_low = [1, 3, 5].iter().all(|pin| peripheral.pins[*pin].is_some());
            let dead = if has_low { 0 } else { parameter(peripheral, "dead") };
            let ([best, worst], surplus) = update(wiring, peripheral, busy);
            let parts = vec![
                Part::new("until the duty acts", best, worst),
                Part::new("its first edge that moves", 1, 2 * half + dead),
            ];
            Some((parts, Answer::Edge, Some(surplus)))
        }
        "digital-out" => edge(vec![Part::new("to the pin", 1, 1)]),
        "sigma-delta" => Some((vec![Part::new("to the modulator", 1, 1)], Answer::Density, None)),
        // A converter's frames begin at ticks, or with the outputs, independent of values.
        _ => None,
    }
}

/// Input ports of a peripheral, with the end of paths at each; `None` without an edge to count from.
pub(super) fn inputs<'a>(
    wiring: &'a Wiring,
    peripheral: &'a Peripheral,
) -> impl Iterator<Item = (&'a str, Option<End>)> {
    let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
    registers.filter_map(move |(register, port)| {
        let port = port.as_deref()?;
        let end = edge_in(wiring, peripheral, register.name).map(|(parts, until, sample)| End {
            peripheral: peripheral.name.clone(),
            port: port.to_owned(),
            parts,
            answer: Answer::Edge,
            until,
            sample,
            update: None,
        });
        Some((port, end))
    })
}

/// Output ports of a peripheral, with the end of paths at each; `None` without an edge to count to. `busy` holds the least and greatest
/// cycles from the tick to the outputs' update, if known.
pub(super) fn outputs<'a>(
    wiring: &'a Wiring,
    peripheral: &'a Peripheral,
    busy: Option<[u64; 2]>,
) -> impl Iterator<Item = (&'a str, Option<End>)> {
    let registers = peripheral.kind.writes.iter().zip(&peripheral.writes);
    registers.filter_map(|(register, write)| Some((register.name, write.as_ref()?))).map(
        move |(name, write)| {
            let end = answer(wiring, peripheral, name, busy).map(|(parts, answer, update)| End {
                peripheral: peripheral.name.clone(),
                port: write.port.clone(),
                parts,
                answer,
                until: Part::sum("", []),
                sample: None,
                update,
            });
            (write.port.as_str(), end)
        },
    )
}

/// Peripherals of a wiring without a port at an end of a path.
pub(super) fn peripherals_without_path(wiring: &Wiring) -> Vec<String> {
    let is_other = |peripheral: &&Peripheral| {
        !inputs(wiring, peripheral).chain(outputs(wiring, peripheral, None)).any(|(_, end)| end.is_some())
    };
    wiring.peripherals.iter().filter(is_other).map(|peripheral| peripheral.name.clone()).collect()
}
