//! Plan: the planned bus cycle at its longest, drawn as the one of a run is.

use super::bus_cycle::{self, View};
use super::look::Words;
use super::telegrams::{Bar, Cycle, Kind};
use super::{PlotError, PlotMeta};
use crate::study::plan::{self, Plan};
use crate::study::scenario::{Extent, Pace, Scenario};
use crate::study::topology::Map;
use crate::time::{Span, Time};
use crate::wire::Address;

const FILE: &str = "plan.svg";

/// Draws `plan.svg`.
///
/// # Errors
/// What the library says.
pub fn draw(scenario: &Scenario, planned: &Plan) -> Result<String, PlotError> {
    let (t_dp, bus) = (scenario.master.t_dp, &scenario.bus.params);
    let clocked = scenario.master.pace == Pace::Synch;
    // Long enough ago that nothing is before the beginning of time.
    let t0 = Time::ZERO + Span::from_s(10);
    let cycle = cycle(scenario, planned, t0);
    let meta = meta(scenario);
    let us = |span: Span| span.as_us();
    let next = if clocked { t_dp - bus.span(plan::SYNCH) } else { t_dp };
    let view = View { cycle: &cycle, slaves: &meta.slaves, t0, next: (us(next), us(t_dp)), clocked };
    let (title, subtitle) = if clocked {
        ("Plan: the bus cycle at its longest, to scale", isochronous(scenario, planned))
    } else {
        ("Plan: the free-running bus cycle with a GAP poll, to scale", free_running(scenario, planned))
    };
    let others = match planned.visits.iter().map(|visit| visit.station.to_string()).collect::<Vec<_>>().as_slice() {
        [] => String::new(),
        [one] => format!(" After the token comes its visit to master {one}, which is not drawn."),
        all => format!(" After the token come its visits to the masters {}, which are not drawn.", all.join(", ")),
    };
    let words = Words {
        title,
        subtitle: format!("{subtitle}{others} A telegram shorter than a pixel is one pixel wide."),
        plotted: if clocked {
            "planned telegrams, T_O and T_I of one bus cycle"
        } else {
            "planned telegrams of one bus cycle"
        },
    };
    bus_cycle::draw_view(&meta, &words, &view).map_err(|reason| PlotError { file: FILE, reason })
}

fn isochronous(scenario: &Scenario, planned: &Plan) -> String {
    let spare = planned.spare(scenario.master.t_dp);
    let rest = if spare < Span::ZERO {
        format!("T_DP is {} too short for its content of {}.", -spare, planned.content())
    } else {
        format!("{spare} of T_DP are spare, with T_ID1 kept before SYNCH.")
    };
    format!(
        "from SYNCH to the next SYNCH; t0 is the last bit of SYNCH. Every slave takes its longest T_SDR, a GAP poll is not \
         answered. {rest}"
    )
}

fn free_running(scenario: &Scenario, planned: &Plan) -> String {
    let free = planned.free_running(scenario);
    format!(
        "from the first bit of the first request to the same of the next cycle, {} with a GAP poll and {} without. Every \
         slave takes its longest T_SDR, a GAP poll is not answered.",
        free.with_gap(),
        free.cycle()
    )
}

/// What a picture says about a scenario that is no run's.
pub(super) fn meta(scenario: &Scenario) -> PlotMeta {
    let t_dp = scenario.master.t_dp;
    PlotMeta {
        scenario: scenario.name.clone(),
        topology: Map::of(scenario),
        seed: scenario.run.seed,
        cycle: scenario.cycle_symbol(),
        t_dp,
        slaves: scenario.configured().map(|slave| slave.address).collect(),
        links: scenario.links.iter().map(|link| (link.publisher, link.subscriber)).collect(),
        masters: 1,
        disturbances: Vec::new(),
        duration: match scenario.run.duration {
            Extent::Time(span) => span,
            Extent::Cycles(cycles) => t_dp.checked_mul(cycles as i64).unwrap_or(Span::MAX),
        },
    }
}

/// The planned telegrams of the cycle that begins at `t0`.
fn cycle(scenario: &Scenario, planned: &Plan, t0: Time) -> Cycle {
    let bus = &scenario.bus.params;
    let (t_dp, t_gc) = (scenario.master.t_dp, bus.span(plan::SYNCH));
    let clocked = scenario.master.pace == Pace::Synch;
    let next = if clocked { t_dp - t_gc } else { t_dp };
    let mut cycle = Cycle::planned(t0, (t0 + next, t0 + t_dp));
    let mut bar = |from: Span, to: Span, kind: Kind, slave: Option<Address>| {
        let asks = !matches!(kind, Kind::Reply | Kind::DxbReply);
        cycle.push(Bar { start: t0 + from, end: t0 + to, kind, asks, slave, other: None });
    };
    if clocked {
        bar(-t_gc, Span::ZERO, Kind::Synch, None);
    }
    for slot in &planned.slots {
        let reply = if scenario.publishes(slot.slave) { Kind::DxbReply } else { Kind::Reply };
        bar(slot.request, slot.request_end, Kind::Request, Some(slot.slave));
        bar(slot.reply, slot.reply_end, reply, Some(slot.slave));
    }
    let t_id1 = bus.span(bus.t_id1());
    let gap = planned.t_dx + t_id1;
    bar(gap, gap + bus.span(plan::STATUS_REQUEST), Kind::Gap, None);
    let token = planned.t_dx + planned.gap + t_id1;
    bar(token, token + bus.span(plan::TOKEN), Kind::Token, None);
    for slave in scenario.configured().filter(|slave| scenario.is_clocked(slave)) {
        cycle.plan_slave(slave.address, t0 + slave.times.t_o, t0 + t_dp - slave.times.t_i);
    }
    cycle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::profile::find;
    use crate::study::plot::tests::all_inside_and_apart;
    use crate::study::scenario::tests::network;
    use crate::time::BitRate;

    /// Few, some and as many slaves as a bus can have; a cycle that is too short; instants outside of the cycle.
    #[test]
    fn the_planned_cycle_can_be_read() {
        let device = find("simodrive-sensor-isochron").unwrap();
        for (slaves, t_dp) in [(1, 1_000), (9, 2_000), (122, 16_000), (9, 500), (1, 125)] {
            let mut scenario = network(BitRate::M12, device, slaves);
            scenario.master.t_dp = Span::from_us(t_dp);
            scenario.slaves[0].times.t_i = Span::from_us(t_dp * 2);
            let text = draw(&scenario, &Plan::of(&scenario)).unwrap();
            all_inside_and_apart(&format!("{slaves} slaves in {t_dp} us"), &text);
            for word in ["Plan:", "time from t0 [us]", "T_DP ", "T_O ", "T_I ", "T_DX ", "SYNCH", "token"] {
                assert!(text.contains(word), "{slaves} slaves lack {word}");
            }
            assert_eq!(text.contains("too short for its content"), t_dp <= 500 && slaves > 1 || t_dp == 125);
        }
    }
}
