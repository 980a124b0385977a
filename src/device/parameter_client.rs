//! The master's side of the PROFIdrive parameter channel: a request is written to record 47, its answer is read from
//! there (manual 4, PROFIdrive base mode).
//!
//! | stage | answer | next |
//! |---|---|---|
//! | Written | positive | Reading |
//! | Reading | positive | values and errors are told; the next request |
//! | Reading | state conflict: not ready yet | Reading |
//! | any | anything else | the failure is told; the next request |

use alloc::collections::VecDeque;

use crate::dp::ms1::{Failure, Job, Pdu};
use crate::fdl::Outbox;
use crate::observation::{AcyclicFailure, Observation};
use crate::wire::Address;
use crate::wire::acyclic::{ErrorCode, Record, Request, Response};
use crate::wire::parameter::{self, Format, ParameterAddress, RequestId, ResponseId, Values};

/// The record of the parameter channel; telegram 81 sits in slot 1 (manual 6.3).
const CHANNEL: Record = Record { slot: 1, index: Record::PARAMETER_CHANNEL };
/// Octets of the longest answer that is asked for.
const MAX_ANSWER: u8 = 240;

/// Values of one answer that are told one by one.
const MAX_VALUES: usize = 64;

/// A request and the slave it is for.
#[derive(Clone, Debug)]
struct Asked {
    slave: usize,
    address: Address,
    parameter: ParameterAddress,
    change: Option<(Format, u32)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    /// The request is to be written.
    Written,
    /// The answer is to be read.
    Reading,
}

/// Requests of the master application, one after the other.
#[derive(Clone, Debug, Default)]
pub struct ParameterClient {
    waiting: VecDeque<Asked>,
    running: Option<(Asked, Stage)>,
    reference: u8,
}

impl ParameterClient {
    /// Asks a slave (its index and address) for a parameter, or to change it.
    pub fn ask(
        &mut self,
        (slave, address): (usize, Address),
        parameter: ParameterAddress,
        change: Option<(Format, u32)>,
        out: &mut Outbox,
    ) {
        let ParameterAddress { pnu, subindex, elements, .. } = parameter;
        let request =
            Observation::ParameterRequest { slave: address, pnu, subindex, elements, change: change.is_some() };
        out.observe(request);
        self.waiting.push_back(Asked { slave, address, parameter, change });
    }

    /// The next job for the slave, if there is something to do.
    pub fn job(&mut self) -> Option<Job> {
        if self.running.is_none() {
            self.running = Some((self.waiting.pop_front()?, Stage::Written));
            self.reference = if self.reference == u8::MAX { 1 } else { self.reference + 1 };
        }
        let (asked, stage) = self.running.as_ref()?;
        let pdu = match stage {
            Stage::Written => write(self.reference, asked.parameter, asked.change),
            Stage::Reading => read(),
        };
        Some(Job { slave: asked.slave, pdu })
    }

    /// Takes what became of the job.
    pub fn answered(&mut self, answer: Result<&[u8], Failure>, out: &mut Outbox) {
        let Some((asked, stage)) = self.running.take() else { return };
        let failed = |why| Observation::AcyclicFailed { slave: asked.address, why };
        let response = match answer {
            Ok(pdu) => Response::parse(pdu),
            Err(why) => return out.observe(failed(failure(why))),
        };
        match (stage, response) {
            (Stage::Written, Ok(Response::Write { .. })) => self.running = Some((asked, Stage::Reading)),
            (Stage::Reading, Ok(Response::Negative(negative))) if negative.code_1 == ErrorCode::STATE_CONFLICT => {
                self.running = Some((asked, Stage::Reading));
            }
            (Stage::Reading, Ok(Response::Read { data, .. })) => {
                tell(asked.address, (asked.parameter, asked.change), data, out);
            }
            (_, Ok(Response::Negative(negative))) => out.observe(failed(AcyclicFailure::Refused(negative.code_1))),
            _ => out.observe(failed(AcyclicFailure::Unreadable)),
        }
    }
}

/// The PDU that writes a request for a parameter to the channel.
pub(super) fn write(reference: u8, parameter: ParameterAddress, change: Option<(Format, u32)>) -> Pdu {
    let mut data = [0; MAX_ANSWER as usize];
    let id = if change.is_some() { RequestId::Change } else { RequestId::Read };
    let octets = change.map(|(format, value)| (format, value.to_be_bytes()));
    let value = octets.as_ref().map(|(format, octets)| {
        let from = octets.len() - format.size().min(octets.len());
        Values { format: *format, data: &octets[from..] }
    });
    let len = parameter::emit_request((reference, id, 0), &[parameter], value.as_slice(), &mut data).unwrap_or(0);
    Pdu::of(&Request::Write { record: CHANNEL, data: &data[..len] })
}
/// The PDU that reads the answer from the channel.
pub(super) fn read() -> Pdu {
    Pdu::of(&Request::Read { record: CHANNEL, len: MAX_ANSWER })
}
/// Why a request has no answer, in the words of observations.
pub(super) const fn failure(why: Failure) -> AcyclicFailure {
    match why {
        Failure::Closed => AcyclicFailure::Closed,
        Failure::Timeout => AcyclicFailure::Timeout,
        Failure::Left => AcyclicFailure::Left,
        Failure::Aborted(reason) => AcyclicFailure::Aborted(reason),
    }
}

/// Tells the values of the answer to a request, or its errors.
pub(super) fn tell(
    slave: Address,
    (parameter, change): (ParameterAddress, Option<(Format, u32)>),
    data: &[u8],
    out: &mut Outbox,
) {
    let ParameterAddress { pnu, subindex, .. } = parameter;
    let Ok(response) = parameter::Response::parse(data) else {
        return out.observe(Observation::AcyclicFailed { slave, why: AcyclicFailure::Unreadable });
    };
    // One step tells only so much, and no parameter of these devices has so many elements.
    if response.values().map(|values| values.count().max(1)).sum::<usize>() > MAX_VALUES {
        return out.observe(Observation::AcyclicFailed { slave, why: AcyclicFailure::Unreadable });
    }
    if let (ResponseId::Changed, Some((_, value))) = (response.id, change) {
        out.observe(Observation::ParameterValue { slave, pnu, subindex, value });
    }
    for values in response.values() {
        if let Some(number) = values.error_number() {
            out.observe(Observation::ParameterError { slave, pnu, subindex, number });
            continue;
        }
        for at in 0..values.count() {
            // P965 is a string whose octets are elements.
            let octet = values.data.get(at).filter(|_| values.format == Format::OctetString);
            if let Some(value) = values.unsigned(at).or(octet.map(|&octet| octet.into())) {
                out.observe(Observation::ParameterValue { slave, pnu, subindex: subindex + at as u16, value });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dp::ms1::MAX_PDU;
    use alloc::vec;

    /// What a slave answers is data: also an answer that is far too long for one step.
    #[test]
    fn an_answer_with_too_many_values_is_told_as_unreadable() {
        let slave = Address::new(3).unwrap();
        let parameter = ParameterAddress { attribute: ParameterAddress::VALUE, elements: 200, pnu: 979, subindex: 0 };
        let mut client = ParameterClient::default();
        client.ask((0, slave), parameter, None, &mut Outbox::new());
        client.job().expect("the request");
        client.answered(Ok(&[0x5F, 1, 47, 10]), &mut Outbox::new());
        client.job().expect("the read");
        let mut data = vec![1, ResponseId::Read.code(), 0, 1, Format::Unsigned8.code(), 200];
        data.resize(206, 7);
        let mut pdu = vec![0; MAX_PDU];
        let len = Response::Read { record: CHANNEL, data: &data }.emit(&mut pdu).expect("it fits");
        let mut out = Outbox::new();
        client.answered(Ok(&pdu[..len]), &mut out);
        let told: Vec<_> = out.observations().copied().collect();
        assert_eq!(told, [Observation::AcyclicFailed { slave, why: AcyclicFailure::Unreadable }]);
    }
}
