// SPDX-License-Identifier: MIT OR Apache-2.0
//! Thread that schedules programs and counts their cycles, which is too slow for every keystroke.

use crate::lsp::Settings;
use crate::lsp::program::{self, AssemblyResult};
use crossbeam_channel::{Receiver, Sender, unbounded};
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use takt_asm::Open;

/// Scheduling job: first source of the program, and the open texts.
pub(crate) struct Job {
    pub(crate) root: PathBuf,
    pub(crate) generation: u64,
    pub(crate) open: Open,
}

/// Result of a scheduling job.
pub(crate) struct JobResult {
    pub(crate) root: PathBuf,
    pub(crate) generation: u64,
    pub(crate) full: AssemblyResult,
}

/// Current generation of each program's text; results for other generations are dropped.
type Generations = Arc<Mutex<BTreeMap<PathBuf, u64>>>;

pub(crate) struct Worker {
    jobs: Sender<Job>,
    wanted: Generations,
}

fn lock(wanted: &Generations) -> MutexGuard<'_, BTreeMap<PathBuf, u64>> {
    // A panic of another holder cannot leave plain numbers inconsistent.
    wanted.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Worker {
    pub(crate) fn new(settings: Settings, done: Sender<JobResult>) -> Worker {
        let (jobs, receiver) = unbounded();
        let wanted = Generations::default();
        let of_thread = Arc::clone(&wanted);
        std::thread::spawn(move || work(&settings, &receiver, &of_thread, &done));
        Worker { jobs, wanted }
    }

    /// Sets the current generation of a program's text, which makes work on earlier ones obsolete.
    pub(crate) fn is_at(&self, root: &Path, generation: u64) {
        lock(&self.wanted).insert(root.to_owned(), generation);
    }

    pub(crate) fn forget(&self, root: &Path) {
        lock(&self.wanted).remove(root);
    }

    pub(crate) fn start(&self, job: Job) {
        // Cannot fail: the thread outlives this sender.
        let _ = self.jobs.send(job);
    }
}

fn work(settings: &Settings, jobs: &Receiver<Job>, wanted: &Generations, done: &Sender<JobResult>) {
    for Job { root, generation, open } in jobs {
        let is_wanted = || lock(wanted).get(&root) == Some(&generation);
        if !is_wanted() {
            continue;
        }
        let full = catch_unwind(AssertUnwindSafe(|| {
            let (_, checked) = program::check(settings, &root, &open);
            is_wanted().then(|| program::finish(&root, checked))
        }));
        if let Ok(Some(full)) = full
            && done.send(JobResult { root, generation, full }).is_err()
        {
            return;
        }
    }
}
