//! A glTF mesh: its primitives, one after the other, in one [`TriangleMesh`].

use std::cell::Cell;

use ::gltf::json::accessor::Type;
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Index};
use glam::{Vec2, Vec3, Vec4};

use super::accessor::Accessor;
use super::budget::Budget;
use super::buffers::Buffers;
use super::builder::Builder;
use super::document::{Document, Targets, missing_extension};
use super::pose::Posing;
use super::skin::Skin;
use super::topology;
use crate::error::{Error, Result};
use crate::formats::{Ledger, NormalMode, Treatment};
use crate::geometry::TriangleMesh;
use crate::scene::Material;

/// What all meshes of a file are read with.
pub(super) struct MeshReader<'a> {
    pub document: &'a Document,
    pub buffers: &'a Buffers<'a>,
    /// All materials of the file, that of primitives without one among them.
    pub materials: &'a [Material],
    /// The material of primitives that have none.
    pub default_material: u32,
    pub normals: NormalMode,
}

/// How a mesh is shown: morphed by the weights of its targets, none of which is 0 for all, and posed by a skin.
#[derive(Clone, Copy)]
pub(super) struct Shape<'a> {
    pub weights: &'a [f64],
    pub skin: Option<&'a Skin>,
}

/// What is told of a mesh: each once.
pub(super) type Features = std::collections::BTreeSet<(Treatment, &'static str)>;

/// A vertex number that no mesh has: [`TriangleMesh::finish`] drops triangles with it.
const NO_VERTEX: u32 = u32::MAX;

/// A primitive being added.
pub(super) struct Part<'a, 'b> {
    pub reader: &'a MeshReader<'a>,
    pub primitive: &'a Primitive,
    pub targets: &'a Targets,
    pub budget: &'b mut Budget,
    pub ledger: &'b mut Ledger,
    /// How many vertices the file has for it.
    pub count: usize,
    /// Which of these are taken, ascending; `None` for all.
    pub selection: Option<Vec<u32>>,
    /// The number in the mesh of the first.
    pub first: usize,
}

impl MeshReader<'_> {
    /// Reads a mesh in a shape, and tells what of it is honoured. It may have no triangles at all.
    ///
    /// # Errors
    /// A file's error that names the place, for accessors that do not fit their buffers or their use; a limit.
    pub fn read(
        &self,
        number: usize,
        shape: Shape<'_>,
        budget: &mut Budget,
        ledger: &mut Ledger,
    ) -> Result<(TriangleMesh, Features)> {
        let mesh = &self.document.root.meshes[number];
        let mut builder = Builder::new();
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let targets = &self.document.targets[number][p];
            let (first, selection) = (builder.vertex_count(), None);
            let part = Part { reader: self, primitive, targets, budget, ledger, count: 0, selection, first };
            part.add(&mut builder, shape)
                .map_err(|error| error.within(format_args!("meshes[{number}].primitives[{p}]")))?;
        }
        let features = std::mem::take(&mut builder.features);
        let name = mesh.name.clone().unwrap_or_else(|| format!("mesh {number}"));
        // Computed tangents follow the first set of coordinates; for maps on the second the renderer has its own.
        let wants = |material: u32| self.normal_map(material).is_some_and(|second_uvs| !second_uvs);
        Ok((builder.finish(name, self.normals, wants)?, features))
    }

    /// Whether the normal map of a material is on the second texture coordinates; `None` if it has none.
    fn normal_map(&self, material: u32) -> Option<bool> {
        let normal = self.materials[material as usize].detail.as_ref()?.normal.as_ref()?;
        Some(normal.texture.second_uvs)
    }

    /// About how many bytes reading a mesh reads.
    pub fn bytes(&self, number: usize, is_morphed: bool) -> u64 {
        let root = &self.document.root;
        let bytes = |index: usize| {
            let Some(accessor) = root.accessors.get(index) else { return 0 };
            let (Checked::Valid(component), Checked::Valid(shape)) = (accessor.component_type, accessor.type_) else {
                return 0;
            };
            accessor.count.0.saturating_mul((component.0.size() * shape.multiplicity()) as u64)
        };
        let of_primitive = |primitive: &Primitive| {
            let attributes = primitive.attributes.values().chain(&primitive.indices).map(|index| index.value());
            attributes.map(bytes).fold(0u64, u64::saturating_add)
        };
        let own = root.meshes[number].primitives.iter().map(of_primitive).fold(0, u64::saturating_add);
        let targets = self.document.targets[number].iter().flatten().filter(|_| is_morphed).flat_map(|t| t.values());
        let indices = targets.filter_map(|value| usize::try_from(value.as_u64()?).ok());
        indices.map(bytes).fold(own, u64::saturating_add)
    }
}

impl<'a> Part<'a, '_> {
    /// The accessor of an attribute, if there is one.
    pub fn attribute(&self, semantic: Semantic) -> Result<Option<Accessor<'a>>> {
        let index = self.primitive.attributes.get(&Checked::Valid(semantic)).copied();
        index.map(|index| self.open(index)).transpose()
    }

    /// The accessor of an attribute that belongs to the same vertices as the positions.
    fn fitting(&mut self, name: &str, semantic: Semantic) -> Result<Option<Accessor<'a>>> {
        let accessor = self.attribute(semantic)?;
        Ok(accessor.filter(|accessor| self.fits(name, accessor)))
    }

    /// Whether an accessor has as many vertices as the positions; warns if not.
    pub fn fits(&mut self, name: &str, accessor: &Accessor) -> bool {
        let fits = accessor.count() >= self.count;
        if !fits {
            let text = format!("{name} for fewer vertices than POSITION: left out");
            self.ledger.note(Treatment::Warning, text, 1);
        }
        fits
    }

    /// Opens an accessor by number.
    pub fn open(&self, index: Index<json::Accessor>) -> Result<Accessor<'a>> {
        Accessor::open(&self.reader.document.root, self.reader.buffers, index)
    }

    fn add(mut self, builder: &mut Builder, shape: Shape<'_>) -> Result<()> {
        self.note_unread_parts(shape.skin.is_some());
        let mode = match self.primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            _ => {
                self.ledger.note(Treatment::Ignored, "primitive of points or lines", 1);
                return Ok(());
            }
        };
        // Validation has put a primitive without positions in the ledger; there is nothing to draw.
        let Some(positions) = self.attribute(Semantic::Positions)? else { return Ok(()) };
        if !positions.has_data() && has_extension(self.primitive, DRACO) {
            return Err(missing_extension(DRACO));
        }
        self.count = positions.count();
        let first_triangle = builder.indices.len();
        self.add_triangles(builder, mode)?;
        note_kinds(builder, mode, &positions);
        let posing = Posing::of(&mut self, shape)?;
        let mirrored = posing.add_positions(&mut self, builder, &positions)?;
        posing.turn_triangles(&mut builder.indices[first_triangle..], self.first, &mirrored);
        let material = self.primitive.material.map_or(self.reader.default_material, |material| material.value() as u32);
        self.add_shading(builder, &posing, material)?;
        for set in 0..2 {
            // The first set is kept for what may be wanted of it later, the second where it is used.
            let material = &self.reader.materials[material as usize];
            if set == 0 || material.textures().any(|texture| texture.second_uvs) {
                self.add_uvs(builder, &posing, set)?;
            }
        }
        self.add_colors(builder, &posing)?;
        builder.materials.push((material, builder.indices.len()));
        Ok(())
    }

    /// Adds the triangles, and chooses the vertices that are taken. More triangles than memory are refused first.
    fn add_triangles(&mut self, builder: &mut Builder, mode: Mode) -> Result<()> {
        let indices = self.primitive.indices.map(|index| self.open(index)).transpose()?;
        let corner_count = indices.as_ref().map_or(self.count, Accessor::count);
        let triangle_count = topology::triangle_count(mode, corner_count).unwrap_or(0);
        self.budget.take::<[u32; 4]>(triangle_count)?;
        if mode == Mode::Triangles && corner_count % 3 != 0 {
            let left = (corner_count % 3) as u64;
            self.ledger.note(Treatment::Warning, "vertices left over after the last triangle", left);
        }
        let (first, count) = (self.first, self.count);
        let check = |vertices: usize| {
            let too_many = |_| Error::limit("more than 4294967295 vertices in a mesh");
            u32::try_from(first + vertices).map_err(too_many)
        };
        let whole = |number: u32| if (number as usize) < count { first as u32 + number } else { NO_VERTEX };
        // A primitive that uses few vertices of a large shared array takes those alone.
        let selects = indices.is_some() && corner_count < count;
        if !selects {
            self.budget.take_vertices(count)?;
            if let (Some(indices), Mode::Triangles) = (&indices, mode) {
                check(count)?;
                return indices.triangles(&mut builder.indices, whole);
            }
        }
        let corners = indices.map(|indices| indices.indices()).transpose()?;
        self.selection = corners.as_ref().filter(|_| selects).map(|corners| used(corners, count));
        if let Some(selection) = &self.selection {
            self.budget.take_vertices(selection.len())?;
        }
        check(self.vertex_count())?;
        let no_memory = |_| Error::limit("not enough memory for the triangles");
        builder.indices.try_reserve(triangle_count).map_err(no_memory)?;
        let vertex = |corner: usize| -> u32 {
            let number = corners.as_ref().map_or(corner as u32, |corners| corners[corner]);
            match &self.selection {
                Some(used) => used.binary_search(&number).map_or(NO_VERTEX, |local| (first + local) as u32),
                None => whole(number),
            }
        };
        builder.indices.extend((0..triangle_count).map(|number| topology::corners(mode, number).map(vertex)));
        Ok(())
    }

    /// How many vertices are taken.
    pub fn vertex_count(&self) -> usize {
        self.selection.as_ref().map_or(self.count, Vec::len)
    }

    /// Adds normals, and tangents where a normal map wants them.
    fn add_shading(&mut self, builder: &mut Builder, posing: &Posing<'a>, material: u32) -> Result<()> {
        let wants_tangents = self.reader.normal_map(material).is_some();
        builder.lacks_tangents |= wants_tangents && self.reader.normals != NormalMode::File;
        if self.reader.normals != NormalMode::File {
            return Ok(());
        }
        let normals = self.fitting("NORMAL", Semantic::Normals)?;
        let tangents = if wants_tangents { self.fitting("TANGENT", Semantic::Tangents)? } else { None };
        // Tangents without normals are to be ignored, as the format says.
        let tangents = tangents.filter(|_| normals.is_some());
        if let Some(normals) = normals {
            note_integers(builder, &normals);
            let own = builder.normals.from(self.first);
            match posing.is_plain() {
                true => normals.extend_vectors(self.selection.as_deref(), own, Vec3::from_array)?,
                false => posing.add_normals(self, own, &normals)?,
            }
        }
        if let Some(tangents) = tangents {
            builder.features.insert((Treatment::Honoured, "tangents (TANGENT)"));
            note_integers(builder, &tangents);
            // Stored coordinates have v up, as the bitangent of the file has.
            let own = builder.tangents.from(self.first);
            match posing.is_plain() {
                true => tangents.extend_vectors(self.selection.as_deref(), own, Vec4::from_array)?,
                false => posing.add_tangents(self, own, &tangents)?,
            }
        } else if wants_tangents {
            builder.lacks_tangents = true;
            builder.features.insert((Treatment::Honoured, "tangents computed for a normal map (MikkTSpace)"));
        }
        Ok(())
    }

    fn add_uvs(&mut self, builder: &mut Builder, posing: &Posing<'a>, set: u32) -> Result<()> {
        let name = format!("TEXCOORD_{set}");
        let Some(uvs) = self.fitting(&name, Semantic::TexCoords(set))? else { return Ok(()) };
        if uvs.is_sparse() {
            builder.features.insert(SPARSE);
        }
        if uvs.has_integers() && !uvs.is_normalized() {
            builder.features.insert(QUANTISED);
        }
        // v goes down from the top of the image in the file, and up from its bottom here.
        let turned = |[u, v]: [f32; 2]| Vec2::new(u, 1.0 - v);
        let own = builder.uvs[set as usize].from(self.first);
        if posing.morphs(&name) {
            let round = |uv: [f64; 2]| turned(uv.map(|x| x as f32));
            own.extend(posing.morphed::<2, 2>(self, &uvs, &name)?.into_iter().map(round));
            return Ok(());
        }
        uvs.extend_vectors(self.selection.as_deref(), own, turned)
    }

    /// COLOR_0: linear, with or without alpha.
    fn add_colors(&mut self, builder: &mut Builder, posing: &Posing<'a>) -> Result<()> {
        let Some(mut colors) = self.fitting("COLOR_0", Semantic::Colors(0))? else { return Ok(()) };
        builder.features.insert((Treatment::Honoured, "vertex colours (COLOR_0)"));
        if colors.is_sparse() {
            builder.features.insert(SPARSE);
        }
        if colors.has_integers() && !colors.is_normalized() {
            self.ledger.note(Treatment::Warning, "COLOR_0 of integers that are not normalised: taken for fractions", 1);
            colors = colors.in_fractions();
        }
        let beyond = Cell::new(false);
        let stored = |color: [f64; 4]| {
            beyond.set(beyond.get() || color.iter().any(|x| !(0.0..=1.0).contains(x)));
            color.map(fraction)
        };
        let opaque = |[r, g, b]: [f64; 3]| [r, g, b, 1.0];
        let own = builder.colors.from(self.first);
        let selection = self.selection.clone();
        match (colors.shape(), posing.morphs("COLOR_0")) {
            (Type::Vec3, true) => {
                own.extend(posing.morphed::<3, 3>(self, &colors, "COLOR_0")?.into_iter().map(opaque).map(stored));
            }
            (_, true) => own.extend(posing.morphed::<4, 4>(self, &colors, "COLOR_0")?.into_iter().map(stored)),
            (Type::Vec3, false) => {
                colors.extend_vectors(selection.as_deref(), own, |color: [f32; 3]| {
                    stored(opaque(color.map(f64::from)))
                })?;
            }
            (_, false) => {
                colors.extend_vectors(selection.as_deref(), own, |color: [f32; 4]| stored(color.map(f64::from)))?;
            }
        }
        if beyond.get() {
            builder.features.insert((Treatment::Approximated, "vertex colours beyond 0 to 1: cut off there"));
        }
        Ok(())
    }

    /// Tells of attributes that nothing here makes use of.
    fn note_unread_parts(&mut self, is_skinned: bool) {
        for key in self.primitive.attributes.keys() {
            let Checked::Valid(semantic) = key else { continue };
            let text = match semantic {
                Semantic::Colors(1..) => "COLOR_1 and beyond: no material uses them".to_owned(),
                Semantic::TexCoords(2..) => "TEXCOORD_2 and beyond: textures use the first two".to_owned(),
                Semantic::Joints(0) if !is_skinned => "JOINTS_0 where the node has no skin".to_owned(),
                Semantic::Extras(name) => format!("vertex attribute _{name}"),
                _ => continue,
            };
            self.ledger.note(Treatment::Ignored, text, 1);
        }
    }
}

const DRACO: &str = "KHR_draco_mesh_compression";
const SPARSE: (Treatment, &str) = (Treatment::Honoured, "sparse accessors");
const QUANTISED: (Treatment, &str) = (Treatment::Honoured, "quantised vertices");

fn has_extension(primitive: &Primitive, name: &str) -> bool {
    primitive.extensions.as_ref().is_some_and(|extensions| extensions.others.contains_key(name))
}

/// The vertices that corners refer to, among `count`, once each, ascending.
fn used(corners: &[u32], count: usize) -> Vec<u32> {
    let mut used: Vec<u32> = corners.iter().copied().filter(|&i| (i as usize) < count).collect();
    used.sort_unstable();
    used.dedup();
    used
}

fn note_kinds(builder: &mut Builder, mode: Mode, positions: &Accessor) {
    match mode {
        Mode::TriangleStrip => drop(builder.features.insert((Treatment::Honoured, "triangle strip"))),
        Mode::TriangleFan => drop(builder.features.insert((Treatment::Honoured, "triangle fan"))),
        _ => {}
    }
    note_integers(builder, positions);
}

/// Notes integers, which plain glTF does not have in positions, normals and tangents, and sparse parts.
fn note_integers(builder: &mut Builder, accessor: &Accessor) {
    if accessor.has_integers() {
        builder.features.insert(QUANTISED);
    }
    if accessor.is_sparse() {
        builder.features.insert(SPARSE);
    }
}

/// The nearest fraction of 65535; NaN is 0.
fn fraction(x: f64) -> u16 {
    (x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16
}
