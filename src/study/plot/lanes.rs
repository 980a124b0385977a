//! Lanes: one level strip per slave, lower the more there are.

use super::look::{Area, Canvas, FAINT, Font, fit};

/// Lanes below each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes {
    top: i32,
    each: i32,
    left: i32,
    right: i32,
}

impl Lanes {
    /// Width of the names in front of the lanes [px].
    pub(super) const NAMES: i32 = 120;

    /// Height of one of `count` lanes [px]: a name can always be read.
    pub(super) fn each(count: usize) -> i32 {
        (560 / count.max(1) as i32).clamp(10, 36)
    }
    /// Lanes from `left` to `right`, the first one at `top`.
    pub(super) fn new(count: usize, top: i32, left: i32, right: i32) -> Self {
        Self { top, each: Self::each(count), left, right }
    }
    /// Lane number `index`, without the gap to the next.
    pub(super) const fn lane(&self, index: usize) -> Area {
        let top = self.top + index as i32 * self.each;
        Area { left: self.left, top, right: self.right, bottom: top + self.each - if self.each > 14 { 4 } else { 1 } }
    }
    /// Size of the letters that fit [px].
    pub(super) fn letters(&self) -> i32 {
        (self.each - 1).min(12)
    }
    /// Draws the empty lane.
    pub(super) fn ground(&self, canvas: &mut Canvas<'_>, index: usize) {
        canvas.fill(self.lane(index), FAINT);
    }
    /// Draws the name of a lane to the left of `x`.
    pub(super) fn name(&self, canvas: &mut Canvas<'_>, index: usize, x: i32, name: &str) {
        let size = self.letters();
        let name = fit(name, size, Self::NAMES - 8);
        canvas.text((x - 8, self.lane(index).centre().1), &name, Font::new(size).right());
    }
}
