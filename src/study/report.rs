//! Report: the summary of a run as text that fits a screen.

use super::acyclic::AcyclicSummary;
use super::live_list::Seen;
use super::masters;
use super::summary::{
    Distribution, FaultSummary, LedSummary, LinkSummary, Receptions, SlaveSummary, StationSummary, Summary, Timing,
};
use super::verdict;
use crate::observation::Leds;
use crate::time::Span;

/// Slaves that are shown; of more, the worst.
pub const SLAVES: usize = 16;
/// Links that are shown; of more, the slowest.
pub const LINKS: usize = 8;
/// Stations of the live list that are shown, of those that are remarkable; of more, the worst.
pub const STATIONS: usize = 4;
/// First faults that are shown.
pub const FAULTS: usize = 8;

/// The summary as text; `dir` is where its files are, none if there are none.
pub fn render(summary: &Summary, dir: Option<&str>) -> String {
    let mut lines = Vec::new();
    network(summary, &mut lines);
    topology(summary, &mut lines);
    masters(summary, &mut lines);
    slaves(summary, &mut lines);
    leds(summary, &mut lines);
    episodes(summary, &mut lines);
    live_list(summary, &mut lines);
    spread(summary, &mut lines);
    steady_state(summary, &mut lines);
    links(summary, &mut lines);
    acyclic(summary, &mut lines);
    faults(summary, &mut lines);
    fingerprint(summary, &mut lines);
    files(summary, dir, &mut lines);
    verdicts(summary, &mut lines);
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

/// The beginning of the page and where the files are, for one of several runs.
pub(super) fn brief(summary: &Summary, dir: Option<&str>) -> Vec<String> {
    let mut lines = Vec::new();
    network(summary, &mut lines);
    files(summary, dir, &mut lines);
    lines
}

fn network(summary: &Summary, lines: &mut Vec<String>) {
    let (network, timing, counts) = (&summary.network, &summary.timing, &summary.counts);
    lines.push(format!(
        "{}: master {}, {}, {}, {}, {} cycles in {}, seed {}",
        network.scenario,
        network.master,
        number(network.slaves, "slave"),
        number(network.links, "link"),
        network.bit_rate,
        network.cycles,
        network.duration,
        network.seed
    ));
    lines.push(times(timing));
    // The first claim of a run is how the ring begins.
    let lost_tokens = summary.masters.iter().map(|master| master.tokens_claimed).sum::<u64>().saturating_sub(1);
    let masters = summary.live_list.iter().filter(|station| station.seen == Seen::Master);
    let happened = [
        (lost_tokens, "lost token"),
        (masters.map(|master| master.lost).sum(), "lost master"),
        (counts.faults, "fault"),
        (counts.retries, "retry"),
        (counts.no_answers, "missing answer"),
        (counts.diagnoses, "DH reply"),
        (counts.auto_clears, "AutoClear"),
        (counts.late_clocks, "late clock"),
        (counts.collisions, "collision"),
        (counts.disturbed, "disturbed telegram"),
    ];
    let text: Vec<_> = happened.iter().filter(|(count, _)| *count > 0).map(|&(n, what)| number(n, what)).collect();
    lines.push(if text.is_empty() { "nothing went wrong on the bus".to_owned() } else { text.join(", ") });
    ring(summary, lines);
}

/// What the token's rotation did to SYNCH, where the master was not alone.
fn ring(summary: &Summary, lines: &mut Vec<String>) {
    let Some(ring) = &summary.ring else { return };
    let missed = match ring.missed_clocks {
        0 => "none missed".to_owned(),
        missed => format!("{missed} missed, the token was away or the bus in use for whole cycles"),
    };
    let delay = summary.distribution("synch_delay").filter(|delay| delay.count > 0);
    lines.push(match delay {
        Some(delay) => format!(
            "SYNCH late in {} of {} cycles: p50 {}, p99 {}, max {}; {missed}",
            delay.count,
            summary.network.cycles,
            span(delay.p50),
            span(delay.p99),
            span(delay.max),
        ),
        None => format!("SYNCH never late; {missed}"),
    });
}

/// Every master that shares the token.
fn masters(summary: &Summary, lines: &mut Vec<String>) {
    if !summary.masters.is_empty() {
        lines.push(String::new());
        lines.extend(masters::table(&summary.masters));
    }
}

/// What is doubtful about the cables, and how they are joined if there is more than one.
fn topology(summary: &Summary, lines: &mut Vec<String>) {
    lines.extend(summary.warnings.iter().map(|warning| format!("warning: {warning}")));
    if !summary.topology.is_empty() {
        lines.push(String::new());
        lines.extend(summary.topology.iter().cloned());
    }
}

fn slaves(summary: &Summary, lines: &mut Vec<String>) {
    let mut shown: Vec<_> = summary.slaves.iter().collect();
    let more = shown.len().saturating_sub(SLAVES);
    if more > 0 {
        // Stable, so that equally bad slaves stay in address order.
        shown.sort_by_key(|slave| std::cmp::Reverse(badness(slave)));
        shown.truncate(SLAVES);
        shown.sort_by_key(|slave| slave.address);
    }
    let header =
        ["slave", "device", "state", "phase", "lock", "PLL error p99", "max", "latch offset mean", "max", "faults"];
    let rows = shown.iter().map(|slave| slave_cells(slave)).collect::<Vec<_>>();
    lines.push(String::new());
    lines.extend(aligned(&header, &[1, 2, 3, 9], &rows));
    if more > 0 {
        lines.push(format!("the {SLAVES} worst of {} slaves; {more} more are no worse", summary.slaves.len()));
    }
}

/// What makes a slave worse than another: faults, then not being in operation, then its latch offset.
fn badness(slave: &SlaveSummary) -> (u64, bool, Span) {
    let operating = slave.phase == crate::observation::Phase::Operation.text();
    let offset = slave.distribution("latch_offset").and_then(|offset| offset.farthest).map_or(Span::ZERO, Span::abs);
    (slave.fault_count(), !operating, offset)
}

fn slave_cells(slave: &SlaveSummary) -> Vec<String> {
    let of = |name, value: fn(&Distribution) -> Option<Span>| span(slave.distribution(name).and_then(value));
    let faults: Vec<_> = slave.faults.iter().map(|(code, count)| format!("{count} x {code}")).collect();
    vec![
        slave.address.to_string(),
        slave.device.clone(),
        slave.state.to_owned(),
        slave.phase.to_owned(),
        slave.lock_cycles.map_or_else(|| "-".to_owned(), |cycles| format!("{cycles} cycles")),
        of("pll_error", |error| error.magnitude_p99),
        of("pll_error", |error| error.farthest),
        of("latch_offset", |offset| offset.mean),
        of("latch_offset", |offset| offset.farthest),
        if faults.is_empty() { "-".to_owned() } else { faults.join(", ") },
    ]
}

/// Who shows something else than normal operation, a line per pattern.
fn leds(summary: &Summary, lines: &mut Vec<String>) {
    for pattern in Leds::ALL.iter().filter(|&&leds| leds != Leds::DataExchange) {
        let leds = LedSummary::of(*pattern);
        let shown = summary.slaves.iter().filter(|slave| slave.leds == Some(leds));
        let slaves: Vec<_> = shown.map(|slave| slave.address).collect();
        if !slaves.is_empty() {
            let LedSummary { red, green, meaning } = leds;
            lines.push(format!("LEDs red {red}, green {green} at slave {}: {meaning}", ranges(&slaves)));
        }
    }
}

/// How long disturbances took to harm, and slaves to recover.
fn episodes(summary: &Summary, lines: &mut Vec<String>) {
    if let Some(episodes) = &summary.episodes {
        lines.push(String::new());
        lines.extend(episodes.lines());
    }
}

/// Ascending numbers as `3..5, 9`.
pub(super) fn ranges(numbers: &[u8]) -> String {
    let part = |run: &[u8]| match *run {
        [first, _, .., last] => format!("{first}..{last}"),
        [first, last] => format!("{first}, {last}"),
        _ => run.iter().map(u8::to_string).collect(),
    };
    numbers.chunk_by(|a, b| a + 1 == *b).map(part).collect::<Vec<_>>().join(", ")
}

/// The counters of a bus analyser: all together, and those of the stations where there is something to look at.
fn live_list(summary: &Summary, lines: &mut Vec<String>) {
    let total = |count: fn(&StationSummary) -> u64| summary.live_list.iter().map(count).sum::<u64>();
    let timing = &summary.timing;
    let mut shown: Vec<_> = summary.live_list.iter().filter(|station| station.is_remarkable()).collect();
    let more = shown.len().saturating_sub(STATIONS);
    lines.push(String::new());
    lines.push(format!(
        "live list: {}, lost {}, syncs {}, repeats {}, illegal {}, diagnoses {}   cycle time {}, mean {}",
        number(summary.live_list.len(), "station"),
        total(|station| station.lost),
        total(|station| station.syncs),
        total(|station| station.repeats),
        total(|station| station.illegal_responses),
        total(|station| station.diagnoses),
        range(timing.cycle_min, timing.cycle_max),
        span(timing.cycle_mean),
    ));
    if shown.is_empty() {
        return;
    }
    if more > 0 {
        shown.sort_by_key(|station| std::cmp::Reverse(rank(station)));
        shown.truncate(STATIONS);
        shown.sort_by_key(|station| station.address);
    }
    let rows: Vec<_> = shown.iter().map(|station| station_cells(station)).collect();
    lines.extend(aligned(STATION_HEADER, &[1], &rows));
    if more > 0 {
        lines.push(format!("the {STATIONS} worst stations; {more} more are remarkable, see live-list.txt"));
    }
}

/// The whole live list, a line per station.
pub(super) fn live_list_of_all(summary: &Summary) -> String {
    let rows: Vec<_> = summary.live_list.iter().map(station_cells).collect();
    aligned(STATION_HEADER, &[1], &rows).iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

/// What makes a station worse than another: not being there, then losses, then its worst state, then its answers.
fn rank(station: &StationSummary) -> (bool, u64, Seen, u64) {
    (station.seen == Seen::Missing, station.lost, station.seen, station.illegal_responses + station.repeats)
}

/// Titles over [`station_cells`].
const STATION_HEADER: &[&str] =
    &["station", "worst state", "lost", "syncs", "repeats", "most in a cycle", "illegal", "diagnoses"];

fn station_cells(station: &StationSummary) -> Vec<String> {
    let counts = [
        station.lost,
        station.syncs,
        station.repeats,
        station.repeats_max_per_cycle,
        station.illegal_responses,
        station.diagnoses,
    ];
    let names = [station.address.to_string(), station.seen.text().to_owned()];
    names.into_iter().chain(counts.iter().map(u64::to_string)).collect()
}

fn spread(summary: &Summary, lines: &mut Vec<String>) {
    let Some(skew) = summary.distribution("latch_skew").filter(|skew| skew.count > 0) else { return };
    let steps = summary.counts.skew_max_steps.map_or_else(String::new, |steps| format!(", {steps:.3} steps"));
    lines.push(String::new());
    lines.push(format!(
        "latch skew: p50 {}, p90 {}, p99 {}, p99.9 {}, max {}{steps}",
        span(skew.p50),
        span(skew.p90),
        span(skew.p99),
        span(skew.p99_9),
        span(skew.max),
    ));
}

/// From when on the network is at work, and what is known of it then.
fn steady_state(summary: &Summary, lines: &mut Vec<String>) {
    if let Some(steady) = &summary.steady_state {
        lines.push(String::new());
        lines.extend(steady.lines());
    }
}

fn links(summary: &Summary, lines: &mut Vec<String>) {
    if summary.links.is_empty() {
        return;
    }
    let mut shown: Vec<_> = summary.links.iter().collect();
    let more = shown.len().saturating_sub(LINKS);
    if more > 0 {
        let slowest = |link: &&LinkSummary| link.distribution("publish").and_then(|publish| publish.p99);
        shown.sort_by_key(|link| std::cmp::Reverse(slowest(link)));
        shown.truncate(LINKS);
        shown.sort_by_key(|link| (link.publisher, link.subscriber));
    }
    let header = [
        "publish latency",
        "p50",
        "p90",
        "p99",
        "p99.9",
        "max",
        "age at use max",
        "valid",
        "lost",
        "wrong length",
        "longest gap",
    ];
    let rows: Vec<_> = shown.iter().map(|link| link_cells(link)).collect();
    lines.push(String::new());
    lines.extend(aligned(&header, &[], &rows));
    if more > 0 {
        lines.push(format!("the {LINKS} slowest of {} links; {more} more are no slower", summary.links.len()));
    }
}

fn link_cells(link: &LinkSummary) -> Vec<String> {
    let publish = |value: fn(&Distribution) -> Option<Span>| span(link.distribution("publish").and_then(value));
    let count =
        |of: fn(&Receptions) -> u64| link.receptions.as_ref().map_or_else(|| "-".to_owned(), |all| of(all).to_string());
    vec![
        format!("{} -> {}", link.publisher, link.subscriber),
        publish(|latency| latency.p50),
        publish(|latency| latency.p90),
        publish(|latency| latency.p99),
        publish(|latency| latency.p99_9),
        publish(|latency| latency.max),
        span(link.distribution("age").and_then(|age| age.max)),
        count(|receptions| receptions.valid),
        count(|receptions| receptions.lost),
        count(|receptions| receptions.length_errors),
        span(link.receptions.and_then(|receptions| receptions.longest_gap)),
    ]
}

/// Acyclic services, a line per class of master.
fn acyclic(summary: &Summary, lines: &mut Vec<String>) {
    if !summary.acyclic.is_empty() {
        lines.push(String::new());
        lines.extend(summary.acyclic.iter().map(AcyclicSummary::line));
    }
}

/// Where each fault was first, and what tells more of it.
fn faults(summary: &Summary, lines: &mut Vec<String>) {
    if summary.first_faults.is_empty() {
        return;
    }
    lines.push(String::new());
    for FaultSummary { slave, code, cycle, count, replay, .. } in summary.first_faults.iter().take(FAULTS) {
        let times = if *count == 1 { String::new() } else { format!(", the first of {count}") };
        lines.push(format!("{code} of slave {slave} in cycle {cycle}{times}: {replay}"));
    }
    let more = summary.counts.faults.saturating_sub(summary.first_faults.len().min(FAULTS) as u64);
    if more > 0 {
        let there = summary.files.iter().any(|file| file == "events.csv");
        lines.push(format!("and {more} more{}", if there { " in events.csv" } else { "" }));
    }
}

fn fingerprint(summary: &Summary, lines: &mut Vec<String>) {
    if !summary.fingerprint.is_empty() {
        let parts: Vec<_> = summary.fingerprint.iter().map(|(name, text)| format!("{name} {text}")).collect();
        lines.push(String::new());
        lines.push(format!("fingerprint: {}", parts.join("  ")));
    }
}

fn files(summary: &Summary, dir: Option<&str>, lines: &mut Vec<String>) {
    let thinned = summary.thinning.iter().filter(|table| table.rows_left_out > 0);
    lines.extend(thinned.map(ToString::to_string));
    if summary.events_left_out > 0 {
        lines.push(format!("events.csv: the last {} events are left out", summary.events_left_out));
    }
    if let Some(flight) = &summary.flight {
        lines.push(format!("flight recorder: {flight}"));
    }
    if let Some(dir) = dir {
        lines.push(format!("{} in {dir}", number(summary.files.len(), "file")));
    }
}

/// What became of the scenario's expectations, last, since it is what one looks for.
fn verdicts(summary: &Summary, lines: &mut Vec<String>) {
    if !summary.verdicts.is_empty() {
        lines.push(String::new());
        lines.extend(verdict::page::lines(&summary.verdicts));
    }
}

/// Lines of a table whose columns are as wide as their widest cell; the columns of `left` are flush left, the others
/// flush right.
pub(super) fn aligned(header: &[&str], left: &[usize], rows: &[Vec<String>]) -> Vec<String> {
    let header = header.iter().map(|&title| title.to_owned()).collect::<Vec<_>>();
    let all = || std::iter::once(&header).chain(rows);
    let width = |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..header.len()).map(width).collect();
    let cell = |(column, text): (usize, &String)| {
        let width = widths[column];
        if left.contains(&column) { format!("{text:<width$}") } else { format!("{text:>width$}") }
    };
    all().map(|row| row.iter().enumerate().map(cell).collect::<Vec<_>>().join("  ")).collect()
}

fn span(span: Option<Span>) -> String {
    span.map_or_else(|| "-".to_owned(), |span| span.to_string())
}
/// The times of the cycle in one line; without SYNCH there are no T_I and T_O.
fn times(timing: &Timing) -> String {
    let t_dx = at("up to", timing.t_dx_max);
    if timing.t_i_min.is_none() && timing.t_o_min.is_none() {
        return format!("no SYNCH   T_cycle {} planned, with a GAP poll   T_DX {t_dx}", timing.t_dp);
    }
    format!(
        "T_DP {}   T_DX {t_dx}, leaves {}   T_I {}   T_O {}   spare {}",
        timing.t_dp,
        span(timing.left),
        range(timing.t_i_min, timing.t_i_max),
        range(timing.t_o_min, timing.t_o_max),
        at("from", timing.spare_min),
    )
}
fn at(word: &str, limit: Option<Span>) -> String {
    limit.map_or_else(|| "-".to_owned(), |limit| format!("{word} {limit}"))
}
fn range(low: Option<Span>, high: Option<Span>) -> String {
    let (low, high) = (span(low), span(high));
    if low == high { low } else { format!("{low} to {high}") }
}
/// `1 slave`, `2 slaves`, `3 retries`.
pub(super) fn number(count: impl TryInto<u64>, noun: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    match noun.strip_suffix('y') {
        _ if count == 1 => format!("1 {noun}"),
        Some(stem) => format!("{count} {stem}ies"),
        None => format!("{count} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample;

    /// A run of `slaves` slaves, of which 3 + 10 n has n faults, and as many links.
    fn summary(slaves: u8) -> Summary {
        let mut summary = sample::run();
        let (slave, link) = (summary.slaves[1].clone(), summary.links[0].clone());
        summary.slaves =
            (3..3 + slaves).map(|address| SlaveSummary { address, faults: Vec::new(), ..slave.clone() }).collect();
        let station = summary.live_list[2];
        let remarkable = |address| StationSummary { address, lost: u64::from(address) % 10, ..station };
        summary.live_list = (3..3 + slaves).map(remarkable).collect();
        summary.links = (3..3 + slaves).map(|publisher| LinkSummary { publisher, ..link.clone() }).collect();
        for (number, slave) in summary.slaves.iter_mut().step_by(10).enumerate() {
            slave.faults = vec![("0F04".to_owned(), number as u64)];
        }
        summary
    }

    #[test]
    fn a_run_fits_a_screen() {
        let text = render(&sample::run(), Some("out/sample"));
        let expected = "\
sample: master 1, 2 slaves, 1 link, 12 Mbit/s, 3 cycles in 10 s, seed 1
T_DP 1 ms   T_DX up to 449 us, leaves 551 us   T_I 125 us   T_O 625 us   spare from 300 us
1 fault, 2 retries

slave  device   state      phase                 lock  PLL error p99     max  latch offset mean    max  faults
    3  encoder  POWER_ON   1 configuration          -              -       -                  -      -  -
    5  encoder  DATA_EXCH  5 operation      20 cycles          42 ns  -42 ns              45 ns  45 ns  1 x 0F04
LEDs red dark, green dark at slave 3: no supply

live list: 3 stations, lost 1, syncs 2, repeats 2, illegal 0, diagnoses 2   cycle time 1 ms to 1.001 ms, mean 1.001 ms
station  worst state  lost  syncs  repeats  most in a cycle  illegal  diagnoses
      3  missing         0      0        0                0        0          0
      5  lost            1      2        2                2        0          2

latch skew: p50 90 ns, p90 90 ns, p99 90 ns, p99.9 90 ns, max 90 ns, 0.250 steps

publish latency     p50     p90     p99   p99.9     max  age at use max  valid  lost  wrong length  longest gap
         3 -> 5  400 us  400 us  400 us  400 us  400 us          750 us      0     0             0            -

fingerprint: wire 0123456789abcdef
2 files in out/sample
";
        assert_eq!(text, expected, "\n{text}");
    }

    #[test]
    fn eight_slaves_and_links_fit_forty_lines() {
        let text = render(&summary(8), Some("out/sample"));
        assert!(text.lines().count() <= 40, "{text}");
    }

    #[test]
    fn of_many_slaves_the_worst_are_shown_and_the_rest_is_counted() {
        let text = render(&summary(100), None);
        assert!(text.lines().count() <= 45, "{text}");
        assert!(text.contains("the 16 worst of 100 slaves; 84 more are no worse\n"), "{text}");
        assert!(text.contains("the 8 slowest of 100 links; 92 more are no slower\n"), "{text}");
        for (number, slave) in (13..=93).step_by(10).enumerate() {
            let line = text
                .lines()
                .find(|line| line.starts_with(&format!("{slave:>5}  ")))
                .unwrap_or_else(|| panic!("no {slave} in\n{text}"));
            assert!(line.ends_with(&format!("{} x 0F04", number + 1)), "{line}");
        }
    }

    #[test]
    fn of_many_remarkable_stations_the_worst_are_shown() {
        let mut summary = summary(100);
        summary.live_list[50].seen = Seen::Missing;
        let text = render(&summary, None);
        let rows = text.lines().skip_while(|line| !line.starts_with("station")).skip(1).take(STATIONS);
        let shown: Vec<&str> = rows.filter_map(|row| row.split_whitespace().next()).collect();
        assert_eq!(shown, ["9", "19", "29", "53"], "{text}");
        assert!(text.contains("the 4 worst stations; 96 more are remarkable, see live-list.txt\n"), "{text}");
    }

    #[test]
    fn a_network_without_trouble_needs_one_line() {
        let mut summary = sample::run();
        let good = StationSummary { seen: Seen::Exchanging, lost: 0, syncs: 1, repeats: 0, ..summary.live_list[2] };
        summary.live_list = vec![StationSummary { seen: Seen::Master, syncs: 0, ..good }, good];
        let text = render(&summary, None);
        assert!(text.contains("\nlive list: 2 stations, lost 0, syncs 1, repeats 0,"), "{text}");
        assert!(!text.contains("worst state"), "{text}");
    }

    #[test]
    fn warnings_are_told_where_the_bus_is() {
        let mut summary = sample::run();
        summary.warnings = vec!["too slow".to_owned()];
        assert!(render(&summary, None).contains("\n1 fault, 2 retries\nwarning: too slow\n\nslave"));
    }

    #[test]
    fn slaves_with_the_same_leds_share_a_line() {
        let mut summary = summary(9);
        for slave in &mut summary.slaves {
            let leds = if slave.address == 7 { Leds::Refused } else { Leds::NotAddressed };
            slave.leds = (slave.address != 10).then(|| LedSummary::of(leds));
        }
        let text = render(&summary, None);
        assert!(
            text.contains("\nLEDs red bright, green flashing at slave 7: parameters or configuration refused"),
            "{text}"
        );
        assert!(
            text.contains("\nLEDs red flashing, green bright at slave 3..6, 8, 9, 11: ready, its master"),
            "{text}"
        );
        assert_eq!(text.matches("LEDs").count(), 2, "{text}");
    }

    #[test]
    fn what_a_table_left_out_is_said() {
        let mut summary = sample::run();
        summary.thinning[0].rows_left_out = 7;
        summary.events_left_out = 9;
        let text = render(&summary, None);
        assert!(text.contains("\ncycles.csv: cycles 0 to 511, one in 1,"), "{text}");
        assert!(text.ends_with("; 7 rows left out\nevents.csv: the last 9 events are left out\n"), "{text}");
    }

    #[test]
    fn of_many_faults_the_first_ones_are_shown_with_what_replays_them() {
        let fault = |slave: u8| FaultSummary {
            slave,
            code: "0F04".to_owned(),
            cycle: 100 + u64::from(slave),
            at: Span::from_ms(1),
            count: 1 + u64::from(slave % 2),
            replay: format!("isodp replay a.toml --seed 1 --cycle {} --window 5", 100 + u64::from(slave)),
        };
        let lines = |summary: &Summary| {
            let mut lines = Vec::new();
            faults(summary, &mut lines);
            lines
        };
        let mut summary = sample::run();
        assert!(lines(&summary).is_empty());
        summary.counts.faults = 2;
        summary.first_faults = vec![fault(3)];
        summary.files = Vec::new();
        let first = "0F04 of slave 3 in cycle 103, the first of 2: isodp replay a.toml --seed 1 --cycle 103 --window 5";
        assert_eq!(lines(&summary), ["", first, "and 1 more"]);
        summary.counts.faults = 30;
        summary.first_faults = (3..23).map(fault).collect();
        summary.files = vec!["events.csv".to_owned()];
        let all = lines(&summary);
        assert_eq!((all.len(), all.last().map(String::as_str)), (2 + FAULTS, Some("and 22 more in events.csv")));
        summary.counts.faults = 1;
        summary.first_faults = vec![fault(4)];
        assert_eq!(lines(&summary).len(), 2);
    }
}
