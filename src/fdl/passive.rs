//! The passive station: answers requests after T_SDR and tells a new request from a repeated one.
//!
//! | request | stored before | answer | stored after |
//! |---|---|---|---|
//! | FCV = 0, FCB = 1 | anything | execute | this master, FCB = 1, its reply |
//! | FCV = 1, other FCB, same master | FCB | execute | new FCB, its reply |
//! | FCV = 1, same FCB, same master | FCB and reply | stored reply again, nothing executed | unchanged |
//! | FCV = 1, another master | anything | execute | this master, its FCB, its reply |
//! | FDL status | anything | station type at once | unchanged |
//! | unanswered (SDN, 127) | anything | none, handed up | unchanged |
//!
//! Source: EN 50170-2, FCB and FCV rules.

use crate::fdl::Outbox;
use crate::time::{BitRate, Local, Span, Tbit};
use crate::wire::{Address, Fcb, Frame, FrameControl, Header, Service, StationType, Status, Telegram};

/// What a heard telegram means for the layer above.
#[derive(Clone, Copy, Debug)]
pub enum Indication<'a> {
    /// Nothing: not for this station, broken, or dealt with here.
    Nothing,
    /// A request to execute once; [`Passive::reply`] or [`Passive::acknowledge`] must answer it in the same step.
    Request {
        /// Addresses, SAPs and service.
        header: &'a Header,
        /// Data unit.
        du: &'a [u8],
    },
    /// A telegram for several stations that nobody answers.
    Broadcast {
        /// Addresses, SAPs and service.
        header: &'a Header,
        /// Data unit.
        du: &'a [u8],
    },
    /// A publisher's reply to 127 (slave to slave).
    Published {
        /// The publisher.
        publisher: Address,
        /// Its inputs.
        du: &'a [u8],
    },
}

/// A passive station's data link layer.
#[derive(Clone, Debug)]
pub struct Passive {
    address: Address,
    rate: BitRate,
    /// Own T_SDR.
    own_tsdr: Tbit,
    /// min T_SDR in force, set by the master (Set_Prm octet 4).
    min_tsdr: Tbit,
    /// T_SDR of the next answer as a span.
    answers_after: Span,
    memory: Memory,
}

/// What is kept to recognise a repeated request.
#[derive(Clone, Debug)]
struct Memory {
    /// Who asked last, and with which FCB; none where it was not counted.
    request: Option<(Address, bool)>,
    /// What was answered; empty while nothing was.
    reply: Frame,
}

impl Memory {
    /// Whether the request that is kept is this master's and was answered.
    #[cold]
    fn has_replied_to(&self, master: Address) -> bool {
        self.request.is_some_and(|(of, _)| of == master) && !self.reply.is_empty()
    }
}

impl Passive {
    /// A station at `address` that needs `own_tsdr` to answer.
    pub fn new(address: Address, rate: BitRate, own_tsdr: Tbit) -> Self {
        let memory = Memory { request: None, reply: Frame::new() };
        let mut passive = Self { address, rate, own_tsdr, min_tsdr: Tbit(0), answers_after: Span::ZERO, memory };
        passive.set_min_tsdr(Tbit(11));
        passive
    }
    /// The station's address.
    pub const fn address(&self) -> Address {
        self.address
    }
    /// T_SDR of the next answer: the station's own, but never below the min T_SDR in force.
    pub fn t_sdr(&self) -> Tbit {
        self.own_tsdr.max(self.min_tsdr)
    }
    /// Puts a min T_SDR in force (Set_Prm octet 4; zero keeps the one before).
    pub fn set_min_tsdr(&mut self, min_tsdr: Tbit) {
        if min_tsdr.0 > 0 {
            self.min_tsdr = min_tsdr;
            self.answers_after = self.rate.span(self.t_sdr());
        }
    }

    /// Takes a telegram whose last bit arrived at `now`. A broken one is dropped before, without a word (EN 50170-2).
    #[inline]
    pub fn heard<'a>(&mut self, now: Local, telegram: &'a Telegram<'a>, out: &mut Outbox) -> Indication<'a> {
        let Telegram::Data { header, du } = telegram else { return Indication::Nothing };
        match header.fc {
            // A publisher that refuses has published nothing.
            FrameControl::Response { status: Status::Dl | Status::Dh, .. } if header.da == Address::BROADCAST => {
                Indication::Published { publisher: header.sa, du }
            }
            FrameControl::Response { .. } => Indication::Nothing,
            FrameControl::Request { .. } if header.da == Address::BROADCAST => Indication::Broadcast { header, du },
            FrameControl::Request { .. } if header.da != self.address => Indication::Nothing,
            FrameControl::Request { service: Service::FdlStatus, .. } => {
                self.answer_status(now, header, out);
                Indication::Nothing
            }
            FrameControl::Request { service, fcb } if service.expects_reply() => {
                if self.is_repeated(header.sa, fcb) {
                    self.reply_again(now, out);
                    return Indication::Nothing;
                }
                Indication::Request { header, du }
            }
            FrameControl::Request { .. } => Indication::Broadcast { header, du },
        }
    }

    #[inline]
    fn is_repeated(&mut self, master: Address, fcb: Fcb) -> bool {
        self.memory.request = match fcb {
            Fcb::Alternate(bit) => {
                if self.memory.request.is_some_and(|(_, last)| last == bit) && self.memory.has_replied_to(master) {
                    return true;
                }
                Some((master, bit))
            }
            fcb => uncounted(master, fcb),
        };
        self.memory.reply.clear();
        false
    }

    #[cold]
    fn reply_again(&self, now: Local, out: &mut Outbox) {
        out.send(now + self.answers_after, |frame| frame.copy_from(&self.memory.reply));
    }
    #[cold]
    fn answer_status(&self, now: Local, request: &Header, out: &mut Outbox) {
        let fc = FrameControl::Response { station: StationType::Slave, status: Status::Ok };
        let header = Header { da: request.sa, sa: self.address, dsap: None, ssap: None, fc };
        out.send(now + self.answers_after, |frame| {
            frame.set_data(&header, &[]).expect("an empty reply fits");
        });
    }

    /// Answers `request`, which came in this step, with a status and so many octets of data, which `write` fills in; as a
    /// publisher to 127.
    ///
    /// # Panics
    /// Above 244 octets: a bug of the caller.
    pub fn reply(
        &mut self,
        now: Local,
        request: &Header,
        (status, len): (Status, usize),
        out: &mut Outbox,
        write: impl FnOnce(&mut [u8]),
    ) {
        let mut header = request.slave_reply(status);
        if matches!(request.fc, FrameControl::Request { service: Service::Msrd, .. }) {
            header.da = Address::BROADCAST;
        }
        let at = now + self.answers_after;
        let memory = &mut self.memory.reply;
        out.send(at, |frame| {
            frame.set_data_with(&header, len, write).expect("a reply fits");
            memory.copy_from(frame);
        });
    }

    /// Answers the request of this step with the short acknowledgement SC.
    pub fn acknowledge(&mut self, now: Local, out: &mut Outbox) {
        let at = now + self.answers_after;
        let memory = &mut self.memory.reply;
        out.send(at, |frame| {
            frame.set_short_ack();
            memory.copy_from(frame);
        });
    }
}

/// What is kept of a request with FCV = 0.
#[cold]
fn uncounted(master: Address, fcb: Fcb) -> Option<(Address, bool)> {
    (fcb == Fcb::First).then_some((master, true))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASTER: Address = Address::new(2).unwrap();
    const OTHER: Address = Address::new(1).unwrap();
    const SLAVE: Address = Address::new(6).unwrap();

    fn request(sa: Address, service: Service, fcb: Fcb) -> Frame {
        let mut frame = Frame::new();
        frame.set_data(&Header::request(SLAVE, sa, service, fcb), &[1, 2]).unwrap();
        frame
    }
    /// Gives the station a request; answers it with `value` where it is executed. Returns the answer on the line.
    fn ask(station: &mut Passive, frame: &Frame, value: u8) -> Option<u8> {
        let mut out = Outbox::new();
        let now = Local::from_ticks(1_000);
        if let Indication::Request { header, .. } = station.heard(now, &frame.telegram().unwrap(), &mut out) {
            station.reply(now, header, (Status::Dl, 1), &mut out, |du| du[0] = value);
        }
        let (send, frame) = out.sending()?;
        assert_eq!(send.at - now, BitRate::M12.span(Tbit(30)), "T_SDR");
        match Telegram::parse(frame.octets()).unwrap() {
            Telegram::Data { du, .. } => du.first().copied(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_repeated_request_gets_the_stored_reply_and_is_not_executed() {
        let mut station = Passive::new(SLAVE, BitRate::M12, Tbit(30));
        let [first, odd, even] =
            [Fcb::First, Fcb::Alternate(false), Fcb::Alternate(true)].map(|fcb| request(MASTER, Service::SrdHigh, fcb));
        assert_eq!(ask(&mut station, &first, 1), Some(1), "first request");
        assert_eq!(ask(&mut station, &even, 2), Some(1), "FCB = 1 again is a repeat of the first");
        assert_eq!(ask(&mut station, &odd, 3), Some(3), "toggled");
        assert_eq!(ask(&mut station, &odd, 4), Some(3), "repeated");
        assert_eq!(ask(&mut station, &first, 5), Some(5), "FCV = 0 is never a repeat");
        assert_eq!(ask(&mut station, &first, 6), Some(6), "FCV = 0 is never a repeat, twice");
    }

    #[test]
    fn another_master_is_never_taken_for_a_repeat() {
        let mut station = Passive::new(SLAVE, BitRate::M12, Tbit(30));
        assert_eq!(ask(&mut station, &request(MASTER, Service::SrdHigh, Fcb::First), 1), Some(1));
        assert_eq!(ask(&mut station, &request(OTHER, Service::SrdHigh, Fcb::Alternate(true)), 2), Some(2));
        assert_eq!(ask(&mut station, &request(MASTER, Service::SrdHigh, Fcb::Alternate(true)), 3), Some(3));
    }

    #[test]
    fn a_publisher_replies_to_everybody() {
        let mut station = Passive::new(SLAVE, BitRate::M12, Tbit(30));
        let mut out = Outbox::new();
        let frame = request(MASTER, Service::Msrd, Fcb::First);
        let telegram = frame.telegram().unwrap();
        let indication = station.heard(Local::ZERO, &telegram, &mut out);
        let Indication::Request { header, .. } = indication else { panic!("{indication:?}") };
        station.reply(Local::ZERO, header, (Status::Dl, 1), &mut out, |_| ());
        assert_eq!(out.sending().unwrap().1.octets()[4], 127);
    }

    #[test]
    fn a_publisher_that_refuses_publishes_nothing() {
        let mut station = Passive::new(SLAVE, BitRate::M12, Tbit(30));
        for (status, published) in [(Status::Dl, true), (Status::Dh, true), (Status::Rs, false), (Status::Rr, false)] {
            let fc = FrameControl::slave(status);
            let header = Header { da: Address::BROADCAST, sa: OTHER, dsap: None, ssap: None, fc };
            let mut frame = Frame::new();
            frame.set_data(&header, &[]).unwrap();
            let telegram = frame.telegram().unwrap();
            let indication = station.heard(Local::ZERO, &telegram, &mut Outbox::new());
            assert_eq!(matches!(indication, Indication::Published { .. }), published, "{status}");
        }
    }

    #[test]
    fn min_tsdr_delays_the_answer_but_zero_keeps_it() {
        let mut station = Passive::new(SLAVE, BitRate::M12, Tbit(30));
        station.set_min_tsdr(Tbit(76));
        station.set_min_tsdr(Tbit(0));
        assert_eq!(station.t_sdr(), Tbit(76));
    }

    #[test]
    fn fdl_status_is_answered_with_the_station_type() {
        let mut station = Passive::new(SLAVE, BitRate::M12, Tbit(30));
        let mut out = Outbox::new();
        let status = [0x10, 0x06, 0x02, 0x49, 0x51, 0x16];
        station.heard(Local::ZERO, &Telegram::parse(&status).unwrap(), &mut out);
        assert_eq!(out.sending().unwrap().1.octets(), [0x10, 0x02, 0x06, 0x00, 0x08, 0x16]);
    }
}
