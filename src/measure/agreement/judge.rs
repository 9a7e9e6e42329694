//! One answer of the renderer beside the exact one.

use glam::{DVec3, Vec3};

use super::Class;
use super::bounds::{self, Span, TriangleBounds};
use super::neighbours::Neighbours;
use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::math::vector::{cross, dot};
use crate::measure::oracle::{ExactHit, Oracle, triangle::world_distance};
use crate::render::world::World;
use crate::scene::{Scene, Shape};

/// Judges answers to rays of one scene.
pub struct Judge<'a> {
    scene: &'a Scene,
    world: World,
    oracle: Oracle,
    /// By mesh.
    neighbours: Vec<Neighbours>,
}

/// What became of an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// How it compares.
    pub class: Class,
    /// |t - exact t| over its bound, for the surface that the renderer reports, or how far t is from the middle of where it
    /// may lie, where the ray's line passes that surface by; 0 where it reports none.
    pub t_error: f64,
    /// The exact answer, rounded.
    pub exact: Hit,
}

/// What is known of one surface on a ray's line.
struct Surface {
    instance: u32,
    primitive: u32,
    /// Whether hit and miss may be confused.
    near_edge: bool,
    /// The exact t where the line meets it.
    t: Option<f64>,
    /// Where t lies if the renderer reports it.
    span: Span,
    /// The edge bound, for triangles.
    edge: f64,
}

impl Surface {
    fn is_at(&self, hit: &Hit) -> bool {
        (self.instance, self.primitive) == (hit.instance, hit.primitive)
    }

    /// How far a reported t is off, in bounds.
    fn error(&self, t: f64) -> f64 {
        let Span { least, largest } = self.span;
        let expected = self.t.unwrap_or(0.5 * (least + largest));
        if t == expected || !(least.is_finite() && largest.is_finite()) {
            return 0.0;
        }
        if t > expected { (t - expected) / (largest - expected) } else { (expected - t) / (expected - least) }
    }
}

/// The most triangles in a [chain](Judge::chain): more lie around no corner of a mesh that is not degenerate.
const LONGEST_CHAIN: usize = 32;

impl<'a> Judge<'a> {
    /// Prepares the oracle and which triangles are neighbours.
    ///
    /// # Errors
    /// As [`Oracle::new`].
    pub fn new(scene: &'a Scene) -> Result<Self> {
        Ok(Self {
            scene,
            world: World::new(scene)?,
            oracle: Oracle::new(scene)?,
            neighbours: scene.meshes.iter().map(|mesh| Neighbours::of(mesh)).collect(),
        })
    }

    /// Compares the renderer's closest hit with the exact one.
    ///
    /// The surface that is reported must be one that rounding can make the ray hit, at a t that rounding can give it; and
    /// each surface that the ray hits before that must be one that rounding can lose.
    pub fn judge(&self, ray: &Ray, hit: &Hit) -> Verdict {
        let exact = self.oracle.closest(ray);
        let rounded = exact.as_ref().map_or(Hit::MISS, ExactHit::hit);
        let found = hit.is_hit().then(|| self.surface(ray, hit.instance, hit.primitive, f64::from(hit.t)));
        let t_error = found.as_ref().map_or(0.0, |surface| surface.error(f64::from(hit.t)));
        let same = (rounded.instance, rounded.primitive) == (hit.instance, hit.primitive);
        let class = if same { Class::Same } else { self.differing(ray, hit, found.as_ref()) };
        Verdict { class, t_error, exact: rounded }
    }

    /// Another surface was reported than the right one, or none, or one where there is none.
    fn differing(&self, ray: &Ray, hit: &Hit, found: Option<&Surface>) -> Class {
        let reported = found.map_or(Class::Same, |found| reported(ray, found));
        let all: Vec<Surface> = self.oracle.all(ray).iter().map(|exact| self.surface_of(ray, exact)).collect();
        let passed = |surface: &&Surface| !surface.is_at(hit) && surface.span.largest < f64::from(hit.t);
        let excuses: Vec<Class> = all.iter().filter(passed).map(|right| self.missing(ray, right, found)).collect();
        let first = all.first().zip(found);
        if reported == Class::Wrong || excuses.contains(&Class::Wrong) {
            Class::Wrong
        } else if first.is_some_and(|(right, found)| self.share_near_edge(ray, found, right)) {
            Class::Neighbour
        } else if reported != Class::Same {
            reported
        } else {
            // If nothing was passed over, the right surface may as well have come later.
            excuses.first().copied().unwrap_or(Class::Reordered)
        }
    }

    /// A surface was not reported, though it comes before the one that was, if any.
    fn missing(&self, ray: &Ray, right: &Surface, found: Option<&Surface>) -> Class {
        let (near, far) = ends(ray);
        if found.is_some_and(|found| self.share_near_edge(ray, found, right)) {
            Class::Neighbour
        } else if right.span.least < near || right.span.largest > far {
            Class::Range
        } else if right.near_edge && self.may_be_missed(ray, right) {
            Class::MissNearEdge
        } else {
            Class::Wrong
        }
    }

    fn surface_of(&self, ray: &Ray, exact: &ExactHit) -> Surface {
        self.surface(ray, exact.instance, exact.primitive, exact.t.to_f64())
    }

    /// What is known of a surface; `near` chooses among a quadric's crossings.
    fn surface(&self, ray: &Ray, instance: u32, primitive: u32, near: f64) -> Surface {
        let crossings = self.oracle.on_line(ray, instance, primitive);
        let placed = &self.world.instances[instance as usize];
        match placed.shape {
            Shape::Mesh(_) => {
                let t = crossings.first().map(|crossing| crossing.t.to_f64());
                let (corners, _) = self.oracle.triangle(instance, primitive).expect("hits name triangles");
                let TriangleBounds { edge, t: span, .. } = bounds::triangle(ray, placed, corners, t);
                let near_edge = self.is_near(ray, instance, corners, edge);
                Surface { instance, primitive, near_edge, t, span, edge }
            }
            Shape::Quadric(quadric) => {
                let own = crossings.iter().filter(|crossing| crossing.primitive == primitive);
                let t = own.map(|crossing| crossing.t.to_f64()).min_by(|a, b| {
                    let distance = |t: &f64| (t - near).abs();
                    distance(a).total_cmp(&distance(b))
                });
                let quadric = &self.scene.quadrics[quadric as usize];
                let own = bounds::quadric(ray, placed, quadric, primitive, t, near);
                Surface { instance, primitive, near_edge: own.near_edge, t, span: own.t, edge: 0.0 }
            }
        }
    }

    /// Whether the ray's line passes an edge of a triangle within a distance.
    fn is_near(&self, ray: &Ray, instance: u32, [a, b, c]: [Vec3; 3], within: f64) -> bool {
        [[a, b], [b, c], [c, a]].into_iter().any(|ends| self.line_distance(ray, instance, ends) <= within)
    }

    fn line_distance(&self, ray: &Ray, instance: u32, ends: [Vec3; 2]) -> f64 {
        let placed = &self.world.instances[instance as usize];
        world_distance(ray, ends, (!placed.identity).then(|| placed.transform.to_world()))
    }

    fn corners(&self, surface: &Surface) -> Option<[Vec3; 3]> {
        self.oracle.triangle(surface.instance, surface.primitive).map(|(corners, _)| corners)
    }

    /// Whether two surfaces are parts of one quadric that meet near the ray, or triangles with a common edge or corner there.
    fn share_near_edge(&self, ray: &Ray, one: &Surface, other: &Surface) -> bool {
        if one.instance != other.instance {
            return false;
        }
        let (Some(corners), Some(others)) = (self.corners(one), self.corners(other)) else {
            let meet = one.span.least <= other.span.largest && other.span.least <= one.span.largest;
            return one.near_edge && other.near_edge && meet;
        };
        let shared: Vec<Vec3> = corners.into_iter().filter(|corner| others.contains(corner)).collect();
        let within = one.edge.max(other.edge);
        let meet = match shared[..] {
            [a] => self.line_distance(ray, one.instance, [a, a]) <= within,
            [a, b, ..] => self.line_distance(ray, one.instance, [a, b]) <= within,
            [] => false,
        };
        meet || self.chain(ray, one).contains(&other.primitive)
    }

    /// The triangles that rounding can put in a triangle's place, itself first: over an edge that the ray passes within the
    /// bound to the next triangle, and if that is so narrow as the ray sees it that another of its edges is as near, over that
    /// one too. Narrow strips are seen nearly edge-on, one after the other along a silhouette.
    fn chain(&self, ray: &Ray, from: &Surface) -> Vec<u32> {
        let mut chain = vec![from.primitive];
        let Shape::Mesh(mesh) = self.world.instances[from.instance as usize].shape else { return chain };
        let neighbours = &self.neighbours[mesh as usize];
        let mut at = 0;
        while let Some(&number) = chain.get(at)
            && chain.len() < LONGEST_CHAIN
        {
            at += 1;
            let Some((corners, _)) = self.oracle.triangle(from.instance, number) else { continue };
            let placed = &self.world.instances[from.instance as usize];
            let within = bounds::triangle(ray, placed, corners, None).edge;
            let [a, b, c] = corners;
            for [from_corner, to_corner] in [[a, b], [b, c], [c, a]] {
                if self.line_distance(ray, from.instance, [from_corner, to_corner]) <= within {
                    let next = neighbours.along(from_corner, to_corner).filter(|next| !chain.contains(next));
                    let next: Vec<u32> = next.collect();
                    chain.extend(next);
                }
            }
        }
        chain
    }

    /// Whether a surface may be missed near its edge: a quadric at a tangent or cut; a triangle at a border, or where what
    /// lies beyond the edge or around the corner faces the other way. Inside a closed surface nothing may be missed.
    fn may_be_missed(&self, ray: &Ray, surface: &Surface) -> bool {
        let Some([a, b, c]) = self.corners(surface) else { return true };
        let Shape::Mesh(mesh) = self.world.instances[surface.instance as usize].shape else { return true };
        let neighbours = &self.neighbours[mesh as usize];
        let own = self.facing(ray, surface.instance, surface.primitive);
        let differs = |number: u32| {
            let other = self.facing(ray, surface.instance, number);
            // A triangle seen edge-on is a silhouette of both sides.
            other * own <= 0.0 || self.is_edge_on(ray, surface.instance, number)
        };
        if self.chain(ray, surface).into_iter().any(differs) {
            return true;
        }
        let is_near = |ends: [Vec3; 2]| self.line_distance(ray, surface.instance, ends) <= surface.edge;
        let edges = [[a, b], [b, c], [c, a]];
        let over_edge = edges
            .into_iter()
            .filter(|&ends| is_near(ends))
            .any(|[from, to]| neighbours.along(from, to).count() < 2 || neighbours.along(from, to).any(differs));
        over_edge
            || [a, b, c].into_iter().filter(|&corner| is_near([corner, corner])).any(|corner| {
                let fan = neighbours.at(corner);
                let has_border = fan.iter().any(|&number| {
                    let others = self.scene.meshes[mesh as usize].triangle(number);
                    others.into_iter().any(|end| end != corner && neighbours.along(corner, end).count() < 2)
                });
                has_border || fan.iter().any(|&number| differs(number))
            })
    }

    /// The sign of the angle between a ray and a triangle's normal, in f64.
    fn facing(&self, ray: &Ray, instance: u32, primitive: u32) -> f64 {
        let Some((corners, _)) = self.oracle.triangle(instance, primitive) else { return 0.0 };
        let placed = &self.world.instances[instance as usize];
        let [a, b, c] = corners.map(|corner| placed.transform.point_to_world(corner.as_dvec3()));
        let d: DVec3 = ray.direction.as_dvec3();
        dot(cross(b - a, c - a), d)
    }

    /// Whether a triangle is seen so nearly edge-on that rounding can turn it around.
    fn is_edge_on(&self, ray: &Ray, instance: u32, primitive: u32) -> bool {
        let placed = &self.world.instances[instance as usize];
        self.oracle
            .triangle(instance, primitive)
            .is_some_and(|(corners, _)| bounds::triangle(ray, placed, corners, None).edge_on)
    }
}

/// Whether a surface may be reported: `Same` if it is hit.
fn reported(ray: &Ray, found: &Surface) -> Class {
    let (near, far) = ends(ray);
    match found.t {
        Some(t) if t >= near && t <= far => Class::Same,
        Some(_) if found.span.largest >= near && found.span.least <= far => Class::Range,
        None if found.near_edge => Class::HitNearEdge,
        _ => Class::Wrong,
    }
}

/// The ends of the interval in which the renderer can report hits.
fn ends(ray: &Ray) -> (f64, f64) {
    (f64::from(ray.t_min).max(0.0), f64::from(ray.t_max.min(f32::MAX)))
}
