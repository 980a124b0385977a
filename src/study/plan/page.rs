//! Page: the plan as a text that fits a terminal.

use super::finding::{Amount, Finding, Relation, Subject, nearest};
use super::rules::{Facts, Rule, Weight};
use super::{Plan, Slot, computing_time, dead_time};
use crate::dp::master::Pace;
use crate::study::report::{aligned, number, ranges};
use crate::study::scenario::{Scenario, Slave};
use crate::time::{Span, Tbit};

/// Slaves that have a line of their own; of more, equal neighbours share one.
const SLAVES: usize = 16;
/// Characters of a line.
const COLUMNS: usize = 100;
/// Characters of the drawn cycle, without its ends.
const WIDTH: usize = COLUMNS - 2;
/// Characters of a device's name.
const DEVICE: usize = 28;
/// Rules that hold and have a line.
const TIGHTEST: usize = 3;

/// The page; `files` says what was written where, `all` whether every rule is shown.
pub(super) fn render(facts: &Facts<'_>, findings: &[Finding], files: &str, all: bool) -> String {
    let clocked = facts.scenario.master.pace == Pace::Synch;
    let mut lines = Vec::new();
    head(facts, &mut lines);
    exchange(facts, &mut lines);
    if clocked {
        shares(facts, &mut lines);
        instants(facts, &mut lines);
    } else {
        free_shares(facts, &mut lines);
    }
    drawing(facts, &mut lines);
    beside(facts, &mut lines);
    ring(facts, &mut lines);
    rules(findings, all, &mut lines);
    if !files.is_empty() {
        lines.push(files.to_owned());
    }
    let times = if clocked { "times that keep all rules: --propose" } else { "values that keep all rules: --propose" };
    lines.push(format!("every rule: --rules; Set_Prm and Chk_Cfg: --slave N; {times}"));
    lines.iter().flat_map(|line| wrapped(line)).flat_map(|line| [line, "\n".to_owned()]).collect()
}

/// A line in pieces of [`COLUMNS`] characters at most, broken at spaces; the second and all others are indented.
fn wrapped(line: &str) -> Vec<String> {
    let mut rest = line.trim_end().to_owned();
    let mut pieces = Vec::new();
    while rest.chars().count() > COLUMNS {
        let indent = rest.len() - rest.trim_start().len();
        let end = rest.char_indices().nth(COLUMNS).map_or(rest.len(), |(at, _)| at);
        let space =
            rest[..=end].rfind(' ').filter(|&at| at > indent).or_else(|| rest[end..].find(' ').map(|at| at + end));
        let Some(space) = space else { break };
        let next = format!("    {}", rest[space..].trim_start());
        rest.truncate(space);
        pieces.push(std::mem::replace(&mut rest, next).trim_end().to_owned());
    }
    pieces.push(rest);
    pieces
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
    let clocked = scenario.master.pace == Pace::Synch;
    lines.push(format!(
        "{}: master {}, {}{}, {}, {}, {}{}",
        scenario.name,
        scenario.master.address,
        if clocked { "" } else { "free-running, " },
        number(plan.slots.len(), "slave"),
        number(scenario.links.len(), "link"),
        bus.rate,
        match scenario.topology.segments() {
            [line] => format!("cable {} m", line.cable_mm as f64 / 1e3),
            segments => number(segments.len(), "segment"),
        },
        match plan.visits.len() {
            0 => String::new(),
            others => format!(", {}", number(others, "other master")),
        },
    ));
    let expected = Plan::expected(scenario);
    if clocked {
        let shortest = scenario.configured().map(|slave| plan.t_dp_min(&slave.device)).max().unwrap_or_default();
        lines.push(format!("T_DP {}, its content needs {shortest}", scenario.master.t_dp));
        lines.push(format!("T_DX {} at most (MaxTsdr), {} expected (own T_SDR)", plan.t_dx, expected.t_dx));
    } else {
        let (most, own) = (plan.free_running(scenario), expected.free_running(scenario));
        lines.push(format!("T_cycle {} at most (MaxTsdr), {} with a GAP poll", most.cycle(), most.with_gap()));
        lines.push(format!("T_cycle {} expected (own T_SDR), {} with a GAP poll", own.cycle(), own.with_gap()));
    }
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
                group[0].device.name.chars().take(DEVICE).collect(),
                first.t_s.0.to_string(),
                first.t_sdr.0.to_string(),
                first.t_r.0.to_string(),
                both(&|slot| bits(scenario, slot.t_td_both)),
                both(&|slot| us(slot.t_mc(bus))),
                us(first.request),
                us(last.reply_end),
            ]
        })
    });
    let header = ["slave", "device", "T_S", "T_SDR", "T_R", "2 T_TD", "T_MC us", "start us", "end us"];
    let from = if scenario.master.pace == Pace::Synch { "t0 (last bit of SYNCH)" } else { "the first request" };
    lines.push(String::new());
    lines.push(format!("Data_Exchange at the longest, from {from} on; T_S to 2 T_TD in tbit"));
    lines.extend(aligned(&header, &[0, 1], &rows.collect::<Vec<_>>()));
}

fn shares(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let t_dp = scenario.master.t_dp;
    let visits = plan.content() - plan.own();
    let mut rows = vec![
        ("T_DX: T_ID2 and every Data_Exchange".to_owned(), plan.t_dx),
        ("GAP: T_ID1, FDL status, T_SL".to_owned(), plan.gap),
        ("token: T_ID1, 3 octets".to_owned(), plan.token),
        ("SYNCH: T_ID1, T_GC of 13 octets".to_owned(), plan.synch),
        ("spare: acyclic messages, silence".to_owned(), plan.spare(t_dp)),
        ("T_DP".to_owned(), t_dp),
    ];
    if !plan.visits.is_empty() {
        rows.insert(3, (format!("visits to {} at least", number(plan.visits.len(), "other master")), visits));
    }
    share_table(scenario, ("share of the cycle", "of T_DP"), &rows, lines);
}

/// The shares of the free-running cycle with a GAP poll.
fn free_shares(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let free = plan.free_running(scenario);
    let why = match (free.pause(Span::ZERO) > Span::ZERO, free.least_cycle >= free.intervals) {
        (false, _) => "none is due",
        (true, true) => "least_cycle",
        (true, false) => "Min_Slave_Interval of every slave from its request on",
    };
    let rows = [
        ("every Data_Exchange with T_ID1".to_owned(), free.exchange),
        ("token, 3 octets, with T_ID1".to_owned(), free.token),
        (format!("pause: {why}"), free.pause(Span::ZERO)),
        ("T_cycle".to_owned(), free.cycle()),
        (format!("GAP at every {}. visit: FDL status, T_SL, T_ID1", scenario.bus.params.gap_factor), free.gap),
        ("T_cycle with it".to_owned(), free.with_gap()),
    ];
    share_table(scenario, ("share of the cycle", "of T_cycle"), &rows, lines);
}

fn share_table(scenario: &Scenario, (title, of): (&str, &str), rows: &[(String, Span)], lines: &mut Vec<String>) {
    // Without SYNCH the cycle without a GAP poll is what happens most of the time.
    let whole = rows.iter().find(|row| row.0 == "T_DP" || row.0 == "T_cycle").map_or(Span::ZERO, |row| row.1);
    let row = |(name, span): &(String, Span)| {
        let share = 100.0 * span.ticks() as f64 / whole.ticks().max(1) as f64;
        vec![name.clone(), bits(scenario, *span), us(*span), format!("{share:.1} %")]
    };
    lines.push(String::new());
    lines.extend(aligned(&[title, "tbit", "us", of], &[0], &rows.iter().map(row).collect::<Vec<_>>()));
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
        "T_M {}: the master application may compute from then on, for {} (T_MAPC {})",
        plan.t_m(),
        computing_time(plan, master.t_dp, master.t_mapc),
        master.t_mapc
    ));
    lines.push(
        "dead time = T_I + T_MAPC x T_DP + T_O: latch, data a cycle later, compute, set point the cycle after"
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
    let clocked = scenario.master.pace == Pace::Synch;
    let whole = if clocked { t_dp.max(plan.content()) } else { t_dp };
    let (mut strip, mut marks) = (Strip::new(whole), Strip::new(whole));
    strip.paint(Span::ZERO, whole, '.');
    for (number, slot) in plan.slots.iter().enumerate() {
        strip.paint(slot.request, slot.reply_end, if number % 2 == 0 { 'D' } else { 'd' });
    }
    let t_id1 = bus.span(bus.t_id1());
    strip.paint(plan.t_dx + t_id1, plan.t_dx + plan.gap, 'G');
    strip.paint(plan.t_dx + plan.gap + t_id1, plan.t_dx + plan.gap + plan.token, 't');
    let mut legend = "D d Data_Exchange, slave by slave  G GAP  t token  . silence".to_owned();
    if !plan.visits.is_empty() {
        let from = plan.t_dx + plan.gap + plan.token;
        strip.paint(from, from + (plan.content() - plan.own()), 'v');
        legend += "  v visits";
    }
    if clocked {
        strip.paint(whole - bus.span(super::SYNCH), whole, 'S');
        legend += "  S SYNCH";
    }
    for slave in scenario.configured().filter(|slave| scenario.is_clocked(slave)) {
        marks.paint(slave.times.t_o, slave.times.t_o, 'O');
        marks.paint(t_dp - slave.times.t_i, t_dp - slave.times.t_i, 'I');
    }
    lines.push(String::new());
    if clocked {
        lines.push(format!(" {}", marks.text()));
        legend += "  O T_O  I T_I";
    }
    lines.push(format!("|{}|", strip.text()));
    lines.push(format!("0{:>width$}", whole.to_string(), width = WIDTH + 1));
    lines.push(legend);
}

fn beside(facts: &Facts<'_>, lines: &mut Vec<String>) {
    /// A parameter request with its header, and the longest record that can be read back (octets).
    const READ: (usize, usize) = (14, 244);
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let bus = &scenario.bus.params;
    let clocked = scenario.master.pace == Pace::Synch;
    let spare = plan.spare(scenario.master.t_dp);
    let free = plan.free_running(scenario);
    lines.push(String::new());
    for (what, span) in [
        ("a repeated Data_Exchange: T_S, T_SL, T_ID1".to_owned(), plan.repeat(bus)),
        (format!("an acyclic message with {} octets back", READ.1), plan.acyclic(bus, READ.0, READ.1)),
        ("a Global_Control that tells the mode, with T_ID2".to_owned(), plan.mode(bus)),
    ] {
        lines.push(match (clocked, span <= spare) {
            (true, true) => format!("{what}, {span}, fits into the spare time"),
            (true, false) => format!("{what}, {span}, does not fit into the spare time"),
            (false, _) => format!("{what}, {span}, makes T_cycle {}", free.cycle_with(span)),
        });
    }
    if clocked {
        lines.push(format!("without SYNCH a cycle takes {}, {} with a GAP poll", free.cycle(), free.with_gap()));
    }
}

/// What the token does at the other masters.
fn ring(facts: &Facts<'_>, lines: &mut Vec<String>) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let (bus, t_dp) = (&scenario.bus.params, scenario.master.t_dp);
    if plan.visits.is_empty() {
        return;
    }
    let clocked = scenario.master.pace == Pace::Synch;
    // A free-running master leaves the others T_TR less the shortest rotation.
    let visits = plan.content() - plan.own();
    let rotation = if clocked { t_dp } else { bus.span(bus.t_tc() + plan.longest_high(bus)) + visits };
    let t_th = plan.t_th(bus, rotation);
    let rows = plan.visits.iter().map(|visit| {
        let what = format!("class {}", visit.class);
        vec![visit.station.to_string(), what, us(visit.least), us(visit.longest), us(visit.work), us(visit.most(t_th))]
    });
    lines.push(String::new());
    lines.push("the token's visits to other masters, each with the token itself".to_owned());
    let header = ["master", "is", "at least us", "one message us", "all its work us", "at most us"];
    lines.extend(aligned(&header, &[1], &rows.collect::<Vec<_>>()));
    let bits_of = |bits: Tbit| format!("{bits} ({})", bus.span(bits));
    lines.push(format!(
        "T_TR {}; at least {} for a message of every master",
        bits_of(bus.t_tr),
        bits_of(plan.least_t_tr(bus))
    ));
    if !clocked {
        lines.push(format!("T_TH is up to {t_th}: T_TR - T_RR, the shortest rotation {rotation}"));
        return;
    }
    lines.push(format!("T_TH of the others is {t_th}: T_TR - T_RR, and T_RR is T_DP"));
    lines.push(match plan.synch_delay(bus, t_dp) {
        Span::ZERO => format!("the token is back {} before SYNCH or more", t_dp - plan.content_at_most(t_th)),
        late => match plan.longest_t_tr(bus, t_dp) {
            Some(most) => format!("the token may delay SYNCH by up to {late}; with t_tr = \"{most}\" it does not"),
            None => format!("the token may delay SYNCH by up to {late}, whatever T_TR is"),
        },
    });
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
            Some(Subject::Class2(_, address)) => format!("class 2 master {address}"),
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

fn row(line: &Line<'_>) -> Vec<String> {
    let verdict = match (line.holds(), line.rule.weight) {
        (true, _) => "ok",
        (false, Weight::Must) => "VIOLATED",
        (false, _) => "warning",
    };
    vec![verdict.to_owned(), line.who(), line.numbers(), line.margin(), line.rule.source.to_owned()]
}

/// The rules that hold with the smallest margins in relation to their bounds: times, and none whose bounds leave one
/// value only.
fn tightest<'l, 'a>(all: &'l [Line<'a>]) -> Vec<&'l Line<'a>> {
    let share = |line: &&Line<'_>| {
        let fixed = matches!(line.sides.as_slice(), [low, high] if low.bound == high.bound);
        let side = line.sides.iter().filter_map(|side| match (side.margin_amount()?, side.bound) {
            (Amount::Time(margin), Amount::Time(bound)) if bound > Span::ZERO => {
                Some(i128::from(margin.ticks()) * 1_000_000_000 / i128::from(bound.ticks()))
            }
            _ => None,
        });
        if fixed { None } else { side.min() }
    };
    let mut held: Vec<_> =
        all.iter().filter(|line| line.holds()).filter_map(|line| Some((share(&line)?, line))).collect();
    held.sort_by_key(|pair| pair.0);
    held.into_iter().take(TIGHTEST).map(|pair| pair.1).collect()
}

fn rules(findings: &[Finding], show_all: bool, lines: &mut Vec<String>) {
    let all = gathered(findings);
    let broken = |weight: fn(Weight) -> bool| all.iter().filter(move |line| !line.holds() && weight(line.rule.weight));
    let (wrong, warned) =
        (broken(|weight| weight == Weight::Must).count(), broken(|weight| weight != Weight::Must).count());
    let mut table = |title: String, columns: usize, shown: &[&Line<'_>]| {
        let rows: Vec<_> = shown.iter().map(|line| row(line)).collect();
        let with = |columns: usize| {
            let rows: Vec<_> = rows.iter().map(|row| row[..columns].to_vec()).collect();
            aligned(&["", "of", "rule", "margin", "source"][..columns], &[0, 1, 2, 4], &rows)
        };
        let whole = with(columns);
        let fits = show_all || whole.iter().all(|line| line.trim_end().chars().count() <= COLUMNS);
        lines.push(title);
        // Sources go first where they do not fit; --rules has them all.
        lines.extend(if fits { whole } else { with(4) });
    };
    if show_all {
        table(String::new(), 5, &all.iter().collect::<Vec<_>>());
    } else {
        let off: Vec<_> = all.iter().filter(|line| !line.holds()).collect();
        if !off.is_empty() {
            table(String::new(), 5, &off);
        }
        let held = all.len() - off.len();
        table(format!("\n{} hold, the tightest:", number(held, "rule")), 4, &tightest(&all));
    }
    lines.push(String::new());
    lines.push(format!(
        "rules: {}{}",
        if wrong == 0 { "all hold".to_owned() } else { format!("{} violated", number(wrong, "rule")) },
        if warned == 0 { String::new() } else { format!(", {}", number(warned, "warning")) }
    ));
    for line in all.iter().filter(|line| !line.holds()) {
        lines.push(complaint(line, findings));
    }
}

/// A rule that does not hold, in a sentence with what would do.
fn complaint(line: &Line<'_>, findings: &[Finding]) -> String {
    let side = line.sides.iter().find(|side| !side.holds()).unwrap_or(&line.sides[0]);
    let message = side.fault.as_ref().map_or_else(|| line.numbers(), |fault| fault.message.clone());
    let near = match nearest(side, findings) {
        Some(near) => format!("nearest {} = {near}", side.key.name),
        None if side.follows => side.fault.as_ref().map_or_else(String::new, |fault| fault.help.clone()),
        None => format!("no {} does with the other values as they are: --propose", side.key.name),
    };
    let word = if line.rule.weight == Weight::Must { "violated" } else { "warning" };
    format!("{word}: {}: {message}; {near}", line.who()).trim_end_matches("; ").to_owned()
}
