//! How triangles meet: duplicates, winding, open and non-manifold edges.
//!
//! An edge belongs to the lower of its two points. The edges of all triangles are dealt out to these, then each point's few are
//! sorted: linear but for points that very many triangles share. A flat triangle of three points takes part, since it may fill the
//! gap beside a T-junction; one of two points does not, since its neighbours meet without it.

use super::weld::Weld;
use super::{Findings, Flaw};
use crate::geometry::TriangleMesh;

/// The edges of each point that is their lower end: the higher end and the triangle.
struct Edges {
    /// Where each point's edges begin, and at last where they end.
    starts: Vec<usize>,
    /// Higher end in the upper 32 bits, triangle in the lower.
    entries: Vec<u64>,
}

/// Finds how triangles meet.
pub(super) fn examine(mesh: &TriangleMesh, findings: &mut Findings) {
    let weld = Weld::new(mesh);
    let mut edges = Edges::collect(mesh, &weld);
    let mut is_duplicate = vec![false; mesh.indices.len()];
    for point in 0..weld.end() {
        let range = edges.starts[point]..edges.starts[point + 1];
        let own = &mut edges.entries[range];
        own.sort_unstable();
        // A triangle is a duplicate by the edge of its two lowest points, which comes before its others.
        for edge in own.chunk_by(|a, b| a >> 32 == b >> 32).filter(|edge| edge.len() > 1) {
            mark_duplicates(mesh, &weld, edge, &mut is_duplicate, findings);
        }
        for edge in own.chunk_by(|a, b| a >> 32 == b >> 32) {
            judge(mesh, &weld, point as u32, edge, &is_duplicate, findings);
        }
    }
}

impl Edges {
    fn collect(mesh: &TriangleMesh, weld: &Weld) -> Self {
        let mut starts = vec![0; weld.end() + 1];
        for_each_edge(mesh, weld, |low, _, _| starts[low as usize + 1] += 1);
        for point in 0..weld.end() {
            starts[point + 1] += starts[point];
        }
        let mut entries = vec![0; starts[weld.end()]];
        let mut next = starts.clone();
        for_each_edge(mesh, weld, |low, high, triangle| {
            let place = &mut next[low as usize];
            entries[*place] = u64::from(high) << 32 | u64::from(triangle);
            *place += 1;
        });
        Self { starts, entries }
    }
}

/// Calls with the lower and the higher end and the triangle's number.
fn for_each_edge(mesh: &TriangleMesh, weld: &Weld, mut visit: impl FnMut(u32, u32, u32)) {
    for number in 0..mesh.indices.len() as u32 {
        let Some([a, b, c]) = weld.triangle(mesh, number) else { continue };
        for (from, to) in [(a, b), (b, c), (c, a)] {
            visit(from.min(to), from.max(to), number);
        }
    }
}

fn triangle_of(entry: u64) -> u32 {
    entry as u32
}

/// Of the triangles at an edge that have it as their lowest two points, all are duplicates that have the third point of one
/// before them.
fn mark_duplicates(mesh: &TriangleMesh, weld: &Weld, edge: &[u64], is_duplicate: &mut [bool], findings: &mut Findings) {
    let high = (edge[0] >> 32) as u32;
    let highest = |entry: &u64| {
        let number = triangle_of(*entry);
        let third = weld.triangle(mesh, number)?.into_iter().max()?;
        (third > high).then_some((third, number))
    };
    let mut thirds: Vec<(u32, u32)> = edge.iter().filter_map(highest).collect();
    thirds.sort_unstable();
    for pair in thirds.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        is_duplicate[pair[1].1 as usize] = true;
        findings.note(Flaw::Duplicate, Some(pair[1].1), None);
    }
}

/// Judges the edge from `low` by the triangles that share it, duplicates left out.
fn judge(mesh: &TriangleMesh, weld: &Weld, low: u32, edge: &[u64], is_duplicate: &[bool], findings: &mut Findings) {
    let mut all = edge.iter().map(|&entry| triangle_of(entry)).filter(|&number| !is_duplicate[number as usize]);
    let Some(first) = all.next() else { return };
    let high = (edge[0] >> 32) as u32;
    // Where the edge begins in a triangle; it runs from the lower point if that is `low`.
    let start = |number: u32| {
        let points = weld.triangle(mesh, number).unwrap_or([low; 3]);
        let at = (0..3).find(|&i| {
            let next = points[(i + 1) % 3];
            (points[i] == low && next == high) || (points[i] == high && next == low)
        });
        let at = at.unwrap_or(0);
        (mesh.indices[number as usize][at], points[at] == low)
    };
    let flaw = match (all.next(), all.next()) {
        (None, _) => Some(Flaw::OpenEdge),
        (Some(second), None) => (start(first).1 == start(second).1).then_some(Flaw::InconsistentWinding),
        _ => Some(Flaw::NonManifoldEdge),
    };
    if let Some(flaw) = flaw {
        findings.note(flaw, Some(first), Some(start(first).0));
    }
}
