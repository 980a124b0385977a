//! Page: the plan as a text that fits a terminal.

use super::finding::{Finding, Relation, Subject, nearest};
use super::rules::{Facts, Rule, Weight};
use super::{Plan, Slot, computing_time, dead_time};
use crate::study::report::{aligned, number, ranges};
use crate::study::scenario::{Scenario, Slave};
use crate::time::{Span, Tbit};

/// Slaves that have a line of their own; of more, equal neighbours share one.
const SLAVES: usize = 16;
/// Characters of the drawn cycle.
const WIDTH: usize = 100;

/// The page; `files` says what was written where.
pub(super) fn render(facts: &Facts<'_>, findings: &[Finding], files: &str) -> String {
    let mut lines = Vec::new();
    head(facts, &mut lines);
    exchange(facts, &mut lines);
    shares(facts, &mut lines);
    instants(facts, &mut lines);
    drawing(facts, &mut lines);
    beside(facts, &mut lines);
    rules(findings, &mut lines);
    if !files.is_empty() {
        lines.push(files.to_owned());
    }
    lines.push("octets of Set_Prm and Chk_Cfg: --slave N; times that keep all rules: --propose".to_owned());
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

/// A span in bit times, with a decimal where a cable makes one.
fn bits(scenario: &Scenario, span: Span) -> String {
    let bit = scenario.bus.params.rate.bit();
    let tenths = (span * 10).div_floor(bit);
    if tenths % 10 == 0 { format!("{}", tenths / 10) } else { format!("{}.{}", tenths / 10, (tenths % 10).abs()) }
}

/// A span (us), three decimals.
fn us(span: Span) -> String {
    format!("{:.3}", span.as_us())
}

fn head(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let bus = &scenario.bus.params;
    lines.push(format!(
        "{}: master {}, {}, {}, {}, {}",
        scenario.name,
        scenario.master.address,
        number(plan.slots.len(), "slave"),
        number(scenario.links.len(), "link"),
        bus.rate,
        match scenario.topology.segments() {
            [line] => format!("cable {} m", line.cable_mm as f64 / 1e3),
            segments => number(segments.len(), "segment"),
        },
    ));
    let shortest = scenario.configured().map(|slave| plan.t_dp_min(&slave.device)).max().unwrap_or_default();
    lines.push(format!(
        "T_DP {}, its content needs {shortest}   T_DX {} at most (MaxTsdr), {} expected (own T_SDR)",
        scenario.master.t_dp,
        plan.t_dx,
        Plan::expected(scenario).t_dx
    ));
    lines.push(format!("T_ID1 {}   T_ID2 {}   T_SL {}   bit {}", bus.t_id1(), bus.t_id2(), bus.t_sl, bus.rate.bit()));
}

/// Slaves in groups: each alone, or of many those that `same` takes for equal.
fn groups(scenario: &Scenario, same: impl Fn(&Slave, &Slave) -> bool) -> Vec<Vec<&Slave>> {
    let slaves: Vec<_> = scenario.configured().collect();
    let many = slaves.len() > SLAVES;
    slaves.chunk_by(|a, b| many && same(a, b)).map(<[_]>::to_vec).collect()
}

/// The addresses of a group.
fn names(group: &[&Slave]) -> String {
    ranges(&group.iter().map(|slave| slave.address.get()).collect::<Vec<_>>())
}

/// One value, or the first and the last.
fn span_of(first: &str, last: &str) -> String {
    if first == last { first.to_owned() } else { format!("{first}..{last}") }
}

fn exchange(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let bus = &scenario.bus.params;
    let slot = |slave: &Slave| plan.slot(slave.address).copied();
    let same = |a: &Slave, b: &Slave| {
        let key = |slave: &Slave| slot(slave).map(|slot| (slot.t_s, slot.t_sdr, slot.t_r, slave.t_sdr));
        a.device == b.device && key(a) == key(b)
    };
    let rows = groups(scenario, same).into_iter().filter_map(|group| {
        let ends = group.first().and_then(|slave| slot(slave)).zip(group.last().and_then(|slave| slot(slave)));
        ends.map(|(first, last)| {
            let both = |of: &dyn Fn(&Slot) -> String| span_of(&of(&first), &of(&last));
            vec![
                names(&group),
                group[0].device.name.to_string(),
                first.t_s.0.to_string(),
                first.t_sdr.0.to_string(),
                first.t_r.0.to_string(),
                both(&|slot| bits(scenario, slot.t_td_both)),
                bus.t_id1().0.to_string(),
                both(&|slot| bits(scenario, slot.t_mc(bus))),
                both(&|slot| us(slot.t_mc(bus))),
                us(first.request),
                us(last.reply_end),
            ]
        })
    });
    let header = [
        "slave",
        "device",
        "T_S",
        "T_SDR",
        "T_R",
        "2 T_TD",
        "T_ID1",
        "T_MC tbit",
        "T_MC us",
        "request us",
        "reply ends us",
    ];
    lines.push(String::new());
    lines.push("Data_Exchange at the longest, from t0 (last bit of SYNCH); T_S to T_ID1 in tbit".to_owned());
    lines.extend(aligned(&header, &[0, 1], &rows.collect::<Vec<_>>()));
}

fn shares(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let t_dp = scenario.master.t_dp;
    let row = |name: &str, span: Span| {
        let share = 100.0 * span.ticks() as f64 / t_dp.ticks().max(1) as f64;
        vec![name.to_owned(), bits(scenario, span), us(span), format!("{share:.1} %")]
    };
    let rows = [
        row("T_DX: T_ID2 and every Data_Exchange", plan.t_dx),
        row("GAP: T_ID1, FDL status, T_SL", plan.gap),
        row("token: T_ID1, 3 octets", plan.token),
        row("SYNCH: T_ID1, T_GC of 13 octets", plan.synch),
        row("spare: acyclic messages, silence", plan.spare(t_dp)),
        row("T_DP", t_dp),
    ];
    lines.push(String::new());
    lines.extend(aligned(&["share of the cycle", "tbit", "us", "of T_DP"], &[0], &rows));
}

/// A range of times, or that there is none.
fn allowed(low: Span, high: Span) -> String {
    if low > high { "none".to_owned() } else { span_of(&low.to_string(), &high.to_string()).replace("..", " .. ") }
}

fn instants(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let master = &scenario.master;
    let same = |a: &Slave, b: &Slave| a.device == b.device && a.times == b.times && a.functions == b.functions;
    let slaves: Vec<_> = scenario.configured().filter(|slave| slave.device.isochronous).collect();
    let rows = slaves.chunk_by(|a, b| same(a, b)).map(|group| {
        let slave = group[0];
        let (times, device) = (slave.times, &slave.device);
        let widest = Span::from_iso_units(device.t_pll_w_max.into());
        vec![
            names(group),
            times.t_i.to_string(),
            allowed(device.t_i_min(slave.functions), plan.t_i_max(slave, master.t_dp)),
            times.t_o.to_string(),
            allowed(plan.t_o_min(device), plan.t_o_max(slave, master.t_dp)),
            times.t_pll_w.to_string(),
            allowed(device.min_window, widest),
            dead_time(times.t_i, times.t_o, master.t_dp, master.t_mapc).to_string(),
        ]
    });
    let header = ["slave", "T_I", "allowed", "T_O", "allowed", "T_PLL_W", "allowed", "dead time"];
    lines.push(String::new());
    lines.extend(aligned(&header, &[0], &rows.collect::<Vec<_>>()));
    lines.push(format!(
        "T_M {}: the master application may compute from then on, for {} (T_MAPC {} x T_DP - T_DX)",
        plan.t_m(),
        computing_time(plan, master.t_dp, master.t_mapc),
        master.t_mapc
    ));
    lines.push(
        "dead time = T_I + T_MAPC x T_DP + T_O: latch, data in the next cycle, compute, set point in the cycle after"
            .to_owned(),
    );
}

/// Paints parts of the cycle on a line of characters.
struct Strip {
    cells: Vec<char>,
    whole: Span,
}

impl Strip {
    fn new(whole: Span) -> Self {
        Self { cells: vec![' '; WIDTH], whole: whole.max(Span::from_ticks(1)) }
    }
    /// The cell of an instant.
    fn cell(&self, at: Span) -> usize {
        let cell = i128::from(at.ticks()) * WIDTH as i128 / i128::from(self.whole.ticks());
        cell.clamp(0, WIDTH as i128 - 1) as usize
    }
    /// Paints a part, at least one character wide.
    fn paint(&mut self, from: Span, to: Span, with: char) {
        let (first, last) = (self.cell(from), self.cell(to - Span::from_ticks(1)));
        self.cells[first..=last.max(first)].fill(with);
    }
    fn text(&self) -> String {
        self.cells.iter().collect()
    }
}

fn drawing(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let (bus, t_dp) = (&scenario.bus.params, scenario.master.t_dp);
    let whole = t_dp.max(plan.content());
    let (mut strip, mut marks) = (Strip::new(whole), Strip::new(whole));
    strip.paint(Span::ZERO, whole, '.');
    for (number, slot) in plan.slots.iter().enumerate() {
        strip.paint(slot.request, slot.reply_end, if number % 2 == 0 { 'D' } else { 'd' });
    }
    let t_id1 = bus.span(bus.t_id1());
    strip.paint(plan.t_dx + t_id1, plan.t_dx + plan.gap, 'G');
    strip.paint(plan.t_dx + plan.gap + t_id1, plan.t_dx + plan.gap + plan.token, 't');
    strip.paint(whole - bus.span(super::SYNCH), whole, 'S');
    for slave in scenario.configured().filter(|slave| slave.device.isochronous) {
        marks.paint(slave.times.t_o, slave.times.t_o, 'O');
        marks.paint(t_dp - slave.times.t_i, t_dp - slave.times.t_i, 'I');
    }
    lines.push(String::new());
    lines.push(format!(" {}", marks.text()));
    lines.push(format!("|{}|", strip.text()));
    lines.push(format!("0{:>width$}", whole.to_string(), width = WIDTH + 1));
    lines.push(
        "D d Data_Exchange with one slave after the other   G GAP   t token   S SYNCH   . silence   O T_O   I latch (T_I)"
            .to_owned(),
    );
}

fn beside(facts: &Facts<'_>, lines: &mut Vec<String>) {
    /// A parameter request with its header, and the longest record that can be read back (octets).
    const READ: (usize, usize) = (14, 244);
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let bus = &scenario.bus.params;
    let spare = plan.spare(scenario.master.t_dp);
    let (read, repeat) = (plan.acyclic(bus, READ.0, READ.1), plan.repeat(bus));
    let free = plan.free_running(bus);
    lines.push(String::new());
    for (what, span) in [
        ("a repeated Data_Exchange: T_S, T_SL, T_ID1".to_owned(), repeat),
        (format!("an acyclic message with {} octets back", READ.1), read),
        ("a Global_Control that tells the mode, with T_ID2".to_owned(), plan.mode(bus)),
    ] {
        let fits = if span <= spare { "fits into" } else { "does not fit into" };
        lines.push(format!("{what}, {span}, {fits} the spare time"));
    }
    let exchange = plan.slots.iter().map(|slot| slot.t_mc(bus)).max().unwrap_or_default();
    let t_mc = Tbit(exchange.ceil_to(bus.rate.bit()).div_floor(bus.rate.bit()) as u32);
    let t_tr = bus.least_t_tr(1, 1, t_mc);
    lines.push(format!(
        "without SYNCH a cycle takes {}, {} with a GAP poll; T_TR >= {t_tr} with one low-priority message per rotation",
        free.cycle, free.with_gap
    ));
}

/// What a rule found of one kind of value, equal findings together.
struct Line<'a> {
    rule: &'static Rule,
    subjects: Vec<Subject>,
    /// One finding, or the two ends of a range.
    sides: Vec<&'a Finding>,
}

impl Line<'_> {
    fn holds(&self) -> bool {
        self.sides.iter().all(|side| side.holds())
    }
    /// `T_O 375 us > T_DX + T_O_MIN = 347.833 us`, or with both ends of a range.
    fn numbers(&self) -> String {
        let first = self.sides[0];
        let (symbol, value) = (first.symbol, first.value);
        match self.sides.as_slice() {
            [low, high] if low.value == high.value => {
                format!("{} <= {symbol} {value} <= {}", low.bound, high.bound)
            }
            _ => format!("{symbol} {value} {} {} ({})", first.relation.sign(), first.bound, first.terms),
        }
    }
    fn margin(&self) -> String {
        let margins = self.sides.iter().filter_map(|side| side.margin_amount());
        margins.min_by_key(|margin| margin.raw()).map_or_else(|| "-".to_owned(), |margin| margin.to_string())
    }
    fn who(&self) -> String {
        let slaves: Vec<_> = self
            .subjects
            .iter()
            .filter_map(|subject| if let Subject::Slave(address) = subject { Some(address.get()) } else { None })
            .collect();
        match self.subjects.first() {
            Some(Subject::Bus) => "bus".to_owned(),
            Some(Subject::Slave(_)) => format!("slave {}", ranges(&slaves)),
            _ => "master".to_owned(),
        }
    }
}

/// The findings of every rule, equal ones of several slaves together.
fn gathered(findings: &[Finding]) -> Vec<Line<'_>> {
    let mut lines: Vec<Line<'_>> = Vec::new();
    let equal = |a: &Finding, b: &Finding| {
        a.value == b.value
            && a.bound == b.bound
            && a.relation == b.relation
            && a.terms == b.terms
            && a.symbol == b.symbol
    };
    let mut rest = findings;
    while let Some((first, after)) = rest.split_first() {
        let pair = after.first().filter(|other| {
            let range = (first.relation, other.relation) == (Relation::AtLeast, Relation::AtMost);
            range && std::ptr::eq(first.rule, other.rule) && first.key == other.key && first.symbol == other.symbol
        });
        let sides: Vec<&Finding> = std::iter::once(first).chain(pair).collect();
        rest = &rest[sides.len()..];
        let same = |line: &&mut Line<'_>| {
            let as_many = line.sides.len() == sides.len() && std::ptr::eq(line.rule, first.rule);
            as_many && line.sides.iter().zip(&sides).all(|(a, b)| equal(a, b))
        };
        match lines.iter_mut().find(same) {
            Some(line) if line.subjects.contains(&first.key.subject) => {}
            Some(line) => line.subjects.push(first.key.subject),
            None => lines.push(Line { rule: first.rule, subjects: vec![first.key.subject], sides }),
        }
    }
    lines
}

fn rules(findings: &[Finding], lines: &mut Vec<String>) {
    let all = gathered(findings);
    let broken = |weight: fn(Weight) -> bool| all.iter().filter(move |line| !line.holds() && weight(line.rule.weight));
    let (wrong, warned) =
        (broken(|weight| weight == Weight::Must).count(), broken(|weight| weight != Weight::Must).count());
    lines.push(String::new());
    let rows: Vec<_> = all
        .iter()
        .map(|line| {
            let verdict = match (line.holds(), line.rule.weight) {
                (true, _) => "ok",
                (false, Weight::Must) => "VIOLATED",
                (false, _) => "warning",
            };
            vec![verdict.to_owned(), line.who(), line.numbers(), line.margin(), line.rule.source.to_owned()]
        })
        .collect();
    lines.extend(aligned(&["", "of", "rule", "margin", "source"], &[0, 1, 2, 4], &rows));
    lines.push(String::new());
    lines.push(format!(
        "rules: {}{}",
        if wrong == 0 { "all hold".to_owned() } else { format!("{} violated", number(wrong, "rule")) },
        if warned == 0 { String::new() } else { format!(", {}", number(warned, "warning")) }
    ));
    for line in all.iter().filter(|line| !line.holds()) {
        let side = line.sides.iter().find(|side| !side.holds()).unwrap_or(&line.sides[0]);
        let message = side.fault.as_ref().map_or_else(|| line.numbers(), |fault| fault.message.clone());
        let near = match nearest(side, findings) {
            Some(near) => format!("nearest {} = {near}", side.key.name),
            None if side.follows => side.fault.as_ref().map_or_else(String::new, |fault| fault.help.clone()),
            None => format!("no {} does with the other values as they are: --propose", side.key.name),
        };
        let word = if line.rule.weight == Weight::Must { "violated" } else { "warning" };
        lines.push(format!("{word}: {}: {message}; {near}", line.who()).trim_end_matches("; ").to_owned());
    }
}
