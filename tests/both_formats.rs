//! The same object as OBJ with MTL and as glTF: the pictures agree.
//!
//! MTL says what a glTF material says where it has the extension for physically based materials (`Pr`, `Pm`, `map_Pr`,
//! `map_Pm`, `norm`). Numbers are the same f32 in both files, so that pictures differ by nothing but the rounding of what
//! the two readers compute; the tolerance is a hundredth of what an 8-bit picture can show.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::Vec2;
use serde_json::{Value, json};
use whitted::formats::{LoadOptions, open};
use whitted::geometry::TriangleMesh;
use whitted::progress::Silent;
use whitted::render::Film;

use crate::common;

/// A hundredth of a step of 8 bits in the bright half of sRGB.
const TOLERANCE: f32 = 0.01 / 255.0;

/// A patch of a sphere's inside and outside: smooth, with normals and coordinates for images.
fn patch() -> TriangleMesh {
    let side = 12u32;
    let points = (0..=side).flat_map(|j| (0..=side).map(move |i| Vec2::new(i as f32, j as f32) / side as f32));
    let uvs: Vec<Vec2> = points.collect();
    let place = |uv: &Vec2| {
        let (x, y) = (2.0 * uv.x - 1.0, 2.0 * uv.y - 1.0);
        glam::Vec3::new(x, y, 0.5 - 0.4 * (x * x + y * y))
    };
    let normal = |uv: &Vec2| glam::Vec3::new(0.8 * (2.0 * uv.x - 1.0), 0.8 * (2.0 * uv.y - 1.0), 1.0).normalize();
    let (positions, normals) = (uvs.iter().map(place).collect(), uvs.iter().map(normal).collect());
    let at = |i: u32, j: u32| j * (side + 1) + i;
    let square =
        |i: u32, j: u32| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    let indices = (0..side).flat_map(|j| (0..side).flat_map(move |i| square(i, j))).collect();
    TriangleMesh { positions, normals: Some(normals), uvs: Some(uvs.into()), indices, ..TriangleMesh::default() }
}

fn write_obj(folder: &Path, mesh: &TriangleMesh, mtl: &str) {
    let mut text = "mtllib a.mtl\n".to_owned();
    for p in &mesh.positions {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for uv in mesh.uvs.iter().flatten() {
        writeln!(text, "vt {} {}", uv.x, uv.y).unwrap();
    }
    for n in mesh.normals.iter().flatten() {
        writeln!(text, "vn {} {} {}", n.x, n.y, n.z).unwrap();
    }
    text += "usemtl a\n";
    for [a, b, c] in mesh.indices.iter().map(|t| t.map(|i| i + 1)) {
        writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}").unwrap();
    }
    fs::write(folder.join("a.obj"), text).unwrap();
    fs::write(folder.join("a.mtl"), format!("newmtl a\n{mtl}\n")).unwrap();
}

fn write_gltf(folder: &Path, mesh: &TriangleMesh, material: &Value, images: &[&str]) {
    let mut bytes: Vec<u8> = Vec::new();
    let (mut views, mut accessors) = (Vec::new(), Vec::new());
    let mut add = |values: Vec<u8>, component: u32, kind: &str, count: usize| {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": values.len()}));
        accessors
            .push(json!({"bufferView": views.len() - 1, "componentType": component, "type": kind, "count": count}));
        bytes.extend(values);
    };
    let count = mesh.positions.len();
    let floats = |values: Vec<f32>| values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    add(floats(mesh.positions.iter().flat_map(|p| p.to_array()).collect()), 5126, "VEC3", count);
    add(floats(mesh.normals.iter().flatten().flat_map(|n| n.to_array()).collect()), 5126, "VEC3", count);
    add(floats(mesh.uvs.iter().flatten().flat_map(|uv| [uv.x, 1.0 - uv.y]).collect()), 5126, "VEC2", count);
    let indices: Vec<u8> = mesh.indices.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
    add(indices, 5125, "SCALAR", 3 * mesh.indices.len());
    let document = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}]}],
        "materials": [material],
        "images": images.iter().map(|uri| json!({"uri": uri})).collect::<Vec<_>>(),
        "textures": (0..images.len()).map(|source| json!({"source": source})).collect::<Vec<_>>(),
        "buffers": [{"uri": "a.bin", "byteLength": bytes.len()}],
        "bufferViews": views,
        "accessors": accessors,
    });
    fs::write(folder.join("a.gltf"), serde_json::to_vec(&document).unwrap()).unwrap();
    fs::write(folder.join("a.bin"), bytes).unwrap();
}

fn rendered(path: &Path) -> Film {
    let mut scene = open(path, &LoadOptions::default(), &Silent).unwrap().scene;
    (scene.film.width, scene.film.height, scene.film.samples) = (48, 48, 4);
    common::render(&scene)
}

fn check(mtl: &str, material: Value, images: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let image = |name: &str, texel: fn(u32, u32) -> [u8; 4]| {
        image::RgbaImage::from_fn(16, 16, |x, y| image::Rgba(texel(x, y))).save(folder.path().join(name)).unwrap();
    };
    image("color.png", |x, y| [(x * 16) as u8, (y * 16) as u8, 90, 255]);
    image("alpha.png", |x, y| [200, 120, (x * 16) as u8, (y * 16) as u8]);
    image("rough.png", |x, _| [(x * 16) as u8, (x * 16) as u8, (x * 16) as u8, 255]);
    image("metal.png", |_, y| [(y * 16) as u8, (y * 16) as u8, (y * 16) as u8, 255]);
    image("both.png", |x, y| [0, (x * 16) as u8, (y * 16) as u8, 255]);
    image("normal.png", |x, y| [(100 + 3 * x) as u8, (140 - 2 * y) as u8, 240, 255]);
    let mesh = patch();
    write_obj(folder.path(), &mesh, mtl);
    write_gltf(folder.path(), &mesh, &material, images);
    let [obj, gltf] = ["a.obj", "a.gltf"].map(|name| rendered(&folder.path().join(name)));
    let difference = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
    let largest = obj.color.iter().zip(&gltf.color).map(difference).fold(0.0, f32::max);
    assert!(largest <= TOLERANCE, "{mtl}: {largest}");
    let bright = obj.color.iter().filter(|color| color.iter().any(|&value| value > 0.02)).count();
    assert!(bright > obj.color.len() / 2, "{mtl}: there is something to see");
}

fn pbr(color: [f32; 4], metallic: f32, roughness: f32) -> Value {
    json!({"baseColorFactor": color, "metallicFactor": metallic, "roughnessFactor": roughness})
}

#[test]
fn dielectrics_and_metals_of_any_roughness() {
    for metallic in [0.0, 0.5, 1.0] {
        for roughness in [0.0, 0.3, 1.0] {
            let mtl = format!("Kd 1 0.75 0.25\nPm {metallic}\nPr {roughness}");
            check(&mtl, json!({"pbrMetallicRoughness": pbr([1.0, 0.75, 0.25, 1.0], metallic, roughness)}), &[]);
        }
    }
}

#[test]
fn light_and_blends() {
    let matt = pbr([0.5, 0.5, 0.5, 1.0], 0.0, 1.0);
    check(
        "Kd 0.5 0.5 0.5\nPr 1\nPm 0\nKe 0.25 0.5 0",
        json!({"pbrMetallicRoughness": matt, "emissiveFactor": [0.25, 0.5, 0.0]}),
        &[],
    );
    let blend = json!({"pbrMetallicRoughness": pbr([0.5, 0.25, 0.5, 0.5], 0.0, 0.5), "alphaMode": "BLEND"});
    check("Kd 0.5 0.25 0.5\nPr 0.5\nPm 0\nd 0.5", blend, &[]);
}

#[test]
fn images() {
    let image = |index: u32| json!({"index": index});
    let mut textured = pbr([1.0, 1.0, 1.0, 1.0], 0.0, 1.0);
    textured["baseColorTexture"] = image(0);
    check("Kd 1 1 1\nPr 1\nPm 0\nmap_Kd color.png", json!({"pbrMetallicRoughness": textured.clone()}), &["color.png"]);

    let mut both = pbr([0.75, 0.5, 0.25, 1.0], 1.0, 1.0);
    both["metallicRoughnessTexture"] = image(0);
    let mtl = "Kd 0.75 0.5 0.25\nPr 1\nPm 1\nmap_Pr rough.png\nmap_Pm metal.png";
    check(mtl, json!({"pbrMetallicRoughness": both}), &["both.png"]);

    let mut all = textured.clone();
    all["metallicFactor"] = json!(0.5);
    let light = json!({"pbrMetallicRoughness": all, "emissiveFactor": [0.5, 0.5, 0.5], "emissiveTexture": image(1)});
    check(
        "Kd 1 1 1\nPr 1\nPm 0.5\nmap_Kd color.png\nKe 0.5 0.5 0.5\nmap_Ke alpha.png",
        light,
        &["color.png", "alpha.png"],
    );

    let mut transparent = pbr([1.0, 1.0, 1.0, 1.0], 0.0, 1.0);
    transparent["baseColorTexture"] = image(0);
    let blend = json!({"pbrMetallicRoughness": transparent, "alphaMode": "BLEND"});
    check("Kd 1 1 1\nPr 1\nPm 0\nmap_Kd alpha.png\nmap_d alpha.png", blend, &["alpha.png"]);
}

#[test]
fn normal_maps() {
    let plain = pbr([0.75, 0.75, 0.75, 1.0], 0.0, 0.25);
    let bumpy = json!({"pbrMetallicRoughness": plain, "normalTexture": {"index": 0, "scale": 1.0}});
    check("Kd 0.75 0.75 0.75\nPr 0.25\nPm 0\nnorm normal.png", bumpy, &["normal.png"]);
}
