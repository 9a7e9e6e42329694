//! Where a ray meets a sphere, in f32 and in the renderer's f64.

use glam::{DVec3, Vec3};

use crate::geometry::{Quadric, Ray};
use crate::math::vector::dot_f32;

/// A way to solve the quadratic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SphereTest {
    /// Coefficients and discriminant in f32, the textbook's formula.
    Textbook,
    /// Haines, Günther and Akenine-Möller, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems 2019,
    /// chapter 7: the discriminant from the closest approach, the roots without cancellation; in f32.
    ClosestApproach,
    /// The renderer's quadric: f64, closest approach, Kahan's discriminant; t rounded at the end.
    Quadric,
}

/// A sphere as all three want it.
#[derive(Debug, Clone)]
pub struct Sphere {
    /// The middle.
    pub center: Vec3,
    /// The radius.
    pub radius: f32,
    quadric: Quadric,
}

impl Sphere {
    /// A sphere of a finite radius above 0.
    pub fn new(center: Vec3, radius: f32) -> Self {
        let r = f64::from(radius);
        let coefficients = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -r * r];
        let quadric = Quadric::new(coefficients, None, false).expect("the coefficients are finite");
        Self { center, radius, quadric }
    }
}

impl SphereTest {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Textbook, Self::ClosestApproach, Self::Quadric];

    /// What it is called in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Textbook => "textbook f32",
            Self::ClosestApproach => "Haines et al. f32",
            Self::Quadric => "f64 quadric (ours)",
        }
    }

    /// The smallest t >= 0 at which a ray meets the sphere.
    #[inline]
    pub fn intersect(self, sphere: &Sphere, ray: &Ray) -> Option<f32> {
        let (near, far) = match self {
            Self::Textbook => {
                let from_center = ray.origin - sphere.center;
                let a = dot_f32(ray.direction, ray.direction);
                let b = 2.0 * dot_f32(ray.direction, from_center);
                let c = dot_f32(from_center, from_center) - sphere.radius * sphere.radius;
                let discriminant = b * b - 4.0 * a * c;
                if !(discriminant >= 0.0) {
                    return None;
                }
                let root = discriminant.sqrt();
                ((-b - root) / (2.0 * a), (-b + root) / (2.0 * a))
            }
            Self::ClosestApproach => {
                let from_center = ray.origin - sphere.center;
                let a = dot_f32(ray.direction, ray.direction);
                let b = -dot_f32(ray.direction, from_center);
                let nearest = from_center + ray.direction * (b / a);
                let discriminant = sphere.radius * sphere.radius - dot_f32(nearest, nearest);
                if !(discriminant >= 0.0) {
                    return None;
                }
                let c = dot_f32(from_center, from_center) - sphere.radius * sphere.radius;
                let q = b + (a * discriminant).sqrt().copysign(b);
                let (r, s) = (c / q, q / a);
                if r < s { (r, s) } else { (s, r) }
            }
            Self::Quadric => {
                let origin: DVec3 = ray.origin.as_dvec3() - sphere.center.as_dvec3();
                let crossings = sphere.quadric.intersect_quadratic(origin, ray.direction.as_dvec3());
                return crossings.iter().map(|crossing| crossing.t as f32).find(|&t| t >= 0.0);
            }
        };
        if near >= 0.0 { Some(near) } else { (far >= 0.0).then_some(far) }
    }
}
