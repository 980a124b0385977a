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
//! The encoder alone, octet by octet, as firmware would drive it: the supply comes on, a telegram arrives, the answer
//! leaves one T_SDR later.
//!
//! ```
//! use isodp::device::encoder::{Disc, Encoder};
//! use isodp::device::{profile, unit::UnitSettings};
//! use isodp::fdl::{Heard, Input, Outbox, Station};
//! use isodp::time::{BitRate, Local, Span, Tbit};
//! use isodp::wire::Address;
//!
//! let profile = profile::find("posital-ocd-dpb1b").expect("a known device");
//! let address = Address::new(6).expect("an address");
//! let settings = UnitSettings::new(address, BitRate::M12, Tbit(30));
//! let mut encoder = Encoder::new(profile, settings, Disc::new(profile, &settings.options));
//!
//! let mut out = Outbox::new();
//! encoder.step(Local::ZERO, Input::PowerOn, &mut out);
//!
//! // Slave_Diag of master 2: the encoder waits for parameters.
//! let request = [0x68, 0x05, 0x05, 0x68, 0x86, 0x82, 0x6D, 0x3C, 0x3E, 0xEF, 0x16];
//! let now = Local::ZERO + Span::from_ms(1);
//! out.clear();
//! encoder.step(now, Input::Telegram(Heard { octets: &request, sample: 0 }), &mut out);
//!
//! let (send, frame) = out.sending().expect("an answer");
//! assert_eq!(send.at - now, BitRate::M12.span(Tbit(30)));
//! assert_eq!(frame.octets()[9..15], [0x02, 0x05, 0x00, 0xFF, 0x06, 0xDF]);
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
