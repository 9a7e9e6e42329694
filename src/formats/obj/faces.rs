//! The faces of an OBJ file: which corners are one vertex is found while they are read.

use super::parse::ABSENT;
use crate::geometry::numbering::Numbering;

/// Polygons over vertices, corners counted per face.
///
/// A vertex is what corners are that agree in position, texture coordinate and normal; there is one for each combination, in
/// the order of the corners. While all corners have positions alone, the file's positions are the vertices.
#[derive(Default)]
pub(super) struct Faces {
    count: usize,
    /// The vertex of each corner, by number.
    corners: Vec<u32>,
    /// Which combinations of position with texture coordinate and normal the vertices are; `None` while they are the file's
    /// positions.
    vertices: Option<Numbering<[u32; 2]>>,
    /// Corners of each face; empty while all are triangles.
    corner_counts: Vec<u32>,
    /// For each face that was left out, how many of those that were kept come before it.
    left_out: Vec<usize>,
}

impl Faces {
    /// Adds a face of at least 3 corners: numbers of position, texture coordinate and normal, [`ABSENT`] for what there is not.
    /// So many positions have been read so far.
    pub fn push(&mut self, corners: &[[u32; 3]], positions: usize) {
        let is_bare = |corner: &[u32; 3]| corner[1] == ABSENT && corner[2] == ABSENT;
        if self.vertices.is_none() && !corners.iter().all(is_bare) {
            self.combine(positions);
        }
        match &mut self.vertices {
            None => self.corners.extend(corners.iter().map(|corner| corner[0])),
            Some(vertices) => {
                vertices.grow(positions);
                self.corners
                    .extend(corners.iter().map(|&[position, uv, normal]| vertices.number(position, [uv, normal])));
            }
        }
        if corners.len() != 3 && self.corner_counts.is_empty() {
            self.corner_counts.resize(self.count, 3);
        }
        if corners.len() != 3 || !self.corner_counts.is_empty() {
            self.corner_counts.push(corners.len() as u32);
        }
        self.count += 1;
    }

    /// Makes vertices of the corners so far, which have positions alone.
    fn combine(&mut self, positions: usize) {
        let mut vertices = Numbering::new(positions);
        self.corners.iter_mut().for_each(|corner| *corner = vertices.number(*corner, [ABSENT; 2]));
        self.vertices = Some(vertices);
    }

    /// Counts a face that is not kept.
    pub fn leave_out(&mut self) {
        self.left_out.push(self.count);
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many corners all of them have.
    pub fn corner_count(&self) -> usize {
        self.corners.len()
    }

    /// How many corners each face has.
    pub fn corner_counts(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.count).map(|face| self.corner_counts.get(face).map_or(3, |&count| count as usize))
    }

    /// For each face the number that it has among all of the file's, those that were left out among them; from 0.
    pub fn numbers_in_file(&self) -> impl Iterator<Item = usize> + '_ {
        let mut before = 0;
        (0..self.count).map(move |face| {
            before += self.left_out[before..].iter().take_while(|&&kept| kept <= face).count();
            face + before
        })
    }

    /// The number of triangles: a face of n corners gives n - 2.
    pub fn triangle_count(&self) -> usize {
        self.corners.len() - 2 * self.count
    }

    /// The number of a vertex's position.
    pub fn position(&self, vertex: u32) -> u32 {
        self.vertices.as_ref().map_or(vertex, |vertices| vertices.pair(vertex).0)
    }

    /// The numbers of the corners' positions.
    pub fn positions(&self) -> impl Iterator<Item = u32> + '_ {
        self.corners.iter().map(|&vertex| self.position(vertex))
    }

    /// The vertices of the corners.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }

    /// Takes the vertices of the corners away, and with them what only finding vertices takes.
    pub fn take_corners(&mut self) -> Vec<u32> {
        self.vertices.iter_mut().for_each(Numbering::stop_finding);
        std::mem::take(&mut self.corners)
    }

    /// The vertices: numbers of position, texture coordinate and normal. `None` where they are the file's positions.
    pub fn vertices(&self) -> Option<impl ExactSizeIterator<Item = [u32; 3]> + '_> {
        let vertices = self.vertices.as_ref()?;
        Some(vertices.pairs().map(|(position, [uv, normal])| [position, uv, normal]))
    }

    /// Makes vertices with texture coordinates or normals that are not in the file ones without, and tells how many corners
    /// had such.
    pub fn clear_outside(&mut self, uvs: usize, normals: usize) -> u64 {
        let Some(vertices) = self.vertices.take() else { return 0 };
        let is_outside = |number: u32, count: usize| number != ABSENT && number as usize >= count;
        let outside = |[uv, normal]: [u32; 2]| u64::from(is_outside(uv, uvs)) + u64::from(is_outside(normal, normals));
        if vertices.pairs().all(|(_, attributes)| outside(attributes) == 0) {
            let has_attributes = vertices.pairs().any(|(_, attributes)| attributes != [ABSENT; 2]);
            if !has_attributes {
                self.corners.iter_mut().for_each(|corner| *corner = vertices.pair(*corner).0);
            }
            self.vertices = has_attributes.then_some(vertices);
            return 0;
        }
        // Those that lose an attribute may become equal to others: all are numbered again.
        let mut count = 0;
        let owners = vertices.pairs().map(|(position, _)| position).filter(|&position| position != ABSENT);
        let mut again = Numbering::new(owners.max().map_or(0, |last| (last as usize + 1).min(vertices.count())));
        for corner in &mut self.corners {
            let (position, [uv, normal]) = vertices.pair(*corner);
            count += outside([uv, normal]);
            let kept = |number, most| if is_outside(number, most) { ABSENT } else { number };
            *corner = again.number(position, [kept(uv, uvs), kept(normal, normals)]);
        }
        self.vertices = Some(again);
        count + self.clear_outside(uvs, normals)
    }

    /// The numbers of a corner's position, texture coordinate and normal.
    #[cfg(test)]
    pub fn corner(&self, corner: usize) -> [u32; 3] {
        let vertex = self.corners[corner];
        self.vertices.as_ref().map_or([vertex, ABSENT, ABSENT], |vertices| {
            let (position, [uv, normal]) = vertices.pair(vertex);
            [position, uv, normal]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_alone_are_the_vertices_until_a_corner_has_more() {
        let mut faces = Faces::default();
        faces.push(&[[5, ABSENT, ABSENT], [2, ABSENT, ABSENT], [5, ABSENT, ABSENT]], 6);
        assert!(faces.vertices().is_none());
        assert_eq!(faces.corners(), [5, 2, 5]);
        faces.push(&[[2, ABSENT, ABSENT], [5, 0, ABSENT], [2, ABSENT, 0], [5, 0, ABSENT]], 6);
        assert_eq!(faces.corners(), [0, 1, 0, 1, 2, 3, 2]);
        let vertices: Vec<_> = faces.vertices().unwrap().collect();
        assert_eq!(vertices, [[5, ABSENT, ABSENT], [2, ABSENT, ABSENT], [5, 0, ABSENT], [2, ABSENT, 0]]);
        assert_eq!((faces.count(), faces.triangle_count()), (2, 3));
    }

    #[test]
    fn what_is_not_in_the_file_is_cleared_and_counted() {
        let mut faces = Faces::default();
        faces.push(&[[0, 0, 9], [1, 9, 9], [0, 0, ABSENT]], 2);
        assert_eq!(faces.clear_outside(1, 1), 3);
        assert_eq!(faces.vertices().unwrap().collect::<Vec<_>>(), [[0, 0, ABSENT], [1, ABSENT, ABSENT]]);
        assert_eq!(faces.corners(), [0, 1, 0]);
        assert_eq!(faces.clear_outside(0, 0), 2);
        assert!(faces.vertices().is_none() && faces.corners() == [0, 1, 0]);
    }
}
