//! A glTF whose picture shows every mistake of orientation: crates whose faces say which one they are.
//!
//! Each face carries its name and, clockwise from its upper left corner, the figures 1 to 4 in red, green, blue and
//! yellow. Crates hang below each other in a hierarchy of nodes; one node mirrors, and its words must read backwards.

use glam::{DVec2, DVec3};
use serde_json::json;

use crate::OutputFile;
use crate::gltf::Writer;
use crate::mesh::{Mesh, UNIT_SQUARE};
use crate::picture::{Color, GLYPH, Picture};
use crate::solids;

/// The faces in the order of [`solids::cuboid`], three tiles a row.
const FACES: [&str; 6] = ["FRONT", "RIGHT", "BACK", "LEFT", "TOP", "BASE"];

/// Width and height of a tile in pixels.
const TILE: u32 = 256;

const FRAME: Color = [104, 70, 38];
const WOOD: [Color; 2] = [[198, 154, 100], [186, 141, 88]];
const INK: Color = [40, 26, 16];
const FIGURES: [(&str, Color); 4] =
    [("1", [200, 30, 30]), ("2", [20, 130, 40]), ("3", [30, 60, 190]), ("4", [245, 205, 40])];

/// The picture of all six faces.
fn atlas() -> Picture {
    let mut picture = Picture::new(3 * TILE, 2 * TILE, FRAME);
    for (number, name) in (0..).zip(FACES) {
        let [left, top] = [number % 3 * TILE, number / 3 * TILE];
        const EDGE: u32 = 12;
        const PLANKS: u32 = 4;
        let plank = (TILE - 2 * EDGE) / PLANKS;
        for row in 0..PLANKS {
            let at = [left + EDGE, top + EDGE + row * plank];
            picture.fill(at, [TILE - 2 * EDGE, plank - 2], WOOD[row as usize % 2]);
        }
        const DOT: u32 = 7;
        let width = (name.len() as u32 * (GLYPH.0 + 1) - 1) * DOT;
        let at = [left + (TILE - width) / 2, top + (TILE - GLYPH.1 * DOT) / 2];
        picture.text(at, DOT, name, INK);
        const SMALL_DOT: u32 = 5;
        let near = EDGE + 8;
        let far = |size: u32| TILE - near - size * SMALL_DOT;
        let corners = [[near, near], [far(GLYPH.0), near], [far(GLYPH.0), far(GLYPH.1)], [near, far(GLYPH.1)]];
        for ([x, y], (figure, color)) in corners.into_iter().zip(FIGURES) {
            picture.text([left + x, top + y], SMALL_DOT, figure, color);
        }
    }
    picture
}

/// The unit cube with each face's part of the picture on it.
fn crate_mesh() -> Mesh {
    let mut mesh = solids::cuboid();
    for (number, uv) in mesh.uvs.iter_mut().enumerate() {
        let face = number / 4;
        let tile = DVec2::new((face % 3) as f64, (1 - face / 3) as f64);
        *uv = (tile + *uv) / DVec2::new(3.0, 2.0);
    }
    mesh
}

/// A square of side 1 on y = 0 whose texture repeats `repeats` times each way.
fn floor_mesh(repeats: f64) -> Mesh {
    let corners = UNIT_SQUARE.map(|corner| DVec3::new(corner.x - 0.5, 0.0, 0.5 - corner.y));
    let mut mesh = Mesh { positions: corners.to_vec(), ..Mesh::default() };
    mesh.push_quad([0, 1, 2, 3], UNIT_SQUARE.map(|corner| corner * repeats));
    mesh
}

/// The rotation about +Y, as glTF writes it.
fn turn(degrees: f64) -> [f64; 4] {
    let (sin, cos) = libm::sincos(0.5 * degrees.to_radians());
    [0.0, sin, 0.0, cos]
}

/// The glTF, its buffer and its picture; it also uses `checker.png`.
pub fn files() -> Vec<OutputFile> {
    let mut writer = Writer::default();
    let crate_number = writer.add_mesh("crate", &crate_mesh(), 0);
    let floor_number = writer.add_mesh("floor", &floor_mesh(2.0), 1);
    let faces = writer.add_image_file("textured_crate.png");
    let checker = writer.add_image_file("checker.png");
    let (text, buffer) = writer.into_gltf(
        json!({
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": { "KHR_lights_punctual": { "lights": [
                { "name": "key", "type": "point", "color": [1.0, 0.93, 0.82], "intensity": 260.0 },
                { "name": "fill", "type": "directional", "color": [0.75, 0.85, 1.0], "intensity": 3.0 },
            ] } },
            "samplers": [{ "magFilter": 9729, "minFilter": 9729, "wrapS": 10497, "wrapT": 10497 }],
            "textures": [{ "source": faces, "sampler": 0 }, { "source": checker, "sampler": 0 }],
            "materials": [
                { "name": "wood", "pbrMetallicRoughness": {
                    "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0, "roughnessFactor": 0.9 } },
                { "name": "floor", "pbrMetallicRoughness": {
                    "baseColorTexture": { "index": 1 }, "metallicFactor": 0.0, "roughnessFactor": 0.9 } },
            ],
            "cameras": [{ "name": "photographer", "type": "perspective",
                "perspective": { "aspectRatio": 1.5, "yfov": 0.62, "znear": 0.1 } }],
            "scene": 0,
            "scenes": [{ "name": "yard", "nodes": [0, 8, 10, 11] }],
            "nodes": [
                { "name": "yard", "children": [1, 2, 5, 7] },
                { "name": "ground", "mesh": floor_number, "scale": [12.0, 1.0, 12.0] },
                // A tower: each crate stands on its parent in the parent's coordinates.
                { "name": "tower", "mesh": crate_number, "translation": [-0.9, 0.75, -0.4], "rotation": turn(20.0),
                    "scale": [1.5, 1.5, 1.5], "children": [3] },
                { "name": "second", "mesh": crate_number, "translation": [0.05, 0.85, 0.0], "rotation": turn(-35.0),
                    "scale": [0.7, 0.7, 0.7], "children": [4] },
                { "name": "third", "mesh": crate_number, "translation": [0.0, 0.8, 0.0], "rotation": turn(30.0),
                    "scale": [0.6, 0.6, 0.6] },
                // Its words read backwards.
                { "name": "mirror", "translation": [1.5, 0.0, 0.3], "scale": [-1.0, 1.0, 1.0], "children": [6] },
                { "name": "mirrored", "mesh": crate_number, "translation": [0.0, 0.5, 0.0], "rotation": turn(15.0) },
                // Lies on its back, front up, stretched.
                { "name": "fallen", "mesh": crate_number, "translation": [0.3, 0.3, 1.6],
                    "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
                    "scale": [0.9, 0.9, 0.6] },
                { "name": "tripod", "translation": [0.2, 2.6, 7.8], "children": [9] },
                // Looks down by 8 degrees.
                { "name": "photographer", "camera": 0,
                    "rotation": [libm::sin(-4f64.to_radians()), 0.0, 0.0, libm::cos(4f64.to_radians())] },
                { "name": "key", "translation": [3.0, 5.0, 4.0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
                // Shines from the left, behind the camera: -Z turned down and to the right.
                { "name": "fill", "rotation": fill_rotation(), "extensions": { "KHR_lights_punctual": { "light": 1 } } },
            ],
        }),
        "textured_crate.bin",
    );
    vec![
        OutputFile::new("textured_crate.gltf", text),
        OutputFile::new("textured_crate.bin", buffer),
        OutputFile::new("textured_crate.png", atlas().png()),
    ]
}

/// Takes -Z to where the fill light shines.
fn fill_rotation() -> [f64; 4] {
    let towards = DVec3::new(0.6, -0.5, -0.8).normalize();
    glam::DQuat::from_rotation_arc(DVec3::NEG_Z, towards).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::assert_sound;

    #[test]
    fn meshes_are_sound() {
        assert_sound(&crate_mesh());
        assert_sound(&floor_mesh(2.0));
    }

    #[test]
    fn the_front_of_the_crate_shows_the_upper_left_tile_upright() {
        let mesh = crate_mesh();
        let front = mesh.triangles[0];
        let lower_left = mesh.positions[front[0].position as usize];
        assert_eq!(lower_left, DVec3::new(-0.5, -0.5, 0.5));
        assert_eq!(mesh.uvs[front[0].uv as usize], DVec2::new(0.0, 0.5));
        assert_eq!(mesh.uvs[front[2].uv as usize], DVec2::new(1.0 / 3.0, 1.0));
    }

    #[test]
    fn the_document_is_valid_and_its_hierarchy_four_deep() {
        let parsed = gltf::Gltf::from_slice(&files()[0].bytes).unwrap();
        fn depth(node: &gltf::Node) -> usize {
            1 + node.children().map(|child| depth(&child)).max().unwrap_or(0)
        }
        let scene = parsed.default_scene().unwrap();
        assert_eq!(scene.nodes().map(|node| depth(&node)).max(), Some(4));
        assert_eq!(parsed.lights().unwrap().count(), 2);
        let uses = parsed.nodes().filter(|node| node.mesh().is_some_and(|mesh| mesh.index() == 0)).count();
        assert_eq!(uses, 5);
    }
}
