//! OpenGL 3.3 and OpenGL ES 3.0 behind functions that cannot be misused: the one place of the editor with `unsafe` code.
//!
//! What makes it sound: all functions are called while the context is current, which whoever makes a [`Gl`] promises, as a
//! window does for what it lets paint; every name that is passed was made by the same context; slices carry their lengths;
//! and ranges of indices are cut to what a geometry has, whose indices are checked when it is made.
#![allow(unsafe_code)]

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use eframe::glow::{self, HasContext as _};
use glam::{Mat4, Vec3, Vec4};

use crate::error::{Error, Result};

/// A context and what it can do.
pub struct Gl {
    raw: Arc<glow::Context>,
    /// The first lines of every shader.
    header: &'static str,
    /// Whether the processor draws: then what costs time by the pixel is left out.
    pub is_software: bool,
    /// The longest side of an image.
    pub longest_side: u32,
}

/// A compiled pair of shaders.
pub struct Program {
    name: glow::Program,
    places: HashMap<String, glow::UniformLocation>,
}

/// Vertex arrays and, unless they are drawn in their order, indices.
pub struct Geometry {
    array: glow::VertexArray,
    buffers: Vec<glow::Buffer>,
    own_indices: Option<glow::Buffer>,
    vertices: u32,
    indices: u32,
}

/// One array of vertices' values.
pub struct Attribute<'a> {
    /// The values, all of one vertex together.
    pub bytes: &'a [u8],
    /// For each shader input that reads them: its number, format and where it starts.
    pub fields: &'a [(u32, Format, i32)],
    /// From one vertex to the next.
    pub stride: i32,
}

/// What a shader input is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// So many f32.
    Floats(i32),
    /// Ten bits each, signed, as fractions.
    Packed,
    /// Four u16 as fractions.
    Fractions,
}

/// An image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Image(glow::Texture);

/// Texels to be made an image.
#[derive(Debug, Clone, Copy)]
pub enum Pixels<'a> {
    /// Encoded in sRGB.
    Srgb(&'a [[u8; 4]]),
    /// As they are.
    Plain(&'a [[u8; 4]]),
    /// Linear.
    Floats(&'a [[f32; 3]]),
}

/// How an image is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reading {
    /// What is beyond its sides: `REPEAT`, `MIRRORED_REPEAT` or `CLAMP_TO_EDGE`.
    pub wrap: [u32; 2],
    /// Whether texels are mixed.
    pub is_smooth: bool,
}

/// A picture that is drawn into: colour and depth.
pub struct Target {
    framebuffer: glow::Framebuffer,
    /// What was drawn, without samples.
    pub color: Image,
    depth: glow::Renderbuffer,
    /// With several samples a pixel: what is drawn into before it is resolved.
    multisampled: Option<(glow::Framebuffer, glow::Renderbuffer)>,
    /// Width and height in pixels.
    pub size: (u32, u32),
}

/// What was bound before, to be bound again.
pub struct Saved {
    framebuffer: Option<glow::Framebuffer>,
    viewport: [i32; 4],
    has_scissor: bool,
}

/// How triangles reach the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// Whether nearer things hide them.
    pub tests_depth: bool,
    /// Whether they hide what is drawn later and farther.
    pub writes_depth: bool,
    /// Whether they are mixed with what is there, colours multiplied by alpha already.
    pub blends: bool,
    /// Which side is left out: `Some(true)` for that seen clockwise.
    pub culls: Option<bool>,
}

/// What is drawn of three vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A triangle.
    Triangles,
    /// Of two: a line.
    Lines,
}

impl Shape {
    fn mode(self) -> u32 {
        match self {
            Self::Triangles => glow::TRIANGLES,
            Self::Lines => glow::LINES,
        }
    }
}

impl Gl {
    /// The context, which is current and stays so whenever a function of this is called.
    ///
    /// # Errors
    /// What is not supported: versions below OpenGL 3.3 and OpenGL ES 3.0.
    pub fn new(raw: Arc<glow::Context>) -> Result<Self> {
        let version = raw.version();
        let (major, minor, is_embedded) = (version.major, version.minor, version.is_embedded);
        if (major, minor) < if is_embedded { (3, 0) } else { (3, 3) } {
            let kind = if is_embedded { " ES" } else { "" };
            return Err(Error::unsupported(format!("OpenGL{kind} {major}.{minor} is too old for the viewport"))
                .remedy("OpenGL 3.3 or OpenGL ES 3.0 is needed: install a newer driver, or Mesa"));
        }
        // SAFETY: see the module.
        let (renderer, longest) =
            unsafe { (raw.get_parameter_string(glow::RENDERER), raw.get_parameter_i32(glow::MAX_TEXTURE_SIZE)) };
        let is_software = ["llvmpipe", "softpipe", "swrast", "SwiftShader"].iter().any(|name| renderer.contains(name));
        let header = if is_embedded {
            "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n"
        } else {
            "#version 330 core\n"
        };
        Ok(Self { raw, header, is_software, longest_side: u32::try_from(longest).unwrap_or(1024).max(1024) })
    }

    /// The same for shaders of OpenGL ES, which newer desktop versions understand too.
    pub fn with_embedded_shaders(mut self) -> Self {
        self.header = "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n";
        self
    }

    /// Waits until everything is drawn.
    pub fn finish(&self) {
        // SAFETY: see the module.
        unsafe { self.raw.finish() }
    }

    /// Compiles shaders; inputs get the numbers of their positions in `inputs`.
    ///
    /// # Errors
    /// What the driver does not support, with its message.
    pub fn program(&self, vertex: &str, fragment: &str, inputs: &[&str]) -> Result<Program> {
        let gl = &self.raw;
        let unsupported = |what: String| Error::unsupported(format!("OpenGL refuses the viewport's shaders: {what}"));
        // SAFETY: see the module; shaders and programs were made here and are deleted once.
        unsafe {
            let name = gl.create_program().map_err(unsupported)?;
            let mut shaders = Vec::new();
            let mut flaw = None;
            for (kind, source) in [(glow::VERTEX_SHADER, vertex), (glow::FRAGMENT_SHADER, fragment)] {
                let shader = gl.create_shader(kind).map_err(unsupported)?;
                gl.shader_source(shader, &format!("{}{source}", self.header));
                gl.compile_shader(shader);
                if !gl.get_shader_compile_status(shader) {
                    flaw.get_or_insert(gl.get_shader_info_log(shader));
                }
                gl.attach_shader(name, shader);
                shaders.push(shader);
            }
            for (number, input) in inputs.iter().enumerate() {
                gl.bind_attrib_location(name, number as u32, input);
            }
            gl.link_program(name);
            if !gl.get_program_link_status(name) {
                flaw.get_or_insert(gl.get_program_info_log(name));
            }
            for shader in shaders {
                gl.detach_shader(name, shader);
                gl.delete_shader(shader);
            }
            if let Some(flaw) = flaw {
                gl.delete_program(name);
                return Err(unsupported(flaw.trim().replace('\n', " ")));
            }
            let mut places = HashMap::new();
            for number in 0..gl.get_active_uniforms(name) {
                if let Some(uniform) = gl.get_active_uniform(name, number)
                    && let Some(place) = gl.get_uniform_location(name, &uniform.name)
                {
                    places.insert(uniform.name.trim_end_matches("[0]").to_owned(), place);
                }
            }
            Ok(Program { name, places })
        }
    }

    /// Uses a program for what is drawn from now on; its uniforms are those that are set.
    pub fn use_program(&self, program: &Program) {
        // SAFETY: see the module.
        unsafe { self.raw.use_program(Some(program.name)) }
    }

    /// Sets a uniform of the program in use, which is the one given. Names that it does not use are passed over.
    pub fn set(&self, program: &Program, name: &str, value: Value<'_>) {
        let Some(place) = program.places.get(name) else { return };
        let (gl, place) = (&self.raw, Some(place));
        // SAFETY: see the module; the driver refuses values of another type with an error.
        unsafe {
            match value {
                Value::Int(value) => gl.uniform_1_i32(place, value),
                Value::Float(value) => gl.uniform_1_f32(place, value),
                Value::Vec3(value) => gl.uniform_3_f32(place, value.x, value.y, value.z),
                Value::Vec4(value) => gl.uniform_4_f32(place, value.x, value.y, value.z, value.w),
                Value::Mat4(value) => gl.uniform_matrix_4_f32_slice(place, false, &value.to_cols_array()),
                Value::Vec4s([]) | Value::Floats([]) => {}
                Value::Vec4s(values) => gl.uniform_4_f32_slice(place, bytemuck::cast_slice(values)),
                Value::Floats(values) => gl.uniform_1_f32_slice(place, values),
            }
        }
    }

    /// Vertices and indices on the graphics card.
    ///
    /// # Errors
    /// A limit where there is no room, a caller's error for an index beyond the vertices.
    pub fn geometry(&self, attributes: &[Attribute<'_>], indices: &[u32]) -> Result<Geometry> {
        let gl = &self.raw;
        let vertices = attributes.iter().map(|a| a.bytes.len() / (a.stride.max(1) as usize)).min().unwrap_or(0) as u32;
        if indices.iter().any(|&index| index >= vertices) || indices.len() > i32::MAX as usize / 4 {
            return Err(Error::caller("an index of the viewport's geometry is out of range"));
        }
        let limit = |what: String| Error::limit(format!("OpenGL has no room for the viewport's geometry: {what}"));
        // SAFETY: see the module; fields lie within the stride, and arrays hold `vertices` strides.
        unsafe {
            let array = gl.create_vertex_array().map_err(limit)?;
            gl.bind_vertex_array(Some(array));
            let mut buffers = Vec::new();
            for attribute in attributes {
                let buffer = gl.create_buffer().map_err(limit)?;
                buffers.push(buffer);
                gl.bind_buffer(glow::ARRAY_BUFFER, Some(buffer));
                gl.buffer_data_u8_slice(glow::ARRAY_BUFFER, attribute.bytes, glow::STATIC_DRAW);
                for &(number, format, start) in attribute.fields {
                    let (count, kind, is_fraction) = match format {
                        Format::Floats(count) => (count, glow::FLOAT, false),
                        Format::Packed => (4, glow::INT_2_10_10_10_REV, true),
                        Format::Fractions => (4, glow::UNSIGNED_SHORT, true),
                    };
                    gl.enable_vertex_attrib_array(number);
                    gl.vertex_attrib_pointer_f32(number, count, kind, is_fraction, attribute.stride, start);
                }
            }
            let mut own_indices = None;
            if !indices.is_empty() {
                let buffer = gl.create_buffer().map_err(limit)?;
                own_indices = Some(buffer);
                buffers.push(buffer);
                gl.bind_buffer(glow::ELEMENT_ARRAY_BUFFER, Some(buffer));
                gl.buffer_data_u8_slice(glow::ELEMENT_ARRAY_BUFFER, bytemuck::cast_slice(indices), glow::STATIC_DRAW);
            }
            gl.bind_vertex_array(None);
            let geometry = Geometry { array, buffers, own_indices, vertices, indices: indices.len() as u32 };
            if gl.get_error() == glow::OUT_OF_MEMORY {
                self.delete_geometry(geometry);
                return Err(limit("its memory is full".into()));
            }
            Ok(geometry)
        }
    }

    /// What shader inputs read that a geometry has no values for.
    pub fn set_default(&self, input: u32, value: Vec4) {
        // SAFETY: see the module.
        unsafe { self.raw.vertex_attrib_4_f32(input, value.x, value.y, value.z, value.w) }
    }

    /// Draws parts of a geometry's indices.
    pub fn draw(&self, geometry: &Geometry, shape: Shape, parts: &[Range<u32>]) {
        let gl = &self.raw;
        // SAFETY: see the module; ranges are cut to the indices that there are.
        unsafe {
            gl.bind_vertex_array(Some(geometry.array));
            for part in parts {
                let (start, end) = (part.start.min(geometry.indices), part.end.min(geometry.indices));
                if start < end {
                    gl.draw_elements(shape.mode(), (end - start) as i32, glow::UNSIGNED_INT, start as i32 * 4);
                }
            }
            gl.bind_vertex_array(None);
        }
    }

    /// Draws triangles of a geometry by indices that are passed along; none if one of them is beyond its vertices.
    pub fn draw_listed(&self, geometry: &Geometry, indices: &[u32]) {
        let gl = &self.raw;
        let is_within = indices.iter().fold(true, |within, &index| within & (index < geometry.vertices));
        if indices.is_empty() || !is_within || indices.len() > i32::MAX as usize / 4 {
            return;
        }
        // SAFETY: see the module; the indices were just checked. The array's own indices are bound again.
        unsafe {
            let Ok(buffer) = gl.create_buffer() else { return };
            gl.bind_vertex_array(Some(geometry.array));
            gl.bind_buffer(glow::ELEMENT_ARRAY_BUFFER, Some(buffer));
            gl.buffer_data_u8_slice(glow::ELEMENT_ARRAY_BUFFER, bytemuck::cast_slice(indices), glow::STREAM_DRAW);
            gl.draw_elements(glow::TRIANGLES, indices.len() as i32, glow::UNSIGNED_INT, 0);
            gl.bind_buffer(glow::ELEMENT_ARRAY_BUFFER, geometry.own_indices);
            gl.bind_vertex_array(None);
            gl.delete_buffer(buffer);
        }
    }

    /// Draws so many vertices of a geometry without indices.
    pub fn draw_all(&self, geometry: &Geometry, vertices: u32) {
        // SAFETY: see the module.
        unsafe {
            self.raw.bind_vertex_array(Some(geometry.array));
            let count = if geometry.buffers.is_empty() { vertices } else { vertices.min(geometry.vertices) };
            self.raw.draw_arrays(glow::TRIANGLES, 0, count as i32);
            self.raw.bind_vertex_array(None);
        }
    }

    /// An image; with smaller versions where it is smooth.
    ///
    /// # Errors
    /// A limit where there is no room; a caller's error for texels of another number.
    pub fn image(&self, size: (u32, u32), pixels: Pixels<'_>, reading: Reading) -> Result<Image> {
        let gl = &self.raw;
        let limit = |what: String| Error::limit(format!("OpenGL has no room for an image: {what}"));
        let (bytes, format, inner, kind): (&[u8], _, _, _) = match pixels {
            Pixels::Srgb(texels) => (bytemuck::cast_slice(texels), glow::RGBA, glow::SRGB8_ALPHA8, glow::UNSIGNED_BYTE),
            Pixels::Plain(texels) => (bytemuck::cast_slice(texels), glow::RGBA, glow::RGBA8, glow::UNSIGNED_BYTE),
            Pixels::Floats(texels) => (bytemuck::cast_slice(texels), glow::RGB, glow::RGB16F, glow::FLOAT),
        };
        let texel = if kind == glow::FLOAT { 12 } else { 4 };
        if bytes.len() as u64 != u64::from(size.0) * u64::from(size.1) * texel {
            return Err(Error::caller("an image has another number of texels than its size says"));
        }
        // SAFETY: see the module; the slice is as long as size and format say, as was just checked.
        unsafe {
            let name = gl.create_texture().map_err(limit)?;
            gl.bind_texture(glow::TEXTURE_2D, Some(name));
            gl.pixel_store_i32(glow::UNPACK_ALIGNMENT, 4);
            let (width, height) = (size.0 as i32, size.1 as i32);
            let data = glow::PixelUnpackData::Slice(Some(bytes));
            gl.tex_image_2d(glow::TEXTURE_2D, 0, inner as i32, width, height, 0, format, kind, data);
            let (small, large) = if reading.is_smooth {
                // Floats in three parts cannot be made smaller by every ES.
                if kind == glow::FLOAT {
                    (glow::LINEAR, glow::LINEAR)
                } else {
                    (glow::LINEAR_MIPMAP_LINEAR, glow::LINEAR)
                }
            } else {
                (glow::NEAREST, glow::NEAREST)
            };
            if small == glow::LINEAR_MIPMAP_LINEAR {
                gl.generate_mipmap(glow::TEXTURE_2D);
            }
            for (parameter, value) in [
                (glow::TEXTURE_MIN_FILTER, small),
                (glow::TEXTURE_MAG_FILTER, large),
                (glow::TEXTURE_WRAP_S, reading.wrap[0]),
                (glow::TEXTURE_WRAP_T, reading.wrap[1]),
            ] {
                gl.tex_parameter_i32(glow::TEXTURE_2D, parameter, value as i32);
            }
            gl.bind_texture(glow::TEXTURE_2D, None);
            if gl.get_error() == glow::OUT_OF_MEMORY {
                gl.delete_texture(name);
                return Err(limit("its memory is full".into()));
            }
            Ok(Image(name))
        }
    }

    /// Lets samplers of this number read an image.
    pub fn bind_image(&self, unit: u32, image: Option<Image>) {
        // SAFETY: see the module.
        unsafe {
            self.raw.active_texture(glow::TEXTURE0 + unit);
            self.raw.bind_texture(glow::TEXTURE_2D, image.map(|image| image.0));
            self.raw.active_texture(glow::TEXTURE0);
        }
    }

    /// A picture to draw into, with so many samples a pixel.
    ///
    /// # Errors
    /// A limit where there is no room, or what the driver does not support.
    pub fn target(&self, size: (u32, u32), samples: u32) -> Result<Target> {
        let gl = &self.raw;
        let limit = |what: String| Error::limit(format!("OpenGL has no room for the viewport's picture: {what}"));
        let (width, height) = (size.0 as i32, size.1 as i32);
        let reading = Reading { wrap: [glow::CLAMP_TO_EDGE; 2], is_smooth: false };
        let blank = vec![[0; 4]; size.0 as usize * size.1 as usize];
        let color = self.image(size, Pixels::Plain(&blank), reading)?;
        // SAFETY: see the module.
        unsafe {
            let framebuffer = gl.create_framebuffer().map_err(limit)?;
            let depth = gl.create_renderbuffer().map_err(limit)?;
            let (point, kind) = (glow::COLOR_ATTACHMENT0, glow::TEXTURE_2D);
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(framebuffer));
            gl.framebuffer_texture_2d(glow::FRAMEBUFFER, point, kind, Some(color.0), 0);
            let mut target = Target { framebuffer, color, depth, multisampled: None, size };
            gl.bind_renderbuffer(glow::RENDERBUFFER, Some(depth));
            if samples > 1 {
                let (samples, color) = (samples as i32, gl.create_renderbuffer().map_err(limit)?);
                let many = gl.create_framebuffer().map_err(limit)?;
                target.multisampled = Some((many, color));
                gl.bind_framebuffer(glow::FRAMEBUFFER, Some(many));
                let (format, buffer) = (glow::DEPTH_COMPONENT24, glow::RENDERBUFFER);
                gl.renderbuffer_storage_multisample(buffer, samples, format, width, height);
                gl.bind_renderbuffer(buffer, Some(color));
                gl.renderbuffer_storage_multisample(buffer, samples, glow::RGBA8, width, height);
                gl.framebuffer_renderbuffer(glow::FRAMEBUFFER, point, buffer, Some(color));
            } else {
                gl.renderbuffer_storage(glow::RENDERBUFFER, glow::DEPTH_COMPONENT24, width, height);
            }
            let buffer = glow::RENDERBUFFER;
            gl.framebuffer_renderbuffer(glow::FRAMEBUFFER, glow::DEPTH_ATTACHMENT, buffer, Some(depth));
            gl.bind_renderbuffer(buffer, None);
            let status = gl.check_framebuffer_status(glow::FRAMEBUFFER);
            if status != glow::FRAMEBUFFER_COMPLETE || gl.get_error() == glow::OUT_OF_MEMORY {
                self.delete_target(target);
                return Err(limit(format!("{width} x {height} pixels, status {status:#x}")));
            }
            Ok(target)
        }
    }

    /// Remembers what is bound.
    pub fn save(&self) -> Saved {
        let gl = &self.raw;
        let mut viewport = [0; 4];
        // SAFETY: see the module; a viewport is four numbers.
        unsafe {
            gl.get_parameter_i32_slice(glow::VIEWPORT, &mut viewport);
            Saved {
                framebuffer: gl.get_parameter_framebuffer(glow::DRAW_FRAMEBUFFER_BINDING),
                viewport,
                has_scissor: gl.is_enabled(glow::SCISSOR_TEST),
            }
        }
    }

    /// Binds again what was bound, and leaves the rest as windows of egui expect it.
    pub fn restore(&self, saved: &Saved) {
        let gl = &self.raw;
        let [x, y, width, height] = saved.viewport;
        // SAFETY: see the module.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, saved.framebuffer);
            gl.viewport(x, y, width, height);
            if saved.has_scissor {
                gl.enable(glow::SCISSOR_TEST);
            }
            gl.disable(glow::DEPTH_TEST);
            gl.disable(glow::CULL_FACE);
            gl.enable(glow::BLEND);
            gl.depth_mask(true);
            gl.bind_vertex_array(None);
            gl.use_program(None);
            gl.bind_buffer(glow::ARRAY_BUFFER, None);
        }
    }

    /// Draws into a target from now on, and empties it.
    pub fn begin(&self, target: &Target) {
        let gl = &self.raw;
        let framebuffer = target.multisampled.map_or(target.framebuffer, |many| many.0);
        // SAFETY: see the module.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(framebuffer));
            gl.viewport(0, 0, target.size.0 as i32, target.size.1 as i32);
            gl.disable(glow::SCISSOR_TEST);
            gl.depth_mask(true);
            gl.color_mask(true, true, true, true);
            gl.clear_color(0.0, 0.0, 0.0, 1.0);
            gl.clear(glow::COLOR_BUFFER_BIT | glow::DEPTH_BUFFER_BIT);
        }
    }

    /// Makes one sample of many, where a target has many.
    pub fn end(&self, target: &Target) {
        let (gl, (width, height)) = (&self.raw, (target.size.0 as i32, target.size.1 as i32));
        let Some((many, _)) = target.multisampled else { return };
        // SAFETY: see the module.
        unsafe {
            gl.bind_framebuffer(glow::READ_FRAMEBUFFER, Some(many));
            gl.bind_framebuffer(glow::DRAW_FRAMEBUFFER, Some(target.framebuffer));
            let (bits, filter) = (glow::COLOR_BUFFER_BIT, glow::NEAREST);
            gl.blit_framebuffer(0, 0, width, height, 0, 0, width, height, bits, filter);
        }
    }

    /// The pixels of a target, rows from the top.
    pub fn read(&self, target: &Target) -> Vec<[u8; 4]> {
        let (gl, (width, height)) = (&self.raw, target.size);
        let mut bytes = vec![[0u8; 4]; width as usize * height as usize];
        // SAFETY: see the module; the slice has four bytes for each pixel.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(target.framebuffer));
            gl.pixel_store_i32(glow::PACK_ALIGNMENT, 4);
            let into = glow::PixelPackData::Slice(Some(bytemuck::cast_slice_mut(&mut bytes)));
            gl.read_pixels(0, 0, width as i32, height as i32, glow::RGBA, glow::UNSIGNED_BYTE, into);
        }
        bytes.chunks(width.max(1) as usize).rev().flatten().copied().collect()
    }

    /// Which part of the bound framebuffer is drawn into: left, bottom, width and height in pixels.
    pub fn set_viewport(&self, [x, y, width, height]: [i32; 4]) {
        // SAFETY: see the module.
        unsafe { self.raw.viewport(x, y, width, height) }
    }

    /// How triangles reach the picture from now on.
    pub fn set_mode(&self, mode: Mode) {
        let gl = &self.raw;
        let switch = |what: u32, on: bool| {
            // SAFETY: see the module.
            unsafe { if on { gl.enable(what) } else { gl.disable(what) } }
        };
        switch(glow::DEPTH_TEST, mode.tests_depth);
        switch(glow::BLEND, mode.blends);
        switch(glow::CULL_FACE, mode.culls.is_some());
        // SAFETY: see the module.
        unsafe {
            gl.depth_func(glow::LEQUAL);
            gl.depth_mask(mode.writes_depth);
            gl.blend_equation(glow::FUNC_ADD);
            gl.blend_func(glow::ONE, glow::ONE_MINUS_SRC_ALPHA);
            gl.cull_face(glow::BACK);
            gl.front_face(if mode.culls == Some(false) { glow::CW } else { glow::CCW });
        }
    }

    /// Frees a geometry.
    pub fn delete_geometry(&self, geometry: Geometry) {
        // SAFETY: see the module; it is given away, so that it is deleted once.
        unsafe {
            geometry.buffers.into_iter().for_each(|buffer| self.raw.delete_buffer(buffer));
            self.raw.delete_vertex_array(geometry.array);
        }
    }

    /// Frees an image, which nobody reads any more.
    pub fn delete_image(&self, image: Image) {
        // SAFETY: see the module; names of deleted images are refused by the driver.
        unsafe { self.raw.delete_texture(image.0) }
    }

    /// Frees a target.
    pub fn delete_target(&self, target: Target) {
        // SAFETY: see the module; it is given away, so that it is deleted once.
        unsafe {
            if let Some((framebuffer, color)) = target.multisampled {
                self.raw.delete_framebuffer(framebuffer);
                self.raw.delete_renderbuffer(color);
            }
            self.raw.delete_framebuffer(target.framebuffer);
            self.raw.delete_renderbuffer(target.depth);
            self.raw.delete_texture(target.color.0);
        }
    }

    /// Frees a program.
    pub fn delete_program(&self, program: Program) {
        // SAFETY: see the module; it is given away, so that it is deleted once.
        unsafe { self.raw.delete_program(program.name) }
    }
}

/// A uniform's value.
#[derive(Debug, Clone, Copy)]
pub enum Value<'a> {
    /// A whole number, a truth value or the number of a sampler.
    Int(i32),
    /// A number.
    Float(f32),
    /// Three numbers.
    Vec3(Vec3),
    /// Four numbers.
    Vec4(Vec4),
    /// A matrix.
    Mat4(Mat4),
    /// An array.
    Vec4s(&'a [Vec4]),
    /// An array.
    Floats(&'a [f32]),
}
