#![allow(missing_docs, clippy::print_stdout)]
use takt_model::{functions::*, graph::*, robot::urdf};
fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let opt = |i: usize| a.get(i).map(String::as_str).filter(|t| *t != "-");
    let tree = urdf::read(&std::fs::read_to_string(&a[0]).unwrap(), 1e-6).unwrap();
    let robot = tree.robot(opt(3), opt(2)).unwrap();
    let delays = Delays::of(&takt_isa::T3);
    let options = Options { rewrites: Rewrites::ALL, delays, tip: opt(2).or(opt(4)), kp: 100.0, kd: 20.0 };
    let f = derive(&robot, What::from_name(&a[1]).unwrap(), &options).unwrap();
    if a.get(5).is_none() { print!("{}", takt_model::write::source(&f)); return; }
    // Assembly, until equations are there.
    println!(".schedule on");
    for p in &f.inputs { println!(".input {}", p.name); }
    for p in &f.outputs { println!(".output {}", p.0.name); }
    let n = |id: Id| match f.graph.node(id) { Node::Constant(b) => format!("{:?}", f64::from_bits(b)), Node::Input(i) => f.inputs[i as usize].name.clone(), _ => format!("t{}", id.index()) };
    let uses = f.graph.uses(&f.nodes());
    let live: Vec<usize> = (0..f.graph.len()).filter(|i| uses[*i] > 0 && f.graph.node_at(*i).operates()).collect();
    for i in &live { println!(".reg t{i}"); }
    println!(".period\nperiod:");
    for i in live { 
        let t = match f.graph.node_at(i) {
            Node::Unary(op, a) => format!("{} t{i}, {}", match op { Unary::Neg => "fneg", Unary::Sin => "fsin", Unary::Cos => "fcos", _ => "f?" }, n(a)),
            Node::Binary(op, a, b) => format!("{} t{i}, {}, {}", match op { Binary::Add => "fadd", Binary::Sub => "fsub", Binary::Mul => "fmul", Binary::Div => "fdiv", _ => "f?" }, n(a), n(b)),
            _ => panic!() };
        println!("  {t}");
    }
    for (p, id) in &f.outputs { println!("  mov {}, {}", p.name, n(*id)); }
    println!("  wait period");
}
