//! The exposure of scenes whose lights are in physical units, where 1 is no natural brightness.

use glam::DVec3;

use crate::math::vector::{dot, normalize};
use crate::scene::{Falloff, Light, LightKind, Scene};
use crate::scene::{luminance, outline};

/// How bright the lights together shall make a surface that faces them: a little less than the studio lights of a bare
/// model, since there is room above for highlights and for surfaces near a lamp.
const TARGET: f64 = 1.0;

/// The exposure, in powers of two, that brings what the scene's surface typically receives to a common brightness,
/// rounded to eighths; 0 where no light reaches it.
///
/// Typical is the median over the surface's points: it does not care about the few next to a lamp, nor the many in the
/// dark behind a spot. Shadows and the surface's direction are left out.
pub fn automatic(scene: &Scene) -> f32 {
    let received = |p: DVec3| scene.lights.iter().map(|light| irradiance(light, p)).sum::<f64>();
    let mut values: Vec<f64> =
        outline::sample(scene).into_iter().map(received).filter(|&e| e > 0.0 && e.is_finite()).collect();
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let exposure = libm::log2(TARGET / *median);
    ((exposure * 8.0).round() / 8.0).clamp(-64.0, 64.0) as f32
}

/// What a surface at `p` that faces the light receives.
fn irradiance(light: &Light, p: DVec3) -> f64 {
    let weakened = |position: DVec3, falloff| match falloff {
        Falloff::None => 1.0,
        Falloff::InverseSquare => 1.0 / dot(p - position, p - position),
    };
    let share = match light.kind {
        LightKind::Directional { .. } => 1.0,
        LightKind::Point { position, falloff } => weakened(position, falloff),
        LightKind::Spot { position, direction, outer_angle, falloff, .. } => {
            let cosine = normalize(direction).zip(normalize(p - position)).map_or(0.0, |(axis, to)| dot(axis, to));
            if cosine > libm::cos(outer_angle) { weakened(position, falloff) } else { 0.0 }
        }
    };
    share * luminance(light.color)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes;
    use crate::scene::{Object, Rgb, Shape};
    use glam::DAffine3;

    /// A unit sphere far from the origin, 100 away along z from where lights stand.
    fn lit_by(kind: LightKind, intensity: f32) -> f32 {
        let transform = DAffine3::from_translation(DVec3::Z * 100.0);
        let object = Object { name: String::new(), shape: Shape::Quadric(0), transform, material: Some(0) };
        let light = Light { name: String::new(), kind, color: Rgb::splat(intensity) };
        let scene = Scene {
            quadrics: vec![shapes::sphere()],
            objects: vec![object],
            lights: vec![light],
            ..Default::default()
        };
        automatic(&scene)
    }

    #[test]
    fn the_surface_receives_about_one() {
        let (position, falloff) = (DVec3::ZERO, Falloff::InverseSquare);
        assert_eq!(lit_by(LightKind::Directional { direction: DVec3::X }, 1024.0), -10.0, "1024 lux");
        assert_eq!(lit_by(LightKind::Point { position, falloff: Falloff::None }, 0.25), 2.0);
        assert_eq!(lit_by(LightKind::Point { position, falloff }, 80_000.0), -3.0, "80000 candela at 100 metres");
        let spot = |direction| LightKind::Spot { position, direction, inner_angle: 0.0, outer_angle: 0.2, falloff };
        assert_eq!(lit_by(spot(DVec3::Z), 80_000.0), -3.0);
        assert_eq!(lit_by(spot(DVec3::X), 80_000.0), 0.0, "it shines past");
    }
}
