//! The report as a Markdown page.

use std::fmt::Write as _;

use super::accuracy::{AccuracyRow, Spread};
use super::image::{CONVERGED_SAMPLES, ErrorKind};
use super::own_scenes;
use super::pictures::{image_name, name};
use super::query::QueryRow;
use super::spawn::SpawnRow;
use super::{File, Report, SubjectReport};
use crate::measure::environment::Environment;
use crate::measure::ray_set::{Group, Question};
use crate::measure::statistics::{Median, rate_bound};
use crate::measure::table::Table;

/// The whole page; `pictures` are the files that it may show.
pub fn markdown(report: &Report, pictures: &[File]) -> String {
    let mut page = String::from("# Speed against error\n\n");
    if !report.complete {
        page += "**Not complete: parts are missing.**\n\n";
    }
    page += "Each choice of triangle test, box test and tree, its speed beside its error; dominated choices stay. \
             The manual's page on reports says how to read this and what was not modelled.\n\n";
    page += &measured_on(report);
    for subject in &report.subjects {
        let _ = writeln!(page, "\n## {}\n", subject.name);
        page += &of_subject(report, subject, pictures);
    }
    page += &own_scenes::spheres(report, pictures);
    page += &own_scenes::light_paths(&report.light_paths);
    page += &own_scenes::features(&report.features);
    page
}

fn measured_on(report: &Report) -> String {
    let Environment { version, commit, rustflags, machine, cpu, processors, seed, .. } = &report.environment;
    let mut table = Table::new(&["measured on", ""]);
    let mut row = |what: &str, value: String| table.push(vec![what.into(), value]);
    let build = if !machine.debug_assertions { "optimised" } else { "**not optimised: speeds say nothing**" };
    row("program", format!("whitted {version}, {build}"));
    row("checkout around it when it was run", commit.as_deref().unwrap_or("none").into());
    row("RUSTFLAGS when it was compiled", rustflags.map_or("not set".into(), |flags| format!("`{flags}`")));
    row("compiled for", format!("{}; {}", machine.target, machine.compiled_features.join(", ")));
    row("processor", format!("{cpu} ({processors} processors); has {}", machine.cpu_features.join(", ")));
    let flushed = |on: bool| if on { "on" } else { "off" };
    let zero = (report.environment.flush_to_zero, report.environment.denormals_are_zero);
    row(
        "flush to zero, denormals are zero",
        format!("{}, {}; no fused multiply-add", flushed(zero.0), flushed(zero.1)),
    );
    row("threads", format!("1 for the speed of rays, {} for exact answers and pictures", machine.threads));
    row("seed", format!("{seed:#x}"));
    row("rays of each kind", format!("{} judged, the first {} timed", report.rays, report.rays_timed));
    row(
        "repetitions",
        format!("{} interleaved forward and backward; median and 95 % bootstrap interval", report.repetitions),
    );
    row("rates", "in 1e9 rays, with the 95 % interval of Clopper and Pearson; one-sided where none was wrong".into());
    table.to_string()
}

fn of_subject(report: &Report, subject: &SubjectReport, pictures: &[File]) -> String {
    let mut text = format!("{} triangles.", subject.triangles);
    if subject.quadrics_left_out > 0 {
        let _ = write!(text, " {} quadrics are left out of these rays.", subject.quadrics_left_out);
    }
    text += "\n\n";
    text += &conclusion(subject);
    if subject.query.is_empty() {
        text += &spawn_section(report, &subject.spawn);
        text += &image_section(subject, pictures);
        return text;
    }
    text += "\n### What was compared\n\n";
    text += &choices_table(subject).to_string();
    text += "\n### Rays\n\n";
    let mut sets = Table::new(&["rays", "group", "question", ">count", ">exact hits", "hash"]);
    for set in &subject.ray_sets {
        sets.push(vec![
            set.ray_kind.clone(),
            set.group.name().into(),
            question(set.question).into(),
            set.rays.to_string(),
            set.exact_hits.to_string(),
            set.ray_set_hash.clone(),
        ]);
    }
    text += &sets.to_string();
    for group in Group::ALL {
        let sets = subject.ray_sets.iter().filter(|set| set.group == group);
        if sets.clone().next().is_none() {
            continue;
        }
        let _ = writeln!(text, "\n### Query plane, {} rays\n", group.name());
        text += &picture(&name("query", &subject.name, group), pictures);
        for set in sets {
            let rows: Vec<&QueryRow> = subject.query.iter().filter(|row| row.ray_kind == set.ray_kind).collect();
            let _ = writeln!(text, "\n**{}** ({})\n", set.ray_kind, question(set.question));
            if rows.is_empty() {
                text += "No such rays could be made.\n";
                continue;
            }
            text += &query_table(&rows).to_string();
        }
        let rows: Vec<&AccuracyRow> = subject.accuracy.iter().filter(|row| row.group == group).collect();
        if !rows.is_empty() {
            let _ = writeln!(text, "\n### Accuracy plane, {} rays\n", group.name());
            text += &picture(&name("accuracy", &subject.name, group), pictures);
            text += "\nErrors are 50 % / 99 % / 99.99 % quantiles and the maximum, of hits on the exact triangle. Choices hit different \
                     ones: where one is wrong or missed, it has no error here.\n\n";
            text += &accuracy_table(&rows).to_string();
        }
    }
    text += &spawn_section(report, &subject.spawn);
    text += &image_section(subject, pictures);
    text
}

/// What the numbers say, in sentences that are made of them alone.
fn conclusion(subject: &SubjectReport) -> String {
    let mut text = String::new();
    let default: Vec<&QueryRow> = subject.query.iter().filter(|row| row.label.default).collect();
    let (wrong, total) = default.iter().fold((0, 0), |(wrong, total), row| {
        let rate = row.wrong();
        (wrong + rate.wrong, total + rate.total)
    });
    if let Some(first) = default.first() {
        let front = default.iter().filter(|row| !row.dominated).count();
        let _ = writeln!(
            text,
            "The default, {}, got {wrong} of {total} rays wrong (at 95 % below {:.1e} in 1e9) and is not dominated on \
             {front} of {} kinds of rays.",
            first.label.name,
            rate_bound(wrong, total) * 1e9,
            default.len()
        );
    }
    for set in &subject.ray_sets {
        let rows = subject.query.iter().filter(|row| row.ray_kind == set.ray_kind && row.mrays_per_s.is_some());
        let mut front: Vec<&QueryRow> = rows.filter(|row| !row.dominated).collect();
        if front.is_empty() {
            continue;
        }
        let speed = |row: &QueryRow| row.mrays_per_s.map_or(0.0, |speed| speed.value);
        front.sort_by(|a, b| speed(b).total_cmp(&speed(a)));
        let entries: Vec<String> = front
            .iter()
            .map(|row| format!("{} ({:.2} Mray/s, {} wrong)", row.label.name, speed(row), row.wrong().wrong))
            .collect();
        let _ = writeln!(text, "- Not dominated on {} rays: {}.", set.ray_kind, entries.join("; "));
    }
    text
}

fn choices_table(subject: &SubjectReport) -> Table {
    let mut table = Table::new(&["choice", "triangle test", "box test", "tree", ">build s", ">bytes a triangle"]);
    let first = subject.query.first().map(|row| row.ray_kind.as_str());
    for row in subject.query.iter().filter(|row| Some(row.ray_kind.as_str()) == first) {
        let label = &row.label;
        let mark = if label.default { " (default)" } else { "" };
        table.push(vec![
            format!("{}{mark}", label.name),
            label.triangle_test.into(),
            label.box_test.into(),
            label.accelerator.into(),
            format!("{:.3}", label.build_s),
            format!("{:.1}", label.bytes_per_triangle),
        ]);
    }
    table
}

fn query_table(rows: &[&QueryRow]) -> Table {
    let headings =
        ["choice", ">Mray/s", ">misses in 1e9", ">false hits in 1e9", ">borderline", ">hits", "hit hash", "dominated"];
    let mut table = Table::new(&headings);
    for row in rows {
        table.push(vec![
            row.label.name.clone(),
            row.mrays_per_s.map_or("not timed".into(), interval),
            row.misses.to_string(),
            row.false_hits.to_string(),
            row.borderline.to_string(),
            row.hits.to_string(),
            row.hit_hash.clone(),
            yes_or_no(row.dominated),
        ]);
    }
    table
}

fn accuracy_table(rows: &[&AccuracyRow]) -> Table {
    let headings = [
        "choice",
        ">ns a ray",
        ">hits",
        ">error of t, ulp",
        ">error of t, normalised",
        ">barycentrics",
        ">normal, radians",
        "dominated",
    ];
    let mut table = Table::new(&headings);
    for row in rows {
        table.push(vec![
            row.label.name.clone(),
            row.ns_per_ray.map_or("not timed".into(), interval),
            row.hits.to_string(),
            spread(&row.t_ulp),
            spread(&row.t_normalized),
            spread(&row.barycentric),
            spread(&row.normal_angle),
            yes_or_no(row.dominated),
        ]);
    }
    table
}

fn spawn_section(report: &Report, rows: &[SpawnRow]) -> String {
    let Report { rays, rays_timed, .. } = report;
    let headings = [
        "place",
        "start",
        ">ns a start",
        ">self-hits in 1e9",
        ">starts below the surface in 1e9",
        ">mean clearance, ulp",
        "dominated",
    ];
    let mut table = Table::new(&headings);
    for row in rows {
        table.push(vec![
            row.place.into(),
            row.name.into(),
            row.ns_per_start.map_or("not timed".into(), interval),
            row.self_hits.to_string(),
            row.below.to_string(),
            short(row.mean_clearance_ulp),
            yes_or_no(row.dominated),
        ]);
    }
    if table.is_empty() {
        return String::new();
    }
    format!(
        "\n### Rays that leave a surface\n\nFrom random points of triangles, away from them in random directions: a hit on \
         the same triangle is wrong. Up to {rays} at a place, the first {rays_timed} of them timed. The renderer's start comes with all that shading needs of the point; the others' \
         times are of the start alone.\n\n{table}"
    )
}

fn image_section(subject: &SubjectReport, pictures: &[File]) -> String {
    let mut text = String::new();
    for (kind, heading, what) in [
        (
            ErrorKind::Numeric,
            "Image plane, numeric error",
            "Against the same samples in f64 with exact hits: what f32 changes.".to_owned(),
        ),
        (
            ErrorKind::Sampling,
            "Image plane, sampling error",
            format!("Against {CONVERGED_SAMPLES} samples a pixel in f32: what too few samples change."),
        ),
    ] {
        let headings =
            ["samples", ">seconds", ">RMSE", ">largest error", ">wrong pixels", ">pixels", ">seconds of the reference"];
        let mut table = Table::new(&headings);
        for row in subject.image.iter().filter(|row| row.error == kind) {
            table.push(vec![
                row.samples.to_string(),
                row.seconds.map_or("not timed".into(), |s| interval(s.times(1e3)) + " ms"),
                short(row.rmse),
                short(row.max),
                row.wrong_pixels.to_string(),
                row.pixels.to_string(),
                format!("{:.3}", row.reference_seconds),
            ]);
        }
        if !table.is_empty() {
            let _ = writeln!(text, "\n### {heading}\n\n{what} Colours are linear; a pixel is wrong from 1/255 on.\n");
            if kind == ErrorKind::Sampling {
                text += &picture(&image_name(&subject.name), pictures);
                text.push('\n');
            }
            text += &table.to_string();
        }
    }
    text
}

fn yes_or_no(dominated: bool) -> String {
    if dominated { "yes" } else { "**no**" }.into()
}

pub(super) fn interval(speed: Median) -> String {
    // Three digits at least; the ends with the same number of decimals.
    let decimals = if speed.value >= 100.0 {
        0
    } else if speed.value >= 10.0 {
        1
    } else {
        2
    };
    let Median { value, low, high } = speed;
    format!("{value:.decimals$} ({low:.decimals$} to {high:.decimals$})")
}

/// Two decimals, or two digits with a power of ten.
pub(super) fn short(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.01..1000.0).contains(&x.abs()) {
        format!("{x:.2}")
    } else {
        format!("{x:.1e}")
    }
}

pub(super) fn spread(errors: &Spread) -> String {
    [errors.p50, errors.p99, errors.p99_99, errors.max].map(short).join(" / ")
}

fn question(question: Question) -> &'static str {
    match question {
        Question::Closest => "closest hit",
        Question::Occluded => "any hit",
    }
}

pub(super) fn picture(name: &str, pictures: &[File]) -> String {
    let exists = pictures.iter().any(|file| file.name == name);
    if exists { format!("![{name}]({name})\n") } else { String::new() }
}
