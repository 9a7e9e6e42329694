//! What `whitted explain` tells a person: the samples, then ray by ray a sum, a line a term.
//!
//! Rays come in the order of their list, which is that of a tree read from its root, and stand further right the deeper
//! they are: the terms of a ray stay together, and name the rays that they come from.

use std::fmt::Write;

use glam::DVec3;

use super::explain::Document;
use super::terminal::printable;
use crate::render::explain::{
    Arrival, BackgroundKind, Dark, End, Found, LightTerm, Lighting, RayNode, Sample, Stop, Surface, Term, Way,
};
use crate::scene::Rgb;

/// Width of the column of what is added: three values with all their digits.
const VALUES: usize = 35;

/// Samples whose colours are listed.
const MOST_SAMPLES: usize = 64;

/// Further right than this nothing is moved, so that deep rays can be read.
const MOST_INDENT: usize = 40;

/// The whole text.
pub fn of(document: &Document<'_>) -> String {
    let (pixel, film) = (document.pixel, &document.film);
    let mut text = Text::default();
    text.line(format!("pixel {},{} of {}x{}: {}", pixel.x, pixel.y, film.width, film.height, color(pixel.color)));
    if let Some(alpha) = pixel.alpha {
        text.line(format!("alpha {alpha:?}"));
    }
    if pixel.samples.len() > 1 {
        text.line(format!("the mean of {} samples:", pixel.samples.len()));
        for sample in pixel.samples.iter().take(MOST_SAMPLES) {
            text.line(format!("  {:3}  {}", sample.number, color(sample.color)));
        }
        if pixel.samples.len() > MOST_SAMPLES {
            text.line(format!("  and {} more", pixel.samples.len() - MOST_SAMPLES));
        }
    }
    for sample in &pixel.samples {
        text.sample(sample);
    }
    text.all
}

#[derive(Default)]
struct Text {
    all: String,
    indent: usize,
}

impl Text {
    /// Adds a line; names from files cannot end it.
    fn line(&mut self, line: impl AsRef<str>) {
        let _ = writeln!(self.all, "{:indent$}{}", "", printable(line.as_ref()), indent = self.indent);
    }

    /// Adds a line of a sum.
    fn term(&mut self, sign: &str, values: &str, what: impl AsRef<str>) {
        self.line(format!("  {sign} {values:VALUES$}  {}", what.as_ref()).trim_end());
    }

    fn sample(&mut self, sample: &Sample) {
        let Some(rays) = &sample.rays else { return };
        self.indent = 0;
        self.all.push('\n');
        let (x, y) = (short(sample.position.x), short(sample.position.y));
        self.line(format!("sample {} at {x} {y} in the pixel: {}", sample.number, color(sample.color)));
        if rays.is_empty() {
            self.line("the camera has no ray there: black");
        }
        for (number, ray) in rays.iter().enumerate() {
            self.indent = (2 * ray.depth as usize).min(MOST_INDENT);
            self.ray(number, ray, rays);
        }
    }

    fn ray(&mut self, number: usize, ray: &RayNode, rays: &[RayNode]) {
        let of = ray.parent.map_or(String::new(), |parent| format!(" of ray {parent}"));
        let (origin, direction) = (vector(ray.origin), vector(ray.direction));
        self.line(format!("ray {number}, {}{of}, from {origin} along {direction}", way(ray.way)));
        for hole in &ray.holes {
            self.line(format!("  passes {} at t = {:?}, which is not there", found(hole), hole.t));
        }
        match &ray.end {
            End::Background { kind, color: seen } => {
                self.line(format!("  hits nothing: {} {}", background(*kind), color(*seen)));
            }
            End::Surface(surface) => {
                self.surface(surface, rays);
                self.term("=", &color(ray.color), "");
            }
        }
    }

    fn surface(&mut self, surface: &Surface, rays: &[RayNode]) {
        let hit = &surface.found;
        let side = if surface.from_outside { "outside" } else { "inside" };
        self.line(format!("  hits {}, material `{}`, from {side} at t = {:?}", found(hit), hit.material, hit.t));
        if let Some(other) = &surface.instead_of {
            self.line(format!("  found behind {}: one leaves there what is entered here", found(other)));
        }
        let mut place = format!("  at {}, normal {}", vector(surface.point), vector(surface.normal));
        if surface.normal != surface.geometric_normal {
            place += &format!(", that of the face {}", vector(surface.geometric_normal));
        }
        self.line(place);
        for term in &surface.terms {
            self.one_term(term, rays);
        }
    }

    fn one_term(&mut self, term: &Term, rays: &[RayNode]) {
        match term {
            Term::Ambient { color: own } => self.term(" ", &color(*own), "ambient"),
            Term::Emission { color: own } if *own == Rgb::ZERO => {}
            Term::Emission { color: own } => self.term("+", &color(*own), "emission"),
            Term::Light(light) => self.term("+", &color(light.added), lighting(light)),
            Term::Seen { way: how, weight, ray, added } => {
                let weight = format!("{} {}", if *how == Way::Reflected { "kr" } else { "kt" }, color(*weight));
                let what = match ray.and_then(|number| Some((number, rays.get(number)?))) {
                    Some((number, ray)) => format!("ray {number}, {}: {weight} * {}", way(*how), color(ray.color)),
                    None => format!("{}: {weight}, not followed, since the largest depth is reached", way(*how)),
                };
                self.term("+", &color(*added), what);
            }
            Term::Absorbed { length, left } => {
                self.term("*", &color(*left), format!("left after {} inside", short(*length)));
            }
            Term::Clamped { from, to } if from == to => {}
            Term::Clamped { from, .. } => self.term("<", "1", format!("clamped from {}", color(*from))),
        }
    }
}

fn lighting(light: &LightTerm) -> String {
    let name = format!("light {} `{}`", light.number, light.light);
    match &light.lighting {
        Lighting::Dark(Dark::Behind { n_dot_l }) => format!("{name}: behind the surface, N.L {}", short(*n_dot_l)),
        Lighting::Dark(Dark::OutsideCone) => format!("{name}: the point is outside its cone"),
        Lighting::Dark(Dark::AtThePoint) => format!("{name}: is at the point"),
        Lighting::Dark(Dark::TooBright) => format!("{name}: so near that its brightness has no number"),
        Lighting::Shines(arrival) => format!("{name}: {}", arrives(arrival)),
    }
}

fn arrives(arrival: &Arrival) -> String {
    if let Some(stop) = &arrival.blocked_by {
        return format!("N.L {}, blocked by {}", short(arrival.n_dot_l), place(stop, arrival));
    }
    let mut text = format!("S {}", color(arrival.visible));
    for crossing in &arrival.crossed {
        let what = place(&crossing.stop, arrival);
        let _ = write!(text, " [{} through {what}", color(crossing.passes));
        if let (Some(length), Some(left)) = (crossing.length, crossing.left) {
            let _ = write!(text, ", {} left after {} inside", color(left), short(length));
        }
        text.push(']');
    }
    let _ = write!(text, " * I {} * (diffuse {}", color(arrival.color), color(arrival.diffuse));
    let _ = write!(text, " with N.L {}", short(arrival.n_dot_l));
    if let (Some(r_dot_v), Some(specular)) = (arrival.r_dot_v, arrival.specular) {
        let _ = write!(text, " + specular {} with R.V {}", color(specular), short(r_dot_v));
    }
    text + ")"
}

/// What stands on the way to a light, and where.
fn place(stop: &Stop, arrival: &Arrival) -> String {
    match arrival.distance {
        Some(_) => format!("{} at t = {:?} of the way", found(&stop.found), stop.found.t),
        None => format!("{} at a distance of {:?}", found(&stop.found), stop.found.t),
    }
}

fn found(found: &Found) -> String {
    let part = found.part.as_ref().map_or(String::new(), |part| format!("part `{part}`, "));
    let numbers = format!("({part}instance {}, primitive {})", found.instance, found.primitive);
    if found.object.is_empty() { format!("an object {numbers}") } else { format!("`{}` {numbers}", found.object) }
}

fn way(way: Way) -> &'static str {
    match way {
        Way::Camera => "of the camera",
        Way::Reflected => "reflected",
        Way::Refracted => "refracted",
        Way::TotalReflection => "totally reflected",
    }
}

fn background(kind: BackgroundKind) -> &'static str {
    match kind {
        BackgroundKind::Color => "the background is",
        BackgroundKind::Gradient => "the background's gradient is",
        BackgroundKind::Image => "the background's image is",
        BackgroundKind::Transparent => "the background is transparent,",
    }
}

/// Its three values, or one if they are the same; all digits, so that they read back bit for bit.
fn color(color: Rgb) -> String {
    let [r, g, b] = color.to_array();
    // By their bits: 0 and -0 are not the same.
    if r.to_bits() == g.to_bits() && g.to_bits() == b.to_bits() {
        format!("{r:?}")
    } else {
        format!("{r:?} {g:?} {b:?}")
    }
}

fn vector(vector: DVec3) -> String {
    let [x, y, z] = vector.to_array().map(short);
    format!("{x} {y} {z}")
}

/// A number that needs no more than seven digits to be understood.
fn short(number: f64) -> String {
    let rounded = format!("{number:.6e}").parse::<f64>().unwrap_or(number);
    format!("{rounded:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_colours_exact() {
        assert_eq!(short(0.1 + 0.2), "0.3");
        assert_eq!(short(-1234567.89), "-1234568.0");
        assert_eq!(short(f64::INFINITY), "inf");
        assert_eq!(color(Rgb::splat(0.1)), "0.1");
        let odd = Rgb::new(0.1 + 0.2, 1e-30, -0.0);
        let read: Vec<f32> = color(odd).split(' ').map(|value| value.parse().unwrap()).collect();
        assert_eq!(read.iter().map(|v| v.to_bits()).collect::<Vec<_>>(), odd.to_array().map(f32::to_bits));
    }

    #[test]
    fn names_cannot_end_a_line() {
        let mut text = Text::default();
        text.line("hits `a\nb`");
        assert_eq!(text.all, "hits `a\\nb`\n");
    }
}
