//! The subscriber drive: a slave that takes publishers' data from their replies in the same cycle and follows the first
//! of them.
//!
//! Each link has a state:
//!
//! | state | valid data | data of another length | nothing for the watchdog time |
//! |---|---|---|---|
//! | Lost | Active | LengthError | Lost, overdue |
//! | Active | Active | LengthError | Lost, overdue |
//! | LengthError | Active | LengthError | Lost, overdue |
//!
//! Only valid data are taken, and only those of active links are used; a link that is not active leaves what it brought
//! last. Model: D27 says "nothing valid"; a publisher that goes on sending another length stays a length error, which
//! says more than lost. A link that is overdue or has another length is told in the diagnosis until it is active again.
//! Before the first data of a publisher a link is lost and not yet overdue: publishers start up one after the other
//! (Model: D27).

use alloc::vec;
use alloc::vec::Vec;

use crate::device::links::{Link, Links, Sample};
use crate::device::profile::{DxbLimits, Profile};
use crate::device::sensor::Preset;
use crate::device::unit::{Function, Unit};
use crate::dp::slave::Refusal;
use crate::fdl::{Outbox, Timer};
use crate::observation::{LinkState, Observation};
use crate::time::{Local, Span};
use crate::wire::Address;
use crate::wire::diag::DiagBuffer;
use crate::wire::link_status::LinkStatus;
use crate::wire::prm::SetPrm;

/// A slave with the subscriber function.
pub type Drive = Unit<Subscriber>;

/// The subscriber function.
#[derive(Clone, Debug)]
pub struct Subscriber {
    own: Address,
    limits: DxbLimits,
    links: Links,
    /// How each link is, in the order of the links.
    conditions: Vec<Condition>,
    /// What the links brought: the areas of [`Links`].
    data: Vec<u8>,
    /// Time without data after which a link is lost: the watchdog's (Model: D27).
    monitoring: Option<Span>,
    /// Whether the unit is in data exchange, which is when links are watched.
    watching: bool,
    /// Whether [`Timer::Links`] is armed. It comes no later than any link is due.
    armed: bool,
    publishers: u128,
    /// Number of the diagnosis.
    revision: u32,
}

/// How a link is.
#[derive(Clone, Copy, Debug)]
struct Condition {
    state: LinkState,
    /// When the publisher was heard last, whatever the length, or data exchange began.
    heard: Local,
    /// Nothing was heard for the monitoring time.
    overdue: bool,
    /// Valid data came since data exchange began.
    existed: bool,
}

impl Condition {
    const NEW: Self = Self { state: LinkState::Lost, heard: Local::ZERO, overdue: false, existed: false };

    fn enter(&mut self, publisher: Address, state: LinkState, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.state, state);
        if from != state {
            out.observe(Observation::Link { publisher, from, to: state });
        }
    }
    /// Whether the diagnosis tells of it.
    const fn is_told(self) -> bool {
        self.overdue || matches!(self.state, LinkState::LengthError)
    }
    const fn status(self) -> LinkStatus {
        LinkStatus(0)
            .with(LinkStatus::ACTIVE, matches!(self.state, LinkState::Active))
            .with(LinkStatus::ERROR, matches!(self.state, LinkState::LengthError))
            .with(LinkStatus::DATA_EXISTED, self.existed)
    }
}

impl Subscriber {
    /// The subscriber function of the device at `own`, without links.
    pub fn new(profile: &Profile, own: Address) -> Self {
        Self {
            own,
            limits: profile.dxb,
            links: Links::default(),
            conditions: Vec::new(),
            data: Vec::new(),
            monitoring: None,
            watching: false,
            armed: false,
            publishers: 0,
            revision: 0,
        }
    }
    /// What the link table brought, its samples one behind the other; zeros before the first.
    pub fn link_data(&self) -> &[u8] {
        self.data.get(self.links.link_table()).unwrap_or_default()
    }
    /// The data area of `slot`, into which the subscriber table brings; none for a slot without one, or without links.
    pub fn slot_data(&self, slot: u8) -> Option<&[u8]> {
        self.data.get(self.links.slot(slot)?)
    }
    /// How the link to `publisher` is; none without one.
    pub fn status(&self, publisher: Address) -> Option<LinkStatus> {
        self.statuses().find(|(of, _)| *of == publisher).map(|(_, status)| status)
    }
    /// How each link is, in the order of the tables.
    pub fn statuses(&self) -> impl Iterator<Item = (Address, LinkStatus)> {
        self.links.iter().zip(&self.conditions).map(|(link, condition)| (link.publisher, condition.status()))
    }
    /// Whether the diagnosis tells of links: one of them is overdue or has another length.
    fn tells(&self) -> bool {
        self.conditions.iter().any(|condition| condition.is_told())
    }
    /// Link `index` is not as it was: if the diagnosis tells of links before or after, it is another one now.
    fn changed(&mut self, index: usize, before: Condition) {
        let seen = |condition: Condition| (condition.status(), condition.is_told());
        if seen(before) != seen(self.conditions[index]) && (before.is_told() || self.tells()) {
            self.revision = self.revision.wrapping_add(1);
        }
    }

    /// The position that a link brings: its first sample, of a longer one the first four octets (Model: D24).
    fn value(&self, link: &Link) -> u32 {
        let first = self.links.samples(link).first().and_then(|Sample { to, .. }| self.data.get(to.clone()));
        first.unwrap_or_default().iter().take(4).fold(0, |value, &octet| value << 8 | u32::from(octet))
    }
    /// Arms the timer for the link that is due next.
    fn arm(&mut self, out: &mut Outbox) {
        let heard =
            self.conditions.iter().filter(|condition| !condition.overdue).map(|condition| condition.heard).min();
        let due = heard.zip(self.monitoring).map(|(heard, time)| heard + time);
        self.armed = due.is_some();
        match due {
            Some(due) => out.arm(Timer::Links, due),
            None => out.disarm(Timer::Links),
        }
    }
}

impl Function for Subscriber {
    fn check(&self, prm: &SetPrm<'_>) -> Result<(), Refusal> {
        Links::of(prm, self.own, self.limits).map(|_| ())
    }
    fn parameterise(&mut self, prm: &SetPrm<'_>, watchdog: Option<Span>) {
        self.links = Links::of(prm, self.own, self.limits).unwrap_or_default();
        self.conditions = vec![Condition::NEW; self.links.iter().len()];
        self.data = vec![0; self.links.octets()];
        self.publishers = self.links.iter().fold(0, |all, link| all | 1 << link.publisher.get());
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
        let value = self.links.iter().next().map_or(0, |link| self.value(link));
        (value, value)
    }
    fn preset(&mut self, _preset: Preset, _raw: u32) {}

    fn enter(&mut self, now: Local, out: &mut Outbox) {
        for condition in self.conditions.iter_mut().filter(|condition| condition.state == LinkState::Lost) {
            condition.heard = now;
        }
        self.watching = true;
        if !self.conditions.is_empty() {
            self.arm(out);
        }
    }
    fn monitor(&mut self, now: Local, out: &mut Outbox) {
        let Some(time) = self.monitoring else { return };
        for index in 0..self.conditions.len() {
            let (publisher, before) = (self.links.link(index).publisher, self.conditions[index]);
            if !before.overdue && now - before.heard >= time {
                self.conditions[index].overdue = true;
                self.conditions[index].enter(publisher, LinkState::Lost, out);
                self.changed(index, before);
            }
        }
        self.arm(out);
    }
    fn set_point(&mut self, _now: Local, out: &mut Outbox) {
        for (link, condition) in self.links.iter().zip(&self.conditions) {
            if condition.state == LinkState::Active {
                out.observe(Observation::Used { publisher: link.publisher, position: self.value(link) });
            }
        }
    }
    fn published(&mut self, now: Local, publisher: Address, du: &[u8], out: &mut Outbox) {
        let Some(index) = self.links.iter().position(|link| link.publisher == publisher) else { return };
        let (link, condition) = (self.links.link(index), &mut self.conditions[index]);
        let before = *condition;
        (condition.heard, condition.overdue) = (now, false);
        if du.len() == usize::from(link.length) {
            for Sample { from, to } in self.links.samples(link) {
                self.data[to.clone()].copy_from_slice(&du[from.clone()]);
            }
            condition.existed = true;
            condition.enter(publisher, LinkState::Active, out);
            out.observe(Observation::Subscribed { publisher });
        } else {
            condition.enter(publisher, LinkState::LengthError, out);
            out.observe(Observation::WrongLength { publisher, length: du.len() as u8 });
        }
        self.changed(index, before);
        if self.watching && !self.armed {
            self.arm(out);
        }
    }
    fn publishers(&self) -> u128 {
        self.publishers
    }
    /// Model: the block is about the device as a whole, slot 0, specifier 0, and holds all links as soon as one of them
    /// does not work. That is something wrong, so Ext_Diag is set.
    fn diagnosis(&self, diagnosis: &mut DiagBuffer) {
        if self.tells() {
            diagnosis.set_ext_diag();
            diagnosis.link_status(0, 0, self.statuses().map(|(publisher, status)| (publisher, status.0)));
        }
    }
    fn diagnosis_revision(&self) -> u32 {
        self.revision
    }
    fn leave(&mut self, out: &mut Outbox) {
        if core::mem::take(&mut self.armed) {
            out.disarm(Timer::Links);
        }
        self.revision = self.revision.wrapping_add(self.tells().into());
        self.links = Links::default();
        self.conditions.clear();
        self.data.clear();
        (self.watching, self.publishers) = (false, 0);
    }
}
