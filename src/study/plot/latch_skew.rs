//! Latch skew: how far apart the slaves latch in one cycle, as a histogram over all cycles (Model: D9).

use super::Material;
use super::chart::{Axis, Chart};
use super::distribution::Grid;
use super::look::{Area, BLUE, Key, Swatch, VERMILION, Words, counted, empty_page, legend, page};

const COLUMNS: usize = 120;

/// Draws `latch_skew.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let skew = &material.distributions.latch_skew;
    let mut words = Words {
        title: "Latch skew: largest minus smallest latch instant of the locked encoders in one cycle",
        subtitle: format!(
            "{} with at least two locked encoders; {} slaves in all. Height: cycles per column, logarithmic.",
            counted(skew.count, "cycle"),
            counted(material.meta.slaves.len() as u64, "slave")
        ),
        plotted: "latch skew per cycle, histogram",
    };
    let Some(grid) = Grid::over(std::iter::once(skew), COLUMNS) else {
        "histogram over all cycles.".clone_into(&mut words.subtitle);
        let why = "No latch skew was recorded: in no cycle were two slaves locked to the clock at once.";
        return empty_page(material.meta, &words, why);
    };
    page(material.meta, &words, 560, |canvas, mut area| {
        let keys = [
            Key::new("cycles per column", BLUE, Swatch::Fill),
            Key::new("percentiles and maximum", VERMILION, Swatch::Dashes),
        ];
        legend(canvas, &mut area, &keys);
        // From zero, so that the skew is seen for what it is.
        let fitting = Axis::over(format!("latch skew [{}]", skew.unit), &grid);
        let x = Axis { lo: fitting.lo.min(-0.02 * fitting.hi), ..fitting };
        let counts = skew.columns(&grid);
        let most = counts.iter().copied().fold(0.0, f64::max);
        let outer = Area { top: area.top + 44, ..area };
        let chart = Chart::draw(canvas, outer, x, Axis::counts("cycles (logarithmic)", most));
        let base = chart.y(0.0);
        for (index, &count) in counts.iter().enumerate().filter(|column| *column.1 > 0.0) {
            let (left, right) = (chart.x(grid.left(index)), chart.x(grid.left(index + 1)));
            canvas.fill(Area { left, top: chart.y(count).min(base - 1), right, bottom: base }, BLUE);
        }
        chart.marks_above(canvas, skew, VERMILION);
    })
}
