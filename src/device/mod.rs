//! The slave's application: what makes an encoder out of a DP slave. Machines on the station's own clock alone.

pub mod controller;
pub mod drive;
pub mod encoder;
pub mod isochronous;
pub mod leds;
pub mod node;
pub mod options;
pub mod parameter_client;
pub mod parameters;
pub mod pll;
pub mod position;
pub mod profile;
pub mod sensor;
pub mod sign_of_life;
pub mod unit;
