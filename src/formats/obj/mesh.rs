//! One mesh from the statements of an OBJ file.

use std::collections::HashMap;
use std::iter::repeat_n;

use glam::{DVec3, Vec3};

use super::colors;
use super::parse::{ABSENT, Parsed};
use super::triangulate::Triangulator;
use crate::array::Array;
use crate::error::Result;
use crate::formats::{Ledger, LoadOptions, NormalMode, Treatment, rounding};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::{Materials, Rounding};
use crate::math::origin::choose_origin;
use crate::progress::Progress;

/// How many faces are cut between two looks at whether to go on.
const FACES_PER_CHECK: usize = 1 << 16;

/// The whole file as one mesh, finished, and the names of its materials in the order in which faces first use them;
/// `None` is the material of faces before any `usemtl`.
///
/// What was read is let go piece by piece, so that no more memory is taken than twice that of the mesh.
///
/// # Errors
/// A limit for more triangles or vertices than 32 bits count; cancellation.
pub(super) fn build(
    mut parsed: Parsed,
    name: &str,
    options: &LoadOptions,
    progress: &dyn Progress,
    ledger: &mut Ledger,
) -> Result<(TriangleMesh, Vec<Option<String>>)> {
    let used = used_positions(&parsed);
    let used_positions = || parsed.positions.iter().zip(&used).filter_map(|(&p, &used)| used.then_some(p));
    let origin = choose_origin(used_positions());
    let rounding = Rounding {
        largest_loss: rounding::largest_loss(used_positions(), origin),
        finest_edge: rounding::finest_edge(edges(&parsed), rounding::magnitude(used_positions())),
    };
    drop(used);
    let (names, materials) = materials(&parsed);
    let groups = parsed.names.groups(parsed.faces.corner_counts());
    let smoothing = smoothing_runs(&parsed);
    let source_faces = if options.faces { source_faces(&parsed) } else { None };
    let indices = cut(&mut parsed, progress)?;
    let mesh = TriangleMesh {
        name: name.to_owned(),
        origin,
        indices: indices.into(),
        materials,
        groups,
        source_faces,
        rounding,
        ..with_vertices(parsed, origin, ledger)
    };
    let mut mesh = mesh.finish()?;
    match options.normals {
        NormalMode::File => smooth(&mut mesh, smoothing.as_deref(), options.crease_angle, ledger)?,
        NormalMode::Flat => {}
        NormalMode::Smooth => mesh.compute_normals(),
    }
    Ok((mesh, names))
}

/// Gives normals to vertices that lack them: by the file's smoothing groups, or, where a file has neither normals nor groups,
/// up to the crease angle.
fn smooth(
    mesh: &mut TriangleMesh,
    groups: Option<&[(u32, u32)]>,
    angle: Option<f64>,
    ledger: &mut Ledger,
) -> Result<()> {
    let lacks_normals = mesh.normals.as_ref().is_none_or(|normals| normals.contains(&Vec3::ZERO));
    match (groups, angle) {
        (Some(groups), _) if lacks_normals && groups.iter().any(|&(_, group)| group != 0) => mesh.smooth_groups(groups),
        (None, Some(angle)) if mesh.normals.is_none() => {
            ledger.note(Treatment::Honoured, "crease angle: edges below it are smooth", 1);
            mesh.smooth_creases(angle)
        }
        _ => Ok(()),
    }
}

/// Which positions some corner refers to. Others, such as a stray point at zero beside a model in map coordinates, must
/// not decide where the origin is.
fn used_positions(parsed: &Parsed) -> Vec<bool> {
    let mut used = vec![false; parsed.positions.len()];
    for number in parsed.faces.positions() {
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
        let corners = &parsed.faces.corners()[start..start + count];
        start += count;
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(move |(&a, &b)| (point(parsed, a), point(parsed, b)))
    })
}

/// Where a vertex is; NaN where that is not in the file.
fn point(parsed: &Parsed, vertex: u32) -> DVec3 {
    parsed.positions.get(parsed.faces.position(vertex) as usize).copied().unwrap_or(DVec3::NAN)
}

/// A mesh of vertices alone, in the order in which corners first use them. Where corners have positions alone, the file's
/// vertices are the mesh's. A position that is not in the file is NaN.
fn with_vertices(parsed: Parsed, origin: DVec3, ledger: &mut Ledger) -> TriangleMesh {
    let Parsed { positions, colors, uvs, normals, faces, .. } = parsed;
    let relative = |position: &DVec3| (*position - origin).as_vec3();
    let colors = colors::linear(colors, ledger).map(Array::from);
    let Some(vertices) = faces.vertices() else {
        let positions = positions.iter().map(relative).collect();
        return TriangleMesh { positions, colors, ..Default::default() };
    };
    drop(vertices);
    let each = || faces.vertices().into_iter().flatten();
    let mut places = Vec::with_capacity(each().count());
    places.extend(each().map(|[position, ..]| positions.get(position as usize).map_or(Vec3::NAN, relative)));
    drop(positions);
    let mut mesh = TriangleMesh { positions: places.into(), ..TriangleMesh::default() };
    if each().any(|[_, uv, _]| uv != ABSENT) {
        mesh.uvs = Some(each().map(|[_, uv, _]| uvs.get(uv as usize).copied().unwrap_or_default()).collect());
    }
    drop(uvs);
    if each().any(|[.., normal]| normal != ABSENT) {
        mesh.normals = Some(each().map(|[.., n]| normals.get(n as usize).copied().unwrap_or_default()).collect());
    }
    drop(normals);
    mesh.colors = colors.map(|colors| {
        each().map(|[position, ..]| colors.get(position as usize).copied().unwrap_or(colors::WHITE)).collect()
    });
    mesh
}

/// Cuts the faces into triangles over their vertices. Those that are not in the file become [`ABSENT`]; the corners are let
/// go.
fn cut(parsed: &mut Parsed, progress: &dyn Progress) -> Result<Vec<[u32; 3]>> {
    progress.check()?;
    let mut corners = parsed.faces.take_corners();
    let is_outside = |vertex: &u32| parsed.faces.position(*vertex) as usize >= parsed.positions.len();
    corners.iter_mut().filter(|vertex| is_outside(vertex)).for_each(|vertex| *vertex = ABSENT);
    if corners.len() == 3 * parsed.faces.count() {
        return Ok(in_threes(corners));
    }
    let mut triangles = Vec::with_capacity(corners.len() - 2 * parsed.faces.count());
    let mut triangulator = Triangulator::default();
    let mut points = Vec::new();
    let mut start = 0;
    for (face, count) in parsed.faces.corner_counts().enumerate() {
        if face % FACES_PER_CHECK == 0 {
            progress.check()?;
        }
        let own = &corners[start..start + count];
        start += count;
        if let &[a, b, c] = own {
            triangles.push([a, b, c]);
            continue;
        }
        points.clear();
        points.extend(own.iter().map(|&vertex| if vertex == ABSENT { DVec3::NAN } else { point(parsed, vertex) }));
        let pick = |triangle: &[u32; 3]| triangle.map(|corner| own[corner as usize]);
        triangles.extend(triangulator.triangulate(&points).iter().map(pick));
    }
    Ok(triangles)
}

/// The same numbers, three by three: without a copy where that can be.
fn in_threes(mut numbers: Vec<u32>) -> Vec<[u32; 3]> {
    numbers.shrink_to_fit();
    bytemuck::allocation::try_cast_vec(numbers).unwrap_or_else(|(_, numbers)| numbers.as_chunks::<3>().0.to_vec())
}

/// From which triangle on which smoothing group holds; `None` for a file that does not speak of them.
fn smoothing_runs(parsed: &Parsed) -> Option<Vec<(u32, u32)>> {
    let runs = &parsed.smoothing_runs;
    let (mut found, mut next, mut triangles) = (Vec::with_capacity(runs.len()), 0, 0);
    for (face, corners) in parsed.faces.corner_counts().enumerate().take_while(|_| !runs.is_empty()) {
        if let Some(&(_, group)) = runs.get(next).filter(|run| run.0 == face) {
            found.push((triangles, group));
            next += 1;
        }
        triangles += corners as u32 - 2;
    }
    (!runs.is_empty()).then_some(found)
}

/// The face that each triangle was cut from, numbered from 0 in the order of the file; `None` where each is its own.
fn source_faces(parsed: &Parsed) -> Option<Array<u32>> {
    let numbers = || {
        let faces = parsed.faces.numbers_in_file().zip(parsed.faces.corner_counts());
        faces.flat_map(|(face, corners)| repeat_n(face as u32, corners - 2))
    };
    if numbers().zip(0..).all(|(face, triangle)| face == triangle) { None } else { Some(numbers().collect()) }
}

/// The names of the materials that faces use, and which each triangle has.
fn materials(parsed: &Parsed) -> (Vec<Option<String>>, Materials) {
    let faces = parsed.faces.count();
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
    (names, Materials::PerTriangle(of_triangles.into()))
}
