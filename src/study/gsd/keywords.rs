//! The keywords that are understood: what kind of value each has, in which unit, and what it says.

/// What a keyword's value must be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Shape {
    /// 0 or 1; more counts as 1.
    Flag,
    /// A whole number from 0 to this.
    Number(u32),
    /// A text.
    Text,
}

/// What a number counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Unit {
    /// Itself.
    Plain,
    /// It is shown as hexadecimal.
    Hex,
    /// Octets.
    Octets,
    /// Bit times.
    Tbit,
    /// 1/12 us.
    Iso,
    /// TBASE_DP.
    OfBaseDp,
    /// TBASE_IO.
    OfBaseIo,
    /// 100 us.
    Us100,
    /// 10 ms.
    Ms10,
}

/// What a keyword is about.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Group {
    Identity,
    Rates,
    Lengths,
    Services,
    Isochronous,
    Dxb,
}

impl Group {
    pub(super) const ALL: [Self; 6] =
        [Self::Identity, Self::Rates, Self::Lengths, Self::Services, Self::Isochronous, Self::Dxb];

    pub(super) const fn title(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Rates => "bit rates",
            Self::Lengths => "lengths",
            Self::Services => "services",
            Self::Isochronous => "isochronous mode",
            Self::Dxb => "slave-to-slave communication",
        }
    }
}

/// A keyword of the whole device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keyword {
    /// As the GSD specification writes it.
    pub(super) name: &'static str,
    pub(super) group: Group,
    pub(super) shape: Shape,
    pub(super) unit: Unit,
    /// Whether the crate `gsd-parser` reads it too; the others are read here alone.
    pub(super) shared: bool,
    /// What it says, after its value.
    pub(super) says: &'static str,
}

use Group::{Dxb, Identity, Isochronous, Lengths, Rates, Services};
use Shape::{Flag, Number, Text};
use Unit::{Hex, Iso, Ms10, Octets, OfBaseDp, OfBaseIo, Plain, Tbit, Us100};

const U8: Shape = Number(0xFF);
const U16: Shape = Number(0xFFFF);
const U32: Shape = Number(u32::MAX);

const fn keyword(
    name: &'static str,
    group: Group,
    (shape, unit): (Shape, Unit),
    shared: bool,
    says: &'static str,
) -> Keyword {
    Keyword { name, group, shape, unit, shared, says }
}
const fn rate(name: &'static str, says: &'static str) -> Keyword {
    keyword(name, Rates, (Flag, Plain), true, says)
}
const fn max_tsdr(name: &'static str) -> Keyword {
    keyword(name, Rates, (U16, Tbit), true, "longest time to an answer")
}

/// Every keyword that is understood outside of blocks, apart from user parameters. Source: GSD files of DP-V2 devices.
pub(super) const KEYWORDS: &[Keyword] = &[
    keyword("GSD_Revision", Identity, (U8, Plain), true, "revision of the GSD specification"),
    keyword("Vendor_Name", Identity, (Text, Plain), true, ""),
    keyword("Model_Name", Identity, (Text, Plain), true, ""),
    keyword("Revision", Identity, (Text, Plain), true, ""),
    keyword("Ident_Number", Identity, (U16, Hex), true, "octets 5 and 6 of Set_Prm"),
    keyword("Protocol_Ident", Identity, (U8, Plain), false, "0 is PROFIBUS DP"),
    keyword("Station_Type", Identity, (U8, Plain), false, "0 is a slave"),
    keyword("Hardware_Release", Identity, (Text, Plain), true, ""),
    keyword("Software_Release", Identity, (Text, Plain), true, ""),
    keyword("Implementation_Type", Identity, (Text, Plain), true, ""),
    keyword("OrderNumber", Identity, (Text, Plain), false, ""),
    keyword("Info_Text", Identity, (Text, Plain), false, ""),
    rate("9.6_supp", "9.6 kbit/s"),
    rate("19.2_supp", "19.2 kbit/s"),
    rate("31.25_supp", "31.25 kbit/s"),
    rate("45.45_supp", "45.45 kbit/s"),
    rate("93.75_supp", "93.75 kbit/s"),
    rate("187.5_supp", "187.5 kbit/s"),
    rate("500_supp", "500 kbit/s"),
    rate("1.5M_supp", "1.5 Mbit/s"),
    rate("3M_supp", "3 Mbit/s"),
    rate("6M_supp", "6 Mbit/s"),
    rate("12M_supp", "12 Mbit/s"),
    max_tsdr("MaxTsdr_9.6"),
    max_tsdr("MaxTsdr_19.2"),
    max_tsdr("MaxTsdr_31.25"),
    max_tsdr("MaxTsdr_45.45"),
    max_tsdr("MaxTsdr_93.75"),
    max_tsdr("MaxTsdr_187.5"),
    max_tsdr("MaxTsdr_500"),
    max_tsdr("MaxTsdr_1.5M"),
    max_tsdr("MaxTsdr_3M"),
    max_tsdr("MaxTsdr_6M"),
    max_tsdr("MaxTsdr_12M"),
    keyword("Auto_Baud_supp", Rates, (Flag, Plain), true, "finds the bit rate by itself"),
    keyword("Min_Slave_Intervall", Rates, (U16, Us100), false, "shortest time between two polls"),
    keyword("Modular_Station", Lengths, (Flag, Plain), true, "modules are chosen"),
    keyword("Max_Module", Lengths, (U8, Plain), true, "modules at most"),
    keyword("Modul_Offset", Lengths, (U8, Plain), false, "number of the first slot"),
    keyword("Max_Input_Len", Lengths, (U8, Octets), true, "from slave to master"),
    keyword("Max_Output_Len", Lengths, (U8, Octets), true, "from master to slave"),
    keyword("Max_Data_Len", Lengths, (U16, Octets), true, "both together"),
    keyword("Max_Diag_Data_Len", Lengths, (U8, Octets), true, "of diagnosis"),
    keyword("Max_User_Prm_Data_Len", Lengths, (U8, Octets), true, "of Set_Prm from octet 8 on"),
    keyword("User_Prm_Data_Len", Lengths, (U8, Octets), true, "of User_Prm_Data"),
    keyword("Fail_Safe", Services, (Flag, Plain), true, "an empty Data_Exchange means Clear"),
    keyword("Sync_Mode_supp", Services, (Flag, Plain), true, "takes Sync"),
    keyword("Freeze_Mode_supp", Services, (Flag, Plain), true, "takes Freeze"),
    keyword("Set_Slave_Add_supp", Services, (Flag, Plain), true, "takes its address over the bus"),
    keyword("DPV1_Slave", Services, (Flag, Plain), false, "octets 8 to 10 of Set_Prm are DPV1_Status"),
    keyword("C1_Read_Write_supp", Services, (Flag, Plain), false, "acyclic requests of its master"),
    keyword("C1_Read_Write_required", Services, (Flag, Plain), false, "works only with them"),
    keyword("C1_Max_Data_Len", Services, (U8, Octets), false, "of data in one of them"),
    keyword("C1_Response_Timeout", Services, (U16, Ms10), false, "longest time to the answer"),
    keyword("C2_Read_Write_supp", Services, (Flag, Plain), false, "acyclic requests of other masters"),
    keyword("C2_Max_Data_Len", Services, (U8, Octets), false, "of data in one of them"),
    keyword("C2_Response_Timeout", Services, (U16, Ms10), false, "longest time to the answer"),
    keyword("C2_Max_Count_Channels", Services, (U8, Plain), false, "connections at a time"),
    keyword("WD_Base_1ms_supp", Services, (Flag, Plain), false, "watchdog in steps of 1 ms"),
    keyword("Check_Cfg_Mode", Services, (Flag, Plain), false, "takes other configurations than its own"),
    keyword("Prm_Block_Structure_supp", Services, (Flag, Plain), false, "Set_Prm in blocks"),
    keyword("Prm_Block_Structure_req", Services, (Flag, Plain), false, "Set_Prm only in blocks"),
    keyword("Isochron_Mode_supp", Isochronous, (Flag, Plain), false, "works isochronously"),
    keyword("Isochron_Mode_required", Isochronous, (Flag, Plain), false, "works only isochronously"),
    keyword("TBASE_DP", Isochronous, (U32, Iso), false, "step of T_DP"),
    keyword("TDP_MIN", Isochronous, (U16, OfBaseDp), false, "shortest T_DP"),
    keyword("TDP_MAX", Isochronous, (U16, OfBaseDp), false, "longest T_DP"),
    keyword("T_PLL_W_MAX", Isochronous, (U16, Iso), false, "widest clock window"),
    keyword("TBASE_IO", Isochronous, (U32, Iso), false, "step of T_I and T_O"),
    keyword("TI_MIN", Isochronous, (U16, OfBaseIo), false, "shortest T_I"),
    keyword("TO_MIN", Isochronous, (U16, OfBaseIo), false, "what T_O must exceed T_DX by"),
    keyword("Publisher_supp", Dxb, (Flag, Plain), false, "other slaves can have its inputs"),
    keyword("Subscriber_supp", Dxb, (Flag, Plain), false, "takes other slaves' inputs"),
    keyword("DXB_Max_Link_Count", Dxb, (U8, Plain), false, "links at most"),
    keyword("DXB_Max_Data_Length", Dxb, (U8, Octets), false, "of one sample at most"),
    keyword("DXB_Subscribertable_Block_Location", Dxb, (U8, Plain), false, "where its table goes"),
];

/// Keywords that are understood and do nothing here, each with the reason.
pub(super) const WITHOUT_EFFECT: &[(&str, &str)] = &[
    ("Auto_Baud_supp", "slaves know the bit rate from the start"),
    ("Modular_Station", "a slave has one module"),
    ("Max_Module", "a slave has one module"),
    ("Modul_Offset", "a slave has one module; records and parameters are those of slot 1 (manual 6.3)"),
    ("User_Prm_Data_Len", "the octets themselves are read"),
    ("Set_Slave_Add_supp", "addresses are the scenario's"),
    ("C1_Read_Write_required", "MS1 is open in data exchange, used or not"),
    ("Check_Cfg_Mode", "a slave takes the configuration of its module alone"),
    ("Prm_Block_Structure_req", "Set_Prm always comes in blocks"),
    (
        "DXB_Subscribertable_Block_Location",
        "the tool puts the table behind all other blocks, which slaves find by type",
    ),
];

/// The keyword `name`, in capitals or not.
pub(super) fn find(name: &str) -> Option<&'static Keyword> {
    KEYWORDS.iter().find(|keyword| keyword.name.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::BitRate;

    #[test]
    fn keywords_are_unique_and_every_rate_has_its_two() {
        for (i, a) in KEYWORDS.iter().enumerate() {
            assert!(KEYWORDS[..i].iter().all(|b| !b.name.eq_ignore_ascii_case(a.name)), "{}", a.name);
        }
        for (i, (name, reason)) in WITHOUT_EFFECT.iter().enumerate() {
            assert!(find(name).is_some_and(|keyword| keyword.name == *name) && !reason.is_empty(), "{name}");
            assert!(WITHOUT_EFFECT[..i].iter().all(|other| other.0 != *name), "{name}");
        }
        let count = |start: &str, end: &str| {
            KEYWORDS.iter().filter(|k| k.group == Rates && k.name.starts_with(start) && k.name.ends_with(end)).count()
        };
        assert_eq!((count("MaxTsdr_", ""), count("", "_supp") - 1), (BitRate::ALL.len(), BitRate::ALL.len()));
    }
}
