//! One mesh from the statements of an OBJ file.

use std::collections::HashMap;
use std::iter::repeat_n;

use glam::{DVec3, Vec2, Vec3};

use super::parse::{ABSENT, Parsed};
use super::triangulate::Triangulator;
use crate::error::Result;
use crate::formats::{LoadOptions, NormalMode, rounding};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::{Materials, Rounding};
use crate::math::origin::choose_origin;
use crate::progress::Progress;

/// How many faces are cut between two looks at whether to go on.
const FACES_PER_CHECK: usize = 1 << 16;

/// The whole file as one mesh, finished, and the names of its materials in the order in which faces first use them;
/// `None` is the material of faces before any `usemtl`.
///
/// # Errors
/// A limit for more triangles than 32 bits count; cancellation.
pub(super) fn build(
    mut parsed: Parsed,
    name: &str,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(TriangleMesh, Vec<Option<String>>)> {
    let normals = options.normals;
    if normals != NormalMode::File {
        // Corners that differ in their normal alone are then one vertex.
        parsed.faces.normals = Vec::new();
    }
    let used = used_positions(&parsed);
    let used_positions = || parsed.positions.iter().zip(&used).filter_map(|(&p, &used)| used.then_some(p));
    let origin = choose_origin(used_positions());
    let rounding = Rounding {
        largest_loss: rounding::largest_loss(used_positions(), origin),
        finest_edge: rounding::finest_edge(edges(&parsed), rounding::magnitude(used_positions())),
    };
    drop(used);
    let vertices = unify(&parsed, origin);
    let indices = cut(&parsed, vertices.of_corners.as_deref().unwrap_or(&parsed.faces.positions), progress)?;
    let (names, materials) = materials(&parsed);
    let Vertices { positions, uvs, normals: file_normals, .. } = vertices;
    let mesh = TriangleMesh {
        name: name.to_owned(),
        origin,
        positions,
        indices,
        normals: file_normals,
        uvs,
        materials,
        rounding,
        source_faces: options.faces.then(|| source_faces(&parsed)),
        ..Default::default()
    };
    drop(parsed);
    let mut mesh = mesh.finish()?;
    if normals == NormalMode::Smooth {
        mesh.compute_normals();
    }
    Ok((mesh, names))
}

/// Which positions some corner refers to. Others, such as a stray point at zero beside a model in map coordinates, must
/// not decide where the origin is.
fn used_positions(parsed: &Parsed) -> Vec<bool> {
    let mut used = vec![false; parsed.positions.len()];
    for &number in &parsed.faces.positions {
        if let Some(used) = used.get_mut(number as usize) {
            *used = true;
        }
    }
    used
}

/// The ends of every face's edges; NaN where a corner's vertex is not in the file.
fn edges(parsed: &Parsed) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    let mut start = 0;
    parsed.faces.corner_counts().flat_map(move |count| {
        let corners = &parsed.faces.positions[start..start + count];
        start += count;
        let point = |number: u32| parsed.positions.get(number as usize).copied().unwrap_or(DVec3::NAN);
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(move |(&a, &b)| (point(a), point(b)))
    })
}

/// The mesh's vertices, and which of them each corner is.
struct Vertices {
    positions: Vec<Vec3>,
    uvs: Option<Vec<Vec2>>,
    normals: Option<Vec<Vec3>>,
    /// `None`: a corner's position number is its vertex number.
    of_corners: Option<Vec<u32>>,
}

/// Makes each combination of position, texture coordinate and normal that a corner has one vertex, in the order of
/// the corners. Where corners have positions alone, the file's vertices are the mesh's.
fn unify(parsed: &Parsed, origin: DVec3) -> Vertices {
    let faces = &parsed.faces;
    let relative = |position: &DVec3| (*position - origin).as_vec3();
    let has = |numbers: &[u32]| numbers.iter().any(|&number| number != ABSENT);
    let (has_uvs, has_normals) = (has(&faces.uvs), has(&faces.normals));
    if !has_uvs && !has_normals {
        let positions = parsed.positions.iter().map(relative).collect();
        return Vertices { positions, uvs: None, normals: None, of_corners: None };
    }
    let mut seen: HashMap<[u32; 3], u32> = HashMap::with_capacity(parsed.positions.len());
    let (mut positions, mut uvs, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let corner = |(corner, &position): (usize, &u32)| {
        let Some(point) = parsed.positions.get(position as usize) else { return ABSENT };
        let attribute = |numbers: &[u32]| numbers.get(corner).copied().unwrap_or(ABSENT);
        let (uv, normal) = (attribute(&faces.uvs), attribute(&faces.normals));
        *seen.entry([position, uv, normal]).or_insert_with(|| {
            positions.push(relative(point));
            if has_uvs {
                uvs.push(parsed.uvs.get(uv as usize).copied().unwrap_or_default());
            }
            if has_normals {
                normals.push(parsed.normals.get(normal as usize).copied().unwrap_or_default());
            }
            (positions.len() - 1) as u32
        })
    };
    let of_corners = faces.positions.iter().enumerate().map(corner).collect();
    Vertices {
        positions,
        uvs: has_uvs.then_some(uvs),
        normals: has_normals.then_some(normals),
        of_corners: Some(of_corners),
    }
}

/// Cuts the faces into triangles over the vertices that the corners are.
fn cut(parsed: &Parsed, vertices: &[u32], progress: &dyn Progress) -> Result<Vec<[u32; 3]>> {
    let mut triangles = Vec::with_capacity(parsed.faces.triangle_count());
    let mut triangulator = Triangulator::default();
    let mut points = Vec::new();
    let mut start = 0;
    for (face, corners) in parsed.faces.corner_counts().enumerate() {
        if face % FACES_PER_CHECK == 0 {
            progress.check()?;
        }
        let range = start..start + corners;
        let own = &vertices[range.clone()];
        if let &[a, b, c] = own {
            triangles.push([a, b, c]);
        } else {
            let point = |&number: &u32| parsed.positions.get(number as usize).copied().unwrap_or(DVec3::NAN);
            points.clear();
            points.extend(parsed.faces.positions[range].iter().map(point));
            let pick = |triangle: &[u32; 3]| triangle.map(|corner| own[corner as usize]);
            triangles.extend(triangulator.triangulate(&points).iter().map(pick));
        }
        start += corners;
    }
    Ok(triangles)
}

/// The face that each triangle was cut from, numbered from 0 in the order of the file.
fn source_faces(parsed: &Parsed) -> Vec<u32> {
    let faces = parsed.faces.numbers_in_file().zip(parsed.faces.corner_counts());
    faces.flat_map(|(face, corners)| repeat_n(face as u32, corners - 2)).collect()
}

/// The names of the materials that faces use, and which each triangle has.
fn materials(parsed: &Parsed) -> (Vec<Option<String>>, Materials) {
    let faces = parsed.faces.count;
    let starts = std::iter::once((0, None)).chain(parsed.material_runs.iter().map(|&(face, name)| (face, Some(name))));
    let ends = parsed.material_runs.iter().map(|&(face, _)| face).chain([faces]);
    let mut slots = HashMap::new();
    let mut names = Vec::new();
    let mut runs = Vec::new();
    for ((start, name), end) in starts.zip(ends).filter(|((start, _), end)| start < end) {
        let slot = *slots.entry(name).or_insert_with(|| {
            names.push(name.map(|name: usize| parsed.material_names[name].clone()));
            (names.len() - 1) as u32
        });
        runs.push((slot, end - start));
    }
    if names.len() <= 1 {
        return (names, Materials::One(0));
    }
    let of_faces = runs.into_iter().flat_map(|(slot, faces)| repeat_n(slot, faces));
    let mut of_triangles = Vec::with_capacity(parsed.faces.triangle_count());
    for (slot, corners) in of_faces.zip(parsed.faces.corner_counts()) {
        of_triangles.extend(repeat_n(slot, corners - 2));
    }
    (names, Materials::PerTriangle(of_triangles))
}
