//! The figures of the Utah teapot (M. Newell, 1975; the bottom is F. Crow's, 1987), +Z up, the spout towards +X.
//!
//! The published list of 306 control points is highly regular and is kept here as what makes it up: 24 patches are
//! quarters of surfaces of revolution, given by their rings, and 8 are halves of the handle and of the spout, given
//! by the cross-sections of their control nets. Numbers are in units of 1e-5, in which all of them are whole.

/// A bicubic Bezier patch: rows run along v, columns along u; the normal is `d/du x d/dv` and points outwards.
pub type Patch = [[[i64; 3]; 4]; 4];

/// The units of the figures in one unit of length.
pub const UNITS: i64 = 100_000;

/// The surfaces that the pot consists of; they touch, but their edges are not joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// With rim and bottom.
    Body,
    /// With its knob.
    Lid,
    /// A tube, open where it ends in the body.
    Handle,
    /// A tube, open at the body and at its tip.
    Spout,
}

/// A row of control points of a quarter turn: radius, how far along its tangents the inner two points lie, height.
type Ring = [i64; 3];

/// Surfaces of revolution, from the top down.
///
/// The published knob has, instead of its top on the axis, a loop of control points 0.002 wide that folds the surface
/// over itself. Here, as in many editions, the loop is drawn together to a point.
const REVOLVED: [(Part, [Ring; 4]); 6] = [
    // Rim.
    (
        Part::Body,
        [
            [140_000, 78_400, 240_000],
            [133_750, 74_900, 253_125],
            [143_750, 80_500, 253_125],
            [150_000, 84_000, 240_000],
        ],
    ),
    // Belly, upper and lower.
    (
        Part::Body,
        [
            [150_000, 84_000, 240_000],
            [175_000, 98_000, 187_500],
            [200_000, 112_000, 135_000],
            [200_000, 112_000, 90_000],
        ],
    ),
    (
        Part::Body,
        [[200_000, 112_000, 90_000], [200_000, 112_000, 45_000], [150_000, 84_000, 22_500], [150_000, 84_000, 15_000]],
    ),
    // Bottom.
    (Part::Body, [[150_000, 84_000, 15_000], [150_000, 84_000, 7_500], [142_500, 79_800, 0], [0, 0, 0]]),
    // Knob.
    (Part::Lid, [[0, 0, 315_000], [80_000, 45_000, 315_000], [0, 0, 285_000], [20_000, 11_200, 270_000]]),
    // Lid.
    (
        Part::Lid,
        [[20_000, 11_200, 270_000], [40_000, 22_400, 255_000], [130_000, 72_800, 255_000], [130_000, 72_800, 240_000]],
    ),
];

/// A cross-section of a bent tube: x and z where it crosses the plane y = 0 first and last, and half its width.
type Section = ([i64; 2], [i64; 2], i64);

/// Handle, upper and lower, and spout, lower and upper, in the order of their rows.
const TUBES: [(Part, [Section; 4]); 4] = [
    (
        Part::Handle,
        [
            ([-160_000, 202_500], [-150_000, 225_000], 30_000),
            ([-230_000, 202_500], [-250_000, 225_000], 30_000),
            ([-270_000, 202_500], [-300_000, 225_000], 30_000),
            ([-270_000, 180_000], [-300_000, 180_000], 30_000),
        ],
    ),
    (
        Part::Handle,
        [
            ([-270_000, 180_000], [-300_000, 180_000], 30_000),
            ([-270_000, 157_500], [-300_000, 135_000], 30_000),
            ([-250_000, 112_500], [-265_000, 93_750], 30_000),
            ([-200_000, 90_000], [-190_000, 60_000], 30_000),
        ],
    ),
    (
        Part::Spout,
        [
            ([170_000, 142_500], [170_000, 60_000], 66_000),
            ([260_000, 142_500], [310_000, 82_500], 66_000),
            ([230_000, 210_000], [240_000, 202_500], 25_000),
            ([270_000, 240_000], [330_000, 240_000], 25_000),
        ],
    ),
    (
        Part::Spout,
        [
            ([270_000, 240_000], [330_000, 240_000], 25_000),
            ([280_000, 247_500], [352_500, 249_375], 25_000),
            ([290_000, 247_500], [345_000, 251_250], 15_000),
            ([280_000, 240_000], [320_000, 240_000], 15_000),
        ],
    ),
];

/// All 32 patches and what they belong to.
pub fn teapot() -> Vec<(Part, Patch)> {
    let mut patches = Vec::with_capacity(32);
    for (part, rings) in &REVOLVED {
        let mut quarter = rings.map(|[radius, inner, height]| {
            [[radius, 0], [radius, -inner], [inner, -radius], [0, -radius]].map(|[x, y]| [x, y, height])
        });
        for _ in 0..4 {
            patches.push((*part, quarter));
            quarter = quarter.map(|row| row.map(|[x, y, z]| [y, -x, z]));
        }
    }
    for (part, sections) in &TUBES {
        let half: Patch =
            sections.map(|([x0, z0], [x1, z1], width)| [[x0, 0, z0], [x0, -width, z0], [x1, -width, z1], [x1, 0, z1]]);
        // A mirrored patch is inside out; columns from right to left put it right.
        let mirrored = half.map(|[a, b, c, d]| [d, c, b, a].map(|[x, y, z]| [x, -y, z]));
        patches.extend([(*part, half), (*part, mirrored)]);
    }
    patches
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Control points as published, from different parts of the list.
    const PUBLISHED: [[i64; 3]; 16] = [
        [140_000, -78_400, 240_000],
        [74_900, -133_750, 253_125],
        [-143_750, 80_500, 253_125],
        [84_000, 150_000, 240_000],
        [-98_000, -175_000, 187_500],
        [200_000, 112_000, 45_000],
        [-300_000, 30_000, 135_000],
        [-200_000, 0, 90_000],
        [170_000, -66_000, 60_000],
        [352_500, 25_000, 249_375],
        [345_000, 0, 251_250],
        [80_000, -45_000, 315_000],
        [-45_000, 80_000, 315_000],
        [11_200, -20_000, 270_000],
        [-130_000, 72_800, 240_000],
        [79_800, -142_500, 0],
    ];

    #[test]
    fn the_figures_are_the_published_ones() {
        let patches = teapot();
        assert_eq!(patches.len(), 32);
        let points: BTreeSet<[i64; 3]> = patches.iter().flat_map(|(_, patch)| patch).flatten().copied().collect();
        // The list of 306 has the ring of twelve between body and bottom twice, and four around the top of the knob.
        assert_eq!(points.len(), 306 - 12 - 4);
        for point in PUBLISHED {
            assert!(points.contains(&point), "{point:?}");
        }
        let range = |axis: usize| {
            let values = points.iter().map(|p| p[axis]);
            [values.clone().min().unwrap(), values.max().unwrap()]
        };
        assert_eq!([range(0), range(1), range(2)], [[-300_000, 352_500], [-200_000, 200_000], [0, 315_000]]);
        // All rings are equally round, at 0.56 of the radius, but the widest of the knob.
        let odd = REVOLVED.iter().flat_map(|(_, rings)| rings).filter(|[radius, inner, _]| 100 * inner != 56 * radius);
        assert_eq!(odd.collect::<Vec<_>>(), [&[80_000, 45_000, 315_000]]);
        // The pot is its own mirror image in the plane y = 0.
        assert!(points.iter().all(|&[x, y, z]| points.contains(&[x, -y, z])));
    }
}
