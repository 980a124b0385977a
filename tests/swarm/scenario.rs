//! Random scenarios as text. They are meant to be valid: times come from the planner's proposal, and what goes wrong
//! is over at [`Case::quiet`], where everything is ordered back to normal.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::disturbance::{Scene, disturbance};
use super::draw::Draw;
use isodp::fdl::params::BusParams;
use isodp::study::plan::proposal::Proposal;
use isodp::study::scenario::Scenario;
use isodp::time::{BitRate, Span};
use isodp::wire::Address;

/// GSD files are looked for beside this file, which does not exist.
const SOURCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/swarm.toml");
const ENCODERS: [&str; 7] = [
    "\"posital-ocd-dpb1b\"",
    "\"posital-ocd-dpb1b\"",
    "\"scancon-sag-dpb1b\"",
    "\"simodrive-sensor-isochron\"",
    "{ gsd = \"gsd/isodp_posital_06df.gsd\" }",
    "{ gsd = \"gsd/isodp_posital_06df.gsd\", module = \"Telegram 81\" }",
    "{ gsd = \"gsd/isodp_scancon_06df.gsd\" }",
];
const DRIVES: [&str; 2] = ["\"subscriber-drive\"", "\"coupled-drive\""];

/// A slave of the scenario being drawn.
#[derive(Clone, Copy)]
pub(super) struct Member {
    pub(super) address: u8,
    /// Address of its master.
    master: u8,
    device: &'static str,
    /// Takes Sync and Freeze, and belongs to group 1.
    holds: bool,
}

/// A drawn scenario.
pub(super) struct Case {
    pub(super) text: String,
    /// Instant by which every event is over.
    pub(super) quiet: Span,
    /// One cycle of the first master, or what stands for it where that is free-running.
    pub(super) cycle: Span,
    /// Whether a master loses its supply or its telegrams, or comes later: then the token may be lost and made twice.
    pub(super) token_at_risk: bool,
    /// Class 2 masters with jobs that go on and on.
    pub(super) asking: Vec<u8>,
    /// The last cycle with a disturbance.
    pub(super) last_cycle: u64,
    /// Whether masters are restarted at the end.
    pub(super) restarts: bool,
}

impl Case {
    /// The same, with the supply of these masters off for a cycle at `at`, when all else is over.
    pub(super) fn with_restarts(mut self, masters: &BTreeSet<Address>, at: Span) -> Self {
        for master in masters {
            order(&mut self.text, at, &format!("do = \"power-off\"\nstation = {master}"));
            order(&mut self.text, at + self.cycle, &format!("do = \"power-on\"\nstation = {master}"));
        }
        self.quiet = at + self.cycle * 2;
        self.restarts = true;
        self
    }
    /// The scenario, or why it is refused.
    pub(super) fn scenario(&self) -> Result<Scenario, String> {
        Scenario::parse("swarm", SOURCE, &self.text, &[]).map_err(|error| error.to_string())
    }
}

/// What is drawn before the times are known.
pub(super) struct Network {
    pub(super) clocked: bool,
    master: u8,
    class1: Vec<u8>,
    class2: Vec<u8>,
    pub(super) slaves: Vec<Member>,
    /// Everything but `[run]` and the times of `[master]`.
    stations: String,
    /// Keys of `[master]` but times.
    master_keys: String,
    bus: String,
    rate: BitRate,
    pub(super) places: Places,
}

/// The scenario of this seed, or why not even its network can be planned.
pub(super) fn case(seed: u64) -> Result<Case, String> {
    let draw = &mut Draw::new(seed);
    let network = network(draw);
    let others = (network.class1.len() + network.class2.len()) as i64;
    let times = if network.clocked { "t_dp = \"32 ms\"\nt_i = \"375 us\"\nt_o = \"16 ms\"\n" } else { "" };
    let trial = network.text("cycles = 1", "t_tr = \"100000 tbit\"\n", times, "");
    let trial = Scenario::parse_to_plan("swarm", SOURCE, &trial, &[]).map_err(|error| format!("{error}\n{trial}"))?;
    let bit = network.rate.bit();
    let (times, cycle) = if network.clocked {
        times_of(draw, &trial, bit * 9_000 * others)?
    } else {
        (String::new(), trial.master.t_dp.max(Span::from_ms(1)))
    };
    // Others have T_TH in every rotation, and the isochronous master gets the token back before SYNCH.
    let t_tr = cycle.div_floor(bit) + 3_000 * others.max(1);
    let ring = format!("t_tr = \"{t_tr} tbit\"\n");
    let start_up = cycle * 60;
    let last = start_up + cycle * draw.within(100..=400);
    let (events, token_at_risk) = happenings(draw, &network, cycle, (start_up, last));
    // Connections take seconds to run out: not every network has the time.
    let share = draw.one(&[0, 0, 80]);
    let asking: Vec<u8> = network.class2.iter().copied().filter(|_| draw.percent(share)).collect();
    let jobs = jobs(draw, &network, &asking, cycle);
    let end = last + cycle * 100_000;
    let run = format!("seed = {}\nduration = \"{} us\"", seed % 1_000, end.ticks() / 12_000);
    let text = network.text(&run, &ring, &times, &[jobs, events].concat());
    Ok(Case { text, quiet: last + cycle, cycle, token_at_risk, asking, last_cycle: 60 + 400, restarts: false })
}

impl Network {
    fn text(&self, run: &str, ring: &str, times: &str, more: &str) -> String {
        let Self { bus, master, master_keys, stations, clocked, .. } = self;
        format!(
            "[run]\n{run}\n\n[bus]\n{bus}{ring}\n[master]\naddress = {master}\nisochronous = {clocked}\n{times}{master_keys}\n{stations}{more}"
        )
    }
}

/// T_DP, T_I, T_O and the window that the planner proposes, with `room` for other masters and more; and T_DP.
fn times_of(draw: &mut Draw, trial: &Scenario, room: Span) -> Result<(String, Span), String> {
    let proposal = Proposal::of(trial).map_err(|broken| {
        let broken: Vec<_> =
            broken.iter().filter_map(|found| found.fault.as_ref().map(|f| f.message.clone())).collect();
        format!("no proposal: {broken:?}")
    })?;
    let base = Span::from_us(125);
    let slaves = || proposal.scenario.configured().map(|slave| slave.times);
    let most = |of: &dyn Fn(isodp::study::scenario::IsoTimes) -> Span| slaves().map(of).max().unwrap_or_default();
    let (t_i, t_o, t_pll_w) = (most(&|t| t.t_i), most(&|t| t.t_o), most(&|t| t.t_pll_w));
    let t_o = t_o.ceil_to(base) + base * draw.within(0..=2);
    let t_i = t_i.max(base).ceil_to(base);
    let shortest = proposal.scenario.master.t_dp.max(t_o + t_i + Span::from_us(375));
    let more = if draw.percent(50) { Span::ZERO } else { shortest * draw.within(0..=100) };
    let more = Span::from_ticks(more.ticks() / 100);
    let t_dp = (shortest + room + more).ceil_to(base);
    let us = |span: Span| span.ticks() / 12_000;
    let window = t_pll_w.ticks().div_euclid(12) + i64::from(t_pll_w.ticks() % 12 != 0);
    let text = format!(
        "t_dp = \"{} us\"\nt_i = \"{} us\"\nt_o = \"{} us\"\nt_pll_w = \"{window} ns\"\n",
        us(t_dp),
        us(t_i),
        us(t_o)
    );
    Ok((text, t_dp))
}

fn network(draw: &mut Draw) -> Network {
    let clocked = draw.percent(75);
    let (name, rate) = draw.one(&[
        ("12 Mbit/s", BitRate::M12),
        ("12 Mbit/s", BitRate::M12),
        ("6 Mbit/s", BitRate::M6),
        ("3 Mbit/s", BitRate::M3),
        ("1.5 Mbit/s", BitRate::M1_5),
    ]);
    let count = match rate {
        _ if draw.percent(50) => draw.within(1..=5),
        BitRate::M1_5 => draw.within(1..=8),
        _ => draw.within(1..=20),
    };
    let hsa = draw.within(30..=45) as u8;
    let mut free: Vec<u8> = (0..=hsa).collect();
    let master = draw.take(&mut free);
    let class1: Vec<u8> = (0..draw.one(&[0, 0, 1, 1, 2])).map(|_| draw.take(&mut free)).collect();
    let class2: Vec<u8> = (0..draw.one(&[0, 0, 1, 1, 2])).map(|_| draw.take(&mut free)).collect();
    let places = places(draw, rate);
    let mut stations = places.text.clone();
    let slaves = slaves(draw, (count, &mut free), (master, &class1), clocked);
    for (i, slave) in slaves.iter().enumerate() {
        // A silent slave publishes nothing and takes no command: only those of others are.
        let first = i == 0 || slave.master == master;
        slave_text(draw, &mut stations, slave, (clocked && slave.master == master, first), (&places, rate));
    }
    links(draw, &mut stations, &slaves, master);
    for address in &class1 {
        let _ = write!(stations, "[[class1]]\naddress = {address}\n{}{}", places.of(draw), crystal(draw));
        if draw.percent(40) {
            let _ = writeln!(stations, "least_cycle = \"{} ms\"", draw.within(1..=5));
        }
        if draw.percent(30) {
            let _ = writeln!(stations, "get_cfg = false\nclear_for = 5");
        }
    }
    let bus = format!("rate = \"{name}\"\nhsa = {hsa}\ngap_factor = {}\n{}", draw.one(&[1, 1, 2, 5]), places.bus(rate));
    let master_keys = master_keys(draw, clocked, &places);
    Network { clocked, master, class1, class2, slaves, stations, master_keys, bus, rate, places }
}

/// Where stations can be.
pub(super) struct Places {
    pub(super) segments: Vec<&'static str>,
    /// Names of what joins them.
    pub(super) repeaters: Vec<String>,
    text: String,
    pub(super) cable_m: i64,
}

impl Places {
    /// The keys that put a station somewhere.
    fn of(&self, draw: &mut Draw) -> String {
        let position = format!("position = \"{} m\"\n", draw.within(0..=self.cable_m));
        if self.segments.is_empty() {
            position
        } else {
            format!("segment = \"{}\"\n{position}", draw.one(&self.segments))
        }
    }
    /// Keys of `[bus]`: T_SL has room for the longest path.
    fn bus(&self, rate: BitRate) -> String {
        if self.segments.is_empty() {
            return format!("cable = \"{} m\"\n", self.cable_m);
        }
        let slot = match rate {
            BitRate::M12 => 1_400,
            BitRate::M6 => 900,
            _ => 700,
        };
        format!("t_sl = \"{slot} tbit\"\n")
    }
}

fn places(draw: &mut Draw, rate: BitRate) -> Places {
    if draw.percent(55) {
        let cable_m = if rate == BitRate::M1_5 { draw.within(0..=190) } else { draw.within(0..=100) };
        return Places { segments: Vec::new(), repeaters: Vec::new(), text: String::new(), cable_m };
    }
    let segments = ["one", "two", "three", "four"][..draw.within(2..=4) as usize].to_vec();
    let cable_m = draw.within(1..=100);
    let mut text = String::new();
    for segment in &segments {
        let _ = writeln!(text, "[[segment]]\nname = \"{segment}\"\ncable = \"{cable_m} m\"");
    }
    let mut repeaters = Vec::new();
    for (i, to) in segments.iter().enumerate().skip(1) {
        let from = draw.one(&segments[..i]);
        repeaters.push(format!("{from} - {to}"));
        let kind = draw.one(&["repeater", "olm", "ilm"]);
        let _ = writeln!(text, "[[repeater]]\nkind = \"{kind}\"\nfrom = \"{from}\"\nto = \"{to}\"");
        if draw.percent(50) {
            let _ = writeln!(text, "jitter = \"{} ns\"", draw.within(1..=60));
        }
        if kind == "olm" {
            let longest = if segments.len() == 2 { 3_500 } else { 800 };
            let _ = writeln!(text, "fibre = \"{} m\"", draw.within(0..=longest));
        }
    }
    Places { segments, repeaters, text, cable_m }
}

fn crystal(draw: &mut Draw) -> String {
    match draw.within(0..=2) {
        0 => String::new(),
        1 => format!("crystal = \"{} ppm\"\n", draw.within(-50..=50)),
        _ => "crystal = { within = \"50 ppm\" }\n".to_owned(),
    }
}

/// The first slave is the first master's.
fn slaves(
    draw: &mut Draw,
    (count, free): (i64, &mut Vec<u8>),
    (master, class1): (u8, &[u8]),
    clocked: bool,
) -> Vec<Member> {
    let member = |i: i64, draw: &mut Draw, free: &mut Vec<u8>| {
        let master = if i > 0 && !class1.is_empty() && draw.percent(40) { draw.one(class1) } else { master };
        let main = !class1.contains(&master);
        let device = if main && clocked && draw.percent(20) { draw.one(&DRIVES) } else { draw.one(&ENCODERS) };
        let holds = main && device.contains("simodrive") && draw.percent(70);
        Member { address: draw.take(free), master, device, holds }
    };
    (0..count).map(|i| member(i, draw, free)).collect()
}

fn slave_text(
    draw: &mut Draw,
    text: &mut String,
    slave: &Member,
    (clocked, first): (bool, bool),
    (places, rate): (&Places, BitRate),
) {
    let Member { address, master, device, holds } = slave;
    let _ = write!(
        text,
        "[[slave]]\naddress = {address}\nmaster = {master}\ndevice = {device}\n{}{}",
        places.of(draw),
        crystal(draw)
    );
    if *holds {
        text.push_str("groups = [1]\nsync = true\nfreeze = true\n");
    }
    let drive = DRIVES.contains(device);
    if !drive && draw.percent(40) {
        let _ = writeln!(text, "motion = {{ kind = \"speed\", speed = \"{} rpm\" }}", draw.within(-3_000..=3_000));
    }
    if !drive && !device.contains("gsd") && draw.percent(20) {
        text.push_str("functions = true\ncode_sequence = \"ccw\"\n");
    }
    if draw.percent(15) {
        let _ = writeln!(text, "max_life_failures = {}", draw.within(1..=5));
    }
    if clocked && draw.percent(15) {
        let _ = writeln!(text, "clock_tolerance = {}", draw.within(1..=5));
    }
    if *device == ENCODERS[0] && draw.percent(25) {
        let _ = writeln!(text, "t_sdr = \"{} tbit\"", BusParams::profile(rate).max_tsdr.0);
    }
    if draw.percent(10) {
        text.push_str("ms2_connections = 3\n");
    }
    if draw.percent(10) {
        let _ = writeln!(text, "powered_at = \"{} ms\"", draw.within(1..=60));
    }
    if draw.percent(4) && !first {
        text.push_str("silent = true\n");
    }
}

fn links(draw: &mut Draw, text: &mut String, slaves: &[Member], master: u8) {
    let own = || slaves.iter().filter(|slave| slave.master == master);
    let publishers: Vec<u8> = own()
        .filter(|slave| slave.device.starts_with('"') && slave.device != DRIVES[0])
        .map(|slave| slave.address)
        .collect();
    for slave in own().filter(|slave| DRIVES.contains(&slave.device)) {
        for (i, publisher) in publishers.iter().filter(|&&publisher| publisher != slave.address).take(3).enumerate() {
            if draw.percent(30) {
                continue;
            }
            let _ = writeln!(text, "[[link]]\npublisher = {publisher}\nsubscriber = {}", slave.address);
            if draw.percent(50) && slave.device == DRIVES[0] {
                let _ = writeln!(text, "table = \"subscriber\"\nto = {}", 4 * i);
            }
        }
    }
}

fn master_keys(draw: &mut Draw, clocked: bool, places: &Places) -> String {
    let mut text = [places.of(draw), crystal(draw)].concat();
    if clocked {
        let us = match draw.within(0..=3) {
            0 => String::new(),
            1 => format!("gc_jitter = {{ kind = \"uniform\", half_width = \"{} ns\" }}\n", draw.within(1..=400)),
            2 => "gc_jitter = { kind = \"bounded-normal\", sigma = \"50 ns\", bound = \"200 ns\" }\n".to_owned(),
            _ => "gc_jitter = { kind = \"uniform\", half_width = \"100 ns\", accumulate = true }\n".to_owned(),
        };
        text.push_str(&us);
        if draw.percent(30) {
            text.push_str("active_spare = true\n");
        }
        if draw.percent(30) {
            let _ = writeln!(text, "t_mapc = {}", draw.within(1..=4));
        }
    }
    if draw.percent(30) {
        text.push_str("auto_clear = true\n");
    }
    if draw.percent(20) {
        let _ = writeln!(text, "get_cfg = false\nclear_for = {}", draw.within(0..=50));
    }
    if draw.percent(30) {
        let _ = writeln!(text, "dx_retries = {}\nlost_after = {}", draw.within(0..=3), draw.within(1..=12));
    }
    text
}

fn jobs(draw: &mut Draw, network: &Network, asking: &[u8], cycle: Span) -> String {
    let mut text = String::new();
    // With one request per token, each of these slaves is polled once in so many rotations.
    let timeout = Span::from_ms(100).max(cycle * 4 * network.slaves.len() as i64).ceil_to(Span::from_ms(10));
    for address in &network.class2 {
        let _ = write!(
            text,
            "[[class2]]\naddress = {address}\nresponse_timeout = \"{timeout}\"\nper_token = {}\n",
            draw.within(1..=4)
        );
        text.push_str(&network.place_of_tools());
        if draw.percent(30) {
            let _ = writeln!(text, "powered_at = \"{} ms\"", draw.within(1..=100));
        }
        if !asking.contains(address) {
            continue;
        }
        for i in 0..draw.within(1..=3) {
            let service = draw.one(&[
                "\"parameter-read\"\nparameters = [918, 964, 979]",
                "\"parameter-read\"\nparameters = [922]",
                "\"record-write\"\nindex = 47\ndata = [0x00]\nlength = 40",
                "\"rd-inp\"",
                "\"get-cfg\"",
                "\"diagnosis\"",
            ]);
            let slave = draw.one(&network.slaves).address;
            let whom = if draw.percent(30) { "slaves = \"all\"".to_owned() } else { format!("slave = {slave}") };
            let period = draw.within(0..=20).max(i64::from(i > 0));
            let period = if period == 0 { "1 us".to_owned() } else { format!("{period} ms") };
            let _ = writeln!(
                text,
                "[[class2.job]]\nservice = {service}\n{whom}\nstart = \"{} ms\"\nperiod = \"{period}\"",
                draw.within(0..=100)
            );
        }
    }
    text
}

impl Network {
    /// All masters.
    pub(super) fn masters(&self) -> Vec<u8> {
        [&[self.master][..], &self.class1, &self.class2].concat()
    }
    /// The slaves of the first master.
    pub(super) fn own(&self) -> impl Iterator<Item = &Member> {
        self.slaves.iter().filter(|slave| slave.master == self.master)
    }
    /// Class 2 masters sit where the first segment begins.
    fn place_of_tools(&self) -> String {
        if self.stations.starts_with("[[segment]]") { "segment = \"one\"\n".to_owned() } else { String::new() }
    }
}

/// Events and disturbances between the two instants, and orders at the end that put everything right. Whether the
/// token is at risk.
fn happenings(draw: &mut Draw, network: &Network, cycle: Span, (from, to): (Span, Span)) -> (String, bool) {
    let mut text = String::new();
    let mut at_risk = false;
    let mut event = |at: Span, what: &str| order(&mut text, at, what);
    let own: Vec<&Member> = network.slaves.iter().filter(|slave| slave.master == network.master).collect();
    let length = (to - from).div_floor(cycle);
    let mut patched = Vec::new();
    for _ in 0..draw.within(0..=6) {
        let first = draw.within(0..=length - 20);
        // Anywhere in the cycle.
        let at = from + cycle * first + Span::from_ticks(draw.within(0..=cycle.ticks() - 1));
        let back = at + cycle * draw.within(1..=(length - first - 5).min(60));
        let slave = draw.one(&network.slaves);
        let whom = format!("slave = {}", slave.address);
        let holds = own.iter().any(|slave| slave.holds);
        match draw.within(0..=9) {
            0 => {
                event(at, &format!("do = \"power-off\"\n{whom}"));
                event(back, &format!("do = \"power-on\"\n{whom}"));
            }
            1 => {
                let masters = [&[network.master][..], &network.class1, &network.class2].concat();
                let whom = format!("station = {}", draw.one(&masters));
                event(at, &format!("do = \"power-off\"\n{whom}"));
                event(back, &format!("do = \"power-on\"\n{whom}"));
                at_risk = true;
            }
            2 => {
                let patch = draw.one(&["octets = [[6, 1]]", "length = 3", "octets = [[8, 255], [2, 0]]", ""]);
                let telegram = draw.one(&["set-prm", "chk-cfg"]);
                patched.push(slave.address);
                event(at, &format!("do = \"{telegram}\"\n{patch}\n{whom}"));
                event(back, &format!("do = \"{telegram}\"\n{whom}"));
            }
            3 => {
                event(at, "do = \"clear\"");
                event(back, "do = \"operate\"");
            }
            4 if holds => {
                let groups = draw.one(&["", "groups = [1]"]);
                let (on, off) = draw.one(&[("sync", "unsync"), ("freeze", "unfreeze")]);
                event(at, &format!("do = \"{on}\"\n{groups}"));
                event(back, &format!("do = \"{off}\"\n{groups}"));
            }
            5 => event(at, &format!("do = \"hold-life-sign\"\nfor = {}\n{whom}", draw.within(1..=30))),
            6 => event(at, &format!("do = \"jump-life-sign\"\nto = {}\n{whom}", draw.within(0..=15))),
            7 => event(
                at,
                &format!("do = \"read-parameter\"\nparameter = {}\n{whom}", draw.one(&[918, 964, 922, 65_000])),
            ),
            8 => event(
                at,
                &format!("do = \"change-parameter\"\nparameter = {}\nvalue = 7\n{whom}", draw.one(&[918, 974, 10])),
            ),
            _ => {
                let value = draw.one(&["0x2000", "0x4000", "0x1000", "0x8000"]);
                event(at, &format!("do = \"control-word\"\nvalue = {value}\n{whom}"));
                event(back, &format!("do = \"control-word\"\nvalue = 0\n{whom}"));
            }
        }
    }
    back_in_order(&mut text, &patched, own.iter().any(|slave| slave.holds), (to, cycle));
    let scene = Scene { network, cycles: (60, 60 + length), times: (from, to), cycle };
    for _ in 0..draw.one(&[0, 0, 1, 2, 3, 5]) {
        at_risk |= disturbance(draw, &mut text, &scene);
    }
    (text, at_risk)
}

/// An event at an instant.
fn order(text: &mut String, at: Span, what: &str) {
    let _ = writeln!(text, "[[event]]\nat = \"{} us\"\n{what}", at.ticks() / 12_000);
}

/// The end of all of it. What is ordered of a master without supply is not heard, so that good telegrams come again.
fn back_in_order(text: &mut String, patched: &[u8], holds: bool, (to, cycle): (Span, Span)) {
    for slave in patched {
        for telegram in ["set-prm", "chk-cfg"] {
            order(text, to - cycle, &format!("do = \"{telegram}\"\nslave = {slave}"));
        }
    }
    // One that was spoilt on its way is not said again by itself.
    for command in ["unsync", "unfreeze"].into_iter().filter(|_| holds) {
        order(text, to, &format!("do = \"{command}\""));
    }
    order(text, to, "do = \"operate\"");
    order(text, to, "do = \"control-word\"\nvalue = 0\nslaves = \"all\"");
    order(text, to, "do = \"acknowledge\"\nslaves = \"all\"");
}
