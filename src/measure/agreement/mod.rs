//! Whether the renderer agrees with the exact oracle, and how it differs where it may.
//!
//! An answer is [`Class::Same`] or differs in one of a few ways that rounding explains, each only within a bound that is
//! proven ([`bounds`]). What no bound explains is [`Class::Wrong`].

pub mod bounds;
mod judge;
mod neighbours;

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::accel::Params;
use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::measure::rays::{RayFamily, RaySource};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::Scene;
pub use judge::{Judge, Verdict};

/// How an answer of the renderer compares with the exact one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// The same surface, or a miss in both.
    Same,
    /// A triangle beside the right one, the ray passing within the edge bound of an edge or corner that they share.
    Neighbour,
    /// A surface whose exact t differs from the right one's by no more than the bounds of both.
    Reordered,
    /// A miss where the ray passes within the edge bound of a border or silhouette.
    MissNearEdge,
    /// A hit where the ray passes a surface by within the edge bound.
    HitNearEdge,
    /// A hit whose exact t lies within its bound of an end of the ray's interval.
    Range,
    /// None of these.
    Wrong,
}

impl Class {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Same, Self::Neighbour, Self::Reordered, Self::MissNearEdge, Self::HitNearEdge, Self::Range, Self::Wrong];

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Neighbour => "neighbour",
            Self::Reordered => "reordered",
            Self::MissNearEdge => "miss_near_edge",
            Self::HitNearEdge => "hit_near_edge",
            Self::Range => "range",
            Self::Wrong => "wrong",
        }
    }
}

/// A ray whose answers differ, or whose t is outside its bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Example {
    /// How.
    pub class: Class,
    /// The ray, relative to the scene's origin.
    pub ray: Ray,
    /// The renderer's answer.
    pub hit: Hit,
    /// The exact one, rounded.
    pub exact: Hit,
}

/// What was found on some rays.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Agreement {
    /// Rays asked.
    pub rays: u64,
    /// Rays that hit something, exactly.
    pub hits: u64,
    /// Answers by class, in the order of [`Class::ALL`].
    pub classes: [u64; 7],
    /// Hits whose t is farther from the exact t of the surface hit than its bound.
    pub t_outside: u64,
    /// The largest error of t, in bounds.
    pub worst_t: f64,
    /// Answers of another structure that differ by a bit from the first's.
    pub structures_differ: u64,
    /// Rays for which "is anything hit" contradicts the closest hit, in any structure.
    pub occluded_differs: u64,
    /// A few rays of each class but `Same`, the first that came.
    pub examples: Vec<Example>,
}

/// Examples kept of each class.
const EXAMPLES: usize = 10;

impl Agreement {
    /// How many answers there are of a class.
    pub fn count(&self, class: Class) -> u64 {
        self.classes[class as usize]
    }

    /// Whether rays were asked and nothing is wrong: no class `Wrong`, every t within its bound, all structures equal.
    pub fn passes(&self) -> bool {
        self.rays > 0
            && self.count(Class::Wrong) == 0
            && self.t_outside == 0
            && self.structures_differ == 0
            && self.occluded_differs == 0
    }

    /// Counts one answer.
    pub fn add(&mut self, ray: &Ray, hit: &Hit, verdict: &Verdict) {
        self.rays += 1;
        self.hits += u64::from(verdict.exact.is_hit());
        self.classes[verdict.class as usize] += 1;
        let outside = !(verdict.t_error <= 1.0);
        self.t_outside += u64::from(outside);
        if verdict.t_error.is_nan() || verdict.t_error > self.worst_t {
            self.worst_t = verdict.t_error;
        }
        let class = if outside { Class::Wrong } else { verdict.class };
        if class != Class::Same {
            self.keep(Example { class, ray: *ray, hit: *hit, exact: verdict.exact });
        }
    }

    /// Both in one.
    pub fn and(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.hits += other.hits;
        for (own, more) in self.classes.iter_mut().zip(other.classes) {
            *own += more;
        }
        self.t_outside += other.t_outside;
        // NaN stays.
        self.worst_t =
            if self.worst_t >= other.worst_t || self.worst_t.is_nan() { self.worst_t } else { other.worst_t };
        self.structures_differ += other.structures_differ;
        self.occluded_differs += other.occluded_differs;
        other.examples.into_iter().for_each(|example| self.keep(example));
        self
    }

    fn keep(&mut self, example: Example) {
        if self.examples.iter().filter(|kept| kept.class == example.class).count() < EXAMPLES {
            self.examples.push(example);
        }
    }
}

/// Compares the renderer with the oracle on `rays` rays, shared among those of the families that the scene has, and all
/// structures with the first; rays are those of [`RaySource`] under the seed. Advances by one step a ray.
///
/// # Errors
/// A scene that cannot be built, or a cancellation.
pub fn check(
    scene: &Scene,
    structures: &[Params],
    families: &[RayFamily],
    rays: u64,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<(RayFamily, Agreement)>> {
    let source = RaySource::new(scene)?;
    let judge = Judge::new(scene)?;
    let renderers =
        structures.iter().map(|params| Renderer::build(scene.clone(), params, progress)).collect::<Result<Vec<_>>>()?;
    let families: Vec<RayFamily> = families.iter().copied().filter(|family| source.has(*family)).collect();
    let count = rays.div_ceil(families.len().max(1) as u64);
    progress.begin("compare", count * families.len() as u64);
    // Pieces are added up in their order, so that examples do not depend on threads.
    const PIECE: u64 = 256;
    let ask = |family: RayFamily, piece: u64| -> Result<Agreement> {
        progress.check()?;
        let mut found = Agreement::default();
        for number in piece * PIECE..((piece + 1) * PIECE).min(count) {
            ask_all(&judge, &renderers, &source.ray(family, seed, number), &mut found);
        }
        progress.advance(PIECE.min(count - piece * PIECE));
        Ok(found)
    };
    let all_pieces = |family: RayFamily| -> Result<(RayFamily, Agreement)> {
        let pieces = (0..count.div_ceil(PIECE)).into_par_iter().map(|piece| ask(family, piece));
        let pieces = pieces.collect::<Result<Vec<_>>>()?;
        Ok((family, pieces.into_iter().fold(Agreement::default(), Agreement::and)))
    };
    families.into_iter().map(all_pieces).collect()
}

/// Asks all structures about one ray; the first's answer is judged.
fn ask_all(judge: &Judge<'_>, renderers: &[Renderer], ray: &Ray, found: &mut Agreement) {
    let Some((first, others)) = renderers.split_first() else { return };
    let hit = first.closest(ray);
    let bits = |hit: &Hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.instance, hit.primitive];
    for answer in others.iter().map(|other| other.closest(ray)).filter(|answer| bits(answer) != bits(&hit)) {
        found.structures_differ += 1;
        found.keep(Example { class: Class::Wrong, ray: *ray, hit: answer, exact: hit });
    }
    found.occluded_differs += renderers.iter().filter(|renderer| renderer.occluded(ray) != hit.is_hit()).count() as u64;
    found.add(ray, &hit, &judge.judge(ray, &hit));
}
