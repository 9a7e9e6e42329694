//! A scene in one kind of structure, and what it answers.

use std::fmt;

use glam::Vec3;

use crate::accel::{Kind, Params};
use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::math::random::hash2;
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::Scene;

/// Rays of a batch: a packet of [`Wide`](crate::accel::Wide) and one that is left over.
const TOGETHER: usize = 17;

/// A scene built with one kind of structure and preset; displayed as `bvh2 fast`.
pub struct Structure {
    /// How it was built.
    pub params: Params,
    /// What rays are asked of.
    pub renderer: Renderer,
}

/// What a structure says of a ray: its closest hit, and whether there is any.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// The closest hit.
    pub hit: Hit,
    /// Whether anything is hit.
    pub occluded: bool,
}

impl Structure {
    /// Builds a scene's structure.
    ///
    /// # Errors
    /// A cancellation, or a build that was refused.
    pub fn build(scene: &Scene, params: Params, progress: &dyn Progress) -> Result<Self> {
        Ok(Self { params, renderer: Renderer::build(scene.clone(), &params, progress)? })
    }

    /// Asks for the closest hit and for any.
    ///
    /// A structure that answers batches in another way than single rays is asked both for one ray in sixteen, which is as many as take no
    /// longer than the others; where it disagrees with itself the answer is neither a hit nor a miss.
    pub fn ask(&self, ray: &Ray) -> Answer {
        let answer = Answer { hit: self.renderer.closest(ray), occluded: self.renderer.occluded(ray) };
        let words: [u32; 8] = bytemuck::cast(*ray);
        let drawn = words.into_iter().fold(0, hash2);
        if !matches!(self.params.kind.resolve(), Kind::Wide | Kind::Compact) || !drawn.is_multiple_of(16) {
            return answer;
        }
        let together = self.ask_with_neighbors(ray, (drawn / 16) as usize % TOGETHER);
        let agrees = bytemuck::bytes_of(&together.hit) == bytemuck::bytes_of(&answer.hit);
        if agrees && together.occluded == answer.occluded {
            answer
        } else {
            Answer { hit: together.hit, occluded: !together.hit.is_hit() }
        }
    }

    /// What a batch says of a ray at a place among others that go nearly alike: a whole packet and one more.
    fn ask_with_neighbors(&self, ray: &Ray, place: usize) -> Answer {
        let rays: [Ray; TOGETHER] = std::array::from_fn(|number| {
            let away = number as f32 - place as f32;
            let [a, b] = [2048.0, 64.0].map(|parts: f32| 1.0 + away / parts);
            let (origin, direction) = (Vec3::new(a, 1.0, 2.0 - a), Vec3::new(1.0, b, a));
            Ray { origin: ray.origin * origin, direction: ray.direction * direction, ..*ray }
        });
        let mut hits = [Hit::MISS; TOGETHER];
        let mut occluded = [false; TOGETHER];
        self.renderer.closest_batch(&rays, &mut hits);
        self.renderer.occluded_batch(&rays, &mut occluded);
        Answer { hit: hits[place], occluded: occluded[place] }
    }
}

impl Answer {
    /// Both questions were answered with a hit.
    pub fn is_hit(&self) -> bool {
        self.hit.is_hit() && self.occluded
    }

    /// Both questions were answered with a miss.
    pub fn is_miss(&self) -> bool {
        !self.hit.is_hit() && !self.occluded
    }
}

impl fmt::Display for Structure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.params.kind.resolve().name())?;
        match self.params.kind.resolve() {
            Kind::Linear => Ok(()),
            _ => write!(f, " {}", format!("{:?}", self.params.preset).to_lowercase()),
        }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Hit { t, u, v, instance, primitive } = self.hit;
        if self.hit.is_hit() {
            write!(f, "a hit at t {t:?} on triangle {primitive} of object {instance}, u {u:?}, v {v:?}")?;
        } else {
            write!(f, "no hit")?;
        }
        if self.hit.is_hit() == self.occluded {
            return Ok(());
        }
        write!(f, "; asked for any hit: {}", if self.occluded { "one" } else { "none" })
    }
}
