// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs of the arm on the emulator, against binary64: errors, cycles, round trips, and unreachable poses.
#![allow(clippy::print_stdout)]

use takt_asm::{MemoryLoader, Options};
use takt_emu::{Emulator, PeriodError};
use takt_isa::{Program, Register, T3};
use takt_programs::SOURCES;
use takt_programs::arm::{
    Arm, Configuration, FORWARD_EXAMPLE, ForwardResult, GOOD, INVERSE_EXAMPLE, InverseResult, NO_ANGLE,
    ON_AXIS, OUT_OF_REACH, Pose, STEEP, Sweep, WRIST_SINGULAR, angle_between, forward, inverse, sweep,
};

/// Limit on the programs' errors, mm and degrees.
const ERROR: f64 = 0.0005;
/// Limits on the cycles of a period.
const FORWARD_CYCLES: u64 = 96;
const INVERSE_CYCLES: u64 = 195;

/// Program with its ports in the order of its source.
struct PortedProgram {
    emulator: Emulator,
    inputs: Vec<Register>,
    outputs: Vec<Register>,
}

impl PortedProgram {
    fn new(path: &str, inputs: &str, outputs: &str) -> PortedProgram {
        let options = Options { machine: &T3, ..Options::default() };
        let assembled = takt_asm::assemble(path, &MemoryLoader::new(SOURCES), &options);
        let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
        assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
        let program: Program = assembled.program;
        let register = |ports: &[takt_isa::program::Port], name: &str| {
            ports.iter().find(|port| port.name == name).unwrap_or_else(|| panic!("no port {name}")).register
        };
        PortedProgram {
            inputs: inputs.split(' ').map(|name| register(&program.inputs, name)).collect(),
            outputs: outputs.split(' ').map(|name| register(&program.outputs, name)).collect(),
            emulator: Emulator::new(&program).expect("it fits"),
        }
    }

    fn period(&mut self, inputs: impl IntoIterator<Item = u32>) -> Result<(Vec<u32>, u64), PeriodError> {
        let mut inputs = inputs.into_iter();
        for register in &self.inputs {
            self.emulator.set_input_bits(*register, inputs.next().expect("as many as ports"))?;
        }
        assert!(inputs.next().is_none(), "more values than ports");
        let report = self.emulator.run_period(&[])?;
        assert!(report.nan_writes.is_empty(), "a NaN reached a port");
        let outputs =
            self.outputs.iter().map(|register| self.emulator.register(*register).expect("it is written"));
        Ok((outputs.collect(), report.cycles))
    }
}

struct EmulatedKinematics {
    forward: PortedProgram,
    inverse: PortedProgram,
}

impl EmulatedKinematics {
    fn new() -> EmulatedKinematics {
        EmulatedKinematics {
            forward: PortedProgram::new(
                "arm/forward.s",
                "th1 th2 th3 th4 th5 th6 tx ty tz",
                "x y z roll pitch yaw config0 config1 config2 status",
            ),
            inverse: PortedProgram::new(
                "arm/inverse.s",
                "x y z roll pitch yaw tx ty tz config0 config1 config2",
                "th1 th2 th3 th4 th5 th6 status",
            ),
        }
    }
}

fn floats<const N: usize>(words: &[u32]) -> [f32; N] {
    std::array::from_fn(|i| f32::from_bits(words[i]))
}

impl Arm for EmulatedKinematics {
    type Error = PeriodError;

    fn forward(&mut self, joints: [f32; 6], tool: [f32; 3]) -> Result<ForwardResult, PeriodError> {
        let (words, cycles) = self.forward.period(joints.into_iter().chain(tool).map(f32::to_bits))?;
        Ok(ForwardResult {
            pose: Pose { position: floats(&words), orientation: floats(&words[3..]) },
            configuration: [6, 7, 8].map(|i| words[i] != 0),
            status: words[9],
            cycles,
        })
    }

    fn inverse(
        &mut self,
        pose: &Pose<f32>,
        tool: [f32; 3],
        configuration: Configuration,
    ) -> Result<InverseResult, PeriodError> {
        let floats_in = pose.position.into_iter().chain(pose.orientation).chain(tool).map(f32::to_bits);
        let (words, cycles) = self.inverse.period(floats_in.chain(configuration.map(u32::from)))?;
        Ok(InverseResult { joints: floats(&words), status: words[6], cycles })
    }
}

fn narrow<const N: usize>(values: [f64; N]) -> [f32; N] {
    values.map(|value| value as f32)
}

fn narrow_pose(pose: &Pose<f64>) -> Pose<f32> {
    Pose { position: narrow(pose.position), orientation: narrow(pose.orientation) }
}

/// Number of random poses; 10⁶ with `TAKT_FULL=1`.
fn count() -> u64 {
    if std::env::var_os("TAKT_FULL").is_some_and(|value| value == "1") { 1_000_000 } else { 5_000 }
}

#[test]
fn random_poses() {
    let mut arm = EmulatedKinematics::new();
    // Exclude the first period, which also runs `.once`.
    arm.forward([0.0; 6], [0.0; 3]).expect("no input makes the program fault");
    arm.inverse(&Pose::default(), [0.0; 3], [false; 3]).expect("no input makes the program fault");
    let found: Sweep = sweep(&mut arm, count(), 1, |_| {}).expect("no input makes the program fault");
    println!("{found:#?}");
    assert!(
        found.forward_mm <= ERROR && found.forward_deg <= ERROR && found.inverse_deg <= ERROR,
        "{found:#?}"
    );
    assert!(found.disagreements == 0, "{found:#?}");
    assert!(found.forward_of_inverse.max_error_mm <= 0.005, "{found:#?}");
    assert!(found.forward_of_inverse.max_error_deg <= 0.002, "{found:#?}");
    assert!(found.inverse_of_forward.max_error_deg <= 0.002, "{found:#?}");
    for trip in [found.forward_of_inverse, found.inverse_of_forward] {
        assert!(trip.tried.iter().all(|&tried| tried > 0), "{found:#?}");
    }
    assert!(found.forward_poses * 4 > count() && found.inverse_solutions > count(), "{found:#?}");
    let (shortest, longest) = found.forward_cycles.expect("it ran");
    assert!(shortest == longest && longest <= FORWARD_CYCLES, "{longest} cycles, target {FORWARD_CYCLES}");
    let (shortest, longest) = found.inverse_cycles.expect("it ran");
    assert!(shortest == longest && longest <= INVERSE_CYCLES, "{longest} cycles, target {INVERSE_CYCLES}");
}

#[test]
fn the_papers_examples() {
    let mut arm = EmulatedKinematics::new();
    let example = &FORWARD_EXAMPLE;
    let result = arm.forward(narrow(example.joints), narrow(example.tool)).expect("it runs");
    assert_eq!((result.status, result.configuration), (GOOD, [false, true, false]));
    for i in 0..3 {
        let off = f64::from(result.pose.position[i]) - example.binary64.position[i];
        assert!(off.abs() < ERROR, "{:?}", result.pose);
        let off = angle_between(result.pose.orientation[i].into(), example.binary64.orientation[i]);
        assert!(off < ERROR, "{:?}", result.pose);
    }
    let example = &INVERSE_EXAMPLE;
    let result = arm.inverse(&narrow_pose(&example.pose), narrow(example.tool), [false; 3]).expect("it runs");
    let exact = inverse(&example.pose, example.tool, [false; 3]).expect("it is in reach");
    assert_eq!(result.status, GOOD);
    for (a, b) in result.joints.into_iter().zip(exact.joints) {
        assert!(angle_between(a.into(), b) < ERROR, "{result:?} against {exact:?}");
    }
}

/// Unreachable poses are reported in the status, and the joint outputs hold.
#[test]
fn reports_failures_and_holds_outputs() {
    let mut arm = EmulatedKinematics::new();
    let tool = [0.0; 3];
    let good = narrow_pose(&INVERSE_EXAMPLE.pose);
    let last = arm.inverse(&good, tool, [false; 3]).expect("it runs");
    assert_eq!(last.status, GOOD);
    let straight = forward([10.0, 20.0, 30.0, 40.0, 0.0, 50.0], [0.0; 3]).0;
    let pose = |position, orientation| Pose { position, orientation };
    let cases = [
        (pose([2000.0, 0.0, 0.0], [0.0; 3]), OUT_OF_REACH),
        (pose([75.0, 0.0, 447.0], [0.0, 90.0, 0.0]), OUT_OF_REACH),
        (pose([f32::NAN, 0.0, 0.0], [0.0; 3]), OUT_OF_REACH),
        (pose([f32::INFINITY, 0.0, 0.0], [0.0; 3]), OUT_OF_REACH),
        (pose([300.0, 0.0, 300.0], [0.0, f32::NAN, 0.0]), OUT_OF_REACH),
        (pose([300.0, 0.0, 300.0], [1e9, 0.0, 0.0]), OUT_OF_REACH),
        (narrow_pose(&straight), WRIST_SINGULAR),
        (pose([0.0, 0.0, 900.0], [0.0, 90.0, 0.0]), ON_AXIS),
    ];
    for (pose, status) in cases {
        let result = arm.inverse(&pose, tool, [false; 3]).expect("it runs");
        assert_eq!((result.status, result.joints), (status, last.joints), "{pose:?}");
    }
    let again = arm.inverse(&good, tool, [false, true, true]).expect("it runs");
    assert!(again.status == GOOD && again.joints != last.joints);

    let last = arm.forward([10.0, 20.0, 30.0, 40.0, 50.0, 60.0], tool).expect("it runs");
    assert_eq!(last.status, GOOD);
    for joint in 0..6 {
        for bad in [f32::NAN, f32::INFINITY, -1e9] {
            let mut joints = [1.0; 6];
            joints[joint] = bad;
            let result = arm.forward(joints, tool).expect("it runs");
            assert_eq!((result.status, result.pose), (NO_ANGLE, last.pose), "joint {joint} {bad}");
        }
    }
    let result = arm.forward([1.0; 6], [f32::NAN, 0.0, 0.0]).expect("it runs");
    assert_eq!((result.status, result.pose), (NO_ANGLE, last.pose));
    let up = arm.forward([0.0, 90.0, 90.0, 0.0, 0.0, 0.0], tool).expect("it runs");
    assert!(up.status == STEEP && (up.pose.orientation[1] - 90.0).abs() < 0.01, "{up:?}");
}
