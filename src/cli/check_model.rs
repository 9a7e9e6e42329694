//! `whitted check --model`: the renderer beside the exact oracle on a scene of the user's.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::build::open_scene;
use super::check::CheckArguments;
use super::ledger::{self, Told};
use super::stats_json::SCHEMA;
use super::terminal::{self, Terminal};
use crate::accel::{Kind, Params, Preset};
use crate::error::{Error, Result};
use crate::geometry::Hit;
use crate::measure::agreement::{self, Agreement, Class, Example};
use crate::measure::hexadecimal::hexadecimal;
use crate::measure::machine::Machine;
use crate::measure::ray_file::RayText;
use crate::measure::rays::RayFamily;

/// Asks rays of every family, each of every structure with every preset, and prints how the answers compare, a line a
/// family or one document.
///
/// # Errors
/// A scene that cannot be opened or built; answers that no bound explains, once all are printed; an interrupt.
pub fn run(path: &Path, kinds: &[Kind], arguments: &CheckArguments, terminal: &Terminal) -> Result<()> {
    let loaded = open_scene(path, &arguments.load, &arguments.load.options(), terminal);
    terminal.clear();
    let loaded = loaded?;
    ledger::report(path, &loaded.ledger, &loaded.scene, Told::Warnings, arguments.load.strict)?;
    let scene = loaded.scene;
    let structures: Vec<Params> = kinds.iter().flat_map(|&kind| presets(kind)).collect();
    let found = agreement::check(&scene, &structures, &RayFamily::ALL, arguments.rays, arguments.seed, terminal);
    terminal.clear();
    let found = found?;
    let all = found.iter().fold(Agreement::default(), |all, (_, agreement)| all.and(agreement.clone()));
    let text = if arguments.json {
        document(path, &structures, arguments.seed, &found, &all, scene.origin)
    } else {
        table(&structures, &found, &all, scene.origin)
    };
    terminal::print(text.as_bytes())?;
    if all.passes() {
        return Ok(());
    }
    let wrong = all.count(Class::Wrong);
    let message = format!(
        "{wrong} answers are wrong, {} distances are outside their bound, and {} answers of structures differ",
        all.t_outside,
        all.structures_differ + all.occluded_differs
    );
    Err(Error::limit(message).at_path(path).remedy("do not rely on this build; the rays above show what is wrong"))
}

/// A structure with every preset that changes it; `linear` has none.
fn presets(kind: Kind) -> impl Iterator<Item = Params> {
    let presets = if kind.resolve() == Kind::Linear { &Preset::ALL[..1] } else { Preset::ALL };
    presets.iter().map(move |&preset| Params { kind, preset })
}

/// The name of a structure in reports.
fn structure(Params { kind, preset }: &Params) -> String {
    if kind.resolve() == Kind::Linear {
        return kind.name().to_owned();
    }
    let preset = match preset {
        Preset::Fast => "fast",
        Preset::Balanced => "balanced",
        Preset::Best => "best",
    };
    format!("{} {preset}", kind.name())
}

/// A line a family, one of all, and the examples.
fn table(structures: &[Params], found: &[(RayFamily, Agreement)], all: &Agreement, origin: DVec3) -> String {
    let mut text = String::from("family         rays       hits");
    for class in Class::ALL {
        let _ = write!(text, " {:>9}", class.name().replace("_near_edge", " edge"));
    }
    text += "  worst t  outside  differ\n";
    for (family, agreement) in found {
        line(family.name(), agreement, &mut text);
    }
    line("all", all, &mut text);
    let names: Vec<String> = structures.iter().map(structure).collect();
    let _ = writeln!(text, "asked: {}", names.join(", "));
    for (family, agreement) in found {
        for example in &agreement.examples {
            describe(family.name(), example, origin, &mut text);
        }
    }
    text
}

/// One line of the table. Writing to a string cannot fail.
fn line(name: &str, agreement: &Agreement, text: &mut String) {
    let _ = write!(text, "{name:<8} {:>10} {:>10}", agreement.rays, agreement.hits);
    for count in agreement.classes {
        let _ = write!(text, " {count:>9}");
    }
    let differ = agreement.structures_differ + agreement.occluded_differs;
    let _ = writeln!(text, "  {:>7.4} {:>8} {differ:>7}", agreement.worst_t, agreement.t_outside);
}

fn describe(family: &str, Example { class, ray, hit, exact }: &Example, origin: DVec3, text: &mut String) {
    let _ = writeln!(text, "{} ({family}): {}", class.name(), RayText::of(ray, origin));
    let answer = |hit: &Hit| {
        if hit.is_hit() {
            format!("t {} on {} {}", hexadecimal(hit.t), hit.instance, hit.primitive)
        } else {
            "miss".to_owned()
        }
    };
    let _ = writeln!(text, "    renderer: {}; exact: {}", answer(hit), answer(exact));
}

/// What `check --model --json` writes. Documented in the manual's page on the command line.
#[derive(Serialize)]
struct Document<'a> {
    schema: u32,
    version: &'static str,
    machine: Machine,
    model: &'a Path,
    seed: u64,
    structures: Vec<String>,
    passed: bool,
    all: Counts,
    families: Vec<FamilyResult>,
}

#[derive(Serialize)]
struct Counts {
    rays: u64,
    hits: u64,
    classes: BTreeMap<&'static str, u64>,
    worst_t: f64,
    t_outside: u64,
    structures_differ: u64,
    occluded_differs: u64,
}

#[derive(Serialize)]
struct FamilyResult {
    family: &'static str,
    #[serde(flatten)]
    counts: Counts,
    examples: Vec<ExampleText>,
}

#[derive(Serialize)]
struct ExampleText {
    class: Class,
    #[serde(flatten)]
    ray: RayText,
    renderer: Option<HitText>,
    exact: Option<HitText>,
}

#[derive(Serialize)]
struct HitText {
    t: String,
    instance: u32,
    primitive: u32,
}

fn document(
    model: &Path,
    structures: &[Params],
    seed: u64,
    found: &[(RayFamily, Agreement)],
    all: &Agreement,
    origin: DVec3,
) -> String {
    let hit = |Hit { t, instance, primitive, .. }: Hit| {
        let text = HitText { t: hexadecimal(t), instance, primitive };
        (instance != Hit::MISS.instance).then_some(text)
    };
    let example = |example: &Example| ExampleText {
        class: example.class,
        ray: RayText::of(&example.ray, origin),
        renderer: hit(example.hit),
        exact: hit(example.exact),
    };
    let family = |(family, agreement): &(RayFamily, Agreement)| FamilyResult {
        family: family.name(),
        counts: counts(agreement),
        examples: agreement.examples.iter().map(example).collect(),
    };
    let document = Document {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::this(),
        model,
        seed,
        structures: structures.iter().map(structure).collect(),
        passed: all.passes(),
        all: counts(all),
        families: found.iter().map(family).collect(),
    };
    serde_json::to_string_pretty(&document).expect("names and numbers have a JSON form") + "\n"
}

fn counts(agreement: &Agreement) -> Counts {
    Counts {
        rays: agreement.rays,
        hits: agreement.hits,
        classes: Class::ALL.iter().map(|&class| (class.name(), agreement.count(class))).collect(),
        worst_t: agreement.worst_t,
        t_outside: agreement.t_outside,
        structures_differ: agreement.structures_differ,
        occluded_differs: agreement.occluded_differs,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::measure::ray_file::{RayReader, RecordFormat};
    use glam::Vec3;

    #[test]
    fn printed_rays_are_read_as_the_same_rays() {
        let origin = DVec3::new(5e6, -0.1, 0.0);
        let ray = Ray { t_max: 7.5, ..Ray::new(Vec3::new(0.1, 3.3, -0.0), Vec3::new(0.3, -1e-40, 1e30)) };
        let mut told = String::new();
        let example = Example { class: Class::Wrong, ray, hit: Hit::MISS, exact: Hit::MISS };
        describe("edge", &example, origin, &mut told);
        let line = told.lines().next().unwrap().split(": ").nth(1).unwrap();
        let mut rays = Vec::new();
        RayReader::new(line.as_bytes(), RecordFormat::Text, Path::new("told")).read(&mut rays, 9).unwrap();
        assert_eq!(bytemuck::bytes_of(&rays[0].relative_to(origin)), bytemuck::bytes_of(&ray));
    }
}
