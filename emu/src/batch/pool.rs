// SPDX-License-Identifier: MIT OR Apache-2.0
//! Thread pool for the groups of batches, one for each process. A process made by `fork` has its parent's memory but not its threads, and
//! would wait for ever for the threads of the parent's pool; therefore it makes a pool of its own.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;

/// Linked list of pools: a process's own, then its children's, grandchildren's and so on. Each process sees its own pool and its
/// ancestors'. There is no lock, since a lock that some thread holds during `fork` would stay locked in the child.
struct Pools {
    process: u32,
    /// Thread pool; `None` if threads cannot be created, so the work is done without them.
    pool: Option<ThreadPool>,
    next: NextPools,
}

type NextPools = OnceLock<Box<Pools>>;

static FIRST: NextPools = OnceLock::new();

/// Applies a function to each element, in parallel on all cores.
pub(super) fn each<T: Send>(all: &mut [T], run: impl Fn(&mut T) + Send + Sync) {
    // Without `fork`, the default pool of the process suffices; some of these hosts have no process numbers either.
    if !cfg!(unix) {
        return all.par_iter_mut().for_each(run);
    }
    let process = std::process::id();
    let mut pools = &FIRST;
    loop {
        let known = pools.get_or_init(|| {
            let pool = ThreadPoolBuilder::new().build().ok();
            Box::new(Pools { process, pool, next: NextPools::new() })
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
