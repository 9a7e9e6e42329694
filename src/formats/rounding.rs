//! What is lost when a file's coordinates are stored in f32, and whether it matters.

use glam::DVec3;

use super::{Ledger, Treatment};
use crate::geometry::mesh::Rounding;

/// The largest distance of a coordinate from what is stored of it, relative to `origin`. Coordinates that f32 cannot
/// hold at all do not count: their triangles are dropped and counted elsewhere.
pub(super) fn largest_loss(positions: impl Iterator<Item = DVec3>, origin: DVec3) -> f64 {
    let mut largest = DVec3::ZERO;
    for position in positions {
        let relative = position - origin;
        let stored = relative.as_vec3();
        if stored.is_finite() {
            largest = largest.max((relative - stored.as_dvec3()).abs());
        }
    }
    largest.max_element()
}

/// The shortest of the edges between these pairs of positions.
///
/// Writers of files compute coordinates to a few roundings of f64: an edge shorter than 16 of them, at the largest
/// coordinate `magnitude`, is noise, as at the poles of spheres, and does not count.
pub(super) fn finest_edge(edges: impl Iterator<Item = (DVec3, DVec3)>, magnitude: f64) -> Option<f64> {
    let noise = 16.0 * f64::EPSILON * magnitude;
    let mut shortest = f64::INFINITY;
    for (a, b) in edges {
        let d = b - a;
        let squared = d.x * d.x + d.y * d.y + d.z * d.z;
        // NaN is neither.
        if squared < shortest && squared > noise * noise {
            shortest = squared;
        }
    }
    (shortest < f64::INFINITY).then(|| shortest.sqrt())
}

/// The largest magnitude of a finite coordinate.
pub(super) fn magnitude(positions: impl Iterator<Item = DVec3>) -> f64 {
    let finite = |p: DVec3| p.is_finite().then(|| p.abs().max_element());
    positions.filter_map(finite).fold(0.0, f64::max)
}

/// Warns where detail is lost.
pub(super) fn note(rounding: &Rounding, name: &str, ledger: &mut Ledger) {
    if let Some((loss, edge)) = rounding.lost_detail() {
        let warning = format!(
            "`{name}` loses detail: coordinates are stored up to {loss:.2e} off, its finest edge is {edge:.2e} long; \
             parts that lie far apart keep theirs in files of their own"
        );
        ledger.note(Treatment::Warning, warning, 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_is_the_largest_of_any_coordinate() {
        let exact = [DVec3::new(0.5, 1e6, -3.0), DVec3::new(f64::INFINITY, 0.0, 0.0)];
        assert_eq!(largest_loss(exact.into_iter(), DVec3::ZERO), 0.0);
        // Between 2^22 and 2^23 f32 holds halves: 0.125 and 0.375 are lost, unless the origin is near.
        let far = [DVec3::new(0.0, 4_194_304.125, 0.0), DVec3::new(0.0, 0.0, 4_194_305.375)];
        assert_eq!(largest_loss(far.into_iter(), DVec3::ZERO), 0.125);
        assert_eq!(largest_loss([DVec3::splat(4_194_304.125)].into_iter(), DVec3::splat(4_194_304.0)), 0.0);
    }

    #[test]
    fn edges_that_are_noise_do_not_count() {
        let edge = |x: f64| (DVec3::ZERO, DVec3::new(0.0, x, 0.0));
        assert_eq!(finest_edge([].into_iter(), 1.0), None);
        assert_eq!(
            finest_edge([edge(2.0), edge(0.0), edge(0.5), edge(f64::NAN), edge(1e-17)].into_iter(), 1.0),
            Some(0.5)
        );
        assert_eq!(finest_edge([edge(1e-9)].into_iter(), 5.4e6), None);
        assert_eq!(finest_edge([edge(1e-3)].into_iter(), 5.4e6), Some(1e-3));
    }
}
