// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of work in other processes, here or on the workers of a HyperQueue server: `takt_work`, for `takt.distribute`.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use takt_work::{Client, Event, HYPERQUEUE, Place, Unit, has_package, run};

/// Between two looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// A unit in words: name, command, folder, the file that it writes.
type Words = (String, Vec<String>, PathBuf, PathBuf);

/// HyperQueue on `PATH`, or in this Python; nothing is installed.
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

/// Runs units on so many CPUs here, on a server and workers that are started (`hq`), or on the workers of a server. Returns name and reason
/// of those that failed; `done` is called with the number of those that are done.
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
        // Workers that are started here end with the call.
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
