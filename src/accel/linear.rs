//! Every triangle for every ray: the reference that trees are compared with.

use std::sync::Arc;

use super::leaf::{LeafTriangle, check_distinct};
use super::{Counting, Params, Tests, TreeStats, TriangleAccelerator};
use crate::error::Result;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, TriangleMesh};
use crate::progress::{Progress, Share};

/// No tree: all live triangles in the order of the mesh. Culls nothing, so that it cannot cull wrongly.
pub struct Linear {
    triangles: Vec<LeafTriangle>,
    bounds: Bounds,
}

impl TriangleAccelerator for Linear {
    const NAME: &'static str = "linear";

    fn build(mesh: &Arc<TriangleMesh>, _params: &Params, progress: &dyn Progress) -> Result<Self> {
        let mut share = Share::new(progress, mesh.live_count() as u64);
        let triangles: Vec<_> = mesh.live_triangles().map(|number| LeafTriangle::new(mesh, number)).collect();
        share.reach(100)?;
        Ok(Self { triangles, bounds: mesh.hit_bounds() })
    }

    fn closest(&self, ray: &PreparedRay, instance: u32, best: &mut Hit) {
        for hit in self.triangles.iter().filter_map(|triangle| triangle.intersect(ray, instance)) {
            if hit.key().is_before(&best.key()) {
                *best = hit;
            }
        }
    }

    fn occluded(&self, ray: &PreparedRay) -> bool {
        self.triangles.iter().any(|triangle| triangle.intersect(ray, 0).is_some())
    }

    fn next_after(&self, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit) {
        for hit in self.triangles.iter().filter_map(|triangle| triangle.intersect(ray, instance)) {
            if key.is_before(&hit.key()) && hit.key().is_before(&best.key()) {
                *best = hit;
            }
        }
    }

    fn stats(&self) -> TreeStats {
        let count = self.triangles.len() as u64;
        TreeStats {
            triangles: count,
            leaves: u64::from(count > 0),
            leaf_bytes: size_of_val(self.triangles.as_slice()) as u64,
            sah_cost: count as f64,
            ..TreeStats::default()
        }
    }

    fn validate(&self) -> std::result::Result<(), String> {
        check_distinct(&self.triangles)?;
        match self.triangles.iter().find(|triangle| !self.bounds.contains(&triangle.bounds())) {
            Some(triangle) => Err(format!("triangle {} lies outside the bounds", triangle.primitive)),
            None => Ok(()),
        }
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }
}

impl Counting for Linear {
    fn count(&self, ray: &PreparedRay, any: bool, best: &mut Hit, tests: &mut Tests) {
        for triangle in &self.triangles {
            tests.triangles += 1;
            if let Some(hit) = triangle.intersect(ray, 0).filter(|hit| hit.key().is_before(&best.key())) {
                *best = hit;
                if any {
                    return;
                }
            }
        }
    }
}
