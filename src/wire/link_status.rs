//! Link status: what a subscriber's diagnosis says of one slave-to-slave link. VPC3+ driver.
//!
//! The block is [`DiagBuffer::link_status`](super::diag::DiagBuffer::link_status): pairs of a publisher's address and this
//! octet. The driver names the three bits and not their places.

bits! {
    /// How one link is. Model: no source has the places of the bits; the good state is on top and the history at the
    /// bottom, so that 80 hex and above is a link that works.
    pub struct LinkStatus: u8 {
        /// Valid data came within the last monitoring time.
        active ACTIVE = 7, "active";
        /// The publisher's data have another length than parameterised.
        error ERROR = 6, "error";
        /// Valid data came since data exchange began.
        data_existed DATA_EXISTED = 0, "data existed";
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn a_status_is_an_octet_of_named_bits() {
        for (octet, text) in [
            (0x00, "none"),
            (0x01, "data existed"),
            (0x40, "error"),
            (0x41, "error, data existed"),
            (0x81, "active, data existed"),
        ] {
            assert_eq!((LinkStatus(octet).to_string().as_str(), LinkStatus(octet).unnamed()), (text, 0));
        }
        assert_eq!((LinkStatus::ACTIVE | LinkStatus::DATA_EXISTED).0, 0x81);
    }
}
