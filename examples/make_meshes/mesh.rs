//! Triangle meshes while they are being made: f64, with an index for each of position, texture coordinate and normal.

use glam::{DVec2, DVec3};

/// A corner of a triangle, as positions in the mesh's lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Corner {
    /// In [`Mesh::positions`].
    pub position: u32,
    /// In [`Mesh::uvs`].
    pub uv: u32,
    /// In [`Mesh::normals`].
    pub normal: u32,
}

/// Triangles from `first` to the next group's first, and what they are made of.
#[derive(Debug, Clone)]
pub struct Group {
    /// Name of the group and of its material.
    pub name: &'static str,
    /// Number of its first triangle.
    pub first: usize,
}

/// Triangles, counter-clockwise seen from the side that their normals point to.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Right-handed, +Y up.
    pub positions: Vec<DVec3>,
    /// The origin is the picture's lower left corner, v goes up.
    pub uvs: Vec<DVec2>,
    /// Unit vectors.
    pub normals: Vec<DVec3>,
    /// Three corners each.
    pub triangles: Vec<[Corner; 3]>,
    /// Ascending; empty where all triangles are alike.
    pub groups: Vec<Group>,
}

impl Mesh {
    /// Starts a group: triangles that follow belong to it.
    pub fn begin_group(&mut self, name: &'static str) {
        self.groups.push(Group { name, first: self.triangles.len() });
    }

    /// Adds a vertex with all its attributes; all three lists grow, so that its number is the same in each.
    pub fn push_vertex(&mut self, position: DVec3, uv: DVec2, normal: DVec3) -> u32 {
        self.positions.push(position);
        self.uvs.push(uv);
        self.normals.push(normal);
        self.positions.len() as u32 - 1
    }

    /// Adds a triangle whose corners have one number for all attributes.
    pub fn push_triangle(&mut self, vertices: [u32; 3]) {
        self.triangles.push(vertices.map(|v| Corner { position: v, uv: v, normal: v }));
    }

    /// Adds a planar quadrilateral, corners counter-clockwise from the lower left, with its own uvs and normal.
    /// `positions` are numbers of positions that exist.
    pub fn push_quad(&mut self, positions: [u32; 4], uvs: [DVec2; 4]) {
        let [a, b, _, d] = positions.map(|p| self.positions[p as usize]);
        let normal = self.normals.len() as u32;
        self.normals.push((b - a).cross(d - a).normalize());
        let first_uv = self.uvs.len() as u32;
        self.uvs.extend(uvs);
        let corner = |i: usize| Corner { position: positions[i], uv: first_uv + i as u32, normal };
        self.triangles.push([corner(0), corner(1), corner(2)]);
        self.triangles.push([corner(0), corner(2), corner(3)]);
    }
}

/// The corners of a whole texture, counter-clockwise from the lower left.
pub const UNIT_SQUARE: [DVec2; 4] =
    [DVec2::new(0.0, 0.0), DVec2::new(1.0, 0.0), DVec2::new(1.0, 1.0), DVec2::new(0.0, 1.0)];
