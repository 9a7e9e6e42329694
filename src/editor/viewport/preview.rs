//! What of a scene is drawn: its shapes as [`Piece`]s, made once, and where they stand.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::array::Array;
use crate::editor::viewport::decimate::decimate;
use crate::editor::viewport::piece::{Piece, Source};
use crate::editor::viewport::tessellate::{Extent, Fineness, Tessellation, tessellate};
use crate::geometry::mesh::Materials;
use crate::geometry::{Bounds, Quadric, TriangleMesh};
use crate::math::transform::{Transform, apply, point};
use crate::scene::{Object, Scene, Shape};

/// How far endless surfaces are shown, in sizes of what has an end.
const ENDLESS: f64 = 10.0;

/// Cells along a quadric's longest side, where there are few of them; and where there are very many.
const CELLS: (u32, u32) = (40, 12);

/// So many quadrics are drawn in full fineness.
const FEW_QUADRICS: usize = 8;

/// Meshes of more triangles are made pieces in the background.
const AT_ONCE: usize = 100_000;

/// Pieces of fewer triangles need no stand-in, and it is not looked whether they are closed.
const SMALL: usize = 20_000;

/// A shape's piece, and what is shown for it while the camera moves.
#[derive(Debug)]
pub struct Shown {
    /// All triangles.
    pub piece: Piece,
    stand_in: OnceLock<Option<Piece>>,
    is_begun: AtomicBool,
}

/// A piece at its place.
#[derive(Debug, Clone)]
pub struct Placed {
    /// What is drawn.
    pub shown: Arc<Shown>,
    /// The object's number.
    pub instance: u32,
    /// From the piece's vertices to the file's coordinates.
    pub transform: Transform,
    /// Replaces the material of its clusters.
    pub material: Option<u32>,
}

/// Which triangles of a mesh are flat though it has normals.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Flatness {
    None,
    All,
    /// Those of these materials.
    Of(Vec<u32>),
}

/// The pieces of scenes, kept while somebody else holds their shapes.
#[derive(Debug, Default)]
pub struct Preview {
    meshes: HashMap<(usize, Flatness), OfMesh>,
    quadrics: Vec<(Quadric, Fineness, Arc<Shown>)>,
}

/// A mesh and its piece.
#[derive(Debug)]
struct OfMesh {
    mesh: Arc<TriangleMesh>,
    /// Empty while it is being made.
    made: Arc<OnceLock<Arc<Shown>>>,
    /// Where it will be.
    bounds: Bounds,
}

/// All that is drawn of a scene.
#[derive(Debug, Clone, Default)]
pub struct Drawing {
    /// In the order of the scene's objects; those that show nothing are left out.
    pub placed: Vec<Placed>,
    /// The box around what has an end, in the file's coordinates; `None` where nothing has.
    pub extent: Option<Extent>,
    /// Whether pieces are missing, which are being made.
    pub is_waiting: bool,
}

impl Preview {
    /// What is drawn of a scene. What was made for an earlier one is used again; large meshes are left out until another thread has made
    /// them.
    pub fn drawing(&mut self, scene: &Scene) -> Drawing {
        let mut drawing = Drawing::default();
        for (instance, object) in scene.objects.iter().enumerate() {
            if let Shape::Mesh(mesh) = object.shape {
                let mesh = &scene.meshes[mesh as usize];
                match self.mesh(scene, mesh, object) {
                    Ok(shown) => drawing.place(shown, instance, object),
                    Err(bounds) => drawing.wait_for(mesh, &bounds, object),
                }
            }
        }
        self.meshes.retain(|_, known| Arc::strong_count(&known.mesh) > 1);
        self.add_quadrics(scene, &mut drawing);
        drawing.placed.sort_by_key(|placed| placed.instance);
        drawing
    }

    /// A mesh's piece, or where it will be.
    fn mesh(&mut self, scene: &Scene, mesh: &Arc<TriangleMesh>, object: &Object) -> Result<Arc<Shown>, Bounds> {
        let is_flat = |material: u32| scene.materials[material as usize].flat;
        let flatness = match (&mesh.materials, object.material) {
            _ if mesh.normals.is_none() => Flatness::All,
            (_, Some(material)) | (&Materials::One(material), None) => {
                if is_flat(material) {
                    Flatness::All
                } else {
                    Flatness::None
                }
            }
            (Materials::PerTriangle(_), None) => {
                let flat: Vec<u32> = (0..scene.materials.len() as u32).filter(|&number| is_flat(number)).collect();
                if flat.is_empty() { Flatness::None } else { Flatness::Of(flat) }
            }
        };
        let key = (Arc::as_ptr(mesh) as usize, flatness);
        if let Some(known) = self.meshes.get(&key) {
            return known.made.get().cloned().ok_or(known.bounds);
        }
        let made = Arc::new(OnceLock::new());
        let is_large = mesh.indices.len() > AT_ONCE;
        let bounds = if is_large { mesh.bounds() } else { Bounds::EMPTY };
        self.meshes.insert(key.clone(), OfMesh { mesh: mesh.clone(), made: made.clone(), bounds });
        let (own, mesh) = (made.clone(), mesh.clone());
        let make = move || {
            let piece = match &key.1 {
                Flatness::None => piece_of_mesh(&mesh, &|_| false),
                Flatness::All => piece_of_mesh(&mesh, &|_| true),
                Flatness::Of(materials) => piece_of_mesh(&mesh, &|material| materials.contains(&material)),
            };
            own.get_or_init(|| Shown::of(piece));
        };
        if is_large {
            rayon::spawn(make);
        } else {
            make();
        }
        made.get().cloned().ok_or(bounds)
    }

    fn add_quadrics(&mut self, scene: &Scene, drawing: &mut Drawing) {
        let objects = || {
            scene.objects.iter().enumerate().filter_map(|(instance, object)| match object.shape {
                Shape::Quadric(quadric) => Some((instance, object, &scene.quadrics[quadric as usize])),
                Shape::Mesh(_) => None,
            })
        };
        let count = objects().count();
        for (_, object, quadric) in objects() {
            if let Some(bounds) = quadric.bounds() {
                drawing.include(bounds.corners().map(|corner| point(&object.transform, corner.as_dvec3())));
            }
        }
        let extent = drawing.extent.unwrap_or(Extent::ORDINARY);
        // As many triangles as a few fine ones have, whatever their number.
        let share = (FEW_QUADRICS as f64 / count.max(1) as f64).sqrt().min(1.0);
        let cells = ((f64::from(CELLS.0) * share) as u32).max(CELLS.1);
        let mut kept = Vec::new();
        for (instance, object, quadric) in objects() {
            let Some(fineness) = fineness(quadric, object, &extent, cells) else { continue };
            let is_same = |(other, with, _): &&(Quadric, Fineness, _)| other == quadric && *with == fineness;
            let shown = match kept.iter().chain(&self.quadrics).find(is_same) {
                Some((_, _, shown)) => shown.clone(),
                None => Shown::of(piece_of_quadric(&tessellate(quadric, &fineness))),
            };
            if !kept.iter().any(|entry| is_same(&entry)) {
                kept.push((quadric.clone(), fineness, shown.clone()));
            }
            drawing.place(shown, instance, object);
        }
        self.quadrics = kept;
    }
}

/// How a quadric is divided; `None` for a transform that has no inverse.
fn fineness(quadric: &Quadric, object: &Object, extent: &Extent, cells: u32) -> Option<Fineness> {
    let transform = Transform::new(object.transform).ok()?;
    if quadric.bounds().is_some() {
        // It has an end of its own: one piece wherever it stands.
        let none = Extent { min: DVec3::ZERO, max: DVec3::ZERO };
        return Some(Fineness { cells, near: none, far: none });
    }
    let local = |extent: &Extent| {
        extent.corners().map(|corner| transform.point_to_object(corner)).into_iter().fold(
            Extent { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY },
            |Extent { min, max }, p| Extent { min: min.min(p), max: max.max(p) },
        )
    };
    let (center, half) = ((extent.min + extent.max) * 0.5, (extent.max - extent.min) * 0.5);
    // A cube, so that flat scenes are seen from above their plane too.
    let half = DVec3::splat(half.max_element());
    let grown = |factor: f64| local(&Extent { min: center - half * factor, max: center + half * factor });
    Some(Fineness { cells, near: grown(1.0), far: grown(ENDLESS) })
}

impl Drawing {
    fn place(&mut self, shown: Arc<Shown>, instance: usize, object: &Object) {
        let piece = &shown.piece;
        let m = object.transform.matrix3;
        let to_world = DAffine3 {
            matrix3: DMat3::from_cols(m.x_axis * piece.scale, m.y_axis * piece.scale, m.z_axis * piece.scale),
            translation: apply(&m, piece.origin) + object.transform.translation,
        };
        // What has no inverse is flat: the renderer tells so.
        let Ok(transform) = Transform::new(to_world) else { return };
        if piece.indices.is_empty() {
            return;
        }
        let placed = Placed { shown, instance: instance as u32, transform, material: object.material };
        if let Shape::Mesh(_) = object.shape {
            self.include(placed.corners());
        }
        self.placed.push(placed);
    }

    /// Keeps room for a mesh whose piece is being made.
    fn wait_for(&mut self, mesh: &TriangleMesh, bounds: &Bounds, object: &Object) {
        self.is_waiting = true;
        let (origin, scale) = (mesh.origin, mesh.scale());
        let corners = Extent { min: bounds.min.as_dvec3(), max: bounds.max.as_dvec3() }.corners();
        self.include(corners.map(|corner| point(&object.transform, origin + corner * scale)));
    }

    fn include(&mut self, corners: [DVec3; 8]) {
        let mut extent = self.extent.unwrap_or(Extent { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY });
        for corner in corners.into_iter().filter(|corner| corner.is_finite()) {
            extent = Extent { min: extent.min.min(corner), max: extent.max.max(corner) };
        }
        self.extent = Some(extent).filter(|extent| extent.min.is_finite());
    }

    /// The corners of the boxes of all that is drawn.
    pub fn corners(&self) -> impl Iterator<Item = DVec3> {
        self.placed.iter().flat_map(Placed::corners)
    }

    /// Triangles of all pieces.
    pub fn triangle_count(&self) -> usize {
        self.placed.iter().map(|placed| placed.shown.piece.triangle_count()).sum()
    }
}

impl Placed {
    /// The corners of its box in the file's coordinates; bit k of a corner's number says which side of axis k it is on.
    pub fn corners(&self) -> [DVec3; 8] {
        let (min, max) = self.shown.piece.bounds;
        let corners = Extent { min: min.as_dvec3(), max: max.as_dvec3() }.corners();
        corners.map(|corner| self.transform.point_to_world(corner))
    }
}

impl Shown {
    fn of(mut piece: Piece) -> Arc<Self> {
        if piece.triangle_count() >= SMALL {
            piece.find_whether_closed();
        }
        Arc::new(Self { piece, stand_in: OnceLock::new(), is_begun: AtomicBool::new(false) })
    }

    /// What stands for the piece while the camera moves; `None` while it is being made, and for small pieces.
    ///
    /// Of a drawing of so many triangles, all stand-ins together have about `most`. It is made once, in the background.
    pub fn stand_in(self: &Arc<Self>, total: usize, most: usize) -> Option<&Piece> {
        if !self.wants_stand_in(total, most) {
            return None;
        }
        let count = self.piece.triangle_count();
        if let Some(made) = self.stand_in.get() {
            return made.as_ref();
        }
        if self.is_begun.swap(true, Ordering::Relaxed) {
            return None;
        }
        let own = Arc::clone(self);
        let target = (count as f64 * (most as f64 / total as f64)).max(500.0) as usize;
        rayon::spawn(move || {
            own.stand_in.get_or_init(|| (target < count).then(|| decimate(&own.piece, target)));
        });
        None
    }

    /// Whether there is to be one: for what is not small, of a drawing that has too many triangles.
    fn wants_stand_in(&self, total: usize, most: usize) -> bool {
        self.piece.triangle_count() >= SMALL / 10 && total > most
    }

    /// Whether [`stand_in`](Self::stand_in) gives all that it will ever give.
    pub fn has_stand_in(&self, total: usize, most: usize) -> bool {
        !self.wants_stand_in(total, most) || self.stand_in.get().is_some()
    }
}

/// The triangles of a mesh that can be hit; flat where it has no normals and where the material is.
pub fn piece_of_mesh(mesh: &TriangleMesh, is_flat: &(dyn Fn(u32) -> bool + Sync)) -> Piece {
    let live: Vec<u32> = mesh.live_triangles().collect();
    Piece::of(&MeshSource { mesh, live, is_flat }, mesh.origin, mesh.scale())
}

struct MeshSource<'a> {
    mesh: &'a TriangleMesh,
    live: Vec<u32>,
    is_flat: &'a (dyn Fn(u32) -> bool + Sync),
}

impl Source for MeshSource<'_> {
    fn triangle_count(&self) -> usize {
        self.live.len()
    }

    fn corners(&self, triangle: usize) -> [u32; 3] {
        self.mesh.indices[self.live[triangle] as usize]
    }

    fn material(&self, triangle: usize) -> u32 {
        self.mesh.material(self.live[triangle])
    }

    fn is_flat(&self, triangle: usize) -> bool {
        self.mesh.normals.is_none() || (self.is_flat)(self.material(triangle))
    }

    fn position(&self, vertex: u32) -> Vec3 {
        self.mesh.positions[vertex as usize]
    }

    fn normal(&self, vertex: u32) -> Vec3 {
        self.mesh.normals.as_ref().map_or(Vec3::ZERO, |normals| normals[vertex as usize])
    }

    fn uv(&self, vertex: u32) -> Option<[f32; 4]> {
        let (first, second) = (self.mesh.uvs.as_ref(), self.mesh.second_uvs.as_ref());
        let at = |uvs: Option<&Array<glam::Vec2>>| uvs.map_or([0.0; 2], |uvs| uvs[vertex as usize].to_array());
        let ([u, v], [s, t]) = (at(first), at(second));
        (first.is_some() || second.is_some()).then_some([u, v, s, t])
    }

    fn color(&self, vertex: u32) -> Option<[u16; 4]> {
        self.mesh.colors.as_ref().map(|colors| colors[vertex as usize])
    }
}

fn piece_of_quadric(mesh: &Tessellation) -> Piece {
    let inside = |fold: fn(DVec3, DVec3) -> DVec3| mesh.positions.iter().copied().reduce(fold).unwrap_or(DVec3::ZERO);
    let origin = (inside(DVec3::min) + inside(DVec3::max)) * 0.5;
    Piece::of(&QuadricSource { mesh, origin }, origin, 1.0)
}

struct QuadricSource<'a> {
    mesh: &'a Tessellation,
    origin: DVec3,
}

impl Source for QuadricSource<'_> {
    fn triangle_count(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn corners(&self, triangle: usize) -> [u32; 3] {
        self.mesh.triangles[triangle]
    }

    fn material(&self, _: usize) -> u32 {
        0
    }

    fn is_flat(&self, _: usize) -> bool {
        false
    }

    fn position(&self, vertex: u32) -> Vec3 {
        (self.mesh.positions[vertex as usize] - self.origin).as_vec3()
    }

    fn normal(&self, vertex: u32) -> Vec3 {
        self.mesh.normals[vertex as usize].as_vec3()
    }

    fn uv(&self, vertex: u32) -> Option<[f32; 4]> {
        let uv = self.mesh.uvs[vertex as usize].as_vec2();
        Some([uv.x, uv.y, 0.0, 0.0])
    }

    fn color(&self, _: u32) -> Option<[u16; 4]> {
        None
    }
}
