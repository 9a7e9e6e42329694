//! Shadows and mirrors against closed forms, at any scale and any distance from zero.
//!
//! Four questions about a scene of size `scale` that stands `distance` away from the origin of its file: does a convex
//! surface shade itself (acne), does light pass through a closed wall (leaks), how near to a contact does a shadow
//! reach, and where is a ray after many mirrors? Shapes are unit shapes placed by f64 transforms and lights stand at
//! f64 positions, as in a scene file; the scene's origin is what a loader would choose. What is expected is computed
//! from the numbers that such a file can hold: at a distance of 1e7 neighbouring f64 positions are 2e-9 apart, which
//! is 2e-3 of a scene of size 1e-6, and no renderer can know better.

use glam::{DVec3, Vec3};

use crate::accel::Params;
use crate::error::Result;
use crate::geometry::quadric::Clip;
use crate::geometry::{Hit, Quadric, shapes};
use crate::math::random::Random;
use crate::math::vector::{cross, dot};
use crate::measure::cases::meshes;
use crate::measure::scenes::{self, largest, ulp};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::{Falloff, Light, LightKind, Rgb};

/// The scales of the full sweep.
pub const SCALES: [f64; 7] = [1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6];

/// The distances of the full sweep.
pub const DISTANCES: [f64; 5] = [0.0, 1.0, 1e3, 1e5, 1e7];

/// How often the ray of [`LightPaths::position_error`] is reflected.
pub const BOUNCES: u32 = 20;

/// What was found at one scale and distance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LightPaths {
    /// Size of the scene: the radius of its sphere, the half side of its cube, the gap between its mirrors.
    pub scale: f64,
    /// How far its middle is from the file's zero.
    pub distance: f64,
    /// Pairs of a lit point of a sphere (of triangles, and as a quadric) and a light.
    pub lit: u64,
    /// How many of them were black: the surface shaded itself.
    pub acne: u64,
    /// Points beyond a closed cube around the light, on lines through its edges, corners and faces.
    pub walled: u64,
    /// How many of them were lit.
    pub leaks: u64,
    /// The largest distance from the contact of an open bowl with its floor, in radii of the bowl, at which the shadow
    /// under it was lost; 0 if it never was.
    pub contact_gap: f64,
    /// What [`contact_gap`](Self::contact_gap) may be: where the bowl is 16 ulp above the floor.
    pub contact_gap_bound: f64,
    /// The largest error of a mirror ray's place, in f32 ulp of the scene's coordinates.
    pub position_error: f64,
    /// The same divided by the number of mirrors up to there.
    pub position_error_per_bounce: f64,
}

impl LightPaths {
    /// The largest [`position_error_per_bounce`](Self::position_error_per_bounce) that passes.
    pub const POSITION_ERROR_BAR: f64 = 4.0;

    /// Whether there is no acne and no leak, and both lengths are within their bounds.
    pub fn passes(&self) -> bool {
        self.lit > 0
            && self.acne == 0
            && self.walled > 0
            && self.leaks == 0
            && self.contact_gap <= self.contact_gap_bound
            && self.position_error_per_bounce <= Self::POSITION_ERROR_BAR
    }
}

/// A unit shape's place in the file, and relative to the scene's origin once that is known.
#[derive(Debug, Clone, Copy)]
struct Place {
    scale: f64,
    offset: DVec3,
}

impl Place {
    /// Along no axis and no diagonal.
    fn new(scale: f64, distance: f64) -> Self {
        Self { scale, offset: DVec3::new(0.48, -0.6, 0.64) * distance }
    }

    fn at(&self, p: DVec3) -> DVec3 {
        self.offset + p * self.scale
    }

    /// A file's position in units of the shape: exact but for one division.
    fn units(&self, position: DVec3) -> DVec3 {
        (position - self.offset) / self.scale
    }

    /// Where a point of the shape is for the renderer.
    fn seen(&self, renderer: &Renderer, p: DVec3) -> DVec3 {
        (self.offset - renderer.scene().origin) + p * self.scale
    }
}

/// Measures a scene of that size and place with `count` points for acne and as many for leaks.
///
/// # Errors
/// A cancellation, or a build that was refused.
pub fn measure(params: &Params, scale: f64, distance: f64, count: u64, progress: &dyn Progress) -> Result<LightPaths> {
    let place = Place::new(scale, distance);
    let (lit, acne) = acne(params, &place, count, progress)?;
    let (walled, leaks) = leaks(params, &place, count, progress)?;
    let (contact_gap, contact_gap_bound) = contact_gap(params, &place, progress)?;
    let (position_error, position_error_per_bounce) = position_error(params, &place, progress)?;
    Ok(LightPaths {
        scale,
        distance,
        lit,
        acne,
        walled,
        leaks,
        contact_gap,
        contact_gap_bound,
        position_error,
        position_error_per_bounce,
    })
}

/// Points between two looks at whether to go on.
const POINTS_PER_CHECK: u64 = 4096;

/// Lit points of a sphere and how many of them are black, half of them on triangles and half on a quadric.
fn acne(params: &Params, place: &Place, count: u64, progress: &dyn Progress) -> Result<(u64, u64)> {
    // One light a channel, far and near, so that every angle to the surface occurs.
    let lights = [DVec3::new(300.0, 200.0, -100.0), DVec3::new(-2.0, 3.0, 1.5), DVec3::new(0.2, -1.2, 0.9)];
    let ball = meshes::sphere(24, 48, 1.0, DVec3::ZERO);
    let (mut lit, mut black) = (0, 0);
    for as_mesh in [true, false] {
        let mut scene = scenes::empty();
        let transform = scenes::placed(place.offset, place.scale);
        if as_mesh {
            scenes::add_mesh(&mut scene, ball.clone(), transform, scenes::white());
        } else {
            scenes::add_quadric(&mut scene, shapes::sphere(), transform, scenes::white());
        }
        for (light, color) in lights.iter().zip([Rgb::X, Rgb::Y, Rgb::Z]) {
            let kind = LightKind::Point { position: place.at(*light), falloff: Falloff::None };
            scene.lights.push(Light { name: "lamp".into(), kind, color });
        }
        let lamps = lights.map(|light| place.units(place.at(light)));
        let renderer = scenes::build(scene, params, progress)?;
        let mut random = Random::new(0x6163_6e65, u64::from(as_mesh));
        for number in 0..count.div_ceil(2) {
            if number % POINTS_PER_CHECK == 0 {
                progress.check()?;
            }
            let target = random.direction();
            let from = target * random.between(1.5, 20.0);
            let seen = scenes::see(&renderer, place.seen(&renderer, from), -target);
            if !seen.hit.is_hit() {
                continue;
            }
            let (normal, height) = if as_mesh {
                let [a, b, c] = ball.triangle(seen.hit.primitive).map(Vec3::as_dvec3);
                let normal = cross(b - a, c - a);
                (normal, dot(normal, a))
            } else {
                (target, 1.0)
            };
            for (channel, lamp) in lamps.iter().enumerate() {
                // A convex surface is lit wherever the lamp stands above it; by less than f64 can tell does not count.
                if dot(normal, *lamp) - height > 1e-9 * largest(normal) * largest(*lamp) {
                    lit += 1;
                    black += u64::from(seen.color[channel] == 0.0);
                }
            }
        }
    }
    Ok((lit, black))
}

/// Points of a room around a closed cube around the light, each on a line from the light through an edge, a corner or
/// a face of the cube, and how many of them are lit.
fn leaks(params: &Params, place: &Place, count: u64, progress: &dyn Progress) -> Result<(u64, u64)> {
    let mut scene = scenes::empty();
    let transform = scenes::placed(place.offset, place.scale);
    let cube = meshes::moved(&meshes::cube(), |p| p * 2.0 - 1.0);
    scenes::add_mesh(&mut scene, cube, transform, scenes::white());
    let room = scenes::placed(place.offset, 20.0 * place.scale);
    scenes::add_quadric(&mut scene, shapes::sphere(), room, scenes::white());
    let lamp = DVec3::new(0.3, -0.2, 0.1);
    scenes::add_light(&mut scene, place.at(lamp));
    let lamp = place.units(place.at(lamp));
    let renderer = scenes::build(scene, params, progress)?;
    let mut random = Random::new(0x6c65_616b, 0);
    let (mut walled, mut lit) = (0, 0);
    for number in 0..count {
        if number % POINTS_PER_CHECK == 0 {
            progress.check()?;
        }
        let mut target = random.in_cube();
        // A face, an edge or a corner.
        for axis in 0..1 + number as usize % 3 {
            target[(number as usize / 3 + axis) % 3] = 1f64.copysign(target[(number as usize / 3 + axis) % 3]);
        }
        let along = target - lamp;
        let seen = scenes::see(&renderer, place.seen(&renderer, lamp + along * random.between(1.2, 3.0)), along);
        walled += 1;
        lit += u64::from(seen.hit.instance != 1 || seen.counts.shadow != 1 || seen.color != Rgb::ZERO);
    }
    Ok((walled, lit))
}

/// How far from its contact with the floor an open bowl, lit from above, still loses its shadow, in its radii; and how
/// far it may.
fn contact_gap(params: &Params, place: &Place, progress: &dyn Progress) -> Result<(f64, f64)> {
    // Four steps an octave down to where the bowl is 2^-41 of its radius above the floor.
    const STEPS: i32 = 80;
    let (mut gap, mut bound) = (0.0f64, 0.0f64);
    for as_mesh in [false, true] {
        let mut scene = scenes::empty();
        let transform = scenes::placed(place.offset, place.scale);
        let floor = if as_mesh {
            let (points, indices) =
                scenes::rectangle_points(DVec3::new(-4.0, 0.0, 4.0), DVec3::X * 9.0, DVec3::Z * -9.0);
            scenes::add_mesh(&mut scene, scenes::mesh_at(&points, indices)?, transform, scenes::white())
        } else {
            scenes::add_quadric(&mut scene, shapes::plane(Some(4.0)), transform, scenes::white())
        };
        // x^2 + (y - 1)^2 + z^2 = 1 below y = 1: in the same frame as the floor, so that they touch exactly.
        let coefficients = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0];
        let bowl = Quadric::new(coefficients, Some(Clip::between(0.0, 1.0)), false)?;
        scenes::add_quadric(&mut scene, bowl, transform, scenes::black());
        scenes::add_light(&mut scene, place.at(DVec3::Y * 10.0));
        let renderer = scenes::build(scene, params, progress)?;
        for step in 0..STEPS {
            let radius = libm::exp2(-0.25 * f64::from(step));
            for turn in 0..8 {
                let (sin, cos) = libm::sincos(f64::from(turn) * 0.8);
                let point = DVec3::new(radius * cos, 0.0, radius * sin);
                let position = place.seen(&renderer, point);
                // Seen from straight above, as if the bowl were not in the way.
                let above = place.seen(&renderer, point + DVec3::Y);
                let primitive = if as_mesh { u32::from(point.x + 4.0 < 4.0 - point.z) } else { 0 };
                let hit = Hit { t: 1.0, u: 0.0, v: 0.0, instance: floor, primitive };
                let seen = scenes::shade(&renderer, above, position - above, &hit);
                if seen.color != Rgb::ZERO || seen.counts.shadow != 1 {
                    gap = gap.max(radius);
                }
            }
        }
        let coordinate = largest(place.seen(&renderer, DVec3::ZERO)) + 4.0 * place.scale;
        bound = bound.max((2.0 * 16.0 * ulp(coordinate) / place.scale).sqrt());
    }
    Ok((gap, bound))
}

/// The largest error of a ray between two mirrors, in ulp, and the largest per mirror met.
fn position_error(params: &Params, place: &Place, progress: &dyn Progress) -> Result<(f64, f64)> {
    let wall = |x: f64, up: f64| {
        scenes::rectangle_points(DVec3::new(x, -40.0, -40.0 * up), DVec3::Y * 80.0, DVec3::Z * 80.0 * up)
    };
    let (mut points, mut indices) = wall(0.0, 1.0);
    let (others, more) = wall(1.0, -1.0);
    indices.extend(more.iter().map(|corners| corners.map(|i| i + points.len() as u32)));
    points.extend(others);
    let mut scene = scenes::empty();
    scenes::add_mesh(
        &mut scene,
        scenes::mesh_at(&points, indices)?,
        scenes::placed(place.offset, place.scale),
        scenes::mirror(1.0, 0.0),
    );
    scene.film.max_depth = BOUNCES;
    let renderer = scenes::build(scene, params, progress)?;
    let mut random = Random::new(0x626f_756e, 0);
    let (mut worst, mut worst_each) = (0.0f64, 0.0f64);
    for _ in 0..200 {
        progress.check()?;
        let start = DVec3::new(random.between(0.1, 0.9), random.between(-1.0, 1.0), random.between(-1.0, 1.0));
        let slope = DVec3::new(1.0, random.between(-1.5, 1.5), random.between(-1.5, 1.5));
        let (rays, _) = scenes::path(&renderer, place.seen(&renderer, start), slope);
        if rays.len() != BOUNCES as usize + 1 {
            return Ok((f64::INFINITY, f64::INFINITY));
        }
        for (bounce, ray) in rays.iter().enumerate().skip(1) {
            // Unfolded, the path is straight.
            let run = bounce as f64 - start.x;
            let x = (bounce % 2) as f64;
            let expected = place.seen(&renderer, (start + slope * run).with_x(x));
            // Off the mirror a ray begins where rounding may not put it behind; along the mirror it must be right.
            let error = largest((ray.origin.as_dvec3() - expected).with_x(0.0)) / ulp(largest(expected));
            worst = worst.max(error);
            worst_each = worst_each.max(error / bounce as f64);
        }
    }
    Ok((worst, worst_each))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn size_and_place_do_not_matter() {
        for scale in SCALES {
            for distance in DISTANCES {
                let found = measure(&Params::default(), scale, distance, 300, &Silent).unwrap();
                assert!(found.passes() && found.lit > 200, "{found:?}");
                // No f32 is farther from a number than half a step.
                assert!(found.position_error >= 0.4 && found.contact_gap_bound < 0.1, "{found:?}");
            }
        }
    }
}
