//! Where the renderer's f32 world has its zero.

use glam::{DAffine3, DVec3};

use crate::math::origin::{FAR, choose_origin};
use crate::math::transform::point;
use crate::scene::extent::Extents;
use crate::scene::{Scene, Shape};

/// The origin that loses least, in the file's coordinates.
///
/// Where a mesh that is not moved, or only turned so that axes become axes, has an origin of its own, that of the mesh
/// with most triangles is taken: it then needs no translation. Otherwise zero, unless the scene lies [`FAR`] from it:
/// then a point on a power-of-two grid amid it.
pub fn choose(scene: &Scene) -> DVec3 {
    of_largest(scene).unwrap_or_else(|| of_all(scene, &Extents::of(scene)))
}

/// [`choose`] where the boxes of the scene's meshes are known.
pub fn choose_within(scene: &Scene, extents: &Extents) -> DVec3 {
    of_largest(scene).unwrap_or_else(|| of_all(scene, extents))
}

/// That of the mesh with most triangles, where one is not moved.
fn of_largest(scene: &Scene) -> Option<DVec3> {
    let unmoved = scene.objects.iter().filter_map(|object| match object.shape {
        Shape::Mesh(mesh) if swaps_axes(&object.transform) => Some((&scene.meshes[mesh as usize], object)),
        _ => None,
    });
    // `max_by_key` keeps the last of equals; reversed, that is the first in the file.
    let largest = unmoved.rev().max_by_key(|(mesh, _)| mesh.live_count());
    // Exact: ones and zeros. Adding 0 takes the sign off a zero.
    largest.map(|(mesh, object)| point(&object.transform, mesh.origin) + DVec3::ZERO)
}

/// One amid all objects, where zero is far away.
fn of_all(scene: &Scene, extents: &Extents) -> DVec3 {
    let corners: Vec<DVec3> =
        scene.objects.iter().filter_map(|object| extents.corners(scene, object)).flatten().collect();
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &corner in &corners {
        (min, max) = (min.min(corner), max.max(corner));
    }
    let nearest = min.max(-max).max_element();
    if nearest > FAR * (max - min).max_element() { choose_origin(corners.into_iter()) } else { DVec3::ZERO }
}

/// Whether a transform moves nothing and maps axes to axes, mirrored or not, without scaling them: the identity, and what
/// `--up z` does.
fn swaps_axes(transform: &DAffine3) -> bool {
    let m = &transform.matrix3;
    let unit = |v: DVec3| v.abs() == DVec3::X || v.abs() == DVec3::Y || v.abs() == DVec3::Z;
    transform.translation == DVec3::ZERO && unit(m.x_axis) && unit(m.y_axis) && unit(m.z_axis)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes;
    use crate::scene::Object;

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
    fn a_mesh_that_is_turned_upright_keeps_its_origin() {
        let mesh = crate::geometry::TriangleMesh { origin: DVec3::new(64.0, -32.0, 8.0), ..Default::default() };
        let upright = DAffine3::from_mat3(glam::DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
        let object = |transform| Object { name: "m".into(), shape: Shape::Mesh(0), transform, material: None };
        let scene = |transform| Scene {
            meshes: vec![mesh.clone().into()],
            objects: vec![object(transform)],
            ..Scene::default()
        };
        assert_eq!(choose(&scene(upright)), DVec3::new(64.0, 8.0, 32.0));
        assert_eq!(choose(&scene(DAffine3::from_scale(DVec3::splat(2.0)))), DVec3::ZERO, "nothing to see there");
    }

    #[test]
    fn an_untransformed_mesh_gives_its_own_origin() {
        let mesh = crate::geometry::TriangleMesh { origin: DVec3::new(0.0, 0.125, 0.0), ..Default::default() };
        let object = Object { name: "m".into(), shape: Shape::Mesh(0), transform: DAffine3::IDENTITY, material: None };
        let scene = Scene { meshes: vec![mesh.into()], objects: vec![object], ..Scene::default() };
        assert_eq!(choose(&scene), DVec3::new(0.0, 0.125, 0.0));
    }
}
