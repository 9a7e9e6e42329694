//! `whitted check --model`: the renderer beside the exact oracle on a scene of the user's.

use std::fmt::Write;
use std::path::Path;

use super::check::CheckArguments;
use super::ledger;
use super::terminal::{self, Terminal};
use crate::accel::{Kind, Params, Preset};
use crate::error::{Error, Result};
use crate::formats::{self, LoadOptions};
use crate::geometry::{Hit, Ray};
use crate::measure::agreement::{self, Agreement, Class, Example};
use crate::measure::hexadecimal::hexadecimal;
use crate::measure::rays::RayFamily;

/// Asks rays of every family and prints how the answers compare, a line a family.
///
/// # Errors
/// A scene that cannot be opened or built; answers that no bound explains, once all are printed; an interrupt.
pub fn run(path: &Path, kinds: &[Kind], arguments: &CheckArguments, terminal: &Terminal) -> Result<()> {
    let loaded = formats::open(path, &LoadOptions::default(), terminal);
    terminal.clear();
    let loaded = loaded?;
    ledger::report(&loaded.ledger, false);
    let structures: Vec<Params> = kinds.iter().map(|&kind| Params { kind, preset: Preset::Balanced }).collect();
    let found = agreement::check(&loaded.scene, &structures, &RayFamily::ALL, arguments.rays, arguments.seed, terminal);
    terminal.clear();
    let found = found?;
    let mut text = String::from("family         rays       hits");
    for class in Class::ALL {
        let _ = write!(text, " {:>9}", class.name().replace("_near_edge", " edge"));
    }
    text += "  worst t  outside  differ\n";
    for (family, agreement) in &found {
        line(family.name(), agreement, &mut text);
    }
    let all = found.iter().fold(Agreement::default(), |all, (_, agreement)| all.and(agreement.clone()));
    line("all", &all, &mut text);
    for (family, agreement) in &found {
        for example in &agreement.examples {
            describe(family.name(), example, &mut text);
        }
    }
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

/// One line of the table. Writing to a string cannot fail.
fn line(name: &str, agreement: &Agreement, text: &mut String) {
    let _ = write!(text, "{name:<8} {:>10} {:>10}", agreement.rays, agreement.hits);
    for count in agreement.classes {
        let _ = write!(text, " {count:>9}");
    }
    let differ = agreement.structures_differ + agreement.occluded_differs;
    let _ = writeln!(text, "  {:>7.4} {:>8} {differ:>7}", agreement.worst_t, agreement.t_outside);
}

fn describe(family: &str, Example { class, ray, hit, exact }: &Example, text: &mut String) {
    let Ray { origin, t_min, direction, t_max } = ray;
    let numbers = origin.to_array().into_iter().chain(direction.to_array()).chain([*t_min, *t_max]);
    let numbers: Vec<String> = numbers.map(hexadecimal).collect();
    let _ = writeln!(text, "{} ({family}): {}", class.name(), numbers.join(" "));
    let answer = |hit: &Hit| {
        if hit.is_hit() {
            format!("t {} on {} {}", hexadecimal(hit.t), hit.instance, hit.primitive)
        } else {
            "miss".to_owned()
        }
    };
    let _ = writeln!(text, "    renderer: {}; exact: {}", answer(hit), answer(exact));
}
