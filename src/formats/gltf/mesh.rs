//! A glTF mesh: its primitives, one after the other, in one [`TriangleMesh`].

use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Index, Root};
use glam::{DVec3, Vec2, Vec3};

use super::accessor::Accessor;
use super::budget::Budget;
use super::buffers::Buffers;
use super::document::missing_extension;
use super::topology;
use crate::error::{Error, Result};
use crate::formats::{Ledger, NormalMode, Treatment, rounding};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::{Materials, Rounding};
use crate::math::origin::choose_origin;
use crate::scene::Material;

/// What all meshes of a file are read with.
pub(super) struct MeshReader<'a> {
    pub root: &'a Root,
    pub buffers: &'a Buffers<'a>,
    /// All materials of the file, that of primitives without one among them.
    pub materials: &'a [Material],
    /// The material of primitives that have none.
    pub default_material: u32,
    pub normals: NormalMode,
}

/// A vertex number that no mesh has: [`TriangleMesh::finish`] drops triangles with it.
const NO_VERTEX: u32 = u32::MAX;

/// A mesh in the making. Attributes exist from the first primitive on that has them.
#[derive(Default)]
struct Builder {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: [Vec<Vec2>; 2],
    indices: Vec<[u32; 3]>,
    /// Materials and up to which triangle each reaches.
    materials: Vec<(u32, usize)>,
}

impl MeshReader<'_> {
    /// Reads a mesh. It may have no triangles at all.
    ///
    /// # Errors
    /// A file's error that names the place, for accessors that do not fit their buffers or their use; a limit.
    pub fn read(&self, number: usize, budget: &mut Budget, ledger: &mut Ledger) -> Result<TriangleMesh> {
        let mesh = &self.root.meshes[number];
        let mut builder = Builder::default();
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            self.add(&mut builder, primitive, budget, ledger)
                .map_err(|error| error.within(format_args!("meshes[{number}].primitives[{p}]")))?;
        }
        builder.finish(mesh.name.clone().unwrap_or_else(|| format!("mesh {number}")), self.normals)
    }

    fn open(&self, index: Index<json::Accessor>) -> Result<Accessor<'_>> {
        Accessor::open(self.root, self.buffers, index)
    }

    fn add(
        &self,
        builder: &mut Builder,
        primitive: &Primitive,
        budget: &mut Budget,
        ledger: &mut Ledger,
    ) -> Result<()> {
        note_unread_parts(primitive, ledger);
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            _ => {
                ledger.note(Treatment::Ignored, "primitive of points or lines", 1);
                return Ok(());
            }
        };
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        // Validation has put a primitive without positions in the ledger; there is nothing to draw.
        let Some(positions) = attribute(Semantic::Positions) else { return Ok(()) };
        let positions = self.open(positions)?;
        if !positions.has_data() && has_extension(primitive, DRACO) {
            return Err(missing_extension(DRACO));
        }

        // Corners are vertices of the accessor, in file order; more triangles than memory are refused first.
        let indices = primitive.indices.map(|index| self.open(index)).transpose()?;
        let corner_count = indices.as_ref().map_or(positions.count(), Accessor::count);
        let triangle_count = topology::triangle_count(mode, corner_count).unwrap_or(0);
        budget.take::<[u32; 4]>(triangle_count)?;
        if mode == Mode::Triangles && corner_count % 3 != 0 {
            ledger.note(Treatment::Warning, "vertices left over after the last triangle", (corner_count % 3) as u64);
        }
        let corners = indices.map(|indices| indices.indices()).transpose()?;

        // A primitive that uses few vertices of a large shared array takes those alone.
        let selection = corners.as_ref().filter(|corners| corners.len() < positions.count()).map(|corners| {
            let mut used: Vec<u32> = corners.iter().copied().filter(|&i| (i as usize) < positions.count()).collect();
            used.sort_unstable();
            used.dedup();
            used
        });
        let vertex_count = selection.as_ref().map_or(positions.count(), Vec::len);
        budget.take_vertices(vertex_count)?;
        let first = builder.positions.len();
        u32::try_from(first + vertex_count).map_err(|_| Error::limit("more than 4294967295 vertices in a mesh"))?;
        let vertex = |corner: usize| -> u32 {
            let number = corners.as_ref().map_or(corner as u32, |corners| corners[corner]);
            let local = match &selection {
                Some(used) => used.binary_search(&number).ok(),
                None => Some(number as usize).filter(|&number| number < vertex_count),
            };
            local.map_or(NO_VERTEX, |local| (first + local) as u32)
        };
        builder.indices.try_reserve(triangle_count).map_err(|_| Error::limit("not enough memory for the triangles"))?;
        builder.indices.extend((0..triangle_count).map(|number| topology::corners(mode, number).map(vertex)));

        // Attributes, which must belong to the same vertices.
        let selection = selection.as_deref();
        builder.positions.append(&mut positions.vectors::<3, Vec3>(selection)?);
        let mut shading = |name: &str, semantic| -> Result<Option<Accessor<'_>>> {
            let accessor = attribute(semantic).map(|index| self.open(index)).transpose()?;
            Ok(accessor.filter(|accessor| {
                let fits = accessor.count() >= positions.count();
                if !fits {
                    ledger.note(Treatment::Warning, format!("{name} for fewer vertices than POSITION: left out"), 1);
                }
                fits
            }))
        };
        if self.normals == NormalMode::File
            && let Some(normals) = shading("NORMAL", Semantic::Normals)?
        {
            builder.normals.resize(first, Vec3::ZERO);
            builder.normals.append(&mut normals.vectors::<3, Vec3>(selection)?);
        }
        let material = primitive.material.map_or(self.default_material, |material| material.value() as u32);
        for set in 0..2 {
            // The first set is kept for what may be wanted of it later, the second where it is used.
            let is_used = set == 0 || self.materials[material as usize].textures().any(|texture| texture.second_uvs);
            let uvs = if is_used { shading("TEXCOORD", Semantic::TexCoords(set))? } else { None };
            if let Some(uvs) = uvs {
                let own = &mut builder.uvs[set as usize];
                own.resize(first, Vec2::ZERO);
                // v goes down from the top of the image in the file, and up from its bottom here.
                own.extend(uvs.vectors::<2, Vec2>(selection)?.into_iter().map(|uv| Vec2::new(uv.x, 1.0 - uv.y)));
            }
        }
        builder.materials.push((material, builder.indices.len()));
        Ok(())
    }
}

const DRACO: &str = "KHR_draco_mesh_compression";

fn has_extension(primitive: &Primitive, name: &str) -> bool {
    primitive.extensions.as_ref().is_some_and(|extensions| extensions.others.contains_key(name))
}

fn note_unread_parts(primitive: &Primitive, ledger: &mut Ledger) {
    if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
        ledger.note(Treatment::Ignored, "primitive with morph targets", 1);
    }
    if primitive.attributes.keys().any(|key| matches!(key, Checked::Valid(Semantic::Colors(_)))) {
        ledger.note(Treatment::Ignored, "primitive with vertex colours", 1);
    }
}

impl Builder {
    fn finish(mut self, name: String, mode: NormalMode) -> Result<TriangleMesh> {
        let vertices = self.positions.len();
        let materials = match self.materials.as_slice() {
            [] => Materials::default(),
            [(first, _), rest @ ..] if rest.iter().all(|(material, _)| material == first) => Materials::One(*first),
            runs => {
                let mut each = Vec::with_capacity(self.indices.len());
                for &(material, end) in runs {
                    each.resize(end, material);
                }
                Materials::PerTriangle(each)
            }
        };
        let normals = (!self.normals.is_empty()).then(|| {
            self.normals.resize(vertices, Vec3::ZERO);
            self.normals
        });
        let [uvs, second_uvs] = self.uvs.map(|mut uvs| {
            (!uvs.is_empty()).then(|| {
                uvs.resize(vertices, Vec2::ZERO);
                uvs
            })
        });
        let (mut positions, indices) = (self.positions, self.indices);
        let rounding = Rounding { largest_loss: 0.0, finest_edge: finest_edge(&positions, &indices) };
        // The file has f32, and such numbers stay exact relative to any origin that is chosen.
        let origin = choose_origin(positions.iter().map(|p| p.as_dvec3()));
        if origin != DVec3::ZERO {
            positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
        }
        let mut mesh = TriangleMesh {
            name,
            origin,
            positions,
            indices,
            normals,
            uvs,
            second_uvs,
            materials,
            rounding,
            ..Default::default()
        }
        .finish()?;
        if mode == NormalMode::Smooth {
            mesh.compute_normals();
        }
        Ok(mesh)
    }
}

/// The shortest edge of the triangles.
fn finest_edge(positions: &[Vec3], indices: &[[u32; 3]]) -> Option<f64> {
    let point = |number: u32| positions.get(number as usize).map_or(DVec3::NAN, |p| p.as_dvec3());
    let edges = indices.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).map(|(a, b)| (point(a), point(b)));
    rounding::finest_edge(edges, rounding::magnitude(positions.iter().map(|p| p.as_dvec3())))
}
