//! Where a case's scene stands.

use glam::{DAffine3, DVec3};

use crate::math::transform::{apply, rotation_about};
use crate::render::Renderer;

/// Where a scene stands: turned, scaled and moved.
pub struct Stand {
    /// How large it is.
    pub scale: f64,
    /// From its own coordinates to the file's.
    pub transform: DAffine3,
}

impl Stand {
    /// Turned by an angle about an axis that is none of the scene's.
    pub fn new(scale: f64, angle: f64, place: DVec3) -> Self {
        let axis = DVec3::new(2.0, 3.0, -6.0) / 7.0;
        let transform = DAffine3 { matrix3: rotation_about(axis, angle) * scale, translation: place };
        Self { scale, transform }
    }

    /// At zero, turned, tiny, huge, and far away.
    pub fn all() -> Vec<Self> {
        vec![
            Self::new(1.0, 0.0, DVec3::ZERO),
            Self::new(1.0, 0.7, DVec3::ZERO),
            Self::new(libm::ldexp(1.0, -20), 0.0, DVec3::ZERO),
            Self::new(1e6, 2.5, DVec3::ZERO),
            Self::new(1.0, 0.0, DVec3::new(4_512_344.0, 1024.0, -5_432_104.0)),
            Self::new(0.001, 1.3, DVec3::new(1000.1, -7.7, 0.3)),
        ]
    }

    /// Where a point of the scene's own coordinates is for the renderer.
    pub fn seen_by(&self, renderer: &Renderer, p: DVec3) -> DVec3 {
        (self.transform.translation - renderer.scene().origin) + apply(&self.transform.matrix3, p)
    }
}
