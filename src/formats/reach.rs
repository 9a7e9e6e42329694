//! How much of a scene the features in a ledger concern.

use std::collections::BTreeMap;

use crate::formats::ledger::{Entry, Scope};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::Materials;
use crate::scene::Scene;

/// What a feature concerns; nothing for a feature of the file as a whole.
///
/// Every mesh counts once, however many instances show it, as in the bytes that it takes; and by its own materials, though a
/// scene file may give an object another one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Reach {
    /// Materials that have the feature.
    pub materials: u64,
    /// Meshes that have it, or that have triangles of such materials.
    pub meshes: u64,
    /// Triangles that can be hit of such materials and meshes, each once.
    pub triangles: u64,
    /// Pixels in which such a triangle is the first that the camera sees; `None` where no picture was rendered.
    pub pixels: Option<u64>,
}

/// In how many pixels the first thing seen has each material, and is of each mesh, by their positions in the scene's lists.
#[derive(Debug, Clone, Copy)]
pub struct PixelCounts<'a> {
    /// By material.
    pub by_material: &'a [u64],
    /// By mesh.
    pub by_mesh: &'a [u64],
}

/// The triangles of a scene by mesh and material, counted once for all entries of its ledger.
#[derive(Debug)]
pub struct Census {
    /// For each mesh its materials, and how many of its triangles can be hit of each.
    meshes: Vec<BTreeMap<u32, u64>>,
}

impl Census {
    /// Counts the triangles of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self { meshes: scene.meshes.iter().map(|mesh| by_material(mesh)).collect() }
    }

    /// What an entry concerns. A feature of materials and of meshes takes the larger of both numbers of pixels, since a pixel
    /// may be in both: at least so many.
    pub fn reach(&self, entry: &Entry, pixels: Option<PixelCounts<'_>>) -> Reach {
        let mut reach = Reach::default();
        for (number, triangles) in (0u32..).zip(&self.meshes) {
            let whole = entry.scopes.contains(&Scope::Mesh(number));
            let concerned = |material: u32| whole || entry.scopes.contains(&Scope::Material(material));
            let mut own =
                triangles.iter().filter(|&(&material, _)| concerned(material)).map(|(_, count)| count).peekable();
            reach.meshes += u64::from(whole || own.peek().is_some());
            reach.triangles += own.sum::<u64>();
        }
        let is_material = |scope: &&Scope| matches!(scope, Scope::Material(_));
        reach.materials = entry.scopes.iter().filter(is_material).count() as u64;
        reach.pixels = pixels.map(|pixels| pixels.of(entry));
        reach
    }
}

impl PixelCounts<'_> {
    fn of(&self, entry: &Entry) -> u64 {
        let (mut materials, mut meshes) = (0, 0);
        for scope in &entry.scopes {
            let (sum, counts, number) = match *scope {
                Scope::Material(number) => (&mut materials, self.by_material, number),
                Scope::Mesh(number) => (&mut meshes, self.by_mesh, number),
            };
            *sum += counts.get(number as usize).copied().unwrap_or(0);
        }
        materials.max(meshes)
    }
}

fn by_material(mesh: &TriangleMesh) -> BTreeMap<u32, u64> {
    let mut counts = BTreeMap::new();
    match &mesh.materials {
        Materials::One(material) => {
            counts.insert(*material, mesh.live_count() as u64);
        }
        Materials::PerTriangle(materials) => {
            mesh.live_triangles().for_each(|number| *counts.entry(materials[number as usize]).or_default() += 1);
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Two meshes of three triangles, the third without area: the first of materials 0, 1, 1, the second of 1 alone.
    fn census() -> Census {
        let mesh = |materials| {
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
            let indices = vec![[0, 1, 2], [2, 1, 0], [0, 0, 1]];
            TriangleMesh { positions: positions.into(), indices: indices.into(), materials, ..Default::default() }
                .finish()
                .unwrap()
                .into()
        };
        let meshes = vec![mesh(Materials::PerTriangle(vec![0, 1, 1].into())), mesh(Materials::One(1))];
        Census::of(&Scene { meshes, ..Default::default() })
    }

    fn reach(scopes: &[Scope], pixels: Option<PixelCounts<'_>>) -> Reach {
        census().reach(&Entry { count: 1, scopes: scopes.iter().copied().collect() }, pixels)
    }

    #[test]
    fn triangles_are_counted_once_whatever_names_them() {
        let expect = |scopes: &[Scope], materials, meshes, triangles| {
            assert_eq!(reach(scopes, None), Reach { materials, meshes, triangles, pixels: None }, "{scopes:?}");
        };
        expect(&[], 0, 0, 0);
        expect(&[Scope::Material(0)], 1, 1, 1);
        expect(&[Scope::Material(1)], 1, 2, 3);
        expect(&[Scope::Mesh(0)], 0, 1, 2);
        expect(&[Scope::Mesh(0), Scope::Material(1)], 1, 2, 4);
        expect(&[Scope::Material(7), Scope::Mesh(7)], 1, 0, 0);
    }

    #[test]
    fn pixels_are_those_of_the_scopes() {
        let counts = PixelCounts { by_material: &[10, 200], by_mesh: &[110, 100] };
        let pixels = |scopes: &[Scope]| reach(scopes, Some(counts)).pixels;
        assert_eq!(pixels(&[]), Some(0));
        assert_eq!(pixels(&[Scope::Material(0), Scope::Material(1), Scope::Material(2)]), Some(210));
        assert_eq!(pixels(&[Scope::Mesh(0), Scope::Material(0)]), Some(110));
    }
}
