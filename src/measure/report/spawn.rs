//! Where rays that leave a surface start: the time it takes against meeting that surface again.

use glam::{DVec3, Vec3};

use super::subject::{Subject, of_mesh};
use crate::accel::Params;
use crate::error::Result;
use crate::geometry::{Hit, Ray, TriangleMesh};
use crate::math::random::Random;
use crate::math::vector::{cross, dot, length, normalize};
use crate::measure::report::query::Effort;
use crate::measure::report::rays::SEED;
use crate::measure::scenes::ulp;
use crate::measure::speed::interleaved;
use crate::measure::statistics::Median;
use crate::measure::sweep::{Cost, Range, Rate, dominated};
use crate::measure::variants::spawn::Spawn;
use crate::progress::Progress;
use crate::render::Renderer;

/// One way to start rays at one place.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SpawnRow {
    /// Where the surface and the camera are.
    pub place: &'static str,
    /// The way.
    pub name: &'static str,
    /// Whether it is the renderer's.
    pub default: bool,
    /// Nanoseconds to find a start, all that belongs to it included; null if not timed.
    pub ns_per_start: Option<Median>,
    /// Rays away from a triangle that met it again.
    pub self_hits: Rate,
    /// Starts on the far side of their triangle's plane.
    pub below: Rate,
    /// Mean height of the start above the triangle, in f32 ulp of the place's largest coordinate.
    pub mean_clearance_ulp: f64,
    /// Whether another way is no slower and has no more self-hits or starts below, and is better in one.
    pub dominated: bool,
}

/// A surface seen from somewhere.
struct Place {
    name: &'static str,
    renderer: Renderer,
    /// Rays, what they hit, and where a ray from there may go: a point's direction on its side of the surface.
    starts: Vec<(Ray, Hit, Vec3)>,
}

/// How many sizes of the scene "far" is: what is a thousandth of the scene survives in f32 there.
const FAR: f64 = 1e3;

impl Place {
    /// Sees a mesh from points around its box moved by `from`, after moving the mesh by `by`.
    fn new(
        name: &'static str,
        mesh: &TriangleMesh,
        by: DVec3,
        from: DVec3,
        count: usize,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut moved = mesh.clone();
        if by != DVec3::ZERO {
            moved.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() + by).as_vec3());
            moved = moved.finish()?;
        }
        let live: Vec<u32> = moved.live_triangles().collect();
        let bounds = moved.bounds();
        let renderer = Renderer::build(of_mesh(moved), &Params::default(), progress)?;
        let mesh = &renderer.scene().meshes[0];
        let mut random = Random::new(SEED, 0x7370_6177);
        let mut starts = Vec::with_capacity(count);
        let around = bounds.center() + from;
        for _ in 0..count {
            progress.check()?;
            let [a, b, c] = mesh.triangle(live[random.below(live.len() as u64) as usize]).map(|p| p.as_dvec3());
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let target = a * (1.0 - u - v) + b * u + c * v;
            let origin = (around + random.in_cube() * length(bounds.size())).as_vec3();
            let ray = Ray::new(origin, (target - origin.as_dvec3()).as_vec3());
            let hit = renderer.closest(&ray);
            if !hit.is_hit() {
                continue;
            }
            let normal = outward(mesh, &ray, hit.primitive);
            let away = random.direction();
            let away = if dot(away, normal) < 0.0 { -away } else { away };
            starts.push((ray, hit, away.as_vec3()));
        }
        Ok(Self { name, renderer, starts })
    }

    fn mesh(&self) -> &TriangleMesh {
        &self.renderer.scene().meshes[0]
    }

    /// The start that a way chooses, and the smallest t that counts.
    fn start(&self, way: Spawn, (ray, hit, _): &(Ray, Hit, Vec3)) -> (Vec3, f32) {
        way.start(self.renderer.scene(), self.renderer.world(), ray, hit)
    }

    /// Self-hits, starts below, the sum of clearances.
    fn count(&self, way: Spawn, progress: &dyn Progress) -> Result<(u64, u64, f64)> {
        let (mut again, mut below, mut clearance) = (0, 0, 0.0);
        for start in &self.starts {
            progress.check()?;
            let (origin, t_min) = self.start(way, start);
            let (ray, hit, away) = start;
            let spawned = Ray { t_min, ..Ray::new(origin, *away) };
            again += u64::from(self.renderer.closest(&spawned).primitive == hit.primitive);
            let corner = self.mesh().triangle(hit.primitive)[0].as_dvec3();
            let height = dot(origin.as_dvec3() - corner, outward(self.mesh(), ray, hit.primitive));
            below += u64::from(height < 0.0);
            clearance += height / ulp(f64::from(origin.abs().max_element()));
        }
        Ok((again, below, clearance))
    }
}

/// The unit normal of a triangle on the side that a ray comes from.
fn outward(mesh: &TriangleMesh, ray: &Ray, triangle: u32) -> DVec3 {
    let [a, b, c] = mesh.triangle(triangle).map(|corner| corner.as_dvec3());
    let normal = normalize(cross(b - a, c - a)).unwrap_or_default();
    if dot(normal, ray.direction.as_dvec3()) > 0.0 { -normal } else { normal }
}

/// Compares all ways to start rays on a subject where it is, far from the origin, and seen from far away, with `count`
/// rays at most, of which the first ones are timed.
///
/// # Errors
/// A cancellation.
pub fn measure(subject: &Subject, count: usize, effort: Effort, progress: &dyn Progress) -> Result<Vec<SpawnRow>> {
    let mesh = subject.mesh();
    let size = length(mesh.bounds().size());
    let far = DVec3::new(0.6, -0.48, 0.64) * (FAR * size);
    let places = [
        Place::new("as given", mesh, DVec3::ZERO, DVec3::ZERO, count, progress)?,
        Place::new("a thousand sizes from zero", mesh, far, DVec3::ZERO, count, progress)?,
        Place::new("seen from a thousand sizes away", mesh, DVec3::ZERO, far, count, progress)?,
    ];
    let mut rows = Vec::new();
    for place in &places {
        let times = time(place, effort, progress)?;
        let mut own = Vec::new();
        for (way, ns_per_start) in Spawn::ALL.into_iter().zip(times) {
            let (again, below, clearance) = place.count(way, progress)?;
            let total = place.starts.len() as u64;
            own.push(SpawnRow {
                place: place.name,
                name: way.name(),
                default: way == Spawn::ErrorBound,
                ns_per_start,
                self_hits: Rate::new(again, total),
                below: Rate::new(below, total),
                mean_clearance_ulp: clearance / total as f64,
                dominated: false,
            });
        }
        let cost = |row: &SpawnRow| Cost::of_time(row.ns_per_start, [&row.self_hits, &row.below].map(Range::of_rate));
        let dominated = dominated(&own.iter().map(cost).collect::<Vec<_>>());
        own.iter_mut().zip(dominated).for_each(|(row, dominated)| row.dominated = dominated);
        rows.extend(own);
    }
    Ok(rows)
}

/// Nanoseconds a start.
fn time(place: &Place, effort: Effort, progress: &dyn Progress) -> Result<Vec<Option<Median>>> {
    let Effort { rays_timed, repetitions } = effort;
    let starts = &place.starts[..rays_timed.min(place.starts.len())];
    if repetitions == 0 || starts.is_empty() {
        return Ok(vec![None; Spawn::ALL.len()]);
    }
    let mut work = Spawn::ALL.map(|way| {
        move || {
            for start in starts {
                std::hint::black_box(place.start(way, start));
            }
        }
    });
    let mut pieces: Vec<&mut dyn FnMut()> = Vec::new();
    for work in &mut work {
        pieces.push(work);
    }
    progress.begin("time", u64::from(repetitions + 1) * Spawn::ALL.len() as u64);
    let seconds = interleaved(&mut pieces, repetitions, progress)?;
    let each = 1e9 / starts.len() as f64;
    Ok(seconds.into_iter().map(|seconds| Some(seconds.times(each))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::report::subject::HardSet;
    use crate::progress::Silent;

    const UNTIMED: Effort = Effort { rays_timed: 0, repetitions: 0 };

    #[test]
    fn flat_meshes_are_seen_from_outside_their_plane() {
        let rows = measure(&Subject::hard(HardSet::Grid), 500, UNTIMED, &Silent).unwrap();
        assert!(rows.iter().all(|row| row.self_hits.total > 100 && row.mean_clearance_ulp.is_finite()), "{rows:?}");
    }

    #[test]
    fn fixed_distances_fail_away_from_zero_and_the_error_bound_does_not() {
        let rows = measure(&Subject::hard(HardSet::Sphere), 4000, UNTIMED, &Silent).unwrap();
        let found = |place: &str, way: Spawn| {
            rows.iter().find(|row| row.place.starts_with(place) && row.name == way.name()).unwrap()
        };
        for place in ["as given", "a thousand", "seen from"] {
            let ours = found(place, Spawn::ErrorBound);
            assert_eq!((ours.self_hits.wrong, ours.below.wrong), (0, 0), "{place}");
            assert!(ours.mean_clearance_ulp > 0.0 && ours.mean_clearance_ulp < 64.0, "{ours:?}");
        }
        assert!(found("a thousand", Spawn::FixedStart).self_hits.wrong > 400);
        assert!(found("a thousand", Spawn::FixedOffset).self_hits.wrong > 400);
        // Its authors say so: the point must come from the barycentrics.
        assert!(found("seen from", Spawn::IntegerOffset).self_hits.wrong > 400);
        assert_eq!(found("seen from", Spawn::IntegerOffsetBarycentric).self_hits.wrong, 0);
    }
}
