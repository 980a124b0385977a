//! VCD: a recording as wave forms (Value Change Dump, IEEE 1364), for GTKWave, Surfer and other viewers.
//!
//! | scope | variable | |
//! |---|---|---|
//! | `isodp` | `recorded` | 1 inside a stretch; outside everything is unknown (`x`, `NaN`) |
//! | | `cycle` | number of the bus cycle |
//! | | `trigger` | the latest trigger of the stretch |
//! | `isodp.bus` | `busy`, `sender` | a telegram is on the line at its sender, and whose; `z` where nobody sends |
//! | | `synch` | SYNCH is on the line; it falls at t0 |
//! | `isodp.master_N` | `mode` | operation mode |
//! | `isodp.slave_N` | `latch`, `t_o` | rises at the latch and at T_O; 1 us wide, so that it can be seen |
//! | | `state`, `phase`, `pll` | DP state, start-up phase, state of the clock recovery |
//! | | `pll_error_ns`, `window_ns` | as the slave judged the latest SYNCH |
//! | | `clock_failures`, `life_failures` | failure counters, ten per failure |
//! | | `master_life`, `own_life` | signs of life at T_O |
//! | | `fault` | code in `G1_XIST2`, 0 without one (manual 5.3) |
//!
//! One unit of time is 1 ps, for stretches after 200 days 100 ps: a tick of 1/12 ns is none, instants are rounded to the
//! nearest unit. Words stand for states, with `_` for blanks.

use std::io::{self, Write};

use vcd::{IdCode, TimescaleUnit, Value, VarType, Writer};

use crate::observation::{ClockVerdict, Observation};
use crate::study::flight::stretch::{Entry, Standing, Stretch, What};
use crate::study::flight::{Recorded, Recording};
use crate::time::{Span, Time};
use crate::wire::Address;
use crate::wire::control::GlobalControl;
use crate::wire::{Sap, Telegram};

/// How long a latch and a T_O stay up.
const PULSE: Span = Span::from_us(1);
/// Until here 64 bits hold picoseconds.
const LONG: Span = Span::from_s(200 * 86_400);

/// Writes every stretch.
///
/// # Errors
/// Of `out`.
pub fn write(recording: &Recording, out: &mut dyn Write) -> io::Result<()> {
    let end = recording.stretches.last().map_or(Span::ZERO, |stretch| stretch.end.since_zero());
    let picoseconds = if end < LONG { 1 } else { 100 };
    let mut writer = Writer::new(out);
    let Recorded { scenario, seed, .. } = &recording.network;
    writer.version(&format!("isodp {}", env!("CARGO_PKG_VERSION")))?;
    writer.comment(&format!("{scenario}, seed {seed}; time 0 is power-on (true time)"))?;
    writer.timescale(picoseconds, TimescaleUnit::PS)?;
    let mut wave = Wave::new(&mut writer, &recording.network)?;
    for stretch in &recording.stretches {
        wave.stretch(stretch);
    }
    wave.emit(&mut writer, i128::from(picoseconds))
}

/// What a variable becomes.
#[derive(Clone, PartialEq, Debug)]
enum Level {
    Bit(bool),
    /// A number of so many bits.
    Bits(u64, u32),
    Real(f64),
    Word(String),
    /// Not known, a number of so many bits.
    Unknown(u32),
    /// Nobody drives it, so many bits.
    Idle(u32),
}

impl Level {
    fn word(text: &str) -> Self {
        Self::Word(text.replace(' ', "_"))
    }
    fn emit(&self, writer: &mut Writer<&mut dyn Write>, id: IdCode) -> io::Result<()> {
        let filled = |value, width: u32| vec![value; width as usize];
        match self {
            Self::Bit(on) => writer.change_scalar(id, *on),
            Self::Bits(number, width) => {
                let bits = (0..*width).rev().map(|bit| Value::from(number >> bit & 1 == 1));
                writer.change_vector(id, bits)
            }
            Self::Real(value) => writer.change_real(id, *value),
            Self::Word(word) => writer.change_string(id, word),
            Self::Unknown(1) => writer.change_scalar(id, Value::X),
            Self::Unknown(width) => writer.change_vector(id, filled(Value::X, *width)),
            Self::Idle(width) => writer.change_vector(id, filled(Value::Z, *width)),
        }
    }
}

/// A variable: its code, and what it is where nothing is recorded.
#[derive(Clone, Debug)]
struct Var {
    id: IdCode,
    unknown: Level,
}

/// The variables of a slave.
#[derive(Clone, Debug)]
struct SlaveVars {
    latch: usize,
    t_o: usize,
    state: usize,
    phase: usize,
    pll: usize,
    error: usize,
    window: usize,
    clock_failures: usize,
    life_failures: usize,
    master_life: usize,
    own_life: usize,
    fault: usize,
}

/// A station's variables.
#[derive(Clone, Debug)]
enum StationVars {
    Master { mode: usize },
    Slave(SlaveVars),
}

/// The wave forms of a recording.
struct Wave {
    vars: Vec<Var>,
    recorded: usize,
    cycle: usize,
    trigger: usize,
    busy: usize,
    sender: usize,
    synch: usize,
    master: Address,
    stations: Vec<(Address, StationVars)>,
    /// Every change: when, of which variable, to what; in the order of time when they are emitted.
    changes: Vec<(Time, usize, Level)>,
}

const CYCLE_BITS: u32 = 64;
const ADDRESS_BITS: u32 = 7;
const COUNTER_BITS: u32 = 16;
const LIFE_BITS: u32 = 4;
const FAULT_BITS: u32 = 16;

/// Declares variables.
struct Header<'w, 'a> {
    writer: &'w mut Writer<&'a mut dyn Write>,
    vars: Vec<Var>,
}

impl Header<'_, '_> {
    fn var(&mut self, kind: VarType, unknown: Level, name: &str) -> io::Result<usize> {
        let width = match unknown {
            Level::Real(_) => 64,
            Level::Unknown(width) => width,
            _ => 1,
        };
        let id = self.writer.add_var(kind, width, name, None)?;
        self.vars.push(Var { id, unknown });
        Ok(self.vars.len() - 1)
    }
    fn wire(&mut self, width: u32, name: &str) -> io::Result<usize> {
        self.var(VarType::Wire, Level::Unknown(width), name)
    }
    fn real(&mut self, name: &str) -> io::Result<usize> {
        self.var(VarType::Real, Level::Real(f64::NAN), name)
    }
    fn word(&mut self, name: &str) -> io::Result<usize> {
        self.var(VarType::String, Level::word("x"), name)
    }
    fn slave(&mut self, address: Address) -> io::Result<SlaveVars> {
        self.writer.add_module(&format!("slave_{address}"))?;
        let vars = SlaveVars {
            latch: self.wire(1, "latch")?,
            t_o: self.wire(1, "t_o")?,
            state: self.word("state")?,
            phase: self.word("phase")?,
            pll: self.word("pll")?,
            error: self.real("pll_error_ns")?,
            window: self.real("window_ns")?,
            clock_failures: self.wire(COUNTER_BITS, "clock_failures")?,
            life_failures: self.wire(COUNTER_BITS, "life_failures")?,
            master_life: self.wire(LIFE_BITS, "master_life")?,
            own_life: self.wire(LIFE_BITS, "own_life")?,
            fault: self.wire(FAULT_BITS, "fault")?,
        };
        self.writer.upscope()?;
        Ok(vars)
    }
    fn master(&mut self, address: Address) -> io::Result<usize> {
        self.writer.add_module(&format!("master_{address}"))?;
        let mode = self.word("mode")?;
        self.writer.upscope()?;
        Ok(mode)
    }
}

impl Wave {
    /// Declares the variables of `network`.
    fn new(writer: &mut Writer<&mut dyn Write>, network: &Recorded) -> io::Result<Self> {
        let mut header = Header { writer, vars: Vec::new() };
        header.writer.add_module("isodp")?;
        let recorded = header.wire(1, "recorded")?;
        let (cycle, trigger) = (header.wire(CYCLE_BITS, "cycle")?, header.word("trigger")?);
        header.writer.add_module("bus")?;
        let busy = header.wire(1, "busy")?;
        let sender = header.wire(ADDRESS_BITS, "sender")?;
        let synch = header.wire(1, "synch")?;
        header.writer.upscope()?;
        let mut stations = Vec::new();
        for &master in &network.masters {
            stations.push((master, StationVars::Master { mode: header.master(master)? }));
        }
        for &slave in &network.slaves {
            stations.push((slave, StationVars::Slave(header.slave(slave)?)));
        }
        header.writer.upscope()?;
        header.writer.enddefinitions()?;
        let (vars, master) = (header.vars, network.masters[0]);
        let changes = Vec::new();
        Ok(Self { vars, recorded, cycle, trigger, busy, sender, synch, master, stations, changes })
    }

    fn put(&mut self, at: Time, var: usize, level: Level) {
        self.changes.push((at, var, level));
    }
    fn pulse(&mut self, at: Time, var: usize) {
        self.put(at, var, Level::Bit(true));
        self.put(at + PULSE, var, Level::Bit(false));
    }

    /// Adds a stretch, from and to the unknown.
    fn stretch(&mut self, stretch: &Stretch) {
        let begin = stretch.begin();
        self.put(begin, self.recorded, Level::Bit(true));
        self.put(begin, self.trigger, Level::word("-"));
        self.put(begin, self.synch, Level::Bit(false));
        for &standing in &stretch.standings {
            self.standing(begin, standing);
        }
        for cycle in &stretch.cycles {
            self.put(cycle.begin, self.cycle, Level::Bits(cycle.number, CYCLE_BITS));
        }
        for fired in &stretch.triggers {
            let text = format!("{}_of_{}", fired.trigger, fired.station);
            self.put(fired.at, self.trigger, Level::Word(text));
        }
        for entry in &stretch.entries {
            match entry.what {
                What::Telegram { end, .. } => self.telegram(stretch, entry, end),
                What::Seen(what) => self.seen(entry, &what),
            }
        }
        self.bus(stretch);
        // What began in the stretch and would end after it ends with it.
        for (at, ..) in &mut self.changes {
            *at = (*at).min(stretch.end);
        }
        for var in 0..self.vars.len() {
            let unknown = if var == self.recorded { Level::Bit(false) } else { self.vars[var].unknown.clone() };
            self.put(stretch.end, var, unknown);
        }
    }

    /// Everything that changes rarely, at the beginning of a stretch.
    fn standing(&mut self, at: Time, standing: Standing) {
        let Some((_, vars)) = self.stations.iter().find(|known| known.0 == standing.station).cloned() else { return };
        match vars {
            StationVars::Master { mode } => self.put(at, mode, Level::word(standing.mode.text())),
            StationVars::Slave(vars) => {
                self.put(at, vars.latch, Level::Bit(false));
                self.put(at, vars.t_o, Level::Bit(false));
                self.rare(at, &vars, standing);
            }
        }
    }
    fn rare(&mut self, at: Time, vars: &SlaveVars, standing: Standing) {
        self.put(at, vars.state, Level::word(standing.state.text()));
        self.put(at, vars.phase, Level::word(standing.phase.text()));
        self.put(at, vars.pll, Level::word(standing.pll.text()));
        self.put(at, vars.fault, Level::Bits(standing.fault.into(), FAULT_BITS));
    }

    fn telegram(&mut self, stretch: &Stretch, entry: &Entry, end: Time) {
        let synch = match Telegram::parse(stretch.octets(entry)) {
            Ok(Telegram::Data { header, du }) => {
                header.dsap == Some(Sap::GLOBAL_CONTROL) && GlobalControl::parse(du).is_ok_and(|gc| gc.is_synch())
            }
            _ => false,
        };
        if synch && entry.station == self.master {
            self.put(entry.at, self.synch, Level::Bit(true));
            self.put(end, self.synch, Level::Bit(false));
        }
    }

    /// Who sends when. Where two do, nobody can say.
    fn bus(&mut self, stretch: &Stretch) {
        let mut edges = Vec::new();
        for entry in &stretch.entries {
            if let What::Telegram { end, .. } = entry.what {
                edges.extend([(entry.at, true, entry.station), (end, false, entry.station)]);
            }
        }
        // At one instant what ends comes first.
        edges.sort_by_key(|&(at, begins, _)| (at, begins));
        let mut sending: Vec<Address> = Vec::new();
        self.line(stretch.begin(), &sending);
        for (at, begins, station) in edges {
            if begins {
                sending.push(station);
            } else if let Some(index) = sending.iter().position(|&other| other == station) {
                sending.remove(index);
            }
            self.line(at, &sending);
        }
    }
    fn line(&mut self, at: Time, sending: &[Address]) {
        self.put(at, self.busy, Level::Bit(!sending.is_empty()));
        let sender = match sending {
            [] => Level::Idle(ADDRESS_BITS),
            [one] => Level::Bits(one.get().into(), ADDRESS_BITS),
            _ => Level::Unknown(ADDRESS_BITS),
        };
        self.put(at, self.sender, sender);
    }

    fn seen(&mut self, entry: &Entry, what: &Observation) {
        let at = entry.at;
        let Some((_, vars)) = self.stations.iter().find(|known| known.0 == entry.station).cloned() else { return };
        let vars = match vars {
            StationVars::Master { mode } => {
                if let Observation::MasterMode { to, .. } = what {
                    self.put(at, mode, Level::word(to.text()));
                }
                return;
            }
            StationVars::Slave(vars) => vars,
        };
        let counter = |count: u16| Level::Bits(count.into(), COUNTER_BITS);
        let life = |value: u8| Level::Bits(value.into(), LIFE_BITS);
        match *what {
            Observation::Latch { .. } => self.pulse(at, vars.latch),
            Observation::SetPoint { mls, sls, counter: failures, .. } => {
                self.pulse(at, vars.t_o);
                self.put(at, vars.master_life, life(mls));
                self.put(at, vars.own_life, life(sls));
                self.put(at, vars.life_failures, counter(failures));
            }
            Observation::Clock { verdict, error, window, counter: failures, .. } if verdict != ClockVerdict::Stray => {
                let error = if verdict == ClockVerdict::Missing { f64::NAN } else { error.as_ns() };
                self.put(at, vars.error, Level::Real(error));
                self.put(at, vars.window, Level::Real(window.as_ns()));
                self.put(at, vars.clock_failures, counter(failures));
            }
            Observation::SlaveState { to, .. } => self.put(at, vars.state, Level::word(to.text())),
            Observation::Phase { to, .. } => self.put(at, vars.phase, Level::word(to.text())),
            Observation::Pll { to, .. } => self.put(at, vars.pll, Level::word(to.text())),
            Observation::Fault { code } => self.put(at, vars.fault, Level::Bits(code.into(), FAULT_BITS)),
            Observation::Acknowledged { .. } => self.put(at, vars.fault, Level::Bits(0, FAULT_BITS)),
            Observation::Power { on: false } => self.rare(at, &vars, Standing::new(entry.station)),
            _ => {}
        }
    }

    /// Writes all changes that are some, in the order of time.
    fn emit(mut self, writer: &mut Writer<&mut dyn Write>, picoseconds: i128) -> io::Result<()> {
        self.changes.sort_by_key(|change| change.0);
        let mut now: Vec<Option<Level>> = vec![None; self.vars.len()];
        // What each variable will be after this instant.
        let mut next: Vec<Option<Level>> = self.vars.iter().map(|var| Some(var.unknown.clone())).collect();
        next[self.recorded] = Some(Level::Bit(false));
        let mut touched: Vec<usize> = (0..self.vars.len()).collect();
        let mut instant = 0;
        for (at, var, level) in self.changes {
            let at = units(at, picoseconds);
            if at != instant {
                settle(writer, &self.vars, instant, (&mut touched, &mut next, &mut now))?;
                instant = at;
            }
            touched.push(var);
            next[var] = Some(level);
        }
        settle(writer, &self.vars, instant, (&mut touched, &mut next, &mut now))
    }
}

/// Writes what the variables that were `touched` became at an instant, where a viewer sees a difference.
fn settle(
    writer: &mut Writer<&mut dyn Write>,
    vars: &[Var],
    at: u64,
    (touched, next, now): (&mut Vec<usize>, &mut [Option<Level>], &mut [Option<Level>]),
) -> io::Result<()> {
    let mut told = false;
    for var in touched.drain(..) {
        let Some(level) = next[var].take() else { continue };
        if now[var].as_ref().is_some_and(|known| same(known, &level)) {
            continue;
        }
        if !told {
            writer.timestamp(at)?;
            told = true;
        }
        level.emit(writer, vars[var].id)?;
        now[var] = Some(level);
    }
    Ok(())
}

/// Whether a viewer sees no difference.
fn same(a: &Level, b: &Level) -> bool {
    match (a, b) {
        (Level::Real(a), Level::Real(b)) => a.to_bits() == b.to_bits(),
        _ => a == b,
    }
}

/// An instant in units of so many picoseconds, to the nearest one.
fn units(at: Time, picoseconds: i128) -> u64 {
    let per_ns = i128::from(Span::from_ns(1).ticks()) * picoseconds;
    let ticks = i128::from(at.since_zero().ticks()) * 1_000;
    u64::try_from((ticks + per_ns / 2).div_euclid(per_ns)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_rounded_to_the_nearest_unit() {
        let at = |ticks| units(Time::from_ticks(ticks), 1);
        // A tick is 83.33 ps.
        assert_eq!([0, 1, 2, 3, 12, -1].map(at), [0, 83, 167, 250, 1_000, 0]);
        assert_eq!([1, 2, 12].map(|ticks| units(Time::from_ticks(ticks), 100)), [1, 2, 10]);
        let last = Time::ZERO + Span::from_s(24 * 365 * 86_400);
        assert_eq!(units(last, 100), 24 * 365 * 86_400 * 10_000_000_000);
        assert!(u64::try_from(LONG.ticks()).unwrap() / 12 < u64::MAX / 1_000);
    }
}
