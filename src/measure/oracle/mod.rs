//! Exact answers: which surfaces a ray meets, and in which order, in exact arithmetic on the inputs as given.
//!
//! The inputs are the f32 vertices of meshes as stored, each instance's f64 map to the world, the f64 coefficients and
//! clip boxes of quadrics, and a [`WideRay`] relative to the scene's origin, which an f32
//! [`Ray`](crate::geometry::Ray) is without loss. All are dyadic numbers, and everything asked
//! of them is the sign of a polynomial ([`triangle`], `quadric.rs`) or a comparison of roots ([`Parameter`]). Maps are
//! applied to vertices and never inverted. No formula, box or tree is the renderer's.
//!
//! ```text
//! culling (boxes in f64) -> filter (f64 with an error bound) -> exact signs -> exact order of t
//! ```
//!
//! The conventions are the renderer's: triangles are closed and hit from both sides; a ray in a triangle's plane misses, and
//! triangles without area are never hit; `t_min <= t <= t_max`, and negative t do not count; hits are ordered by exact
//! t, then instance, then primitive; a ray that is not [valid](WideRay::is_valid) meets nothing.

mod culling;
mod number;
pub mod parameter;
mod quadric;
pub mod triangle;
mod wide_ray;

#[cfg(test)]
mod tests;

use std::cell::OnceCell;
use std::cmp::Ordering;

use glam::{DAffine3, DVec3, Vec3};

use crate::array::Array;
use crate::error::{Error, Result};
use crate::geometry::Hit;
use crate::measure::dyadic::Dyadic;
use crate::render::world::World;
use crate::scene::{Scene, Shape};
use culling::{Culling, DBox, SlabLine};
use number::{Rounded, Vector};
use quadric::PlacedQuadric;
use triangle::{Filtered, Line, TriangleAnswer, filter, is_in_range, meet, place};

pub use parameter::Parameter;
pub use wide_ray::WideRay;

/// A hit, exact.
#[derive(Debug, Clone)]
pub struct ExactHit {
    /// Object number.
    pub instance: u32,
    /// Triangle or surface number, as in [`Hit`].
    pub primitive: u32,
    /// t.
    pub t: Parameter,
    /// Weights, where a triangle was hit.
    weights: Option<TriangleAnswer>,
}

impl ExactHit {
    /// The weights of B and C rounded to the nearest f64; 0 on quadrics.
    pub fn uv(&self) -> (f64, f64) {
        self.weights.as_ref().map_or((0.0, 0.0), TriangleAnswer::uv)
    }

    /// The record of the hit: t, u and v rounded to the nearest f32 once. A t beyond the largest f32 becomes infinite.
    pub fn hit(&self) -> Hit {
        let (u, v) = self.weights.as_ref().map_or((0.0, 0.0), TriangleAnswer::uv_f32);
        Hit { t: self.t.to_f32(), u, v, instance: self.instance, primitive: self.primitive }
    }
}

/// What an item of the culling tree is.
#[derive(Debug, Clone, Copy)]
struct Item {
    instance: u32,
    triangle: u32,
}

/// A mesh as it stands in the world.
#[derive(Debug)]
struct PlacedMesh {
    mesh: u32,
    /// `None` is the identity.
    to_world: Option<DAffine3>,
}

/// Answers exactly for one scene, of which it keeps the geometry.
pub struct Oracle {
    /// Vertices and triangles of the scene's meshes.
    meshes: Vec<(Array<Vec3>, Array<[u32; 3]>)>,
    /// By instance number; `None` is a quadric.
    placed: Vec<Option<PlacedMesh>>,
    quadrics: Vec<(u32, PlacedQuadric)>,
    items: Vec<Item>,
    culling: Culling,
}

/// Something that a line certainly meets within the ray's interval, its t known as well as was needed.
struct Candidate {
    item: Item,
    low: f64,
    high: f64,
    exact: OnceCell<Exact>,
}

/// The exact part of a hit.
#[derive(Debug, Clone)]
struct Exact {
    t: Parameter,
    weights: Option<TriangleAnswer>,
}

impl From<TriangleAnswer> for Exact {
    fn from(answer: TriangleAnswer) -> Self {
        Self { t: answer.t.clone(), weights: Some(answer) }
    }
}

/// One ray in all the forms that are asked.
struct Question<'a> {
    oracle: &'a Oracle,
    ray: WideRay,
    exact: Line<Dyadic>,
    rounded: Line<Rounded>,
}

impl Oracle {
    /// Prepares a scene's objects: one box for each triangle of each instance, 56 bytes or so.
    ///
    /// # Errors
    /// As [`World::new`]; a limit for more than 2^31 instanced triangles.
    pub fn new(scene: &Scene) -> Result<Self> {
        let world = World::new(scene)?;
        if scene.instanced_triangles() > 1 << 31 {
            return Err(Error::limit(
                "exact answers are for scenes of at most 2147483648 triangles, instances counted",
            ));
        }
        let (mut placed, mut quadrics, mut items, mut boxes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (number, instance) in (0u32..).zip(&world.instances) {
            let to_world = *instance.transform.to_world();
            match instance.shape {
                Shape::Quadric(quadric) => {
                    let quadric = PlacedQuadric::new(&scene.quadrics[quadric as usize], &to_world);
                    quadrics.push((number, quadric));
                    placed.push(None);
                }
                Shape::Mesh(mesh) => {
                    let to_world = (to_world != DAffine3::IDENTITY).then_some(to_world);
                    let triangles = &scene.meshes[mesh as usize];
                    for triangle in triangles.live_triangles() {
                        items.push(Item { instance: number, triangle });
                        let corners = triangles.triangle(triangle);
                        boxes.push(enclose(corners.map(|corner| place(to_world.as_ref(), corner))));
                    }
                    placed.push(Some(PlacedMesh { mesh, to_world }));
                }
            }
        }
        let meshes = scene.meshes.iter().map(|mesh| (mesh.positions.clone(), mesh.indices.clone())).collect();
        Ok(Self { meshes, placed, quadrics, items, culling: Culling::new(&boxes) })
    }

    /// Bytes of the boxes and of what they hold, without the vertices.
    pub fn bytes(&self) -> usize {
        self.culling.bytes() + size_of_val(self.items.as_slice())
    }

    /// The first hit.
    pub fn closest(&self, ray: impl Into<WideRay>) -> Option<ExactHit> {
        let question = Question::new(self, ray.into())?;
        let mut best: Option<Candidate> = None;
        question.search(&everything, |candidate| {
            if best.as_ref().is_none_or(|best| question.compare(&candidate, best) == Ordering::Less) {
                best = Some(candidate);
            }
            best.as_ref().map_or(f64::INFINITY, |best| best.high)
        });
        best.map(|best| question.finish(best))
    }

    /// Whether there is any hit.
    pub fn occluded(&self, ray: impl Into<WideRay>) -> bool {
        self.occluded_by(ray, &everything)
    }

    /// Whether there is any hit on an instance that `wants` names.
    pub fn occluded_by(&self, ray: impl Into<WideRay>, wants: &dyn Fn(u32) -> bool) -> bool {
        let Some(question) = Question::new(self, ray.into()) else { return false };
        let mut found = false;
        question.search(wants, |_| {
            found = true;
            f64::NEG_INFINITY
        });
        found
    }

    /// Every hit, in order.
    pub fn all(&self, ray: impl Into<WideRay>) -> Vec<ExactHit> {
        self.all_among(ray, &everything)
    }

    /// Every hit on instances that `wants` names, in order.
    pub fn all_among(&self, ray: impl Into<WideRay>, wants: &dyn Fn(u32) -> bool) -> Vec<ExactHit> {
        let Some(question) = Question::new(self, ray.into()) else { return Vec::new() };
        let mut found = Vec::new();
        question.search(wants, |candidate| {
            found.push(candidate);
            f64::INFINITY
        });
        found.sort_by(|a, b| question.compare(a, b));
        found.into_iter().map(|candidate| question.finish(candidate)).collect()
    }

    /// The vertices of a triangle of an instance, as stored, and the map that places them (`None` is the identity);
    /// `None` where there is no such triangle.
    pub fn triangle(&self, instance: u32, primitive: u32) -> Option<([Vec3; 3], Option<DAffine3>)> {
        let placed = self.placed.get(instance as usize)?.as_ref()?;
        let (positions, indices) = &self.meshes[placed.mesh as usize];
        let corners = indices.get(primitive as usize)?.map(|vertex| positions.get(vertex as usize).copied());
        match corners {
            [Some(a), Some(b), Some(c)] => Some(([a, b, c], placed.to_world)),
            _ => None,
        }
    }

    /// Where a ray's line meets one surface, whatever the ray's interval, in order: at most one hit on a triangle, at most
    /// four on a quadric, all of whose surfaces are given.
    pub fn on_line(&self, ray: impl Into<WideRay>, instance: u32, primitive: u32) -> Vec<ExactHit> {
        let line = Line::new(ray);
        if let Some((_, quadric)) = self.quadrics.iter().find(|(number, _)| *number == instance) {
            let crossings = quadric.crossings(&line).into_iter();
            return crossings.map(|(t, primitive)| ExactHit { instance, primitive, t, weights: None }).collect();
        }
        let answer = self
            .triangle(instance, primitive)
            .and_then(|(corners, to_world)| meet(&line, &corners.map(|corner| place(to_world.as_ref(), corner))));
        answer
            .map(|answer| ExactHit { instance, primitive, t: answer.t.clone(), weights: Some(answer) })
            .into_iter()
            .collect()
    }
}

/// Wants every instance.
fn everything(_: u32) -> bool {
    true
}

/// A box around vertices, rounded outward.
fn enclose(corners: [Vector<Rounded>; 3]) -> DBox {
    let ranges = corners.map(|corner| corner.map(|k| k.range()));
    let pick = |axis: usize, end: fn(&(f64, f64)) -> f64, better: fn(f64, f64) -> f64| {
        let [a, b, c] = ranges.each_ref().map(|corner| end(&corner[axis]));
        better(better(a, b), c)
    };
    let ends = |end: fn(&(f64, f64)) -> f64, better: fn(f64, f64) -> f64| {
        DVec3::new(pick(0, end, better), pick(1, end, better), pick(2, end, better))
    };
    DBox { min: ends(|range| range.0, f64::min), max: ends(|range| range.1, f64::max) }
}

impl<'a> Question<'a> {
    fn new(oracle: &'a Oracle, ray: WideRay) -> Option<Self> {
        ray.is_valid().then(|| Self { oracle, ray, exact: Line::new(ray), rounded: Line::new(ray) })
    }

    /// Calls `found` with everything on wanted instances that is hit within the ray's interval. It returns the largest t
    /// of interest.
    fn search(&self, wants: &dyn Fn(u32) -> bool, mut found: impl FnMut(Candidate) -> f64) {
        let (near, far) = self.ray.interval();
        let mut limit = far;
        for (instance, quadric) in &self.oracle.quadrics {
            if !wants(*instance) || quadric.certainly_missed(&self.rounded, near, limit) {
                continue;
            }
            for (t, surface) in quadric.crossings(&self.exact) {
                if is_in_range(&self.ray, &t) {
                    let item = Item { instance: *instance, triangle: surface };
                    limit = limit.min(found(Candidate::exact(item, Exact { t, weights: None })));
                }
            }
        }
        self.oracle.culling.search(&SlabLine::new(self.ray), near, limit, |item| {
            let item = self.oracle.items[item as usize];
            if wants(item.instance)
                && let Some(candidate) = self.meet(item)
            {
                limit = limit.min(found(candidate));
            }
            limit
        });
    }

    /// Meets one triangle; `None` unless it is hit within the ray's interval.
    fn meet(&self, item: Item) -> Option<Candidate> {
        let (corners, to_world) = self.oracle.triangle(item.instance, item.triangle)?;
        match filter(&self.rounded, &corners.map(|corner| place(to_world.as_ref(), corner))) {
            Filtered::Miss => None,
            Filtered::Hit(low, high) => {
                let (near, far) = self.ray.interval();
                if high < near || low > far {
                    return None;
                }
                let candidate = Candidate { item, low, high, exact: OnceCell::new() };
                (low >= near && high <= far || is_in_range(&self.ray, &self.exact(&candidate).t)).then_some(candidate)
            }
            Filtered::Unknown => {
                let answer = self.meet_exactly(item)?;
                is_in_range(&self.ray, &answer.t).then(|| Candidate::exact(item, answer.into()))
            }
        }
    }

    fn meet_exactly(&self, item: Item) -> Option<TriangleAnswer> {
        let (corners, to_world) = self.oracle.triangle(item.instance, item.triangle)?;
        meet(&self.exact, &corners.map(|corner| place(to_world.as_ref(), corner)))
    }

    /// The exact part of a candidate, found where it was not needed before.
    fn exact<'c>(&self, candidate: &'c Candidate) -> &'c Exact {
        candidate.exact.get_or_init(|| self.meet_exactly(candidate.item).expect("the filter found it").into())
    }

    /// The order of two candidates: t, instance, primitive.
    fn compare(&self, a: &Candidate, b: &Candidate) -> Ordering {
        if a.high < b.low {
            return Ordering::Less;
        }
        if a.low > b.high {
            return Ordering::Greater;
        }
        let by_number = || (a.item.instance, a.item.triangle).cmp(&(b.item.instance, b.item.triangle));
        self.exact(a).t.cmp(&self.exact(b).t).then_with(by_number)
    }

    fn finish(&self, candidate: Candidate) -> ExactHit {
        let Exact { t, weights } = self.exact(&candidate).clone();
        ExactHit { instance: candidate.item.instance, primitive: candidate.item.triangle, t, weights }
    }
}

impl Candidate {
    fn exact(item: Item, exact: Exact) -> Self {
        let t = exact.t.to_f64();
        Self { item, low: t.next_down(), high: t.next_up(), exact: exact.into() }
    }
}
