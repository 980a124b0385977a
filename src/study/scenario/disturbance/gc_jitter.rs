//! Jitter of SYNCH as a disturbance: the shapes of `master.gc_jitter`, in a window.

use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::study::scenario::jitter;
use crate::study::scenario::section::yes;

const SHAPE: Key = Key {
    name: "shape",
    unit: "kind of gc_jitter",
    default: "-",
    what: "none, uniform, normal, bounded-normal, sine, step, drift or table",
};
const ACCUMULATE: Key =
    Key { name: "accumulate", unit: "true or false", default: "false", what: "strays add up as long as a burst lasts" };
const WIDTH: Key = Key { name: "half_width", unit: "time", default: "-", what: "uniform: largest stray" };
const SIGMA: Key =
    Key { name: "sigma", unit: "time", default: "-", what: "normal, bounded-normal: standard deviation" };
const BOUND: Key = Key { name: "bound", unit: "time", default: "-", what: "bounded-normal, drift: largest stray" };
const AMPLITUDE: Key = Key { name: "amplitude", unit: "time", default: "-", what: "sine: largest stray" };
const PERIOD: Key = Key { name: "period", unit: "time or cycles", default: "-", what: "sine: length of a period" };
const OFFSET: Key = Key { name: "offset", unit: "time", default: "-", what: "step: every stray" };
const PER_CYCLE: Key =
    Key { name: "per_cycle", unit: "time", default: "-", what: "drift: growth from clock to clock; or per_second" };
const PER_SECOND: Key = Key { name: "per_second", unit: "time", default: "-", what: "drift: growth in a second" };
const OFFSETS: Key =
    Key { name: "offsets", unit: "times", default: "-", what: "table: the strays one by one; or file" };
const FILE: Key = Key {
    name: "file",
    unit: "path",
    default: "-",
    what: "table: a CSV file beside the scenario with the column offset_ns",
};
const REPEAT: Key = Key {
    name: "repeat",
    unit: "true or false",
    default: "true",
    what: "table: begins again, or holds its last stray",
};

/// SYNCH strays.
pub(super) const GC_JITTER: DisturbanceKind = DisturbanceKind {
    name: "gc-jitter",
    what: "the master's SYNCH strays in a `shape`, besides its own gc_jitter; shapes count from a burst's first clock",
    keys: &[
        SHAPE, ACCUMULATE, WIDTH, SIGMA, BOUND, AMPLITUDE, PERIOD, OFFSET, PER_CYCLE, PER_SECOND, OFFSETS, FILE, REPEAT,
    ],
    example: r#"kind = "gc-jitter", shape = "sine", amplitude = "400 ns", period = "200 ms", at = "1 s""#,
    read: |section, reader| {
        let jitter = jitter::shape("shape", section, reader);
        let accumulates = section.optional(reader, "accumulate", yes).unwrap_or(false);
        jitter.map(|jitter| What::Clock(jitter, accumulates))
    },
};
