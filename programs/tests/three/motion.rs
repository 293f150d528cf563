//! Motion in joint space against the binary64 synthesis, and the servo along it.

use crate::bench::{ACCEPTED, Bench, FINISHED, HOME, How, MOVE, MOVEL, REFUSED, STARTED, apart, fast};
use takt_programs::three::profile::Profile;

#[test]
fn probe() {
    let mut bench = Bench::new();
    let mut target = HOME;
    target[0] += 0.5;
    target[3] -= 0.4;
    let sequence = bench.motion(MOVE, target, fast(Profile::Trapezoidal));
    bench.run(6000);
    println!("{:?}", bench.reports);
    println!("{:?}", bench.longest_periods());
    for seen in bench.from_segment(sequence).iter().step_by(60).take(20) {
        println!("{} {:?} {:?} {:?} {:?}", seen.mode, seen.q(), seen.v(), seen.a(), seen.pose);
    }
    let worst = bench
        .servo
        .iter()
        .map(|(_, n, _, r)| {
            (0..6)
                .map(|i| (r[i] - f64::from(n[i]) * takt_programs::three::servo::COUNT).abs())
                .fold(0.0, f64::max)
        })
        .fold(0.0, f64::max);
    println!("{worst} {:?}", bench.servo.last());
    let mut bench = Bench::new();
    let pose = takt_programs::three::kinematics::pose(&HOME, &[0.0; 3]).0;
    let mut to = pose;
    to[1] += 0.1;
    to[2] += 0.05;
    to[5] += 0.2;
    println!("{pose:?}");
    let sequence = bench.motion(MOVEL, to, How { profile: Profile::Cosine, how: 0, amount: 0.6, flags: 0 });
    bench.run(8000);
    println!("{:?}", bench.reports);
    for seen in bench.from_segment(sequence).iter().step_by(100).take(20) {
        println!("{} {:?} {:?} {:?} {:?}", seen.mode, seen.q(), seen.v(), seen.a(), seen.pose);
    }
    let _ = (ACCEPTED, FINISHED, REFUSED, STARTED, apart);
}
