//! Crew: threads that share jobs out among themselves, one after the other, and hand in what they made.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;

use rayon::ThreadPoolBuilder;
use rayon::iter::{ParallelBridge, ParallelIterator};

/// Results that wait to be taken, per thread.
const WAITING: usize = 64;

/// How many threads there are if nobody says: one per core.
pub fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Does all `jobs` on `threads` threads, each of them next when a thread is free. Each thread makes itself a `worker`,
/// which `does` its jobs; `take` gets what comes of them on the calling thread, in any order. Ends early when `stop` is
/// set, when a worker makes nothing of its job, or when `take` fails.
///
/// # Errors
/// Whatever `take` says.
///
/// # Panics
/// If the machine has no thread left.
pub(in crate::study) fn share<W, J: Copy + Send, R: Send, E>(
    (threads, jobs): (usize, impl Iterator<Item = J> + Send),
    stop: &AtomicBool,
    worker: impl Fn() -> W + Sync,
    does: impl Fn(&mut W, J) -> Option<R> + Sync,
    mut take: impl FnMut(J, R) -> Result<(), E>,
) -> Result<(), E> {
    let most = jobs.size_hint().1.unwrap_or(usize::MAX);
    let threads = threads.min(most).max(1);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a machine has threads");
    let (worker, does) = (&worker, &does);
    pool.in_place_scope(|scope| {
        let (sender, receiver) = mpsc::sync_channel(threads * WAITING);
        scope.spawn(move |_| {
            // Nothing made of one job ends all threads, each after the job that it is at. So does a result that nobody
            // takes, where taking has failed.
            let one = |worker: &mut W, job| {
                let made = if stop.load(Ordering::Relaxed) { None } else { does(worker, job) };
                sender.send((job, made?)).ok()
            };
            let _all_done: Option<()> = jobs.par_bridge().try_for_each_init(worker, one);
        });
        receiver.into_iter().try_for_each(|(job, made)| take(job, made))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn every_job_is_done_once_by_any_number_of_threads() {
        for threads in [0, 1, 2, 4, 200] {
            let mut made = [0; 1_000];
            let take = |job: usize, result: usize| -> Result<(), Infallible> {
                assert_eq!(result, job * 2);
                made[job] += 1;
                Ok(())
            };
            share((threads, 0..1_000), &AtomicBool::new(false), || (), |(), job| Some(job * 2), take).unwrap();
            assert!(made.iter().all(|&times| times == 1), "{threads} threads");
        }
    }

    #[test]
    fn the_work_ends_when_nobody_wants_more() {
        let stop = AtomicBool::new(false);
        let mut taken = 0;
        let take = |_, ()| -> Result<(), &str> {
            taken += 1;
            if taken == 3 { Err("full") } else { Ok(()) }
        };
        assert_eq!(share((2, 0..1_000_000), &stop, || (), |(), _| Some(()), take), Err("full"));
        assert_eq!(taken, 3);
        stop.store(true, Ordering::Relaxed);
        let take = |_, ()| -> Result<(), ()> { Err(()) };
        assert_eq!(share((2, 0..1_000), &stop, || (), |(), _| Some(()), take), Ok(()));
    }
}
