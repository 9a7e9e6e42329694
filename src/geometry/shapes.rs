//! Named quadrics in a canonical object space, +Y up; sizes and places come by transform.
//!
//! Where a shape is cut, `open` leaves the cut open; otherwise it is closed by a cap and the shape is a solid, which
//! refraction needs. Insides are where the equation's left side is negative.

use glam::DVec3;

use crate::geometry::quadric::{Clip, Mapping, Quadric};

/// The unit sphere around the origin.
pub fn sphere() -> Quadric {
    let bounds = (DVec3::NEG_ONE, DVec3::ONE);
    Quadric::shaped(diagonal(1.0, 1.0, 1.0, 0.0, -1.0), Clip::NONE, false, Some(bounds), Mapping::Spherical)
}

/// The cylinder `x^2 + z^2 = 1` for y in [0, 1].
pub fn cylinder(open: bool) -> Quadric {
    around_y(diagonal(1.0, 0.0, 1.0, 0.0, -1.0), 0.0, 1.0, 1.0, open)
}

/// The cone with its apex at (0, 1, 0) and a base of radius 1 at y = 0: `x^2 + z^2 = (1 - y)^2`.
pub fn cone(open: bool) -> Quadric {
    around_y(diagonal(1.0, -1.0, 1.0, 1.0, -1.0), 0.0, 1.0, 1.0, open)
}

/// The paraboloid `y = x^2 + z^2` for y in [0, 1].
pub fn paraboloid(open: bool) -> Quadric {
    around_y(diagonal(1.0, 0.0, 1.0, -0.5, 0.0), 0.0, 1.0, 1.0, open)
}

/// The hyperboloid of one sheet `x^2 + z^2 - y^2 = 1` for y in [y0, y1].
pub fn hyperboloid_one_sheet(y0: f64, y1: f64, open: bool) -> Quadric {
    let widest = y0.abs().max(y1.abs());
    around_y(diagonal(1.0, -1.0, 1.0, 0.0, -1.0), y0, y1, (1.0 + widest * widest).sqrt(), open)
}

/// The hyperboloid of two sheets `y^2 - x^2 - z^2 = 1` for |y| up to `limit`, which is at least 1.
pub fn hyperboloid_two_sheets(limit: f64, open: bool) -> Quadric {
    let limit = limit.max(1.0);
    around_y(diagonal(1.0, -1.0, 1.0, 0.0, 1.0), -limit, limit, (limit * limit - 1.0).sqrt(), open)
}

/// The saddle `y = x^2 - z^2` for |x| and |z| up to `half_size`; always open.
pub fn saddle(half_size: f64) -> Quadric {
    let (s, height) = (half_size, half_size * half_size);
    let clip = Clip { min: DVec3::new(-s, f64::NEG_INFINITY, -s), max: DVec3::new(s, f64::INFINITY, s) };
    let bounds = (DVec3::new(-s, -height, -s), DVec3::new(s, height, s));
    Quadric::shaped(diagonal(1.0, 0.0, -1.0, -0.5, 0.0), clip, false, Some(bounds), Mapping::Planar { half_size })
}

/// The plane y = 0 with its normal along +Y: a square of half side `half_size`, or without end. Textures repeat every
/// unit on a plane without end.
pub fn plane(half_size: Option<f64>) -> Quadric {
    let coefficients = diagonal(0.0, 0.0, 0.0, 0.5, 0.0);
    let Some(s) = half_size else {
        return Quadric::shaped(coefficients, Clip::NONE, false, None, Mapping::Planar { half_size: 0.5 });
    };
    let clip = Clip { min: DVec3::new(-s, f64::NEG_INFINITY, -s), max: DVec3::new(s, f64::INFINITY, s) };
    let bounds = (DVec3::new(-s, 0.0, -s), DVec3::new(s, 0.0, s));
    Quadric::shaped(coefficients, clip, false, Some(bounds), Mapping::Planar { half_size: s })
}

/// `a x^2 + b y^2 + c z^2 + 2 h y + j`.
fn diagonal(a: f64, b: f64, c: f64, h: f64, j: f64) -> [f64; 10] {
    [a, b, c, 0.0, 0.0, 0.0, 0.0, h, 0.0, j]
}

/// A surface of revolution around y, cut at two heights, within `radius` of the axis.
fn around_y(coefficients: [f64; 10], y0: f64, y1: f64, radius: f64, open: bool) -> Quadric {
    let bounds = (DVec3::new(-radius, y0, -radius), DVec3::new(radius, y1, radius));
    let mapping = Mapping::Cylindrical { y0, y1 };
    Quadric::shaped(coefficients, Clip::between(y0, y1), !open, Some(bounds), mapping)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash2, unit};
    use glam::DVec2;

    fn all() -> Vec<(&'static str, Quadric)> {
        vec![
            ("sphere", sphere()),
            ("cylinder", cylinder(false)),
            ("open cylinder", cylinder(true)),
            ("cone", cone(false)),
            ("open cone", cone(true)),
            ("paraboloid", paraboloid(false)),
            ("one sheet", hyperboloid_one_sheet(-1.0, 0.5, false)),
            ("two sheets", hyperboloid_two_sheets(2.0, false)),
            ("saddle", saddle(1.0)),
            ("square", plane(Some(2.0))),
        ]
    }

    fn random_point(seed: u32, scale: f64) -> DVec3 {
        let axis = |k: u32| (unit(hash2(seed, k)) * 2.0 - 1.0) * scale;
        DVec3::new(axis(0), axis(1), axis(2))
    }

    #[test]
    fn crossings_lie_on_the_surface_within_the_bounds_and_solids_are_closed() {
        for (name, q) in all() {
            let mut found = 0;
            for seed in 0..2000 {
                let origin = random_point(2 * seed, 4.0);
                let direction = random_point(2 * seed + 1, 1.0) - origin * 0.3;
                let crossings: Vec<_> = q.intersect_quadratic(origin, direction).iter().collect();
                if q.is_solid() || name == "sphere" {
                    assert!(crossings.len() % 2 == 0, "{name}: {crossings:?}");
                }
                for crossing in crossings {
                    found += 1;
                    let point = q.point(origin, direction, crossing.surface);
                    let p = point.position;
                    assert!((origin + direction * crossing.t - p).abs().max_element() < 1e-9, "{name}");
                    if crossing.surface < 2 {
                        assert!(q.value(p).abs() < 1e-12 * (1.0 + p.length_squared()), "{name}: {}", q.value(p));
                        let step = q.value(p + point.normal * 1e-4) - q.value(p - point.normal * 1e-4);
                        assert!(step > 0.0, "{name}: the normal points to F > 0");
                    }
                    let bounds = q.bounds().unwrap();
                    let inside = |p: DVec3, slack: f64| {
                        p.cmpge(bounds.min.as_dvec3() - slack).all() && p.cmple(bounds.max.as_dvec3() + slack).all()
                    };
                    assert!(inside(p, 1e-12), "{name}: {p}");
                    assert!((point.normal.length() - 1.0).abs() < 1e-14);
                    assert!(q.uv(p, crossing.surface).is_finite());
                }
            }
            assert!(found > 50, "{name} was hit {found} times");
        }
    }

    #[test]
    fn textures_are_upright_and_not_mirrored_from_outside() {
        let near = |a: DVec2, b: DVec2| assert!((a - b).abs().max_element() < 1e-12, "{a} {b}");
        near(sphere().uv(DVec3::Z, 0), DVec2::new(0.5, 0.5));
        assert!(sphere().uv(DVec3::new(0.5, 0.0, 0.8), 0).x > 0.5, "seen from +Z, right is larger u");
        near(sphere().uv(DVec3::Y, 0), DVec2::new(0.5, 1.0));
        near(cylinder(false).uv(DVec3::new(0.0, 0.25, 1.0), 0), DVec2::new(0.5, 0.25));
        near(plane(Some(2.0)).uv(DVec3::new(2.0, 0.0, 2.0), 0), DVec2::new(1.0, 0.0));
        near(plane(None).uv(DVec3::new(0.5, 0.0, -0.5), 0), DVec2::new(1.0, 1.0));
    }
}
