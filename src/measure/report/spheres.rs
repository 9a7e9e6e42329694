//! Quadrics: nanoseconds a ray against the error of a unit sphere's hits, near by and far away.

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::accuracy::{Spread, angle};
use super::query::Effort;
use super::rays::SEED;
use crate::error::Result;
use crate::geometry::{Ray, shapes};
use crate::math::random::Random;
use crate::math::vector::{basis, dot, length, normalize};
use crate::measure::oracle::Oracle;
use crate::measure::ray_set::Group;
use crate::measure::scenes::ulp;
use crate::measure::speed::interleaved;
use crate::measure::statistics::Median;
use crate::measure::sweep::{Cost, Range, Rate, dominated};
use crate::measure::variants::sphere::{Sphere, SphereTest};
use crate::progress::Progress;
use crate::scene::{Object, Scene, Shape};

/// How far the sphere is from where the rays start, which is around zero.
const DISTANCES: [f64; 4] = [1e1, 1e3, 1e5, 1e7];

/// One formula at one distance.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SphereRow {
    /// `generic`: rays at a disc half as large again as the sphere; `adversarial`: at its outline.
    pub group: Group,
    /// Distance of a sphere of radius 1 from the rays' origins.
    pub distance: f64,
    /// The formula.
    pub name: &'static str,
    /// Whether it is the renderer's.
    pub default: bool,
    /// Nanoseconds a ray; null if not timed.
    pub ns_per_ray: Option<Median>,
    /// Hits that were missed, of the rays that exactly hit.
    pub misses: Rate,
    /// Hits that are none, of all rays.
    pub false_hits: Rate,
    /// |t - exact| in f32 ulp of t, where both hit.
    pub t_ulp: Spread,
    /// |F| / |grad F| at o + t d: the distance of the found point from the surface, in radii.
    pub off_surface: Spread,
    /// Radians between the normals at the found and at the exact point.
    pub normal_angle: Spread,
    /// Whether another formula is no slower and no more often wrong, and better in one.
    pub dominated: bool,
}

/// Compares the formulas with `count` rays a distance, of which the first ones are timed.
///
/// # Errors
/// A cancellation.
pub fn measure(count: usize, effort: Effort, progress: &dyn Progress) -> Result<Vec<SphereRow>> {
    let mut rows = Vec::new();
    for group in Group::ALL {
        for distance in DISTANCES {
            rows.extend(at(group, distance, count, effort, progress)?);
        }
    }
    Ok(rows)
}

fn at(group: Group, distance: f64, count: usize, effort: Effort, progress: &dyn Progress) -> Result<Vec<SphereRow>> {
    let center = (DVec3::new(0.48, 0.6, -0.64) * distance).as_vec3();
    let sphere = Sphere::new(center, 1.0);
    let rays = rays(group, center, count);
    let truths = truths(center, &rays, progress)?;
    let times = time(&sphere, &rays[..effort.rays_timed.min(rays.len())], effort.repetitions, progress)?;
    let mut rows: Vec<SphereRow> = Vec::new();
    for (test, ns_per_ray) in SphereTest::ALL.into_iter().zip(times) {
        let (mut misses, mut false_hits) = (0, 0);
        let [mut t_ulp, mut off_surface, mut normal_angle] = [const { Vec::new() }; 3];
        for (ray, truth) in rays.iter().zip(&truths) {
            match (truth, test.intersect(&sphere, ray)) {
                (None, None) => {}
                (Some(_), None) => misses += 1,
                (None, Some(_)) => false_hits += 1,
                (Some(truth), Some(t)) => {
                    let t = f64::from(t);
                    let from_center = |t: f64| ray.origin.as_dvec3() + ray.direction.as_dvec3() * t - center.as_dvec3();
                    t_ulp.push((t - truth).abs() / ulp(*truth));
                    off_surface.push((length(from_center(t)) - 1.0).abs());
                    normal_angle.push(angle(from_center(t), from_center(*truth)));
                }
            }
        }
        rows.push(SphereRow {
            group,
            distance,
            name: test.name(),
            default: test == SphereTest::Quadric,
            ns_per_ray,
            misses: Rate::new(misses, truths.iter().flatten().count() as u64),
            false_hits: Rate::new(false_hits, rays.len() as u64),
            t_ulp: Spread::of(&mut t_ulp),
            off_surface: Spread::of(&mut off_surface),
            normal_angle: Spread::of(&mut normal_angle),
            dominated: false,
        });
    }
    let cost = |row: &SphereRow| Cost::of_time(row.ns_per_ray, [&row.misses, &row.false_hits].map(Range::of_rate));
    let dominated = dominated(&rows.iter().map(cost).collect::<Vec<_>>());
    rows.iter_mut().zip(dominated).for_each(|(row, dominated)| row.dominated = dominated);
    Ok(rows)
}

/// Rays from around zero through a disc about the sphere, or through a narrow ring at its outline.
fn rays(group: Group, center: Vec3, count: usize) -> Vec<Ray> {
    let mut random = Random::new(SEED, 0x7370_6865 + group as u64);
    let ray = |_| {
        let origin = (random.in_cube() * 0.5).as_vec3();
        let to_center = center.as_dvec3() - origin.as_dvec3();
        let (across, up) = basis(normalize(to_center).unwrap_or(DVec3::Z));
        let turn = std::f64::consts::TAU * random.unit();
        let radius = match group {
            Group::Generic => 1.5 * random.unit().sqrt(),
            // The outline is seen a little outside the disc through the centre.
            Group::Adversarial => {
                let squared = dot(to_center, to_center);
                (squared / (squared - 1.0)).sqrt() * (1.0 + 1e-6 * random.between(-1.0, 1.0))
            }
        };
        let aim = to_center + (across * libm::cos(turn) + up * libm::sin(turn)) * radius;
        Ray::new(origin, aim.as_vec3())
    };
    (0..count).map(ray).collect()
}

/// Where each ray exactly enters the sphere.
fn truths(center: Vec3, rays: &[Ray], progress: &dyn Progress) -> Result<Vec<Option<f64>>> {
    let transform = DAffine3::from_translation(center.as_dvec3());
    let object = Object { name: "sphere".into(), shape: Shape::Quadric(0), transform, material: Some(0) };
    let scene = Scene { quadrics: vec![shapes::sphere()], objects: vec![object], ..Scene::default() };
    let oracle = Oracle::new(&scene)?;
    rays.par_iter()
        .map(|ray| {
            progress.check()?;
            Ok(oracle.closest(ray).map(|hit| hit.t.to_f64()))
        })
        .collect()
}

/// Nanoseconds a ray.
fn time(sphere: &Sphere, rays: &[Ray], repetitions: u32, progress: &dyn Progress) -> Result<Vec<Option<Median>>> {
    if repetitions == 0 || rays.is_empty() {
        return Ok(vec![None; SphereTest::ALL.len()]);
    }
    let mut work = SphereTest::ALL.map(|test| {
        move || {
            for ray in rays {
                std::hint::black_box(test.intersect(sphere, ray));
            }
        }
    });
    let mut pieces: Vec<&mut dyn FnMut()> = Vec::new();
    for work in &mut work {
        pieces.push(work);
    }
    let seconds = interleaved(&mut pieces, repetitions, progress)?;
    let each = 1e9 / rays.len() as f64;
    Ok(seconds.into_iter().map(|seconds| Some(seconds.times(each))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn the_textbook_fails_far_away_and_ours_does_not() {
        let rows = measure(500, Effort { rays_timed: 0, repetitions: 0 }, &Silent).unwrap();
        assert_eq!(rows.len(), 2 * 4 * 3);
        for row in rows.iter().filter(|row| row.default) {
            assert_eq!((row.misses.wrong, row.false_hits.wrong), (0, 0), "{row:?}");
            assert!(row.t_ulp.max <= 0.5000001, "{row:?}");
        }
        let textbook = rows.iter().filter(|row| row.name == SphereTest::Textbook.name() && row.distance >= 1e5);
        assert!(
            textbook.clone().count() == 4 && textbook.clone().all(|row| row.misses.wrong + row.false_hits.wrong > 25)
        );
    }
}
