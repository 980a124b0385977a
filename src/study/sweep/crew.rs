//! Crew: threads that share jobs out among themselves, one after the other, and hand in what they made.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, mpsc};
use std::thread;

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
pub(in crate::study) fn share<W, J: Copy + Send, R: Send, E>(
    (threads, jobs): (usize, impl Iterator<Item = J> + Send),
    stop: &AtomicBool,
    worker: impl Fn() -> W + Sync,
    does: impl Fn(&mut W, J) -> Option<R> + Sync,
    mut take: impl FnMut(J, R) -> Result<(), E>,
) -> Result<(), E> {
    let most = jobs.size_hint().1.unwrap_or(usize::MAX);
    let threads = threads.min(most).max(1);
    let (jobs, worker, does) = (&Mutex::new(jobs), &worker, &does);
    thread::scope(|scope| {
        let (sender, receiver) = mpsc::sync_channel(threads * WAITING);
        for _ in 0..threads {
            let sender = sender.clone();
            scope.spawn(move || {
                let mut worker = worker();
                while !stop.load(Ordering::Relaxed) {
                    // Whoever finds the lock poisoned stops: the panic of the other thread is told when all have ended.
                    let Some(job) = jobs.lock().ok().and_then(|mut jobs| jobs.next()) else { break };
                    let made = does(&mut worker, job);
                    // Nobody takes it where taking has failed.
                    if made.is_none_or(|made| sender.send((job, made)).is_err()) {
                        break;
                    }
                }
            });
        }
        drop(sender);
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
