//! Which telegrams a disturbance means: of whom, to whom, of which service.
//!
//! A telegram is told by its octets; the short acknowledgement and a reply without SAPs by the request before it. Source of
//! the SAPs: EN 50170-2, DP-V1.

use crate::wire::{self, Address, FrameControl, Header, Sap, Telegram};

/// A telegram that a station sends, before anything is done to it.
#[derive(Clone, Copy, Debug)]
pub struct Sent<'a> {
    /// Who sends it.
    pub sender: Address,
    /// Whether it is SYNCH.
    pub clock: bool,
    /// The characters.
    pub octets: &'a [u8],
}

/// Which telegrams a disturbance means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Which {
    /// Only those of this station.
    pub from: Option<Address>,
    /// Only those to this station.
    pub to: Option<Address>,
    /// Only those of this service.
    pub service: Service,
}

/// Services that a disturbance can mean.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Service {
    /// Every telegram, SYNCH too.
    All,
    /// Every telegram but SYNCH.
    Any,
    /// What the station with the token sends, but SYNCH and the token.
    Requests,
    /// What answers a request.
    Replies,
    /// Requests and replies of this kind.
    Only(Kind),
}

/// Kinds of telegrams.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// The clock.
    Synch,
    /// Global_Control, but SYNCH.
    GlobalControl,
    /// Data_Exchange.
    DataExchange,
    /// Slave_Diag.
    Diagnosis,
    /// Set_Prm.
    SetPrm,
    /// Chk_Cfg.
    ChkCfg,
    /// FDL status.
    FdlStatus,
    /// The token.
    Token,
    /// MS1 and MS2.
    Acyclic,
    /// Everything else.
    Other,
}

/// What is known of a telegram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    kind: Kind,
    to: Option<Address>,
    reply: bool,
}

/// The request that was sent last.
#[derive(Clone, Copy, Debug)]
struct Asked {
    by: Address,
    of: Address,
    kind: Kind,
}

/// Tells telegrams apart.
#[derive(Clone, Debug, Default)]
pub struct Classifier {
    asked: Option<Asked>,
}

impl Classifier {
    /// What the next telegram on the line is.
    pub fn identify(&mut self, sent: &Sent<'_>) -> Identity {
        let identity = |kind, to, reply| Identity { kind, to, reply };
        match Telegram::parse(sent.octets) {
            Ok(Telegram::Token { da, .. }) => identity(Kind::Token, Some(da), false),
            Ok(Telegram::Data { header, .. }) => match header.fc {
                FrameControl::Request { service, .. } => {
                    let kind = if sent.clock { Kind::Synch } else { request(&header, service) };
                    self.asked = Some(Asked { by: header.sa, of: header.da, kind });
                    identity(kind, Some(header.da), false)
                }
                FrameControl::Response { .. } => identity(self.reply(&header), Some(header.da), true),
            },
            Ok(Telegram::ShortAck) => {
                let asked = self.asked.filter(|asked| asked.of == sent.sender);
                identity(asked.map_or(Kind::Other, |asked| asked.kind), asked.map(|asked| asked.by), true)
            }
            Err(_) => identity(Kind::Other, None, false),
        }
    }
    fn reply(&self, header: &Header) -> Kind {
        match (header.ssap, self.asked) {
            (Some(sap), _) => of_sap(sap),
            (None, Some(asked)) if asked.of == header.sa => asked.kind,
            (None, _) => Kind::DataExchange,
        }
    }
}

fn request(header: &Header, service: wire::Service) -> Kind {
    match (service, header.dsap) {
        (wire::Service::FdlStatus, _) => Kind::FdlStatus,
        (wire::Service::Ident | wire::Service::LsapStatus, _) => Kind::Other,
        (_, None) => Kind::DataExchange,
        (_, Some(sap)) => of_sap(sap),
    }
}

/// The kind of what goes to, or comes from, this SAP of a slave.
fn of_sap(sap: Sap) -> Kind {
    match sap {
        Sap::CHK_CFG => Kind::ChkCfg,
        Sap::SET_PRM => Kind::SetPrm,
        Sap::SLAVE_DIAG => Kind::Diagnosis,
        Sap::GLOBAL_CONTROL => Kind::GlobalControl,
        Sap::MS1 | Sap::MS1_ALARM | Sap::MS2_RM => Kind::Acyclic,
        sap if sap <= Sap::MS2_LAST => Kind::Acyclic,
        _ => Kind::Other,
    }
}

impl Which {
    /// Every telegram of this service.
    pub const fn all(service: Service) -> Self {
        Self { from: None, to: None, service }
    }
    /// Whether it means the telegram of `sender` that is this.
    pub fn means(&self, sender: Address, telegram: Identity) -> bool {
        let Identity { kind, to, reply } = telegram;
        self.from.is_none_or(|from| from == sender)
            && (self.to.is_none() || self.to == to)
            && match self.service {
                Service::All => true,
                Service::Any => kind != Kind::Synch,
                Service::Requests => !reply && kind != Kind::Synch && kind != Kind::Token,
                Service::Replies => reply,
                Service::Only(only) => only == kind,
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Fcb, Frame, Status};

    fn address(number: u8) -> Address {
        Address::new(number).unwrap()
    }
    fn request_to(to: u8, saps: Option<(Sap, Sap)>, service: wire::Service) -> Frame {
        let mut header = Header::request(address(to), address(2), service, Fcb::First);
        if let Some((dsap, ssap)) = saps {
            header = header.with_saps(dsap, ssap);
        }
        let mut frame = Frame::new();
        frame.set_data(&header, &[]).unwrap();
        frame
    }
    fn answer(request: &Frame) -> Frame {
        let Ok(Telegram::Data { header, .. }) = request.telegram() else { panic!("a request") };
        let mut frame = Frame::new();
        frame.set_data(&header.slave_reply(Status::Dl), &[1]).unwrap();
        frame
    }
    /// What the telegrams of one exchange with slave 5 are.
    fn identities(request: &Frame, answer: &Frame) -> [Identity; 2] {
        let mut classifier = Classifier::default();
        [(2, request), (5, answer)].map(|(sender, frame)| {
            classifier.identify(&Sent { sender: address(sender), clock: false, octets: frame.octets() })
        })
    }

    #[test]
    fn requests_and_their_answers_are_of_one_kind() {
        let mut sc = Frame::new();
        sc.set_short_ack();
        let ms0 = |sap| Some((sap, Sap::MASTER_MS0));
        for (saps, service, kind) in [
            (None, wire::Service::SrdHigh, Kind::DataExchange),
            (None, wire::Service::Msrd, Kind::DataExchange),
            (None, wire::Service::FdlStatus, Kind::FdlStatus),
            (ms0(Sap::SLAVE_DIAG), wire::Service::SrdHigh, Kind::Diagnosis),
            (ms0(Sap::SET_PRM), wire::Service::SrdHigh, Kind::SetPrm),
            (ms0(Sap::CHK_CFG), wire::Service::SrdHigh, Kind::ChkCfg),
            (ms0(Sap::GET_CFG), wire::Service::SrdHigh, Kind::Other),
            (Some((Sap::MS1, Sap::MASTER_MS1)), wire::Service::SrdLow, Kind::Acyclic),
            (Some((Sap::MS2_RM, Sap::MASTER_MS2)), wire::Service::SrdLow, Kind::Acyclic),
            (Some((Sap(0), Sap::MASTER_MS2)), wire::Service::SrdLow, Kind::Acyclic),
            (Some((Sap(48), Sap::MASTER_MS2)), wire::Service::SrdLow, Kind::Acyclic),
        ] {
            let request = request_to(5, saps, service);
            for answer in [&answer(&request), &sc] {
                let [asked, answered] = identities(&request, answer);
                assert_eq!(asked, Identity { kind, to: Some(address(5)), reply: false });
                assert_eq!(answered, Identity { kind, to: Some(address(2)), reply: true });
            }
        }
    }

    #[test]
    fn a_short_acknowledgement_that_nobody_asked_for_is_to_nobody() {
        let mut sc = Frame::new();
        sc.set_short_ack();
        let other = request_to(6, None, wire::Service::SrdHigh);
        let [_, stray] = identities(&other, &sc);
        assert_eq!(stray, Identity { kind: Kind::Other, to: None, reply: true });
    }

    #[test]
    fn services_mean_what_their_names_say() {
        let of = |kind, reply| Identity { kind, to: Some(address(5)), reply };
        let [synch, token] = [of(Kind::Synch, false), of(Kind::Token, false)];
        let [request, reply] = [of(Kind::DataExchange, false), of(Kind::DataExchange, true)];
        let meant =
            |service| [synch, token, request, reply].map(|telegram| Which::all(service).means(address(2), telegram));
        assert_eq!(meant(Service::All), [true, true, true, true]);
        assert_eq!(meant(Service::Any), [false, true, true, true]);
        assert_eq!(meant(Service::Requests), [false, false, true, false]);
        assert_eq!(meant(Service::Replies), [false, false, false, true]);
        assert_eq!(meant(Service::Only(Kind::Synch)), [true, false, false, false]);
        assert_eq!(meant(Service::Only(Kind::Token)), [false, true, false, false]);
        assert_eq!(meant(Service::Only(Kind::DataExchange)), [false, false, true, true]);
        let to_six = Which { to: Some(address(6)), ..Which::all(Service::All) };
        let from_two = Which { from: Some(address(2)), ..Which::all(Service::All) };
        assert!(!to_six.means(address(2), request));
        assert_eq!([2, 5].map(|sender| from_two.means(address(sender), request)), [true, false]);
    }
}
