//! Triangle meshes: shared vertex arrays, and which triangles can be hit at all.

use std::sync::Arc;

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use robust::{Coord, orient2d};

use crate::array::Array;
use crate::error::{Error, Result};
use crate::geometry::bounds::Bounds;
use crate::geometry::smoothing::angles;
use crate::geometry::triangle::hit_bounds;
use crate::math::vector::{cross, normalize};

/// Triangles over shared vertices, with optional attributes per vertex; absent attributes take no memory.
///
/// A triangle's number is its position in `indices`, which is the order of the file after polygons were cut into
/// triangles. Triangles that cannot be hit stay in the array, so that numbers do not shift, and are listed in
/// [`dropped`](Self::dropped); accelerators leave them out. Front faces are counter-clockwise.
#[derive(Debug, Clone, Default)]
pub struct TriangleMesh {
    /// What to call the mesh in messages.
    pub name: String,
    /// Where the positions are relative to, in the file's coordinates; see [`file_position`](Self::file_position).
    pub origin: DVec3,
    /// Positions are the file's divided by 2 to this: 0 but for meshes so large or small that products of three of
    /// their coordinates leave f32. Filled by [`finish`](Self::finish).
    pub exponent: i32,
    /// Vertex positions, relative to `origin` and divided by 2 to the `exponent`.
    pub positions: Array<Vec3>,
    /// Vertex numbers, three per triangle.
    pub indices: Array<[u32; 3]>,
    /// Shading normals per vertex, of any length; zero means "use the face's".
    pub normals: Option<Array<Vec3>>,
    /// Texture coordinates per vertex; the origin is the image's lower left corner, v goes up.
    pub uvs: Option<Array<Vec2>>,
    /// A second set of texture coordinates, for those textures that use it.
    pub second_uvs: Option<Array<Vec2>>,
    /// Linear colours and alpha per vertex, in fractions of 65535: they multiply a material's diffuse colour.
    pub colors: Option<Array<[u16; 4]>>,
    /// Tangents per vertex, for normal maps: the direction in which u grows, of any length, and in w the sign of
    /// the bitangent `w cross(normal, tangent)`, along which v grows.
    pub tangents: Option<Array<Vec4>>,
    /// Which of the scene's materials each triangle has.
    pub materials: Materials,
    /// Names of runs of triangles, ascending: each group reaches to the next one's first triangle. Empty where the file names
    /// nothing within a mesh.
    pub groups: Vec<Group>,
    /// The 0-based face of the file that each triangle was cut from, where that was asked for and faces are not
    /// triangles anyway; see [`source_face`](Self::source_face).
    pub source_faces: Option<Array<u32>>,
    /// Numbers of the triangles that cannot be hit, ascending; filled by [`finish`](Self::finish).
    pub dropped: Array<u32>,
    /// Why they were dropped; filled by [`finish`](Self::finish).
    pub dropped_counts: DroppedCounts,
    /// What storing the file's positions in f32 cost; filled by loaders.
    pub rounding: Rounding,
}

/// A name that the file gives to consecutive triangles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Object and group, with a slash between where the file has both.
    pub name: Arc<str>,
    /// The first of them.
    pub first_triangle: u32,
}

/// What storing a file's positions in f32 cost, in the file's units.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Rounding {
    /// The largest distance of a stored coordinate from the file's, over the vertices of faces.
    pub largest_loss: f64,
    /// The shortest edge of a face in the file; `None` if there is none. Edges that the file's own numbers cannot tell
    /// from nothing do not count.
    pub finest_edge: Option<f64>,
}

impl Rounding {
    /// The loss where it is larger than the finest edge: detail is lost.
    pub fn lost_detail(&self) -> Option<(f64, f64)> {
        self.finest_edge.filter(|&edge| self.largest_loss > edge).map(|edge| (self.largest_loss, edge))
    }
}

/// The materials of a mesh's triangles, as positions in the scene's list.
#[derive(Debug, Clone, PartialEq)]
pub enum Materials {
    /// One for all.
    One(u32),
    /// One per triangle.
    PerTriangle(Array<u32>),
}

impl Default for Materials {
    fn default() -> Self {
        Self::One(0)
    }
}

/// How many triangles were dropped, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct DroppedCounts {
    /// A vertex that is NaN, infinite or, as stored, beyond [`FARTHEST_COORDINATE`] in magnitude.
    pub non_finite: u64,
    /// No area, decided exactly.
    pub zero_area: u64,
    /// A vertex number that is not in the file.
    pub bad_index: u64,
}

impl DroppedCounts {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.non_finite + self.zero_area + self.bad_index
    }
}

/// The largest magnitude that usual meshes have, and one over the smallest. A mesh most of whose vertices lie beyond
/// is stored divided by a power of two.
pub const LARGEST_COORDINATE: f32 = (1u64 << 40) as f32;

/// Vertices farther out, as stored, are treated as not finite. The triangle test subtracts a ray's origin, shears, and
/// multiplies in f32 only to find what is certainly missed; up to here no difference of two such numbers, sheared, comes
/// near the largest f32, and neither do the boxes of trees.
pub const FARTHEST_COORDINATE: f32 = (1u64 << 63) as f32;

impl TriangleMesh {
    /// Checks the arrays against each other and lists the triangles that cannot be hit. Loaders call it once.
    ///
    /// # Errors
    /// A limit where a count does not fit 32 bits; a caller's error where an attribute array has another length than
    /// `positions`.
    pub fn finish(mut self) -> Result<Self> {
        self.check_lengths()?;
        self.bring_into_range();
        let mut counts = DroppedCounts::default();
        let mut dropped = Vec::new();
        for (number, indices) in self.indices.iter().enumerate() {
            let reason = match indices.map(|i| self.positions.get(i as usize).copied()) {
                [Some(a), Some(b), Some(c)] => {
                    if ![a, b, c].into_iter().all(is_usable) {
                        &mut counts.non_finite
                    } else if has_zero_area(a, b, c) {
                        &mut counts.zero_area
                    } else {
                        continue;
                    }
                }
                _ => &mut counts.bad_index,
            };
            *reason += 1;
            dropped.push(number as u32);
        }
        self.dropped = dropped.into();
        self.dropped_counts = counts;
        Ok(self)
    }

    /// Checks the lengths of arrays against each other.
    fn check_lengths(&self) -> Result<()> {
        if u32::try_from(self.indices.len()).is_err() || u32::try_from(self.positions.len()).is_err() {
            return Err(Error::limit(format!("mesh `{}` has more than 4294967295 triangles or vertices", self.name)));
        }
        let mismatch = |what: &str, have: usize| {
            let name = &self.name;
            Error::caller(format!("mesh `{name}` has {have} {what} for {} positions", self.positions.len()))
        };
        let counts = [
            ("normals", self.normals.as_ref().map(|values| values.len())),
            ("texture coordinates", self.uvs.as_ref().map(|values| values.len())),
            ("second texture coordinates", self.second_uvs.as_ref().map(|values| values.len())),
            ("colours", self.colors.as_ref().map(|values| values.len())),
            ("tangents", self.tangents.as_ref().map(|values| values.len())),
        ];
        for (what, count) in counts {
            if let Some(count) = count.filter(|&count| count != self.positions.len()) {
                return Err(mismatch(what, count));
            }
        }
        if let Materials::PerTriangle(materials) = &self.materials
            && materials.len() != self.indices.len()
        {
            return Err(Error::caller(format!(
                "mesh `{}` has {} materials for {} triangles",
                self.name,
                materials.len(),
                self.indices.len()
            )));
        }
        Ok(())
    }

    /// Checks a mesh that was [finished](Self::finish) once and read back: the lengths of its arrays, and every number that names a
    /// vertex or a triangle.
    ///
    /// # Errors
    /// As `finish`; a file's error where a number names what is not there.
    pub fn check_numbers(&self) -> Result<()> {
        self.check_lengths()?;
        let flawed = |what: &str| Err(Error::file(format!("mesh `{}` has {what}", self.name)));
        if self.source_faces.as_ref().is_some_and(|faces| faces.len() != self.indices.len()) {
            return flawed("another number of source faces than triangles");
        }
        let triangles = self.indices.len();
        if !self.dropped.is_sorted_by(|one, next| one < next)
            || self.dropped.last().is_some_and(|&n| n as usize >= triangles)
        {
            return flawed("dropped triangles that are not there");
        }
        if !self.groups.is_sorted_by_key(|group| group.first_triangle)
            || self.groups.last().is_some_and(|group| group.first_triangle as usize > triangles)
        {
            return flawed("groups of triangles that are not there");
        }
        let vertices = self.positions.len();
        let is_there = |corners: &[u32; 3]| corners.iter().all(|&corner| (corner as usize) < vertices);
        let missing = |number: usize| !is_there(&self.indices[number]);
        let is_dropped = |number: usize| self.dropped.binary_search(&(number as u32)).is_ok();
        if (0..triangles).into_par_iter().with_min_len(1 << 16).any(|number| missing(number) && !is_dropped(number)) {
            return flawed("triangles of vertices that are not there");
        }
        Ok(())
    }

    /// Where a position of this mesh stands in the file's coordinates.
    #[inline]
    pub fn file_position(&self, position: Vec3) -> DVec3 {
        self.origin + position.as_dvec3() * self.scale()
    }

    /// 2 to the `exponent`: what multiplies a position to give the file's.
    pub fn scale(&self) -> f64 {
        libm::ldexp(1.0, self.exponent)
    }

    /// Divides the positions by a power of two, exactly, where most of them lie beyond [`LARGEST_COORDINATE`] or all
    /// but within its reciprocal. A few vertices far out do not count.
    fn bring_into_range(&mut self) {
        let usual = 1.0 / LARGEST_COORDINATE..=LARGEST_COORDINATE;
        let magnitude = |p: &Vec3| p.is_finite().then(|| p.abs().max_element()).filter(|&m| m > 0.0);
        let largest = self.positions.iter().filter_map(magnitude).fold(0.0, f32::max);
        if largest == 0.0 || usual.contains(&largest) {
            return;
        }
        let mut magnitudes: Vec<f32> = self.positions.iter().filter_map(magnitude).collect();
        let middle = magnitudes.len() / 2;
        let (_, &mut median, _) = magnitudes.select_nth_unstable_by(middle, f32::total_cmp);
        if !usual.contains(&median) {
            let exponent = libm::ilogbf(median);
            let shrink = |x: f32| libm::scalbnf(x, -exponent);
            self.positions.iter_mut().for_each(|p| *p = Vec3::new(shrink(p.x), shrink(p.y), shrink(p.z)));
            self.exponent += exponent;
        }
    }

    /// Number of triangles in the file, dropped ones included.
    pub fn triangle_count(&self) -> usize {
        self.indices.len()
    }

    /// The vertices of a triangle that was not dropped.
    #[inline]
    pub fn triangle(&self, number: u32) -> [Vec3; 3] {
        self.indices[number as usize].map(|i| self.positions[i as usize])
    }

    /// The numbers of the triangles that can be hit, ascending.
    pub fn live_triangles(&self) -> impl Iterator<Item = u32> + '_ {
        let mut dropped = self.dropped.iter().copied().peekable();
        (0..self.indices.len() as u32).filter(move |number| dropped.next_if_eq(number).is_none())
    }

    /// How many triangles can be hit.
    pub fn live_count(&self) -> usize {
        self.indices.len() - self.dropped.len()
    }

    /// The material of a triangle, as a position in the scene's list.
    #[inline]
    pub fn material(&self, number: u32) -> u32 {
        match &self.materials {
            Materials::One(material) => *material,
            Materials::PerTriangle(materials) => materials[number as usize],
        }
    }

    /// The 0-based face of the file that a triangle was cut from; its own number where that was not kept.
    pub fn source_face(&self, number: u32) -> u32 {
        self.source_faces.as_ref().map_or(number, |faces| faces[number as usize])
    }

    /// The box around the triangles that can be hit, relative to `origin`.
    pub fn bounds(&self) -> Bounds {
        self.live_triangles()
            .fold(Bounds::EMPTY, |bounds, number| self.triangle(number).into_iter().fold(bounds, Bounds::with))
    }

    /// The box in which rays look for hits on the triangles: each one's [`hit_bounds`].
    pub fn hit_bounds(&self) -> Bounds {
        let each = self.live_triangles().map(|number| hit_bounds(self.triangle(number)));
        each.fold(Bounds::EMPTY, Bounds::union)
    }

    /// Replaces shading normals by ones computed from the faces: the mean of the faces around a vertex, weighted by
    /// their angle there (Thürmer and Wüthrich 1998), where positions are equal bit for bit.
    pub fn compute_normals(&mut self) {
        let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut sums: HashMap<[u32; 3], DVec3> = HashMap::with_capacity(self.positions.len());
        for number in self.live_triangles() {
            let corners = self.triangle(number);
            let p = corners.map(|corner| corner.as_dvec3());
            let Some(face) = normalize(cross(p[1] - p[0], p[2] - p[0])) else { continue };
            for (corner, angle) in corners.into_iter().zip(angles(&p)) {
                *sums.entry(key(corner)).or_default() += face * angle;
            }
        }
        let normal = |p: &Vec3| sums.get(&key(*p)).and_then(|&n| normalize(n)).unwrap_or(DVec3::ZERO).as_vec3();
        self.normals = Some(self.positions.iter().map(normal).collect());
    }

    /// Appends a copy of a vertex and returns its number.
    ///
    /// # Errors
    /// A limit where there are 4294967295 already.
    pub(crate) fn copy_vertex(&mut self, vertex: u32) -> Result<u32> {
        fn copy<T: Copy>(values: Option<&mut Array<T>>, at: usize) {
            if let Some(values) = values {
                values.extend(values.get(at).copied());
            }
        }
        let number = u32::try_from(self.positions.len())
            .map_err(|_| Error::limit(format!("mesh `{}` has more than 4294967295 vertices", self.name)))?;
        let at = vertex as usize;
        copy(Some(&mut self.positions), at);
        copy(self.normals.as_mut(), at);
        copy(self.uvs.as_mut(), at);
        copy(self.second_uvs.as_mut(), at);
        copy(self.colors.as_mut(), at);
        copy(self.tangents.as_mut(), at);
        Ok(number)
    }

    /// The names of runs of triangles: name, first triangle and number of triangles.
    pub fn named_runs(&self) -> impl Iterator<Item = (&str, u32, u32)> {
        let ends = self.groups.iter().skip(1).map(|next| next.first_triangle).chain([self.indices.len() as u32]);
        self.groups
            .iter()
            .zip(ends)
            .map(|(group, end)| (&*group.name, group.first_triangle, end - group.first_triangle))
    }

    /// Bytes of the vertex and index arrays and attributes; of names, what lists them.
    pub fn bytes(&self) -> usize {
        let per_triangle = match &self.materials {
            Materials::One(_) => 0,
            Materials::PerTriangle(materials) => std::mem::size_of_val(materials.as_slice()),
        };
        std::mem::size_of_val(self.positions.as_slice())
            + std::mem::size_of_val(self.indices.as_slice())
            + self.normals.as_ref().map_or(0, |normals| std::mem::size_of_val(normals.as_slice()))
            + self.uvs.as_ref().map_or(0, |uvs| std::mem::size_of_val(uvs.as_slice()))
            + self.second_uvs.as_ref().map_or(0, |uvs| std::mem::size_of_val(uvs.as_slice()))
            + self.colors.as_ref().map_or(0, |colors| std::mem::size_of_val(colors.as_slice()))
            + self.tangents.as_ref().map_or(0, |tangents| std::mem::size_of_val(tangents.as_slice()))
            + std::mem::size_of_val(self.dropped.as_slice())
            + std::mem::size_of_val(self.groups.as_slice())
            + per_triangle
    }
}

/// Whether a triangle with this corner can be hit; NaN is not usable.
pub(super) fn is_usable(corner: Vec3) -> bool {
    corner.abs().cmple(Vec3::splat(FARTHEST_COORDINATE)).all()
}

/// Whether the vertices are collinear or coincide, decided exactly: the triangle's shadows on the three coordinate
/// planes are all flat, by adaptive-precision predicates (Shewchuk 1997).
fn has_zero_area(a: Vec3, b: Vec3, c: Vec3) -> bool {
    let flat = |i: usize, j: usize| {
        let on_plane = |p: Vec3| Coord { x: f64::from(p[i]), y: f64::from(p[j]) };
        orient2d(on_plane(a), on_plane(b), on_plane(c)) == 0.0
    };
    flat(0, 1) && flat(1, 2) && flat(2, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_triangles_are_dropped_and_counted_and_numbers_do_not_shift() {
        let mesh = TriangleMesh {
            positions: vec![
                Vec3::ZERO,
                Vec3::X,
                Vec3::Y,
                Vec3::new(2.0, 0.0, 0.0),
                Vec3::new(f32::NAN, 0.0, 0.0),
                Vec3::new(3e38, 0.0, 0.0),
            ]
            .into(),
            indices: vec![[0, 1, 3], [0, 1, 2], [0, 0, 1], [4, 1, 2], [5, 1, 2], [0, 1, 9], [2, 1, 0]].into(),
            ..Default::default()
        };
        let mesh = mesh.finish().unwrap();
        assert_eq!(mesh.dropped, [0, 2, 3, 4, 5]);
        assert_eq!(mesh.dropped_counts, DroppedCounts { non_finite: 2, zero_area: 2, bad_index: 1 });
        assert_eq!(mesh.live_triangles().collect::<Vec<_>>(), [1, 6]);
        assert_eq!(mesh.bounds(), Bounds { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.0) });
    }

    #[test]
    fn huge_and_tiny_meshes_are_scaled_by_a_power_of_two() {
        for size in [1e13f32, 1.8e18, 1e30, 1e-13, 1e-25] {
            let positions = vec![Vec3::ZERO, Vec3::X * size, Vec3::new(0.3, 0.7, 0.1) * size];
            let mesh = TriangleMesh {
                positions: positions.clone().into(),
                indices: vec![[0, 1, 2]].into(),
                ..Default::default()
            };
            let mesh = mesh.finish().unwrap();
            assert_eq!(mesh.live_count(), 1, "{size:e}");
            assert!((0.5..=2.0).contains(&mesh.positions[1].x), "{size:e}");
            for (&stored, given) in mesh.positions.iter().zip(positions) {
                assert_eq!(mesh.file_position(stored), given.as_dvec3(), "{size:e}");
            }
        }
        // One vertex far out leaves the others alone; it is dropped where f32 could not answer for it.
        for (far, live) in [(3e38, 1), (1.8e18, 2), (FARTHEST_COORDINATE, 2), (FARTHEST_COORDINATE.next_up(), 1)] {
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(far)];
            let mesh = TriangleMesh {
                positions: positions.into(),
                indices: vec![[0, 1, 2], [0, 1, 3]].into(),
                ..Default::default()
            };
            let mesh = mesh.finish().unwrap();
            assert_eq!((mesh.exponent, mesh.live_count()), (0, live), "{far:e}");
            assert_eq!(mesh.dropped_counts.non_finite, 2 - live as u64, "{far:e}");
        }
    }

    #[test]
    fn zero_area_is_decided_exactly() {
        let (a, b) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.2, 0.4, 0.6));
        let nearly = Vec3::new(0.4, 0.8f32.next_up(), 1.2);
        assert!(has_zero_area(Vec3::ZERO, b, b * 2.0));
        assert!(!has_zero_area(Vec3::ZERO, b, nearly));
        assert!(!has_zero_area(Vec3::ZERO, Vec3::X * 1e-15, Vec3::Y * 1e-15));
        assert!(has_zero_area(a, a, b));
    }

    #[test]
    fn mismatched_attributes_are_refused() {
        let mesh =
            TriangleMesh { positions: vec![Vec3::ZERO; 3].into(), normals: Some(vec![].into()), ..Default::default() };
        assert!(mesh.finish().is_err());
    }
}
