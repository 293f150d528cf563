// SPDX-License-Identifier: MIT OR Apache-2.0
//! The thread that schedules programs and counts their cycles: what takes longer than a keystroke allows.

use crate::lsp::Settings;
use crate::lsp::program::{self, Full};
use crossbeam_channel::{Receiver, Sender, unbounded};
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use takt_asm::Open;

/// A program to be scheduled: its first source, and the texts that are open.
pub(crate) struct Job {
    pub(crate) root: PathBuf,
    pub(crate) generation: u64,
    pub(crate) open: Open,
}

/// A program that is scheduled.
pub(crate) struct Done {
    pub(crate) root: PathBuf,
    pub(crate) generation: u64,
    pub(crate) full: Full,
}

/// Which texts of which programs are wanted.
type Wanted = Arc<Mutex<BTreeMap<PathBuf, u64>>>;

pub(crate) struct Worker {
    jobs: Sender<Job>,
    wanted: Wanted,
}

fn lock(wanted: &Wanted) -> MutexGuard<'_, BTreeMap<PathBuf, u64>> {
    // Numbers only: whoever panicked left them whole.
    wanted.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Worker {
    pub(crate) fn new(settings: Settings, done: Sender<Done>) -> Worker {
        let (jobs, receiver) = unbounded();
        let wanted = Wanted::default();
        let of_thread = Arc::clone(&wanted);
        std::thread::spawn(move || work(&settings, &receiver, &of_thread, &done));
        Worker { jobs, wanted }
    }

    /// The text of a program is another: what is done for an earlier one is not wanted.
    pub(crate) fn is_at(&self, root: &Path, generation: u64) {
        lock(&self.wanted).insert(root.to_owned(), generation);
    }

    pub(crate) fn forget(&self, root: &Path) {
        lock(&self.wanted).remove(root);
    }

    pub(crate) fn start(&self, job: Job) {
        // The thread ends with this end of the channel, not before.
        let _ = self.jobs.send(job);
    }
}

fn work(settings: &Settings, jobs: &Receiver<Job>, wanted: &Wanted, done: &Sender<Done>) {
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
            && done.send(Done { root, generation, full }).is_err()
        {
            return;
        }
    }
}
