// SPDX-License-Identifier: MIT OR Apache-2.0
//! Points of `generation.s` against the binary64 trajectory: the test plays the host's end of the FIFO.

use super::processor::assemble;
use takt_asm::Schedule;
use takt_emu::Emulator;
use takt_isa::program::Port;
use takt_isa::{Register, T3};
use takt_programs::accuracy::Accuracy;
use takt_programs::gcode;
use takt_programs::hybrid::generation::{ANGLE_UNIT, Block, FIELDS, POSITION_UNIT, blocks};
use takt_programs::hybrid::ports::{INPUTS, REFERENCE_LEN};
use takt_programs::trajectory::{CUT_RAMP, Trajectory};

const GENERATION: &str = "hybrid/generation.s";

/// Limits on errors, in ulps of the largest value of each output along the path: position, velocity and acceleration of the tool, then of
/// the table.
const ULPS: [f64; 6] = [4.0, 4.0, 5.0, 2.0, 4.5, 4.5];
/// Limit on the error of the tool's position, m: an ulp of z.
const POSITION: f64 = 6.2e-8;

/// Program with a FIFO in front of it.
struct Generator {
    emulator: Emulator,
    empty: Register,
    fields: [Register; FIELDS.len()],
    pop: Register,
    standing: Register,
    point: [Register; REFERENCE_LEN],
    waiting: std::vec::IntoIter<Block>,
    head: Option<Block>,
    popped: u32,
}

impl Generator {
    fn new(blocks: Vec<Block>) -> Generator {
        let program = &assemble(GENERATION, &T3, Schedule::AsWritten).program;
        let find = |ports: &[Port], name: &str| {
            let port = ports.iter().find(|port| port.name == name);
            port.unwrap_or_else(|| panic!("there is no port {name}")).register
        };
        let mut waiting = blocks.into_iter();
        Generator {
            emulator: Emulator::new(program).expect("the program fits its machine"),
            empty: find(&program.inputs, "empty"),
            fields: FIELDS.map(|name| find(&program.inputs, name)),
            pop: find(&program.outputs, "pop"),
            standing: find(&program.outputs, "standing"),
            // The outputs have the names of the tracking program's inputs.
            point: std::array::from_fn(|i| {
                find(&program.outputs, INPUTS[INPUTS.len() - REFERENCE_LEN + i].name)
            }),
            head: waiting.next(),
            waiting,
            popped: 0,
        }
    }

    /// Runs a period: returns the point, whether the core stands, and the cycles.
    fn period(&mut self) -> ([f32; REFERENCE_LEN], bool, u64) {
        let empty = u32::from(self.head.is_none());
        self.emulator.set_input_bits(self.empty, empty).expect("it is an input");
        if let Some(block) = &self.head {
            for (register, word) in self.fields.iter().zip(block.to_words()) {
                self.emulator.set_input_bits(*register, word).expect("it is an input");
            }
        }
        let cycles = self.emulator.run_period(&[]).expect("no block makes the program fault").cycles;
        let read = |register: Register| self.emulator.register(register).expect("it is written");
        let popped = read(self.pop);
        if popped != self.popped {
            assert_eq!((popped, empty), (self.popped + 1, 0), "one at a time, and none that is not there");
            (self.popped, self.head) = (popped, self.waiting.next());
        }
        let (point, standing) = (self.point.map(read).map(f32::from_bits), read(self.standing) == 1);
        (point, standing, cycles)
    }
}

fn plan(text: &str) -> Trajectory {
    Trajectory::plan(&gcode::read(text).expect("the path is sound")).expect("the path is short")
}

/// Errors of the points of a path, without a lost period between moves.
fn errors(text: &str) -> Accuracy<REFERENCE_LEN> {
    let trajectory = plan(text);
    let mut generator = Generator::new(blocks(&trajectory).expect("the path fits"));
    let mut accuracy = Accuracy::default();
    let (_, standing, _) = generator.period();
    assert!(standing, "the first block places the robot");
    for (period, sample) in trajectory.samples().enumerate() {
        let (point, standing, _) = generator.period();
        assert!(!standing, "period {period}: no move is running");
        accuracy.add(&point, &sample.reference.to_array());
    }
    let (end, standing, _) = generator.period();
    assert!(standing && end[3..9].iter().all(|&derivative| derivative == 0.0), "it rests at the end");
    assert!(generator.emulator.flags().is_empty());
    accuracy
}

#[test]
fn points_equal_the_trajectorys() {
    let accuracy = errors(takt_programs::AGH);
    for (i, error) in accuracy.errors.iter().enumerate() {
        let kind = if i < 9 { i / 3 } else { 3 + (i - 9) / 2 };
        let name = INPUTS[5 + i].name;
        assert!(error.ulps_of_largest() <= ULPS[kind], "{name}: {error} at {}", error.worst);
        assert!(kind > 0 || error.absolute <= POSITION, "{name}: {error} at {}", error.worst);
        assert_eq!(error.count, 346_666);
    }
}

/// Moves of every kind: arcs both ways, shorter and longer than half a turn, with all other axes moving along and with different radii;
/// moves too short for a plateau, a move of one axis of the table, and a crawl.
#[test]
fn moves_of_every_kind() {
    let text = "G0 X10 Y5 Z700 A1 C-20\nG2 X30 Y5 Z702 I10 J0 A3 C-25 F1500\nG3 X10 Y25.005 I-20 J0 F1500\n\
                G2 X10 Y25 Z701 I5 J0 F800\nG2 X10 Y25.1 R40 F800\nG2 X10 Y25.1 I7 J1 C-24 F1800\n\
                G0 X10.01\nG1 X10.5 F2000\nG0 C300\nG0 A-90 C300 Z640\nG1 X10.51 F1\n";
    let accuracy = errors(text);
    // A path of a hundredth of a millimetre is a few thousand units, rounded to whole ones: at most a unit of error, within the time of a
    // ramp.
    let bounds =
        [POSITION_UNIT, ANGLE_UNIT].map(|unit| [2.0 * unit / CUT_RAMP, 8.0 * unit / CUT_RAMP.powi(2)]);
    let [[speed, acceleration], [turning, spinning]] = bounds;
    for (i, error) in accuracy.errors.iter().enumerate() {
        let bound = match i {
            0..3 => 8e-8,
            3..6 => speed,
            6..9 => acceleration,
            // Two ulps at 300°.
            9..11 => 1e-6,
            11..13 => turning,
            _ => spinning,
        };
        assert!(
            error.absolute <= bound,
            "{}: {error} at {}, bound {bound:e}",
            INPUTS[5 + i].name,
            error.worst
        );
    }
}

/// Without the number of periods from the host, the feed determines a move's duration, up to a period of rounding.
#[test]
fn the_core_can_plan_its_own_time() {
    let trajectory = plan(takt_programs::AGH);
    let mut planned = trajectory.moves();
    let given = blocks(&trajectory).expect("the path fits");
    let own = given.iter().map(|block| Block { periods: 0, ..*block }).collect();
    let mut generator = Generator::new(own);
    let _ = (generator.period(), generator.period());
    // Count the moves by their starts at rest: only there are all derivatives zero.
    let (mut length, mut moves) = (1u64, 0);
    while moves < 12 {
        let (point, ..) = generator.period();
        if point[3..9].iter().chain(&point[11..]).all(|&value| value == 0.0) {
            let (piece, periods) = planned.next().expect("there are more moves");
            assert!(length.abs_diff(periods) <= 1, "line {}: {length} periods for {periods}", piece.line);
            (length, moves) = (0, moves + 1);
        }
        length += 1;
    }
}

/// Blocks of length zero are dropped without a lost period; a late block begins when it arrives; cycles do not depend on a block's
/// contents.
#[test]
fn late_blocks_and_empty_blocks() {
    let trajectory = plan("G0 X0 Y0 Z700\nG1 X1 F2000\nG1 X2 F2000\n");
    let all = blocks(&trajectory).expect("the path fits");
    let [place, first, second] = all[..] else { panic!("{all:?}") };
    let nothing = Block { periods: 0, ..first };
    let periods = u64::from(first.periods) + u64::from(second.periods);

    let mut generator = Generator::new(vec![place, first, nothing, nothing, second]);
    let _ = generator.period();
    for period in 0..periods {
        assert!(!generator.period().1, "period {period}");
    }
    assert!(generator.period().1, "and no longer");

    let mut late = Generator::new(vec![place, first]);
    let mut cycles = std::collections::BTreeSet::new();
    for _ in 0..=first.periods {
        cycles.insert(late.period().2);
    }
    for _ in 0..10 {
        let (point, standing, _) = late.period();
        assert!(standing && (point[0] - 0.001).abs() < 3e-9, "{}", point[0]);
    }
    late.head = Some(second);
    assert!(!late.period().1, "it begins at once");
    // The first period also runs `.once`; the others prepare a block, begin one, or neither.
    assert!(cycles.len() <= 4 && cycles.last() <= Some(&500), "{cycles:?}");
}
