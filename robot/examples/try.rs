use std::sync::Arc;
use std::time::Instant;
use takt_robot::controller::{Controller, standard};
use takt_robot::level::{Files, Session};
struct No;
impl Files for No {
    fn read(&self, name: &str) -> Result<String, String> { std::fs::read_to_string(name).map_err(|e| e.to_string()) }
    fn write(&self, _: &str, _: &str) -> Result<(), String> { Ok(()) }
}
#[allow(clippy::print_stdout)]
fn main() {
    let t = Instant::now();
    let d = standard().unwrap_or_else(|e| panic!("{e}"));
    println!("assembled {:?}", t.elapsed());
    let c = Controller::new(&d, takt_robot::plant::Plant::standard()).unwrap();
    let t = Instant::now();
    let mut s = Session::new(c, Arc::new(No), Arc::default()).unwrap();
    println!("ready at {} {:?}", s.host().time(), t.elapsed());
    for file in std::env::args().skip(1) {
        let text = std::fs::read_to_string(&file).unwrap();
        if let Err(e) = s.run(&file, &text).and_then(|()| s.finish()) { println!("{}", e.render(false)); }
        for m in s.take_messages() { println!("{:8.4} {} {}", m.time, m.kind, m.text); }
    }
    println!("time {} in {:?}", s.host().time(), t.elapsed());
    let k = s.host().robot().tracking();
    println!("{:?} rms {:?}", k, k.rms());
    println!("{:?}", s.host().robot().periods());
    println!("{:?} {:?}", s.host().robot().plant().joints(), s.host().view());
}
