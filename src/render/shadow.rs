//! `Si` in the shading formula: how a light reaches a point, and what stands between.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::geometry::Hit;
use crate::math::lanes::{Flags, LANES, Numbers, Vectors, Vectors32, whole_rows};
use crate::math::simd::{Level, Task};
use crate::math::vector::{dot, is_safe, length, normalize};
use crate::render::answers::{Answers, Meeting};
use crate::render::explain::Dark;
use crate::render::points::Points;
use crate::render::surface::SurfacePoint;
use crate::render::trace::Tracer;
use crate::render::witness::Witness;
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
    /// Where it is; infinitely far away the unit vector towards it.
    place: DVec3,
    is_distant: bool,
    falloff: Falloff,
    cone: Option<Cone>,
}

/// Where a spot shines.
#[derive(Debug, Clone, Copy)]
struct Cone {
    /// Unit vector from the light.
    axis: DVec3,
    /// Cosines of the angles within which it is as bright as anywhere, and beyond which there is no light.
    inner: f64,
    outer: f64,
}

impl Cone {
    /// How bright the light is along a unit vector to it, from 0 to 1; and whether the vector lies within the cone.
    #[inline(always)]
    fn share(&self, to_light: DVec3) -> (f64, bool) {
        // glTF's KHR_lights_punctual: the square of a linear ramp in the cosine.
        let cosine = -dot(to_light, self.axis);
        let share = (cosine - self.outer) / (self.inner - self.outer);
        (if cosine >= self.inner { 1.0 } else { share * share }, (cosine >= self.inner) | (share > 0.0))
    }
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
        let at = |place: DVec3, falloff: Falloff, cone: Option<Cone>| {
            let place = place - scene_origin;
            Self { color: light.color.as_dvec3(), place, is_distant: false, falloff, cone }
        };
        Ok(match light.kind {
            LightKind::Directional { direction } => {
                let place = unit(-direction)?;
                Self { place, is_distant: true, ..at(place, Falloff::None, None) }
            }
            LightKind::Point { position, falloff } => at(position, falloff, None),
            LightKind::Spot { position, direction, inner_angle, outer_angle, falloff } => {
                let (inner, outer) = (libm::cos(inner_angle), libm::cos(outer_angle));
                at(position, falloff, Some(Cone { axis: unit(direction)?, inner, outer }))
            }
        })
    }

    /// Where it is, in the renderer's world; `None` if infinitely far away.
    pub fn position(&self) -> Option<DVec3> {
        (!self.is_distant).then_some(self.place)
    }

    /// The vector from a point to the light, of any length; and whether it can be told from none.
    ///
    /// Within some roundings of f64 a light and a point cannot be told apart: on which side of the surface the light is would be
    /// chance, and its inverse square without limit.
    #[inline(always)]
    fn offset(&self, position: DVec3) -> (DVec3, bool) {
        if self.is_distant {
            return (self.place, true);
        }
        let offset = self.place - position;
        let largest = |v: DVec3| {
            let v = v.abs();
            let larger = if v.x > v.y { v.x } else { v.y };
            if v.z > larger { v.z } else { larger }
        };
        (offset, largest(offset) > 64.0 * f64::EPSILON * largest(self.place))
    }

    /// What the light sends along a unit vector to it, over a distance of which the square is given, to where the normal is; and
    /// whether that is any.
    #[inline(always)]
    fn shine(&self, to_light: DVec3, squared: f64, normal: DVec3) -> (f64, Rgb, bool) {
        let mut strength = match self.falloff {
            Falloff::None => 1.0,
            Falloff::InverseSquare => 1.0 / squared,
        };
        let mut shines = true;
        if let Some(cone) = self.cone {
            let (share, is_within) = cone.share(to_light);
            strength *= share;
            shines = is_within;
        }
        let n_dot_l = dot(normal, to_light);
        let color = (self.color * strength).as_vec3();
        // Closer to an inverse-square light than f32 can tell there is no brightness to speak of.
        let is_finite = |x: f32| x.abs() < f32::INFINITY;
        let is_lit = shines & (n_dot_l > 0.0) & is_finite(color.x) & is_finite(color.y) & is_finite(color.z);
        (n_dot_l, color, is_lit)
    }
}

impl Illumination {
    /// What `light` sends to a point; `None` where N.L is not positive, the light is at the point or its brightness
    /// there overflows, or the point lies outside its cone: then no shadow ray is traced.
    pub fn at(light: &PreparedLight, point: &SurfacePoint) -> Option<Self> {
        let (offset, is_apart) = light.offset(point.position);
        if !is_apart {
            return None;
        }
        let to_light = if light.is_distant { offset } else { normalize(offset)? };
        let (n_dot_l, color, is_lit) = light.shine(to_light, dot(offset, offset), point.normal);
        is_lit.then_some(Self { to_light, n_dot_l, color, position: light.position() })
    }
}

impl PreparedLight {
    /// Why [`Illumination::at`] gives nothing at a point where it does.
    pub(super) fn darkness(&self, point: &SurfacePoint) -> Dark {
        let (offset, is_apart) = self.offset(point.position);
        let to_light = if self.is_distant { Some(offset) } else { normalize(offset) };
        let Some(to_light) = to_light.filter(|_| is_apart) else { return Dark::AtThePoint };
        let (n_dot_l, ..) = self.shine(to_light, dot(offset, offset), point.normal);
        if !(n_dot_l > 0.0) {
            return Dark::Behind { n_dot_l };
        }
        match self.cone {
            Some(cone) if !cone.share(to_light).1 => Dark::OutsideCone,
            _ => Dark::TooBright,
        }
    }
}

/// What one light would send to many points.
pub struct Illuminations {
    pub(super) to_light: Vectors,
    pub(super) n_dot_l: Numbers,
    pub(super) color: Vectors32,
    /// Where that is any; elsewhere the rest has no meaning.
    pub(super) is_lit: Flags,
    /// Where the light is; `None` if infinitely far away.
    pub(super) position: Option<DVec3>,
}

impl Illuminations {
    /// None.
    pub const NONE: Self = Self {
        to_light: Vectors::ZERO,
        n_dot_l: [0.0; LANES],
        color: Vectors32::ZERO,
        is_lit: [0; LANES],
        position: None,
    };

    /// [`Illumination::at`] for each of some points.
    pub fn find(&mut self, level: Level, light: &PreparedLight, points: &Points, count: usize) {
        self.position = light.position();
        let lanes = whole_rows(count);
        let mut odd = [0; LANES];
        level.run(Illuminate { lanes, light, points, found: self, odd: &mut odd });
        for at in (0..count).filter(|&at| odd[at] != 0) {
            let one = Illumination::at(light, &points.get(at));
            self.is_lit[at] = u32::from(one.is_some());
            if let Some(one) = one {
                self.to_light.set(at, one.to_light);
                self.n_dot_l[at] = one.n_dot_l;
                self.color.set(at, one.color);
            }
        }
    }

    /// One of them.
    #[inline(always)]
    pub fn get(&self, at: usize) -> Option<Illumination> {
        let (to_light, n_dot_l, color) = (self.to_light.get(at), self.n_dot_l[at], self.color.get(at));
        (self.is_lit[at] != 0).then_some(Illumination { to_light, n_dot_l, color, position: self.position })
    }
}

struct Illuminate<'a> {
    lanes: usize,
    light: &'a PreparedLight,
    points: &'a Points,
    found: &'a mut Illuminations,
    odd: &'a mut Flags,
}

impl Task for Illuminate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        // What does not depend on the point is a constant in each of these, so that the loops have no branches.
        let light = *self.light;
        match (light.is_distant, light.falloff, light.cone) {
            (true, ..) => {
                self.each(PreparedLight { is_distant: true, falloff: Falloff::None, cone: None, ..light });
            }
            (_, Falloff::None, None) => {
                self.each(PreparedLight { is_distant: false, falloff: Falloff::None, cone: None, ..light });
            }
            (_, Falloff::InverseSquare, None) => {
                self.each(PreparedLight { is_distant: false, falloff: Falloff::InverseSquare, cone: None, ..light });
            }
            (_, Falloff::None, Some(cone)) => {
                self.each(PreparedLight { is_distant: false, falloff: Falloff::None, cone: Some(cone), ..light });
            }
            (_, Falloff::InverseSquare, Some(cone)) => {
                let falloff = Falloff::InverseSquare;
                self.each(PreparedLight { is_distant: false, falloff, cone: Some(cone), ..light });
            }
        }
    }
}

impl Illuminate<'_> {
    #[inline(always)]
    fn each(self, light: PreparedLight) {
        illuminate(self.lanes, &light, self.points, self.found, self.odd);
    }
}

#[inline(always)]
fn illuminate(lanes: usize, light: &PreparedLight, points: &Points, found: &mut Illuminations, odd: &mut Flags) {
    for at in 0..lanes.min(LANES) {
        let (offset, is_apart) = light.offset(points.position.get(at));
        let squared = dot(offset, offset);
        let is_regular = light.is_distant | is_safe(squared);
        let to_light = if light.is_distant { offset } else { offset / squared.sqrt() };
        let (n_dot_l, color, is_lit) = light.shine(to_light, squared, points.normal.get(at));
        found.to_light.set(at, to_light);
        found.n_dot_l[at] = n_dot_l;
        found.color.set(at, color);
        found.is_lit[at] = u32::from(is_apart & is_lit);
        odd[at] = u32::from(is_apart & !is_regular);
    }
}

impl<I: Answers> Tracer<'_, I> {
    /// Si, per channel: 0 where an opaque surface blocks the light, the product of kt over the surfaces crossed, in
    /// the order of hits, where they let light through, else 1.
    pub fn visibility(&self, from: &Meeting<'_>, illumination: &Illumination) -> Rgb {
        self.watch_visibility(from, illumination, &mut ())
    }

    /// The same while someone looks on.
    pub(super) fn watch_visibility(
        &self,
        from: &Meeting<'_>,
        illumination: &Illumination,
        witness: &mut impl Witness,
    ) -> Rgb {
        let ray = self.intersect.shadow_ray(from, illumination);
        self.count(|counts| counts.shadow += 1);
        if self.intersect.is_blocked_by_opaque(&ray) {
            witness.is_blocked(|| self.first_opaque(&ray));
            return Rgb::ZERO;
        }
        self.visible_through(&ray, from.point, illumination, witness)
    }

    /// The first hit on what is opaque as a whole.
    fn first_opaque(&self, ray: &I::Ray) -> Hit {
        let mut hit = self.intersect.first_hit(ray);
        while hit.is_hit() && !self.world.instances[hit.instance as usize].opaque {
            hit = self.intersect.next_hit(ray, hit.key());
        }
        hit
    }

    /// The same for a shadow ray from a point that nothing opaque blocks.
    pub(super) fn visible_through(
        &self,
        ray: &I::Ray,
        from: &SurfacePoint,
        illumination: &Illumination,
        witness: &mut impl Witness,
    ) -> Rgb {
        let mut visible = Rgb::ONE;
        if self.is_opaque() {
            return visible;
        }
        // The light's place is at t = 1, but for lights far away, whose direction has unit length.
        let scale = illumination.position.map_or(1.0, |position| length(position - from.position));
        let mut before = 0.0;
        self.intersect.visit_transmissive(ray, |hit| {
            let passes = self.passes(hit, -illumination.to_light);
            witness.crosses(hit, passes);
            visible *= passes;
            let material = self.material_hit(hit);
            if material.is_absorbing() {
                let t = f64::from(hit.t);
                // What comes out of a solid went through it since it came in, or began inside.
                if self.is_from_inside(hit, illumination.to_light) {
                    let length = (t - before) * scale;
                    let left = material.left_after(length);
                    witness.absorbs_light(length, left);
                    visible *= left;
                }
                before = t;
            }
            visible != Rgb::ZERO
        });
        visible
    }
}
