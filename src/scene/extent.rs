//! Where objects are: the corners of their boxes in the file's coordinates.

use glam::DVec3;

use crate::geometry::Bounds;
use crate::geometry::mesh::LARGEST_COORDINATE;
use crate::math::transform::point;
use crate::scene::{Object, Scene, Shape};

/// How an object is of no use to the renderer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misfit {
    /// Some of it lies beyond 2^40, and beyond the farthest vertex of its mesh where that is farther, or nowhere.
    TooFar,
    /// It is smaller than 2^-40 along every axis.
    TooSmall,
}

/// The boxes of a scene's meshes, each found once however many objects show it.
#[derive(Debug, Clone, Default)]
pub struct Extents {
    meshes: Vec<Bounds>,
}

impl Extents {
    /// The boxes of all meshes.
    pub fn of(scene: &Scene) -> Self {
        Self { meshes: scene.meshes.iter().map(|mesh| mesh.bounds()).collect() }
    }

    /// Adds the boxes of meshes that the scene gained.
    pub fn add(&mut self, boxes: &[Bounds]) {
        self.meshes.extend(boxes);
    }

    /// The corners of the box around what the object shows, in the file's coordinates; `None` if that is nothing or goes
    /// to infinity. The corners bound the object, tightly unless it is turned or sheared.
    pub fn corners(&self, scene: &Scene, object: &Object) -> Option<[DVec3; 8]> {
        match object.shape {
            Shape::Mesh(number) => {
                let mesh = &scene.meshes[number as usize];
                let bounds = Some(&self.meshes[number as usize]).filter(|bounds| !bounds.is_empty())?;
                Some(bounds.corners().map(|corner| point(&object.transform, mesh.file_position(corner))))
            }
            Shape::Quadric(quadric) => {
                let bounds = scene.quadrics[quadric as usize].bounds().filter(|bounds| !bounds.is_empty())?;
                Some(bounds.corners().map(|corner| point(&object.transform, corner.as_dvec3())))
            }
        }
    }

    /// What keeps the object from being rendered, if anything. Of what goes to infinity, the place alone counts.
    pub fn misfit(&self, scene: &Scene, object: &Object) -> Option<Misfit> {
        let largest = f64::from(LARGEST_COORDINATE);
        // A mesh may lie where its file puts it, as long as its objects go no farther.
        let farthest = match object.shape {
            Shape::Mesh(number) if !self.meshes[number as usize].is_empty() => {
                let mesh = &scene.meshes[number as usize];
                let corners = self.meshes[number as usize].corners();
                corners.map(|p| mesh.file_position(p).abs().max_element()).into_iter().fold(largest, f64::max)
            }
            _ => largest,
        };
        // Written so that NaN is too far.
        let is_near = |p: DVec3| p.abs().cmple(DVec3::splat(farthest)).all();
        let Some(corners) = self.corners(scene, object) else {
            return (!is_near(object.transform.translation)).then_some(Misfit::TooFar);
        };
        if !corners.iter().all(|&corner| is_near(corner)) {
            return Some(Misfit::TooFar);
        }
        let (min, max) = corners.iter().fold((corners[0], corners[0]), |(min, max), &p| (min.min(p), max.max(p)));
        ((max - min).max_element() < 1.0 / largest).then_some(Misfit::TooSmall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{TriangleMesh, shapes};
    use glam::{DAffine3, Vec3};

    /// A triangle from (1000, 0, 0) to (1001, 1, 0), a sphere, and an endless plane.
    fn scene() -> Scene {
        let mesh = TriangleMesh {
            origin: DVec3::X * 1000.0,
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y].into(),
            indices: vec![[0, 1, 2]].into(),
            ..Default::default()
        };
        Scene {
            meshes: vec![mesh.finish().unwrap().into(), TriangleMesh::default().into()],
            quadrics: vec![shapes::sphere(), shapes::plane(None)],
            ..Default::default()
        }
    }

    fn object(shape: Shape, transform: DAffine3) -> Object {
        Object { name: String::new(), shape, transform, material: None }
    }

    #[test]
    fn corners_are_those_of_the_placed_box() {
        let (scene, shift) = (scene(), DAffine3::from_translation(DVec3::Z));
        let extents = Extents::of(&scene);
        let corners = extents.corners(&scene, &object(Shape::Mesh(0), shift)).unwrap();
        let has = |x, y| corners.contains(&DVec3::new(x, y, 1.0));
        assert!(has(1000.0, 0.0) && has(1001.0, 0.0) && has(1000.0, 1.0) && has(1001.0, 1.0), "{corners:?}");
        assert!(
            extents.corners(&scene, &object(Shape::Quadric(0), shift)).unwrap().contains(&DVec3::new(1.0, -1.0, 2.0))
        );
        assert_eq!(extents.corners(&scene, &object(Shape::Mesh(1), shift)), None, "nothing");
        assert_eq!(extents.corners(&scene, &object(Shape::Quadric(1), shift)), None, "without end");
    }

    #[test]
    fn what_no_number_holds_is_a_misfit() {
        let scene = scene();
        let extents = Extents::of(&scene);
        let misfit = |shape, transform| extents.misfit(&scene, &object(shape, transform));
        let (mesh, sphere, plane) = (Shape::Mesh(0), Shape::Quadric(0), Shape::Quadric(1));
        let scale = |factor: f64| DAffine3::from_scale(DVec3::splat(factor));
        let shift = |y: f64| DAffine3::from_translation(DVec3::Y * y);
        for shape in [mesh, sphere, plane] {
            assert_eq!(misfit(shape, scale(1e-6)), None);
            assert_eq!(misfit(shape, shift(1e12)), None);
            assert_eq!(misfit(shape, shift(-1e13)), Some(Misfit::TooFar));
            assert_eq!(misfit(shape, shift(f64::NAN)), Some(Misfit::TooFar));
        }
        assert_eq!(misfit(mesh, scale(1e10)), Some(Misfit::TooFar), "it is not at the origin");
        assert_eq!(misfit(sphere, scale(1e10)), None);
        assert_eq!(misfit(sphere, scale(1e-13)), Some(Misfit::TooSmall));
        assert_eq!(misfit(sphere, DAffine3::from_scale(DVec3::new(1e-13, 1e-13, 1.0))), None, "a needle");
    }
}
