//! Everything that can be observed, as plain data.
//!
//! Stations emit observations and never see who reads them. An observation carries no instant of its own: the
//! simulator stamps each with the true time and the station that made it. Metrics, traces, exports, fingerprints
//! and tests all read this one stream.

use core::fmt;

use crate::time::{Local, Span};
use crate::wire::acyclic::{AbortCode, ErrorCode};
use crate::wire::parameter::{self, ErrorNumber};
use crate::wire::{Address, Sap};

macro_rules! named {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
        #[repr(u8)]
        pub enum $name { $($(#[$vdoc])* $variant,)* }

        impl $name {
            /// Every value, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The name as reports print it.
            pub const fn text(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.text())
            }
        }
    };
}

named! {
    /// Operation mode of a class 1 master.
    MasterMode {
        /// No bus activity.
        Offline = "Offline",
        /// In the ring, no DP traffic.
        Stop = "Stop",
        /// Slaves are parameterised and polled, outputs are zero.
        Clear = "Clear",
        /// Outputs are valid.
        Operate = "Operate",
    }
}
named! {
    /// State of a DP slave (EN 50170-2).
    SlaveState {
        /// Own initialisation.
        PowerOn = "POWER_ON",
        /// Waits for Set_Prm.
        WaitPrm = "WAIT_PRM",
        /// Waits for Chk_Cfg.
        WaitCfg = "WAIT_CFG",
        /// Exchanges data.
        DataExch = "DATA_EXCH",
    }
}
named! {
    /// Why a DP slave changed its state.
    SlaveCause {
        /// Own initialisation is finished.
        Initialised = "initialised",
        /// A good Set_Prm.
        Parameterised = "Set_Prm accepted",
        /// A Set_Prm that breaks a rule.
        PrmFault = "Prm_Fault",
        /// A good Chk_Cfg.
        Configured = "Chk_Cfg accepted",
        /// A Chk_Cfg that does not fit.
        CfgFault = "Cfg_Fault",
        /// Unlocked by its master.
        Unlocked = "unlocked",
        /// The watchdog ran out.
        Watchdog = "watchdog",
        /// Data_Exchange with a wrong length.
        OutputLength = "output length",
        /// Power off and on, or a command of the scenario.
        Restart = "restart",
    }
}
named! {
    /// What the master does with one slave.
    HandlerState {
        /// Asks for diagnosis until the slave answers.
        Diagnose = "Slave_Diag",
        /// Reads the configuration back.
        GetCfg = "Get_Cfg",
        /// Sends parameters.
        SetPrm = "Set_Prm",
        /// Sends the configuration.
        ChkCfg = "Chk_Cfg",
        /// Reads diagnosis until the slave is ready.
        AwaitReady = "await ready",
        /// Exchanges data.
        DataExchange = "Data_Exchange",
    }
}
named! {
    /// Start-up phases of an isochronous slave (manual 2.1.1 to 2.1.5).
    Phase {
        /// Parameters and configuration (manual 2.1.1).
        Configuration = "1 configuration",
        /// Synchronising to the clock (manual 2.1.2).
        Clock = "2 clock",
        /// Synchronising to the master's sign of life (manual 2.1.3).
        MasterLife = "3 master sign of life",
        /// The master synchronises to the slave's sign of life (manual 2.1.4).
        SlaveLife = "4 slave sign of life",
        /// Cyclic operation (manual 2.1.5).
        Operation = "5 operation",
    }
}
named! {
    /// State of a slave's clock recovery (Model: D11, D12).
    PllState {
        /// Not started.
        Idle = "idle",
        /// Waits for the first SYNCH.
        Waiting = "waiting",
        /// The window is being narrowed.
        Narrowing = "narrowing",
        /// Final width, not yet locked.
        Settling = "settling",
        /// Locked.
        Locked = "locked",
    }
}
named! {
    /// What a slave made of one clock instant (Model: D11).
    ClockVerdict {
        /// The first SYNCH, from which the prediction starts.
        First = "first",
        /// Inside the window.
        Hit = "hit",
        /// A SYNCH outside the window: a clock failure.
        Outside = "outside",
        /// No SYNCH until the window closed: a clock failure.
        Missing = "missing",
        /// A SYNCH of a cycle that was judged before; ignored.
        Stray = "stray",
    }
}
named! {
    /// State of a sign-of-life monitor, on either side (Model: D16, D17).
    LifeState {
        /// Waits for a first change to a non-zero value.
        Waiting = "waiting",
        /// Counts correct steps, no tolerance.
        Strict = "strict",
        /// Synchronised, the other side follows; no tolerance yet.
        Confirming = "confirming",
        /// Tolerant monitoring.
        Operating = "operating",
    }
}
named! {
    /// State of a slave-to-slave link in the subscriber (Model: D27).
    LinkState {
        /// Nothing came yet, or not for the watchdog time.
        Lost = "lost",
        /// Valid data came within the watchdog time.
        Active = "active",
        /// The publisher's data have another length than parameterised.
        LengthError = "length error",
    }
}
named! {
    /// What a GAP poll found.
    GapAnswer {
        /// No answer within T_SL.
        Absent = "absent",
        /// A passive station.
        Slave = "slave",
        /// An active station, not ready for the ring.
        NotReady = "master, not ready",
        /// An active station, ready for the ring.
        Ready = "master, ready",
        /// An active station in the ring.
        InRing = "master, in ring",
    }
}
named! {
    /// Why an active station left the ring, or lost the token that it held.
    RingExit {
        /// The token passed it over twice.
        Skipped = "passed over twice",
        /// Another station uses its address.
        AddressConflict = "another station has its address",
        /// It heard another station use a token while it held one itself.
        SecondToken = "a second token",
    }
}
named! {
    /// What the two LEDs in the connection cap show, red/green (manual 5.2).
    Leds {
        /// No supply.
        NoSupply = "dark/dark",
        /// Ready, but nothing configured it since power on.
        NotConfigured = "bright/bright",
        /// Parameters or configuration were refused.
        Refused = "bright/flashing",
        /// Ready, but its master does not exchange data with it.
        NotAddressed = "flashing/bright",
        /// Nothing came for a longer time.
        Silence = "bright/dark",
        /// Data exchange.
        DataExchange = "dark/bright",
    }
}

named! {
    /// State of an MS2 connection, on either side.
    ConnectionState {
        /// There is none.
        Closed = "closed",
        /// Asked for, not confirmed yet.
        Opening = "opening",
        /// Nothing is asked.
        Open = "open",
        /// A request waits for its answer.
        Working = "working",
        /// Given up, the other side does not know yet.
        Aborting = "aborting",
    }
}

named! {
    /// Which kind of master asks for an acyclic service.
    MasterClass {
        /// It parameterises its slaves and exchanges data with them.
        One = "class 1",
        /// A tool for commissioning and service.
        Two = "class 2",
    }
}
named! {
    /// What a class 2 master reads or writes.
    AcyclicService {
        /// The diagnosis.
        Diagnosis = "Slave_Diag",
        /// The inputs of a slave.
        Inputs = "RD_Inp",
        /// The outputs of a slave.
        Outputs = "RD_Outp",
        /// The configuration.
        Configuration = "Get_Cfg",
        /// A record over MS2.
        RecordRead = "Read",
        /// A record over MS2.
        RecordWrite = "Write",
    }
}
named! {
    /// How an acyclic service ended.
    AcyclicResult {
        /// The slave did it.
        Positive = "positive",
        /// The slave answered that it does not.
        Negative = "negative",
        /// Nothing that ends it came in time.
        Timeout = "time-out",
        /// Its connection was refused, aborted or closed.
        Broken = "connection lost",
    }
}

/// Why the state of an MS2 connection changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ConnectionCause {
    /// The master asked for it.
    Initiated,
    /// The slave confirmed it.
    Confirmed,
    /// No connection is free, or the slave has closed it.
    Refused,
    /// This side gives it up.
    GaveUp(AbortCode),
    /// The other side aborted it: octet 3 of the abort, instance and code.
    Aborted(u8),
    /// The other side knows of the abort.
    Told,
    /// The other side does not ask any more.
    Silence,
}
impl fmt::Display for ConnectionCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Initiated => f.write_str("Initiate"),
            Self::Confirmed => f.write_str("confirmed"),
            Self::Refused => f.write_str("refused, SAP closed"),
            Self::GaveUp(code) => write!(f, "given up, {code}"),
            Self::Aborted(reason) => match AbortCode::from_code(reason & 0x0F) {
                Some(code) => write!(f, "aborted by the other side, {code}"),
                None => write!(f, "aborted by the other side, reason {reason:02X}"),
            },
            Self::Told => f.write_str("abort told"),
            Self::Silence => f.write_str("nothing heard"),
        }
    }
}

/// Why an acyclic request failed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AcyclicFailure {
    /// The slave's service access point is closed.
    Closed,
    /// Nothing came in time.
    Timeout,
    /// The slave left data exchange.
    Left,
    /// The connection was aborted, by either side: octet 3 of the abort, instance and code.
    Aborted(u8),
    /// The slave refused it, with this class and code (DP-V1).
    Refused(ErrorCode),
    /// The answer cannot be read.
    Unreadable,
}
impl fmt::Display for AcyclicFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed => f.write_str("its service access point is closed"),
            Self::Timeout => f.write_str("no answer in time"),
            Self::Left => f.write_str("it left data exchange"),
            Self::Aborted(reason) => match AbortCode::from_code(reason & 0x0F) {
                Some(code) => write!(f, "the connection was aborted, {code}"),
                None => write!(f, "the connection was aborted, reason {reason:02X}"),
            },
            Self::Refused(code) => write!(f, "refused: {code}"),
            Self::Unreadable => f.write_str("its answer cannot be read"),
        }
    }
}

/// Something a station saw or did. Instants are readings of the station's own crystal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Observation {
    // ----- master
    /// A DP cycle began: the last bit of SYNCH has just left the master (Model: D1).
    CycleStart {
        /// Number of the cycle, from 0.
        cycle: u64,
        /// Where the master aimed, on its own jitter-free grid.
        nominal: Local,
    },
    /// The Data_Exchange part is over: last bit of the last reply at the master, or the end of its slot time.
    ExchangeDone {
        /// From t0 to here (Model: D2).
        t_dx: Span,
        /// Repeated requests in this part.
        retries: u32,
    },
    /// Everything of this cycle is sent; silence until the next SYNCH (Model: D6).
    CycleSpare {
        /// From the end of the Data_Exchange part to the end of the token.
        acyclic: Span,
        /// From here to the first bit of the next SYNCH.
        spare: Span,
    },
    /// SYNCH could not be sent at its planned instant, the bus was still in use.
    ClockLate {
        /// How late its sending begins.
        by: Span,
    },
    /// The token came back, or acyclic traffic of the master itself ended, so late that whole cycles are left out.
    SynchMissed {
        /// How many SYNCH never left.
        cycles: u64,
    },
    /// The master's operation mode changed.
    MasterMode {
        /// Before.
        from: MasterMode,
        /// Now.
        to: MasterMode,
    },
    /// What the master does with one slave changed.
    Handler {
        /// The slave.
        slave: Address,
        /// Before.
        from: HandlerState,
        /// Now.
        to: HandlerState,
    },
    /// A request without answer is sent again.
    Retry {
        /// To whom.
        slave: Address,
    },
    /// No answer after all retries.
    NoAnswer {
        /// From whom.
        slave: Address,
    },
    /// An answer that does not fit its request.
    IllegalAnswer {
        /// From whom.
        slave: Address,
    },
    /// A slave left data exchange against the master's will: it refused (RS), answered nonsense, was silent for too long,
    /// or said so in its diagnosis. `Handler` tells that the master starts over, also where it does so of its own accord.
    Lost {
        /// Which.
        slave: Address,
    },
    /// A slave's diagnosis was read. What it says is told by `Diagnosis`, if that is new.
    DiagnosisRead {
        /// Whose.
        slave: Address,
    },
    /// A slave's diagnosis as the master read it.
    Diagnosis {
        /// Whose.
        slave: Address,
        /// Octets 1 to 3.
        status: [u8; 3],
    },
    /// A slave's diagnosis has extended blocks, or others than before.
    ExtendedDiagnosis {
        /// Whose.
        slave: Address,
        /// All their octets.
        length: u8,
        /// The first of them, zero where there are fewer.
        first: [u8; 8],
    },
    /// A slave replied with high priority (DH): its diagnosis is read in the next cycle.
    DiagnosisDue {
        /// Which.
        slave: Address,
    },
    /// The master sends the slaves a command that is no mode.
    Control {
        /// Octets 1 and 2 of Global_Control.
        octets: [u8; 2],
    },
    /// The master goes back to Clear: a slave was without Data_Exchange for Data_Control_Time (Error_Action_Flag).
    AutoClear {
        /// Which.
        slave: Address,
    },
    /// A GAP poll and what it found.
    Gap {
        /// The polled address.
        address: Address,
        /// The answer.
        answer: GapAnswer,
    },
    /// The token was claimed after T_TO of silence.
    TokenClaimed,
    /// The token came from another active station.
    TokenReceived {
        /// T_RR, real rotation time: since the token came last; zero the first time.
        t_rr: Span,
        /// T_TH, what may be used of it; not positive where the token came late.
        t_th: Span,
    },
    /// The token was sent again: nothing was heard of the station it went to.
    TokenRetry {
        /// To whom.
        to: Address,
    },
    /// The token was given up while it was held.
    TokenDropped {
        /// Why.
        why: RingExit,
    },
    /// This station got its first token: it is in the ring.
    RingEntered,
    /// This station left the ring and listens.
    RingLeft {
        /// Why.
        why: RingExit,
    },
    /// Another station has this station's address: it keeps away from the line.
    AddressConflict,
    /// A GAP poll found an active station that is ready: it is next in the ring.
    StationJoined {
        /// Which one.
        station: Address,
    },
    /// An active station did not take the token and is no longer in the ring.
    StationLost {
        /// Which one.
        station: Address,
    },
    /// The master application's check of one slave's sign of life changed its state (Model: D17).
    SlaveLife {
        /// Whose.
        slave: Address,
        /// Before.
        from: LifeState,
        /// Now.
        to: LifeState,
        /// Whether the failure counter went over its limit.
        tripped: bool,
    },
    /// The master application counts its sign of life for a slave no further, or again.
    MasterLifeHeld {
        /// For whom.
        slave: Address,
        /// Held or running.
        held: bool,
    },

    /// The master application asks a slave for parameters, or to change one.
    ParameterRequest {
        /// Whom.
        slave: Address,
        /// Parameter number.
        pnu: u16,
        /// First element.
        subindex: u16,
        /// Elements, 0 for a parameter that is no array.
        elements: u8,
        /// Change instead of read.
        change: bool,
    },
    /// One value of a slave's answer.
    ParameterValue {
        /// Whose.
        slave: Address,
        /// Parameter number.
        pnu: u16,
        /// Element.
        subindex: u16,
        /// The value.
        value: u32,
    },
    /// A parameter that a slave did not give or change.
    ParameterError {
        /// Whose.
        slave: Address,
        /// Parameter number.
        pnu: u16,
        /// Element asked for first.
        subindex: u16,
        /// Error number (PROFIdrive).
        number: u16,
    },
    /// An acyclic request got no answer that could be used.
    AcyclicFailed {
        /// From whom.
        slave: Address,
        /// Why.
        why: AcyclicFailure,
    },

    /// What a class 2 master has read from a slave or written to it, but for parameters.
    AcyclicData {
        /// The slave.
        slave: Address,
        /// By which service.
        service: AcyclicService,
        /// Slot and index of a record.
        record: Option<(u8, u8)>,
        /// Octets of the data.
        len: u8,
        /// The first of them, zero where there are none.
        head: [u8; 8],
    },
    /// An acyclic service is over: a PDU and its answer, or the repeated polls for it, or one read of DP-V0.
    AcyclicDone {
        /// Of whom it was asked.
        slave: Address,
        /// By which kind of master.
        class: MasterClass,
        /// How it ended.
        result: AcyclicResult,
        /// From its beginning at the master to here.
        took: Span,
    },
    /// An MS2 connection was opened or closed, seen by the slave or by the class 2 master. Its requests are not told.
    Connection {
        /// The other side.
        peer: Address,
        /// The slave's SAP; 49 before the resource manager has named another.
        sap: Sap,
        /// Before.
        from: ConnectionState,
        /// Now.
        to: ConnectionState,
        /// Why.
        why: ConnectionCause,
    },

    // ----- slave
    /// A slave's DP state changed.
    SlaveState {
        /// Before.
        from: SlaveState,
        /// Now.
        to: SlaveState,
        /// Why.
        cause: SlaveCause,
    },
    /// Sync or Freeze mode of a slave changed.
    Held {
        /// Outputs wait for Sync.
        outputs: bool,
        /// Inputs are held.
        inputs: bool,
    },
    /// A start-up phase was entered.
    Phase {
        /// Before.
        from: Phase,
        /// Now.
        to: Phase,
    },
    /// A slave judged one clock instant.
    Clock {
        /// The verdict.
        verdict: ClockVerdict,
        /// Arrival minus prediction; zero for `First` and `Missing`.
        error: Span,
        /// Recovered period.
        period: Span,
        /// Half width of the window in force.
        window: Span,
        /// Clock failure counter, ten per failure.
        counter: u16,
    },
    /// The state of the clock recovery changed.
    Pll {
        /// Before.
        from: PllState,
        /// Now.
        to: PllState,
    },
    /// The position was latched (manual 3.3.5).
    Latch {
        /// At T_I of a locked clock, or free-running at a request (Model: D8).
        locked: bool,
        /// What the next reply will carry.
        inputs: Inputs,
    },
    /// T_O: set points take effect and the sign of life is compared (manual 3.3.6).
    SetPoint {
        /// Master's sign of life.
        mls: u8,
        /// Own sign of life from now on.
        sls: u8,
        /// Sign-of-life failure counter, ten per failure.
        counter: u16,
        /// Whether the value was as expected.
        expected: bool,
    },
    /// The sign-of-life monitor changed its state.
    MasterLife {
        /// Before.
        from: LifeState,
        /// Now.
        to: LifeState,
    },
    /// A fault was latched (manual 5.3).
    Fault {
        /// Code in `G1_XIST2`.
        code: u16,
    },
    /// A fault was acknowledged (`G1_STW` bit 15).
    Acknowledged {
        /// Code in `G1_XIST2` until now.
        code: u16,
    },
    /// The LEDs show something else (manual 5.2).
    Leds {
        /// Before.
        from: Leds,
        /// Now.
        to: Leds,
    },
    /// The supply was switched.
    Power {
        /// On or off.
        on: bool,
    },

    // ----- slave to slave
    /// A publisher's reply was taken over by a subscriber.
    Subscribed {
        /// Whose.
        publisher: Address,
    },
    /// A publisher's reply came with another length than parameterised and was not taken over.
    WrongLength {
        /// Whose.
        publisher: Address,
        /// Its length (octets).
        length: u8,
    },
    /// A subscriber used a publisher's value at its T_O.
    Used {
        /// Whose.
        publisher: Address,
        /// The value (steps).
        position: u32,
    },
    /// The state of a link changed.
    Link {
        /// The publisher.
        publisher: Address,
        /// Before.
        from: LinkState,
        /// Now.
        to: LinkState,
    },

    // ----- bus, made by the simulator for the sending station
    /// Two telegrams overlapped on the line; the second one began during the first.
    Collision {
        /// Who was sending already.
        with: Address,
    },
    /// An order of the scenario came while this station had no supply.
    OrderLost,
    /// The scenario disturbed this station, a telegram of it, or the line at its place.
    Disturbed {
        /// Number of the disturbance in the scenario, from 0.
        number: u16,
        /// How.
        how: Disturbance,
    },
}

named! {
    /// What the scenario did to one telegram, to a station, or put on the line at its place.
    Disturbance {
        /// A burst of a disturbance begins.
        Begins = "begins",
        /// A burst of a disturbance is over.
        Ends = "ends",
        /// It never reached the line.
        Lost = "telegram lost",
        /// It left late.
        Late = "telegram late",
        /// It comes a second time.
        Doubled = "telegram doubled",
        /// Some of its bits are wrong.
        WrongBits = "wrong bits",
        /// Characters without sense came onto the line.
        Noise = "noise",
        /// A telegram of nobody came onto the line.
        Foreign = "foreign telegram",
    }
}

/// The twelve octets of telegram 81 from a slave as words (manual 2.2).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Inputs {
    /// `ZSW2`: bits 15..12 are the slave's sign of life.
    pub zsw2: u16,
    /// `G1_ZSW`.
    pub g1_zsw: u16,
    /// `G1_XIST1`, left-justified position.
    pub xist1: u32,
    /// `G1_XIST2`, right-justified position or fault code.
    pub xist2: u32,
}

impl Observation {
    /// Whether this happens rarely and belongs into a log of events, rather than once or more in every cycle or in
    /// words that another event has already.
    pub const fn is_event(&self) -> bool {
        !matches!(
            self,
            Self::CycleStart { .. }
                | Self::ExchangeDone { .. }
                | Self::CycleSpare { .. }
                | Self::Clock { verdict: ClockVerdict::Hit, .. }
                | Self::Latch { .. }
                | Self::SetPoint { expected: true, .. }
                | Self::Subscribed { .. }
                | Self::WrongLength { .. }
                | Self::Used { .. }
                | Self::AcyclicDone { .. }
                | Self::Gap { .. }
                | Self::Lost { .. }
                | Self::DiagnosisRead { .. }
                | Self::TokenReceived { .. }
        )
    }
}

impl Observation {
    /// What is about acyclic services, as text; nothing for anything else.
    fn fmt_acyclic(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ParameterRequest { slave, pnu, subindex, elements, change } => {
                let verb = if *change { "change" } else { "read" };
                write!(f, "slave {slave}: {verb} P{pnu}[{subindex}], {elements} elements, {}", parameter::name(*pnu))
            }
            Self::ParameterValue { slave, pnu, subindex, value } => {
                let element = parameter::element(*pnu, *subindex);
                write!(f, "slave {slave}: P{pnu}[{subindex}] = {value} ({value:X} hex), {element}")
            }
            Self::ParameterError { slave, pnu, subindex, number } => {
                let name = ErrorNumber::from_code(*number).map_or("error not assigned", ErrorNumber::name);
                write!(f, "slave {slave}: P{pnu}[{subindex}] error {number:02X}, {name}")
            }
            Self::AcyclicFailed { slave, why } => write!(f, "slave {slave}: acyclic request failed, {why}"),
            Self::AcyclicData { slave, service, record, len, head } => {
                write!(f, "slave {slave}: {service}")?;
                if let Some((slot, index)) = record {
                    write!(f, " slot {slot} index {index}")?;
                }
                write!(f, ", {len} octets")?;
                head.iter().take((*len).into()).try_for_each(|octet| write!(f, " {octet:02X}"))?;
                if usize::from(*len) > head.len() { f.write_str(" ...") } else { Ok(()) }
            }
            Self::AcyclicDone { slave, class, result, took } => {
                write!(f, "slave {slave}: acyclic service of {class} {result} after {took}")
            }
            Self::Connection { peer, sap, from, to, why } => {
                write!(f, "MS2 with {peer} at SAP {sap}: {from} -> {to} ({why})")
            }
            _ => Ok(()),
        }
    }
    /// What happens at the instants of a slave's clock, as text; nothing for anything else.
    fn fmt_clock(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clock { verdict, error, window, counter, .. } => {
                write!(f, "clock {verdict}, error {error}, window {window}, failure counter {counter}")
            }
            Self::Latch { locked, inputs } => {
                write!(f, "latch {} ({})", inputs.xist1, if *locked { "at T_I" } else { "free-running" })
            }
            Self::SetPoint { mls, sls, counter, expected } => {
                let verdict = if *expected { "expected" } else { "NOT EXPECTED" };
                write!(f, "T_O, master sign of life {mls} {verdict}, own {sls}, failure counter {counter}")
            }
            _ => Ok(()),
        }
    }
}

/// One line in the field's words.
impl fmt::Display for Observation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CycleStart { cycle, .. } => write!(f, "cycle {cycle} starts"),
            Self::ExchangeDone { t_dx, retries } => write!(f, "T_DX {t_dx}, {retries} retries"),
            Self::CycleSpare { acyclic, spare } => write!(f, "acyclic part and token {acyclic}, spare {spare}"),
            Self::ClockLate { by } => write!(f, "SYNCH {by} late, the bus was in use"),
            Self::SynchMissed { cycles } => write!(f, "{cycles} SYNCH missed, the token was away or the bus in use"),
            Self::MasterMode { from, to } => write!(f, "master {from} -> {to}"),
            Self::Handler { slave, from, to } => write!(f, "slave {slave}: {from} -> {to}"),
            Self::Retry { slave } => write!(f, "slave {slave}: request repeated"),
            Self::NoAnswer { slave } => write!(f, "slave {slave}: no answer"),
            Self::IllegalAnswer { slave } => write!(f, "slave {slave}: illegal answer"),
            Self::Lost { slave } => write!(f, "slave {slave}: left data exchange"),
            Self::DiagnosisRead { slave } => write!(f, "slave {slave}: diagnosis read"),
            Self::Diagnosis { .. }
            | Self::ExtendedDiagnosis { .. }
            | Self::DiagnosisDue { .. }
            | Self::Control { .. }
            | Self::AutoClear { .. }
            | Self::Held { .. } => self.fmt_services(f),
            Self::Gap { address, answer } => write!(f, "GAP {address}: {answer}"),
            Self::TokenClaimed => f.write_str("token claimed"),
            Self::TokenReceived { .. }
            | Self::TokenRetry { .. }
            | Self::TokenDropped { .. }
            | Self::RingEntered
            | Self::RingLeft { .. }
            | Self::AddressConflict
            | Self::StationJoined { .. }
            | Self::StationLost { .. } => self.fmt_ring(f),
            Self::SlaveLife { slave, from, to, tripped } => {
                write!(f, "slave {slave}: its sign of life {from} -> {to}{}", if *tripped { ", FAULT" } else { "" })
            }
            Self::MasterLifeHeld { slave, held } => {
                write!(f, "master sign of life for {slave} {}", if *held { "held" } else { "running" })
            }
            Self::ParameterRequest { .. }
            | Self::ParameterValue { .. }
            | Self::ParameterError { .. }
            | Self::AcyclicFailed { .. }
            | Self::AcyclicData { .. }
            | Self::AcyclicDone { .. }
            | Self::Connection { .. } => self.fmt_acyclic(f),
            Self::SlaveState { from, to, cause } => write!(f, "{from} -> {to} ({cause})"),
            Self::Phase { from, to } => write!(f, "phase {from} -> {to}"),
            Self::Clock { .. } | Self::Latch { .. } | Self::SetPoint { .. } => self.fmt_clock(f),
            Self::Pll { from, to } => write!(f, "PLL {from} -> {to}"),
            Self::MasterLife { from, to } => write!(f, "master sign of life {from} -> {to}"),
            Self::Fault { code } => write!(f, "fault {code:04X}"),
            Self::Acknowledged { code } => write!(f, "fault {code:04X} acknowledged"),
            Self::Leds { from, to } => write!(f, "LEDs red/green {from} -> {to}"),
            Self::Power { on } => write!(f, "supply {}", if *on { "on" } else { "off" }),
            Self::Subscribed { publisher } => write!(f, "data of publisher {publisher}"),
            Self::WrongLength { publisher, length } => {
                write!(f, "{length} octets of publisher {publisher}, wrong length")
            }
            Self::Used { publisher, position } => write!(f, "position {position} of publisher {publisher} used"),
            Self::Link { publisher, from, to } => write!(f, "link to {publisher}: {from} -> {to}"),
            Self::Collision { with } => write!(f, "collision with {with}"),
            Self::OrderLost => f.write_str("an order is lost, there is no supply"),
            Self::Disturbed { number, how: how @ (Disturbance::Begins | Disturbance::Ends) } => {
                write!(f, "disturbance {} {how}", number + 1)
            }
            Self::Disturbed { how, .. } => write!(f, "disturbed: {how}"),
        }
    }
}

impl Observation {
    /// What DP services do beside Data_Exchange, as text; nothing for anything else.
    fn fmt_services(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Diagnosis { slave, status: [a, b, c] } => {
                write!(f, "slave {slave}: diagnosis {a:02X} {b:02X} {c:02X}")
            }
            Self::ExtendedDiagnosis { slave, length, first } => {
                write!(f, "slave {slave}: extended diagnosis of {length} octets")?;
                let shown = usize::from(*length).min(first.len());
                if shown > 0 {
                    f.write_str(":")?;
                }
                first[..shown].iter().try_for_each(|octet| write!(f, " {octet:02X}"))?;
                if shown < usize::from(*length) { f.write_str(" ...") } else { Ok(()) }
            }
            Self::DiagnosisDue { slave } => write!(f, "slave {slave}: reply of high priority, its diagnosis is due"),
            Self::Control { octets: [command, groups] } => write!(f, "Global_Control {command:02X} {groups:02X}"),
            Self::AutoClear { slave } => write!(f, "slave {slave}: no Data_Exchange for Data_Control_Time, AutoClear"),
            Self::Held { outputs, inputs } => {
                let word = |on: bool| if on { "on" } else { "off" };
                write!(f, "Sync mode {}, Freeze mode {}", word(*outputs), word(*inputs))
            }
            _ => Ok(()),
        }
    }
    /// What happens in the token ring, as text; nothing for anything else.
    fn fmt_ring(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TokenReceived { t_rr, t_th } => write!(f, "token received after T_RR {t_rr}, T_TH {t_th}"),
            Self::TokenRetry { to } => write!(f, "token to {to} repeated"),
            Self::TokenDropped { why } => write!(f, "token given up: {why}"),
            Self::RingEntered => f.write_str("entered the ring"),
            Self::RingLeft { why } => write!(f, "left the ring: {why}"),
            Self::AddressConflict => f.write_str("another station has this address, offline"),
            Self::StationJoined { station } => write!(f, "station {station} joins the ring"),
            Self::StationLost { station } => write!(f, "station {station} took no token and leaves the ring"),
            _ => Ok(()),
        }
    }
}
