// SPDX-License-Identifier: MIT OR Apache-2.0
//! AGH path end to end: the figures of the specification.

use takt_programs::AGH;
use takt_programs::accuracy::Accuracy;
use takt_programs::gcode::{self, Program};
use takt_programs::hybrid::kinematics::inverse;
use takt_programs::hybrid::{
    ClosedLoop, Controller, Inputs, LoopError, Outputs, Reference, TrackingController, TrackingError,
};
use takt_programs::path::MoveKind;
use takt_programs::trajectory::Trajectory;

fn program() -> Program {
    gcode::read(AGH).expect("the embedded path is sound")
}

fn trajectory() -> Trajectory {
    Trajectory::plan(&program()).expect("the embedded path is short")
}

fn errors_of<C: TrackingController<Error: std::fmt::Debug>>(controller: C) -> TrackingError {
    let trajectory = trajectory();
    let mut errors = TrackingError::default();
    let mut periods = 0;
    for record in ClosedLoop::new(&trajectory, controller) {
        errors.add(&record.expect("the loop is stable"));
        periods += 1;
    }
    assert_eq!(periods, 346_666);
    errors
}

fn assert_near(measured: f64, expected: f64, tolerance: f64) {
    assert!((measured / expected - 1.0).abs() < tolerance, "{measured:e} is not near {expected:e}");
}

#[test]
fn path_has_the_specified_length() {
    let program = program();
    assert_eq!(program.moves.len(), 39);
    assert_eq!(program.moves.iter().filter(|piece| piece.kind == MoveKind::Cut).count(), 23);
    let trajectory = trajectory();
    assert_eq!(trajectory.periods(), 346_666);
    assert_eq!(trajectory.samples().len(), 346_666);
    assert_eq!(trajectory.samples().count(), 346_666);
    assert!((trajectory.duration() - 34.6666).abs() < 1e-9);
}

#[test]
fn arms_stay_in_the_specified_range() {
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
    for sample in trajectory().samples() {
        for length in inverse(&sample.reference).length {
            shortest = shortest.min(length);
            longest = longest.max(length);
        }
    }
    assert!((shortest - 0.789).abs() < 5e-4 && (longest - 0.918).abs() < 5e-4, "{shortest}..{longest}");
}

#[test]
fn binary64_controller_tracks_as_specified() {
    let errors = errors_of(Controller::<f64>::new());
    // Figures of the specification, then our own to four digits, so that a change is noticed.
    assert_near(errors.cutting, 7.9e-6, 0.03);
    assert_near(errors.overall, 8.8e-6, 0.03);
    assert_near(errors.cutting, 7.801e-6, 0.002);
    assert_near(errors.overall, 8.712e-6, 0.002);
}

#[test]
fn binary32_controller_meets_the_requirement_too() {
    let errors = errors_of(Controller::<f32>::new());
    assert!(errors.cutting < 10e-6, "{errors:?}");
    assert_near(errors.cutting, 7.9e-6, 0.05);
}

#[test]
fn joint_reference_in_binary32_is_close_to_the_unrounded_truth() {
    let mut accuracy = Accuracy::default();
    for sample in trajectory().samples() {
        let rounded: Reference<f32> = sample.reference.convert();
        accuracy.add(&inverse(&rounded).to_array(), &inverse(&sample.reference).to_array());
    }
    let worst = |range: std::ops::Range<usize>| {
        accuracy.errors[range].iter().map(|error| error.absolute).fold(0.0, f64::max)
    };
    // Largest values in the rows "FPGA1,2,3" of the paper's Table 3.
    assert!(worst(0..3) < 1.8651e-6);
    assert!(worst(3..6) < 8.2634e-7);
    assert!(worst(6..9) < 2.9990e-6);
    // The angles pass through unchanged: their rounding costs half an ulp.
    assert!(accuracy.errors[9..].iter().all(|error| error.ulps <= 0.5));
    assert!(accuracy.errors.iter().all(|error| error.count == 346_666));
}

#[test]
fn a_closure_can_control_and_fail() {
    let trajectory = trajectory();
    let mut periods = 0;
    let mut controller = Controller::<f64>::new();
    let closure = |inputs: &Inputs| -> Result<Outputs<f64>, &'static str> {
        periods += 1;
        if periods > 10 {
            return Err("enough");
        }
        Ok(controller.step(inputs.counts, &inputs.reference.convert()))
    };
    let results: Vec<_> = ClosedLoop::new(&trajectory, closure).collect();
    assert_eq!(results.len(), 11, "the loop ends after the error");
    assert_eq!(results[10], Err(LoopError::Controller { period: 10, source: "enough" }));
    assert_eq!(results[9].expect("before the error").period, 9);
}

#[test]
fn forces_that_are_no_numbers_are_named() {
    let trajectory = trajectory();
    let closure = |_: &Inputs| -> Result<Outputs<f64>, std::convert::Infallible> {
        Ok(Outputs { torque: [0.0, f64::NAN], ..Outputs::default() })
    };
    let result = ClosedLoop::new(&trajectory, closure).next();
    assert_eq!(result, Some(Err(LoopError::NotFinite { period: 0, port: "tau5" })));
}

#[test]
fn a_runaway_plant_is_reported() {
    let trajectory = trajectory();
    let closure = |_: &Inputs| -> Result<Outputs<f64>, std::convert::Infallible> {
        Ok(Outputs { torque: [0.0, 1e9], ..Outputs::default() })
    };
    let last = ClosedLoop::new(&trajectory, closure).last().expect("it runs");
    assert!(matches!(last, Err(LoopError::Lost { .. })), "{last:?}");
}
