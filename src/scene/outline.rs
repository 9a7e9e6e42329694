//! Points on the surface of a scene, in the file's coordinates.

use glam::{DVec3, Vec3};

use crate::geometry::TriangleMesh;
use crate::math::transform::point;
use crate::scene::extent::Extents;
use crate::scene::{Object, Scene, Shape};

/// So many points are looked at even if it is many instances of few triangles that have them: a fifth of a second.
const MOST_POINTS: usize = 20_000_000;

/// Visits points whose hull is that of the scene, or just around it: the corners of the triangles that can be hit, and of
/// the boxes around bounded quadrics.
///
/// Where instances have far more points than the meshes themselves, the corners of every object's box stand for them.
pub(super) fn visit(scene: &Scene, mut visitor: impl FnMut(DVec3)) {
    let read = scene.meshes.iter().map(|mesh| mesh.live_count() * 3).sum();
    let by_boxes = count(scene) > MOST_POINTS.max(read);
    let extents = Extents::of(scene);
    for object in &scene.objects {
        match mesh_of(scene, object).filter(|_| !by_boxes) {
            Some(mesh) => placed_corners(mesh, object).for_each(&mut visitor),
            None => extents.corners(scene, object).into_iter().flatten().for_each(&mut visitor),
        }
    }
}

/// A fair choice of at most about two million points of the surface.
pub(super) fn sample(scene: &Scene) -> Vec<DVec3> {
    const MOST: usize = 2_000_000;
    let stride = count(scene).div_ceil(MOST).max(1);
    let extents = Extents::of(scene);
    let mut points = Vec::new();
    for object in &scene.objects {
        match mesh_of(scene, object) {
            Some(mesh) => points.extend(placed_corners(mesh, object).step_by(stride)),
            None => points.extend(extents.corners(scene, object).into_iter().flatten()),
        }
    }
    points
}

/// How many points the objects have.
fn count(scene: &Scene) -> usize {
    scene.objects.iter().map(|object| mesh_of(scene, object).map_or(8, |mesh| mesh.live_count() * 3)).sum()
}

fn mesh_of<'a>(scene: &'a Scene, object: &Object) -> Option<&'a TriangleMesh> {
    match object.shape {
        Shape::Mesh(mesh) => Some(&scene.meshes[mesh as usize]),
        Shape::Quadric(_) => None,
    }
}

/// The corners of the triangles that can be hit, one triangle after the other.
fn placed_corners(mesh: &TriangleMesh, object: &Object) -> impl Iterator<Item = DVec3> {
    let place = |p: Vec3| point(&object.transform, mesh.file_position(p));
    mesh.live_triangles().flat_map(|number| mesh.triangle(number)).map(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes;
    use glam::DAffine3;

    fn scene(triangles: usize, instances: usize) -> Scene {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(0.25, 1.0, 0.5), Vec3::splat(99.0)];
        let mesh = TriangleMesh {
            positions: positions.into(),
            indices: vec![[0, 1, 2]; triangles].into(),
            ..Default::default()
        };
        let object = |shape, transform| Object { name: String::new(), shape, transform, material: None };
        let place = |i: usize| DAffine3::from_translation(DVec3::new(0.0, i as f64, 0.0));
        let mut objects: Vec<_> = (0..instances).map(|i| object(Shape::Mesh(0), place(i))).collect();
        objects.push(object(Shape::Quadric(0), place(0)));
        objects.push(object(Shape::Quadric(1), place(0)));
        Scene {
            meshes: vec![mesh.finish().unwrap().into()],
            quadrics: vec![shapes::sphere(), shapes::plane(None)],
            objects,
            ..Default::default()
        }
    }

    fn visited(scene: &Scene) -> (usize, DVec3, DVec3) {
        let (mut count, mut min, mut max) = (0, DVec3::INFINITY, DVec3::NEG_INFINITY);
        visit(scene, |p| (count, min, max) = (count + 1, min.min(p), max.max(p)));
        (count, min, max)
    }

    #[test]
    fn every_corner_is_visited_and_unused_vertices_are_not() {
        let (count, min, max) = visited(&scene(2, 3));
        assert_eq!((count, min, max), (2 * 3 * 3 + 8, DVec3::splat(-1.0), DVec3::new(1.0, 3.0, 1.0)));
    }

    #[test]
    fn boxes_stand_for_too_many_instances_and_for_nothing_else() {
        let (instances, triangles) = (7_000, 1_000);
        let (count, min, max) = visited(&scene(triangles, instances));
        assert_eq!((count, min, max), (8 * instances + 8, DVec3::splat(-1.0), DVec3::new(1.0, 7000.0, 1.0)));
        let (count, ..) = visited(&scene(triangles, 6_000));
        assert_eq!(count, 3 * 6_000 * triangles + 8);
    }

    #[test]
    fn a_sample_is_spread_over_all_objects() {
        let points = sample(&scene(1_000, 1_000));
        assert!((1_000_000..=2_000_000).contains(&points.len()), "{}", points.len());
        assert!(points.iter().any(|p| p.y > 999.0) && points.iter().any(|p| p.y < 0.0));
    }
}
