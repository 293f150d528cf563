// SPDX-License-Identifier: MIT OR Apache-2.0
//! Half bridges: voltages of their legs, over a period of the carrier or from switch to switch.
//!
//! In the dead time both switches of a leg are off, and the current's sign decides through which diode it goes on. Close to 0 the leg's
//! capacitance takes the current instead: between -`knee` and `knee` the voltage goes linearly from one rail to the other.

/// A leg for a stretch of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Voltage without current, as a part of the bridge's.
    pub level: f64,
    /// Part of the bridge's voltage that a current out of the leg takes from it, and a current into it adds.
    pub loss: f64,
}

impl Leg {
    /// Upper switch on.
    pub const HIGH: Leg = Leg { level: 1.0, loss: 0.0 };
    /// Lower switch on.
    pub const LOW: Leg = Leg { level: 0.0, loss: 0.0 };
    /// Both switches off.
    pub const OFF: Leg = Leg { level: 0.5, loss: 0.5 };

    /// Voltage as a part of the bridge's, for a current out of the leg.
    pub(super) fn voltage(self, current: f64, knee: f64) -> f64 {
        (self.level - self.loss * (current / knee).clamp(-1.0, 1.0)).clamp(0.0, 1.0)
    }
}

/// A duty as the bridge takes it: what is no number switches off.
fn limited(duty: f64) -> f64 {
    if duty.is_nan() { 0.0 } else { duty.clamp(0.0, 1.0) }
}

/// Legs for a whole period, in the mean. `dead` is the dead time as a part of the period. A leg that does not switch loses nothing.
pub(super) fn averaged(duties: [f64; 3], dead: f64) -> [Leg; 3] {
    duties.map(|duty| {
        let level = limited(duty);
        let switches = level > 0.0 && level < 1.0;
        Leg { level, loss: if switches { dead.min(1.0) } else { 0.0 } }
    })
}

/// Legs from edge to edge over a period in seconds, which begins in the middle of the lower switches' pulses: durations and states. The
/// switch that is to go on waits for the dead time, a lower one of the period before, whose duties are taken to be the same, into this one.
pub(super) fn switched<const N: usize>(duties: [f64; N], dead: f64, period: f64) -> Vec<(f64, [Leg; N])> {
    let pulses = duties.map(|duty| {
        let half = 0.5 * period * limited(duty);
        (0.5 * period - half, 0.5 * period + half)
    });
    let legs = |at: f64| {
        pulses.map(|(rise, fall)| match () {
            // A leg whose duty is 0 or 1 does not switch.
            () if rise <= 0.0 => Leg::HIGH,
            () if fall <= rise => Leg::LOW,
            () if at < fall + dead - period => Leg::OFF,
            () if at < rise => Leg::LOW,
            () if at < rise + dead => Leg::OFF,
            () if at < fall => Leg::HIGH,
            () if at < fall + dead => Leg::OFF,
            () => Leg::LOW,
        })
    };
    let edges = |&(rise, fall): &(f64, f64)| [rise, rise + dead, fall, fall + dead, fall + dead - period];
    let mut edges: Vec<f64> = pulses.iter().flat_map(edges).filter(|at| (0.0..period).contains(at)).collect();
    edges.extend([0.0, period]);
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    let stretches = edges.iter().zip(edges.iter().skip(1));
    stretches.map(|(&from, &to)| (to - from, legs(from))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_lie_in_the_middle_and_wait_for_the_dead_time() {
        let of = |duty: f64| -> Vec<(f64, Leg)> {
            let mut all: Vec<(f64, Leg)> = Vec::new();
            for (duration, [leg, ..]) in switched([duty, 0.0, 1.0], 0.125, 2.0) {
                match all.last_mut() {
                    Some((sum, last)) if *last == leg => *sum += duration,
                    _ => all.push((duration, leg)),
                }
            }
            all
        };
        use Leg as L;
        let whole = [(0.5, L::LOW), (0.125, L::OFF), (0.875, L::HIGH), (0.125, L::OFF), (0.375, L::LOW)];
        assert_eq!(of(0.5), whole);
        assert_eq!(
            (of(0.0), of(1.0), of(f64::NAN)),
            (vec![(2.0, L::LOW)], vec![(2.0, L::HIGH)], vec![(2.0, L::LOW)])
        );
        // A gap as short as the dead time is never low, a pulse as short never high; the dead time of a longer gap goes on in the next period.
        assert_eq!(of(1.0 - 0.0625), [(0.1875, L::OFF), (1.75, L::HIGH), (0.0625, L::OFF)]);
        assert_eq!(of(0.0625), [(0.9375, L::LOW), (0.25, L::OFF), (0.8125, L::LOW)]);
        assert_eq!(of(1.0 - 0.09375)[..2], [(0.03125, L::OFF), (0.0625, L::LOW)]);
        let total: f64 = switched([0.3, 0.71, 0.11], 0.125, 2.0).iter().map(|(duration, _)| duration).sum();
        assert!((total - 2.0).abs() < 1e-15);
    }

    #[test]
    fn mean_of_the_switches_is_the_averaged_voltage() {
        for (duties, currents) in [([0.3, 0.5, 0.8], [1.0, -2.0, 1.0]), ([0.02, 0.98, 0.5], [-0.3, 0.0, 0.3])]
        {
            let mean = averaged(duties, 0.01).map(|leg| leg);
            for phase in 0..3 {
                let stretches = switched(duties, 0.02, 2.0);
                let sum: f64 =
                    stretches.iter().map(|(d, legs)| d * legs[phase].voltage(currents[phase], 0.5)).sum();
                assert!((sum / 2.0 - mean[phase].voltage(currents[phase], 0.5)).abs() < 1e-12, "{phase}");
            }
        }
    }
}
