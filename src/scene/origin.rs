//! Where the renderer's f32 world has its zero.

use glam::DVec3;

use crate::math::origin::choose_origin;
use crate::scene::extent::Extents;
use crate::scene::{Scene, Shape};

/// A scene this many times farther from zero than it is large is moved; nearer ones lose at most four bits.
const FAR: f64 = 16.0;

/// The origin that loses least, in the file's coordinates.
///
/// Where an untransformed mesh has an origin of its own, that of the mesh with most triangles is taken: the mesh then
/// needs no transform. Otherwise zero, unless the scene lies far from it: then a point on a power-of-two grid amid it.
pub fn choose(scene: &Scene) -> DVec3 {
    let untransformed = scene.objects.iter().filter_map(|object| match object.shape {
        Shape::Mesh(mesh) if object.transform == glam::DAffine3::IDENTITY => Some(&scene.meshes[mesh as usize]),
        _ => None,
    });
    // `max_by_key` keeps the last of equals; reversed, that is the first in the file.
    let largest = untransformed.rev().max_by_key(|mesh| mesh.live_count());
    if let Some(mesh) = largest {
        return mesh.origin;
    }
    let extents = Extents::of(scene);
    let corners: Vec<DVec3> =
        scene.objects.iter().filter_map(|object| extents.corners(scene, object)).flatten().collect();
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &corner in &corners {
        (min, max) = (min.min(corner), max.max(corner));
    }
    let nearest = min.max(-max).max_element();
    if nearest > FAR * (max - min).max_element() { choose_origin(&corners) } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes;
    use crate::scene::Object;
    use glam::DAffine3;

    fn sphere_at(center: DVec3) -> Scene {
        let transform = DAffine3::from_translation(center);
        let object = Object { name: "sphere".into(), shape: Shape::Quadric(0), transform, material: None };
        Scene { quadrics: vec![shapes::sphere()], objects: vec![object], ..Scene::default() }
    }

    #[test]
    fn only_far_scenes_are_moved() {
        assert_eq!(choose(&Scene::default()), DVec3::ZERO);
        assert_eq!(choose(&sphere_at(DVec3::new(5.1, 0.3, 7.7))), DVec3::ZERO);
        let far = choose(&sphere_at(DVec3::new(456_789.123, 5_432_100.987, 12.3)));
        assert!((far - DVec3::new(456_789.123, 5_432_100.987, 12.3)).abs().max_element() < 4.0, "{far}");
    }

    #[test]
    fn an_untransformed_mesh_gives_its_own_origin() {
        let mesh = crate::geometry::TriangleMesh { origin: DVec3::new(0.0, 0.125, 0.0), ..Default::default() };
        let object = Object { name: "m".into(), shape: Shape::Mesh(0), transform: DAffine3::IDENTITY, material: None };
        let scene = Scene { meshes: vec![mesh], objects: vec![object], ..Scene::default() };
        assert_eq!(choose(&scene), DVec3::new(0.0, 0.125, 0.0));
    }
}
