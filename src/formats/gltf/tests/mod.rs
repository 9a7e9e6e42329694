//! Whole files: small ones written here, one a feature, and the models of `shared/data` where they are present.

mod attributes;
mod geometry;
mod hierarchy;
mod materials;
mod models;
mod motion;
mod posed_models;
mod robustness;

use std::path::Path;

use serde_json::{Value, json};

use crate::error::Result;
use crate::formats::{LoadOptions, Model, Treatment};
use crate::progress::{Progress, Silent};

/// Builds a file around bytes: each array becomes a buffer view and an accessor of its own.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl File {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let bound = [0.0; 3];
        self.accessors.push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count,
            "min": bound, "max": bound}));
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1], values.len())
    }

    /// The unit triangle (0, 0), (1, 0), (0, 1) at z = 0.
    fn triangle(&mut self) -> usize {
        self.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }

    /// The JSON with a data URI; `rest` has the other members.
    fn json(&self, rest: Value) -> Value {
        let mut file = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": self.bytes.len(), "uri": data_uri(&self.bytes)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        if self.bytes.is_empty() {
            file = json!({"asset": {"version": "2.0"}});
        }
        file.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
        file
    }

    fn load(&self, rest: Value) -> Result<Model> {
        load_json(&self.json(rest), &LoadOptions::default())
    }
}

fn data_uri(bytes: &[u8]) -> String {
    let hex: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    format!("data:application/octet-stream,{hex}")
}

/// Reads a file that is in memory.
fn read(file: &[u8], folder: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    super::read(file, folder, options, progress)
}

fn load_json(json: &Value, options: &LoadOptions) -> Result<Model> {
    read(json.to_string().as_bytes(), Path::new("nowhere"), options, &Silent)
}

/// One node that shows one mesh of one primitive.
fn one(primitive: Value) -> Value {
    json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]})
}

/// A file with one triangle of one material.
fn with_material(material: Value) -> Model {
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["materials"] = json!([material]);
    file.load(rest).unwrap()
}

fn has_note(model: &Model, treatment: Treatment, text: &str) -> bool {
    model.ledger.entries().any(|(found, feature, _)| found == treatment && feature.contains(text))
}
