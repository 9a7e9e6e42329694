//! Spheres over metalness and roughness: what glTF's materials look like here.

use serde_json::{Value, json};

use crate::OutputFile;
use crate::gltf::Writer;
use crate::solids;

/// Metalness from top to bottom, and roughness from left to right.
const METALNESS: [f64; 3] = [0.0, 0.5, 1.0];
const ROUGHNESS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];

/// The file.
pub fn files() -> Vec<OutputFile> {
    let mut writer = Writer::default();
    let (mut materials, mut nodes): (Vec<Value>, Vec<Value>) = (Vec::new(), Vec::new());
    let sphere = writer.add_mesh("sphere", &solids::icosphere(4), 0);
    for (row, metalness) in METALNESS.into_iter().enumerate() {
        for (column, roughness) in ROUGHNESS.into_iter().enumerate() {
            let mesh = match materials.len() {
                0 => sphere,
                material => writer.add_mesh_again(sphere, material),
            };
            materials.push(json!({
                "name": format!("metalness {metalness} roughness {roughness}"),
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.85, 0.35, 0.12, 1.0],
                    "metallicFactor": metalness,
                    "roughnessFactor": roughness,
                },
            }));
            let at = [2.3 * (column as f64 - 2.5), 2.3 * (1.0 - row as f64), 0.0];
            nodes.push(json!({ "mesh": mesh, "translation": at }));
        }
    }
    let all: Vec<usize> = (0..nodes.len()).collect();
    let rest = json!({ "materials": materials, "nodes": nodes, "scenes": [{ "nodes": all }], "scene": 0 });
    vec![OutputFile::new("metal_roughness.glb", writer.into_glb(rest))]
}
