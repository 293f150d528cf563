// SPDX-License-Identifier: MIT OR Apache-2.0
//! Thread pool for the groups of batches, one for each process. A process made by `fork` has its parent's memory but not its
//! threads, and would wait for ever for those of the parent's pool; therefore it makes a pool of its own.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;

/// A linked list of pools: a process's own, then those of its children, grandchildren and so on. Each process sees its own pool and
/// those of its ancestors. There is no lock, since a lock that some thread holds during `fork` would stay locked in the child.
struct Pools {
    process: u32,
    /// The pool; `None` if threads cannot be created, so that the work is done without.
    pool: Option<ThreadPool>,
    next: Next,
}

type Next = OnceLock<Box<Pools>>;

static FIRST: Next = OnceLock::new();

/// Applies a function to each element, in parallel on all cores.
pub(super) fn each<T: Send>(all: &mut [T], run: impl Fn(&mut T) + Send + Sync) {
    // Without `fork`, the default pool of the process is enough; some of these hosts have no process numbers either.
    if !cfg!(unix) {
        return all.par_iter_mut().for_each(run);
    }
    let process = std::process::id();
    let mut pools = &FIRST;
    loop {
        let known = pools.get_or_init(|| {
            let pool = ThreadPoolBuilder::new().build().ok();
            Box::new(Pools { process, pool, next: Next::new() })
        });
        if known.process == process {
            return match &known.pool {
                Some(pool) => pool.install(|| all.par_iter_mut().for_each(run)),
                None => all.iter_mut().for_each(run),
            };
        }
        pools = &known.next;
    }
}
