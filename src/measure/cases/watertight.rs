//! Closed and connected surfaces let nothing through: D1, D9, D13.

use glam::{DVec3, Vec3};

use super::exact::normal;
use super::histogram::Histogram;
use super::{Answer, Case, Context, Failure, Outcome, Rays, Structure, meshes, scene_seed};
use crate::error::Result;
use crate::geometry::{Ray, TriangleMesh};
use crate::math::random::Random;
use crate::math::vector::{dot, length};
use crate::measure::oracle::Oracle;
use crate::measure::scenes::ulp;
use crate::scene::Scene;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D1",
        title: "from inside a closed sphere, at vertices, at edges and anywhere",
        bar: "0 misses in 1e8",
        run: inside_a_sphere,
    },
    Case { id: "D9", title: "a flat grid under grazing and steep rays", bar: "0 misses in 1e7", run: flat_grid },
    Case {
        id: "D13",
        title: "spheres from 1 to 1e7 away from the origin",
        bar: "0 misses in 1e8; points off the plane: o + t d by 4 ulp in 99 %, 16 ulp at most; by weights 2 ulp at most",
        run: far_spheres,
    },
];

/// Where a model stands that was not moved to the origin: metres in a map's coordinates.
pub const FAR: DVec3 = DVec3::new(148_376.0, 1_234.0, -223_423.0);

/// Half of the rays at the origin, half of them far away, where the vertices are rounded to 1/64 and coarser.
///
/// 9024 triangles: 5e5 rays on `linear`, a two hundredth, take about a minute on two cores.
fn inside_a_sphere(context: &Context<'_>) -> Result<Outcome> {
    const EACH: Rays = Rays { quick: 60_000, full: 50_000_000, linear: 200 };
    let mut sum = Outcome::default();
    for (place, center) in [(0, DVec3::ZERO), (1, FAR)] {
        let scene = meshes::scene(vec![meshes::sphere(48, 96, 2.0, center)]);
        let mesh = &scene.meshes[0];
        let certain = |_: &Oracle, ray: &Ray| is_inside(ray, center, 2.0);
        sum = sum.and(all_hit(
            context,
            &scene,
            scene_seed(0xd1, place),
            EACH,
            certain,
            |structure, random, number, outcome| {
                let ray = outward_ray(mesh, center, 1.0, random, number);
                must_hit(structure, &ray, outcome);
            },
        )?);
    }
    Ok(sum)
}

/// [`Context::ask_all`] where every ray must hit. A failure's ray is made as simple as it can be while `certain` says that
/// it must hit and it does not; the failure names the triangle that is exactly hit.
fn all_hit(
    context: &Context<'_>,
    scene: &Scene,
    seed: u64,
    rays: Rays,
    certain: impl Fn(&Oracle, &Ray) -> bool,
    body: impl Fn(&Structure, &mut Random, u64, &mut Outcome) + Sync,
) -> Result<Outcome> {
    let mut sum = Outcome::default();
    for structure in context.structures(scene) {
        let structure = structure?;
        let mut found = context.ask(&structure, seed, rays, &body)?;
        if found.failure.is_some() {
            found = blame(&structure, found, &certain)?;
        }
        sum = sum.and(found);
    }
    Ok(sum)
}

/// Simplifies a missing hit and finds its triangle.
fn blame(structure: &Structure, found: Outcome, certain: impl Fn(&Oracle, &Ray) -> bool) -> Result<Outcome> {
    let oracle = Oracle::new(structure.renderer.scene())?;
    let mut found = found.simplify(|ray, _| {
        let whole = ray.t_min == 0.0 && ray.t_max == f32::INFINITY;
        whole && certain(&oracle, ray) && !structure.ask(ray).is_hit()
    });
    if let Some(failure) = &mut found.failure
        && let Some(ray) = failure.ray
        && let Some(exact) = oracle.closest(&ray)
    {
        failure.triangle = oracle.triangle(exact.instance, exact.primitive).map(|(corners, _)| corners);
        failure.what = missing(structure, &structure.ask(&ray));
    }
    Ok(found)
}

/// Whether a ray starts well inside a sphere of triangles and leads anywhere.
fn is_inside(ray: &Ray, center: DVec3, radius: f64) -> bool {
    // The coarsest of the spheres, rounded where it stands, contains 0.98 of its radius.
    length(ray.origin.as_dvec3() - center) <= 0.97 * radius && ray.direction != Vec3::ZERO
}

/// A ray that starts within `half` of `center` per axis: at a vertex, at a point of an edge, at either along an axis, or
/// anywhere; with a direction as long as the way or normalised. `number` says which of these; it is anywhere where its
/// last three bits are set, else at a vertex where it is even.
pub fn outward_ray(mesh: &TriangleMesh, center: DVec3, half: f64, random: &mut Random, number: u64) -> Ray {
    let origin = (center + random.in_cube() * half).as_vec3();
    if number % 8 == 7 {
        return Ray::new(origin, random.direction().as_vec3());
    }
    let target = if number.is_multiple_of(2) { any_vertex(mesh, random) } else { any_edge_point(mesh, random) };
    let origin = match number % 8 {
        // Along the axis of which the target is farthest: the ray meets the target exactly.
        4 | 5 => {
            let out = (target.as_dvec3() - center).abs();
            let axis = (0..3).fold(0, |best, axis| if out[axis] > out[best] { axis } else { best });
            let mut beside = target;
            beside[axis] = origin[axis];
            beside
        }
        _ => origin,
    };
    let way = target - origin;
    let direction = if (number / 8).is_multiple_of(2) { way } else { super::unit(way) };
    Ray::new(origin, direction)
}

fn any_vertex(mesh: &TriangleMesh, random: &mut Random) -> Vec3 {
    mesh.positions[random.below(mesh.positions.len() as u64) as usize]
}

/// A point between two vertices that share a triangle, rounded.
fn any_edge_point(mesh: &TriangleMesh, random: &mut Random) -> Vec3 {
    let corners = mesh.indices[random.below(mesh.indices.len() as u64) as usize];
    let first = random.below(3) as usize;
    let [a, b] = [corners[first], corners[(first + 1) % 3]].map(|i| mesh.positions[i as usize].as_dvec3());
    (a + (b - a) * random.unit()).as_vec3()
}

/// Counts a ray that must hit, asked for the closest hit and for any.
fn must_hit(structure: &Structure, ray: &Ray, outcome: &mut Outcome) -> Answer {
    let answer = structure.ask(ray);
    outcome.check(answer.is_hit(), || Failure::of_ray(ray, missing(structure, &answer)));
    answer
}

fn missing(structure: &Structure, answer: &Answer) -> String {
    format!("{structure}: {answer}, where one is certain")
}

/// From heights of 1e-6 to 1e6 above a grid of 100 x 100 quads to points on it, most of them on its edges and vertices,
/// the grid lying across any axis.
fn flat_grid(context: &Context<'_>) -> Result<Outcome> {
    const EACH: Rays = Rays { quick: 12_000, full: 3_400_000, linear: 500 };
    // Targets keep away from the border, so that rounding the direction cannot lead a ray over it.
    const INNER: f64 = 0.875;
    let mut sum = Outcome::default();
    for axis in 0..3 {
        // Turning the axes in a circle keeps the numbers of the vertices.
        let to_world = |p: Vec3| match axis {
            0 => p,
            1 => Vec3::new(p.z, p.x, p.y),
            _ => Vec3::new(p.y, p.z, p.x),
        };
        let scene = meshes::scene(vec![meshes::moved(&meshes::grid(100), to_world)]);
        let mesh = &scene.meshes[0];
        let certain = |oracle: &Oracle, ray: &Ray| {
            oracle.closest(ray).is_some_and(|exact| {
                let p = ray.origin.as_dvec3() + ray.direction.as_dvec3() * exact.t.to_f64();
                p.abs().max_element() <= INNER
            })
        };
        let seed = scene_seed(0xd9, axis);
        sum = sum.and(all_hit(context, &scene, seed, EACH, certain, |structure, random, number, outcome| {
            // The rays are drawn over the plane z = 0 and turned with the grid.
            let flat = |random: &mut Random, half: f64| {
                to_world(Vec3::new(random.between(-half, half) as f32, random.between(-half, half) as f32, 0.0))
            };
            let target = loop {
                let target = match number % 3 {
                    0 => any_vertex(mesh, random),
                    1 => any_edge_point(mesh, random),
                    _ => flat(random, 1.0),
                };
                if target.as_dvec3().abs().max_element() <= INNER {
                    break target;
                }
            };
            let height = libm::pow(10.0, random.between(-6.0, 6.0)) * if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
            let origin = flat(random, 3.0) + to_world(Vec3::new(0.0, 0.0, height as f32));
            must_hit(structure, &Ray::new(origin, target - origin), outcome);
        })?);
    }
    Ok(sum)
}

/// Icospheres about (10^k, -10^k, 10^k) for k from 0 to 7, seen from inside. Their radius is 1, or 1e-4 of the distance
/// where that is more: vertices of a smaller one would coincide.
///
/// A hit's point is computed in f32 as users do: from t, and from u and v. Its distance from the plane is counted in ulp
/// of the largest coordinate of the point, and of the ray's origin for the former; its quantile is that of each distance and
/// kind of structure by itself.
fn far_spheres(context: &Context<'_>) -> Result<Outcome> {
    const EACH: Rays = Rays { quick: 9_000, full: 12_500_000, linear: 30 };
    let mut sum = Outcome::default();
    for k in 0..8u32 {
        let distance = libm::pow(10.0, f64::from(k));
        let (center, radius) = (DVec3::new(distance, -distance, distance), f64::max(1.0, 1e-4 * distance));
        let scene = meshes::scene(vec![meshes::icosphere(3, radius, center)]);
        let mesh = &scene.meshes[0];
        let along: Vec<Histogram> = context.kinds.iter().map(|_| Histogram::default()).collect();
        let certain = |_: &Oracle, ray: &Ray| is_inside(ray, center, radius);
        let seed = scene_seed(0xd13, u64::from(k));
        sum = sum.and(all_hit(context, &scene, seed, EACH, certain, |structure, random, number, outcome| {
            let ray = outward_ray(mesh, center, 0.5 * radius, random, number);
            let answer = must_hit(structure, &ray, outcome);
            if !answer.is_hit() {
                return;
            }
            let hit = answer.hit;
            let corners = mesh.triangle(hit.primitive);
            let normal = normal(corners);
            let off = |p: Vec3| dot(normal, p.as_dvec3() - corners[0].as_dvec3()).abs();
            let p = ray.origin + ray.direction * hit.t;
            let largest = p.abs().max_element().max(ray.origin.abs().max_element());
            let error = off(p) / ulp(largest.into());
            let kind = context.kinds.iter().position(|kind| *kind == structure.params.kind);
            if let Some(kind) = kind {
                along[kind].add(error);
            }
            outcome.figure("o + t d off the plane, in ulp, at most", error, Some(16.0));
            let [a, b, c] = corners;
            let p = a + (b - a) * hit.u + (c - a) * hit.v;
            let error = off(p) / ulp(p.abs().max_element().into());
            outcome.figure("A + u (B - A) + v (C - A) off the plane, in ulp, at most", error, Some(2.0));
        })?);
        // One for each distance, the largest of all kinds.
        for histogram in along {
            let name = format!("o + t d off the plane, in ulp, 99 % of rays, at 1e{k}");
            sum.figure(name, histogram.quantile(0.99), Some(4.0));
        }
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Params;
    use crate::progress::Silent;

    #[test]
    fn failures_get_a_short_ray_and_the_triangle_that_it_meets() {
        let scene = meshes::scene(vec![meshes::square()]);
        let structure = Structure::build(&scene, Params::default(), &Silent).unwrap();
        // As if a hit were certain that the interval, which must not change, excludes; the ray may pass the square too.
        let mut found = Outcome::default();
        let ray = Ray { t_max: 0.5, ..Ray::new(Vec3::new(0.3, 0.7, 3.3), Vec3::new(0.001, 0.002, -1.1)) };
        found.check(false, || Failure::of_ray(&ray, "none"));
        let kept = blame(&structure, found.clone(), |_, _| true).unwrap().failure.unwrap();
        assert_eq!((kept.ray, kept.triangle), (Some(ray), None));
        found.failure = Some(Failure::of_ray(&Ray::new(Vec3::new(0.3, 7.7, 3.3), ray.direction), "none"));
        let kept = blame(&structure, found, |_, ray| ray.origin.y > 5.0 && ray.direction.z < 0.0).unwrap();
        let ray = kept.failure.unwrap().ray.unwrap();
        assert_eq!((ray.origin, ray.direction), (Vec3::new(0.0, 6.0, 0.0), Vec3::NEG_Z));
        let through = Ray::new(Vec3::new(0.25, 0.5, 1.0), Vec3::NEG_Z);
        let mut found = Outcome::default();
        found.check(false, || Failure::of_ray(&through, "none"));
        assert!(blame(&structure, found, |_, _| true).unwrap().failure.unwrap().triangle.is_some());
    }
}
