//! A scene's textures on the graphics card, each uploaded once.

use std::borrow::Cow;

use eframe::glow;
use glam::Vec4;

use crate::editor::viewport::gl::{Gl, Image, Pixels, Reading};
use crate::error::Result;
use crate::scene::texture::{Filter, Texels, Wrap};
use crate::scene::{Scene, Texture};

/// The images of the textures that were asked for.
#[derive(Default)]
pub struct Images {
    known: Vec<Known>,
}

struct Known {
    texels: Texels,
    size: (u32, u32),
    reading: Reading,
    image: Image,
    is_used: bool,
}

impl Images {
    /// Forgets what the scene does not have.
    pub fn retain(&mut self, gl: &Gl, scene: &Scene) {
        for known in &mut self.known {
            known.is_used = scene.textures.iter().any(|texture| texture.texels.is_shared_with(&known.texels));
            if let crate::scene::Background::Image { texture, .. } = &scene.background {
                known.is_used |= texture.texels.is_shared_with(&known.texels);
            }
        }
        self.known.iter().filter(|known| !known.is_used).for_each(|known| gl.delete_image(known.image));
        self.known.retain(|known| known.is_used);
    }

    /// The image of a texture.
    ///
    /// # Errors
    /// A limit where there is no room.
    pub fn of(&mut self, gl: &Gl, texture: &Texture) -> Result<Image> {
        let wrap = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => glow::REPEAT,
            Wrap::Mirror => glow::MIRRORED_REPEAT,
            Wrap::Clamp => glow::CLAMP_TO_EDGE,
        });
        let reading = Reading { wrap, is_smooth: texture.filter == Filter::Linear };
        let size = (texture.width, texture.height);
        let same = |known: &&Known| {
            known.texels.is_shared_with(&texture.texels) && known.reading == reading && known.size == size
        };
        if let Some(known) = self.known.iter().find(same) {
            return Ok(known.image);
        }
        let (texels, smaller) = reduced(texture, gl.longest_side);
        let pixels = match texels.as_ref() {
            Texels::Srgb8(texels) => Pixels::Srgb(texels),
            Texels::Data8(texels) => Pixels::Plain(texels),
            Texels::Linear32(texels) => Pixels::Floats(texels),
        };
        let image = gl.image(smaller, pixels, reading)?;
        self.known.push(Known { texels: texture.texels.clone(), size, reading, image, is_used: true });
        Ok(image)
    }

    /// Frees all.
    pub fn destroy(&mut self, gl: &Gl) {
        self.known.drain(..).for_each(|known| gl.delete_image(known.image));
    }
}

/// Every so manyth texel, where there are more than the graphics card takes.
fn reduced(texture: &Texture, longest: u32) -> (Cow<'_, Texels>, (u32, u32)) {
    let step = texture.width.max(texture.height).div_ceil(longest.max(1)).max(1);
    let size = (texture.width.div_ceil(step), texture.height.div_ceil(step));
    if step == 1 {
        return (Cow::Borrowed(&texture.texels), size);
    }
    let rows = (0..texture.height).step_by(step as usize);
    let chosen = rows.flat_map(|y| (0..texture.width).step_by(step as usize).map(move |x| (x, y)));
    let chosen = chosen.map(|(x, y)| y as usize * texture.width as usize + x as usize);
    let texels = match &texture.texels {
        Texels::Srgb8(texels) => Texels::Srgb8(chosen.map(|at| texels[at]).collect::<Vec<_>>().into()),
        Texels::Data8(texels) => Texels::Data8(chosen.map(|at| texels[at]).collect::<Vec<_>>().into()),
        Texels::Linear32(texels) => Texels::Linear32(chosen.map(|at| texels[at]).collect::<Vec<_>>().into()),
    };
    (Cow::Owned(texels), size)
}

/// A texture's use as the shader takes it: matrix; offset and which set of coordinates.
pub fn placing(reference: Option<&crate::scene::TextureRef>) -> (Vec4, Vec4) {
    let Some(reference) = reference else { return (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::ZERO) };
    let (x, y) = (reference.matrix.x_axis.as_vec2(), reference.matrix.y_axis.as_vec2());
    let offset = reference.offset.as_vec2();
    let second = if reference.second_uvs { 1.0 } else { 0.0 };
    (Vec4::new(x.x, x.y, y.x, y.y), Vec4::new(offset.x, offset.y, second, 0.0))
}
