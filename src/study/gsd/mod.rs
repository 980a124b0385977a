//! GSD files: what a device's manufacturer tells configuration tools, in the text format of PROFIBUS DP.
//!
//! ```text
//! octets -> lex: lines of words -> file: statements -> device: what the model takes from them -> Profile
//!                                        |             prm: user parameters                    -> Set_Prm
//!                                        +-> crate gsd-parser
//! ```
//! Every language's file is the same but for its texts, so the ending of its name (.gsd, .gse, .gsg ...) does not matter.

mod device;
mod file;
mod keywords;
mod lex;
mod prm;
mod show;

use super::scenario::{self, Fault, Position, Problem};
use crate::device::profile::Device;
pub use device::{Finding, Weight};
use file::File;
use lex::At;
pub use prm::{Touched, UserPrm};
use std::path::Path;

/// A GSD file, read. Displays as a page that says what was understood, what was ignored and what does not fit.
#[derive(Clone, PartialEq, Debug)]
pub struct Gsd {
    /// Its name as it was given.
    name: String,
    file: File,
}

impl Gsd {
    /// Reads the file `path`.
    ///
    /// # Errors
    /// The file cannot be read, or [`Self::parse`] finds it broken.
    pub fn load(path: &Path) -> Result<Self, Box<Problem>> {
        let name = path.display().to_string();
        match scenario::read_file(path, "GSD file", "name one GSD file in it, such as *.gsd or *.gse") {
            Ok(octets) => Self::parse(&name, &octets),
            Err(fault) => Err(Box::new(Problem { source: name, position: None, key: String::new(), fault })),
        }
    }

    /// Reads the octets of a GSD file; messages call it `name`.
    ///
    /// # Errors
    /// The octets are no text, or a statement is not what the GSD specification makes of its keyword.
    pub fn parse(name: &str, octets: &[u8]) -> Result<Self, Box<Problem>> {
        let mut lines = Vec::new();
        let read = lex::decode(octets).and_then(|decoded| {
            lines = decoded;
            file::read(&lex::tokens(&lines)?)
        });
        match read {
            Ok(file) => Ok(Self { name: name.to_owned(), file }),
            Err(Wrong { at, fault }) => {
                let position = at.map(|At { line, column, width }| Position {
                    line,
                    column,
                    width,
                    text: lines.get(line - 1).cloned().unwrap_or_default(),
                });
                Err(Box::new(Problem { source: name.to_owned(), position, key: String::new(), fault }))
            }
        }
    }

    /// The names of its modules, in the order of the file.
    pub fn modules(&self) -> impl Iterator<Item = &str> + Clone {
        self.file.description.available_modules.iter().map(|module| module.name.trim())
    }
    /// What does not fit together in it.
    pub fn findings(&self) -> Vec<Finding> {
        device::findings(&self.file)
    }
    /// Whether the file contradicts itself or the GSD specification: one of [`Self::findings`] is an error.
    pub fn is_inconsistent(&self) -> bool {
        self.findings().iter().any(|finding| finding.weight == Weight::Error)
    }
    /// The device with the module called `module`. Without a name it is the only module, or the one with telegram 81.
    ///
    /// # Errors
    /// There is no such module or no such choice, or the model cannot simulate this device.
    pub fn device(&self, module: Option<&str>) -> Result<Device, Fault> {
        device::profile(&self.file, module).map(|profile| {
            let source = format!("{}; disc, gap and narrowest window Model: no GSD file says them", self.name);
            Device::from(crate::device::profile::Profile { source: source.into(), ..profile })
        })
    }
    /// The user parameters of the device with this module, as the GSD file presets them.
    ///
    /// # Errors
    /// There is no such module, or a preset value is not what its parameter can have.
    pub fn user_prm(&self, module: Option<&str>) -> Result<UserPrm, Fault> {
        let index = device::module(&self.file, module)?;
        UserPrm::of(&self.file, Some(&self.file.description.available_modules[index].module_prm_data))
    }
}

/// What is wrong with a file, and where.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Wrong {
    at: Option<At>,
    fault: Fault,
}

impl Wrong {
    fn at(at: At, message: impl Into<String>) -> Self {
        Self { at: Some(at), fault: Fault::new(message) }
    }
    fn in_line(line: usize, message: impl Into<String>) -> Self {
        Self::at(At { line, column: 1, width: 1 }, message)
    }
    fn of_file(message: impl Into<String>) -> Self {
        Self { at: None, fault: Fault::new(message) }
    }
    fn rule(self, rule: impl Into<String>) -> Self {
        Self { fault: self.fault.rule(rule), ..self }
    }
    fn help(self, help: impl Into<String>) -> Self {
        Self { fault: self.fault.help(help), ..self }
    }
}
