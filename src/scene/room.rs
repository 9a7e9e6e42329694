//! Models that are rooms open on one side, such as a Cornell box: they are looked into, not at.

use glam::DVec3;

use crate::math::transform::point;
use crate::math::vector::{cross, dot, length};
use crate::scene::{Camera, Falloff, Light, LightKind, Rgb, Scene, Shape};

/// A model whose faces look inward, like a stage: walls around, open on one side.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Room {
    /// The side that is open, as the azimuth to look from, radians.
    pub azimuth: f64,
    /// Where a lamp hangs: the middle, a tenth of the height below the top.
    pub lamp: DVec3,
}

impl Room {
    /// The room that a scene is, if it is one.
    ///
    /// Faces that look inward enclose a negative volume; a Cornell box reaches -0.8 of its bounding box, while models seen
    /// from outside are positive and scans with flipped faces are bodies that fill far less than half of theirs. The faces
    /// of a closed surface cancel: what remains of their sum points out of the opening.
    pub fn of(scene: &Scene) -> Option<Self> {
        const INWARD: f64 = -0.5;
        let corners = triangles_of(scene);
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &corner in corners.iter().flatten() {
            (min, max) = (min.min(corner), max.max(corner));
        }
        let (center, size) = (0.5 * (min + max), max - min);
        let (mut volume, mut areas, mut area) = (0.0, DVec3::ZERO, 0.0);
        for [a, b, c] in corners.iter().map(|triangle| triangle.map(|p| p - center)) {
            let face = 0.5 * cross(b - a, c - a);
            volume += dot(a, face) / 3.0;
            areas += face;
            area += length(face);
        }
        // An opening of a cube's side is a fifth of the rest; a window is no side to look in from.
        const OPEN: f64 = 0.1;
        if !(volume < INWARD * size.x * size.y * size.z && areas.x.abs().max(areas.z.abs()) > OPEN * area) {
            return None;
        }
        let azimuth: f64 = match (areas.x.abs() > areas.z.abs(), areas.x > 0.0, areas.z > 0.0) {
            (true, true, _) => 90.0,
            (true, false, _) => -90.0,
            (false, _, true) => 0.0,
            (false, _, false) => 180.0,
        };
        Some(Self { azimuth: azimuth.to_radians(), lamp: DVec3::new(center.x, max.y - 0.1 * size.y, center.z) })
    }

    /// A lamp that lights the room and a weaker light where the camera stands.
    pub(super) fn lights(&self, camera: &Camera) -> Vec<Light> {
        let at = |name: &str, position: DVec3, color: Rgb| Light {
            name: name.into(),
            kind: LightKind::Point { position, falloff: Falloff::None },
            color,
        };
        let eye = match *camera {
            Camera::LookAt { eye, .. } => eye,
            Camera::FourPoint { viewpoint, .. } => viewpoint,
        };
        vec![at("lamp", self.lamp, Rgb::new(0.75, 0.73, 0.70)), at("fill", eye, Rgb::splat(0.25))]
    }
}

/// All triangles in the file's coordinates; none of scenes too large for a stage set.
fn triangles_of(scene: &Scene) -> Vec<[DVec3; 3]> {
    const MOST_TRIANGLES: u64 = 200_000;
    if scene.instanced_triangles() > MOST_TRIANGLES {
        return Vec::new();
    }
    let mut triangles = Vec::new();
    for object in &scene.objects {
        if let Shape::Mesh(mesh) = object.shape {
            let mesh = &scene.meshes[mesh as usize];
            let place = |p: glam::Vec3| point(&object.transform, mesh.file_position(p));
            triangles.extend(mesh.live_triangles().map(|number| mesh.triangle(number).map(place)));
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriangleMesh;
    use crate::scene::Object;
    use glam::Vec3;

    #[test]
    fn a_box_open_at_one_side_is_looked_into() {
        // A cube whose faces look inward, without its +X side.
        let positions = crate::geometry::Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE }.corners().to_vec();
        let sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4]];
        let indices = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mut mesh = TriangleMesh { positions: positions.into(), indices, ..Default::default() }.finish().unwrap();
        let object =
            Object { name: String::new(), shape: Shape::Mesh(0), transform: glam::DAffine3::IDENTITY, material: None };
        let scene = |mesh: &TriangleMesh| Scene {
            meshes: vec![mesh.clone().into()],
            objects: vec![object.clone()],
            ..Default::default()
        };
        let room = Room::of(&scene(&mesh)).unwrap();
        assert_eq!(room.azimuth, std::f64::consts::FRAC_PI_2);
        assert_eq!(room.lamp, DVec3::new(0.0, 0.8, 0.0));
        // The same box seen from outside is no room.
        for triangle in &mut mesh.indices {
            triangle.swap(0, 1);
        }
        assert!(Room::of(&scene(&mesh)).is_none());
    }
}
