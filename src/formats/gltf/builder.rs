//! A mesh in the making.

use std::collections::BTreeSet;

use glam::{DVec3, Vec2, Vec3, Vec4};

use crate::array::Array;
use crate::error::Result;
use crate::formats::{NormalMode, Treatment, rounding};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::{Materials, Rounding};
use crate::math::origin::choose_origin;

/// The primitives of a mesh that were read so far, one after the other.
pub(super) struct Builder {
    /// Positions as the file has them.
    pub positions: Vec<Vec3>,
    /// Positions of a mesh that is morphed or posed, all of them, instead of those.
    pub posed: Vec<DVec3>,
    /// The attributes; each exists from the first primitive on that has it.
    pub normals: Attribute<Vec3>,
    pub uvs: [Attribute<Vec2>; 2],
    pub colors: Attribute<[u16; 4]>,
    pub tangents: Attribute<Vec4>,
    pub indices: Vec<[u32; 3]>,
    /// Materials and up to which triangle each reaches.
    pub materials: Vec<(u32, usize)>,
    /// Whether some primitive has a normal map and no tangents.
    pub lacks_tangents: bool,
    /// What is to be told of the mesh.
    pub features: BTreeSet<(Treatment, &'static str)>,
}

/// Values of vertices; none, or one for each vertex up to the last of a primitive that has some.
pub(super) struct Attribute<T> {
    values: Vec<T>,
    /// What vertices have whose primitive has none.
    absent: T,
}

impl<T: Copy> Attribute<T> {
    fn new(absent: T) -> Self {
        Self { values: Vec::new(), absent }
    }

    /// The values, to which those of the vertices from `first` on are to be appended.
    pub fn from(&mut self, first: usize) -> &mut Vec<T> {
        self.values.resize(first, self.absent);
        &mut self.values
    }

    fn finish(mut self, vertices: usize) -> Option<Array<T>> {
        (!self.values.is_empty()).then(|| {
            self.values.resize(vertices, self.absent);
            self.values.into()
        })
    }
}

impl Builder {
    /// Nothing yet.
    pub fn new() -> Self {
        Self {
            positions: Vec::new(),
            posed: Vec::new(),
            normals: Attribute::new(Vec3::ZERO),
            uvs: [Attribute::new(Vec2::ZERO), Attribute::new(Vec2::ZERO)],
            colors: Attribute::new([u16::MAX; 4]),
            tangents: Attribute::new(Vec4::ZERO),
            indices: Vec::new(),
            materials: Vec::new(),
            lacks_tangents: false,
            features: BTreeSet::new(),
        }
    }

    /// Number of vertices so far.
    pub fn vertex_count(&self) -> usize {
        self.positions.len().max(self.posed.len())
    }

    /// The mesh. Tangents are computed for it where a material `wants` them and the file does not have them all.
    ///
    /// # Errors
    /// A limit.
    pub fn finish(self, name: String, mode: NormalMode, wants: impl Fn(u32) -> bool) -> Result<TriangleMesh> {
        let vertices = self.vertex_count();
        let materials = materials(&self.materials, self.indices.len());
        let indices = self.indices;
        let (origin, positions, rounding) =
            if self.posed.is_empty() { as_in_file(self.positions, &indices) } else { rounded(&self.posed, &indices) };
        drop(self.posed);
        let [uvs, second_uvs] = self.uvs.map(|uvs| uvs.finish(vertices));
        let mut mesh = TriangleMesh {
            name,
            origin,
            positions: positions.into(),
            indices: indices.into(),
            normals: self.normals.finish(vertices),
            uvs,
            second_uvs,
            colors: self.colors.finish(vertices),
            tangents: if self.lacks_tangents { None } else { self.tangents.finish(vertices) },
            materials,
            rounding,
            ..Default::default()
        };
        // Without shading normals the renderer takes the directions of each triangle's texture coordinates.
        if mode == NormalMode::File && self.lacks_tangents && mesh.normals.is_some() {
            mesh.compute_tangents(&wants)?;
        }
        mesh = mesh.finish()?;
        if mode == NormalMode::Smooth {
            mesh.compute_normals();
            if self.lacks_tangents {
                mesh.compute_tangents(&wants)?;
            }
        }
        Ok(mesh)
    }
}

fn materials(runs: &[(u32, usize)], triangles: usize) -> Materials {
    match runs {
        [] => Materials::default(),
        [(first, _), rest @ ..] if rest.iter().all(|(material, _)| material == first) => Materials::One(*first),
        runs => {
            let mut each = Vec::with_capacity(triangles);
            for &(material, end) in runs {
                each.resize(end, material);
            }
            Materials::PerTriangle(each.into())
        }
    }
}

/// An origin for positions that the file has in f32: they stay exact relative to any origin that is chosen.
fn as_in_file(mut positions: Vec<Vec3>, indices: &[[u32; 3]]) -> (DVec3, Vec<Vec3>, Rounding) {
    let finest_edge = finest_edge(indices, positions.len(), |number| positions[number].as_dvec3());
    let origin = choose_origin(positions.iter().map(|p| p.as_dvec3()));
    if origin != DVec3::ZERO {
        positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
    }
    (origin, positions, Rounding { largest_loss: 0.0, finest_edge })
}

/// An origin for positions that were computed, and these relative to it.
fn rounded(positions: &[DVec3], indices: &[[u32; 3]]) -> (DVec3, Vec<Vec3>, Rounding) {
    let origin = choose_origin(positions.iter().copied());
    let rounding = Rounding {
        largest_loss: rounding::largest_loss(positions.iter().copied(), origin),
        finest_edge: finest_edge(indices, positions.len(), |number| positions[number]),
    };
    (origin, positions.iter().map(|p| (p - origin).as_vec3()).collect(), rounding)
}

/// The shortest edge of the triangles.
fn finest_edge(indices: &[[u32; 3]], count: usize, position: impl Fn(usize) -> DVec3) -> Option<f64> {
    let point = |number: u32| if (number as usize) < count { position(number as usize) } else { DVec3::NAN };
    let edges = indices.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).map(|(a, b)| (point(a), point(b)));
    rounding::finest_edge(edges, rounding::magnitude((0..count).map(&position)))
}
