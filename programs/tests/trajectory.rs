// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed profiles: continuity, limits, and special moves.

use takt_programs::AGH;
use takt_programs::gcode;
use takt_programs::hybrid::Reference;
use takt_programs::trajectory::{MAX_PERIODS, Sample, Trajectory, TrajectoryError};

const TS: f64 = 1e-4;

fn plan(source: &str) -> Trajectory {
    Trajectory::plan(&gcode::read(source).expect("a sound program")).expect("a short program")
}

/// Position, velocity and acceleration of the five axes.
fn axes(r: &Reference<f64>) -> [[f64; 3]; 5] {
    std::array::from_fn(|i| match i {
        0..3 => [r.position[i], r.velocity[i], r.acceleration[i]],
        _ => [r.angle[i - 3], r.angular_velocity[i - 3], r.angular_acceleration[i - 3]],
    })
}

fn assert_continuous(trajectory: &Trajectory) {
    let mut previous: Option<Sample> = None;
    for sample in trajectory.samples() {
        if let Some(previous) = previous {
            for (before, after) in axes(&previous.reference).iter().zip(axes(&sample.reference)) {
                // The trapezoidal rule errs by the curvature of the velocity: jerk·Ts³/12, and up to 1400 rad/s³ on rapid turns.
                let mean = 0.5 * (before[1] + after[1]);
                assert!((after[0] - before[0] - mean * TS).abs() < 2e-10, "{previous:?} {sample:?}");
                // The trapezoidal rule errs by the kink of the acceleration at a ramp's end: jerk·Ts²/8.
                let mean = 0.5 * (before[2] + after[2]);
                assert!((after[1] - before[1] - mean * TS).abs() < 2e-6, "{previous:?} {sample:?}");
            }
        }
        previous = Some(sample);
    }
}

#[test]
fn agh_is_continuous() {
    assert_continuous(&plan(AGH));
}

#[test]
fn arcs_and_helices_are_continuous() {
    let trajectory = plan(
        "G0 X0 Y0 Z700\n\
         G0 X40 Y0 F1500\n\
         G3 X0 Y40 I-40 J0 Z710 A10\n\
         G2 X-20.001 Y20 R20\n\
         G3 X-20 Y-20 R-30 C90\n\
         G2 X-20 Y-20 I15 J5",
    );
    assert_continuous(&trajectory);
    let end = trajectory.samples().last().expect("not empty").reference;
    for (a, b) in end.position.iter().zip([-0.020, -0.020, 0.71]) {
        assert!((a - b).abs() < 1e-9, "{end:?}");
    }
}

#[test]
fn moves_start_and_end_at_rest() {
    let trajectory = plan("G0 X0 Y0 Z700 A5 C10\nG1 X10 F2000\nG0 Y7 C30");
    let mut move_index = usize::MAX;
    for sample in trajectory.samples() {
        if sample.move_index != move_index {
            move_index = sample.move_index;
            let r = sample.reference;
            assert_eq!((r.velocity, r.angular_velocity), ([0.0; 3], [0.0; 2]));
            assert_eq!((r.acceleration, r.angular_acceleration), ([0.0; 3], [0.0; 2]));
        }
    }
    let first = trajectory.samples().next().expect("not empty");
    assert_eq!(first.reference.position, [0.0, 0.0, 0.7]);
    assert_eq!(first.reference.angle, [5.0f64.to_radians(), 10.0f64.to_radians()]);
    assert_eq!((first.cutting, first.line), (true, 2));
    assert_eq!(trajectory.samples().last().map(|sample| (sample.cutting, sample.line)), Some((false, 3)));
}

/// Largest tool speed (m/s), largest tool acceleration (m/s²) and largest table speed (rad/s).
fn peaks(trajectory: &Trajectory) -> [f64; 3] {
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    trajectory.samples().fold([0.0; 3], |[v, a, w], sample| {
        let r = sample.reference;
        let spin = r.angular_velocity.iter().fold(0.0f64, |max, w| max.max(w.abs()));
        [v.max(norm(&r.velocity)), a.max(norm(&r.acceleration)), w.max(spin)]
    })
}

fn assert_near(measured: f64, expected: f64) {
    assert!((measured / expected - 1.0).abs() < 1e-3, "{measured} is not near {expected}");
}

#[test]
fn feed_is_reached_over_a_cosine_ramp() {
    use std::f64::consts::PI;
    // Duration L/V + Tr = 0.9 s + 0.03 s.
    let cut = plan("G0 X0 Y0 Z700\nG1 X30 F2000");
    assert_eq!(cut.periods(), 9300);
    let [speed, acceleration, _] = peaks(&cut);
    assert_near(speed, 2.0 / 60.0);
    assert_near(acceleration, 0.5 * PI / 0.03 * 2.0 / 60.0);
    // Duration 0.15 s + 0.06 s.
    let rapid = plan("G0 X0 Y0 Z700\nG0 X30");
    assert_eq!(rapid.periods(), 2100);
    let [speed, acceleration, _] = peaks(&rapid);
    assert_near(speed, 0.2);
    assert_near(acceleration, 0.5 * PI / 0.06 * 0.2);
}

#[test]
fn short_moves_only_ramp() {
    let short = plan("G0 X0 Y0 Z700\nG0 X6");
    assert_eq!(short.periods(), 1200, "two ramps of 0.06 s");
    assert_near(peaks(&short)[0], 0.1);
}

#[test]
fn durations_are_stretched_to_whole_periods() {
    // Duration of 0.0100123 m at 1/30 m/s with a ramp: 3303.69 periods.
    let stretched = plan("G0 X0 Y0 Z700\nG1 X10.0123 F2000");
    assert_eq!(stretched.periods(), 3304);
    let middle = stretched.samples().nth(1652).expect("in range").reference;
    assert!((middle.position[0] - 0.5 * 0.0100123).abs() < 1e-15, "the middle stays the middle");
    assert!((middle.velocity[0] - 2.0 / 60.0 * 3303.69 / 3304.0).abs() < 1e-12);
}

#[test]
fn rotation_sets_the_pace_where_it_dominates() {
    use std::f64::consts::PI;
    let quarter = plan("G0 X0 Y0 Z700\nG0 X5 C90 A-20");
    // Rotary speed: 0.2 m per rad at 0.2 m/s gives 1 rad/s.
    assert_eq!(quarter.periods(), ((0.5 * PI + 0.06) / TS).ceil() as u64);
    assert_near(peaks(&quarter)[2], 1.0);
    let tool = plan("G0 X0 Y0 Z700\nG0 X50 C1");
    assert_near(peaks(&tool)[0], 0.2);
}

#[test]
fn moves_to_the_same_place_vanish() {
    let trajectory = plan("G0 X0 Y0 Z700\nG0 X0\nG1 Y0 F100\nG0 X20");
    assert_eq!(trajectory.periods(), 1600);
    assert_eq!(trajectory.samples().next().map(|sample| (sample.move_index, sample.line)), Some((2, 4)));
    let still = plan("G0 X0 Y0 Z700");
    assert_eq!((still.periods(), still.samples().next()), (0, None));
}

#[test]
fn endless_paths_are_refused() {
    for feed in ["F0.001", "F0.00000000000000001"] {
        let source = format!("G0 X0 Y0 Z700\nG1 X10 F500\nG1 X100 {feed}");
        let program = gcode::read(&source).expect("sound");
        assert_eq!(Trajectory::plan(&program), Err(TrajectoryError::TooLong { line: 3 }));
    }
    let error = TrajectoryError::TooLong { line: 3 };
    assert_eq!(error.to_string(), "line 3: the path takes more than 3600 s up to here; give a higher feed");
    assert_eq!(MAX_PERIODS, 36_000_000);
}
