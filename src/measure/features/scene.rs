//! The plain scene, and what each feature adds to it.
//!
//! A ball of 9,024 triangles on a floor of two, one mesh as a file has it, without normals and texture coordinates, one
//! matt material, one light. It is one untransformed mesh, which has one level.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A feature that a scene may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// Shading normals.
    Normals,
    /// Texture coordinates alone.
    TextureCoordinates,
    /// An image on the mesh.
    Textures,
    /// A mesh that is turned.
    Transforms,
    /// A sphere beside the mesh.
    Quadrics,
    /// A mirroring material.
    Reflection,
    /// A glass material.
    Refraction,
    /// Eight lights.
    Lights,
}

const RINGS: u32 = 48;
const SEGMENTS: u32 = 96;

impl Feature {
    /// Every feature.
    pub const ALL: [Self; 8] = [
        Self::Normals,
        Self::TextureCoordinates,
        Self::Textures,
        Self::Transforms,
        Self::Quadrics,
        Self::Reflection,
        Self::Refraction,
        Self::Lights,
    ];

    /// What it is called in tables and in builds that leave it out.
    pub fn name(self) -> &'static str {
        match self {
            Self::Normals => "normals",
            Self::TextureCoordinates => "uvs",
            Self::Textures => "textures",
            Self::Transforms => "transforms",
            Self::Quadrics => "quadrics",
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
            Self::Lights => "lights",
        }
    }

    /// What the scene has more than the plain one.
    pub fn adds(self) -> &'static str {
        match self {
            Self::Normals => "a normal a vertex",
            Self::TextureCoordinates => "texture coordinates, no image",
            Self::Textures => "texture coordinates and a 64x64 image",
            Self::Transforms => "the mesh is turned and moved",
            Self::Quadrics => "a sphere beside the mesh",
            Self::Reflection => "kr = 0.3",
            Self::Refraction => "kt = 0.5",
            Self::Lights => "8 lights for 1",
        }
    }
}

/// Writes the plain scene, or the one with a feature, into a folder and returns the scene file's path.
///
/// # Errors
/// What the file system says.
pub fn write(folder: &Path, feature: Option<Feature>) -> Result<PathBuf> {
    let name = feature.map_or("plain", Feature::name);
    let put = |file: String, content: &[u8]| {
        let path = folder.join(file);
        std::fs::write(&path, content).map_err(|cause| Error::system(&path, cause))?;
        Ok(path)
    };
    put(format!("{name}.obj"), mesh(feature).as_bytes())?;
    if feature == Some(Feature::Textures) {
        put("image.bmp".into(), &image())?;
    }
    put(format!("{name}.toml"), scene(feature).as_bytes())
}

fn scene(feature: Option<Feature>) -> String {
    let is = |other| feature == Some(other);
    let name = feature.map_or("plain", Feature::name);
    let mut text = String::from(
        "ambient = 0.1\n[film]\nsize = [96, 72]\nmax_depth = 4\n[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\nfov = 40\n",
    );
    for light in 0..if is(Feature::Lights) { 8 } else { 1 } {
        let _ = write!(text, "[[light]]\nkind = \"point\"\nposition = [{}, 6, 4]\nintensity = 0.1\n", light - 3);
    }
    let extra = match feature {
        Some(Feature::Textures) => "texture = { file = \"image.bmp\" }\n",
        Some(Feature::Reflection) => "kr = 0.3\n",
        Some(Feature::Refraction) => "kt = 0.5\n",
        _ => "",
    };
    let _ = write!(text, "[[material]]\nname = \"matt\"\ndiffuse = 0.7\nks = 0\n{extra}");
    let placed = if is(Feature::Transforms) {
        "transform = [{ rotate = [0, 30, 0] }, { translate = [0.1, 0, 0] }]\n"
    } else {
        ""
    };
    let _ = write!(text, "[[object]]\nmesh = \"{name}.obj\"\nmaterial = \"matt\"\n{placed}");
    if is(Feature::Quadrics) {
        text += "[[object]]\nsphere = { center = [1.6, -0.5, 0.5], radius = 0.5 }\nmaterial = \"matt\"\n";
    }
    text
}

/// The ball and the floor as an OBJ file.
fn mesh(feature: Option<Feature>) -> String {
    let normals = feature == Some(Feature::Normals);
    let uvs = matches!(feature, Some(Feature::TextureCoordinates | Feature::Textures));
    let mut text = String::new();
    for ring in 0..=RINGS {
        for segment in 0..=SEGMENTS {
            let (v, u) = (f64::from(ring) / f64::from(RINGS), f64::from(segment) / f64::from(SEGMENTS));
            let (polar, azimuth) = (std::f64::consts::PI * v, std::f64::consts::TAU * u);
            let (x, y) = (libm::sin(polar) * libm::sin(azimuth), libm::cos(polar));
            let z = libm::sin(polar) * libm::cos(azimuth);
            let _ = writeln!(text, "v {x:.9} {y:.9} {z:.9}");
            if normals {
                let _ = writeln!(text, "vn {x:.9} {y:.9} {z:.9}");
            }
            if uvs {
                let _ = writeln!(text, "vt {u:.9} {:.9}", 1.0 - v);
            }
        }
    }
    let corner = |number: u32| match (uvs, normals) {
        (false, false) => format!("{number}"),
        (false, true) => format!("{number}//{number}"),
        _ => format!("{number}/{number}"),
    };
    let mut face = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(corner);
        let _ = writeln!(text, "f {a} {b} {c}");
    };
    let at = |ring: u32, segment: u32| 1 + ring * (SEGMENTS + 1) + segment;
    for ring in 0..RINGS {
        for segment in 0..SEGMENTS {
            let (a, b) = (at(ring, segment), at(ring, segment + 1));
            let (c, d) = (at(ring + 1, segment + 1), at(ring + 1, segment));
            if ring > 0 {
                face([a, c, b]);
            }
            if ring + 1 < RINGS {
                face([a, d, c]);
            }
        }
    }
    // The floor uses coordinates of its own; its normals and texture coordinates are some of the ball's.
    let first = at(RINGS, SEGMENTS) + 1;
    for (x, z) in [(-4, 4), (4, 4), (4, -4), (-4, -4)] {
        let _ = writeln!(text, "v {x} -1 {z}");
    }
    let floor = |number: u32| match (uvs, normals) {
        (false, false) => format!("{number}"),
        (false, true) => format!("{number}//1"),
        _ => format!("{number}/1"),
    };
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        let _ = writeln!(text, "f {} {} {}", floor(first + a), floor(first + b), floor(first + c));
    }
    text
}

/// A chequered image of 64 x 64 pixels: a BMP file of 24 bits a pixel.
fn image() -> Vec<u8> {
    const SIDE: u32 = 64;
    let mut file = b"BM".to_vec();
    for field in [54 + 3 * SIDE * SIDE, 0, 54, 40, SIDE, SIDE, 1 | 24 << 16, 0, 3 * SIDE * SIDE, 2835, 2835, 0, 0] {
        file.extend(field.to_le_bytes());
    }
    for y in 0..SIDE {
        for x in 0..SIDE {
            file.extend(if (x / 8 + y / 8) % 2 == 0 { [60, 80, 200] } else { [230, 220, 210] });
        }
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{LoadOptions, open};
    use crate::progress::Silent;
    use crate::scene::needs::Needs;

    #[test]
    fn each_scene_has_its_feature_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let needs = |feature| {
            let path = write(folder.path(), feature).unwrap();
            let loaded = open(&path, &LoadOptions::default(), &Silent).unwrap();
            assert_eq!(loaded.scene.meshes[0].live_count(), 9026);
            Needs::of(&loaded.scene)
        };
        let plain = needs(None);
        let expected = Needs { mesh_objects: 1, lights: 1, ..Needs::default() };
        assert_eq!(plain, expected);
        let with = |change: fn(&mut Needs)| {
            let mut needs = expected;
            change(&mut needs);
            needs
        };
        for feature in Feature::ALL {
            let expected = match feature {
                Feature::Normals => with(|needs| needs.smooth_meshes = 1),
                Feature::TextureCoordinates => with(|needs| needs.uv_meshes = 1),
                Feature::Textures => with(|needs| (needs.uv_meshes, needs.textured_materials) = (1, 1)),
                Feature::Transforms => with(|needs| needs.transformed_objects = 1),
                Feature::Quadrics => with(|needs| (needs.quadric_objects, needs.transformed_objects) = (1, 1)),
                Feature::Reflection => with(|needs| needs.reflective_materials = 1),
                Feature::Refraction => with(|needs| needs.transmissive_materials = 1),
                Feature::Lights => with(|needs| needs.lights = 8),
            };
            assert_eq!(needs(Some(feature)), expected, "{feature:?}");
        }
    }
}
