//! The threads that run the groups of batches: a pool for each process. A child that `fork` has made has its parent's memory
//! but none of its threads, so that it would wait for ever for those of the parent's pool: it makes one of its own.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;

/// A process's pool, and behind it those of its children, grandchildren and so on: each process sees its ancestors' and its
/// own. Nothing is locked, as a lock that some thread holds during `fork` would stay locked in the child.
struct Pools {
    process: u32,
    /// `None`: threads cannot be had, and the work is done without.
    pool: Option<ThreadPool>,
    next: Next,
}

type Next = OnceLock<Box<Pools>>;

static FIRST: Next = OnceLock::new();

/// Does something with each of these, on all cores.
pub(super) fn each<T: Send>(all: &mut [T], run: impl Fn(&mut T) + Send + Sync) {
    // On hosts without `fork` the one pool of the process will do; some hosts have no numbers of processes either.
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
