//! Random disturbances of every kind, each with a window that ends.

use std::fmt::Write as _;

use super::draw::Draw;
use super::scenario::Network;
use isodp::time::Span;

/// What a disturbance is drawn from.
pub(super) struct Scene<'a> {
    pub(super) network: &'a Network,
    /// First cycle in which something may go wrong, and the one by which all is over.
    pub(super) cycles: (i64, i64),
    /// The same as instants.
    pub(super) times: (Span, Span),
    /// One cycle.
    pub(super) cycle: Span,
}

/// A disturbance as text.
#[derive(Default)]
pub(super) struct Drawn {
    /// Its own keys.
    keys: String,
    /// Whether a token may be lost or made twice.
    pub(super) token_at_risk: bool,
}

impl Drawn {
    fn new(keys: impl Into<String>, token_at_risk: bool) -> Self {
        Self { keys: keys.into(), token_at_risk }
    }
}

/// A kind and its own keys; none where this network cannot have it.
type Generator = fn(&mut Draw, &Scene<'_>) -> Option<Drawn>;

/// Every kind that a scenario can name.
pub(super) const KINDS: &[(&str, Generator)] = &[
    ("missing-clocks", |draw, scene| {
        let manner = manner(draw);
        scene.network.clocked.then(|| Drawn::new(manner, false))
    }),
    ("lost-telegrams", |draw, scene| Some(telegrams(draw, scene, ""))),
    ("late-telegrams", |draw, scene| {
        let by = draw.one(&["by", "up_to"]);
        let late = format!("{by} = \"{} ns\"\n", draw.within(0..=50_000));
        let drawn = telegrams(draw, scene, &late);
        // Whatever comes late may come when somebody else sends.
        Some(Drawn { token_at_risk: true, ..drawn })
    }),
    ("duplicate-telegrams", |draw, scene| {
        let after = format!("after = \"{} ns\"\n", draw.within(0..=20_000));
        let drawn = telegrams(draw, scene, &after);
        Some(Drawn { token_at_risk: true, ..drawn })
    }),
    ("bit-errors", |draw, scene| {
        let rate = draw.one(&["1e-6", "1e-5", "1e-4", "1e-3", "1e-2"]);
        let whom = whom(draw, scene);
        Some(Drawn::new(format!("rate = \"{rate}\"\n{}", whom.keys), true))
    }),
    ("wrong-octet", |draw, scene| {
        let (octet, flip) = (draw.within(1..=24), draw.within(1..=255));
        let parity = draw.one(&["", "parity = \"good\"\n", "parity = \"sent\"\n"]);
        let wrong = format!("octet = {octet}\nflip = {flip}\n{parity}");
        let drawn = telegrams(draw, scene, &wrong);
        Some(Drawn { token_at_risk: true, ..drawn })
    }),
    ("noise", |draw, scene| {
        let mean = match draw.within(0..=2) {
            0 => String::new(),
            _ => format!("mean = \"{} us\"\n", draw.within(20..=20_000)),
        };
        let octets = draw.within(1..=9);
        let keys = format!("{mean}octets = {octets}\noctets_to = {}\n", octets + draw.within(0..=20));
        Some(Drawn::new(keys + &near(draw, scene), true))
    }),
    ("foreign-telegram", |draw, scene| {
        let slave = draw.one(&scene.network.slaves).address;
        let (from, to) = (draw.one(&scene.network.masters()), draw.one(&scene.network.masters()));
        let what = match draw.within(0..=4) {
            0 => format!("token = {{ to = {to}, from = {from} }}\n"),
            1 => format!("token = {{ to = {}, from = {from} }}\n", draw.within(0..=125)),
            2 => format!("data = {{ to = {slave}, from = {from}, fc = 0x7D, dsap = 60, ssap = 62 }}\n"),
            3 => format!("data = {{ to = {slave}, from = {from}, fc = 0x5D, du = \"00 00 04 00\" }}\n"),
            _ => "octets = \"68 05 05 68 FF 00\"\n".to_owned(),
        };
        let after = format!("after = \"{} us\"\n", draw.within(0..=1_000));
        Some(Drawn::new(what + &after + &near(draw, scene), true))
    }),
    ("late-token", |draw, scene| {
        let master = draw.one(&scene.network.masters());
        Some(Drawn::new(format!("station = {master}\nby = \"{} us\"\n", draw.within(0..=500)), true))
    }),
    ("overlong-acyclic", |draw, scene| {
        let to = slave(draw, scene, "").keys.replace("station", "to");
        // It may be the master of a slave that hears the next SYNCH late.
        Some(Drawn::new(format!("{to}octets = {}\n", draw.within(1..=240)), true))
    }),
    ("silent", |draw, scene| Some(station(draw, scene))),
    ("mute", |draw, scene| Some(station(draw, scene))),
    ("deaf", |draw, scene| Some(station(draw, scene))),
    ("restart", |draw, scene| Some(station(draw, scene))),
    ("gc-jitter", |draw, scene| {
        let ns = |draw: &mut Draw| draw.within(1..=2_000);
        let shape = match draw.within(0..=6) {
            0 => format!("shape = \"uniform\"\nhalf_width = \"{} ns\"\n", ns(draw)),
            1 => format!("shape = \"normal\"\nsigma = \"{} ns\"\n", ns(draw) / 4 + 1),
            2 => "shape = \"bounded-normal\"\nsigma = \"100 ns\"\nbound = \"300 ns\"\n".to_owned(),
            3 => format!("shape = \"sine\"\namplitude = \"{} ns\"\nperiod = {}\n", ns(draw), draw.within(2..=100)),
            4 => format!("shape = \"step\"\noffset = \"-{} ns\"\n", ns(draw)),
            5 => format!("shape = \"drift\"\nper_cycle = \"{} ns\"\nbound = \"2 us\"\n", draw.within(-50..=50)),
            _ => "shape = \"table\"\noffsets = [\"0 ns\", \"900 ns\", \"-1 us\"]\n".to_owned(),
        };
        let accumulate = if draw.percent(20) { "accumulate = true\n" } else { "" };
        scene.network.clocked.then(|| Drawn::new(shape + accumulate, false))
    }),
    ("crystal-offset", |draw, scene| {
        let offset = format!("offset = \"{} ppm\"\n", draw.within(-100..=100));
        Some(Drawn::new(station(draw, scene).keys + &offset, false))
    }),
    ("crystal-wander", |draw, scene| {
        let step = draw.within(10..=2_000);
        let (interval, bound) = (draw.within(200..=20_000), draw.within(2..=50));
        let walk = format!("step = \"{step} ppb\"\ninterval = \"{interval} us\"\nbound = \"{bound} ppm\"\n");
        Some(Drawn::new(station(draw, scene).keys + &walk, false))
    }),
    ("temperature-step", |draw, scene| {
        let constant = draw.within(1..=100);
        let step = format!(
            "offset = \"{} ppm\"\ntime_constant = \"{constant} ms\"\ninterval = \"1 ms\"\n",
            draw.within(-50..=50)
        );
        Some(Drawn::new(station(draw, scene).keys + &step, false))
    }),
    ("receiver-jitter", |draw, scene| {
        let width = format!("half_width = \"{} ns\"\n", draw.within(0..=1_000));
        Some(Drawn { keys: station(draw, scene).keys + &width, token_at_risk: true })
    }),
    ("repeater-jitter", |draw, scene| {
        let repeaters = &scene.network.places.repeaters;
        let number = draw.within(0..=2) as usize;
        let keys = format!("half_width = \"{} ns\"\n", draw.within(0..=200));
        let repeater = repeaters.get(number % repeaters.len().max(1))?;
        Some(Drawn::new(format!("repeater = \"{repeater}\"\n{keys}"), true))
    }),
    ("t-sdr-jitter", |draw, scene| {
        let slower = match draw.within(0..=2) {
            0 => format!("by = \"{} tbit\"\n", draw.within(0..=300)),
            1 => format!("up_to = \"{} tbit\"\n", draw.within(0..=300)),
            _ => format!("by = \"{} us\"\nup_to = \"5 us\"\n", draw.within(0..=100)),
        };
        Some(slave(draw, scene, &slower)).map(|drawn| Drawn { token_at_risk: true, ..drawn })
    }),
    ("cable-cut", |draw, scene| {
        let places = &scene.network.places;
        let segment = match &places.segments[..] {
            [] => String::new(),
            segments => format!("segment = \"{}\"\n", draw.one(segments)),
        };
        let position = draw.within(1..=(places.cable_m - 1).max(1));
        (position < places.cable_m).then(|| Drawn::new(format!("{segment}position = \"{position} m\"\n"), true))
    }),
    ("hold-life-sign", |draw, scene| Some(slave(draw, scene, ""))),
    ("jump-life-sign", |draw, scene| {
        let to = format!("to = {}\n", draw.within(0..=15));
        Some(slave(draw, scene, &to))
    }),
    ("repeat-life-sign", |draw, scene| Some(slave(draw, scene, ""))),
    ("wrong-parameters", |draw, scene| {
        let patch = draw.one(&["octets = [[6, 1]]\n", "length = 3\n", "octets = [[8, 255], [2, 0]]\n", "length = 0\n"]);
        Some(slave(draw, scene, patch))
    }),
];

/// One disturbance of any kind.
pub(super) fn disturbance(draw: &mut Draw, text: &mut String, scene: &Scene<'_>) -> bool {
    let (kind, generator) = draw.one(KINDS);
    let Some(drawn) = generator(draw, scene) else { return false };
    // Without its supply the master begins no cycles, and nothing is counted in them.
    let in_cycles = kind != "restart" && draw.percent(50);
    let window = window(draw, scene, in_cycles);
    let _ = write!(text, "[[disturbance]]\nkind = \"{kind}\"\n{}{window}", drawn.keys);
    drawn.token_at_risk
}

/// When it acts: in cycles or at instants, once or several times, over by the end of the scene.
fn window(draw: &mut Draw, scene: &Scene<'_>, in_cycles: bool) -> String {
    let (from, to) = scene.cycles;
    let first = draw.within(from..=to - 20);
    let room = to - first - 5;
    let longest = draw.one(&[1, 3, 15, 15, 60]);
    let length = draw.within(1..=room.min(longest));
    let every = draw.within(length..=length * 4);
    let times = (room / every).max(1);
    let repeated = draw.percent(30) && times > 1;
    let times = draw.within(1..=times);
    if in_cycles {
        let again = if repeated { format!("every = {every}\ntimes = {times}\n") } else { String::new() };
        return format!("cycle = {first}\nfor = {length}\n{again}");
    }
    let us = |span: Span| span.ticks() / 12_000;
    let (begin, end) = scene.times;
    // Anywhere in the cycle.
    let at =
        (begin + scene.cycle * (first - from) + Span::from_ticks(draw.within(0..=scene.cycle.ticks() - 1))).min(end);
    let part = draw.within(1..=100);
    let length = us(scene.cycle * length) * part / 100 + 1;
    let every = us(scene.cycle * every) + 1;
    let again = if repeated { format!("every = \"{every} us\"\ntimes = {times}\n") } else { String::new() };
    format!("at = \"{} us\"\nfor = \"{length} us\"\n{again}", us(at))
}

/// Telegrams of anybody, some or all of them.
fn telegrams(draw: &mut Draw, scene: &Scene<'_>, keys: &str) -> Drawn {
    let whom = whom(draw, scene);
    Drawn { keys: [keys, &whom.keys, &manner(draw)].concat(), ..whom }
}

/// Whose telegrams, and of which service.
fn whom(draw: &mut Draw, scene: &Scene<'_>) -> Drawn {
    let network = scene.network;
    let slave = draw.one(&network.slaves).address;
    let services = [
        "any",
        "all",
        "requests",
        "replies",
        "synch",
        "global-control",
        "data-exchange",
        "diagnosis",
        "set-prm",
        "chk-cfg",
        "fdl-status",
        "token",
        "acyclic",
    ];
    match draw.within(0..=5) {
        0 => Drawn::new(format!("from = {slave}\n"), false),
        // A token counts as taken when its next holder is heard: what one asks then may be lost.
        1 => Drawn::new(format!("to = {slave}\n"), true),
        2 => Drawn::new(format!("from = {slave}\nservice = \"data-exchange\"\n"), false),
        3 => Drawn::new(format!("from = {}\n", draw.one(&network.masters())), true),
        4 => Drawn::new(format!("service = \"{}\"\n", draw.one(&services)), true),
        _ => Drawn::new("", true),
    }
}

/// At whose place it comes onto the line.
fn near(draw: &mut Draw, scene: &Scene<'_>) -> String {
    let stations: Vec<u8> = scene.network.slaves.iter().map(|slave| slave.address).collect();
    if draw.percent(50) { String::new() } else { format!("near = {}\n", draw.one(&stations)) }
}

/// How many of them.
fn manner(draw: &mut Draw) -> String {
    match draw.within(0..=5) {
        0 => format!("rate = \"{} %\"\n", draw.within(0..=100)),
        1 => format!("telegrams = {}\n", draw.within(0..=5)),
        2 => format!("pattern = \"{}\"\n", draw.one(&["x", ".x", "xx...", "x.x.x....."])),
        _ => String::new(),
    }
}

/// One station or several, masters too.
fn station(draw: &mut Draw, scene: &Scene<'_>) -> Drawn {
    match draw.within(0..=3) {
        0 => Drawn::new("stations = \"all slaves\"\n", true),
        1 => Drawn::new(format!("station = {}\n", draw.one(&scene.network.masters())), true),
        // A slave that nobody hears costs its master's time, and with it perhaps the token.
        _ => Drawn::new(format!("station = {}\n", draw.one(&scene.network.slaves).address), true),
    }
}

/// A slave of the first master, which is never silent.
fn slave(draw: &mut Draw, scene: &Scene<'_>, keys: &str) -> Drawn {
    let own: Vec<u8> = scene.network.own().map(|slave| slave.address).collect();
    Drawn::new(format!("{keys}station = {}\n", draw.one(&own)), false)
}
