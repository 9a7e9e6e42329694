//! Where a ray that leaves a surface starts, so that it does not meet that surface again.

use glam::Vec3;

use super::moller_trumbore::cross_f32;
use crate::geometry::{Hit, Ray};
use crate::math::vector::{dot_f32, normalize};
use crate::render::surface::SurfacePoint;
use crate::render::world::World;
use crate::scene::camera::ViewRay;
use crate::scene::{Scene, Shape};

/// A way to choose the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spawn {
    /// At `o + t d`, and hits nearer than a fixed distance do not count.
    FixedStart,
    /// At `o + t d`, moved along the normal by a fixed distance.
    FixedOffset,
    /// Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems 2019, chapter 6,
    /// applied to `o + t d`: moved by 256 ulp along the normal, or by 1/65536 near the origin.
    IntegerOffset,
    /// The same applied to the point given by the barycentrics, as its authors advise.
    IntegerOffsetBarycentric,
    /// The renderer's: the point solved again in f64, moved by a bound on the triangle test's error.
    ErrorBound,
}

/// The distance of programs that have a fixed one.
const FIXED: f32 = 1e-4;

impl Spawn {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::FixedStart, Self::FixedOffset, Self::IntegerOffset, Self::IntegerOffsetBarycentric, Self::ErrorBound];

    /// What it is called in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::FixedStart => "t_min = 1e-4",
            Self::FixedOffset => "normal * 1e-4",
            Self::IntegerOffset => "Wächter-Binder, o + t d",
            Self::IntegerOffsetBarycentric => "Wächter-Binder, barycentric",
            Self::ErrorBound => "error bound (ours)",
        }
    }

    /// The start of a ray from the place where `ray` hit a triangle, on the side that it came from, and the smallest t
    /// that counts.
    ///
    /// `hit` is on an untransformed mesh of the scene; `world` belongs to the scene.
    pub fn start(self, scene: &Scene, world: &World, ray: &Ray, hit: &Hit) -> (Vec3, f32) {
        if self == Self::ErrorBound {
            let direction = normalize(ray.direction.as_dvec3()).expect("a ray that hit has a direction");
            let view = ViewRay { origin: ray.origin.as_dvec3(), direction };
            return (SurfacePoint::of(scene, world, &view, hit).origin_outside(), f32::MIN_POSITIVE);
        }
        let Shape::Mesh(mesh) = scene.objects[hit.instance as usize].shape else {
            unreachable!("spawned rays are compared on triangles")
        };
        let [a, b, c] = scene.meshes[mesh as usize].triangle(hit.primitive);
        let normal = facing(cross_f32(b - a, c - a), ray.direction);
        let along_ray = ray.origin + ray.direction * hit.t;
        match self {
            Self::FixedStart => (along_ray, FIXED),
            Self::FixedOffset => (along_ray + normal * FIXED, 0.0),
            Self::IntegerOffset => (integer_offset(along_ray, normal), 0.0),
            _ => {
                let point = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
                (integer_offset(point, normal), 0.0)
            }
        }
    }
}

/// A vector made a unit vector against a direction.
fn facing(normal: Vec3, direction: Vec3) -> Vec3 {
    let unit = normalize(normal.as_dvec3()).unwrap_or_default().as_vec3();
    if dot_f32(unit, direction) > 0.0 { -unit } else { unit }
}

/// The listing of the chapter, with its three constants.
fn integer_offset(point: Vec3, normal: Vec3) -> Vec3 {
    const ORIGIN: f32 = 1.0 / 32.0;
    const FLOAT_SCALE: f32 = 1.0 / 65536.0;
    const INT_SCALE: f32 = 256.0;
    let moved = |p: f32, n: f32| {
        let steps = (INT_SCALE * n) as i32;
        let bits = p.to_bits() as i32;
        let by_steps = f32::from_bits(bits.wrapping_add(if p < 0.0 { -steps } else { steps }) as u32);
        if p.abs() < ORIGIN { p + FLOAT_SCALE * n } else { by_steps }
    };
    Vec3::new(moved(point.x, normal.x), moved(point.y, normal.y), moved(point.z, normal.z))
}
