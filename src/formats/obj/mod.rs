//! Wavefront OBJ files and their material libraries.
//!
//! ```text
//! lines -> parse -> faces -> triangulate, origin -> mesh
//!       -> library (tobj) -> mtl, maps, textures -> materials
//! ```
//!
//! A file is one mesh and one object, named after the file. Triangles are numbered in the order of the file, whatever
//! groups and materials they belong to; a face of n corners is n - 2 of them. Positions are read in f64 and stored in
//! f32 relative to one origin per file.
//!
//! # Why tobj reads the materials and not the faces
//!
//! tobj's answer is a list of models, one for each group and material, in f32. To get the mesh above from it a reader
//! around it would have to read every face first: one index that is not in the file ends tobj's reading, and
//! without a line; a corner that lacks a normal in a mesh that has some shifts the normals of all corners after it; and
//! positions pass through f32. It also keeps 104 bytes a face and a `String` a line. What is left for it to do is to
//! read again what was read already, so the statements are read here once. For libraries, where the cost does not
//! matter and each value can be checked before tobj sees it, it does the reading (`library.rs`).

mod colors;
mod faces;
mod find_file;
mod library;
mod lines;
mod maps;
mod materials;
mod mesh;
mod mtl;
mod names;
mod parse;
mod texels;
mod textures;
mod triangulate;

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use crate::error::{Error, Result};
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, LoadOptions, Model, NormalMode, Scope, Treatment, rounding};
use crate::progress::Progress;
use crate::scene::{Material, Object, Shape};
use library::Libraries;
use lines::Lines;
use parse::Parsed;

/// Bytes between two reports of progress.
const BYTES_PER_STEP: u64 = 1 << 20;

/// Reads an OBJ file and the material libraries and images that it names.
///
/// Trouble with materials is written in the model's ledger and worked around with neutral ones. Progress counts
/// bytes. Positions keep the file's units.
///
/// # Errors
/// A system's error for a file that cannot be read; a file's error, with the line, for text that is not UTF-8, numbers
/// that cannot be read and indices of 0; a file's error for a file without faces; a limit for more than 4294967294
/// vertices or corners, or more than the options allow; cancellation.
pub fn load(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    let system = |cause| Error::system(path, cause);
    let file = File::open(path).map_err(system)?;
    let size = file.metadata().map_err(system)?.len();
    options.limits.check_file_bytes(size).map_err(|error| error.at_path(path))?;
    progress.begin("load", size);
    read(BufReader::with_capacity(1 << 16, file), path, options, progress)
}

/// Reads an OBJ file from elsewhere that lies, or would lie, at `path`. Progress is only advanced, by bytes.
///
/// # Errors
/// As [`load`].
pub fn read(reader: impl BufRead, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    let mut ledger = Ledger::default();
    ledger.note_file(path);
    let mut parsed = parse(reader, path, options, progress)?;
    parsed.finish(&mut ledger);
    if parsed.faces.count() == 0 {
        return Err(Error::file("the file has no faces").remedy("export it with polygons").at_path(path));
    }
    let libraries = std::mem::take(&mut parsed.libraries);
    let name = path.file_stem().map_or_else(|| "mesh".into(), |stem| stem.to_string_lossy());
    let (mut mesh, material_names) =
        mesh::build(parsed, &name, options, progress, &mut ledger).map_err(|error| error.at_path(path))?;
    rounding::note(&mesh.rounding, &name, &mut ledger);

    let surroundings = Surroundings::of(path, options);
    let libraries = Libraries::read(&surroundings, &libraries, &mut ledger);
    let has_colors = mesh.colors.is_some();
    let (materials, textures) = materials::read(&material_names, &libraries, surroundings, has_colors, &mut ledger);
    if mesh.uvs.is_none() && materials.iter().any(|material| material.textures().next().is_some()) {
        let feature = "images on a mesh without texture coordinates (vt): their lower left corner used";
        ledger.note_in(Treatment::Approximated, feature, Scope::Mesh(0));
    }
    let has_normal_map = |material: &Material| material.detail.as_ref().is_some_and(|detail| detail.normal.is_some());
    // Without shading normals the renderer takes the directions of each triangle's texture coordinates.
    if mesh.normals.is_some() {
        mesh.compute_tangents(|number| materials.get(number as usize).is_some_and(has_normal_map))
            .map_err(|error| error.at_path(path))?;
    }
    options.limits.check_vertices(mesh.positions.len() as u64).map_err(|error| error.at_path(path))?;
    let object =
        Object { name: name.into_owned(), shape: Shape::Mesh(0), transform: options.up.to_y(), material: None };
    Ok(Model { meshes: vec![mesh], materials, textures, objects: vec![object], ledger, ..Default::default() })
}

/// Reads all statements.
fn parse(reader: impl BufRead, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Parsed> {
    let limits = &options.limits;
    let mut lines = Lines::new(path, reader);
    // Corners that differ in their normal alone are one vertex where the file's normals are not wanted.
    let mut parsed = if options.normals == NormalMode::File { Parsed::default() } else { Parsed::without_normals() };
    let mut reported = 0;
    while let Some(statement) = lines.read()? {
        let line = statement.line;
        let taken = parsed.statement(statement).and_then(|()| limits.check_vertices(parsed.positions.len() as u64));
        taken.map_err(|error| error.at_path(path).at_line(line))?;
        if lines.bytes() - reported >= BYTES_PER_STEP {
            progress.advance(lines.bytes() - reported);
            reported = lines.bytes();
            progress.check()?;
        }
    }
    progress.advance(lines.bytes() - reported);
    Ok(parsed)
}

#[cfg(test)]
mod tests;
