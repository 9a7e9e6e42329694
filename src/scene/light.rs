//! Lights: points, directions and spots.

use glam::DVec3;

use crate::scene::Rgb;

/// How a light weakens with distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Falloff {
    /// Not at all: the seed.
    #[default]
    None,
    /// With the square of the distance, in the scene's units: glTF.
    InverseSquare,
}

/// Where light comes from.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum LightKind {
    /// From a point.
    Point {
        /// In the file's coordinates.
        position: DVec3,
        /// How it weakens.
        falloff: Falloff,
    },
    /// From infinitely far away.
    Directional {
        /// Where the light travels to, of any length but 0.
        direction: DVec3,
    },
    /// From a point into a cone.
    Spot {
        /// In the file's coordinates.
        position: DVec3,
        /// The cone's axis, where the light travels to, of any length but 0.
        direction: DVec3,
        /// Half angle of full light, radians.
        inner_angle: f64,
        /// Half angle beyond which there is none, radians, greater than `inner_angle` or equal.
        outer_angle: f64,
        /// How it weakens.
        falloff: Falloff,
    },
}

/// One light.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Light {
    /// For messages and `info`.
    pub name: String,
    /// Where it comes from.
    pub kind: LightKind,
    /// Linear colour times intensity: `Ipi` in the shading formula.
    pub color: Rgb,
}
