#![allow(missing_docs, clippy::print_stdout)]
use takt_model::{functions::*, graph::*, robot::urdf};
fn main() {
    let mut args = std::env::args().skip(1);
    let file = args.next().unwrap();
    let tip = args.next().filter(|t| t != "-");
    let base = args.next().filter(|t| t != "-");
    let end = args.next().or(tip.clone());
    let tree = urdf::read(&std::fs::read_to_string(&file).unwrap(), 1e-6).unwrap();
    let robot = tree.robot(base.as_deref(), tip.as_deref()).unwrap();
    let delays = Delays::of(&takt_isa::T3);
    let mut options = Options { rewrites: Rewrites::ALL, delays, tip: end.as_deref(), kp: 100.0, kd: 20.0 };
    for (what, name, _) in What::ALL {
        let f = derive(&robot, what, &options).unwrap();
        let c = f.count();
        println!("{name:20} total {:4}  add {} mul {} div {} trig {} other {} depth {}", c.total(), c.add, c.mul, c.div, c.trig, c.other, f.depth(&delays));
        options.rewrites.scale = false;
        let g = derive(&robot, what, &options).unwrap();
        println!("{:20} without scale {:4}", "", g.count().total());
        options.rewrites.scale = true;
    }
}
