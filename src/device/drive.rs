//! The subscriber drive: a slave that takes publishers' positions from their replies in the same cycle and follows
//! the first of them.

use alloc::vec::Vec;

use crate::device::sensor::Preset;
use crate::device::unit::{Function, Unit};
use crate::dp::slave::Refusal;
use crate::fdl::Outbox;
use crate::observation::{LinkState, Observation};
use crate::time::{Local, Span};
use crate::wire::Address;
use crate::wire::prm::{BlockType, DxbLink, DxbLinks, SetPrm};

/// Octets of the longest sample that a link brings.
const MAX_SAMPLE: u8 = 4;
/// Most links of a subscriber (VPC3+C).
pub const MAX_LINKS: usize = 29;

/// A slave with the subscriber function.
pub type Drive = Unit<Subscriber>;

/// The subscriber function.
#[derive(Clone, Debug, Default)]
pub struct Subscriber {
    /// Whether it takes user blocks too, which change nothing here.
    user_blocks: bool,
    links: Vec<Link>,
    /// A link is lost when nothing valid came for this long (Model: D27).
    monitoring: Option<Span>,
    publishers: u128,
}

impl Subscriber {
    /// A subscriber that takes blocks of user parameters besides its links, or does not. Model: what a manufacturer's
    /// user parameters do is not known.
    pub fn new(user_blocks: bool) -> Self {
        Self { user_blocks, ..Self::default() }
    }
    /// The links of Set_Prm, checked.
    fn links_of(&self, prm: &SetPrm<'_>) -> Result<Vec<DxbLink>, Refusal> {
        links(prm, self.user_blocks)
    }
}

#[derive(Clone, Debug)]
struct Link {
    params: DxbLink,
    state: LinkState,
    /// When valid data came last, and what they were.
    last: Local,
    value: u32,
}

impl Link {
    fn publisher(&self) -> Address {
        Address::new(self.params.publisher).expect("a checked link")
    }
    fn enter(&mut self, state: LinkState, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.state, state);
        if from != state {
            out.observe(Observation::Link { publisher: self.publisher(), from, to: state });
        }
    }
}

/// The links of Set_Prm, checked.
fn links(prm: &SetPrm<'_>, user_blocks: bool) -> Result<Vec<DxbLink>, Refusal> {
    let mut all = Vec::new();
    for block in prm.blocks() {
        let block = block?;
        match block.kind {
            BlockType::IsoM => {}
            BlockType::User if user_blocks => {}
            BlockType::DxbLinks => {
                let table = DxbLinks::parse(&block)?;
                table.check(MAX_SAMPLE)?;
                all.extend(table.iter());
            }
            kind => {
                let rule = "this device takes isochronous and link table blocks only";
                return Err(Refusal::Device { octet: block.octet + 1, rule, value: kind.code().into() });
            }
        }
    }
    if all.len() > MAX_LINKS {
        let rule = "a subscriber has 29 links at most";
        return Err(Refusal::Device { octet: 11, rule, value: all.len() as u64 });
    }
    Ok(all)
}

impl Function for Subscriber {
    fn check(&self, prm: &SetPrm<'_>) -> Result<(), Refusal> {
        let links = self.links_of(prm)?;
        if !links.is_empty() && !prm.status.wd_on() {
            let rule = "links need the watchdog, its time monitors them";
            return Err(Refusal::Device { octet: 1, rule, value: prm.status.0.into() });
        }
        Ok(())
    }
    fn parameterise(&mut self, prm: &SetPrm<'_>, watchdog: Option<Span>) {
        let link = |params| Link { params, state: LinkState::Lost, last: Local::ZERO, value: 0 };
        self.links = self.links_of(prm).unwrap_or_default().into_iter().map(link).collect();
        self.publishers = self.links.iter().fold(0, |all, link| all | 1 << link.params.publisher);
        self.monitoring = watchdog;
    }
    fn max_failures(_prm: &SetPrm<'_>) -> u8 {
        1
    }
    fn slow(_prm: &SetPrm<'_>) -> bool {
        false
    }
    /// The drive is where the publisher it follows was.
    fn position(&self, _raw: u32) -> (u32, u32) {
        let value = self.links.first().map_or(0, |link| link.value);
        (value, value)
    }
    fn preset(&mut self, _preset: Preset, _raw: u32) {}

    fn set_point(&mut self, now: Local, out: &mut Outbox) {
        for link in &mut self.links {
            if self.monitoring.is_some_and(|time| now - link.last > time) {
                link.enter(LinkState::Lost, out);
            }
            if link.state == LinkState::Active {
                out.observe(Observation::Used { publisher: link.publisher(), position: link.value });
            }
        }
    }
    fn published(&mut self, now: Local, publisher: Address, du: &[u8], out: &mut Outbox) {
        for link in self.links.iter_mut().filter(|link| link.params.publisher == publisher.get()) {
            if du.len() != usize::from(link.params.length) {
                link.enter(LinkState::LengthError, out);
                continue;
            }
            let from = usize::from(link.params.offset);
            let sample = &du[from..from + usize::from(link.params.sample)];
            link.value = sample.iter().fold(0, |value, &octet| value << 8 | u32::from(octet));
            link.last = now;
            link.enter(LinkState::Active, out);
            out.observe(Observation::Subscribed { publisher });
        }
    }
    fn publishers(&self) -> u128 {
        self.publishers
    }
    fn leave(&mut self, _out: &mut Outbox) {
        self.publishers = 0;
        self.links.clear();
    }
}
