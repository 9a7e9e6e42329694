//! What was measured, as Markdown tables.

use std::fmt::Write as _;

use super::{Bench, ModelReport, Row};
use crate::measure::environment::Environment;
use crate::measure::table::Table;

impl Bench {
    /// All tables, for people.
    pub fn tables(&self) -> String {
        let mut text = self.heading();
        for model in &self.models {
            let rows: Vec<&Row> = self.rows.iter().filter(|row| row.model == model.model).collect();
            let ModelReport { model: name, triangles, reference, linear_rays } = model;
            let _ = writeln!(text, "\n## {name}: {triangles} triangles\n");
            let _ = writeln!(
                text,
                "The reference, {reference}, equals linear on {linear_rays} rays.\n\n{}",
                builds(&rows).trim_end()
            );
            for set in sets(&rows) {
                let first = set[0];
                let _ = write!(
                    text,
                    "\n### {}: {}, {} rays ({})\n\n{}",
                    model.model,
                    kind(first),
                    first.rays,
                    first.ray_set_hash,
                    speeds(&set)
                );
                for row in set.iter().filter(|row| !row.peer) {
                    if let Some(ray) = &row.first_differing {
                        let who = contender(row);
                        let _ = writeln!(text, "\nNot timed: {who} differs from the reference, first on {ray}");
                    }
                }
            }
        }
        text + &self.summary()
    }

    /// Rays a second of all contenders side by side, a table a number of threads.
    fn summary(&self) -> String {
        let mut text = String::new();
        let mut threads: Vec<usize> = self.rows.iter().map(|row| row.threads).collect();
        threads.sort_unstable();
        threads.dedup();
        for threads in threads {
            let timed = |row: &&Row| row.threads == threads && row.mrays_per_s.is_some();
            let rows: Vec<&Row> = self.rows.iter().filter(timed).collect();
            let mut names: Vec<String> = Vec::new();
            for name in rows.iter().map(|row| contender(row)) {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            let columns: Vec<String> = names.iter().map(|name| format!(">{name}")).collect();
            let headings = ["model", "rays"].into_iter().chain(columns.iter().map(String::as_str));
            let mut table = Table::new(&headings.collect::<Vec<_>>());
            for set in self.models.iter().flat_map(|model| {
                sets(&rows.iter().copied().filter(|row| row.model == model.model).collect::<Vec<_>>())
            }) {
                let cell = |name: &String| {
                    let row = set.iter().find(|row| contender(row) == *name)?;
                    let ratio = row.ratio_to_embree.map(|ratio| format!(" ({ratio:.2})")).unwrap_or_default();
                    Some(format!("{:.2}{ratio}", row.mrays_per_s?))
                };
                let cells = names.iter().map(|name| cell(name).unwrap_or_else(|| "-".into()));
                table.push([set[0].model.clone(), kind(set[0])].into_iter().chain(cells).collect());
            }
            if !table.is_empty() {
                let _ = write!(text, "\n## Million rays a second, threads: {threads} (times Embree)\n\n{table}");
            }
        }
        text
    }

    /// What it was measured on, and what has to be known.
    fn heading(&self) -> String {
        let Environment { version, commit, machine, cpu, processors, .. } = &self.environment;
        let commit = commit.as_ref().map(|commit| format!(" ({commit})")).unwrap_or_default();
        let mut text = format!(
            "whitted {version}{commit} on {cpu}, {processors} processors, {}; {} rounds\n",
            machine.cpu_features.join(" "),
            self.rounds
        );
        if machine.debug_assertions {
            text += "This build has debug assertions: its speed says nothing.\n";
        }
        for note in &self.notes {
            text += note;
            text.push('\n');
        }
        text
    }

    /// The document as JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("names and numbers have a JSON form") + "\n"
    }
}

/// Who answered, and how it was asked.
fn contender(row: &Row) -> String {
    format!("{} {} {}", row.accelerator, row.preset, row.calls.name()).replace(" - ", " ")
}

/// Where the rays come from and what they are.
fn kind(row: &Row) -> String {
    format!("{} {}", row.view.map_or("given", |view| view.name()), row.ray_kind)
}

/// The rows of a model, set by set.
pub fn sets<'a>(rows: &[&'a Row]) -> Vec<Vec<&'a Row>> {
    let mut sets: Vec<Vec<&Row>> = Vec::new();
    let same = |a: &Row, b: &Row| (a.view, &a.ray_kind, &a.ray_set_hash) == (b.view, &b.ray_kind, &b.ray_set_hash);
    for row in rows {
        match sets.iter_mut().find(|set| same(set[0], row)) {
            Some(set) => set.push(row),
            None => sets.push(vec![row]),
        }
    }
    sets
}

/// Seconds and bytes of every build.
fn builds(rows: &[&Row]) -> String {
    let mut table = Table::new(&["accelerator", "preset", ">threads", ">build s", ">bytes a triangle"]);
    let mut told = Vec::new();
    for row in rows {
        let build = (&row.accelerator, row.preset, row.threads);
        if told.contains(&build) {
            continue;
        }
        told.push(build);
        table.push(vec![
            row.accelerator.clone(),
            row.preset.into(),
            row.threads.to_string(),
            format!("{:.3}", row.build_s),
            format!("{:.1}", row.bytes_per_triangle),
        ]);
    }
    table.to_string()
}

/// Rays a second of every contender, and what they hit.
fn speeds(rows: &[&Row]) -> String {
    let headings = [
        "accelerator",
        "preset",
        "calls",
        ">threads",
        ">Mray/s",
        ">spread",
        ">x Embree",
        ">boxes a ray",
        ">triangles a ray",
        ">hits",
        "hit hash",
        ">differing",
        ">other triangle",
    ];
    let mut table = Table::new(&headings);
    for row in rows {
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".into());
        table.push(vec![
            row.accelerator.clone(),
            row.preset.into(),
            row.calls.name().into(),
            row.threads.to_string(),
            or_dash(row.mrays_per_s.map(|rate| format!("{rate:.2}"))),
            or_dash(row.spread.map(|spread| format!("{:.1} %", 100.0 * spread))),
            or_dash(row.ratio_to_embree.map(|ratio| format!("{ratio:.2}"))),
            or_dash(row.boxes_per_ray.map(|boxes| format!("{boxes:.1}"))),
            or_dash(row.triangles_per_ray.map(|triangles| format!("{triangles:.1}"))),
            row.hits.to_string(),
            row.hit_hash.clone(),
            row.differing.to_string(),
            or_dash(row.other_triangle.map(|count| count.to_string())),
        ]);
    }
    table.to_string()
}
