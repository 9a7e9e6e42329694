//! The search for one ray once more, scalar, with counts: what the vectors do for single rays, without being fast.

use super::Tree;
use super::node::Child;
use crate::accel::Tests;
use crate::geometry::{Hit, PreparedRay};

/// A child to be visited: where the ray enters it, as bits, and the child; compared as [`simd`](super::simd) compares them.
type Entry = (u32, u32);

/// See [`TriangleAccelerator::count`](crate::accel::TriangleAccelerator::count).
pub fn count(tree: &Tree, ray: &PreparedRay, any: bool, best: &mut Hit, tests: &mut Tests) {
    let near = ray.lower_bound(ray.t_min);
    let far = |best: &Hit| if any { ray.upper_bound(ray.t_max) } else { ray.far_bound(best.t) };
    let mut pending: Vec<Entry> = Vec::new();
    let mut next = Some(tree.root).filter(|root| *root != Child::NONE);
    while let Some(child) = next {
        if child.is_leaf() {
            tests.triangles += child.count() as u64;
            for triangle in tree.leaves.triangles(child) {
                if let Some(hit) = triangle.intersect(ray, 0).filter(|hit| hit.key().is_before(&best.key())) {
                    *best = hit;
                    if any {
                        return;
                    }
                }
            }
        } else {
            let mut crossed: Vec<Entry> = Vec::new();
            for (child, bounds) in tree.nodes[child.number()].children() {
                tests.boxes += 1;
                let part = bounds.interval(ray, near, far(best));
                if !part.is_empty() {
                    crossed.push((part.near.to_bits(), child.0));
                }
            }
            if any {
                // The first is next, then the last.
                let one = usize::from(crossed.len() > 1);
                crossed.rotate_left(one);
            } else {
                crossed.sort_unstable_by(|one, other| other.cmp(one));
            }
            pending.extend(crossed);
        }
        next = loop {
            match pending.pop() {
                None => break None,
                Some((near, child)) if f32::from_bits(near) <= far(best) => break Some(Child(child)),
                Some(_) => {}
            }
        };
    }
}
