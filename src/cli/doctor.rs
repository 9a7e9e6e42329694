//! What `info --validate` tells of meshes: the flaws that the mesh doctor finds, and a size that looks like a wrong unit.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::Instant;

use glam::DVec2;
use serde::Serialize;

use super::info::BoundsInfo;
use crate::geometry::TriangleMesh;
use crate::geometry::doctor::{self, Flaw, MOST_PLACES, Place};
use crate::scene::texture::Wrap;
use crate::scene::{Scene, TextureRef};

/// Coordinates this far outside an image that does not repeat are rounding: less than half a texel of 4096.
const OUTSIDE_TOLERANCE: f64 = 1e-4;

/// The largest side of scenes that are usual, in units: from a millimetre to a hundred kilometres if these are metres.
const USUAL_SIZE: std::ops::RangeInclusive<f64> = 1e-3..=1e5;

/// What the doctor found in all meshes.
#[derive(Debug, Serialize)]
pub struct Diagnosis {
    /// Wall-clock seconds that it took.
    pub seconds: f64,
    /// Flaws that were found, every mesh counted once.
    pub flaws: Vec<FlawInfo>,
    /// What is said of the scene's size; null where that is usual.
    pub size: Option<String>,
    /// Meshes so large or small that they are stored divided by a power of two.
    pub scaled_meshes: usize,
}

/// A flaw, how often it was found, and where first.
#[derive(Debug, Serialize)]
pub struct FlawInfo {
    pub flaw: Flaw,
    pub count: u64,
    pub places: Vec<PlaceInfo>,
}

/// Where a flaw is.
#[derive(Debug, Serialize)]
pub struct PlaceInfo {
    /// The mesh's name.
    pub mesh: String,
    /// The triangle's number, from 0; null for a vertex of none.
    pub triangle: Option<u32>,
    /// The face of the file that it was cut from, from 0; in files of triangles its own number.
    pub face: Option<u32>,
    /// The vertex's number in the mesh, from 0; null for a triangle as a whole.
    pub vertex: Option<u32>,
    /// The vertex, or the triangle's first, in the file's coordinates; null where there is none.
    pub position: Option<[f64; 3]>,
}

impl Diagnosis {
    /// Examines every mesh of a scene.
    pub fn of(scene: &Scene, bounds: Option<&BoundsInfo>) -> Self {
        let start = Instant::now();
        let mut flaws: BTreeMap<Flaw, FlawInfo> = BTreeMap::new();
        let clamped = clamped_textures(scene);
        for mesh in &scene.meshes {
            let outside = |material: u32, vertex: u32| is_outside(mesh, &clamped[material as usize], vertex);
            for (flaw, finding) in doctor::examine(mesh, &outside).iter() {
                let info = flaws.entry(flaw).or_insert_with(|| FlawInfo { flaw, count: 0, places: Vec::new() });
                info.count += finding.count;
                let room = MOST_PLACES - info.places.len();
                info.places.extend(finding.places.iter().take(room).map(|place| PlaceInfo::of(mesh, *place)));
            }
        }
        Self {
            seconds: start.elapsed().as_secs_f64(),
            flaws: flaws.into_values().collect(),
            size: bounds.and_then(|bounds| unusual_size(largest_side(bounds))),
            scaled_meshes: scene.meshes.iter().filter(|mesh| mesh.exponent != 0).count(),
        }
    }
}

impl PlaceInfo {
    fn of(mesh: &TriangleMesh, Place { triangle, vertex }: Place) -> Self {
        let first = || triangle.map(|number| mesh.indices[number as usize][0]);
        let position = vertex.or_else(first).and_then(|vertex| mesh.positions.get(vertex as usize));
        Self {
            mesh: mesh.name.clone(),
            triangle,
            face: triangle.map(|number| mesh.source_face(number)),
            vertex,
            position: position.map(|&position| mesh.file_position(position).to_array()),
        }
    }

    /// In one line, for a person.
    pub fn text(&self) -> String {
        let mut text = format!("mesh `{}`", self.mesh);
        for (what, number) in [("triangle", self.triangle), ("face", self.face), ("vertex", self.vertex)] {
            if let Some(number) = number {
                // Writing to a string cannot fail.
                let _ = write!(text, ", {what} {number}");
            }
        }
        if let Some([x, y, z]) = self.position {
            let _ = write!(text, ", at {x} {y} {z}");
        }
        text
    }
}

/// A use of an image that does not repeat along each axis.
struct Clamped {
    texture: TextureRef,
    axes: [bool; 2],
}

/// For each material its images that do not repeat along both axes.
fn clamped_textures(scene: &Scene) -> Vec<Vec<Clamped>> {
    let clamped = |texture: &TextureRef| {
        let axes = scene.textures[texture.texture as usize].wrap.map(|wrap| wrap == Wrap::Clamp);
        axes.contains(&true).then_some(Clamped { texture: *texture, axes })
    };
    scene.materials.iter().map(|material| material.textures().filter_map(clamped).collect()).collect()
}

/// Whether a vertex lies outside one of the images.
fn is_outside(mesh: &TriangleMesh, clamped: &[Clamped], vertex: u32) -> bool {
    clamped.iter().any(|Clamped { texture, axes }| {
        let set = if texture.second_uvs { &mesh.second_uvs } else { &mesh.uvs };
        let Some(uv) = set.as_ref().map(|uvs| uvs[vertex as usize]) else { return false };
        let place: DVec2 = texture.place(uv.as_dvec2());
        let inside = -OUTSIDE_TOLERANCE..=1.0 + OUTSIDE_TOLERANCE;
        (axes[0] && !inside.contains(&place.x)) || (axes[1] && !inside.contains(&place.y))
    })
}

fn largest_side(bounds: &BoundsInfo) -> f64 {
    (0..3).map(|axis| bounds.max[axis] - bounds.min[axis]).fold(0.0, f64::max)
}

/// What to say of a scene whose largest side has this many units, unless that is usual: the unit that makes it so.
fn unusual_size(units: f64) -> Option<String> {
    // Metres are tried first, since a size that is usual in them is not told at all.
    const UNITS: [(&str, f64); 6] = [
        ("millimetre", 1e-3),
        ("micrometre", 1e-6),
        ("nanometre", 1e-9),
        ("kilometre", 1e3),
        ("Earth's radius", 6.371e6),
        ("astronomical unit", 1.496e11),
    ];
    if units == 0.0 || USUAL_SIZE.contains(&units) {
        return None;
    }
    let what = if units > *USUAL_SIZE.end() { "huge" } else { "tiny" };
    let usual = UNITS.iter().find(|(_, metres)| USUAL_SIZE.contains(&(units * metres)));
    let likely = usual.map_or("no unit makes it usual".to_owned(), |(unit, metres)| {
        format!("likely in units of a {unit}: {:.3e} m", units * metres)
    });
    Some(format!("{what}, {units:.3e} units across; {likely}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mesh::Materials;
    use crate::scene::texture::Texels;
    use crate::scene::{Material, Texture};
    use glam::{Vec2, Vec3};

    #[test]
    fn sizes_that_look_like_a_wrong_unit_are_told() {
        for usual in [0.0, 1e-3, 1.0, 1e5] {
            assert_eq!(unusual_size(usual), None);
        }
        let said = |units: f64| unusual_size(units).unwrap();
        assert_eq!(said(2.5e5), "huge, 2.500e5 units across; likely in units of a millimetre: 2.500e2 m");
        assert!(said(1e10).contains("micrometre"));
        assert_eq!(said(5e-4), "tiny, 5.000e-4 units across; likely in units of a kilometre: 5.000e-1 m");
        assert!(said(1e-30).ends_with("no unit makes it usual"));
    }

    #[test]
    fn only_clamped_axes_of_the_images_in_use_count() {
        let uvs = vec![Vec2::ZERO, Vec2::new(2.0, 0.0), Vec2::new(0.0, 1.00005)];
        let mesh = TriangleMesh {
            name: "m".into(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y].into(),
            indices: vec![[0, 1, 2]].into(),
            uvs: Some(uvs.into()),
            materials: Materials::One(0),
            ..Default::default()
        };
        let outside = |wrap, scale| {
            let image = Texture::new("t", 1, 1, Texels::Srgb8(vec![[0; 4]].into()));
            let texture = TextureRef::scaled(0, DVec2::splat(scale), DVec2::ZERO);
            let scene = Scene {
                meshes: vec![mesh.clone().finish().unwrap().into()],
                textures: vec![Texture { wrap, ..image }],
                materials: vec![Material { diffuse_texture: Some(texture), ..Material::default() }],
                ..Scene::default()
            };
            let flaws = Diagnosis::of(&scene, None).flaws;
            let mut outside = flaws.into_iter().filter(|flaw| flaw.flaw == Flaw::OutsideImage);
            outside.next().map(|flaw| flaw.places[0].text())
        };
        let told = "mesh `m`, triangle 0, face 0, vertex 1, at 1 0 0";
        assert_eq!(outside([Wrap::Clamp, Wrap::Repeat], 1.0).as_deref(), Some(told));
        assert_eq!(outside([Wrap::Repeat, Wrap::Clamp], 1.0), None, "1.00005 is rounding");
        assert_eq!(outside([Wrap::Repeat, Wrap::Mirror], 1.0), None);
        assert_eq!(outside([Wrap::Clamp, Wrap::Clamp], 0.5), None, "what counts is where the image is read");
    }
}
