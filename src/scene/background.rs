//! What a ray sees that hits nothing.

use glam::DVec3;

use crate::scene::{Rgb, Texture};

/// The background; black unless set, as in the seed.
#[derive(Debug, Clone, PartialEq)]
pub enum Background {
    /// One colour.
    Color(Rgb),
    /// From `horizon`-wards down (`bottom`) to straight up (`top`), linear in the height of the unit direction.
    Gradient {
        /// Colour straight down.
        bottom: Rgb,
        /// Colour straight up.
        top: Rgb,
        /// Unit vector that points up.
        up: DVec3,
    },
    /// An equirectangular image around the scene: its middle column lies along -Z, its top row along +Y.
    Image {
        /// The image.
        texture: Texture,
        /// Multiplies its values.
        intensity: f32,
    },
    /// Black with an alpha of 0 in formats that have alpha; rays other than camera rays see black.
    Transparent,
}

impl Default for Background {
    fn default() -> Self {
        Self::Color(Rgb::ZERO)
    }
}
