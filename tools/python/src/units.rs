// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of work in other processes, on this computer or on the workers of a HyperQueue server: `takt_work`, for `takt.distribute`.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use takt_work::{Client, Event, HYPERQUEUE, Place, Unit, has_package, run};

/// Interval between two checks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// A unit: name, command, folder, and path of the file that it writes.
type Words = (String, Vec<String>, PathBuf, PathBuf);

/// Finds HyperQueue on `PATH` or in this Python; installs nothing.
fn client(python: &Path) -> PyResult<Client> {
    Client::find(|| {
        if has_package(python) {
            return Ok(python.to_owned());
        }
        Err(PyRuntimeError::new_err(format!(
            "HyperQueue is not on PATH, neither `hq` nor the package in python3: `pip install {HYPERQUEUE}`; docs/campaigns.md has the way \
             without a network"
        )))
    })
}

/// Runs units on the given number of CPUs of this computer, on a server and workers started for this call (`hq`), or on the workers of an
/// existing server. Returns the failed units with reasons; calls `done` with the number of finished units.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(crate) fn run_units(
    py: Python<'_>,
    units: Vec<Words>,
    seconds: u64,
    jobs: usize,
    hq: bool,
    server: Option<PathBuf>,
    folder: PathBuf,
    python: PathBuf,
) -> PyResult<Vec<(String, String)>> {
    let unit = |(name, command, folder, result): Words| {
        let time = Duration::from_secs(seconds);
        Unit { name, command, folder, result, cpus: 1, time }
    };
    let units: Vec<Unit> = units.into_iter().map(unit).collect();
    py.detach(|| {
        let wrong = |error: takt_work::WorkError| PyRuntimeError::new_err(error.to_string());
        // Workers started for this call end with it.
        let (place, _cluster) = if hq || server.is_some() {
            Place::queue(client(&python)?, server.as_deref(), &folder.join("server"), jobs).map_err(wrong)?
        } else {
            (Place::Here(jobs), None)
        };
        let (stop, ended) = (AtomicBool::new(false), AtomicBool::new(false));
        let failures = std::thread::scope(|scope| {
            let worker = scope.spawn(|| {
                let failures = run(&units, &place, &stop, &mut |_: Event<'_>| {});
                ended.store(true, Ordering::Relaxed);
                failures
            });
            let mut interrupted = None;
            while !ended.load(Ordering::Relaxed) && interrupted.is_none() {
                std::thread::sleep(LOOK);
                interrupted = Python::attach(|py| py.check_signals()).err();
            }
            stop.store(true, Ordering::Relaxed);
            let failures = worker.join().unwrap_or_else(|_| Ok(Vec::new()));
            interrupted.map_or(failures.map_err(wrong), Err)
        })?;
        Ok(failures.into_iter().map(|failure| (failure.name, failure.reason)).collect())
    })
}
