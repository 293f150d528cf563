// SPDX-License-Identifier: MIT OR Apache-2.0
//! Extension module of the Python package `takt`: programs, runs and models. The Python code in `tools/python/takt` adds names, shapes
//! and NumPy types. docs/python.md describes the package.
//!
//! Arguments are checked here as well as in Python, so that no argument causes a panic. Long operations release the interpreter and check
//! for Ctrl-C.

mod accuracy;
mod board;
mod failure;
mod interrupt;
mod lanes;
mod model;
mod mpc;
mod plant;
mod policy;
mod program;
mod report;
mod run;
mod sim;
mod system;
mod units;

use pyo3::prelude::*;

/// Extension module of the package `takt`, for use by that package only.
#[pymodule]
mod _takt {
    #[pymodule_export]
    use crate::accuracy::{accuracy, enclose};
    #[pymodule_export]
    use crate::board::Board;
    #[pymodule_export]
    use crate::failure::{Failure, restored_fault};
    #[pymodule_export]
    use crate::lanes::Lanes;
    #[pymodule_export]
    use crate::model::{expressions, robot, robot_functions};
    #[pymodule_export]
    use crate::mpc::{predictive, predictive_weight, predictive_worst};
    #[pymodule_export]
    use crate::plant::{Plant, serve_fmu};
    #[pymodule_export]
    use crate::policy::perceptron;
    #[pymodule_export]
    use crate::program::{
        Program, assemble, flag_names, load, longest_tick, machines, nearest_name, restored_program, version,
    };
    #[pymodule_export]
    use crate::report::analyse;
    #[pymodule_export]
    use crate::run::{run, run_loop, run_to_halt};
    #[pymodule_export]
    use crate::sim::Sim;
    #[pymodule_export]
    use crate::system::SystemSim;
    #[pymodule_export]
    use crate::units::run_units;
}
