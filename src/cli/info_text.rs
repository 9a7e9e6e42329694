//! What `whitted info` tells a person: one aligned table, a paragraph a subject.

use std::collections::BTreeMap;

use super::doctor::Diagnosis;
use super::estimate::Estimate;
use super::info::{Info, PerTriangle, Tree};
use super::ledger;
use super::terminal::printable;
use crate::job::estimate::Shared;

/// Width of the column of names.
const LABEL: usize = 22;

/// Names of groups that are printed; files may have one for each face.
const MOST_GROUPS: usize = 40;

/// The whole text.
pub fn of(info: &Info<'_>) -> String {
    let mut table = Table(String::new());
    table.row("input", info.input.display());
    contents(&mut table, info);
    place(&mut table, info);
    needs(&mut table, info);
    memory(&mut table, info);
    if let Some(tree) = &info.tree {
        tree_rows(&mut table, tree);
    }
    if let Some(estimate) = &info.estimate {
        estimate_rows(&mut table, estimate);
    }
    if let Some(doctor) = &info.doctor {
        doctor_rows(&mut table, doctor);
    }
    if !info.ledger.is_empty() {
        table.heading("read");
        for entry in &info.ledger {
            table.line(&format!("  {}", ledger::line(entry.treatment, &entry.feature, entry.count, Some(entry.reach))));
        }
    }
    table.0
}

fn contents(table: &mut Table, info: &Info<'_>) {
    table.heading("contents");
    let triangles = &info.triangles;
    if triangles.instanced == triangles.unique {
        table.row("triangles", triangles.unique);
    } else {
        table.row("triangles", format!("{}, {} with every instance", triangles.unique, triangles.instanced));
    }
    let dropped = triangles.dropped;
    for (reason, count) in [
        ("without area", dropped.zero_area),
        ("not finite or too large", dropped.non_finite),
        ("with a missing vertex", dropped.bad_index),
    ] {
        if count > 0 {
            table.row("  dropped", format!("{count} {reason}"));
        }
    }
    table.row("meshes", info.meshes);
    if !info.groups.is_empty() {
        let names: Vec<String> = info.groups.iter().take(MOST_GROUPS).map(|group| group.name.clone()).collect();
        table.list_of("groups", info.groups.len(), &names);
    }
    table.row("quadrics", info.quadrics);
    table.row("instances", info.instances);
    table.list("materials", &info.materials);
    let textures = info.textures.iter().map(|t| format!("{} ({}x{})", t.name, t.width, t.height));
    table.list("textures", &textures.collect::<Vec<_>>());
    let lights = info.lights.iter().map(|light| format!("{} ({})", light.name, light.kind));
    table.list("lights", &lights.collect::<Vec<_>>());
    let active = |name: &String| Some(name) == info.active_camera.as_ref();
    let cameras = info.cameras.iter().map(|name| if active(name) { format!("{name} (used)") } else { name.clone() });
    table.list("cameras", &cameras.collect::<Vec<_>>());
}

fn place(table: &mut Table, info: &Info<'_>) {
    table.heading("place");
    match &info.bounds {
        Some(bounds) => {
            table.row("least corner", point(bounds.min));
            table.row("greatest corner", point(bounds.max));
            let size = std::array::from_fn(|axis| bounds.max[axis] - bounds.min[axis]);
            table.row("size", point(size));
        }
        None => table.row("size", "nothing that has an end"),
    }
    table.row("scene origin", point(info.origin));
    if let Some(rounding) = &info.rounding {
        let size = |x: f64| if x == 0.0 { "none".into() } else { format!("{x:.3e}") };
        table.row("coordinate loss", size(rounding.coordinate_loss));
        table.row("finest edge", size(rounding.finest_edge.unwrap_or(0.0)));
    }
    let film = &info.film;
    table.row("picture", format!("{}x{}, {} samples a pixel", film.width, film.height, film.samples));
}

fn needs(table: &mut Table, info: &Info<'_>) {
    table.heading("needs");
    let needs = serde_json::to_value(info.needs).expect("counts have a JSON form");
    for (name, value) in needs.as_object().into_iter().flatten() {
        let label = name.replace('_', " ");
        match value {
            serde_json::Value::Bool(true) => table.row(&label, "yes"),
            serde_json::Value::Number(count) if count.as_u64() != Some(0) => table.row(&label, count),
            _ => {}
        }
    }
}

fn memory(table: &mut Table, info: &Info<'_>) {
    table.heading("memory");
    let share = |part: fn(&PerTriangle) -> f64| info.bytes_per_triangle.as_ref().map(part);
    for (part, bytes, share) in [
        ("positions", info.bytes.positions, share(|p| p.positions)),
        ("indices", info.bytes.indices, share(|p| p.indices)),
        ("normals", info.bytes.normals, share(|p| p.normals)),
        ("texture coordinates", info.bytes.uvs, share(|p| p.uvs)),
        ("material numbers", info.bytes.materials, share(|p| p.materials)),
        ("textures", info.bytes.textures, None),
    ] {
        if bytes > 0 {
            table.bytes(part, bytes, share);
        }
    }
}

fn estimate_rows(table: &mut Table, estimate: &Estimate) {
    table.heading("estimate");
    let Estimate { load, build, render, write, seconds, tiles, tried, tried_samples, threads, .. } = estimate;
    let told = if estimate.measured { "" } else { ", by what arrays take" };
    table.row("memory at most", format!("{}{told}", readable(estimate.peak_bytes)));
    table.row("time", format!("{seconds:.1} s on {threads} threads"));
    table.row("  reading", format!("{load:.2} s, as it took"));
    table.row("  building", format!("{build:.2} s, as it took"));
    table.row("  rendering", format!("{render:.2} s, by {tried} of {tiles} tiles at {tried_samples} samples a pixel"));
    table.row("  writing", format!("{write:.2} s"));
    if let (Some(shared), Some(worthwhile)) = (&estimate.shared, estimate.worthwhile) {
        let Shared { machines, cores, seconds, longest, imbalance } = shared;
        table.row("machines", format!("{machines} with {cores} processors each: {seconds:.1} s"));
        table.row("  the longest part", format!("{longest:.2} s of rendering, {imbalance:.3} of the mean"));
        let saving = "from there on twice as many save less than a twentieth";
        table.row("  worthwhile", format!("{worthwhile}: {saving}"));
    }
}

fn tree_rows(table: &mut Table, tree: &Tree) {
    table.heading("tree");
    let stats = &tree.stats;
    table.row("accelerator", &stats.accelerator);
    table.row("built in", format!("{:.3} s", stats.seconds));
    table.row("nodes", format!("{}, {}", stats.nodes, readable(stats.node_bytes)));
    table.row("leaves", format!("{}, {}", stats.leaves, readable(stats.leaf_bytes)));
    table.row("top level", readable(stats.top_level_bytes));
    table.row("greatest depth", stats.max_depth);
    if let Some(share) = tree.bytes_per_triangle {
        table.row("bytes a triangle", format!("{share:.1}"));
    }
    if tree.validated {
        table.row("checked", "sound");
    }
}

/// Flaws of the meshes, each with its first places.
fn doctor_rows(table: &mut Table, doctor: &Diagnosis) {
    table.heading("meshes");
    table.row("examined in", format!("{:.3} s", doctor.seconds));
    if let Some(size) = &doctor.size {
        table.row("size", size);
    }
    if doctor.scaled_meshes > 0 {
        table.row("beyond 2^-40 to 2^40", format!("{}, stored divided by a power of two", doctor.scaled_meshes));
    }
    for flaw in &doctor.flaws {
        table.line(&format!("  {}: {}", flaw.flaw.words(), flaw.count));
        for place in &flaw.places {
            table.line(&format!("    {}", place.text()));
        }
    }
    if doctor.flaws.is_empty() {
        table.row("flaws", "none");
    }
}

/// Lines with a column of names.
struct Table(String);

impl Table {
    fn heading(&mut self, name: &str) {
        self.0.push('\n');
        self.line(name);
    }

    fn line(&mut self, text: &str) {
        self.0.push_str(&printable(text));
        self.0.push('\n');
    }

    fn row(&mut self, label: &str, value: impl std::fmt::Display) {
        self.line(&format!("  {label:LABEL$} {value}"));
    }

    /// A number of things, and one name a line below it; a name that several have comes once.
    fn list(&mut self, label: &str, names: &[String]) {
        self.list_of(label, names.len(), names);
    }

    /// The same of the first of so many.
    fn list_of(&mut self, label: &str, count: usize, names: &[String]) {
        self.row(label, count);
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for name in names {
            *counts.entry(name).or_default() += 1;
        }
        for name in names {
            match counts.remove(name.as_str()) {
                Some(1) => self.line(&format!("  {:LABEL$}   {name}", "")),
                Some(count) => self.line(&format!("  {:LABEL$}   {name} ({count} of them)", "")),
                None => {}
            }
        }
        if names.len() < count {
            self.line(&format!("  {:LABEL$}   and {} more, all of them with --json", "", count - names.len()));
        }
    }

    fn bytes(&mut self, label: &str, bytes: u64, share: Option<f64>) {
        let share = share.map_or(String::new(), |share| format!("  {share:6.1} bytes a triangle"));
        self.row(label, format!("{:>10}{share}", readable(bytes)));
    }
}

fn point(coordinates: [f64; 3]) -> String {
    coordinates.map(|x| short(x).to_string()).join(" ")
}

/// The number to seven significant digits, which is what f32 tells apart.
fn short(x: f64) -> f64 {
    // Adding 0 takes the sign off a zero.
    format!("{x:.6e}").parse().unwrap_or(x) + 0.0
}

/// A number of bytes with a unit of 1024s, to four digits.
pub fn readable(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} B") } else { format!("{value:.1} {}", UNITS[unit]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_readable() {
        assert_eq!(readable(0), "0 B");
        assert_eq!(readable(1023), "1023 B");
        assert_eq!(readable(1536), "1.5 KiB");
        assert_eq!(readable(3 << 30), "3.0 GiB");
        assert_eq!(readable(u64::MAX), "16777216.0 TiB");
    }

    #[test]
    fn coordinates_have_the_digits_that_f32_has() {
        assert_eq!(point([f64::from(1.3f32), -0.0, 148_376.251]), "1.3 0 148376.3");
        assert_eq!(point([f64::INFINITY, 1e-30, 1e12]), "inf 0.000000000000000000000000000001 1000000000000");
    }

    #[test]
    fn columns_are_aligned() {
        let mut table = Table(String::new());
        table.row("a", 1);
        table.list("names", &["x".into()]);
        let columns: Vec<_> = table.0.lines().map(|line| line.find(['1', 'x']).unwrap()).collect();
        assert_eq!(columns, [3 + LABEL, 3 + LABEL, 5 + LABEL]);
    }

    #[test]
    fn names_keep_their_order_and_come_once() {
        let mut table = Table(String::new());
        table.list("materials", &["wood", "glass", "wood"].map(String::from));
        let words: Vec<_> = table.0.split_whitespace().collect();
        assert_eq!(words, ["materials", "3", "wood", "(2", "of", "them)", "glass"]);
        let mut table = Table(String::new());
        table.list_of("groups", 5, &["a", "b"].map(String::from));
        assert!(table.0.contains(" and 3 more"), "{}", table.0);
    }
}
