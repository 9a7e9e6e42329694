//! Which triangles a ray may meet: a binary tree of boxes in f64, split at the median.
//!
//! It shares nothing with the renderer's trees. Boxes contain the exact triangles: vertices that are not exact in f64
//! are rounded outward. A box is passed by only where that is certain: per axis the planes are crossed at
//! `(plane - o) / d`, a difference and a quotient of f64, together within 2.01 unit roundoffs; ends moved outward by 4
//! contain the true interval. Nothing under- or overflows to a wrong side: differences of f64 are 0 only where they are,
//! quotients by directions below 2^128 vanish only where the plane is at the origin to within 2^-946, and a quotient that
//! overflows, or a plane at infinity, leaves no end or moves it to infinity. NaN keeps the running end.

use glam::DVec3;

use super::wide_ray::WideRay;

/// A closed box that contains something exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DBox {
    pub min: DVec3,
    pub max: DVec3,
}

impl DBox {
    const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// A bound from below on the t at which a line's part in `[near, far]` enters the box; `None` if it certainly
    /// does not.
    fn entry(&self, line: &SlabLine, mut near: f64, mut far: f64) -> Option<f64> {
        const OUT: f64 = 2.0 * f64::EPSILON;
        for axis in 0..3 {
            let (o, d) = (line.origin[axis], line.direction[axis]);
            if d == 0.0 {
                if o < self.min[axis] || o > self.max[axis] {
                    return None;
                }
                continue;
            }
            let (one, other) = ((self.min[axis] - o) / d, (self.max[axis] - o) / d);
            let (first, last) = if d > 0.0 { (one, other) } else { (other, one) };
            let (first, last) = (first - OUT * first.abs(), last + OUT * last.abs());
            near = if first > near { first } else { near };
            far = if last < far { last } else { far };
        }
        (near <= far).then_some(near)
    }
}

/// A ray's line as the boxes meet it.
pub(super) struct SlabLine {
    origin: DVec3,
    direction: DVec3,
}

impl SlabLine {
    pub fn new(ray: impl Into<WideRay>) -> Self {
        let ray = ray.into();
        Self { origin: ray.origin, direction: ray.direction }
    }
}

/// A node: a leaf with `count` items from `first` on, or, where `count` is 0, the parent of nodes `first` and the next.
#[derive(Debug)]
struct Node {
    bounds: DBox,
    first: u32,
    count: u32,
}

/// The tree.
#[derive(Debug)]
pub(super) struct Culling {
    nodes: Vec<Node>,
    items: Vec<u32>,
}

/// Exact tests cost a microsecond and box tests some nanoseconds: few items a leaf.
const MOST_IN_LEAF: usize = 2;

impl Culling {
    /// A tree over items with these boxes, at most 2^31.
    pub fn new(boxes: &[DBox]) -> Self {
        let mut items: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut nodes = vec![Node { bounds: DBox::EMPTY, first: 0, count: 0 }];
        let mut open = vec![(0, 0, items.len())];
        while let Some((node, start, end)) = open.pop() {
            let own = &mut items[start..end];
            let bounds = own.iter().fold(DBox::EMPTY, |all, &item| all.union(boxes[item as usize]));
            nodes[node].bounds = bounds;
            if own.len() <= MOST_IN_LEAF {
                (nodes[node].first, nodes[node].count) = (start as u32, own.len() as u32);
                continue;
            }
            let middle = |item: &u32, axis: usize| {
                let bounds = &boxes[*item as usize];
                bounds.min[axis] + bounds.max[axis]
            };
            let spread = |axis: usize| {
                let all = own.iter().map(|item| middle(item, axis));
                let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
                high - low
            };
            let spreads = [0, 1, 2].map(spread);
            let axis = if spreads[0] >= spreads[1] && spreads[0] >= spreads[2] {
                0
            } else if spreads[1] >= spreads[2] {
                1
            } else {
                2
            };
            let half = own.len() / 2;
            own.select_nth_unstable_by(half, |a, b| middle(a, axis).total_cmp(&middle(b, axis)));
            let children = nodes.len();
            nodes[node].first = children as u32;
            for (child, range) in [(children, (start, start + half)), (children + 1, (start + half, end))] {
                nodes.push(Node { bounds: DBox::EMPTY, first: 0, count: 0 });
                open.push((child, range.0, range.1));
            }
        }
        Self { nodes, items }
    }

    /// Bytes of nodes and leaves.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.items.as_slice())
    }

    /// Calls `visit` with every item that a line may meet with t between `near` and a limit, nearer boxes first. `visit`
    /// returns the limit from then on, of which negative infinity ends the search.
    pub fn search(&self, line: &SlabLine, near: f64, far: f64, mut visit: impl FnMut(u32) -> f64) {
        let mut limit = far;
        let mut stack = Vec::with_capacity(64);
        if let Some(entry) = self.nodes[0].bounds.entry(line, near, limit) {
            stack.push((0, entry));
        }
        while let Some((number, entry)) = stack.pop() {
            if entry > limit {
                continue;
            }
            let node: &Node = &self.nodes[number];
            if node.count > 0 {
                for &item in &self.items[node.first as usize..(node.first + node.count) as usize] {
                    limit = visit(item);
                }
                continue;
            }
            if self.items.is_empty() {
                return;
            }
            let children = [node.first as usize, node.first as usize + 1];
            let entries = children.map(|child| self.nodes[child].bounds.entry(line, near, limit));
            let order = if entries[0] <= entries[1] { [1, 0] } else { [0, 1] };
            stack.extend(order.into_iter().filter_map(|side| Some((children[side], entries[side]?))));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::random::Random;
    use glam::Vec3;

    #[test]
    fn no_box_on_the_way_is_left_out() {
        let mut random = Random::new(21, 0);
        // Lattice boxes, flat ones among them, and rays between lattice points: everything touches.
        let point = |random: &mut Random| (random.in_cube() * 4.0).round();
        let boxes: Vec<DBox> = (0..200)
            .map(|_| {
                let (a, b) = (point(&mut random), point(&mut random));
                DBox { min: a.min(b), max: a.max(b) }
            })
            .collect();
        let tree = Culling::new(&boxes);
        for _ in 0..500 {
            let (from, to) = (point(&mut random), point(&mut random));
            if from == to {
                continue;
            }
            let ray = Ray::new(from.as_vec3(), (to - from).as_vec3());
            let mut found = vec![false; boxes.len()];
            tree.search(&SlabLine::new(&ray), 0.0, 1.0, |item| {
                assert!(!found[item as usize], "each item once");
                found[item as usize] = true;
                1.0
            });
            // The segment's ends and middle lie exactly on the lattice or halfway.
            for (number, bounds) in boxes.iter().enumerate() {
                let inside = |p: DVec3| bounds.min.cmple(p).all() && bounds.max.cmpge(p).all();
                if [from, to, 0.5 * (from + to)].into_iter().any(inside) {
                    assert!(found[number], "{ray:?} {bounds:?}");
                }
            }
        }
        Culling::new(&[]).search(&SlabLine::new(&Ray::new(Vec3::ZERO, Vec3::X)), 0.0, 1.0, |_| unreachable!());
    }
}
