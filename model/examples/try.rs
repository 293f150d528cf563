#![allow(missing_docs, clippy::print_stdout)]
use takt_model::{functions::inverse, graph::*, robot::{frames::Layout, urdf}};
fn main() {
    let mut args = std::env::args().skip(1);
    let file = args.next().unwrap();
    let tip = args.next();
    let base = args.next();
    let tree = urdf::read(&std::fs::read_to_string(&file).unwrap(), 1e-6).unwrap();
    let robot = tree.robot(base.as_deref(), tip.as_deref()).unwrap();
    println!("{:?}", robot.notes);
    let delays = Delays::of(&takt_isa::T3);
    let layout = Layout::new(&robot);
    for link in takt_model::robot::frames::place(&robot, &layout) {
        println!("{} par {} sign {} off {:.4} axis {:?} origin {:?} m {:.3} ms {:?} S {:?}", link.name, link.parallel, link.sign, link.offset, link.axis, link.origin, link.body.mass, link.body.first, link.body.second);
    }
    for sums in [false, true] {
        let f = inverse::attempt(&robot, Rewrites::ALL, &layout, sums);
        println!("raw {:?} {} depth {}", f.count(), f.count().total(), f.depth(&delays));
        let n = robot.joints.len();
        let x: Vec<f64> = (0..3*n).map(|i| ((i * 37 % 19) as f64 - 9.0) / 7.0).collect();
        println!("{:?}", f.evaluate(&x));
        let f = f.optimised(&delays);
        println!("opt {:?} {} depth {}", f.count(), f.count().total(), f.depth(&delays));
        println!("{:?}", f.evaluate(&x));
    }
}
