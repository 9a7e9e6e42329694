//! The plots of a report.

use super::accuracy::AccuracyRow;
use super::choices::Label;
use super::query::QueryRow;
use super::ray_set::Group;
use super::{File, Report, SubjectReport};
use crate::measure::plot::{Height, Mark, Panel, Point, Scatter, scatter};
use crate::measure::sweep::Rate;

/// All plots, in the order in which the document shows them.
pub fn all(report: &Report) -> Vec<File> {
    report
        .subjects
        .iter()
        .flat_map(|subject| Group::ALL.into_iter().flat_map(|group| of_group(subject, group)))
        .collect()
}

/// What a picture of a subject is called.
pub fn name(plane: &str, subject: &str, group: Group) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
    format!("{plane}-{}-{}.svg", subject.chars().map(plain).collect::<String>(), group.name())
}

fn of_group(subject: &SubjectReport, group: Group) -> Vec<File> {
    let mut files = Vec::new();
    let panels: Vec<Panel> = subject
        .ray_sets
        .iter()
        .filter(|set| set.group == group)
        .map(|set| {
            let rows = subject.query.iter().filter(|row| row.ray_kind == set.ray_kind);
            Panel {
                title: format!("{} ({} rays)", set.ray_kind, set.rays),
                points: rows.filter_map(query_point).collect(),
            }
        })
        .collect();
    if panels.iter().any(|panel| !panel.points.is_empty()) {
        let plot = Scatter {
            title: format!("{}: speed against wrong answers, {} rays", subject.name, group.name()),
            x_label: "million rays a second, one thread".into(),
            y_label: "misses and false hits in 1e9 rays".into(),
            panels,
            legend: legend(true),
        };
        files.push(File { name: name("query", &subject.name, group), text: scatter(&plot) });
    }
    let points: Vec<Point> =
        subject.accuracy.iter().filter(|row| row.group == group).filter_map(accuracy_point).collect();
    if !points.is_empty() {
        let plot = Scatter {
            title: format!("{}: time against the error of t, {} rays", subject.name, group.name()),
            x_label: "nanoseconds a ray, one thread".into(),
            y_label: "normalised error of t, 99.99 %".into(),
            panels: vec![Panel { title: "|t - exact| |d| |cos| / (u max(|o|, |v - o|))".into(), points }],
            legend: legend(false),
        };
        files.push(File { name: name("accuracy", &subject.name, group), text: scatter(&plot) });
    }
    files
}

fn legend(zeros: bool) -> Vec<(Mark, String)> {
    let mut legend = vec![
        (Mark::Circle, "plain tree, padded boxes".into()),
        (Mark::Square, "plain tree, plain boxes".into()),
        (Mark::Diamond, "the renderer's trees".into()),
    ];
    if zeros {
        legend.push((Mark::Hollow, "hollow: none wrong, the rate is below the mark (95 %)".into()));
    }
    legend
}

fn query_point(row: &QueryRow) -> Option<Point> {
    let speed = row.mrays_per_s?;
    let Rate { wrong, per_1e9, low, high, .. } = row.wrong();
    let y = if wrong == 0 { Height::Below(high) } else { Height::At(per_1e9, [low, high]) };
    Some(point(&row.label, [speed.value, speed.low, speed.high], y))
}

fn accuracy_point(row: &AccuracyRow) -> Option<Point> {
    let ns = row.ns_per_ray?;
    let error = row.t_normalized;
    Some(point(&row.label, [ns.value, ns.low, ns.high], Height::At(error.p99_99, [error.p99_99; 2])))
}

fn point(label: &Label, x: [f64; 3], y: Height) -> Point {
    let own = label.accelerator != "plain";
    let mark = match label.box_test {
        _ if own => Mark::Diamond,
        "plain" => Mark::Square,
        _ => Mark::Circle,
    };
    // In the order of the choices; the renderer's test is the first.
    const TESTS: [&str; 7] = [
        "Woop (ours)",
        "Woop 2013",
        "Möller-Trumbore",
        "Woop f64 edges",
        "Baldwin-Weber",
        "Möller-Trumbore f64",
        "Woop Kahan",
    ];
    let color = TESTS.iter().position(|test| *test == label.triangle_test).unwrap_or(TESTS.len());
    let text = match mark {
        Mark::Diamond => label.name.clone(),
        Mark::Square => format!("{}, plain", label.triangle_test),
        _ => label.triangle_test.to_owned(),
    };
    Point { label: text, x, y, color, mark }
}
