//! The process image of a slave: outputs that wait for Sync, inputs that Freeze holds.
//!
//! | Sync mode | input | outputs in force | Sync mode after |
//! |---|---|---|---|
//! | off | Data_Exchange | these | off |
//! | off | Sync | unchanged | on |
//! | off | Unsync, with Sync or without | unchanged | off |
//! | on | Data_Exchange | unchanged, these wait | on |
//! | on | Sync | those that wait | on |
//! | on | Unsync, with Sync or without | those that wait | off |
//! | any | Clear_Data, empty Data_Exchange | none, nothing waits | unchanged |
//!
//! | Freeze mode | input | inputs that are read | Freeze mode after |
//! |---|---|---|---|
//! | any | Freeze | those of this instant | on |
//! | any | Unfreeze, with Freeze or without | always fresh ones | off |
//!
//! Source: EN 50170-2. A command counts only for a slave whose parameters asked for it (Sync_Req, Freeze_Req). Model:
//! Clear acts at once in Sync mode too, since none of the sources says otherwise and outputs are cleared for safety; of
//! a Global_Control that says Clear_Data and Sync, Clear_Data comes last.

use crate::wire::control::GlobalControl;
use crate::wire::diag::DiagStatus;

/// Room for the octets of either direction: 244 at most, and more than any length that an octet names.
const ROOM: usize = 256;

/// Outputs and inputs between the line and the device.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools)] // What is asked for and what is there: all independent.
pub struct Image {
    /// Octets of a Data_Exchange.
    outputs: u8,
    inputs: u8,
    /// Outputs in force, zero while `valid` is false: none came yet, or they were cleared.
    in_force: [u8; ROOM],
    valid: bool,
    /// Outputs that the next Sync brings, if `waiting`.
    next: [u8; ROOM],
    waiting: bool,
    /// Sync_Req and Freeze_Req.
    may_sync: bool,
    may_freeze: bool,
    /// Sync_Mode and Freeze_Mode.
    modes: DiagStatus,
    held: [u8; ROOM],
}

impl Image {
    /// The image of a slave with so many octets in each direction (octets), at most 244; no commands are taken.
    pub const fn new(outputs: u8, inputs: u8) -> Self {
        Self {
            outputs,
            inputs,
            in_force: [0; ROOM],
            valid: false,
            next: [0; ROOM],
            waiting: false,
            may_sync: false,
            may_freeze: false,
            modes: DiagStatus(0),
            held: [0; ROOM],
        }
    }
    /// Forgets everything and takes Sync and Freeze from now on, or does not (Sync_Req, Freeze_Req).
    pub fn parameterise(&mut self, sync: bool, freeze: bool) {
        *self = Self { may_sync: sync, may_freeze: freeze, ..Self::new(self.outputs, self.inputs) };
    }
    /// Data exchange is over: outputs are cleared, both modes end.
    pub fn leave(&mut self) {
        self.parameterise(self.may_sync, self.may_freeze);
    }

    /// Outputs in force; none before the first ones and after Clear.
    pub fn outputs(&self) -> Option<&[u8]> {
        self.valid.then(|| self.octets())
    }
    /// As [`outputs`](Self::outputs), zero where there are none: what RD_Outp reads.
    pub fn octets(&self) -> &[u8] {
        &self.in_force[..self.outputs.into()]
    }
    /// The inputs that are held in Freeze mode.
    pub fn held(&self) -> Option<&[u8]> {
        self.modes.freeze_mode().then(|| &self.held[..self.inputs.into()])
    }
    /// Sync_Mode and Freeze_Mode of the diagnosis.
    pub const fn modes(&self) -> DiagStatus {
        self.modes
    }

    /// A Data_Exchange brought outputs. Tells whether they have the image's length; else nothing changes.
    pub fn exchange(&mut self, du: &[u8]) -> bool {
        if du.len() != usize::from(self.outputs) {
            return false;
        }
        let waiting = self.modes.sync_mode();
        let place = if waiting { &mut self.next } else { &mut self.in_force };
        match *du {
            // Telegram 81, with which nearly all come: no call for so few octets.
            [a, b, c, d] => place[..4].copy_from_slice(&[a, b, c, d]),
            _ => place[..du.len()].copy_from_slice(du),
        }
        self.waiting = waiting;
        self.valid |= !waiting;
        true
    }
    /// Clear_Data or an empty Data_Exchange. Tells whether outputs were in force.
    pub fn clear(&mut self) -> bool {
        self.in_force = [0; ROOM];
        self.waiting = false;
        core::mem::take(&mut self.valid)
    }
    /// A Global_Control for this slave; `inputs` writes those of this instant. Tells whether other outputs are in
    /// force now.
    pub fn control(&mut self, control: GlobalControl, inputs: impl FnOnce(&mut [u8])) -> bool {
        let mut changed = false;
        if let Some(sync) = control.sync_mode().filter(|_| self.may_sync) {
            changed = self.transfer();
            self.modes = self.modes.with(DiagStatus::SYNC_MODE, sync);
        }
        if let Some(freeze) = control.freeze_mode().filter(|_| self.may_freeze) {
            self.modes = self.modes.with(DiagStatus::FREEZE_MODE, freeze);
            if freeze {
                inputs(&mut self.held[..self.inputs.into()]);
            }
        }
        if control.clear { self.clear() } else { changed }
    }
    /// What waits takes effect.
    fn transfer(&mut self) -> bool {
        if self.waiting {
            self.in_force = self.next;
            self.valid = true;
        }
        core::mem::take(&mut self.waiting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPERATE: GlobalControl = GlobalControl::OPERATE;
    const SYNC: GlobalControl = GlobalControl { sync: true, ..OPERATE };
    const UNSYNC: GlobalControl = GlobalControl { unsync: true, ..OPERATE };
    const FREEZE: GlobalControl = GlobalControl { freeze: true, ..OPERATE };
    const UNFREEZE: GlobalControl = GlobalControl { unfreeze: true, ..OPERATE };

    #[derive(Clone, Copy, Debug)]
    enum Input {
        Exchange(u8),
        Control(GlobalControl),
    }
    use Input::{Control, Exchange};

    /// An image that took outputs 1 and, in Sync mode, holds 2 back.
    fn image(sync: bool) -> Image {
        let mut image = Image::new(1, 1);
        image.parameterise(true, true);
        assert!(image.exchange(&[1]));
        if sync {
            image.control(SYNC, |_| unreachable!());
            assert!(image.exchange(&[2]));
        }
        image
    }

    /// The first table of the file header, row by row, and whether the device is told.
    #[test]
    fn outputs_in_sync_mode_and_out_of_it() {
        let both = GlobalControl { sync: true, ..UNSYNC };
        let clear = GlobalControl::CLEAR;
        let table = [
            (false, Exchange(9), Some(9), false, false),
            (false, Control(SYNC), Some(1), true, false),
            (false, Control(UNSYNC), Some(1), false, false),
            (false, Control(both), Some(1), false, false),
            (false, Control(clear), None, false, true),
            (true, Exchange(9), Some(1), true, false),
            (true, Control(SYNC), Some(2), true, true),
            (true, Control(UNSYNC), Some(2), false, true),
            (true, Control(both), Some(2), false, true),
            (true, Control(clear), None, true, true),
            (true, Control(GlobalControl { sync: true, ..clear }), None, true, true),
            (true, Control(OPERATE), Some(1), true, false),
            (true, Control(FREEZE), Some(1), true, false),
        ];
        for (before, input, outputs, after, told) in table {
            let mut image = image(before);
            let changed = match input {
                Exchange(octet) => {
                    assert!(image.exchange(&[octet]));
                    false
                }
                Control(control) => image.control(control, |_| ()),
            };
            let now = image.outputs().map(|octets| octets[0]);
            assert_eq!((now, image.modes().sync_mode(), changed), (outputs, after, told), "{before} {input:?}");
            assert_eq!(image.octets(), [outputs.unwrap_or(0)]);
        }
    }

    #[test]
    fn after_clear_in_sync_mode_outputs_wait_for_a_sync_again() {
        let mut image = image(true);
        assert!(image.clear() && !image.clear(), "the second time nothing was in force");
        assert!(!image.control(SYNC, |_| ()), "nothing waits");
        assert!(!image.exchange(&[]) && !image.exchange(&[3, 3]), "another length than the image's");
        assert!(!image.control(SYNC, |_| ()), "nothing waits still");
        assert!(image.exchange(&[3]));
        assert_eq!(image.outputs(), None);
        assert!(image.control(SYNC, |_| ()));
        assert_eq!(image.outputs(), Some(&[3][..]));
    }

    /// The second table of the file header.
    #[test]
    fn inputs_in_freeze_mode_and_out_of_it() {
        for before in [false, true] {
            let table = [
                (FREEZE, Some(7)),
                (UNFREEZE, None),
                (GlobalControl { freeze: true, ..UNFREEZE }, None),
                (SYNC, before.then_some(5)),
                (OPERATE, before.then_some(5)),
                (GlobalControl { clear: true, ..FREEZE }, Some(7)),
            ];
            for (control, held) in table {
                let mut image = image(false);
                if before {
                    image.control(FREEZE, |inputs| inputs[0] = 5);
                }
                image.control(control, |inputs| inputs[0] = 7);
                assert_eq!(image.held().map(|octets| octets[0]), held, "{before} {control:?}");
                assert_eq!(image.modes().freeze_mode(), held.is_some());
            }
        }
    }

    #[test]
    fn commands_that_the_parameters_did_not_ask_for_do_nothing() {
        for (sync, freeze) in [(false, false), (true, false), (false, true)] {
            let mut image = Image::new(1, 1);
            image.parameterise(sync, freeze);
            image.control(GlobalControl { freeze: true, ..SYNC }, |_| ());
            assert_eq!((image.modes().sync_mode(), image.modes().freeze_mode()), (sync, freeze));
            image.leave();
            assert_eq!((image.modes(), image.held()), (DiagStatus::default(), None));
            image.control(SYNC, |_| ());
            assert_eq!(image.modes().sync_mode(), sync, "data exchange anew, the same parameters");
        }
    }
}
