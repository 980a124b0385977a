#![cfg_attr(not(feature = "sim"), no_std)]
//! isodp simulates whole isochronous PROFIBUS DP (DP-V2) networks, telegram by telegram and octet by octet, in
//! deterministic virtual time: the master with its clock and jitter, token, GAP and acyclic part, the cable, and any
//! number of absolute encoders, each running the real slave: parameterisation, clock recovery, sign of life,
//! telegram 81, T_I and T_O, faults.
//!
//! # Layers
//!
//! Imports point down only; a test reads the `use` lines.
//!
//! ```text
//! study        scenario, plan, run, metrics, exports, plots          files, threads, reports
//! sim          event queue, bus, crystals, noise, faults, recorder   true time
//! ------------ from here down: no_std + alloc, no true time ------------------------------------
//! device       encoder, drive: PLL, sign of life, sensor; master application
//! dp           DP master and slave, isochronous cycle, MS1
//! fdl          active and passive station, bus parameters, the station contract
//! observation  everything that can be observed, as plain data
//! wire         octets <-> telegrams and PDUs
//! time         ticks of 1/12 ns, two clocks, bit rates
//! ```
//!
//! A station is a value that answers: [`fdl::Station::step`] takes what happened at which reading of the station's own
//! crystal and fills an outbox with telegrams, deadlines and observations. So the slave that is simulated is a slave
//! that firmware can ship: build with `--no-default-features` to get `time` to `device` alone.
//!
//! # A network in a few lines
//!
#![cfg_attr(feature = "sim", doc = "```")]
#![cfg_attr(not(feature = "sim"), doc = "```ignore")]
//! use isodp::sim::network::NetworkEvent;
//! use isodp::sim::queue::NearQueue;
//! use isodp::study::{run::run, scenario::Scenario};
//!
//! let text = r#"
//!     [run]
//!     seed = 1
//!     cycles = 300
//!     [bus]
//!     rate = "12 Mbit/s"
//!     [master]
//!     address = 2
//!     t_dp = "2 ms"
//!     t_i = "125 us"
//!     t_o = "1 ms"
//!     [[slave]]
//!     addresses = "3..4"
//!     device = "posital-ocd-dpb1b"
//!     crystal = { within = "50 ppm" }
//! "#;
//! let scenario = Scenario::parse("two", "two.toml", text, &[])?;
//! let outcome = run::<NearQueue<NetworkEvent>>(&scenario, None, |_| ())?;
//! for slave in &outcome.summary.slaves {
//!     assert_eq!((slave.phase, slave.fault_count()), ("5 operation", 0));
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # An encoder without a simulator
//!
//! The encoder alone, octet by octet, as firmware would drive it: the supply comes on, telegrams arrive, each answer
//! leaves one T_SDR later. Parameters, configuration, and the first Data_Exchange, which asks for the position:
//!
//! ```
//! use isodp::device::encoder::{Disc, Encoder};
//! use isodp::device::{profile, unit::UnitSettings};
//! use isodp::fdl::{Heard, Input, Outbox, Station};
//! use isodp::time::{BitRate, Local, Span, Tbit};
//! use isodp::wire::{Address, Fcb, Frame, Header, Sap, Service};
//!
//! let profile = profile::find("posital-ocd-dpb1b").expect("a known device");
//! let [encoder_6, master_2] = [6, 2].map(|number| Address::new(number).expect("an address"));
//! let settings = UnitSettings::new(encoder_6, BitRate::M12, Tbit(30));
//! let mut encoder = Encoder::new(profile, settings, Disc::new(profile, &settings.options));
//!
//! let (mut now, mut out) = (Local::ZERO, Outbox::new());
//! encoder.step(now, Input::PowerOn, &mut out);
//!
//! // A request of master 2 to the encoder at address 6, whose shaft is at step 4096: the octets of the answer.
//! let mut ask = |saps: Option<(Sap, Sap)>, du: &[u8]| {
//!     let header = Header::request(encoder_6, master_2, Service::SrdHigh, Fcb::First);
//!     let header = saps.map_or(header, |(to, from)| header.with_saps(to, from));
//!     let mut request = Frame::new();
//!     request.set_data(&header, du).expect("a telegram");
//!     now += Span::from_ms(1);
//!     out.clear();
//!     encoder.step(now, Input::Telegram(Heard { octets: request.octets(), sample: 4096 }), &mut out);
//!     let (send, answer) = out.sending().expect("an answer");
//!     assert_eq!(send.at - now, BitRate::M12.span(Tbit(30)));
//!     answer.octets().to_vec()
//! };
//!
//! // Slave_Diag: the encoder waits for parameters.
//! let diagnosis = ask(Some((Sap::SLAVE_DIAG, Sap::MASTER_MS0)), &[]);
//! assert_eq!(diagnosis[9..15], [0x02, 0x05, 0x00, 0xFF, 0x06, 0xDF]);
//!
//! // Set_Prm (manual 3.1) and Chk_Cfg (manual 2.1.1) are answered with SC.
//! let prm = [
//!     0x88, 20, 1, 11, 0x06, 0xDF, 0x80, 0xC0, 0x00, 0x18, // lock, watchdog 200 ms, ident, group 8, IsoM
//!     0x15, 0x81, 0, 0, 0x00, 0, 0, 0x20, 0, 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, // user block: no scaling
//!     0x1C, 0x04, 0, 0, 1, 0, 0, 0x05, 0xDC, 0, 16, 1, // T_BASE_DP 125 us, T_DP 2 ms, T_MAPC 1
//!     0, 0, 0x05, 0xDC, 0, 1, 0, 8, 0, 0, 0x15, 0x0C, 0, 12, 0, 0, // T_I 125 us, T_O 1 ms, T_DX, T_PLL_W 1 us
//! ];
//! assert_eq!(ask(Some((Sap::SET_PRM, Sap::MASTER_MS0)), &prm), [0xE5]);
//! assert_eq!(ask(Some((Sap::CHK_CFG, Sap::MASTER_MS0)), &profile.config), [0xE5]);
//!
//! // Data_Exchange: STW2 = 0, G1_STW = 2000; ZSW2 = 0, G1_ZSW = 2000, G1_XIST1 left-justified, G1_XIST2.
//! let inputs = &ask(None, &[0x00, 0x00, 0x20, 0x00])[7..19];
//! assert_eq!(inputs, [0x00, 0x00, 0x20, 0x00, 0x00, 0x08, 0x00, 0x00, 0x00, 0x00, 0x10, 0x00]);
//! ```

extern crate alloc;

pub mod device;
pub mod dp;
pub mod fdl;
pub mod observation;
#[cfg(feature = "sim")]
pub mod sim;
#[cfg(feature = "sim")]
pub mod study;
pub mod time;
pub mod wire;
