// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loading of programs and systems, runs with input tables, and results of runs.

pub(crate) mod account;
pub(crate) mod application;
pub(crate) mod batch;
pub(crate) mod cache;
pub(crate) mod controller;
pub(crate) mod deny;
pub(crate) mod fault;
pub(crate) mod load;
pub(crate) mod loaded_program;
pub(crate) mod machine_mistake;
pub(crate) mod memory;
pub(crate) mod nan;
pub(crate) mod outcome;
pub(crate) mod parameters;
pub(crate) mod plant;
pub(crate) mod ports;
pub(crate) mod spills;
pub(crate) mod synthesis;
pub(crate) mod system;
pub(crate) mod table_run;
pub(crate) mod trace;
pub(crate) mod workers;
