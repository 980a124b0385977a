//! Words: a telegram as one line in the field's words, as a bus analyser shows it.
//!
//! Stations and instants are not part of the line: whoever prints it has columns for them. A reply without service access
//! points does not say which service it answers; [`Words::answering`] takes the request along.

use core::fmt;

use super::acyclic::{Request, Response};
use super::config::TELEGRAM_81;
use super::control::GlobalControl;
use super::diag::Diagnosis;
use super::drive::{Inputs81, Outputs81};
use super::prm::SetPrm;
use super::{Fcb, FrameControl, Header, Sap, Service, StationType, Status, Telegram};

/// A telegram that shows itself as one line.
#[derive(Clone, Copy, Debug)]
pub struct Words<'a> {
    telegram: Telegram<'a>,
    request: Option<Service>,
}

impl<'a> Words<'a> {
    /// A telegram on its own.
    pub const fn of(telegram: Telegram<'a>) -> Self {
        Self { telegram, request: None }
    }
    /// A telegram that answers a request for this service, if it answers one.
    pub const fn answering(telegram: Telegram<'a>, request: Option<Service>) -> Self {
        Self { telegram, request }
    }
}

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.telegram {
            Telegram::ShortAck => f.write_str("SC"),
            Telegram::Token { da, sa } if da == sa => f.write_str("token to itself"),
            Telegram::Token { .. } => f.write_str("token"),
            Telegram::Data { header, du } => match header.fc {
                FrameControl::Request { service, fcb } => request(f, &header, service, fcb, du),
                FrameControl::Response { station, status } => reply(f, &header, (station, status), self.request, du),
            },
        }
    }
}

fn request(f: &mut fmt::Formatter<'_>, header: &Header, service: Service, fcb: Fcb, du: &[u8]) -> fmt::Result {
    match header.dsap {
        _ if service == Service::FdlStatus => return f.write_str("FDL_Status"),
        Some(Sap::GLOBAL_CONTROL) => return control(f, du),
        None => f.write_str("Data_Exchange")?,
        Some(sap) => name(f, sap)?,
    }
    match fcb {
        Fcb::First => f.write_str(", first")?,
        Fcb::Alternate(bit) => write!(f, ", FCB {}", u8::from(bit))?,
        Fcb::Unused => {}
    }
    if service == Service::Msrd {
        f.write_str(", MSRD")?;
    }
    match header.dsap {
        None if du.is_empty() => Ok(()),
        None => outputs(f, du),
        Some(Sap::SET_PRM) => set_prm(f, du),
        Some(Sap::CHK_CFG) => config(f, du),
        Some(sap) if sap <= Sap::MS1 && !du.is_empty() => match Request::parse(du) {
            Ok(pdu) => acyclic_request(f, &pdu),
            Err(error) => write!(f, ": unreadable, {error}"),
        },
        Some(_) => length(f, du),
    }
}

fn reply(
    f: &mut fmt::Formatter<'_>,
    header: &Header,
    (station, status): (StationType, Status),
    request: Option<Service>,
    du: &[u8],
) -> fmt::Result {
    if status == Status::Ok && du.is_empty() && header.ssap.is_none() {
        return match request {
            Some(Service::FdlStatus) | None => write!(f, "FDL_Status: {station}"),
            Some(_) => f.write_str("OK"),
        };
    }
    match header.ssap {
        None => f.write_str("Data_Exchange reply ")?,
        Some(sap) => {
            name(f, sap)?;
            f.write_str(" reply ")?;
        }
    }
    write!(f, "{status}")?;
    match header.ssap {
        None if du.is_empty() => Ok(()),
        None => inputs(f, du),
        Some(Sap::SLAVE_DIAG) => match Diagnosis::parse(du) {
            Ok(diagnosis) => diag(f, &diagnosis),
            Err(error) => write!(f, ": unreadable, {error}"),
        },
        Some(Sap::GET_CFG) => config(f, du),
        Some(sap) if sap <= Sap::MS1 && !du.is_empty() => match Response::parse(du) {
            Ok(pdu) => acyclic_response(f, &pdu),
            Err(error) => write!(f, ": unreadable, {error}"),
        },
        Some(_) => length(f, du),
    }
}

/// The service at a slave's service access point.
fn name(f: &mut fmt::Formatter<'_>, sap: Sap) -> fmt::Result {
    f.write_str(match sap {
        Sap::CHK_CFG => "Chk_Cfg",
        Sap::SET_PRM => "Set_Prm",
        Sap::SLAVE_DIAG => "Slave_Diag",
        Sap::GET_CFG => "Get_Cfg",
        Sap::GLOBAL_CONTROL => "Global_Control",
        Sap::RD_OUTP => "RD_Outp",
        Sap::RD_INP => "RD_Inp",
        Sap::SET_SLAVE_ADD => "Set_Slave_Add",
        Sap::MASTER_MASTER => "master-master",
        Sap::EXT_USER_PRM => "Ext_User_Prm",
        Sap::MS1 => "MS1",
        Sap::MS1_ALARM => "MS1 alarm",
        Sap::MS2_RM => "MS2 resource manager",
        sap if sap <= Sap::MS2_LAST => return write!(f, "MS2 connection {sap}"),
        sap => return write!(f, "SAP {sap}"),
    })
}

fn length(f: &mut fmt::Formatter<'_>, du: &[u8]) -> fmt::Result {
    if du.is_empty() { Ok(()) } else { write!(f, ", {} octets", du.len()) }
}

fn control(f: &mut fmt::Formatter<'_>, du: &[u8]) -> fmt::Result {
    let control = match GlobalControl::parse(du) {
        Ok(control) if control.is_synch() => return f.write_str("SYNCH"),
        Ok(control) => control,
        Err(error) => return write!(f, "Global_Control: unreadable, {error}"),
    };
    f.write_str(if control.clear { "Global_Control Clear" } else { "Global_Control Operate" })?;
    let commands = [
        (control.sync, " Sync"),
        (control.unsync, " Unsync"),
        (control.freeze, " Freeze"),
        (control.unfreeze, " Unfreeze"),
    ];
    for (_, command) in commands.into_iter().filter(|&(on, _)| on) {
        f.write_str(command)?;
    }
    match control.groups {
        0 => f.write_str(", all slaves"),
        groups => {
            f.write_str(", groups")?;
            (0..8).filter(|bit| groups >> bit & 1 == 1).try_for_each(|bit| write!(f, " {}", bit + 1))
        }
    }
}

fn outputs(f: &mut fmt::Formatter<'_>, du: &[u8]) -> fmt::Result {
    match Outputs81::parse(du) {
        Some(Outputs81 { stw2, g1_stw }) => {
            write!(f, ": sign of life {}, G1_STW {:04X}", stw2.sign_of_life(), g1_stw.0)
        }
        None => length(f, du),
    }
}

fn inputs(f: &mut fmt::Formatter<'_>, du: &[u8]) -> fmt::Result {
    match Inputs81::parse(du) {
        Some(Inputs81 { zsw2, g1_zsw, xist1, xist2 }) => write!(
            f,
            ": sign of life {}, G1_ZSW {:04X}, XIST1 {xist1:08X}, XIST2 {xist2:08X}",
            zsw2.sign_of_life(),
            g1_zsw.0,
        ),
        None => length(f, du),
    }
}

fn set_prm(f: &mut fmt::Formatter<'_>, du: &[u8]) -> fmt::Result {
    let prm = match SetPrm::parse(du) {
        Ok(prm) => prm,
        Err(error) => return write!(f, ": unreadable, {error}"),
    };
    write!(f, ": {}, ident {:04X}, min_TSDR {}", prm.status, prm.ident, prm.min_tsdr)?;
    if let Some(units) = prm.watchdog_units() {
        write!(f, ", watchdog {} ms", u32::from(units) * u32::from(prm.watchdog_base_ms()))?;
    }
    if prm.dpv1.octets() != [0; 3] {
        write!(f, ", {}", prm.dpv1)?;
    }
    if prm.dpv1.prm_structure() {
        for block in prm.blocks().map_while(Result::ok) {
            write!(f, ", {}", block.kind)?;
        }
    }
    Ok(())
}

fn config(f: &mut fmt::Formatter<'_>, du: &[u8]) -> fmt::Result {
    if du == TELEGRAM_81 {
        return f.write_str(": telegram 81");
    }
    f.write_str(":")?;
    du.iter().try_for_each(|octet| write!(f, " {octet:02X}"))
}

fn diag(f: &mut fmt::Formatter<'_>, diagnosis: &Diagnosis<'_>) -> fmt::Result {
    write!(f, ": {diagnosis}, ident {:04X}, ", diagnosis.ident)?;
    match diagnosis.master {
        Some(master) => write!(f, "master {master}")?,
        None => f.write_str("no master")?,
    }
    match diagnosis.extended.len() {
        0 => Ok(()),
        len => write!(f, ", {len} octets of extended diagnosis"),
    }
}

fn acyclic_request(f: &mut fmt::Formatter<'_>, pdu: &Request<'_>) -> fmt::Result {
    match pdu {
        Request::Read { record, len } => write!(f, ": read slot {} index {}, up to {len}", record.slot, record.index),
        Request::Write { record, data } => {
            write!(f, ": write slot {} index {}, {} octets", record.slot, record.index, data.len())
        }
        Request::DataTransport { record, data } => {
            write!(f, ": transport slot {} index {}, {} octets", record.slot, record.index, data.len())
        }
        Request::AlarmAck { .. } => f.write_str(": alarm acknowledge"),
        Request::Initiate(_) => f.write_str(": initiate"),
        Request::Idle => f.write_str(": idle"),
        Request::Abort(abort) => write!(f, ": abort {}.{}", abort.instance(), abort.code()),
    }
}

fn acyclic_response(f: &mut fmt::Formatter<'_>, pdu: &Response<'_>) -> fmt::Result {
    match pdu {
        Response::Read { record, data } => {
            write!(f, ": read slot {} index {}, {} octets", record.slot, record.index, data.len())
        }
        Response::Write { record, len } => {
            write!(f, ": written slot {} index {}, {len} octets", record.slot, record.index)
        }
        Response::DataTransport { record, data } => {
            write!(f, ": transport slot {} index {}, {} octets", record.slot, record.index, data.len())
        }
        Response::AlarmAck { .. } => f.write_str(": alarm acknowledged"),
        Response::ResourceManager { server_sap, .. } => write!(f, ": connection at SAP {server_sap}"),
        Response::Initiate(_) => f.write_str(": initiated"),
        Response::Idle => f.write_str(": idle"),
        Response::Abort(abort) => write!(f, ": abort {}.{}", abort.instance(), abort.code()),
        Response::Negative(negative) => write!(f, ": refused, {}", negative.code_1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;

    fn words(hex: &str, request: Option<Service>) -> alloc::string::String {
        let octets: Vec<u8> = hex.split(' ').map(|octet| u8::from_str_radix(octet, 16).unwrap()).collect();
        Words::answering(Telegram::parse(&octets).unwrap(), request).to_string()
    }

    #[test]
    fn worked_telegrams_in_the_fields_words() {
        for (hex, text) in [
            ("68 07 07 68 FF 82 46 3A 3E 00 80 BF 16", "SYNCH"),
            ("68 07 07 68 FF 82 46 3A 3E 00 00 3F 16", "Global_Control Operate, all slaves"),
            ("68 07 07 68 FF 82 46 3A 3E 20 01 60 16", "Global_Control Operate Sync, groups 1"),
            ("DC 02 02", "token to itself"),
            ("DC 05 02", "token"),
            ("E5", "SC"),
            ("10 03 02 49 4E 16", "FDL_Status"),
            ("10 02 03 20 25 16", "FDL_Status: master, ready"),
            ("68 05 05 68 86 82 6D 3C 3E EF 16", "Slave_Diag, first"),
            (
                "68 0B 0B 68 82 86 08 3E 3C 02 05 00 FF 80 F9 09 16",
                "Slave_Diag reply DL: Station_Not_Ready, Prm_Req, ident 80F9, no master",
            ),
            ("68 0B 0B 68 86 82 7D 3E 3E C3 C1 C5 FD 00 51 98 16", "Chk_Cfg, FCB 1: telegram 81"),
            ("68 07 07 68 06 02 7D 10 00 20 00 B5 16", "Data_Exchange, FCB 1: sign of life 1, G1_STW 2000"),
            (
                "68 0F 0F 68 02 06 08 30 00 20 00 00 91 A2 80 00 01 23 45 7C 16",
                "Data_Exchange reply DL: sign of life 3, G1_ZSW 2000, XIST1 0091A280, XIST2 00012345",
            ),
            ("10 06 02 7D 85 16", "Data_Exchange, FCB 1"),
            ("10 02 06 03 0B 16", "Data_Exchange reply RS"),
            ("68 07 07 68 06 02 77 10 00 20 00 AF 16", "Data_Exchange, FCB 1, MSRD: sign of life 1, G1_STW 2000"),
            ("68 05 05 68 86 82 7C 33 33 EA 16", "MS1, FCB 1"),
            ("68 09 09 68 86 82 5C 33 33 5E 00 2F F0 47 16", "MS1, FCB 0: read slot 0 index 47, up to 240"),
            ("68 09 09 68 82 86 08 33 33 DE 80 B5 00 89 16", "MS1 reply DL: refused, state conflict"),
            ("68 05 05 68 86 82 7C 00 32 B6 16", "MS2 connection 0, FCB 1"),
        ] {
            assert_eq!(words(hex, None), text, "{hex}");
        }
        assert_eq!(words("10 02 06 00 08 16", Some(Service::SrdHigh)), "OK");
    }

    #[test]
    fn a_set_prm_says_what_it_sets() {
        let hex = "68 40 40 68 86 82 5D 3D 3E 88 14 01 0B 80 F9 80 C0 00 18 15 81 00 00 08 00 00 20 00 02 00 00 00 01 \
                   00 00 00 00 00 00 00 1C 04 00 00 01 00 00 05 DC 00 10 01 00 00 05 DC 00 01 00 03 00 00 0A 72 00 0C \
                   00 00 9A 16";
        let text = words(hex, None);
        assert!(
            text.starts_with("Set_Prm, FCB 0: Lock_Req, WD_On, ident 80F9, min_TSDR 11, watchdog 200 ms"),
            "{text}"
        );
    }
}
