use takt_asm::{FileLoader, Options, Schedule, assemble};
use takt_emu::{Emulator, Stop};
use takt_isa::MACHINES;
#[test]
fn scratch() {
    let file = std::env::var("SRC").unwrap();
    for machine in MACHINES.iter() {
        for schedule in [Schedule::None, Schedule::All] {
            let options = Options { machine, schedule, ..Options::default() };
            match assemble(&file, &FileLoader::new("/tmp/l"), &options) {
                Ok(a) => {
                    for r in &a.loops {
                        println!(
                            "  loop {:?} n={} S={} II={} bound={} rec={}",
                            r.location.map(|l| l.line),
                            r.iterations,
                            r.stages,
                            r.interval,
                            r.bound.cycles(),
                            r.bound.recurrence
                        );
                    }
                    let mut e = Emulator::new(&a.program).unwrap();
                    e.set_cycle_limit(10_000_000);
                    let stop = e.run();
                    println!(
                        "{} {schedule:?}: {stop:?} {} cycles, {} bundles, hash {:x}",
                        machine.name,
                        e.now(),
                        a.program.bundles(),
                        e.memory().iter().fold(0u64, |h, w| (h.rotate_left(5) ^ u64::from(*w))
                            .wrapping_mul(0x517cc1b727220a95))
                    );
                }
                Err(m) => println!("{} {schedule:?}: {}", machine.name, m.render(false)),
            }
        }
    }
}
