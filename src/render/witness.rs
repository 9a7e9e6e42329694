//! What is told of the recursion of `Trace` and `Shade` while it goes on: nothing for pictures, everything for an
//! [explanation](crate::render::explain).
//!
//! One code shades and is looked on at, so that an explanation cannot differ from the picture. Where `()` looks on, all of
//! this compiles to nothing.

use crate::geometry::Hit;
use crate::render::answers::Meeting;
use crate::render::explain::{Dark, Way};
use crate::render::shade::{Direct, SurfaceColors};
use crate::render::shadow::Illumination;
use crate::scene::Rgb;
use crate::scene::camera::ViewRay;

/// Looks on while a ray is traced; told in the order in which things are done.
pub(super) trait Witness {
    /// Whether reflected and refracted rays are followed: not once there is more than can be remembered.
    fn has_room(&self) -> bool {
        true
    }

    /// A ray sets out: from the camera, or for the [branch](Self::branches) that was told last.
    fn begins(&mut self, _view: &ViewRay, _depth: u32) {}

    /// It passes where the surface that it found is not there.
    fn passes_hole(&mut self, _hit: &Hit) {}

    /// It hits nothing.
    fn sees_background(&mut self, _color: Rgb) {}

    /// It comes upon a surface; `found` was found first, and differs where that was a way out just before the way in.
    fn meets(&mut self, _found: &Hit, _here: &Meeting<'_>) {}

    /// The surface's own colours are what the sum begins with.
    fn begins_sum(&mut self, _colors: &SurfaceColors) {}

    /// A light, by its number, does not shine at the point.
    fn is_dark(&mut self, _light: usize, _why: impl FnOnce() -> Dark) {}

    /// A light shines at the point, unless something is between; `direct` is what it would add in full.
    fn shines(&mut self, _light: usize, _illumination: &Illumination, _direct: impl FnOnce() -> Direct) {}

    /// Between that light and the point is something opaque.
    fn is_blocked(&mut self, _by: impl FnOnce() -> Hit) {}

    /// Between them is something that lets so much through.
    fn crosses(&mut self, _hit: &Hit, _passes: Rgb) {}

    /// The light went so far inside what was crossed last, and so much of it is left.
    fn absorbs_light(&mut self, _length: f64, _left: Rgb) {}

    /// So much of that light arrives.
    fn arrives(&mut self, _visible: Rgb) {}

    /// What is seen over a way belongs to the sum with this weight; a ray [begins](Self::begins) next, unless no more are
    /// followed.
    fn branches(&mut self, _way: impl FnOnce() -> Way, _weight: Rgb) {}

    /// The ray came so far inside, and so much of the sum is left.
    fn absorbs(&mut self, _length: f64, _left: Rgb) {}

    /// The sum is clamped.
    fn clamps(&mut self, _from: Rgb, _to: Rgb) {}

    /// The ray that set out last saw this.
    fn ends(&mut self, _color: Rgb) {}
}

/// No one looks on.
impl Witness for () {}
