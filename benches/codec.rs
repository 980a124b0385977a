//! What it costs to write and to read the telegrams of a cycle: the median over several rounds [ns per telegram].
//!
//! `--test` runs one short round, to see that it runs at all. Other arguments are ignored.

use isodp::wire::control::GlobalControl;
use isodp::wire::drive::{G1Stw, G1Zsw, Inputs81, Outputs81, SignOfLife, Stw2, Zsw2};
use isodp::wire::{Address, Fcb, Frame, Header, Sap, Service, Status, Telegram};
use std::hint::black_box;
use std::time::Instant;

/// How often each operation is timed, and how many times it is done while the clock runs.
#[derive(Clone, Copy)]
struct Effort {
    rounds: usize,
    repetitions: u32,
}

impl Effort {
    const FULL: Self = Self { rounds: 15, repetitions: 400_000 };
    const SHORT: Self = Self { rounds: 1, repetitions: 1_000 };

    /// Median duration of one `operation` [ns].
    fn time(self, mut operation: impl FnMut()) -> f64 {
        let mut rounds: Vec<f64> = (0..self.rounds)
            .map(|_| {
                let start = Instant::now();
                (0..self.repetitions).for_each(|_| operation());
                start.elapsed().as_secs_f64() * 1e9 / f64::from(self.repetitions)
            })
            .collect();
        rounds.sort_by(f64::total_cmp);
        rounds[rounds.len() / 2]
    }
}

/// Writes with `emit`, then reads with `parse` what was written; prints both.
fn row(effort: Effort, name: &str, mut emit: impl FnMut(&mut Frame), parse: impl Fn(&Telegram<'_>)) {
    let mut frame = Frame::new();
    let emitted = effort.time(|| emit(black_box(&mut frame)));
    let parsed = effort.time(|| parse(&black_box(&frame).telegram().expect("what was written is a telegram")));
    println!("{name:<12} {:>6} {emitted:>9.2} {parsed:>9.2}", frame.len());
}

fn main() {
    let test = std::env::args().any(|argument| argument == "--test") || std::env::var_os("ISODP_BENCH_TEST").is_some();
    let effort = if test { Effort::SHORT } else { Effort::FULL };
    let address = |number| Address::new(number).expect("a station");
    let (master, encoder) = (address(2), address(6));
    println!("{:<12} {:>6} {:>9} {:>9}", "telegram", "octets", "emit/ns", "parse/ns");

    let clock = Header::request(Address::BROADCAST, master, Service::SdnHigh, Fcb::Unused)
        .with_saps(Sap::GLOBAL_CONTROL, Sap::MASTER_MS0);
    row(
        effort,
        "GC SYNCH",
        |frame| frame.set_data(black_box(&clock), &GlobalControl::SYNCH.emit()).expect("it fits"),
        |telegram| {
            let Telegram::Data { du, .. } = telegram else { return };
            black_box(GlobalControl::parse(du).is_ok_and(|control| control.is_synch()));
        },
    );

    let request = Header::request(encoder, master, Service::SrdHigh, Fcb::Alternate(true));
    let mut outputs = Outputs81 { stw2: Stw2::default(), g1_stw: G1Stw::ABSOLUTE_VALUE };
    let mut sign = SignOfLife::NONE;
    row(
        effort,
        "DX request",
        |frame| {
            sign = sign.next();
            outputs.stw2 = outputs.stw2.with_sign_of_life(sign);
            frame.set_data(black_box(&request), &outputs.emit()).expect("it fits");
        },
        |telegram| {
            let Telegram::Data { du, .. } = telegram else { return };
            black_box(Outputs81::parse(du));
        },
    );

    let response = request.slave_reply(Status::Dl);
    let mut inputs = Inputs81 { zsw2: Zsw2::default(), g1_zsw: G1Zsw::ABSOLUTE_VALUE, xist1: 0, xist2: 0 };
    row(
        effort,
        "DX response",
        |frame| {
            inputs.xist2 = inputs.xist2.wrapping_add(1);
            inputs.xist1 = inputs.xist2 << 7;
            frame.set_data(black_box(&response), &inputs.emit()).expect("it fits");
        },
        |telegram| {
            let Telegram::Data { du, .. } = telegram else { return };
            black_box(Inputs81::parse(du));
        },
    );

    row(
        effort,
        "token",
        |frame| frame.set_token(black_box(master), black_box(master)),
        |telegram| {
            black_box(telegram);
        },
    );
}
