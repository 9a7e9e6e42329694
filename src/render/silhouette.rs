//! Which of two surfaces comes first where a ray clips the edge between them.
//!
//! A ray that clips an edge of a solid enters and leaves it within less than f32 can tell, so that the surface by which it
//! leaves may be found first. Seen from within, that is lit by what is inside: light would shine out along silhouettes.

use glam::DVec3;

use crate::geometry::Hit;
use crate::math::float::gamma;
use crate::math::vector::{cross, dot, length};
use crate::render::answers::Answers;
use crate::render::surface::SurfacePoint;
use crate::render::trace::{TracedRay, Tracer};

/// How far beyond a hit, in its distance, its entry is looked for. Rounding is some 2^-23 over the sine of the angle at
/// which a surface is met; more costs time and changes nothing, since the two points decide.
const WINDOW: f32 = 1.0 / 4096.0;

/// How many surfaces are looked at: an edge has one entry, a corner of a mesh has a few.
const MOST: u32 = 8;

impl<I: Answers> Tracer<'_, I> {
    /// The surface by which `ray` entered where `hit`, the first that was found, is met from within at `exit`; `None` if
    /// the ray comes from inside.
    ///
    /// It is an entry just beyond whose plane has the exit behind it: the ray is in front of that plane until it crosses
    /// it, so that whatever lies behind comes later, and rounding alone said otherwise.
    pub(super) fn entry_before(
        &self,
        ray: &TracedRay<I::Ray>,
        hit: &Hit,
        exit: &SurfacePoint,
    ) -> Option<(Hit, SurfacePoint)> {
        let t_max = hit.t * (1.0 + WINDOW);
        let mut key = hit.key();
        for _ in 0..MOST {
            let next = self.intersect.next_until(&ray.ray, key, t_max);
            if !next.is_hit() {
                return None;
            }
            if self.has_holes(&next) && self.is_hole(&next, ray.view.direction) {
                key = next.key();
                continue;
            }
            let entry = SurfacePoint::of(self.scene, self.world, &ray.view, &next);
            if entry.from_outside && has_behind(&entry, exit, ray.view.origin) {
                return Some((next, entry));
            }
            key = next.key();
        }
        None
    }
}

/// Whether `exit` lies behind the plane of `entry`, or in it where the two surfaces meet at an edge.
fn has_behind(entry: &SurfacePoint, exit: &SurfacePoint, eye: DVec3) -> bool {
    let height = dot(entry.geometric_normal, exit.position - entry.position);
    let scale = entry.position.abs().max(exit.position.abs()).max(eye.abs()).max_element();
    // Points of triangles are kept inside them and good to some roundings of f64. Those of quadrics are where the
    // unrounded ray is, which may pass the rim at which the ray of f32 was clipped.
    let rounding = if entry.is_on_triangle() { 64.0 * f64::EPSILON } else { gamma(8) };
    // Faces back to back are no edge: their planes are one, as far as
    // f32 corners can tell, and the ray leaves through one before it enters through the other.
    let same_plane = dot(entry.geometric_normal, exit.geometric_normal) > 0.0
        && length(cross(entry.geometric_normal, exit.geometric_normal)) < f64::from(f32::EPSILON);
    height <= rounding * scale && !same_plane
}
