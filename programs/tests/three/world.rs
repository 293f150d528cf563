// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion in the world against binary64 kinematics.

use super::bench::{Bench, FINISHED, HOME, MOVEL, MotionFields, PeriodObservation, REFUSED, apart, fast};
use takt_programs::three::kinematics::{joints, pose};
use takt_programs::three::profile::{Course, Profile};
use takt_programs::three::{PERIOD, SixValues};

const TOOL: [f64; 3] = [0.0; 3];

/// Joint angles with their derivatives, by differences of the binary64 inverse along a line.
fn joint_motion_along(course: &Course, from: &SixValues, to: &SixValues, time: f64) -> [SixValues; 3] {
    let branch = pose(&HOME, &TOOL).1;
    let total = f64::from(course.periods) * PERIOD;
    let at = |time: f64| {
        let way = course.at(time)[0];
        let line = std::array::from_fn(|i| from[i] + (to[i] - from[i]) * way);
        joints(&line, &TOOL, branch).expect("the line is in reach")
    };
    let h = 2e-5;
    let time = time.clamp(h, total - h);
    let [before, here, after] = [at(time - h), at(time), at(time + h)];
    [
        here,
        std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * h)),
        std::array::from_fn(|i| (after[i] - 2.0 * here[i] + before[i]) / (h * h)),
    ]
}

fn line(bench: &mut Bench) -> (SixValues, SixValues) {
    let from = pose(&bench.last().q(), &TOOL).0;
    let mut to = from;
    for (i, by) in [0.02, 0.1, 0.05, 0.1, -0.08, 0.15].iter().enumerate() {
        to[i] = f64::from((to[i] + by) as f32);
    }
    (from, to)
}

#[test]
fn a_line_is_straight_and_its_joints_are_binary64s() {
    let mut bench = Bench::new();
    let (from, to) = line(&mut bench);
    let how = MotionFields { profile: Profile::Cosine, how: 0, amount: 0.5, flags: 0 };
    let sequence = bench.motion(MOVEL, to, how);
    bench.until(FINISHED, sequence);
    let seen = bench.since(sequence);
    // Ramps take a quarter of the time, since no limit intervenes here.
    let course = Course { ramp: 313, periods: 1250, profile: Profile::Cosine };
    let (mut off, mut worst, mut tool) = (0f64, [0f64; 3], 0f64);
    for (k, seen) in seen.iter().enumerate() {
        let [q, v, a] = joint_motion_along(&course, &from, &to, k as f64 * PERIOD);
        let here = pose(&seen.q(), &TOOL).0;
        let way = course.at(k as f64 * PERIOD)[0];
        let should: SixValues = std::array::from_fn(|i| from[i] + (to[i] - from[i]) * way);
        off = off.max(apart(&here, &should));
        tool = tool.max(apart(&seen.pose, &here));
        for (worst, (is, should)) in worst.iter_mut().zip([(seen.q(), q), (seen.v(), v), (seen.a(), a)]) {
            *worst = worst.max(apart(&is, &should));
        }
    }
    println!("pose {off:.2e} m and rad, joints {worst:?}, reported pose {tool:.2e}");
    assert!(off < 3e-6, "{off}");
    assert!(tool < 2e-6, "{tool}");
    // The acceleration is a difference over a period: it lags by half a period and is as noisy as the last digits of the velocity. The
    // servo compensates the resulting error of the nominal control, which is less than a count of the encoders.
    assert!(worst[0] < 5e-6 && worst[1] < 5e-5 && worst[2] < 0.2, "{worst:?}");
    let count = std::f64::consts::TAU / f64::from(1 << 18);
    let behind = worst[2] / (std::f64::consts::TAU * 15.0).powi(2);
    println!("the servo makes up for {behind:.2e} rad, a count is {count:.2e}");
    assert!(behind < count, "{behind}");
}

#[test]
fn a_square_is_gone_round_without_a_pause() {
    let mut bench = Bench::new();
    let (from, _) = line(&mut bench);
    let side = 0.06;
    let corners = [[0.0, side], [side, side], [side, 0.0], [0.0, 0.0]].map(|[y, z]| {
        let mut corner = from;
        corner[1] += y;
        corner[2] += z;
        corner
    });
    let mut sequences = Vec::new();
    for (number, corner) in corners.iter().enumerate() {
        let flags = u32::from(number < 3);
        sequences.push(bench.motion(
            MOVEL,
            *corner,
            MotionFields { profile: Profile::Parabolic, how: 1, amount: 0.3, flags },
        ));
    }
    bench.until(FINISHED, sequences[3]);
    let seen: Vec<PeriodObservation> = bench.since(sequences[0]).to_vec();
    let end = seen.iter().position(|seen| seen.mode == 0).expect("it has ended");
    let poses: Vec<SixValues> = seen[..end].iter().map(|seen| pose(&seen.q(), &TOOL).0).collect();
    let speeds: Vec<f64> = poses
        .windows(2)
        .map(|p| (0..3).map(|i| (p[1][i] - p[0][i]).powi(2)).sum::<f64>().sqrt() / PERIOD)
        .collect();
    let at_speed = |speed: &f64| *speed > 0.29;
    let first = speeds.iter().position(at_speed).expect("it gets there");
    let last = speeds.iter().rposition(at_speed).expect("it gets there");
    let inner = &speeds[first..last];
    // At a right corner both speeds are half: 0.707 of the full one, less where one ramp is longer.
    assert!(
        inner.iter().all(|speed| *speed > 0.12 && *speed < 0.31),
        "{:?}",
        inner.iter().copied().fold(f64::MAX, f64::min)
    );
    for pose in &poses {
        assert!(
            (pose[0] - from[0]).abs() < 3e-6
                && apart(
                    &[pose[3], pose[4], pose[5], 0.0, 0.0, 0.0],
                    &[from[3], from[4], from[5], 0.0, 0.0, 0.0]
                ) < 5e-6
        );
    }
    assert!(apart(&bench.last().pose, &from) < 3e-6);
}

#[test]
fn rejects_targets_out_of_reach() {
    let mut bench = Bench::new();
    let (from, _) = line(&mut bench);
    let mut far = from;
    far[0] += 1.0;
    let sequence = bench.motion(MOVEL, far, fast(Profile::Cosine));
    assert_eq!(bench.until(REFUSED, sequence).cause, 8);
    // The target is in reach, but the path there leads along joint 1's axis.
    let through: SixValues = std::array::from_fn(|i| if i < 2 { -from[i] } else { from[i] });
    let sequence = bench.motion(MOVEL, through, fast(Profile::Cosine));
    let cause = bench.until(REFUSED, sequence).cause;
    assert!([7, 8, 9].contains(&cause), "{cause}");
    // The wrist would become straight.
    let mut straight = bench.last().q();
    straight[4] = -0.02;
    let to = pose(&straight, &TOOL).0;
    let sequence = bench.motion(MOVEL, to, fast(Profile::Cosine));
    let cause = bench.until(REFUSED, sequence).cause;
    assert!([7, 9].contains(&cause), "{cause}");
    // In joint space, the report names the joint beyond its range.
    let mut beyond = HOME;
    beyond[1] = 3.0;
    let sequence = bench.motion(super::bench::MOVE, beyond, fast(Profile::Cosine));
    let report = bench.until(REFUSED, sequence);
    assert_eq!((report.cause, report.value), (7, 2.0));
    bench.run(40);
    assert_eq!((bench.last().mode, bench.last().v()), (0, [0.0; 6]));
}

#[test]
fn tool_offset_moves_the_controlled_point() {
    let mut bench = Bench::new();
    let tool = [0.01, -0.02, 0.08].map(|t: f32| f64::from(t));
    let sequence = bench.send(8, &super::bench::bits(&tool));
    bench.until(super::bench::ACCEPTED, sequence);
    bench.run(40);
    let from = pose(&bench.last().q(), &tool).0;
    assert!(apart(&bench.last().pose, &from) < 2e-6);
    let mut to = from;
    to[5] += 0.2;
    let sequence = bench.motion(
        MOVEL,
        to,
        MotionFields { profile: Profile::Trapezoidal, how: 0, amount: 0.3, flags: 0 },
    );
    bench.until(FINISHED, sequence);
    for seen in bench.since(sequence) {
        let here = pose(&seen.q(), &tool).0;
        assert!(
            (0..5).all(|i| (here[i] - from[i]).abs() < 5e-6),
            "the point stays while the tool turns: {here:?}"
        );
    }
}
