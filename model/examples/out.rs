#![allow(missing_docs, clippy::print_stdout)]
use takt_model::{functions::*, graph::*, robot::urdf};
fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let opt = |i: usize| a.get(i).map(String::as_str).filter(|t| *t != "-");
    let tree = urdf::read(&std::fs::read_to_string(&a[0]).unwrap(), 1e-6).unwrap();
    let robot = tree.robot(opt(3), opt(2)).unwrap();
    let delays = Delays::of(&takt_isa::T3);
    let options = Options { rewrites: Rewrites::ALL, delays, tip: opt(2).or(opt(4)), kp: 100.0, kd: 20.0 };
    for (what, name, _) in What::ALL {
        if a[1] != "all" && a[1] != name {
            continue;
        }
        let f = derive(&robot, what, &options).unwrap();
        if a[1] != "all" {
            print!("{}", takt_model::write::source(&f));
            continue;
        }
        let c = f.count();
        println!(
            "{name:20} total {:4}  add {} mul {} div {} trig {} other {} depth {}",
            c.total(),
            c.add,
            c.mul,
            c.div,
            c.trig,
            c.other,
            f.depth(&delays)
        );
    }
}
