//! What was noted while reading, as lines for a person; and `--strict`, to which it is an error.

use std::path::Path;

use super::terminal;
use crate::error::{Error, Result};
use crate::formats::ledger::Entry;
use crate::formats::reach::{Census, PixelCounts, Reach};
use crate::formats::{Ledger, Treatment};
use crate::scene::Scene;

/// How much of a ledger is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// Nothing.
    Nothing,
    /// Warnings.
    Warnings,
}

/// Reports what was noted while `input` was read, on standard error. With `strict` what is not honoured is reported in any
/// case.
///
/// # Errors
/// With `strict`, when something was approximated, ignored or wrong: each thing is a line of its own before the error's.
pub fn report(input: &Path, ledger: &Ledger, scene: &Scene, told: Told, strict: bool) -> Result<()> {
    let shortcomings = ledger.entries().filter(|(treatment, ..)| *treatment != Treatment::Honoured).count();
    let refused = strict && shortcomings > 0;
    let wanted = |treatment| match told {
        Told::Warnings if treatment == Treatment::Warning => true,
        _ => refused && treatment != Treatment::Honoured,
    };
    if refused {
        lines(ledger, scene, None, wanted).iter().for_each(|line| terminal::report(line));
    } else {
        let lines = ledger.entries().filter(|(treatment, ..)| wanted(*treatment));
        lines.for_each(|(treatment, feature, count)| terminal::report(&line(treatment, feature, count, None)));
    }
    if !refused {
        return Ok(());
    }
    let what = match shortcomings {
        1 => "1 feature is".to_owned(),
        several => format!("{several} features are"),
    };
    Err(Error::file(format!("{what} approximated, ignored or wrong, as listed above"))
        .at_path(input)
        .remedy("leave out --strict to do without"))
}

/// The entries whose treatment is `wanted`, a line each, with what of the scene they concern, and in how many pixels it is seen
/// where that was counted.
pub fn lines(
    ledger: &Ledger,
    scene: &Scene,
    pixels: Option<PixelCounts<'_>>,
    wanted: impl Fn(Treatment) -> bool,
) -> Vec<String> {
    let census = Census::of(scene);
    let entries = ledger.all().filter(|(treatment, ..)| wanted(*treatment));
    let line = |(treatment, feature, entry): (_, &str, &Entry)| {
        line(treatment, feature, entry.count, Some(census.reach(entry, pixels)))
    };
    entries.map(line).collect()
}

/// One entry, such as `warning: map_bump is not readable (3 times; 2 materials, 1 mesh, 600 triangles)`.
pub fn line(treatment: Treatment, feature: &str, count: u64, reach: Option<Reach>) -> String {
    let times = if count > 1 { format!("{count} times") } else { String::new() };
    let Reach { materials, meshes, triangles, pixels } = reach.unwrap_or_default();
    let numbers = [
        numbered(materials, "material", "materials"),
        numbered(meshes, "mesh", "meshes"),
        // Zeros tell something where the feature belongs to a material or a mesh.
        (materials + meshes > 0).then(|| plural(triangles, "triangle", "triangles")),
        pixels.filter(|_| materials + meshes > 0).map(|pixels| plural(pixels, "pixel", "pixels")),
    ];
    let numbers: Vec<String> = numbers.into_iter().flatten().collect();
    let parts: Vec<String> = [times, numbers.join(", ")].into_iter().filter(|part| !part.is_empty()).collect();
    let aside = if parts.is_empty() { String::new() } else { format!(" ({})", parts.join("; ")) };
    format!("{}: {feature}{aside}", name(treatment))
}

fn numbered(count: u64, one: &str, several: &str) -> Option<String> {
    (count > 0).then(|| plural(count, one, several))
}

fn plural(count: u64, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

fn name(treatment: Treatment) -> &'static str {
    match treatment {
        Treatment::Honoured => "honoured",
        Treatment::Approximated => "approximated",
        Treatment::Ignored => "ignored",
        Treatment::Warning => "warning",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_told_where_there_are_several() {
        assert_eq!(line(Treatment::Ignored, "map_bump", 1, None), "ignored: map_bump");
        assert_eq!(line(Treatment::Warning, "no texture `a.png`", 3, None), "warning: no texture `a.png` (3 times)");
    }

    #[test]
    fn what_is_concerned_is_told_where_it_is_known() {
        let line = |count, reach| line(Treatment::Ignored, "map_bump", count, Some(reach));
        let reach = Reach { materials: 1, meshes: 2, triangles: 600, pixels: None };
        assert_eq!(line(1, Reach::default()), "ignored: map_bump");
        assert_eq!(line(3, reach), "ignored: map_bump (3 times; 1 material, 2 meshes, 600 triangles)");
        let reach = Reach { materials: 0, meshes: 1, triangles: 0, pixels: Some(1) };
        assert_eq!(line(1, reach), "ignored: map_bump (1 mesh, 0 triangles, 1 pixel)");
    }
}
