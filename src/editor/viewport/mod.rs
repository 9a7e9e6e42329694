//! The viewport: a preview of a scene by OpenGL, shaded by the formula of the renderer at vertices (Gouraud 1971), without
//! shadows, refraction and mirrors other than of the background.
//!
//! [`preview`] makes a scene's shapes [`piece`]s; [`painter`] draws them by [`gl`], the only part that knows OpenGL.
//! [`camera`] says where points are in the picture. What was drawn stays in a picture of its own, which is copied to the
//! window until something changes.

pub mod batch;
pub mod camera;
pub mod decimate;
pub mod gl;
pub mod images;
pub mod lines;
pub mod painter;
pub mod piece;
pub mod preview;
pub mod sieve;
pub mod terms;
pub mod tessellate;

use std::sync::Arc;

use eframe::glow;
use glam::DVec3;

pub use camera::View;

use crate::error::{Error, Result};
use crate::scene::{Camera, Scene};
use gl::{Gl, Target};
use lines::Lines;
use painter::{Frame, Painter};
use preview::{Drawing, Preview};
use terms::{Lights, Terms};
use tessellate::Extent;

/// Samples a pixel where the graphics card draws: edges are smooth, and it costs little there.
const SAMPLES: u32 = 4;

/// The colour of what marks the selection.
const SELECTED: [f32; 4] = [1.0, 0.6, 0.1, 1.0];

/// What is shown beside the scene itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// Whether the camera moves: large meshes are shown by coarse stand-ins, once they are made.
    pub moving: bool,
    /// Whether there is a grid on the ground, and axes.
    pub grid: bool,
    /// Whether edges are drawn instead of faces.
    pub wireframe: bool,
    /// Numbers of the objects that get a box around them.
    pub selected: Vec<u32>,
}

/// What drawing took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stats {
    /// Triangles that were drawn; those of clusters that cannot be seen are left out.
    pub triangles: u64,
    /// Triangles of the whole scene.
    pub of: u64,
    /// Whether anything had changed since the picture was drawn.
    pub is_new: bool,
    /// Whether all that the scene has is drawn: large meshes follow once they are prepared.
    pub is_whole: bool,
}

/// A preview of a scene in a picture of its own.
pub struct Viewport {
    gl: Gl,
    painter: Painter,
    preview: Preview,
    prepared: Option<Prepared>,
    target: Option<Target>,
    drawn: Option<Drawn>,
}

/// What was made of a scene.
struct Prepared {
    scene: Arc<Scene>,
    drawing: Drawing,
    terms: Vec<Terms>,
    lights: Lights,
    origin: DVec3,
}

/// What the picture shows.
struct Drawn {
    scene: Arc<Scene>,
    camera: Camera,
    options: Options,
    stats: Stats,
}

impl Viewport {
    /// A viewport in a context that is current now and whenever this is used.
    ///
    /// # Errors
    /// What is not supported: OpenGL below 3.3 or OpenGL ES below 3.0, or shaders that the driver refuses.
    pub fn new(gl: Arc<glow::Context>) -> Result<Self> {
        Self::with(Gl::new(gl)?)
    }

    /// The same with a context that was looked at already.
    ///
    /// # Errors
    /// Shaders that the driver refuses.
    pub fn with(gl: Gl) -> Result<Self> {
        let painter = Painter::new(&gl)?;
        Ok(Self { gl, painter, preview: Preview::default(), prepared: None, target: None, drawn: None })
    }

    /// Draws the scene into the viewport's own picture, unless that shows it already.
    ///
    /// # Errors
    /// A camera that shows nothing, a picture without pixels or larger than OpenGL takes, and no room on the graphics card.
    pub fn draw(&mut self, scene: &Arc<Scene>, camera: &Camera, size: (u32, u32), options: &Options) -> Result<Stats> {
        let is_drawn = self.target.as_ref().is_some_and(|target| target.size == size)
            && self.drawn.as_ref().is_some_and(|drawn| {
                let is_same = Arc::ptr_eq(&drawn.scene, scene) && drawn.camera == *camera && drawn.options == *options;
                is_same && drawn.stats.is_whole
            });
        if let Some(drawn) = self.drawn.as_ref().filter(|_| is_drawn) {
            return Ok(Stats { is_new: false, ..drawn.stats });
        }
        let longest = self.gl.longest_side;
        if size.0 > longest || size.1 > longest {
            let message =
                format!("a viewport of {} x {} pixels is larger than the {longest} of OpenGL", size.0, size.1);
            return Err(Error::limit(message));
        }
        let view = View::new(camera, size.0, size.1)?;
        self.drawn = None;
        let saved = self.gl.save();
        let stats = self.draw_new(scene, view, size, options);
        self.gl.restore(&saved);
        let stats = stats?;
        self.drawn = Some(Drawn { scene: scene.clone(), camera: *camera, options: options.clone(), stats });
        Ok(stats)
    }

    fn draw_new(&mut self, scene: &Arc<Scene>, view: View, size: (u32, u32), options: &Options) -> Result<Stats> {
        self.prepare(scene);
        self.resize(size)?;
        let Self { gl, painter, prepared, target, .. } = self;
        let (Some(prepared), Some(target)) = (prepared, target) else { return Ok(Stats::default()) };
        let drawing = &prepared.drawing;
        let near = drawing.extent.unwrap_or(Extent::ORDINARY);
        let view = view.around(drawing.corners().chain(near.corners()));
        let frame = Frame {
            scene,
            drawing,
            terms: &prepared.terms,
            lights: &prepared.lights,
            origin: prepared.origin,
            view: &view,
            moving: options.moving,
            wireframe: options.wireframe,
        };

        gl.begin(target);
        let triangles = painter.scene(gl, &frame)?;
        if options.grid {
            let mut lines = Lines::default();
            lines.add_grid(&near, frame.origin);
            painter.lines(gl, &frame, &lines, 1.0, 0.0)?;
        }
        let mut boxes = Lines::default();
        for placed in drawing.placed.iter().filter(|placed| options.selected.contains(&placed.instance)) {
            boxes.add_box(&placed.corners(), frame.origin, SELECTED);
        }
        painter.lines(gl, &frame, &boxes, 2.0, 0.35)?;
        gl.end(target);
        let of = drawing.triangle_count() as u64;
        Ok(Stats { triangles, of, is_new: true, is_whole: !drawing.is_waiting })
    }

    /// Makes of a scene what is drawn of it, unless that is done.
    fn prepare(&mut self, scene: &Arc<Scene>) {
        let is_whole = |prepared: &Prepared| Arc::ptr_eq(&prepared.scene, scene) && !prepared.drawing.is_waiting;
        if self.prepared.as_ref().is_some_and(is_whole) {
            return;
        }
        let drawing = self.preview.drawing(scene);
        let origin = drawing.extent.map_or(scene.origin, |extent| (extent.min + extent.max) * 0.5);
        let terms = scene.materials.iter().map(|material| Terms::of(scene, material)).collect();
        let lights = Lights::of(scene, origin);
        self.painter.retain(&self.gl, scene, &drawing);
        self.prepared = Some(Prepared { scene: scene.clone(), drawing, terms, lights, origin });
    }

    fn resize(&mut self, size: (u32, u32)) -> Result<()> {
        if self.target.as_ref().is_some_and(|target| target.size == size) {
            return Ok(());
        }
        if let Some(target) = self.target.take() {
            self.gl.delete_target(target);
        }
        let samples = if self.gl.is_software { 1 } else { SAMPLES };
        // Not every driver has several samples; every one has one.
        let target = self.gl.target(size, samples).or_else(|_| self.gl.target(size, 1))?;
        self.target = Some(target);
        Ok(())
    }

    /// Copies the picture to the bound framebuffer, into this part of it: left, bottom, width and height in pixels.
    pub fn blit(&self, part: [i32; 4]) {
        if let Some(target) = &self.target {
            let saved = self.gl.save();
            self.painter.copy(&self.gl, target.color, part);
            self.gl.restore(&saved);
        }
    }

    /// The picture's bytes, red, green, blue and alpha, rows from the top; empty before anything is drawn.
    pub fn pixels(&self) -> Vec<[u8; 4]> {
        let Some(target) = &self.target else { return Vec::new() };
        let saved = self.gl.save();
        let pixels = self.gl.read(target);
        self.gl.restore(&saved);
        pixels
    }

    /// Waits until the graphics card has drawn everything: for measuring.
    pub fn finish(&self) {
        self.gl.finish();
    }

    /// Whether stand-ins for what is shown are made, where there are to be any.
    pub fn has_stand_ins(&self) -> bool {
        let Some(prepared) = &self.prepared else { return false };
        let total = prepared.drawing.triangle_count();
        prepared.drawing.placed.iter().all(|placed| placed.shown.has_stand_in(total, painter::MOVING_TRIANGLES))
    }

    /// Frees everything on the graphics card.
    pub fn destroy(self) {
        if let Some(target) = self.target {
            self.gl.delete_target(target);
        }
        self.painter.destroy(&self.gl);
    }
}
