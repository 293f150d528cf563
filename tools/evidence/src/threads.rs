// SPDX-License-Identifier: MIT OR Apache-2.0
//! Work on several threads.

use anyhow::Result;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Number of cores; 1 if it is unknown.
pub(crate) fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Calls `work` for each element, in this order, with the number of the thread, on at most so many threads. Returns the results in the
/// order of the elements.
///
/// # Errors
/// The first error; the other threads then finish their current element and stop.
pub(crate) fn at_once<T: Sync, R: Send>(
    all: &[T],
    threads: usize,
    work: impl Fn(usize, &T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let (next, work) = (AtomicUsize::new(0), &work);
    let thread = |own: usize| -> Result<Vec<(usize, R)>> {
        let mut done = Vec::new();
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(one) = all.get(at) else { return Ok(done) };
            let result = work(own, one).inspect_err(|_| next.store(all.len(), Ordering::Relaxed))?;
            done.push((at, result));
        }
    };
    let mut results = thread::scope(|scope| {
        let threads = (0..threads.clamp(1, all.len().max(1))).map(|own| scope.spawn(move || thread(own)));
        let threads: Vec<_> = threads.collect();
        let mut results = Vec::new();
        for thread in threads {
            results.extend(thread.join().expect("a thread does not panic")?);
        }
        Ok::<_, anyhow::Error>(results)
    })?;
    results.sort_by_key(|(at, _)| *at);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::ensure;

    #[test]
    fn results_have_the_order_of_their_elements_and_an_error_stops() {
        let all: Vec<usize> = (0..100).collect();
        let doubled = at_once(&all, 3, |thread, one| {
            ensure!(thread < 3, "a fourth thread");
            Ok(2 * one)
        });
        assert_eq!(doubled.expect("no error"), all.iter().map(|one| 2 * one).collect::<Vec<_>>());
        let met = AtomicUsize::new(0);
        let failed = at_once(&all, 1, |_, one| {
            met.fetch_add(1, Ordering::Relaxed);
            ensure!(*one != 4, "the fifth");
            Ok(())
        });
        assert_eq!(failed.expect_err("an error").to_string(), "the fifth");
        assert_eq!(met.into_inner(), 5);
        assert!(at_once(&[], 2, |_, _: &u8| Ok(())).expect("nothing to do").is_empty());
    }
}
