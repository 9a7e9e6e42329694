//! Writes down what the recursion tells.

use super::{
    Arrival, BackgroundKind, Crossing, Dark, End, Found, LightTerm, Lighting, RayNode, Stop, Surface, Term, Way,
};
use crate::geometry::Hit;
use crate::math::vector::length;
use crate::render::answers::Meeting;
use crate::render::shade::{Direct, SurfaceColors};
use crate::render::shadow::Illumination;
use crate::render::witness::Witness;
use crate::scene::camera::ViewRay;
use crate::scene::{Background, Clamp, Rgb, Scene, Shape};

/// Looks on while one camera ray is traced.
pub struct Recorder<'a> {
    scene: &'a Scene,
    /// The rays so far.
    pub rays: Vec<RayNode>,
    /// Those that have not ended, the latest last.
    open: Vec<usize>,
    /// What can still be recorded; 0 once something was left out.
    pub room: usize,
}

impl<'a> Recorder<'a> {
    /// Has recorded nothing, and will stop when it has recorded so much.
    pub fn new(scene: &'a Scene, room: usize) -> Self {
        Self { scene, rays: Vec::new(), open: Vec::new(), room }
    }

    fn uses_room(&mut self) {
        self.room = self.room.saturating_sub(1);
    }

    /// The ray that is being traced.
    fn ray(&mut self) -> &mut RayNode {
        let latest = *self.open.last().expect("a ray sets out before anything happens to it");
        &mut self.rays[latest]
    }

    /// The terms of the surface that is being shaded.
    fn terms(&mut self) -> &mut Vec<Term> {
        match &mut self.ray().end {
            End::Surface(surface) => &mut surface.terms,
            End::Background { .. } => unreachable!("a surface is met before it is shaded"),
        }
    }

    /// The light that is being asked, with what it may add.
    fn light(&mut self) -> (&mut Arrival, &mut Rgb) {
        match self.terms().last_mut() {
            Some(Term::Light(LightTerm { lighting: Lighting::Shines(arrival), added, .. })) => (arrival, added),
            _ => unreachable!("a light shines before it is asked what is between"),
        }
    }

    fn add_light(&mut self, number: usize, lighting: Lighting) {
        self.uses_room();
        let light = self.scene.lights[number].name.clone();
        self.terms().push(Term::Light(LightTerm { number, light, lighting, added: Rgb::ZERO }));
    }

    fn found(&self, hit: &Hit) -> Found {
        let object = &self.scene.objects[hit.instance as usize];
        let part = match object.shape {
            Shape::Mesh(mesh) => {
                let groups = &self.scene.meshes[mesh as usize].groups;
                let after = groups.partition_point(|group| group.first_triangle <= hit.primitive);
                after.checked_sub(1).map(|at| groups[at].name.to_string())
            }
            Shape::Quadric(_) => None,
        };
        let material = self.scene.material_of(hit.instance, hit.primitive);
        Found {
            object: object.name.clone(),
            instance: hit.instance,
            primitive: hit.primitive,
            part,
            material: self.scene.materials[material as usize].name.clone(),
            t: hit.t,
        }
    }

    /// A hit on the way to the light that is being asked.
    fn stop(&mut self, hit: &Hit) -> Stop {
        let found = self.found(hit);
        // The way to a light at a place has length 1 in the ray's units.
        let scale = self.light().0.distance.unwrap_or(1.0);
        Stop { found, distance: f64::from(hit.t) * scale }
    }
}

impl Witness for Recorder<'_> {
    fn has_room(&self) -> bool {
        self.room > 0
    }

    fn begins(&mut self, view: &ViewRay, depth: u32) {
        self.uses_room();
        let number = self.rays.len();
        let parent = self.open.last().copied();
        let mut way = Way::Camera;
        if parent.is_some()
            && let Some(Term::Seen { way: branch, ray, .. }) = self.terms().last_mut()
        {
            (way, *ray) = (*branch, Some(number));
        }
        let (origin, direction) = (view.origin + self.scene.origin, view.direction);
        let end = End::Background { kind: kind_of(&self.scene.background), color: Rgb::ZERO };
        self.rays.push(RayNode { parent, way, depth, origin, direction, holes: Vec::new(), end, color: Rgb::ZERO });
        self.open.push(number);
    }

    fn passes_hole(&mut self, hit: &Hit) {
        self.uses_room();
        let found = self.found(hit);
        self.ray().holes.push(found);
    }

    fn sees_background(&mut self, color: Rgb) {
        self.ray().end = End::Background { kind: kind_of(&self.scene.background), color };
    }

    fn meets(&mut self, found: &Hit, here: &Meeting<'_>) {
        let instead_of = (found.key() != here.hit.key()).then(|| self.found(found));
        let point = here.point;
        let surface = Surface {
            found: self.found(here.hit),
            instead_of,
            point: point.position + self.scene.origin,
            geometric_normal: point.geometric_normal,
            normal: point.normal,
            from_outside: point.from_outside,
            terms: Vec::new(),
        };
        self.ray().end = End::Surface(Box::new(surface));
    }

    fn begins_sum(&mut self, colors: &SurfaceColors) {
        let terms = [Term::Ambient { color: colors.ambient }, Term::Emission { color: colors.emission }];
        self.terms().extend(terms);
    }

    fn is_dark(&mut self, light: usize, why: impl FnOnce() -> Dark) {
        self.add_light(light, Lighting::Dark(why()));
    }

    fn shines(&mut self, light: usize, illumination: &Illumination, direct: impl FnOnce() -> Direct) {
        let &Illumination { to_light, n_dot_l, color, position } = illumination;
        let Direct { diffuse, r_dot_v, specular } = direct();
        let End::Surface(surface) = &self.ray().end else { unreachable!("lights shine at surfaces") };
        let point = surface.point;
        let distance = position.map(|position| length(position + self.scene.origin - point));
        let arrival = Arrival {
            to_light,
            distance,
            color,
            n_dot_l,
            r_dot_v,
            diffuse,
            specular,
            visible: Rgb::ZERO,
            crossed: Vec::new(),
            blocked_by: None,
        };
        self.add_light(light, Lighting::Shines(Box::new(arrival)));
    }

    fn is_blocked(&mut self, by: impl FnOnce() -> Hit) {
        let hit = by();
        if hit.is_hit() {
            self.light().0.blocked_by = Some(self.stop(&hit));
        }
    }

    fn crosses(&mut self, hit: &Hit, passes: Rgb) {
        self.uses_room();
        let stop = self.stop(hit);
        self.light().0.crossed.push(Crossing { stop, passes, length: None, left: None });
    }

    fn absorbs_light(&mut self, length: f64, left: Rgb) {
        if let Some(crossing) = self.light().0.crossed.last_mut() {
            (crossing.length, crossing.left) = (Some(length), Some(left));
        }
    }

    fn arrives(&mut self, visible: Rgb) {
        let (arrival, added) = self.light();
        arrival.visible = visible;
        if visible != Rgb::ZERO {
            *added = arrival.adds();
        } else if arrival.blocked_by.is_none() {
            arrival.blocked_by = arrival.crossed.last().map(|crossing| crossing.stop.clone());
        }
    }

    fn branches(&mut self, way: impl FnOnce() -> Way, weight: Rgb) {
        self.terms().push(Term::Seen { way: way(), weight, ray: None, added: Rgb::ZERO });
    }

    fn absorbs(&mut self, length: f64, left: Rgb) {
        self.terms().push(Term::Absorbed { length, left });
    }

    fn clamps(&mut self, from: Rgb, to: Rgb) {
        if self.scene.film.clamp == Clamp::Shade {
            self.terms().push(Term::Clamped { from, to });
        }
    }

    fn ends(&mut self, color: Rgb) {
        self.ray().color = color;
        self.open.pop();
        if self.open.is_empty() {
            return;
        }
        if let Some(Term::Seen { weight, added, .. }) = self.terms().last_mut() {
            *added = *weight * color;
        }
    }
}

fn kind_of(background: &Background) -> BackgroundKind {
    match background {
        Background::Color(_) => BackgroundKind::Color,
        Background::Gradient { .. } => BackgroundKind::Gradient,
        Background::Image { .. } => BackgroundKind::Image,
        Background::Transparent => BackgroundKind::Transparent,
    }
}
