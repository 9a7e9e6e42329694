//! One answer of the renderer beside the exact one.

use glam::{DVec3, Vec3};

use super::Class;
use super::bounds::{self, TriangleBounds};
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
    /// |t - exact t| over its bound, for the surface that the renderer reports; 0 where it reports none, or one that the
    /// ray's line does not meet exactly.
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
    /// The bound of t.
    bound: f64,
    /// The edge bound, for triangles.
    edge: f64,
}

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
            neighbours: scene.meshes.iter().map(Neighbours::of).collect(),
        })
    }

    /// Compares the renderer's closest hit with the exact one.
    pub fn judge(&self, ray: &Ray, hit: &Hit) -> Verdict {
        let exact = self.oracle.closest(ray);
        let rounded = exact.as_ref().map_or(Hit::MISS, ExactHit::hit);
        let found = hit.is_hit().then(|| self.surface(ray, hit.instance, hit.primitive, f64::from(hit.t)));
        let t_error = found.as_ref().and_then(|surface| Some((f64::from(hit.t) - surface.t?).abs() / surface.bound));
        let class = match (&exact, &found) {
            (None, None) => Class::Same,
            (Some(exact), None) => self.missing(ray, &self.surface_of(ray, exact)),
            (None, Some(found)) => extra(ray, found),
            (Some(exact), Some(found)) if (exact.instance, exact.primitive) == (found.instance, found.primitive) => {
                Class::Same
            }
            (Some(exact), Some(found)) => self.other(ray, hit, found, &self.surface_of(ray, exact)),
        };
        Verdict { class, t_error: t_error.unwrap_or(0.0), exact: rounded }
    }

    /// Another surface was reported than the right one.
    fn other(&self, ray: &Ray, hit: &Hit, found: &Surface, right: &Surface) -> Class {
        let t_right = right.t.expect("an exact hit has an exact t");
        if self.share_near_edge(ray, found, right) {
            return Class::Neighbour;
        }
        match found.t {
            Some(t) if !is_in_range(ray, t) => extra(ray, found),
            Some(t) if (t - t_right).abs() <= found.bound + right.bound => Class::Reordered,
            None if !found.near_edge => Class::Wrong,
            // An extra hit before the right one hides it.
            None if f64::from(hit.t) <= t_right + right.bound => Class::HitNearEdge,
            _ => self.missing(ray, right),
        }
    }

    /// The right surface was not reported, nor one that explains it.
    fn missing(&self, ray: &Ray, right: &Surface) -> Class {
        if right.t.is_some_and(|t| is_near_end(ray, t, right.bound)) {
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
                let TriangleBounds { edge, t: bound, .. } = bounds::triangle(ray, placed, corners, t);
                // A needle is no excuse: an extra hit far from it would be wrong.
                let near_edge = self.is_near(ray, instance, corners, edge);
                Surface { instance, primitive, near_edge, t, bound, edge }
            }
            Shape::Quadric(quadric) => {
                let at = crossings.iter().map(|crossing| (crossing.t.to_f64(), crossing.primitive));
                let rank = |(t, surface): &(f64, u32)| ((*surface != primitive) as u32, (t - near).abs());
                let t = at.min_by(|a, b| rank(a).partial_cmp(&rank(b)).expect("t are not NaN")).map(|(t, _)| t);
                let quadric = &self.scene.quadrics[quadric as usize];
                let own = bounds::quadric(ray, placed, quadric, t.unwrap_or(near), primitive);
                Surface { instance, primitive, near_edge: own.near_edge, t, bound: own.t, edge: 0.0 }
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

    /// Whether two surfaces are parts of one quadric, or triangles with a common edge or corner near the ray.
    fn share_near_edge(&self, ray: &Ray, one: &Surface, other: &Surface) -> bool {
        if one.instance != other.instance {
            return false;
        }
        let (Some(corners), Some(others)) = (self.corners(one), self.corners(other)) else {
            return one.near_edge || other.near_edge;
        };
        let shared: Vec<Vec3> = corners.into_iter().filter(|corner| others.contains(corner)).collect();
        let within = one.edge.max(other.edge);
        match shared[..] {
            [a] => self.line_distance(ray, one.instance, [a, a]) <= within,
            [a, b, ..] => self.line_distance(ray, one.instance, [a, b]) <= within,
            [] => false,
        }
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
            .is_some_and(|(corners, _)| bounds::triangle(ray, placed, corners, None).needle)
    }
}

/// A surface was reported that is not hit exactly, and nothing else is.
fn extra(ray: &Ray, found: &Surface) -> Class {
    match found.t {
        Some(t) if is_near_end(ray, t, found.bound) => Class::Range,
        Some(_) => Class::Wrong,
        None if found.near_edge => Class::HitNearEdge,
        None => Class::Wrong,
    }
}

/// The ends of the interval in which the renderer can report hits.
fn ends(ray: &Ray) -> (f64, f64) {
    (f64::from(ray.t_min).max(0.0), f64::from(ray.t_max.min(f32::MAX)))
}

fn is_in_range(ray: &Ray, t: f64) -> bool {
    let (near, far) = ends(ray);
    t >= near && t <= far
}

fn is_near_end(ray: &Ray, t: f64, bound: f64) -> bool {
    let (near, far) = ends(ray);
    (t - near).abs() <= bound || (t - far).abs() <= bound || t > f64::from(f32::MAX) - bound
}
