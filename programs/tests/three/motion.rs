// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion in joint space against the binary64 synthesis; limits; stops.

use super::bench::{
    ACCEPTED, Bench, CHECKED, FINISHED, HOME, MOVE, MotionFields, PeriodObservation, REFUSED, STARTED, STOP,
    STOPPED, apart, bits, fast,
};
use takt_programs::three::dynamics::nominal;
use takt_programs::three::plan::{Demand, Limits, admissible, course};
use takt_programs::three::profile::{Course, Profile};
use takt_programs::three::synthesis::{Motion, Segment};
use takt_programs::three::{DA, DB, DC, PERIOD, SixValues, TORQUES, VELOCITIES};

const LIMITS: Limits = Limits { velocities: VELOCITIES, torques: TORQUES };

/// Target at a distance from another, joint by joint, in binary32.
fn away(from: &SixValues, by: SixValues) -> SixValues {
    std::array::from_fn(|i| f64::from((from[i] + by[i]) as f32))
}

/// Planned course of the core, by the binary64 model.
fn planned(from: &SixValues, to: &SixValues, demand: Demand, profile: Profile, via: bool) -> Course {
    let way = |sigma: f64| std::array::from_fn(|i| from[i] + (to[i] - from[i]) * sigma);
    let (speed, acceleration) = admissible(way, false, &LIMITS, 32);
    let share = if via { 0.5 } else { 1.0 };
    course(demand, profile, (speed * 0.999, acceleration * 0.95 * share)).expect("it is possible")
}

/// Errors of angles, velocities and accelerations against a motion that began in the first observed period. Accelerations in the periods
/// `steps` are skipped, since they jump there.
fn errors(seen: &[PeriodObservation], motion: &Motion, steps: &[u32]) -> [f64; 3] {
    let mut worst = [0f64; 3];
    for (k, seen) in seen.iter().enumerate() {
        let at = motion.at(k as f64 * PERIOD);
        worst[0] = worst[0].max(apart(&seen.q(), &at[0]));
        worst[1] = worst[1].max(apart(&seen.v(), &at[1]));
        if !steps.contains(&(k as u32)) {
            worst[2] = worst[2].max(apart(&seen.a(), &at[2]));
        }
    }
    worst
}

/// The motion follows the planned course, or a neighbour: where a duration in binary64 is a whole number of periods, binary32 may round it
/// up. `allowed` limits the errors: rad, rad/s, rad/s².
fn matches(seen: &[PeriodObservation], from: SixValues, to: SixValues, course: Course, allowed: [f64; 3]) {
    let neighbours = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(ramp, periods)| Course {
        ramp: course.ramp + ramp,
        periods: course.periods + periods,
        ..course
    });
    let all = neighbours.map(|course| {
        let steps = [0, course.ramp, course.periods - course.ramp, course.periods];
        let steps = if course.profile == Profile::Rectangular { &steps[..] } else { &[] };
        errors(seen, &Motion::new(from, &[Segment { to, course, via: false }]), steps)
    });
    let best = all.iter().min_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1]))).expect("there are four");
    println!("{course:?}: {best:?}");
    assert!((0..3).all(|i| best[i] <= allowed[i]), "{course:?}: {best:?}");
}

#[test]
fn each_profile_is_its_binary64_model() {
    let mut bench = Bench::new();
    let mut from = bench.last().q();
    for (number, profile) in Profile::ALL.into_iter().enumerate() {
        let sign = if number % 2 == 0 { 1.0 } else { -1.0 };
        let to = away(&HOME, [0.2, -0.1, 0.12, 0.3, 0.2, -0.25].map(|by: f64| by * sign));
        let sequence = bench.motion(MOVE, to, fast(profile));
        let accepted = bench.until(ACCEPTED, sequence);
        bench.until(FINISHED, sequence);
        let seen = bench.since(sequence);
        let course = planned(&from, &to, Demand::Fast, profile, false);
        let expected = f64::from(course.periods) * PERIOD;
        assert!((f64::from(accepted.value) - expected).abs() < 1.5 * PERIOD, "{accepted:?}, not {expected}");
        matches(seen, from, to, course, [3e-7, 1e-5, 2e-3]);
        continuous(seen, course, &from, &to);
        assert_eq!(
            seen.last().expect("some").q(),
            to.map(|to| f64::from(to as f32)),
            "it ends exactly there"
        );
        from = to;
    }
}

/// Checks continuity: of the velocity, of the acceleration except with the rectangular profile, and of the jerk with the cosine profile.
fn continuous(seen: &[PeriodObservation], course: Course, from: &SixValues, to: &SixValues) {
    let longest = apart(from, to);
    let ramp = f64::from(course.ramp) * PERIOD;
    let rate = longest / (f64::from(course.periods) * PERIOD - ramp) / ramp;
    // Largest slope of the pulse, and of its derivative, over the ramp.
    let (slope, bend) = match course.profile {
        Profile::Rectangular => (f64::INFINITY, f64::INFINITY),
        Profile::Trapezoidal => (course.profile.top() / 0.25, f64::INFINITY),
        Profile::Parabolic => (6.0, f64::INFINITY),
        Profile::Cosine => (std::f64::consts::TAU, std::f64::consts::TAU.powi(2)),
    };
    let part = PERIOD / ramp;
    for window in seen.windows(3) {
        let [a, b, c] = [0, 1, 2].map(|i| &window[i]);
        assert!(apart(&a.v(), &b.v()) <= rate * course.profile.top() * PERIOD * 1.001 + 1e-5);
        assert!(apart(&a.a(), &b.a()) <= rate * slope * part * 1.001 + 1e-3, "{course:?}");
        let second: SixValues = std::array::from_fn(|i| a.a()[i] - 2.0 * b.a()[i] + c.a()[i]);
        assert!(apart(&second, &[0.0; 6]) <= rate * bend * part * part * 1.001 + 2e-3, "{course:?}");
    }
}

#[test]
fn times_are_met_and_speeds_are_reached() {
    let mut bench = Bench::new();
    let from = bench.last().q();
    let to = away(&from, [0.1, 0.0, 0.05, -0.1, 0.0, 0.02]);
    let how = MotionFields { profile: Profile::Parabolic, how: 0, amount: 0.25, flags: 0 };
    let sequence = bench.motion(MOVE, to, how);
    bench.until(FINISHED, sequence);
    let moving = bench.seen.iter().filter(|seen| seen.mode == 1).count();
    assert_eq!(moving, 625, "0.25 s");
    let course = planned(&from, &to, Demand::Time(0.25), Profile::Parabolic, false);
    matches(bench.since(sequence), from, to, course, [3e-7, 1e-5, 2e-3]);
    // Speed refers to the fastest joint.
    let back = bench.motion(MOVE, from, MotionFields { how: 1, amount: 0.7, ..how });
    bench.until(FINISHED, back);
    let fastest =
        bench.since(back).iter().flat_map(PeriodObservation::v).fold(0.0, |a: f64, v| a.max(v.abs()));
    assert!((0.695..=0.7).contains(&fastest), "{fastest}");
    // Checked motions do not move the robot.
    let checked = bench.motion(MOVE, to, MotionFields { flags: 2, ..how });
    let report = bench.until(CHECKED, checked);
    assert!((report.value - 0.25).abs() < 1e-6);
    bench.run(100);
    assert_eq!(bench.last().mode, 0);
    // NaN in a target keeps the joint's present value.
    let mut part = [f64::NAN; 6];
    part[2] = to[2];
    let sequence = bench.motion(MOVE, part, fast(Profile::Cosine));
    bench.until(FINISHED, sequence);
    let mut expected = from;
    expected[2] = to[2];
    assert!(apart(&bench.last().q(), &expected) < 1e-7);
}

#[test]
fn via_points_are_passed_without_a_pause() {
    let mut bench = Bench::new();
    let from = bench.last().q();
    let corners = [
        [0.15, 0.0, 0.0, 0.1, 0.0, 0.0],
        [0.2, -0.12, 0.05, 0.2, 0.0, 0.1],
        [0.05, -0.2, 0.1, 0.1, -0.1, 0.2],
    ];
    let targets = corners.map(|by| away(&from, by));
    let mut last = from;
    let (mut segments, mut sequences) = (Vec::new(), Vec::new());
    for (number, to) in targets.iter().enumerate() {
        let via = number < 2;
        let flags = u32::from(via);
        sequences.push(bench.motion(MOVE, *to, MotionFields { flags, ..fast(Profile::Trapezoidal) }));
        let course = planned(&last, to, Demand::Fast, Profile::Trapezoidal, true);
        segments.push(Segment { to: *to, course, via });
        last = *to;
    }
    bench.until(FINISHED, sequences[2]);
    assert!(bench.reports.iter().all(|report| report.kind != STOPPED), "{:?}", bench.reports);
    let motion = Motion::new(from, &segments);
    let seen: Vec<PeriodObservation> = bench.since(sequences[0]).to_vec();
    let moving = seen.iter().position(|seen| seen.mode == 0).expect("it has ended");
    // A course longer by a period shifts its successors: check durations to 3 periods, and the shape by its continuity.
    assert!((moving as i64 - i64::from(motion.periods())).abs() <= 3, "{moving}, {}", motion.periods());
    let speed = |seen: &PeriodObservation| seen.v().iter().map(|v| v * v).sum::<f64>().sqrt();
    let top = seen.iter().map(speed).fold(0.0, f64::max);
    let ramp = segments[0].course.ramp as usize;
    let slowest =
        seen[ramp..moving - segments[2].course.ramp as usize].iter().map(speed).fold(f64::MAX, f64::min);
    assert!(slowest > 0.25 * top, "slows down to {slowest} of {top}");
    for pair in seen.windows(2) {
        assert!(apart(&pair[0].v(), &pair[1].v()) < 0.02 && apart(&pair[0].a(), &pair[1].a()) < 3.0);
    }
    // Corners are rounded by less than the distance of a ramp.
    for corner in &targets[..2] {
        let nearest = seen.iter().map(|seen| apart(&seen.q(), corner)).fold(f64::MAX, f64::min);
        assert!(nearest > 1e-4 && nearest < 0.06, "{nearest}");
    }
    within_limits(&seen, &TORQUES, 1.0);
    assert_eq!(bench.last().q(), targets[2].map(|to| f64::from(to as f32)));
}

/// Torques by the binary64 dynamics stay within a fraction of the limits. Returns the largest fraction used.
fn within_limits(seen: &[PeriodObservation], torques: &SixValues, part: f64) -> f64 {
    let mut used = 0f64;
    for seen in seen {
        let torque = nominal(&seen.q()).torques(&seen.a());
        for i in 0..6 {
            used = used.max(torque[i].abs() / torques[i]);
        }
    }
    assert!(used <= part, "uses {used} of a torque");
    used
}

#[test]
fn torque_limits_are_met_and_hit() {
    let mut bench = Bench::new();
    let from = bench.last().q();
    let to = away(&from, [0.3, 0.1, 0.0, 0.0, 0.0, 0.0]);
    let sequence = bench.motion(MOVE, to, fast(Profile::Rectangular));
    let free = bench.until(ACCEPTED, sequence).value;
    bench.until(FINISHED, sequence);
    // With pace `fast`, torques come close to the limit and do not exceed it.
    assert!(within_limits(bench.since(sequence), &TORQUES, 1.0) > 0.9);
    // Half the time is refused, with joint 1 as the cause.
    let how = MotionFields { profile: Profile::Rectangular, how: 0, amount: f64::from(free) / 2.0, flags: 0 };
    let refused = bench.motion(MOVE, from, how);
    let report = bench.until(REFUSED, refused);
    assert_eq!((report.cause, report.value), (11, 1.0));
    // Limits lowered during a motion take effect: the nominal torque is held at the limit.
    let back = bench.motion(MOVE, from, fast(Profile::Rectangular));
    bench.until(STARTED, back);
    let mut lower = TORQUES;
    lower[0] = 60.0;
    let limits = bench.send(9, &bits(&[VELOCITIES, lower].concat()));
    bench.until(ACCEPTED, limits);
    bench.until(FINISHED, back);
    let mut held = 0;
    for seen in &bench.since(back)[40..] {
        let torque = nominal(&seen.q()).torques(&seen.a())[0].clamp(-60.0, 60.0);
        let point = seen.points[0];
        assert!((point.u - (DA * torque + DB * point.v + DC * point.a)).abs() < 1e-4, "{point:?} {torque}");
        held += usize::from(torque.abs() == 60.0);
    }
    assert!(held > 100, "{held}");
    // Planning with lowered limits takes longer.
    let slower = bench.motion(MOVE, to, fast(Profile::Rectangular));
    let value = bench.until(ACCEPTED, slower).value;
    assert!(value > free * 1.5, "{value} {free}");
    // Limits above the built-in ones are refused, with the joint.
    let mut higher = TORQUES;
    higher[3] = 20.0;
    let limits = bench.send(9, &bits(&[VELOCITIES, higher].concat()));
    let report = bench.until(REFUSED, limits);
    assert_eq!((report.cause, report.value), (11, 4.0));
}

#[test]
fn a_stop_stays_on_the_path_and_within_the_torques() {
    let mut bench = Bench::new();
    let from = bench.last().q();
    let to = away(&from, [0.8, -0.3, 0.2, 0.4, 0.2, -0.6]);
    let sequence = bench.motion(MOVE, to, fast(Profile::Cosine));
    bench.until(STARTED, sequence);
    bench.run(1600);
    let before = bench.seen.len();
    let stop = bench.send(STOP, &[]);
    let report = bench.until(STOPPED, stop);
    assert_eq!(report.cause, 0);
    bench.run(40);
    let seen: Vec<PeriodObservation> = bench.seen[before..].to_vec();
    let stopping = seen.iter().filter(|seen| seen.mode == 3).count();
    assert!(stopping > 20 && stopping < 400, "{stopping} periods");
    for seen in &seen {
        let part = (seen.q()[0] - from[0]) / (to[0] - from[0]);
        let on_path = away(&from, std::array::from_fn(|i| (to[i] - from[i]) * part));
        assert!(apart(&seen.q(), &on_path) < 2e-6);
    }
    let used = within_limits(&seen, &TORQUES, 1.0);
    assert!(used > 0.9, "as fast as may be: {used}");
    for pair in seen.windows(2) {
        assert!(apart(&pair[0].v(), &pair[1].v()) < 0.03, "velocities have no step");
    }
    assert_eq!((bench.last().mode, bench.last().v()), (0, [0.0; 6]));
    // The stop has emptied the queue, and the next motion begins at the present position.
    let next = bench.motion(
        MOVE,
        from,
        MotionFields { profile: Profile::Trapezoidal, how: 1, amount: 2.0, flags: 0 },
    );
    bench.until(FINISHED, next);
    assert!(apart(&bench.last().q(), &from) < 1e-6);
}
