//! The part of the page about scenes of the report's own: quadrics, shadows and mirrors, features.

use super::document::{interval, picture, short, spread};
use super::pictures::SPHERES;
use super::{File, Report};
use crate::measure::features::FeatureCost;
use crate::measure::light_paths::{BOUNCES, LightPaths};
use crate::measure::table::Table;

/// The section on quadrics; empty if they were not measured.
pub fn spheres(report: &Report, pictures: &[File]) -> String {
    let Report { spheres: rows, rays, rays_timed, .. } = report;
    if rows.is_empty() {
        return String::new();
    }
    let headings = [
        "rays",
        ">distance",
        "formula",
        ">ns a ray",
        ">misses in 1e9",
        ">false hits in 1e9",
        ">error of t, ulp",
        ">off the surface, radii",
        ">normal, radians",
        "dominated",
    ];
    let mut table = Table::new(&headings);
    for row in rows {
        table.push(vec![
            row.group.name().into(),
            format!("{:.0e}", row.distance),
            format!("{}{}", row.name, if row.default { " (default)" } else { "" }),
            row.ns_per_ray.map_or("not timed".into(), interval),
            row.misses.to_string(),
            row.false_hits.to_string(),
            spread(&row.t_ulp),
            spread(&row.off_surface),
            spread(&row.normal_angle),
            if row.dominated { "yes" } else { "**no**" }.into(),
        ]);
    }
    let shown = picture(SPHERES, pictures);
    format!(
        "\n## Quadrics\n\nA sphere of radius 1, seen from around zero. Generic rays go through a disc half as large again, \
         adversarial ones within a millionth of its outline: \
         {rays} at each distance, the first {rays_timed} of them timed. Hits and t are compared with exact ones; \
         |F| / |grad F| is how far `o + t d` is from the surface, which the rounding of t alone makes large far away: the \
         renderer solves for the point again. Quantiles as above.\n\n{shown}\n{table}"
    )
}

/// The section on shadows and mirrors; empty if they were not measured.
pub fn light_paths(rows: &[LightPaths]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let headings = [
        ">scale",
        ">distance from zero",
        ">acne",
        ">leaks",
        ">contact gap, radii",
        ">bound",
        ">mirrored place, ulp",
        ">a bounce",
        "within bars",
    ];
    let mut table = Table::new(&headings);
    for row in rows {
        table.push(vec![
            format!("{:.0e}", row.scale),
            format!("{:.0e}", row.distance),
            format!("{} of {}", row.acne, row.lit),
            format!("{} of {}", row.leaks, row.walled),
            short(row.contact_gap),
            short(row.contact_gap_bound),
            short(row.position_error),
            short(row.position_error_per_bounce),
            if row.passes() { "yes" } else { "**no**" }.into(),
        ]);
    }
    format!(
        "\n## Shadows and mirrors\n\nThe renderer against closed forms, in scenes of each size that stand at each distance from \
         their file's zero: lit points of a sphere that are black (acne), points outside a closed cube that its lamp lights \
         (leaks), the largest distance from a contact at which the shadow is lost, and the error of a ray's place after up to \
         {BOUNCES} mirrors, in f32 ulp of the scene's coordinates.\n\n{table}"
    )
}

/// The section on what features cost; empty if that was not counted.
pub fn features(rows: &[FeatureCost]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let headings = [
        "feature",
        "present: the plain scene and",
        ">bytes absent",
        ">bytes present",
        ">instructions a ray absent",
        ">present",
        ">in a build without it",
        ">cost of absence",
    ];
    let mut table = Table::new(&headings);
    for row in rows {
        table.push(vec![
            row.feature.into(),
            row.adds.into(),
            row.bytes_absent.to_string(),
            row.bytes_present.to_string(),
            format!("{:.1}", row.instructions_absent),
            format!("{:.1}", row.instructions_present),
            row.instructions_without.map_or("not counted".into(), |count| format!("{count:.1}")),
            row.cost_of_absence().map_or("not counted".into(), |cost| format!("{:+.2} %", 100.0 * cost)),
        ]);
    }
    format!(
        "\n## What features cost\n\nA plain scene, a matt ball of triangles on a floor under one lamp, and the same with one \
         feature more. Bytes are those of geometry, textures, trees and top level. Instructions are those of user mode, counted \
         by callgrind on one thread over whole renderings and divided by all rays, shadow rays included. The cost of absence \
         compares the plain scene with itself in a build whose code for the feature was left out.\n\n{table}"
    )
}
