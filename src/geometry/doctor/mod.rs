//! The mesh doctor: what is wrong with a mesh, how often, and where first. Nothing is mended.
//!
//! Positions are compared bit for bit, so that vertices split for their normals or texture coordinates are one point and their
//! edges are not open. Each look takes time in proportion to triangles and vertices, and one at a time some 30 bytes a triangle and
//! 40 a point: edges are dealt out to their lower end by counting, not hashed.

mod corners;
mod edges;
mod weld;

use std::collections::BTreeMap;

use crate::geometry::TriangleMesh;
use crate::geometry::mesh::is_usable;

/// How many places of each flaw are kept: those with the lowest numbers.
pub const MOST_PLACES: usize = 5;

/// What can be wrong with a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Flaw {
    /// A triangle with a vertex number that is not in the file.
    BadIndex,
    /// A triangle with a vertex that is not finite or beyond [`FARTHEST_COORDINATE`](crate::geometry::mesh::FARTHEST_COORDINATE).
    NonFinite,
    /// A triangle without area.
    Degenerate,
    /// A triangle with the same corners as one before it, whichever way round.
    Duplicate,
    /// An edge that two triangles run along in the same direction: one of them faces the wrong way.
    InconsistentWinding,
    /// An edge of one triangle alone.
    OpenEdge,
    /// An edge of three triangles or more.
    NonManifoldEdge,
    /// A vertex of no triangle.
    UnreferencedVertex,
    /// A triangle that faces away from the shading normal at one of its corners.
    OpposedNormal,
    /// A vertex whose shading normal is zero: the face's is used.
    ZeroNormal,
    /// A vertex whose shading normal is not finite, or whose length differs from 1 by more than 0.01.
    NonUnitNormal,
    /// A triangle with texture coordinates outside an image that does not repeat.
    OutsideImage,
}

impl Flaw {
    /// What is counted, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::BadIndex => "triangles with vertices that are not there",
            Self::NonFinite => "triangles that are not finite",
            Self::Degenerate => "triangles without area",
            Self::Duplicate => "triangles that are there before",
            Self::InconsistentWinding => "edges of triangles that face different ways",
            Self::OpenEdge => "open edges",
            Self::NonManifoldEdge => "edges of three triangles or more",
            Self::UnreferencedVertex => "vertices of no triangle",
            Self::OpposedNormal => "triangles that face away from their normals",
            Self::ZeroNormal => "normals of length 0",
            Self::NonUnitNormal => "normals not of length 1",
            Self::OutsideImage => "triangles outside clamped images",
        }
    }
}

/// A place in a mesh; of an edge the triangle with the lowest number, and where it begins there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The triangle's number; `None` for a vertex of none.
    pub triangle: Option<u32>,
    /// The vertex's number; `None` for a triangle as a whole.
    pub vertex: Option<u32>,
}

/// How often a flaw was found, and where.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Finding {
    /// How often.
    pub count: u64,
    /// The places with the lowest numbers, ascending, [`MOST_PLACES`] at most.
    pub places: Vec<Place>,
}

/// All that was found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Findings {
    by_flaw: BTreeMap<Flaw, Finding>,
}

impl Findings {
    /// The flaws that were found, in the order of [`Flaw`].
    pub fn iter(&self) -> impl Iterator<Item = (Flaw, &Finding)> {
        self.by_flaw.iter().map(|(flaw, finding)| (*flaw, finding))
    }

    fn note(&mut self, flaw: Flaw, triangle: Option<u32>, vertex: Option<u32>) {
        let finding = self.by_flaw.entry(flaw).or_default();
        finding.count += 1;
        let place = Place { triangle, vertex };
        let places = &mut finding.places;
        if places.len() == MOST_PLACES && places.last().is_some_and(|last| *last <= place) {
            return;
        }
        places.insert(places.partition_point(|other| *other <= place), place);
        places.truncate(MOST_PLACES);
    }
}

/// Examines a [finished](TriangleMesh::finish) mesh. `outside_image` tells whether a vertex lies outside of an image that a
/// material does not repeat.
pub fn examine(mesh: &TriangleMesh, outside_image: &dyn Fn(u32, u32) -> bool) -> Findings {
    let mut findings = Findings::default();
    dropped(mesh, &mut findings);
    let referenced = referenced(mesh, &mut findings);
    edges::examine(mesh, &mut findings);
    corners::examine(mesh, &referenced, outside_image, &mut findings);
    findings
}

/// Why triangles were dropped, by the rules of [`TriangleMesh::finish`].
fn dropped(mesh: &TriangleMesh, findings: &mut Findings) {
    for &number in &mesh.dropped {
        let corners = mesh.indices[number as usize].map(|vertex| mesh.positions.get(vertex as usize));
        let flaw = if corners.contains(&None) {
            Flaw::BadIndex
        } else if corners.into_iter().flatten().all(|&corner| is_usable(corner)) {
            Flaw::Degenerate
        } else {
            Flaw::NonFinite
        };
        findings.note(flaw, Some(number), None);
    }
}

/// Which vertices some triangle refers to.
fn referenced(mesh: &TriangleMesh, findings: &mut Findings) -> Vec<bool> {
    let mut referenced = vec![false; mesh.positions.len()];
    for &vertex in mesh.indices.iter().flatten() {
        if let Some(referenced) = referenced.get_mut(vertex as usize) {
            *referenced = true;
        }
    }
    for (vertex, _) in (0u32..).zip(&referenced).filter(|(_, referenced)| !**referenced) {
        findings.note(Flaw::UnreferencedVertex, None, Some(vertex));
    }
    referenced
}

#[cfg(test)]
mod tests;
