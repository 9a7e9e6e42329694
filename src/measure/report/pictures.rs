//! The plots of a report.

use super::accuracy::AccuracyRow;
use super::choices::Label;
use super::image::{ErrorKind, ImageRow};
use super::query::QueryRow;
use super::spheres::SphereRow;
use super::{File, Report, SubjectReport};
use crate::measure::plot::{Height, Mark, Panel, Point, Scatter, scatter};
use crate::measure::ray_set::Group;
use crate::measure::sweep::Rate;
use crate::measure::variants::BoxTest;
use crate::measure::variants::slab::Ize;
use crate::measure::variants::sphere::SphereTest;

/// The picture of quadrics.
pub const SPHERES: &str = "quadrics.svg";

/// All plots, in the order in which the document shows them.
pub fn all(report: &Report) -> Vec<File> {
    let mut files = Vec::new();
    for subject in &report.subjects {
        files.extend(Group::ALL.into_iter().flat_map(|group| of_group(subject, group)));
        files.extend(of_image(subject));
    }
    files.extend(of_spheres(&report.spheres));
    files
}

/// A name without what file systems or links do not like.
pub fn plain(name: &str) -> String {
    let allowed = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
    name.chars().map(allowed).collect()
}

/// What a picture of a subject is called.
pub fn name(plane: &str, subject: &str, group: Group) -> String {
    format!("{plane}-{}-{}.svg", plain(subject), group.name())
}

/// What the picture of a subject's image plane is called.
pub fn image_name(subject: &str) -> String {
    format!("image-{}.svg", plain(subject))
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

/// Time against sampling error; numeric errors beside it on the same axes.
fn of_image(subject: &SubjectReport) -> Option<File> {
    let point = |row: &ImageRow| {
        let seconds = row.seconds?;
        let (color, mark, what) = match row.error {
            ErrorKind::Sampling => (1, Mark::Circle, "samples"),
            ErrorKind::Numeric => (2, Mark::Square, "samples, numeric error"),
        };
        Some(Point {
            label: format!("{} {what}", row.samples),
            x: [seconds.value, seconds.low, seconds.high],
            y: Height::At(row.rmse, [row.rmse; 2]),
            color,
            mark,
        })
    };
    let points: Vec<Point> = subject.image.iter().filter_map(point).collect();
    let plot = Scatter {
        title: format!("{}: time of a picture against its error", subject.name),
        x_label: "seconds, all threads".into(),
        y_label: "RMSE of linear colours".into(),
        legend: vec![
            (Mark::Circle, "sampling: against many samples".into()),
            (Mark::Square, "numeric: against the same samples in f64".into()),
        ],
        panels: vec![Panel { title: "pictures 64 pixels wide".into(), points }],
    };
    let shown = !plot.panels[0].points.is_empty();
    shown.then(|| File { name: image_name(&subject.name), text: scatter(&plot) })
}

/// Time against wrong answers, a panel for each group of rays.
fn of_spheres(rows: &[SphereRow]) -> Option<File> {
    let point = |row: &SphereRow| {
        let ns = row.ns_per_ray?;
        let wrong = Rate::new(row.misses.wrong + row.false_hits.wrong, row.false_hits.total);
        let mark = if row.default { Mark::Diamond } else { Mark::Circle };
        let color = SphereTest::ALL.iter().position(|test| test.name() == row.name).map_or(0, |n| (n + 1) % 3);
        let label = format!("{} at {:.0e}", row.name, row.distance);
        Some(Point { label, x: [ns.value, ns.low, ns.high], y: height(&wrong), color, mark })
    };
    let panel = |group: Group| Panel {
        title: format!("{} rays", group.name()),
        points: rows.iter().filter(|row| row.group == group).filter_map(point).collect(),
    };
    let plot = Scatter {
        title: "Quadrics: time against wrong answers".into(),
        x_label: "nanoseconds a ray, one thread".into(),
        y_label: "misses and false hits in 1e9 rays".into(),
        panels: Group::ALL.map(panel).into(),
        legend: vec![
            (Mark::Circle, "f32".into()),
            (Mark::Diamond, "the renderer's, f64".into()),
            (Mark::Hollow, NONE_WRONG.into()),
        ],
    };
    let shown = plot.panels.iter().any(|panel| !panel.points.is_empty());
    shown.then(|| File { name: SPHERES.into(), text: scatter(&plot) })
}

const NONE_WRONG: &str = "hollow: none wrong, the rate is below the mark (95 %)";

/// Where a rate stands; at the upper end of its interval if nothing was wrong.
fn height(rate: &Rate) -> Height {
    if rate.wrong == 0 { Height::Below(rate.high) } else { Height::At(rate.per_1e9, [rate.low, rate.high]) }
}

fn legend(zeros: bool) -> Vec<(Mark, String)> {
    let mut legend = vec![
        (Mark::Circle, "plain tree, padded boxes".into()),
        (Mark::Square, "plain tree, plain boxes".into()),
        (Mark::Diamond, "the renderer's trees".into()),
    ];
    if zeros {
        legend.push((Mark::Hollow, NONE_WRONG.into()));
    }
    legend
}

fn query_point(row: &QueryRow) -> Option<Point> {
    let speed = row.mrays_per_s?;
    Some(point(&row.label, [speed.value, speed.low, speed.high], height(&row.wrong())))
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
    const TESTS: [&str; 8] = [
        "Woop (ours)",
        "Woop 2013",
        "Möller-Trumbore",
        "Woop f64 edges",
        "Baldwin-Weber",
        "Möller-Trumbore f64",
        "Woop Kahan",
        "Woop f32 edges",
    ];
    let color = TESTS.iter().position(|test| *test == label.triangle_test).unwrap_or(TESTS.len());
    let text = match mark {
        Mark::Diamond => label.name.clone(),
        Mark::Square => format!("{}, plain", label.triangle_test),
        _ if label.box_test == Ize::NAME => format!("{}, Ize", label.triangle_test),
        _ => label.triangle_test.to_owned(),
    };
    Point { label: text, x, y, color, mark }
}
