// SPDX-License-Identifier: MIT OR Apache-2.0
//! Controller programs for the Takt processor, and the binary64 models that judge them.
//!
//! - [`hybrid`]: the five-axis hybrid robot of the founding paper: kinematics, dynamics, the tracking controller in binary64 and in native
//!   binary32, the plant, and the closed loop; its [`gcode`] reads a tool path, its [`trajectory`] computes the reference of every sampling
//!   period;
//! - [`path`]: geometry of a tool path;
//! - [`arm`]: the six-axis arm of the second founding paper: kinematics in binary64, and the measurement of its programs;
//! - [`three`]: the six-joint arm of the third founding paper: the computations of its three processors, in binary64;
//! - [`plants`]: plants that close the loop of a controller;
//! - [`listings`]: assembler listings of documents;
//! - [`accuracy`]: errors of binary32 results against binary64.
//!
//! All but the six-axis arm (mm, degrees) is in SI units (m, rad, s, kg, N, N·m). The crate prints nothing, and no input makes it panic.

pub mod accuracy;
pub mod arm;
pub mod hybrid;
pub mod listings;
pub mod path;
pub mod plants;
pub mod real;
pub mod three;

pub use hybrid::{gcode, trajectory};

/// Test path of the paper: the letters "AGH", each in a plane of its own.
pub const AGH: &str = include_str!("../data/agh.ngc");

/// Path for the identification of friction: every axis there and back at constant speeds.
pub const FRICTION: &str = include_str!("../data/friction.ngc");

/// Assembly sources: path within this crate's folder, and text.
pub const SOURCES: &[(&str, &str)] = &[
    ("arm/arm.s", include_str!("../arm/arm.s")),
    ("arm/forward.s", include_str!("../arm/forward.s")),
    ("arm/inverse.s", include_str!("../arm/inverse.s")),
    ("hybrid/generation.s", include_str!("../hybrid/generation.s")),
    ("hybrid/interpolation.s", include_str!("../hybrid/interpolation.s")),
    ("hybrid/robot.s", include_str!("../hybrid/robot.s")),
    ("hybrid/tracking.s", include_str!("../hybrid/tracking.s")),
    ("hybrid/tracking_equations.s", include_str!("../hybrid/tracking_equations.s")),
    ("hybrid/tracking_friction.s", include_str!("../hybrid/tracking_friction.s")),
    ("hybrid/tracking_literal.s", include_str!("../hybrid/tracking_literal.s")),
];

/// Inputs of the tracking programs (CSV): the first 300 periods of `takt track --csv`, a row each.
pub const TRACKING_INPUTS: &str = include_str!("../hybrid/tracking.csv");

/// Files of the three-processor controller: name and text of every file in `three/`. The system is `controller.toml`.
pub const THREE: &[(&str, &str)] = &[
    ("communication.s", include_str!("../three/communication.s")),
    ("controller.toml", include_str!("../three/controller.toml")),
    ("demonstration.robot", include_str!("../three/demonstration.robot")),
    ("dynamic.s", include_str!("../three/dynamic.s")),
    ("geometry.s", include_str!("../three/geometry.s")),
    ("kinematic.s", include_str!("../three/kinematic.s")),
    ("packets.s", include_str!("../three/packets.s")),
    ("planning.s", include_str!("../three/planning.s")),
    ("profile.s", include_str!("../three/profile.s")),
    ("ums7.s", include_str!("../three/ums7.s")),
];

/// Examples and their inputs: name and text of the files in `examples/`, but for [`RECORDS`].
pub const EXAMPLES: &[(&str, &str)] = &[
    ("biquads.csv", include_str!("../examples/biquads.csv")),
    ("biquads.s", include_str!("../examples/biquads.s")),
    ("blink.s", include_str!("../examples/blink.s")),
    ("foc.s", include_str!("../examples/foc.s")),
    ("foc_early.s", include_str!("../examples/foc_early.s")),
    ("gains.s", include_str!("../examples/gains.s")),
    ("kalman.csv", include_str!("../examples/kalman.csv")),
    ("kalman.s", include_str!("../examples/kalman.s")),
    ("lu.csv", include_str!("../examples/lu.csv")),
    ("lu.s", include_str!("../examples/lu.s")),
    ("pendulum.s", include_str!("../examples/pendulum.s")),
    ("pi.s", include_str!("../examples/pi.s")),
    ("statespace.csv", include_str!("../examples/statespace.csv")),
    ("statespace.s", include_str!("../examples/statespace.s")),
    ("table.csv", include_str!("../examples/table.csv")),
    ("table.s", include_str!("../examples/table.s")),
];

/// Inputs that were recorded in the loops of examples, a file each in `examples/`. With a plant, which closes the loop, they are not needed.
pub const RECORDS: &[(&str, &str)] = &[
    ("foc.csv", include_str!("../examples/foc.csv")),
    ("pendulum.csv", include_str!("../examples/pendulum.csv")),
    ("pi.csv", include_str!("../examples/pi.csv")),
];

/// Plants that close the loops of examples: name and text of every TOML file in `examples/plant/`.
pub const PLANTS: &[(&str, &str)] = &[
    ("cart_pendulum.toml", include_str!("../examples/plant/cart_pendulum.toml")),
    ("chain.toml", include_str!("../examples/plant/chain.toml")),
    ("dc_motor.toml", include_str!("../examples/plant/dc_motor.toml")),
    ("pmsm.toml", include_str!("../examples/plant/pmsm.toml")),
    ("servo.toml", include_str!("../examples/plant/servo.toml")),
    ("tank.toml", include_str!("../examples/plant/tank.toml")),
];

/// Programs over arrays, built from the library's macros, with their costs in `docs/library.md`: name and text of every file in `kernels/`.
pub const KERNELS: &[(&str, &str)] = &[
    ("activations.s", include_str!("../kernels/activations.s")),
    ("biquads.s", include_str!("../kernels/biquads.s")),
    ("cholesky.s", include_str!("../kernels/cholesky.s")),
    ("dot.s", include_str!("../kernels/dot.s")),
    ("ekf.s", include_str!("../kernels/ekf.s")),
    ("fft.s", include_str!("../kernels/fft.s")),
    ("fir.s", include_str!("../kernels/fir.s")),
    ("kalman.s", include_str!("../kernels/kalman.s")),
    ("layers.s", include_str!("../kernels/layers.s")),
    ("layers_tanh.s", include_str!("../kernels/layers_tanh.s")),
    ("lu.s", include_str!("../kernels/lu.s")),
    ("matmul.s", include_str!("../kernels/matmul.s")),
    ("matvec.s", include_str!("../kernels/matvec.s")),
    ("mpc.s", include_str!("../kernels/mpc.s")),
    ("policy.s", include_str!("../kernels/policy.s")),
    ("policy_tanh.s", include_str!("../kernels/policy_tanh.s")),
    ("qp.s", include_str!("../kernels/qp.s")),
    ("qr.s", include_str!("../kernels/qr.s")),
    ("riccati.s", include_str!("../kernels/riccati.s")),
    ("table.s", include_str!("../kernels/table.s")),
    ("table2.s", include_str!("../kernels/table2.s")),
];

/// Kernels of TACLeBench, rewritten from their algorithms: name and text of every file in `taclebench/`.
pub const TACLEBENCH: &[(&str, &str)] = &[
    ("cosf.s", include_str!("../taclebench/cosf.s")),
    ("deg2rad.s", include_str!("../taclebench/deg2rad.s")),
    ("fir2dim.s", include_str!("../taclebench/fir2dim.s")),
    ("iir.s", include_str!("../taclebench/iir.s")),
    ("lms.s", include_str!("../taclebench/lms.s")),
    ("ludcmp.s", include_str!("../taclebench/ludcmp.s")),
    ("minver.s", include_str!("../taclebench/minver.s")),
    ("st.s", include_str!("../taclebench/st.s")),
];

/// Library for `.include <name>`: name and text of every file in `library/`.
pub const LIBRARY: &[(&str, &str)] = &[
    ("arrays.s", include_str!("../library/arrays.s")),
    ("c.s", include_str!("../library/c.s")),
    ("control.s", include_str!("../library/control.s")),
    ("math.s", include_str!("../library/math.s")),
    ("matrix.s", include_str!("../library/matrix.s")),
    ("motor.s", include_str!("../library/motor.s")),
    ("signal.s", include_str!("../library/signal.s")),
];

/// Title of a program: the first sentence of its first comment, up to a colon.
#[must_use]
pub fn title(source: &str) -> String {
    let lines = source.lines().map_while(|line| line.strip_prefix(';')).map(str::trim);
    let text = lines.take_while(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
    let end = [". ", ": ", "; "].iter().filter_map(|mark| text.find(mark)).min().unwrap_or(text.len());
    text[..end].trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_file_of_the_library_and_the_examples_is_carried() {
        let carried = [
            ("library", super::LIBRARY.to_vec()),
            ("examples", [super::EXAMPLES, super::RECORDS].concat()),
            ("kernels", super::KERNELS.to_vec()),
            ("taclebench", super::TACLEBENCH.to_vec()),
            ("three", super::THREE.to_vec()),
        ];
        for (folder, list) in carried {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
            let entries = std::fs::read_dir(path).expect("it is part of the crate");
            let entries = entries.map(|entry| entry.expect("it can be read"));
            let files = entries.filter(|entry| entry.path().is_file()).map(|entry| entry.file_name());
            let mut files: Vec<_> = files.collect();
            files.sort();
            let mut names: Vec<_> = list.iter().map(|(name, _)| *name).collect();
            names.sort_unstable();
            assert_eq!(files, names, "{folder}");
        }
    }
}
