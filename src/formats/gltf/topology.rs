//! Triangles from lists, strips and fans of vertices (glTF 2.0, section 3.7.2.1).

use ::gltf::json::mesh::Mode;

/// How many triangles `corners` vertices make; `None` for points and lines.
pub(super) fn triangle_count(mode: Mode, corners: usize) -> Option<usize> {
    match mode {
        Mode::Triangles => Some(corners / 3),
        Mode::TriangleStrip | Mode::TriangleFan => Some(corners.saturating_sub(2)),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => None,
    }
}

/// The three corners of triangle `number`, as positions in the list of vertices, in the order that the format gives
/// them: counter-clockwise, and every other triangle of a strip turned so that it is too.
#[inline]
pub(super) fn corners(mode: Mode, number: usize) -> [usize; 3] {
    match mode {
        Mode::TriangleStrip => [number, number + 1 + number % 2, number + 2 - number % 2],
        Mode::TriangleFan => [number + 1, number + 2, 0],
        _ => [3 * number, 3 * number + 1, 3 * number + 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_follow_the_format() {
        let all = |mode, n| (0..triangle_count(mode, n).unwrap()).map(|i| corners(mode, i)).collect::<Vec<_>>();
        assert_eq!(all(Mode::Triangles, 7), [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(all(Mode::TriangleStrip, 5), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(all(Mode::TriangleFan, 4), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(all(Mode::TriangleStrip, 1), [[0; 3]; 0]);
        assert_eq!(triangle_count(Mode::LineLoop, 9), None);
    }
}
