//! `Si` in the shading formula: how a light reaches a point, and what stands between.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::math::vector::{dot, normalize};
use crate::render::answers::{Answers, Meeting};
use crate::render::surface::SurfacePoint;
use crate::render::trace::Tracer;
use crate::scene::{Falloff, Light, LightKind, Rgb};

/// The light that would reach a point if nothing stood between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Illumination {
    /// Unit vector from the point to the light: L.
    pub to_light: DVec3,
    /// N.L, greater than 0.
    pub n_dot_l: f64,
    /// Ipi, weakened by distance and cone.
    pub color: Rgb,
    /// Where the light is, in the renderer's world; `None` if infinitely far away.
    pub position: Option<DVec3>,
}

/// A light relative to the scene's origin, with what does not depend on the point found once.
#[derive(Debug, Clone, Copy)]
pub struct PreparedLight {
    color: DVec3,
    source: Source,
}

#[derive(Debug, Clone, Copy)]
enum Source {
    /// Infinitely far away, in this unit direction.
    Directional {
        to_light: DVec3,
    },
    Point {
        position: DVec3,
        falloff: Falloff,
    },
    /// `axis` is the unit vector from the light along the cone; the angles are given by their cosines.
    Spot {
        position: DVec3,
        axis: DVec3,
        inner: f64,
        outer: f64,
        falloff: Falloff,
    },
}

impl PreparedLight {
    /// Prepares a light.
    ///
    /// # Errors
    /// A direction that is zero or not finite.
    pub fn new(light: &Light, scene_origin: DVec3) -> Result<Self> {
        let unit = |direction: DVec3| {
            normalize(direction).ok_or_else(|| Error::caller(format!("light `{}` has no direction", light.name)))
        };
        let source = match light.kind {
            LightKind::Directional { direction } => Source::Directional { to_light: unit(-direction)? },
            LightKind::Point { position, falloff } => Source::Point { position: position - scene_origin, falloff },
            LightKind::Spot { position, direction, inner_angle, outer_angle, falloff } => Source::Spot {
                position: position - scene_origin,
                axis: unit(direction)?,
                inner: libm::cos(inner_angle),
                outer: libm::cos(outer_angle),
                falloff,
            },
        };
        Ok(Self { color: light.color.as_dvec3(), source })
    }
}

impl Illumination {
    /// What `light` sends to a point; `None` where N.L is not positive, the light is at the point or its brightness
    /// there overflows, or the point lies outside its cone: then no shadow ray is traced.
    pub fn at(light: &PreparedLight, point: &SurfacePoint) -> Option<Self> {
        let (to_light, strength, position) = match light.source {
            Source::Directional { to_light } => (to_light, 1.0, None),
            Source::Point { position, falloff } => {
                let (to_light, strength) = from_point(position, falloff, point)?;
                (to_light, strength, Some(position))
            }
            Source::Spot { position, axis, inner, outer, falloff } => {
                let (to_light, strength) = from_point(position, falloff, point)?;
                (to_light, strength * cone(-dot(to_light, axis), inner, outer)?, Some(position))
            }
        };
        let n_dot_l = dot(point.normal, to_light);
        // Closer to an inverse-square light than f32 can tell there is no brightness to speak of.
        let color = (light.color * strength).as_vec3();
        (n_dot_l > 0.0 && color.is_finite()).then_some(Self { to_light, n_dot_l, color, position })
    }
}

/// Direction and strength of a light at a point; `None` for a light that is where the point is.
///
/// Within some roundings of f64 the two cannot be told apart: on which side of the surface the light is would be chance,
/// and its inverse square without limit.
fn from_point(position: DVec3, falloff: Falloff, point: &SurfacePoint) -> Option<(DVec3, f64)> {
    let offset = position - point.position;
    if offset.abs().max_element() <= 64.0 * f64::EPSILON * position.abs().max_element() {
        return None;
    }
    let strength = match falloff {
        Falloff::None => 1.0,
        Falloff::InverseSquare => 1.0 / dot(offset, offset),
    };
    Some((normalize(offset)?, strength))
}

/// The share of a spot's light at an angle to its axis, all angles given by their cosines: glTF's
/// KHR_lights_punctual, the square of a linear ramp in the cosine. `None` outside the cone.
fn cone(cosine: f64, inner: f64, outer: f64) -> Option<f64> {
    if cosine >= inner {
        return Some(1.0);
    }
    let share = (cosine - outer) / (inner - outer);
    (share > 0.0).then_some(share * share)
}

impl<I: Answers> Tracer<'_, I> {
    /// Si, per channel: 0 where an opaque surface blocks the light, the product of kt over the surfaces crossed, in
    /// the order of hits, where they let light through, else 1.
    pub fn visibility(&self, from: &Meeting<'_>, illumination: &Illumination) -> Rgb {
        let ray = self.intersect.shadow_ray(from, illumination);
        self.count(|counts| counts.shadow += 1);
        if self.intersect.is_blocked_by_opaque(&ray) {
            return Rgb::ZERO;
        }
        self.visible_through(&ray)
    }

    /// The same for a shadow ray that nothing opaque blocks.
    pub(super) fn visible_through(&self, ray: &I::Ray) -> Rgb {
        let mut visible = Rgb::ONE;
        if self.is_opaque() {
            return visible;
        }
        self.intersect.visit_transmissive(ray, |hit| {
            visible *= self.scene.materials[self.scene.material_of(hit.instance, hit.primitive) as usize].kt;
            visible != Rgb::ZERO
        });
        visible
    }
}
