//! Crystals that jump, wander and follow a temperature.

use isodp::observation::Observation;
use isodp::sim::fingerprint::Fingerprint;
use isodp::time::Span;

use super::{disturbed, prints, refused};
use crate::support::{Run, address};

/// T_DP of the scene.
const T_DP: Span = Span::from_ms(2);
/// From here on every loop has settled.
const SETTLED: u64 = 160;

/// The mean period of one slave's loop over these cycles, off T_DP (parts per billion).
fn mean_ppb(run: &Run, slave: u8, cycles: std::ops::Range<u64>) -> i64 {
    let of = |row: &isodp::study::row::CycleRow| row.t0;
    let at = |cycle| run.cycles.iter().find(|row| row.cycle == cycle).map(of).expect("a cycle");
    let (from, to) = (at(cycles.start), at(cycles.end));
    let periods: Vec<i64> = run
        .observations
        .iter()
        .filter(|(when, station, _)| *station == address(slave) && (from..to).contains(when))
        .filter_map(|(_, _, what)| match what {
            Observation::Clock { period, .. } => Some(period.ticks()),
            _ => None,
        })
        .collect();
    assert!(periods.len() >= 20, "{} clocks", periods.len());
    let mean = periods.iter().sum::<i64>() / periods.len() as i64;
    (mean - T_DP.ticks()) * 1_000_000_000 / T_DP.ticks()
}
fn latches(disturbances: &[&str], slave: u8) -> u64 {
    let print = |(station, print): (u8, Fingerprint)| (station == slave).then_some(print.latches);
    prints(disturbances).into_iter().find_map(print).expect("a slave")
}

#[test]
fn a_slave_that_jumps_counts_a_longer_period_and_stays_locked() {
    let run = disturbed(&["kind = \"crystal-offset\"; station = 3; offset = \"30 ppm\"; cycle = 200; for = 100"]);
    let periods = [160..200, 260..300, 360..399].map(|cycles| mean_ppb(&run, 3, cycles));
    let step = periods[1] - periods[0];
    assert!((29_000..31_000).contains(&step), "{periods:?}");
    assert!((periods[2] - periods[0]).abs() < 1_000, "{periods:?}");
    assert_eq!(run.counts_of(3).fault_count(), 0);
    let other = [160..200, 260..300].map(|cycles| mean_ppb(&run, 4, cycles));
    assert!((other[1] - other[0]).abs() < 1_000);
}

#[test]
fn a_master_that_jumps_changes_t_dp_without_a_kink() {
    // In the middle of the silence: the SYNCH that is planned leaves as planned, and the grid goes on from it.
    let run = disturbed(&[
        "kind = \"crystal-offset\"; station = 2; offset = \"-40 ppm\"; at = \"500.7 ms\"; for = \"100 ms\"",
    ]);
    let calm = disturbed(&[]);
    let strays = Span::from_ns(200);
    let plain = calm.cycles[SETTLED as usize].t_dp.expect("another before");
    for row in run.cycles.iter().filter(|row| row.cycle >= SETTLED) {
        let t_dp = row.t_dp.expect("another before");
        let at = row.t0.since_zero();
        // 40 ppm of 2 ms; T_DP of a slow crystal is longer.
        let inside = at > Span::from_us(502_900) && at < Span::from_us(602_500);
        let expected = if inside { plain + Span::from_ns(80) } else { plain };
        assert!((t_dp - expected).abs() <= strays * 2, "cycle {}: {t_dp}, not {expected}", row.cycle);
        assert!(row.gc_jitter.abs() <= Span::from_ns(101), "cycle {}: {}", row.cycle, row.gc_jitter);
    }
    let sum = |run: &Run| run.cycles[305].t0 - run.cycles[200].t0;
    // Fifty cycles are longer by 80 ns each.
    let longer = sum(&run) - sum(&calm);
    assert!((longer - Span::from_us(4)).abs() < Span::from_ns(300), "{longer}");
}

#[test]
fn offsets_add_up_and_none_changes_nothing() {
    let undisturbed = prints(&[]);
    for none in [
        "kind = \"crystal-offset\"; stations = \"2..6\"; offset = \"0 ppm\"; cycle = 150; for = 5; every = 10",
        "kind = \"crystal-wander\"; stations = \"2..6\"; step = \"0 ppb\"; interval = \"1 ms\"; bound = \"5 ppm\"",
        "kind = \"temperature-step\"; stations = \"all slaves\"; offset = \"0 ppm\"; time_constant = \"1 s\"",
    ] {
        assert_eq!(undisturbed, prints(&[none]), "{none}");
    }
    let up = "kind = \"crystal-offset\"; station = 4; offset = \"30 ppm\"; at = \"333 ms\"; for = \"70 ms\"";
    let down = "kind = \"crystal-offset\"; station = 4; offset = \"-30 ppm\"; at = \"333 ms\"; for = \"70 ms\"; name = \"down\"";
    assert_eq!(undisturbed, prints(&[up, down]));
    assert_ne!(undisturbed, prints(&[up]));
}

#[test]
fn a_wander_is_the_station_s_own_and_within_its_bound() {
    let wander = |stations: &str, name: &str| {
        format!(
            "kind = \"crystal-wander\"; stations = \"{stations}\"; name = \"{name}\"; step = \"2 ppm\"; \
             interval = \"2 ms\"; bound = \"20 ppm\"; cycle = 160"
        )
    };
    let (one, both, other) = (wander("3", "w"), wander("3, 5", "w"), wander("5", "x"));
    let alone = latches(&[&one], 3);
    assert_ne!(alone, latches(&[], 3));
    assert_eq!(alone, latches(&[&both], 3), "another station's walk");
    assert_eq!(alone, latches(&[&one, &other], 3), "another disturbance");
    assert_eq!(latches(&[&one], 4), latches(&[], 4));
    let run = disturbed(&[&both]);
    for slave in [3, 5] {
        assert_eq!(run.counts_of(slave).fault_count(), 0);
        let off = mean_ppb(&run, slave, 200..399) - mean_ppb(&disturbed(&[]), slave, 200..399);
        assert!(off != 0 && off.abs() <= 20_000, "{off}");
    }
}

#[test]
fn a_temperature_is_followed_and_left() {
    let run = disturbed(&[
        "kind = \"temperature-step\"; station = 3; offset = \"50 ppm\"; time_constant = \"40 ms\"; interval = \"1 ms\"; \
         at = \"300 ms\"; for = \"300 ms\"",
    ]);
    let periods = [120..150, 260..300, 360..399].map(|cycles| mean_ppb(&run, 3, cycles));
    // Five time constants in: all but 0.7 % and less.
    assert!((49_000..50_500).contains(&(periods[1] - periods[0])), "{periods:?}");
    assert!((periods[2] - periods[0]).abs() < 1_500, "{periods:?}");
}

#[test]
fn crystals_that_are_none_are_refused() {
    let said = refused(&["kind = \"crystal-offset\"; station = 3; offset = \"201 ppm\""]);
    assert!(said.contains("disturbance.1.offset: a crystal is not off by 201 ppm"), "{said}");
    let walk = "kind = \"crystal-wander\"; station = 3; interval = \"1 ms\"";
    let said = refused(&[&format!("{walk}; step = \"5 ppm\"; bound = \"4 ppm\"")]);
    assert!(said.contains("a step of 5000 ppb is beyond the bound of 4000 ppb"), "{said}");
    let said = refused(&[&format!("{}; step = \"5 ppm\"; bound = \"9 ppm\"", walk.replace("1 ms", "1 us"))]);
    assert!(said.contains("at least 100 us"), "{said}");
}
