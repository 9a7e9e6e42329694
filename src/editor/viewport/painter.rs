//! Draws a scene's pieces, its background and the lines over it into a picture.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use glam::{DMat4, DVec2, DVec3, DVec4, Mat4, Vec3, Vec4};

use crate::editor::viewport::batch::{Batch, batches, clip_rows};
use crate::editor::viewport::camera::{Eye, View};
use crate::editor::viewport::gl::{Attribute, Format, Geometry, Gl, Image, Mode, Program, Shape, Value};
use crate::editor::viewport::images::{Images, placing};
use crate::editor::viewport::lines::{LineVertex, Lines};
use crate::editor::viewport::piece::{Piece, Vertex};
use crate::editor::viewport::preview::{Drawing, Shown};
use crate::editor::viewport::sieve::sift;
use crate::editor::viewport::terms::{Lights, Terms};
use crate::error::Result;
use crate::math::transform::Transform;
use crate::math::vector::length;
use crate::scene::{Background, Rgb, Scene, Transfer};

const ENCODE: &str = include_str!("shaders/encode.glsl");
const INPUTS: [&str; 4] = ["position", "normal", "uvs", "color"];
const LINE_INPUTS: [&str; 4] = ["position", "other", "side", "color"];

/// So many triangles are drawn while the camera moves, where there are more.
pub const MOVING_TRIANGLES: usize = 80_000;

/// From so many triangles on it pays to look which of them reach a pixel, where the processor draws.
const SIEVED: u64 = 20_000;

/// A piece on the graphics card.
struct Uploaded {
    /// Keeps the piece, and so its address, as long as this.
    _shown: Arc<Shown>,
    geometry: Geometry,
    edges: Option<Geometry>,
    is_used: bool,
}

/// Programs, and what is on the graphics card of the scene drawn last.
pub struct Painter {
    surfaces: HashMap<Variant, Program>,
    sky: Program,
    sky_image: Program,
    line: Program,
    copy: Program,
    /// No values at all, for what the shader makes of vertices' numbers.
    nothing: Geometry,
    pieces: HashMap<(usize, bool), Uploaded>,
    images: Images,
}

/// What a surface's shaders are compiled with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Variant {
    lights: usize,
    near_lights: bool,
    glossy: bool,
    mirrors: bool,
    images: bool,
    holes: bool,
    encoded: bool,
}

impl Variant {
    fn of(terms: &Terms, lights: &Lights, is_sieved: bool) -> Self {
        let images = terms.texture.is_some() || terms.glow_texture.is_some();
        Self {
            lights: lights.places.len(),
            near_lights: lights.places.iter().any(|place| place.w != 0.0),
            glossy: terms.shine != Rgb::ZERO,
            mirrors: terms.mirror != Rgb::ZERO,
            images,
            holes: terms.cutoff > 0.0,
            encoded: is_sieved && !images,
        }
    }

    fn compiled(self, gl: &Gl) -> Result<Program> {
        let mut defined = format!("#define LIGHTS {}\n", self.lights);
        for (name, is_defined) in [
            ("NEAR_LIGHTS", self.near_lights),
            ("GLOSSY", self.glossy),
            ("MIRRORS", self.mirrors),
            ("IMAGES", self.images),
            ("HOLES", self.holes),
            ("ENCODED", self.encoded),
        ] {
            if is_defined {
                defined += &format!("#define {name}\n");
            }
        }
        let vertex = format!("{defined}{ENCODE}{}", include_str!("shaders/surface.vert"));
        let fragment = format!("{defined}{ENCODE}{}", include_str!("shaders/surface.frag"));
        gl.program(&vertex, &fragment, &INPUTS)
    }
}

/// What stays the same throughout a picture.
pub struct Frame<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// What of it is drawn.
    pub drawing: &'a Drawing,
    /// The terms of its materials.
    pub terms: &'a [Terms],
    /// Its lights, relative to `origin`.
    pub lights: &'a Lights,
    /// Where shaders' coordinates are relative to.
    pub origin: DVec3,
    /// Where it is seen from.
    pub view: &'a View,
    /// Whether stand-ins are drawn.
    pub moving: bool,
    /// Whether edges alone are drawn.
    pub wireframe: bool,
}

impl Painter {
    /// Compiles the shaders.
    ///
    /// # Errors
    /// What the driver does not support.
    pub fn new(gl: &Gl) -> Result<Self> {
        let sky = include_str!("shaders/sky.vert");
        let sky_of = |defined: &str| format!("{defined}{ENCODE}{}", include_str!("shaders/sky.frag"));
        Ok(Self {
            surfaces: HashMap::new(),
            sky: gl.program(sky, &sky_of(""), &[])?,
            sky_image: gl.program(sky, &sky_of("#define IMAGES\n"), &[])?,
            line: gl.program(include_str!("shaders/line.vert"), include_str!("shaders/line.frag"), &LINE_INPUTS)?,
            copy: gl.program(sky, include_str!("shaders/copy.frag"), &[])?,
            nothing: gl.geometry(&[], &[])?,
            pieces: HashMap::new(),
            images: Images::default(),
        })
    }

    /// Draws the background where nothing is.
    ///
    /// # Errors
    /// A limit where there is no room for its image.
    fn sky(&mut self, gl: &Gl, frame: &Frame<'_>) -> Result<()> {
        let (bottom, top, up) = sky_colors(&frame.scene.background);
        let image = match &frame.scene.background {
            Background::Image { texture, .. } => Some(self.images.of(gl, texture)?),
            _ => None,
        };
        let bottom = match &frame.scene.background {
            Background::Image { intensity, .. } => Rgb::splat(*intensity),
            _ => bottom,
        };
        let (width, height) = frame.view.size();
        let direction = |x: f64, y: f64| frame.view.ray(DVec2::new(x, y)).1;
        let corner = direction(0.0, 0.0);
        let program = if image.is_some() { &self.sky_image } else { &self.sky };
        let set = |name: &str, value: Value<'_>| gl.set(program, name, value);
        gl.use_program(program);
        // Of any length, but all together of one that f32 holds.
        let unit = 1.0 / length(corner).max(f64::MIN_POSITIVE);
        set("corner_direction", Value::Vec3((corner * unit).as_vec3()));
        set("step_x", Value::Vec3(((direction(width, 0.0) - corner) * unit).as_vec3()));
        set("step_y", Value::Vec3(((direction(0.0, height) - corner) * unit).as_vec3()));
        set("sky_bottom", Value::Vec3(bottom));
        set("sky_top", Value::Vec3(top));
        set("sky_up", Value::Vec3(up));
        set("image", Value::Int(0));
        set_film(gl, frame.scene, program);
        gl.bind_image(0, image);
        gl.set_mode(Mode { tests_depth: true, writes_depth: false, blends: false, culls: None });
        gl.draw_all(&self.nothing, 3);
        Ok(())
    }

    /// Draws all pieces and, where they leave it free, the background; then what it is seen through. Says how many triangles
    /// were drawn.
    ///
    /// # Errors
    /// A limit where there is no room.
    pub fn scene(&mut self, gl: &Gl, frame: &Frame<'_>) -> Result<u64> {
        let mut batches = batches(frame);
        // What hides others from the nearest on, the rest from the farthest on.
        let is_blended = |batch: &Batch<'_>| frame.terms[batch.material as usize].is_blended;
        batches.sort_by(|a, b| {
            let order = a.depth.total_cmp(&b.depth);
            is_blended(a).cmp(&is_blended(b)).then(if is_blended(a) { order.reverse() } else { order })
        });
        let (blended, hiding): (Vec<_>, Vec<_>) = batches.iter().partition(|batch| is_blended(batch));
        let mut triangles = self.surfaces(gl, frame, &hiding)?;
        self.sky(gl, frame)?;
        triangles += self.surfaces(gl, frame, &blended)?;
        Ok(triangles)
    }

    fn surfaces(&mut self, gl: &Gl, frame: &Frame<'_>, batches: &[&Batch<'_>]) -> Result<u64> {
        let mut in_use = None;
        let mut triangles = 0;
        for batch in batches {
            let is_sieved = gl.is_software && !frame.wireframe && batch.triangle_count() >= SIEVED;
            let variant = Variant::of(&frame.terms[batch.material as usize], frame.lights, is_sieved);
            if let Entry::Vacant(place) = self.surfaces.entry(variant) {
                place.insert(variant.compiled(gl)?);
            }
            if in_use.replace(variant) != Some(variant)
                && let Some(program) = self.surfaces.get(&variant)
            {
                gl.use_program(program);
                set_frame(gl, frame, program);
            }
            triangles += self.batch(gl, frame, batch, variant, is_sieved)?;
        }
        Ok(triangles)
    }

    fn batch(
        &mut self,
        gl: &Gl,
        frame: &Frame<'_>,
        batch: &Batch<'_>,
        variant: Variant,
        is_sieved: bool,
    ) -> Result<u64> {
        let terms = &frame.terms[batch.material as usize];
        let texture = |painter: &mut Self, reference: Option<&crate::scene::TextureRef>| -> Result<Option<Image>> {
            let texture = reference.map(|reference| &frame.scene.textures[reference.texture as usize]);
            texture.map(|texture| painter.images.of(gl, texture)).transpose()
        };
        let (image, glow) = (texture(self, terms.texture.as_ref())?, texture(self, terms.glow_texture.as_ref())?);
        gl.bind_image(0, image);
        gl.bind_image(1, glow);
        self.upload(gl, batch, frame.wireframe)?;

        let Some(program) = self.surfaces.get(&variant) else { return Ok(0) };
        let set = |name: &str, value: Value<'_>| gl.set(program, name, value);
        let transform = &batch.placed.transform;
        set("to_clip", Value::Mat4(rows_matrix(clip_rows(frame.view, transform))));
        let m = transform.to_world();
        let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| axis.extend(0.0).as_vec4());
        let [x, y, z] = columns;
        let place = (m.translation - frame.origin).as_vec3().extend(1.0);
        set("to_world", Value::Mat4(Mat4::from_cols(x, y, z, place)));
        set("normal_to_world", Value::Mat4(normal_matrix(transform)));
        set("tinted", Value::Vec3(terms.tinted));
        set("diffuse", Value::Vec3(terms.diffuse));
        set("steady", Value::Vec3(terms.steady));
        set("shine", Value::Vec4(terms.shine.extend(terms.exponent)));
        set("mirror", Value::Vec3(terms.mirror));
        set("glow", Value::Vec3(terms.glow));
        set("alpha", Value::Vec3(Vec3::new(terms.alpha, terms.cutoff, if terms.has_alpha { 1.0 } else { 0.0 })));
        set("has_image", Value::Int(i32::from(image.is_some())));
        set("has_glow_image", Value::Int(i32::from(glow.is_some())));
        let ((matrix, offset), (glow_matrix, glow_offset)) =
            (placing(terms.texture.as_ref()), placing(terms.glow_texture.as_ref()));
        set("uv_matrix", Value::Vec4(matrix));
        set("uv_offset", Value::Vec4(offset));
        set("glow_matrix", Value::Vec4(glow_matrix));
        set("glow_offset", Value::Vec4(glow_offset));

        gl.set_mode(Mode {
            tests_depth: true,
            writes_depth: !terms.is_blended,
            blends: terms.is_blended,
            culls: terms.single_sided.then(|| !transform.is_mirroring()),
        });
        // What a geometry lacks: coordinates of 0 and white.
        gl.set_default(2, Vec4::ZERO);
        gl.set_default(3, Vec4::ONE);
        let Some(uploaded) = self.pieces.get(&key(batch)) else { return Ok(0) };
        match &uploaded.edges {
            Some(edges) if frame.wireframe => {
                let parts: Vec<_> = batch.parts.iter().map(|part| 2 * part.start..2 * part.end).collect();
                gl.draw(edges, Shape::Lines, &parts);
            }
            _ if is_sieved => {
                let rows = clip_rows(frame.view, transform);
                let indices = sift(batch.piece, &batch.parts, rows, frame.view.size(), batch.sides);
                gl.draw_listed(&uploaded.geometry, &indices);
                return Ok(indices.len() as u64 / 3);
            }
            _ => gl.draw(&uploaded.geometry, Shape::Triangles, &batch.parts),
        }
        Ok(batch.triangle_count())
    }

    fn upload(&mut self, gl: &Gl, batch: &Batch<'_>, wireframe: bool) -> Result<()> {
        let piece = batch.piece;
        let uploaded = match self.pieces.entry(key(batch)) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let geometry = geometry(gl, piece, &piece.indices)?;
                let shown = batch.placed.shown.clone();
                place.insert(Uploaded { _shown: shown, geometry, edges: None, is_used: true })
            }
        };
        if wireframe && uploaded.edges.is_none() {
            uploaded.edges = Some(geometry(gl, piece, &edges(piece))?);
        }
        Ok(())
    }

    /// Draws lines, which start at `frame.origin`; those behind something with a share of their opacity.
    ///
    /// # Errors
    /// A limit where there is no room.
    pub fn lines(&self, gl: &Gl, frame: &Frame<'_>, lines: &Lines, width: f32, hidden: f32) -> Result<()> {
        if lines.vertices.is_empty() {
            return Ok(());
        }
        let fields = [
            (0, Format::Floats(3), 0),
            (1, Format::Floats(3), 12),
            (2, Format::Floats(1), 24),
            (3, Format::Floats(4), 28),
        ];
        let stride = size_of::<LineVertex>() as i32;
        let attribute = Attribute { bytes: bytemuck::cast_slice(&lines.vertices), fields: &fields, stride };
        let geometry = gl.geometry(&[attribute], &[])?;
        gl.use_program(&self.line);
        let (x, y) = frame.view.size();
        gl.set(&self.line, "to_clip", Value::Mat4(frame.view.matrix(frame.origin)));
        gl.set(&self.line, "picture", Value::Vec3(Vec3::new(x as f32, y as f32, 0.5 * width)));
        for (tests_depth, opacity) in [(false, hidden), (true, 1.0)] {
            if opacity > 0.0 {
                gl.set(&self.line, "opacity", Value::Float(opacity));
                gl.set_mode(Mode { tests_depth, writes_depth: false, blends: true, culls: None });
                gl.draw_all(&geometry, lines.vertices.len() as u32);
            }
        }
        gl.delete_geometry(geometry);
        Ok(())
    }

    /// Copies an image to the bound framebuffer, into this part of it: left, bottom, width and height in pixels.
    pub fn copy(&self, gl: &Gl, image: Image, part: [i32; 4]) {
        gl.use_program(&self.copy);
        gl.set(&self.copy, "image", Value::Int(0));
        gl.bind_image(0, Some(image));
        gl.set_viewport(part);
        gl.set_mode(Mode { tests_depth: false, writes_depth: false, blends: false, culls: None });
        gl.draw_all(&self.nothing, 3);
        gl.bind_image(0, None);
    }

    /// Forgets what the drawing does not have.
    pub fn retain(&mut self, gl: &Gl, scene: &Scene, drawing: &Drawing) {
        self.pieces.values_mut().for_each(|uploaded| uploaded.is_used = false);
        for placed in &drawing.placed {
            for is_stand_in in [false, true] {
                if let Some(uploaded) = self.pieces.get_mut(&(Arc::as_ptr(&placed.shown) as usize, is_stand_in)) {
                    uploaded.is_used = true;
                }
            }
        }
        let unused: Vec<_> =
            self.pieces.iter().filter(|(_, uploaded)| !uploaded.is_used).map(|(&key, _)| key).collect();
        unused.iter().filter_map(|key| self.pieces.remove(key)).for_each(|uploaded| uploaded.destroy(gl));
        self.images.retain(gl, scene);
    }

    /// Frees everything.
    pub fn destroy(mut self, gl: &Gl) {
        self.pieces.drain().for_each(|(_, uploaded)| uploaded.destroy(gl));
        self.images.destroy(gl);
        gl.delete_geometry(self.nothing);
        self.surfaces
            .into_values()
            .chain([self.sky, self.sky_image, self.line, self.copy])
            .for_each(|program| gl.delete_program(program));
    }
}

fn set_frame(gl: &Gl, frame: &Frame<'_>, program: &Program) {
    let set = |name: &str, value: Value<'_>| gl.set(program, name, value);
    let eye = match frame.view.eye() {
        Eye::At(eye) => (eye - frame.origin).as_vec3().extend(1.0),
        Eye::Parallel(direction) => (-direction).as_vec3().extend(0.0),
    };
    set("eye", Value::Vec4(eye));
    set("light_places", Value::Vec4s(&frame.lights.places));
    set("light_colors", Value::Vec4s(&frame.lights.colors));
    set("light_cones", Value::Vec4s(&frame.lights.cones));
    set("light_rims", Value::Floats(&frame.lights.rims));
    let (bottom, top, up) = sky_colors(&frame.scene.background);
    set("sky_bottom", Value::Vec3(bottom));
    set("sky_top", Value::Vec3(top));
    set("sky_up", Value::Vec3(up));
    set("image", Value::Int(0));
    set("glow_image", Value::Int(1));
    set_film(gl, frame.scene, program);
}

fn set_film(gl: &Gl, scene: &Scene, program: &Program) {
    gl.set(program, "exposure", Value::Float(libm::exp2f(scene.film.exposure)));
    gl.set(program, "is_linear", Value::Int(i32::from(scene.film.transfer == Transfer::Linear)));
}

impl Uploaded {
    fn destroy(self, gl: &Gl) {
        gl.delete_geometry(self.geometry);
        if let Some(edges) = self.edges {
            gl.delete_geometry(edges);
        }
    }
}

fn key(batch: &Batch<'_>) -> (usize, bool) {
    (Arc::as_ptr(&batch.placed.shown) as usize, batch.is_stand_in)
}

fn rows_matrix([x, y, z, w]: [DVec4; 4]) -> Mat4 {
    DMat4::from_cols(x, y, z, w).transpose().as_mat4()
}

/// The inverse transpose, scaled to numbers that f32 holds: normals are made unit vectors afterwards.
fn normal_matrix(transform: &Transform) -> Mat4 {
    let columns = DVec3::AXES.map(|axis| transform.normal_to_world(axis));
    let largest = columns.iter().map(|column| column.abs().max_element()).fold(f64::MIN_POSITIVE, f64::max);
    let [x, y, z] = columns.map(|column| (column / largest).as_vec3().extend(0.0));
    Mat4::from_cols(x, y, z, Vec4::W)
}

/// The colours straight down and straight up, and which way that is; what mirrors show of the background.
fn sky_colors(background: &Background) -> (Rgb, Rgb, Vec3) {
    match background {
        Background::Color(color) => (*color, *color, Vec3::Y),
        Background::Gradient { bottom, top, up } => (*bottom, *top, up.as_vec3()),
        Background::Image { texture, intensity } => {
            let at = |v: f64| texture.sample_footprint(DVec2::new(0.5, v), f32::MAX).truncate() * *intensity;
            (at(0.25), at(0.75), Vec3::Y)
        }
        Background::Transparent => (Rgb::ZERO, Rgb::ZERO, Vec3::Y),
    }
}

fn geometry(gl: &Gl, piece: &Piece, indices: &[u32]) -> Result<Geometry> {
    let vertices = Attribute {
        bytes: bytemuck::cast_slice(&piece.vertices),
        fields: &[(0, Format::Floats(3), 0), (1, Format::Signed, 12)],
        stride: size_of::<Vertex>() as i32,
    };
    let mut attributes = vec![vertices];
    if let Some(uvs) = &piece.uvs {
        let fields = &[(2, Format::Floats(4), 0)];
        attributes.push(Attribute { bytes: bytemuck::cast_slice(uvs), fields, stride: 16 });
    }
    if let Some(colors) = &piece.colors {
        let fields = &[(3, Format::Fractions, 0)];
        attributes.push(Attribute { bytes: bytemuck::cast_slice(colors), fields, stride: 8 });
    }
    gl.geometry(&attributes, indices)
}

/// The edges of a piece's triangles, in their order: a part of the indices has its edges in twice the part.
fn edges(piece: &Piece) -> Vec<u32> {
    piece.indices.chunks_exact(3).flat_map(|corners| (0..3).flat_map(|k| [corners[k], corners[(k + 1) % 3]])).collect()
}
