//! Writes glTF 2.0: meshes and pictures as buffers, everything else as the caller's JSON.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use crate::mesh::{Corner, Mesh};

/// Component types and targets of the format.
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A file in the making.
#[derive(Default)]
pub struct Writer {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    images: Vec<Value>,
}

impl Writer {
    /// Adds a mesh with one material and returns its number.
    pub fn add_mesh(&mut self, name: &str, mesh: &Mesh, material: u32) -> usize {
        let mut numbers: HashMap<Corner, u32> = HashMap::new();
        let mut vertices: Vec<Corner> = Vec::new();
        let mut indices: Vec<u8> = Vec::with_capacity(12 * mesh.triangles.len());
        for &corner in mesh.triangles.iter().flatten() {
            let number = *numbers.entry(corner).or_insert_with(|| {
                vertices.push(corner);
                vertices.len() as u32 - 1
            });
            indices.extend(number.to_le_bytes());
        }
        let positions: Vec<DVec3> = vertices.iter().map(|v| mesh.positions[v.position as usize]).collect();
        let normals: Vec<DVec3> = vertices.iter().map(|v| mesh.normals[v.normal as usize]).collect();
        // The format's pictures have their origin at the top.
        let uvs = vertices.iter().map(|v| mesh.uvs[v.uv as usize]).map(|uv| DVec2::new(uv.x, 1.0 - uv.y));

        let vec3s = |values: &[DVec3]| floats(values.iter().flat_map(|v| v.to_array()));
        let position = self.add_accessor(vec3s(&positions), FLOAT, "VEC3", vertices.len(), ARRAY_BUFFER);
        let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        self.accessors[position]["min"] = json!(low.as_vec3().to_array());
        self.accessors[position]["max"] = json!(high.as_vec3().to_array());
        let normal = self.add_accessor(vec3s(&normals), FLOAT, "VEC3", vertices.len(), ARRAY_BUFFER);
        let uv_bytes = floats(uvs.flat_map(|uv| uv.to_array()));
        let uv = self.add_accessor(uv_bytes, FLOAT, "VEC2", vertices.len(), ARRAY_BUFFER);
        let count = 3 * mesh.triangles.len();
        let index = self.add_accessor(indices, UNSIGNED_INT, "SCALAR", count, ELEMENT_ARRAY_BUFFER);
        self.meshes.push(json!({
            "name": name,
            "primitives": [{
                "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv },
                "indices": index,
                "material": material,
            }],
        }));
        self.meshes.len() - 1
    }

    /// Adds a mesh that was added before with another material, and returns its number; nothing is stored twice.
    pub fn add_mesh_again(&mut self, number: usize, material: usize) -> usize {
        let mut mesh = self.meshes[number].clone();
        mesh["primitives"][0]["material"] = json!(material);
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// Refers to a picture in a file of its own and returns its number.
    pub fn add_image_file(&mut self, name: &str) -> usize {
        self.images.push(json!({ "uri": name }));
        self.images.len() - 1
    }

    /// Embeds a PNG and returns its number.
    pub fn add_png(&mut self, bytes: &[u8]) -> usize {
        let view = self.add_view(bytes, None);
        self.images.push(json!({ "bufferView": view, "mimeType": "image/png" }));
        self.images.len() - 1
    }

    /// The JSON and the buffer as two files; `rest` has what the meshes and pictures are used for, `buffer_name` is
    /// how the JSON calls the buffer's file.
    pub fn into_gltf(self, rest: Value, buffer_name: &str) -> (Vec<u8>, Vec<u8>) {
        let (document, buffer) = self.finish(rest, Some(buffer_name));
        let mut text = serde_json::to_vec_pretty(&document).expect("a JSON value can be written");
        text.push(b'\n');
        (text, buffer)
    }

    /// The JSON and the buffer as one binary file.
    pub fn into_glb(self, rest: Value) -> Vec<u8> {
        let (document, buffer) = self.finish(rest, None);
        let mut text = serde_json::to_vec(&document).expect("a JSON value can be written");
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + buffer.len();
        let mut out = Vec::with_capacity(length);
        let mut put = |tag: &[u8; 4], number: usize| {
            out.extend(tag);
            out.extend((number as u32).to_le_bytes());
        };
        put(b"glTF", 2);
        out.extend((length as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &buffer)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }

    fn finish(self, mut rest: Value, buffer_name: Option<&str>) -> (Value, Vec<u8>) {
        let mut buffer = json!({ "byteLength": self.buffer.len() });
        if let Some(name) = buffer_name {
            buffer["uri"] = json!(name);
        }
        rest["asset"] = json!({ "version": "2.0", "generator": "whitted make_meshes" });
        rest["buffers"] = json!([buffer]);
        rest["bufferViews"] = Value::Array(self.views);
        rest["accessors"] = Value::Array(self.accessors);
        rest["meshes"] = Value::Array(self.meshes);
        rest["images"] = Value::Array(self.images);
        (rest, self.buffer)
    }

    fn add_accessor(&mut self, bytes: Vec<u8>, component: u32, kind: &str, count: usize, target: u32) -> usize {
        let view = self.add_view(&bytes, Some(target));
        self.accessors.push(json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }));
        self.accessors.len() - 1
    }

    fn add_view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        self.buffer.extend(bytes);
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }
}

/// Little-endian f32.
fn floats(values: impl Iterator<Item = f64>) -> Vec<u8> {
    values.flat_map(|value| (value as f32).to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solids;

    fn writer() -> Writer {
        let mut writer = Writer::default();
        writer.add_mesh("cube", &solids::cuboid(), 0);
        writer
    }

    fn rest() -> Value {
        json!({ "materials": [{}], "nodes": [{ "mesh": 0 }], "scenes": [{ "nodes": [0] }], "scene": 0 })
    }

    #[test]
    fn the_gltf_crate_reads_it_back() {
        let parsed = gltf::Gltf::from_slice(&writer().into_glb(rest())).unwrap();
        let blob = parsed.blob.as_deref().unwrap();
        let primitive = parsed.meshes().next().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(blob));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        assert_eq!(positions.len(), 24);
        assert_eq!(reader.read_indices().unwrap().into_u32().count(), 36);
        // The front's first vertex is its lower left corner, which the format calls (0, 1).
        assert_eq!(positions[0], [-0.5, -0.5, 0.5]);
        assert_eq!(reader.read_normals().unwrap().next(), Some([0.0, 0.0, 1.0]));
        assert_eq!(reader.read_tex_coords(0).unwrap().into_f32().next(), Some([0.0, 1.0]));
    }

    #[test]
    fn the_text_form_names_its_buffer() {
        let (text, buffer) = writer().into_gltf(rest(), "cube.bin");
        let parsed = gltf::Gltf::from_slice(&text).unwrap();
        let declared = parsed.buffers().next().unwrap();
        assert_eq!(declared.length(), buffer.len());
        assert!(matches!(declared.source(), gltf::buffer::Source::Uri("cube.bin")));
    }
}
