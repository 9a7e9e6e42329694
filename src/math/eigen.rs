//! Eigenvalues and eigenvectors of symmetric 3x3 matrices.

use glam::DVec3;

/// Eigenvalues and the unit eigenvectors that belong to them, by cyclic Jacobi rotations (Golub and Van Loan, Matrix
/// Computations, 8.5), for the matrix with this diagonal (xx, yy, zz) and off-diagonal (xy, yz, xz).
///
/// A diagonal matrix keeps its order and gives the coordinate axes exactly.
pub fn eigen(diagonal: DVec3, off: DVec3) -> (DVec3, [DVec3; 3]) {
    let mut m: [[f64; 3]; 3] = [[diagonal.x, off.x, off.z], [off.x, diagonal.y, off.y], [off.z, off.y, diagonal.z]];
    let mut v: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Convergence is quadratic: 3x3 matrices are diagonal to the last bit after five or six sweeps.
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if m[p][q] == 0.0 {
                continue;
            }
            let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
            let t = 1f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for row in m.iter_mut().chain(&mut v) {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            let (old_p, old_q) = (m[p], m[q]);
            m[p] = std::array::from_fn(|k| c * old_p[k] - s * old_q[k]);
            m[q] = std::array::from_fn(|k| s * old_p[k] + c * old_q[k]);
            (m[p][q], m[q][p]) = (0.0, 0.0);
        }
    }
    let column = |k: usize| DVec3::new(v[0][k], v[1][k], v[2][k]);
    (DVec3::new(m[0][0], m[1][1], m[2][2]), [column(0), column(1), column(2)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash2, unit};
    use crate::math::vector::dot;

    #[test]
    fn the_parts_put_the_matrix_together_again() {
        for seed in 0..200 {
            let random = |k: u32| unit(hash2(seed, k)) * 2.0 - 1.0;
            let (d, o) = (DVec3::new(random(0), random(1), random(2)), DVec3::new(random(3), random(4), random(5)));
            let (values, vectors) = eigen(d, o);
            let entry = |i: usize, j: usize| (0..3).map(|k| values[k] * vectors[k][i] * vectors[k][j]).sum::<f64>();
            for (i, j, expected) in [(0, 0, d.x), (1, 1, d.y), (2, 2, d.z), (0, 1, o.x), (1, 2, o.y), (0, 2, o.z)] {
                assert!((entry(i, j) - expected).abs() < 1e-14, "{seed}");
            }
            for i in 0..3 {
                for j in 0..3 {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((dot(vectors[i], vectors[j]) - expected).abs() < 1e-14, "{seed}");
                }
            }
        }
    }

    #[test]
    fn diagonal_matrices_are_left_alone() {
        let (values, vectors) = eigen(DVec3::new(3.0, -1.0, 0.0), DVec3::ZERO);
        assert_eq!((values, vectors), (DVec3::new(3.0, -1.0, 0.0), [DVec3::X, DVec3::Y, DVec3::Z]));
    }
}
