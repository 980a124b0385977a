//! What one event costs in the queue: a pop and the push that follows from it, [`NearQueue`] against [`HeapQueue`].
//!
//! ```text
//! cargo bench --bench queue             five rounds, medians [ns]
//! cargo bench --bench queue -- --test   one short round, only to see that it runs
//! ```
//!
//! Two workloads. `spread`: each event that is popped comes back at a random instant, of which nothing is known
//! beforehand. `bus`: three of four come back as the next of all (a request, its answer, its end), one of four goes behind
//! nearly all others (the station's next latch), as in a bus cycle.

use isodp::sim::queue::{HeapQueue, Key, Lane, NearQueue, Phase, Queue};
use isodp::time::{Span, Time};
use std::hint::black_box;
use std::time::Instant;

/// Events that wait while the time is taken.
const PENDING: [i64; 4] = [2, 34, 127, 1_000];
/// Mean distance between two waiting events [ticks].
const GAP: i64 = 12_000;

/// An event about as large as those of the simulator.
type Event = [u64; 3];

/// How far ahead [ticks] of `number` events popped so far, with `pending` waiting, the next one lies, and where it waits.
type Ahead = fn(number: u64, pending: i64) -> (i64, Lane);

/// A random number from 0 to 2^31 - 1, cheap and the same in every round.
fn scatter(number: u64) -> i64 {
    (number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33) as i64
}
fn spread(number: u64, pending: i64) -> (i64, Lane) {
    (scatter(number) % (2 * pending * GAP), Lane::Any)
}
fn bus(number: u64, pending: i64) -> (i64, Lane) {
    if number.is_multiple_of(4) {
        ((pending + 1) * GAP + scatter(number) % 100, Lane::Row(0))
    } else {
        (10, Lane::Soon)
    }
}

/// Time per pop and push [ns].
fn measure<Q: Queue<Event>>(pending: i64, ahead: Ahead, count: u64) -> f64 {
    let mut queue = Q::default();
    for i in 0..pending {
        queue.push(
            Lane::Row(0),
            Key::new(Time::from_ticks(i * GAP), Phase::Deadline, i as u8, i as u64),
            [i as u64; 3],
        );
    }
    let begun = Instant::now();
    for number in 1..=count {
        let (key, event) = black_box(&mut queue).pop().expect("as many pushes as pops");
        let (ahead, lane) = ahead(number, pending);
        let time = key.time() + Span::from_ticks(ahead);
        queue.push(lane, Key::new(time, Phase::Telegram, key.station(), number + 1_000), black_box(event));
    }
    begun.elapsed().as_secs_f64() * 1e9 / count as f64
}

fn main() {
    let short = std::env::args().any(|arg| arg == "--test");
    let (rounds, count) = if short { (1, 1_000) } else { (5, 2_000_000) };
    println!("workload  pending   near [ns]   heap [ns]   heap / near");
    for (name, ahead) in [("spread", spread as Ahead), ("bus", bus)] {
        for pending in PENDING {
            // The two take turns, so that a slow spell of the machine meets both.
            let (mut near, mut heap) = (Vec::new(), Vec::new());
            for _ in 0..rounds {
                near.push(measure::<NearQueue<Event>>(pending, ahead, count));
                heap.push(measure::<HeapQueue<Event>>(pending, ahead, count));
            }
            near.sort_by(f64::total_cmp);
            heap.sort_by(f64::total_cmp);
            let (near, heap) = (near[rounds / 2], heap[rounds / 2]);
            println!("{name:<8}  {pending:>7}   {near:>9.1}   {heap:>9.1}   {:>11.2}", heap / near);
        }
    }
}
