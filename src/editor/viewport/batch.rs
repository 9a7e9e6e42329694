//! Which clusters of a scene's pieces the camera may see, in the order of their materials.

use std::ops::Range;

use glam::{DVec3, DVec4};

use crate::editor::viewport::camera::{Eye, View};
use crate::editor::viewport::painter::{Frame, MOVING_TRIANGLES};
use crate::editor::viewport::piece::{Cluster, Piece};
use crate::editor::viewport::preview::Placed;
use crate::editor::viewport::sieve::Sides;
use crate::math::transform::Transform;
use crate::math::vector::{dot, length};

/// The clusters of one material of one object.
pub struct Batch<'a> {
    /// What it is of.
    pub placed: &'a Placed,
    /// The piece that is drawn for it.
    pub piece: &'a Piece,
    /// Whether that is a stand-in.
    pub is_stand_in: bool,
    /// The material, by its position.
    pub material: u32,
    /// Of the piece's indices, ascending.
    pub parts: Vec<Range<u32>>,
    /// Which sides of its triangles are seen.
    pub sides: Sides,
    /// How far before the eye its first cluster is.
    pub depth: f64,
}

impl Batch<'_> {
    /// Triangles of its clusters.
    pub fn triangle_count(&self) -> u64 {
        self.parts.iter().map(|part| u64::from(part.end - part.start) / 3).sum()
    }
}

/// What is to be drawn: what the camera cannot see is left out.
pub fn batches<'a>(frame: &Frame<'a>) -> Vec<Batch<'a>> {
    let total = frame.drawing.triangle_count();
    let mut batches: Vec<Batch<'a>> = Vec::new();
    for placed in &frame.drawing.placed {
        let stand_in = frame.moving.then(|| placed.shown.stand_in(total, MOVING_TRIANGLES)).flatten();
        let piece = stand_in.unwrap_or(&placed.shown.piece);
        let sight = Sight::of(frame.view, placed, piece);
        let mut latest: Option<Batch<'a>> = None;
        for cluster in &piece.clusters {
            let material = placed.material.unwrap_or(cluster.material);
            let hides = frame.terms[material as usize].hides();
            if !sight.meets(cluster) || (hides && sight.is_seen_from_behind(cluster)) {
                continue;
            }
            match &mut latest {
                Some(batch) if batch.material == material => match batch.parts.last_mut() {
                    Some(part) if part.end == cluster.indices.start => part.end = cluster.indices.end,
                    _ => batch.parts.push(cluster.indices.clone()),
                },
                _ => {
                    let depth = frame.view.depth(placed.transform.point_to_world(cluster.center.as_dvec3()));
                    let parts = vec![cluster.indices.clone()];
                    let sides = if hides { sight.sides(placed, piece) } else { Sides::Both };
                    let is_stand_in = stand_in.is_some();
                    batches.extend(latest.replace(Batch { placed, piece, is_stand_in, material, parts, sides, depth }));
                }
            }
        }
        batches.extend(latest);
    }
    batches
}

/// What of a piece the camera may see, in the piece's own coordinates.
struct Sight {
    /// Unit normals into the picture and distances: left, right, lower, upper side, near.
    planes: [DVec4; 5],
    /// Where a closed piece is seen from outside: the eye and 1, or the direction of parallel rays and 0.
    from: Option<(DVec3, bool)>,
}

impl Sight {
    fn of(view: &View, placed: &Placed, piece: &Piece) -> Self {
        let [x, y, z, w] = clip_rows(view, &placed.transform);
        let planes = [w + x, w - x, w + y, w - y, w + z].map(|plane| {
            let size = length(plane.truncate());
            if size > 0.0 { plane / size } else { DVec4::W * f64::INFINITY }
        });
        let from = match view.eye() {
            Eye::At(eye) => (placed.transform.point_to_object(eye), true),
            Eye::Parallel(direction) => (placed.transform.vector_to_object(direction), false),
        };
        let (min, max) = (piece.bounds.0.as_dvec3(), piece.bounds.1.as_dvec3());
        let is_within = from.1 && from.0.cmpge(min).all() && from.0.cmple(max).all();
        Self { planes, from: (piece.is_closed && !is_within).then_some(from) }
    }

    fn meets(&self, cluster: &Cluster) -> bool {
        let center = cluster.center.as_dvec3();
        // Written so that NaN is seen.
        self.planes.iter().all(|plane| !(dot(plane.truncate(), center) + plane.w < -f64::from(cluster.radius)))
    }

    /// Which sides of triangles are seen.
    fn sides(&self, placed: &Placed, piece: &Piece) -> Sides {
        match (self.from, placed.transform.is_mirroring() != piece.is_inside_out) {
            (None, _) => Sides::Both,
            (Some(_), false) => Sides::CounterClockwise,
            (Some(_), true) => Sides::Clockwise,
        }
    }

    /// Whether all of its faces look away.
    fn is_seen_from_behind(&self, cluster: &Cluster) -> bool {
        let (axis, spread) = (cluster.axis.as_dvec3(), f64::from(cluster.spread));
        match self.from {
            Some((eye, true)) => {
                let offset = cluster.center.as_dvec3() - eye;
                spread < 1.0 && dot(offset, axis) > spread * length(offset) + f64::from(cluster.radius)
            }
            Some((direction, false)) => spread < 1.0 && dot(direction, axis) > spread * length(direction),
            None => false,
        }
    }
}

/// The rows of the matrix from a piece's vertices to clip space.
pub fn clip_rows(view: &View, transform: &Transform) -> [DVec4; 4] {
    let m = transform.to_world();
    // The eye is near, compared with the file's zero: first the difference.
    view.rows(m.translation).map(|row| {
        let along = row.truncate();
        let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| dot(along, axis));
        DVec3::from_array(columns).extend(row.w)
    })
}
