//! Where labels go, so that they cover neither marks nor each other.

/// A rectangle in pixels: left, top, right, bottom.
pub type Area = [f64; 4];

/// Where a label was put.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// What it covers.
    pub area: Area,
    /// Whether a line to the mark is needed.
    pub distant: bool,
}

impl Placed {
    /// The point of the label's box that is nearest to a point.
    pub fn nearest(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top, right, bottom] = self.area;
        [x.clamp(left, right), y.clamp(top, bottom)]
    }
}

/// Clear space around a label.
const GAP: f64 = 3.0;

/// How far from a mark's middle a label may end without a line.
const NEAR: f64 = 14.0;

/// Half the side of what a mark covers.
const MARK: f64 = 7.0;

/// Lines in pixels, from one point to another.
pub type Line = [[f64; 2]; 2];

/// Places a label of the given size beside each mark, within `frame` and clear of `lines` where that can be.
///
/// Greedy: each label takes the cheapest place that is left. The order of the labels matters, so several are tried and
/// the one whose places cost least together is kept.
pub fn place(marks: &[[f64; 2]], sizes: &[[f64; 2]], lines: &[Line], frame: Area) -> Vec<Placed> {
    let by = |key: &dyn Fn(usize) -> f64| {
        let mut order: Vec<usize> = (0..marks.len()).collect();
        order.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
        order
    };
    let crowd = |own: usize| {
        let [x, y] = marks[own];
        marks.iter().filter(|[a, b]| (x - a).abs() < 120.0 && (y - b).abs() < 40.0).count() as f64
    };
    let middle = 0.5 * (frame[0] + frame[2]);
    let orders = [
        by(&|own| marks[own][0]),
        by(&|own| -marks[own][0]),
        by(&|own| -crowd(own)),
        by(&|own| crowd(own)),
        by(&|own| (marks[own][0] - middle).abs()),
        by(&|own| -(marks[own][0] - middle).abs()),
    ];
    let attempts = orders.iter().map(|order| in_order(order, marks, sizes, lines, frame));
    attempts.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, placed)| placed).unwrap_or_default()
}

/// Places labels one after the other; the sum of the costs.
fn in_order(
    order: &[usize],
    marks: &[[f64; 2]],
    sizes: &[[f64; 2]],
    lines: &[Line],
    frame: Area,
) -> (f64, Vec<Placed>) {
    let obstacles: Vec<Area> = marks.iter().map(|[x, y]| [x - MARK, y - MARK, x + MARK, y + MARK]).collect();
    let mut placed: Vec<Option<Placed>> = vec![None; marks.len()];
    let mut lines = lines.to_vec();
    let mut total = 0.0;
    for &own in order {
        let cost = |candidate: &Placed, effort: f64| {
            let [left, top, right, bottom] = candidate.area;
            let outside = left < frame[0] || top < frame[1] || right > frame[2] || bottom > frame[3];
            let line = [marks[own], candidate.nearest(marks[own])];
            let others = || placed.iter().flatten();
            let covered = obstacles.iter().filter(|&obstacle| overlap(candidate.area, *obstacle)).count()
                + others().filter(|other| overlap(candidate.area, other.area)).count() * 2
                + lines.iter().filter(|line| crosses(**line, candidate.area)).count();
            let cut = if candidate.distant {
                others().filter(|other| crosses(line, other.area)).count() * 4
                    + lines.iter().filter(|other| segments_cross(**other, line)).count()
                    + obstacles.iter().enumerate().filter(|(n, area)| *n != own && crosses(line, **area)).count()
            } else {
                0
            };
            f64::from(u32::from(outside)) * 1e6 + covered as f64 * 1e4 + cut as f64 * 100.0 + effort
        };
        let best = candidates(marks[own], sizes[own])
            .map(|(candidate, effort)| (cost(&candidate, effort), candidate))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let (cost, candidate) = best.expect("there are candidates");
        total += cost;
        if candidate.distant {
            lines.push([marks[own], candidate.nearest(marks[own])]);
        }
        placed[own] = Some(candidate);
    }
    (total, placed.into_iter().map(|place| place.expect("every label was placed")).collect())
}

/// Places around a mark, and how far the eye has to go: sideways is farther than up or down.
fn candidates([x, y]: [f64; 2], [width, height]: [f64; 2]) -> impl Iterator<Item = (Placed, f64)> {
    const ROW: f64 = 12.0;
    let beside = MARK + GAP;
    let rows = (-12..=12).map(f64::from);
    // Left ends: to the right of the mark, to its left, above or below it, and farther to both sides.
    let shifts = (0..=10).map(f64::from).flat_map(move |k| {
        [beside + 14.0 * k, -beside - width - 14.0 * k, -0.5 * width + 11.0 * k, -0.5 * width - 11.0 * k]
    });
    rows.flat_map(move |row| shifts.clone().map(move |shift| [shift, row * ROW])).map(move |[shift, dy]| {
        let left = x + shift;
        let area = [left, y + dy - 0.5 * height, left + width, y + dy + 0.5 * height];
        let [nx, ny] = Placed { area, distant: false }.nearest([x, y]);
        let (dx, dy) = ((nx - x).abs(), (ny - y).abs());
        (Placed { area, distant: (dx * dx + dy * dy).sqrt() > NEAR }, 2.0 * dx + dy + if dx > 0.0 { 0.0 } else { 4.0 })
    })
}

fn overlap(a: Area, b: Area) -> bool {
    a[0] < b[2] + GAP && b[0] < a[2] + GAP && a[1] < b[3] && b[1] < a[3]
}

/// Whether a segment passes through a rectangle.
fn crosses([[x0, y0], [x1, y1]]: Line, [left, top, right, bottom]: Area) -> bool {
    let (mut near, mut far) = (0.0f64, 1.0f64);
    for (start, delta, low, high) in [(x0, x1 - x0, left, right), (y0, y1 - y0, top, bottom)] {
        if delta == 0.0 {
            if start <= low || start >= high {
                return false;
            }
        } else {
            let (a, b) = ((low - start) / delta, (high - start) / delta);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    near < far
}

fn segments_cross([a, b]: Line, [c, d]: Line) -> bool {
    let side = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crowded_labels_do_not_cover_each_other_or_marks() {
        let marks: Vec<[f64; 2]> = (0..20).map(|i| [150.0 + 18.0 * f64::from(i), 200.0]).collect();
        let sizes = vec![[90.0, 13.0]; 20];
        let frame = [60.0, 20.0, 880.0, 330.0];
        let placed = place(&marks, &sizes, &[], frame);
        for (i, a) in placed.iter().enumerate() {
            assert!(a.area[0] >= frame[0] && a.area[1] >= frame[1] && a.area[2] <= frame[2] && a.area[3] <= frame[3]);
            assert!(placed[i + 1..].iter().all(|b| !overlap(a.area, b.area)), "{i}");
            assert!(marks.iter().all(|[x, y]| !overlap(a.area, [x - 7.0, y - 7.0, x + 7.0, y + 7.0])), "{i}");
        }
    }

    #[test]
    fn lines_are_kept_clear_of() {
        let bar = [[60.0, 100.0], [300.0, 100.0]];
        let placed = place(&[[100.0, 100.0]], &[[50.0, 12.0]], &[bar], [0.0, 0.0, 300.0, 300.0]);
        assert!(!crosses(bar, placed[0].area), "{placed:?}");
    }

    #[test]
    fn a_lonely_label_stands_beside_its_mark() {
        let placed = place(&[[100.0, 100.0]], &[[50.0, 12.0]], &[], [0.0, 0.0, 300.0, 300.0]);
        assert_eq!(placed[0], Placed { area: [110.0, 94.0, 160.0, 106.0], distant: false });
    }
}
