//! Pcapng: the telegrams of a recording for Wireshark, and the dissector that makes it read them.
//!
//! A packet is a telegram from its start delimiter to its end delimiter, stamped with its first bit at the sender: true
//! time from power-on, which the file counts from 1970-01-01 00:00:00 UTC, in whole nanoseconds, rounded down. The link
//! type is the first of those for own use (147, USER0): Wireshark shows the one of PROFIBUS (257) as unknown, does not
//! save it, and gives a dissector no name to register for. Comments stand at the SYNCH of each cycle and at the telegram
//! during or after which a trigger fired. PCAP Next Generation, draft-ietf-opsawg-pcapng.

use std::borrow::Cow;
use std::io::{self, Write};
use std::time::Duration;

use pcap_file::pcapng::PcapNgWriter;
use pcap_file::pcapng::blocks::enhanced_packet::{EnhancedPacketBlock, EnhancedPacketOption};
use pcap_file::pcapng::blocks::interface_description::{InterfaceDescriptionBlock, InterfaceDescriptionOption};
use pcap_file::pcapng::blocks::section_header::{SectionHeaderBlock, SectionHeaderOption};
use pcap_file::{DataLink, Endianness, PcapError};

use crate::study::flight::stretch::{Cycle, Entry, Stretch, What};
use crate::study::flight::{Recorded, Recording};
use crate::time::{Span, Time};

/// The dissector in Lua.
pub const DISSECTOR: &str = include_str!("profibus_dp.lua");

/// LINKTYPE_USER0.
const LINK_TYPE: DataLink = DataLink::USER0;
/// No telegram is cut (octets); the longest has 255.
const SNAP_LENGTH: u32 = 65_535;

/// Writes the telegrams of every stretch.
///
/// # Errors
/// Of `out`.
pub fn write(recording: &Recording, out: &mut dyn Write) -> io::Result<()> {
    let program = format!("isodp {}", env!("CARGO_PKG_VERSION"));
    let section = SectionHeaderBlock {
        endianness: Endianness::Little,
        options: vec![SectionHeaderOption::UserApplication(program.into())],
        ..SectionHeaderBlock::default()
    };
    let mut file = PcapNgWriter::with_section_header(out, section).map_err(io_error)?;
    file.write_pcapng_block(interface(recording)).map_err(io_error)?;
    for (number, stretch) in recording.stretches.iter().enumerate() {
        let heading = format!("stretch {} of {}", number + 1, recording.stretches.len());
        for packet in packets(stretch, &recording.network, heading) {
            file.write_pcapng_block(packet).map_err(io_error)?;
        }
    }
    Ok(())
}

fn io_error(error: PcapError) -> io::Error {
    match error {
        PcapError::IoError(error) => error,
        error => io::Error::other(error),
    }
}

/// The bus as a network interface.
fn interface(recording: &Recording) -> InterfaceDescriptionBlock<'static> {
    let Recorded { scenario, seed, rate, .. } = &recording.network;
    let description =
        format!("PROFIBUS DP, {rate}, simulated: {scenario}, seed {seed}; time 0 is power-on, stamps are first bits");
    InterfaceDescriptionBlock {
        linktype: LINK_TYPE,
        snaplen: SNAP_LENGTH,
        options: vec![
            InterfaceDescriptionOption::IfName(format!("isodp-{scenario}").into()),
            InterfaceDescriptionOption::IfDescription(description.into()),
            InterfaceDescriptionOption::IfSpeed((Span::from_s(1).ticks() / rate.bit().ticks()) as u64),
            InterfaceDescriptionOption::IfTsResol(9),
        ],
    }
}

/// Each telegram of `stretch` as a packet; the first one carries the `heading`.
fn packets<'a>(
    stretch: &'a Stretch,
    network: &Recorded,
    heading: String,
) -> impl Iterator<Item = EnhancedPacketBlock<'a>> {
    let telegrams: Vec<&Entry> =
        stretch.entries.iter().filter(|entry| matches!(entry.what, What::Telegram { .. })).collect();
    let mut comments = comments(stretch, network, &telegrams);
    if let Some(first) = comments.first_mut() {
        first.insert(0, heading);
    }
    telegrams.into_iter().zip(comments).map(|(entry, comments)| {
        let octets = stretch.octets(entry);
        let comments = comments.into_iter().map(|text| EnhancedPacketOption::Comment(text.into()));
        EnhancedPacketBlock {
            interface_id: 0,
            timestamp: Duration::from_nanos(entry.at.since_zero().div_floor(Span::from_ns(1)).max(0) as u64),
            original_len: octets.len() as u32,
            data: Cow::Borrowed(octets),
            options: comments.collect(),
        }
    })
}

/// What is said of each telegram: which cycle it begins, which disturbance put it there, and what fired from its first
/// bit to that of the next.
fn comments(stretch: &Stretch, network: &Recorded, telegrams: &[&Entry]) -> Vec<Vec<String>> {
    let mut all = vec![Vec::new(); telegrams.len()];
    let until = |at: Time| telegrams.partition_point(|entry| entry.at <= at);
    for &Cycle { number, begin, t0 } in &stretch.cycles {
        if let Ok(at) = telegrams.binary_search_by_key(&begin, |entry| entry.at) {
            all[at].push(format!("cycle {number}, t0 at {:.9} s", t0.since_zero().as_s()));
        }
    }
    for (comments, entry) in all.iter_mut().zip(telegrams) {
        if let What::Telegram { origin, .. } = entry.what
            && let Some(name) = network.culprit(origin)
        {
            comments.push(format!("put there by disturbance {name}"));
        }
    }
    for fired in &stretch.triggers {
        let after = stretch.cycle_at(fired.at).map_or(Span::ZERO, |cycle| fired.at - cycle.t0);
        if let Some(comments) = until(fired.at).checked_sub(1).and_then(|at| all.get_mut(at)) {
            comments.push(format!("TRIGGER {fired}, {:.3} us after t0 of cycle {}", after.as_us(), fired.cycle));
        }
    }
    all
}
