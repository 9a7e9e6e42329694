//! The accuracy plane: time a ray against the error of hits on the right triangle.

use glam::DVec3;

use super::choices::{Choice, Label};
use super::judge::{Judge, Truth};
use super::query::{Asked, QueryRow};
use crate::geometry::{Hit, Ray, TriangleMesh};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::vector::{cross, dot, length};
use crate::measure::ray_set::{Answered, Group, Question};
use crate::measure::scenes::ulp;
use crate::measure::statistics::{Median, quantile};
use crate::measure::sweep::{Cost, Range, dominated};

/// One choice's errors on the hits of one group of rays.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct AccuracyRow {
    /// Which rays.
    pub group: Group,
    /// What answered.
    #[serde(flatten)]
    pub label: Label,
    /// Nanoseconds a ray, the mean of the medians of the group's sets; null if not timed.
    pub ns_per_ray: Option<Median>,
    /// Hits on the exact triangle, of which the errors are.
    pub hits: usize,
    /// |t - exact| in f32 ulp of the exact t.
    pub t_ulp: Spread,
    /// |t - exact| |d| |cos| / (u max(|o|, |v - o|)): without what grazing and distance make unavoidable.
    pub t_normalized: Spread,
    /// The larger error of the two barycentrics.
    pub barycentric: Spread,
    /// Radians between the smooth normals at the given and at the exact barycentrics.
    pub normal_angle: Spread,
    /// Whether another choice is no slower and has no larger 99.99 % quantile of the normalised error, and is better
    /// in one.
    pub dominated: bool,
}

/// Quantiles of an error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Half are at most this.
    pub p50: f64,
    /// 99 % are at most this.
    pub p99: f64,
    /// 99.99 % are at most this.
    pub p99_99: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// The quantiles of some values, which are sorted on the way.
    pub fn of(values: &mut [f64]) -> Self {
        let [p50, p99, p99_99, max] = [0.5, 0.99, 0.9999, 1.0].map(|q| quantile(values, q));
        Self { p50, p99, p99_99, max }
    }
}

/// Errors of one choice, one value a hit on the exact triangle.
#[derive(Debug, Default)]
struct Errors {
    t_ulp: Vec<f64>,
    t_normalized: Vec<f64>,
    barycentric: Vec<f64>,
    normal_angle: Vec<f64>,
}

/// Collects errors over sets of rays.
pub struct Accuracy<'a> {
    mesh: &'a TriangleMesh,
    judge: &'a Judge<'a>,
    /// A smooth normal a vertex, as shading would have it.
    normals: Vec<DVec3>,
    /// By choice, then group.
    errors: Vec<[Errors; 2]>,
}

impl<'a> Accuracy<'a> {
    /// Nothing collected yet.
    pub fn new(mesh: &'a TriangleMesh, judge: &'a Judge<'a>, choices: usize) -> Self {
        let mut smooth = mesh.clone();
        smooth.compute_normals();
        let normals = smooth.normals.unwrap_or_default().iter().map(|normal| normal.as_dvec3()).collect();
        Self { mesh, judge, normals, errors: (0..choices).map(|_| Default::default()).collect() }
    }

    /// Adds the hits of a set that was asked for the closest.
    pub fn add(&mut self, asked: &Asked<'_>) {
        for (choice, answers) in asked.answers.iter().enumerate() {
            let Answered::Closest(hits) = answers else { continue };
            for ((ray, truth), hit) in asked.set.rays.iter().zip(&asked.truths).zip(hits) {
                if let Some(truth) = truth.filter(|truth| truth.primitive == hit.primitive) {
                    let [t_ulp, t_normalized, barycentric, normal_angle] = self.errors_of(ray, &truth, hit);
                    let errors = &mut self.errors[choice][asked.set.group as usize];
                    errors.t_ulp.push(t_ulp);
                    errors.t_normalized.push(t_normalized);
                    errors.barycentric.push(barycentric);
                    errors.normal_angle.push(normal_angle);
                }
            }
        }
    }

    /// The four errors of a hit on the exact triangle.
    fn errors_of(&self, ray: &Ray, truth: &Truth, hit: &Hit) -> [f64; 4] {
        let off = (f64::from(hit.t) - truth.t).abs();
        let origin = ray.origin.as_dvec3();
        let corners = self.mesh.triangle(truth.primitive);
        let far = |corner: glam::Vec3| length(corner.as_dvec3() - origin);
        let reach = corners.map(far).into_iter().fold(length(origin), f64::max);
        let steepness = length(ray.direction.as_dvec3()) * self.judge.cosine(ray, truth.primitive);
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let [a, b, c] = self.mesh.indices[truth.primitive as usize].map(|vertex| self.normals[vertex as usize]);
        let normal = |u: f64, v: f64| a * (1.0 - u - v) + b * u + c * v;
        [
            off / ulp(truth.t),
            off * steepness / (UNIT_ROUNDOFF * reach),
            (u - truth.uv.0).abs().max((v - truth.uv.1).abs()),
            angle(normal(u, v), normal(truth.uv.0, truth.uv.1)),
        ]
    }

    /// A row a choice and group that has hits; `rows` are those of the query plane.
    pub fn rows(self, choices: &[Choice<'_>], rows: &[QueryRow]) -> Vec<AccuracyRow> {
        let mut by_group: [Vec<AccuracyRow>; 2] = Default::default();
        for (choice, errors) in choices.iter().zip(self.errors) {
            for (group, mut errors) in Group::ALL.into_iter().zip(errors) {
                if errors.t_ulp.is_empty() {
                    continue;
                }
                by_group[group as usize].push(AccuracyRow {
                    group,
                    label: choice.label.clone(),
                    ns_per_ray: ns_per_ray(rows, group, &choice.label.name),
                    hits: errors.t_ulp.len(),
                    t_ulp: Spread::of(&mut errors.t_ulp),
                    t_normalized: Spread::of(&mut errors.t_normalized),
                    barycentric: Spread::of(&mut errors.barycentric),
                    normal_angle: Spread::of(&mut errors.normal_angle),
                    dominated: false,
                });
            }
        }
        for rows in &mut by_group {
            let dominated = dominated(&rows.iter().map(cost).collect::<Vec<_>>());
            rows.iter_mut().zip(dominated).for_each(|(row, dominated)| row.dominated = dominated);
        }
        by_group.concat()
    }
}

/// The mean over a group's sets of closest hits, ends of intervals likewise.
fn ns_per_ray(rows: &[QueryRow], group: Group, name: &str) -> Option<Median> {
    let own = |row: &&QueryRow| row.group == group && row.question == Question::Closest && row.label.name == name;
    let speeds: Vec<Median> = rows.iter().filter(own).filter_map(|row| row.mrays_per_s).collect();
    let mean =
        |pick: fn(&Median) -> f64| speeds.iter().map(|speed| 1e3 / pick(speed)).sum::<f64>() / speeds.len() as f64;
    (!speeds.is_empty()).then(|| Median { value: mean(|m| m.value), low: mean(|m| m.high), high: mean(|m| m.low) })
}

fn cost(row: &AccuracyRow) -> Cost {
    Cost::of_time(row.ns_per_ray, [Range::exactly(row.t_normalized.p99_99); 2])
}

/// Radians between two vectors; 0 if one has no length.
pub fn angle(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(length(cross(a, b)), dot(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ulps_and_angles_follow_their_definitions() {
        assert_eq!(ulp(1.0), f64::from(f32::EPSILON));
        assert_eq!(ulp(-1.999), f64::from(f32::EPSILON));
        assert_eq!(ulp(0.0), f64::from(f32::from_bits(1)));
        assert!((angle(DVec3::X, DVec3::new(1.0, 1.0, 0.0)) - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert!((angle(DVec3::X, DVec3::new(1.0, 1e-12, 0.0)) - 1e-12).abs() < 1e-20);
    }
}
