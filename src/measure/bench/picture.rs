//! What was measured, at a glance: rays a second against seconds to build.

use super::contender::Calls;
use super::document::sets;
use super::{Bench, Row};
use crate::measure::plot::{Height, Mark, Panel, Point, Scatter, scatter};

impl Bench {
    /// The picture as SVG: a panel a set of rays.
    pub fn picture(&self) -> String {
        let several_threads = self.rows.iter().any(|row| row.threads != self.rows[0].threads);
        let mut names: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !names.contains(&row.accelerator.as_str()) {
                names.push(&row.accelerator);
            }
        }
        let point = |row: &&Row| {
            let rate = row.mrays_per_s?;
            let half = 0.5 * rate * row.spread.unwrap_or(0.0);
            let preset = if row.peer || row.preset == "-" { String::new() } else { format!(" {}", row.preset) };
            let threads = if several_threads { format!(" x{}", row.threads) } else { String::new() };
            let seconds = row.build_s;
            Some(Point {
                label: format!("{}{preset}{threads}", row.accelerator),
                x: [rate, rate - half, rate + half],
                y: Height::At(seconds, [seconds; 2]),
                color: names.iter().position(|name| *name == row.accelerator).unwrap_or(0),
                mark: if row.calls == Calls::Single { Mark::Circle } else { Mark::Square },
            })
        };
        let mut panels = Vec::new();
        for model in &self.models {
            let rows: Vec<&Row> = self.rows.iter().filter(|row| row.model == model.model).collect();
            panels.extend(sets(&rows).into_iter().map(|set| {
                let view = set[0].view.map_or(String::new(), |view| format!("{} ", view.name()));
                let title = format!("{}: {view}{} ({} rays)", model.model, set[0].ray_kind, set[0].rays);
                Panel { title, points: set.iter().filter_map(point).collect() }
            }));
        }
        scatter(&Scatter {
            title: "Rays a second against seconds to build".into(),
            x_label: "million rays a second".into(),
            y_label: "build, seconds".into(),
            panels,
            legend: vec![(Mark::Circle, "one call a ray".into()), (Mark::Square, "batches or packets".into())],
        })
    }
}
