//! Images made into what a material reads: opaque colours, numbers, normals from heights, two images in one.

use glam::DVec2;
use rayon::prelude::*;

use crate::scene::detail::Channel;
use crate::scene::quantize::byte;
use crate::scene::texture::{Texels, srgb_to_linear};
use crate::scene::{Texture, Transfer};

/// The steepest slope, and the largest factor of slopes: the normal then lies in the surface, as far as f32 can tell.
pub(super) const STEEPEST: f64 = 1e6;

/// Whether some texels are more opaque than others.
pub(super) fn has_varying_alpha(image: &Texture) -> bool {
    match &image.texels {
        Texels::Srgb8(texels) | Texels::Data8(texels) => texels.iter().any(|texel| texel[3] != texels[0][3]),
        Texels::Linear32(_) => false,
    }
}

/// The image without its alpha; the same memory where there is none.
pub(super) fn opaque(image: &Texture) -> Texture {
    let texels = match &image.texels {
        Texels::Srgb8(texels) if texels.iter().any(|texel| texel[3] != u8::MAX) => {
            Texels::Srgb8(texels.iter().map(|&[r, g, b, _]| [r, g, b, u8::MAX]).collect())
        }
        texels => texels.clone(),
    };
    Texture { texels, ..image.clone() }
}

/// The image's values as they are stored, in the same memory.
pub(super) fn data(image: &Texture) -> Texture {
    let texels = match &image.texels {
        Texels::Srgb8(texels) => Texels::Data8(texels.clone()),
        texels => texels.clone(),
    };
    Texture { texels, ..image.clone() }
}

/// The image with `base + gain * value` for each value but alpha: option `-mm`. Values of bytes stay from 0 to 1.
pub(super) fn adjusted(image: Texture, [base, gain]: [f64; 2]) -> Texture {
    if [base, gain] == [0.0, 1.0] {
        return image;
    }
    let bytes = |texels: &[[u8; 4]], decode: fn(f64) -> f64, transfer: Transfer| {
        let table: [u8; 256] =
            std::array::from_fn(|value| byte((base + gain * decode(value as f64 / 255.0)) as f32, transfer));
        texels.iter().map(|&[r, g, b, a]| [table[r as usize], table[g as usize], table[b as usize], a]).collect()
    };
    let texels = match &image.texels {
        Texels::Srgb8(texels) => Texels::Srgb8(bytes(texels, srgb_to_linear, Transfer::Srgb)),
        Texels::Data8(texels) => Texels::Data8(bytes(texels, |value| value, Transfer::Linear)),
        Texels::Linear32(texels) => {
            let value = |value: f32| ((base + gain * f64::from(value)) as f32).clamp(f32::MIN, f32::MAX);
            Texels::Linear32(texels.iter().map(|texel| texel.map(value)).collect())
        }
    };
    Texture { texels, ..image }
}

/// Whether an image that may be of heights or of normals is of normals: these mostly point away from the surface, so that
/// blue is high and red and green are about a half, which no grey is.
pub(super) fn shows_normals(image: &Texture) -> bool {
    let Texels::Srgb8(texels) = &image.texels else { return false };
    let mut sums = [0u64; 3];
    texels.iter().for_each(|texel| (0..3).for_each(|channel| sums[channel] += u64::from(texel[channel])));
    let [red, green, blue] = sums.map(|sum| sum as f64 / texels.len() as f64 / 255.0);
    let is_half = |mean: f64| (0.35..0.65).contains(&mean);
    is_half(red) && is_half(green) && blue > 0.7
}

/// Normals of a surface, from an image of numbers: its height over its texels, in texels, is `scale` times a value of it: normals of its slopes between
/// the neighbours on both sides. In floats, since the slope of a step of one in 255 is lost in bytes.
pub(super) fn normals_of_heights(image: &Texture, channel: Channel, scale: f64, clamp: bool) -> Texture {
    let (width, height) = (image.width as usize, image.height as usize);
    let value = |x: usize, y: usize| f64::from(channel.of(image.texels.get(y * width + x)));
    let neighbours = |at: usize, count: usize| match (at, clamp) {
        (0, true) => (0, 1.min(count - 1)),
        (at, true) => (at - 1, (at + 1).min(count - 1)),
        (at, false) => ((at + count - 1) % count, (at + 1) % count),
    };
    let normal = |x: usize, y: usize| {
        let ((left, right), (above, below)) = (neighbours(x, width), neighbours(y, height));
        let slope = |difference: f64| (0.5 * scale * difference).clamp(-STEEPEST, STEEPEST);
        let along_u = slope(value(right, y) - value(left, y));
        let along_v = slope(value(x, above) - value(x, below));
        let length = (along_u * along_u + along_v * along_v + 1.0).sqrt();
        [-along_u, -along_v, 1.0].map(|component| (0.5 + 0.5 * component / length) as f32)
    };
    let rows = (0..height).into_par_iter().flat_map_iter(|y| (0..width).map(move |x| normal(x, y)));
    Texture { texels: Texels::Linear32(rows.collect::<Vec<_>>().into()), ..image.clone() }
}

/// One image with a value of each of two images of numbers: roughness in green and metalness in blue, where glTF has them. The smaller is
/// enlarged; what is not there is 1.
pub(super) fn packed(
    roughness: Option<(&Texture, Channel)>,
    metalness: Option<(&Texture, Channel)>,
) -> Option<Texture> {
    let first = roughness.or(metalness)?.0;
    let images = [roughness, metalness];
    let size = |side: fn(&Texture) -> u32| images.iter().flatten().map(|(image, _)| side(image)).max().unwrap_or(1);
    let (width, height) = (size(|image| image.width), size(|image| image.height));
    let number = |value: f32| byte(value, Transfer::Linear);
    let value = |image: Option<(&Texture, Channel)>, x: u32, y: u32| {
        let Some((image, channel)) = image else { return u8::MAX };
        if (image.width, image.height) == (width, height) {
            return number(channel.of(image.texels.get(y as usize * width as usize + x as usize)));
        }
        let middle = |at: u32, side: u32| (f64::from(at) + 0.5) / f64::from(side);
        let place = DVec2::new(middle(x, width), 1.0 - middle(y, height));
        number(channel.of(image.sample_footprint(place, 0.0)))
    };
    let pixel = |x, y| [u8::MAX, value(images[0], x, y), value(images[1], x, y), u8::MAX];
    let rows = (0..height).into_par_iter().flat_map_iter(|y| (0..width).map(move |x| pixel(x, y)));
    let texels = Texels::Data8(rows.collect::<Vec<_>>().into());
    Some(Texture::new(first.name.clone(), width, height, texels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec4;

    fn texel(image: &Texture, x: usize, y: usize) -> Vec4 {
        image.texels.get(y * image.width as usize + x)
    }

    fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Texture {
        let texels: Vec<_> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        Texture::new("a", width, height, Texels::Srgb8(texels.into()))
    }

    #[test]
    fn alpha_is_taken_away_where_there_is_some() {
        let half = image(2, 1, |x, _| [1, 2, 3, 100 + x as u8]);
        assert!(has_varying_alpha(&half) && !has_varying_alpha(&opaque(&half)));
        assert_eq!(opaque(&half).texels, Texels::Srgb8(vec![[1, 2, 3, 255]; 2].into()));
        let whole = opaque(&half);
        assert!(opaque(&whole).texels.is_shared_with(&whole.texels));
        assert_eq!(data(&half).texels, Texels::Data8(vec![[1, 2, 3, 100], [1, 2, 3, 101]].into()));
    }

    #[test]
    fn values_are_adjusted_in_linear_light() {
        let grey = image(1, 1, |_, _| [188, 0, 255, 7]);
        // 188 is 0.5 in linear light: 0.25 + 0.5 * 0.5 is again.
        assert_eq!(adjusted(grey.clone(), [0.25, 0.5]).texels, Texels::Srgb8(vec![[188, 137, 225, 7]].into()));
        assert_eq!(adjusted(data(&grey), [1.0, -1.0]).texels, Texels::Data8(vec![[67, 255, 0, 7]].into()));
    }

    #[test]
    fn normals_and_heights_are_told_apart() {
        assert!(shows_normals(&image(4, 4, |x, y| [96 + 20 * x as u8, 96 + 20 * y as u8, 240, 255])));
        for grey in [0, 128, 200, 255] {
            assert!(!shows_normals(&image(4, 4, |_, _| [grey, grey, grey, 255])));
        }
        assert!(!shows_normals(&image(4, 4, |_, _| [20, 20, 255, 255])), "a blue picture");
    }

    #[test]
    fn normals_stand_upon_slopes() {
        // A ramp that rises by 51/255 = 0.2 to the right and by 0.1 upward.
        let ramp = image(4, 5, |x, y| {
            let height = (51.0 * f64::from(x) + 25.5 * f64::from(4 - y)) as u8;
            [height, height, height, 255]
        });
        let ramp = data(&ramp);
        let normals = normals_of_heights(&ramp, Channel::Red, 2.0, true);
        let found = texel(&normals, 1, 2).truncate() * 2.0 - 1.0;
        let expected = glam::Vec3::new(-0.4, -0.2, 1.0).normalize();
        assert!((found - expected).abs().max_element() < 0.005, "{found} {expected}");
        // A border halves the difference where the image ends, and wraps around where it repeats.
        let at_border = |clamp| (texel(&normals_of_heights(&ramp, Channel::Red, 2.0, clamp), 0, 2) * 2.0 - 1.0).x;
        assert!(at_border(true) < 0.0 && at_border(false) > 0.0);
        let flat = normals_of_heights(&data(&image(3, 3, |_, _| [9, 9, 9, 255])), Channel::Luminance, 5.0, false);
        assert_eq!(texel(&flat, 1, 1), Vec4::new(0.5, 0.5, 1.0, 1.0));
    }

    #[test]
    fn two_images_become_one() {
        let rough = data(&image(2, 1, |x, _| [10 + x as u8, 0, 0, 255]));
        let metal = data(&image(1, 1, |_, _| [0, 0, 0, 77]));
        let both = packed(Some((&rough, Channel::Red)), Some((&metal, Channel::Alpha))).unwrap();
        assert_eq!((both.width, both.height), (2, 1));
        assert_eq!(both.texels, Texels::Data8(vec![[255, 10, 77, 255], [255, 11, 77, 255]].into()));
        let one = packed(None, Some((&metal, Channel::Alpha))).unwrap();
        assert_eq!(one.texels, Texels::Data8(vec![[255, 255, 77, 255]].into()));
        assert_eq!(packed(None, None), None);
    }
}
