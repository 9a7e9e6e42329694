//! What vertices have at the corners of triangles: shading normals and texture coordinates.

use super::{Findings, Flaw};
use crate::geometry::TriangleMesh;
use crate::math::vector::{cross, dot, length};

/// How far the length of a unit normal may be from 1. Normals of three signed bytes are 0.7 % off at most, half a step of 1/127
/// along each axis.
pub(super) const LENGTH_TOLERANCE: f64 = 0.01;

/// Finds what is wrong with normals and texture coordinates.
pub(super) fn examine(
    mesh: &TriangleMesh,
    referenced: &[bool],
    outside_image: &dyn Fn(u32, u32) -> bool,
    findings: &mut Findings,
) {
    lengths(mesh, referenced, findings);
    for number in mesh.live_triangles() {
        let corners = mesh.indices[number as usize];
        if let Some(vertex) = opposed_corner(mesh, number) {
            findings.note(Flaw::OpposedNormal, Some(number), Some(vertex));
        }
        let material = mesh.material(number);
        if let Some(vertex) = corners.into_iter().find(|&vertex| outside_image(material, vertex)) {
            findings.note(Flaw::OutsideImage, Some(number), Some(vertex));
        }
    }
}

/// Normals by their length, of vertices that triangles use.
fn lengths(mesh: &TriangleMesh, referenced: &[bool], findings: &mut Findings) {
    let normals = mesh.normals.iter().flatten();
    for ((vertex, normal), _) in (0u32..).zip(normals).zip(referenced).filter(|(_, referenced)| **referenced) {
        let length = length(normal.as_dvec3());
        if length == 0.0 {
            findings.note(Flaw::ZeroNormal, None, Some(vertex));
        } else if !((length - 1.0).abs() <= LENGTH_TOLERANCE) {
            findings.note(Flaw::NonUnitNormal, None, Some(vertex));
        }
    }
}

/// The first corner of a triangle whose shading normal points to the triangle's back.
fn opposed_corner(mesh: &TriangleMesh, number: u32) -> Option<u32> {
    let normals = mesh.normals.as_ref()?;
    let [a, b, c] = mesh.triangle(number).map(|corner| corner.as_dvec3());
    let face = cross(b - a, c - a);
    let opposed = |vertex: &u32| dot(face, normals[*vertex as usize].as_dvec3()) < 0.0;
    mesh.indices[number as usize].into_iter().find(opposed)
}
