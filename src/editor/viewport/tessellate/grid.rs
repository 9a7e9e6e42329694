//! The grid over a quadric: its outermost planes are the sides of the clip box where that cuts the surface.

use glam::{DVec3, UVec3};

use crate::editor::viewport::tessellate::Fineness;
use crate::geometry::Quadric;

/// Planes across the axes, and the function where they meet.
pub(super) struct Grid {
    pub(super) ticks: [Vec<f64>; 3],
    /// Whether the first and the last plane of an axis are sides of the clip box.
    pub(super) cuts: [[bool; 2]; 3],
    values: Vec<f64>,
}

impl Grid {
    /// `None` where the box is empty, flat or not finite.
    pub(super) fn of(quadric: &Quadric, fineness: &Fineness) -> Option<Self> {
        let (clip, bounds) = (quadric.clip(), quadric.bounds());
        let cells = fineness.cells.max(2);
        let mut ends = [[0.0; 2]; 3];
        let mut cuts = [[false; 2]; 3];
        let mut endless = [false; 3];
        for axis in 0..3 {
            let limits = match &bounds {
                Some(bounds) => [f64::from(bounds.min[axis]), f64::from(bounds.max[axis])],
                None => [f64::NEG_INFINITY, f64::INFINITY],
            };
            // The bounds are rounded outward: where the clip box is the tighter one, it is exact.
            cuts[axis] = [
                clip.min[axis].is_finite() && clip.min[axis] >= limits[0],
                clip.max[axis].is_finite() && clip.max[axis] <= limits[1],
            ];
            for (end, given) in [clip.min[axis], clip.max[axis]].into_iter().enumerate() {
                let far = [fineness.far.min[axis], fineness.far.max[axis]][end];
                endless[axis] |= !cuts[axis][end] && limits[end].is_infinite();
                ends[axis][end] = match cuts[axis][end] {
                    true => given,
                    false if limits[end].is_finite() => limits[end],
                    false => far,
                };
            }
        }
        let size = |axis: usize| {
            if endless[axis] {
                fineness.near.max[axis] - fineness.near.min[axis]
            } else {
                ends[axis][1] - ends[axis][0]
            }
        };
        let cell = size(0).max(size(1)).max(size(2)) / f64::from(cells);
        let mut ticks = [const { Vec::new() }; 3];
        for axis in 0..3 {
            let [mut first, mut last] = ends[axis];
            if !endless[axis] {
                // What only touches its bounds lies within the grid, not in its outermost planes.
                first -= if cuts[axis][0] { 0.0 } else { 0.5 * cell };
                last += if cuts[axis][1] { 0.0 } else { 0.5 * cell };
            }
            let near = endless[axis].then_some([fineness.near.min[axis], fineness.near.max[axis]]);
            ticks[axis] = planes(first, last, cell, cells, near)?;
            pass_through(&mut ticks[axis], quadric.center()[axis]);
        }
        let mut grid = Self { ticks, cuts, values: Vec::new() };
        let size = grid.size();
        let nodes = (0..size.z).flat_map(|z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| (x, y, z))));
        grid.values = nodes.map(|(x, y, z)| quadric.value(grid.position(UVec3::new(x, y, z)))).collect();
        Some(grid)
    }

    /// Number of planes across each axis.
    pub(super) fn size(&self) -> UVec3 {
        UVec3::new(self.ticks[0].len() as u32, self.ticks[1].len() as u32, self.ticks[2].len() as u32)
    }

    pub(super) fn position(&self, node: UVec3) -> DVec3 {
        let [x, y, z] = &self.ticks;
        DVec3::new(x[node.x as usize], y[node.y as usize], z[node.z as usize])
    }

    pub(super) fn number(&self, node: UVec3) -> u32 {
        let size = self.size();
        (node.z * size.y + node.y) * size.x + node.x
    }

    fn value(&self, node: UVec3) -> f64 {
        self.values[self.number(node) as usize]
    }

    pub(super) fn is_inside(&self, node: UVec3) -> bool {
        self.value(node) <= 0.0
    }
}

/// Moves the nearest of the inner planes to a place, such as that of an apex, which is then a node.
fn pass_through(planes: &mut [f64], place: f64) {
    let last = planes.len() - 1;
    if let Some(nearest) = (1..last).min_by(|&a, &b| (planes[a] - place).abs().total_cmp(&(planes[b] - place).abs()))
        && planes[nearest - 1] < place
        && place < planes[nearest + 1]
    {
        planes[nearest] = place;
    }
}

/// Ascending places of planes from `first` to `last`, about `cell` apart; beyond `near` each cell is half as large again as
/// the one before.
fn planes(first: f64, last: f64, cell: f64, cells: u32, near: Option<[f64; 2]>) -> Option<Vec<f64>> {
    if !(first < last && first.is_finite() && last.is_finite() && cell > 0.0 && cell.is_finite()) {
        return None;
    }
    let even = |from: f64, to: f64| {
        // An even number, so that there is a plane in the middle, where apexes and planes are.
        let count = 2 * ((0.5 * (to - from) / cell).round() as u32).clamp(1, cells.div_ceil(2));
        (0..=count).map(move |i| from + (to - from) * (f64::from(i) / f64::from(count)))
    };
    let Some([least, greatest]) = near else {
        let mut planes: Vec<f64> = even(first, last).collect();
        *planes.last_mut()? = last;
        return Some(planes);
    };
    let (from, to) = (least.clamp(first, last), greatest.clamp(first, last));
    let grown = |start: f64, end: f64| {
        let (mut step, mut at) = (cell, start);
        std::iter::from_fn(move || {
            step *= 1.5;
            at += if end > start { step } else { -step };
            Some(at)
        })
        // The last one is the end itself, and not much thinner than its neighbour.
        .take_while(move |&at| (end - at) * (end - start) > 0.25 * cell * (end - start).abs())
        .chain([end])
    };
    let mut planes: Vec<f64> = if from > first { grown(from, first).collect() } else { Vec::new() };
    planes.reverse();
    planes.extend(if from < to { even(from, to).collect() } else { vec![from] });
    if to < last {
        planes.extend(grown(to, last));
    }
    Some(planes)
}
