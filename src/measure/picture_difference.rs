//! How far two pictures are apart.
//!
//! FLIP (Andersson et al. 2020) is not among the numbers: the only crate that has it is bound to a library in C++. Its
//! place would be beside the root mean square: a mean over pixels of what the eye makes of them.

use std::path::Path;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::formats::picture::stored::{Layer, Samples, StoredPicture};

/// What two pictures are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// Both hold linear floats: these are compared.
    Linear,
    /// Both hold whole numbers: these are compared as they are stored, encoded and not weighted by alpha, 0 to 1.
    Encoded,
    /// One holds linear floats: the other is decoded by the sRGB curve and weighted by its alpha first.
    Decoded,
}

/// What compares with what.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PictureDifference {
    /// Width of both, pixels.
    pub width: usize,
    /// Height of both, pixels.
    pub height: usize,
    /// What is compared.
    pub space: Space,
    /// The colours, alpha included if one of them has it; without alpha a picture is opaque.
    pub color: LayerDifference,
    /// The layers that both have, by name.
    pub layers: Vec<NamedDifference>,
    /// Layers that only one has, or that have other channels in the other: not compared.
    pub unmatched_layers: Vec<String>,
    /// Per pixel, rows from the top: the largest difference of the colours; NaN where one is not finite.
    #[serde(skip)]
    pub map: Vec<f32>,
}

/// The difference of a layer.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct NamedDifference {
    /// The layer's name in the file.
    pub name: String,
    /// How far it is apart.
    #[serde(flatten)]
    pub difference: LayerDifference,
}

/// How far the values of some channels are apart, over the pixels at which all of them are finite in both pictures.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LayerDifference {
    /// The largest difference of a value; 0 where nothing is finite.
    pub max: f64,
    /// Where it is, first in the order of rows; `None` if nothing differs.
    pub max_at: Option<Place>,
    /// The root of the mean of the squared differences of all values.
    pub rmse: f64,
    /// `20 log10 (1 / rmse)`, decibels, for a peak of 1; `None` if nothing differs.
    pub psnr: Option<f64>,
    /// The mean of the differences of all values.
    pub mean: f64,
    /// Pixels with a difference over the threshold.
    pub over_threshold: u64,
    /// Pixels with a value that is NaN or infinite: they have no part in the numbers above, equal or not.
    pub not_finite: NotFinite,
}

/// Numbers of pixels with a value that is NaN or infinite.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct NotFinite {
    /// In the first picture alone.
    pub only_a: u64,
    /// In the second picture alone.
    pub only_b: u64,
    /// In both.
    pub both: u64,
}

impl NotFinite {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.only_a + self.only_b + self.both
    }
}

/// A value of a picture.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Place {
    /// Column from the left.
    pub x: usize,
    /// Row from the top.
    pub y: usize,
    /// The channel's name.
    pub channel: String,
    /// The first picture's value.
    pub a: f64,
    /// The second picture's value.
    pub b: f64,
}

impl PictureDifference {
    /// Reads two files and compares them; pixels that differ by more than `threshold` are counted.
    ///
    /// # Errors
    /// A file that is no picture; pictures of different sizes.
    pub fn of_files(a: &Path, b: &Path, threshold: f64) -> Result<Self> {
        let (first, second) = (StoredPicture::read(a)?, StoredPicture::read(b)?);
        Self::of(first, second, threshold).map_err(|error| error.at_path(b))
    }

    /// Compares two pictures; pixels that differ by more than `threshold` are counted.
    ///
    /// # Errors
    /// Pictures of different sizes.
    pub fn of(a: StoredPicture, b: StoredPicture, threshold: f64) -> Result<Self> {
        if (a.width, a.height) != (b.width, b.height) {
            let message =
                format!("the picture has {}x{} pixels, the other {}x{}", b.width, b.height, a.width, a.height);
            return Err(Error::caller(message).remedy("render both with the same --size and --crop"));
        }
        let (space, a, b) = match (a.is_linear, b.is_linear) {
            (true, true) => (Space::Linear, a, b),
            (false, false) => (Space::Encoded, a, b),
            _ => (Space::Decoded, a.into_linear(), b.into_linear()),
        };
        let (width, height) = (a.width, a.height);
        let (color, map) = compare(&color_pairs(&a.color, &b.color), width, width * height, threshold);
        let (mut layers, mut unmatched_layers) = (Vec::new(), Vec::new());
        for layer in &a.layers {
            match b.layers.iter().find(|other| other.name == layer.name).and_then(|other| pairs(layer, other)) {
                Some(pairs) => {
                    let (difference, _) = compare(&pairs, width, width * height, threshold);
                    layers.push(NamedDifference { name: layer.name.clone(), difference });
                }
                None => unmatched_layers.push(layer.name.clone()),
            }
        }
        let is_new = |layer: &&Layer| a.layers.iter().all(|other| other.name != layer.name);
        unmatched_layers.extend(b.layers.iter().filter(is_new).map(|layer| layer.name.clone()));
        Ok(Self { width, height, space, color, layers, unmatched_layers, map })
    }
}

/// Two channels to compare; a channel that a picture lacks is 1 everywhere.
struct Pair<'a> {
    name: &'a str,
    a: Option<&'a Samples>,
    b: Option<&'a Samples>,
}

impl Pair<'_> {
    fn values(&self, pixel: usize) -> (f64, f64) {
        let value = |samples: Option<&Samples>| samples.map_or(1.0, |samples| samples.value(pixel));
        (value(self.a), value(self.b))
    }
}

/// Red, green, blue, and alpha if either has it.
fn color_pairs<'a>(a: &'a Layer, b: &'a Layer) -> Vec<Pair<'a>> {
    let named = if a.channels.len() >= b.channels.len() { a } else { b };
    let samples = |layer: &'a Layer, i: usize| layer.channels.get(i).map(|channel| &channel.samples);
    let pair = |i: usize| Pair { name: &named.channels[i].name, a: samples(a, i), b: samples(b, i) };
    (0..named.channels.len()).map(pair).collect()
}

/// The channels of two layers side by side; `None` if their names differ.
fn pairs<'a>(a: &'a Layer, b: &'a Layer) -> Option<Vec<Pair<'a>>> {
    if a.channels.len() != b.channels.len() {
        return None;
    }
    let partner = |name: &str| b.channels.iter().find(|channel| channel.name == name);
    let pair = |channel: &'a crate::formats::picture::stored::Channel| {
        let other = partner(&channel.name)?;
        Some(Pair { name: &channel.name, a: Some(&channel.samples), b: Some(&other.samples) })
    };
    a.channels.iter().map(pair).collect()
}

/// What a run of pixels adds up to.
#[derive(Default)]
struct Sums {
    max: f64,
    max_at: Option<(usize, usize)>,
    squares: f64,
    total: f64,
    values: u64,
    over: u64,
    not_finite: NotFinite,
    map: Vec<f32>,
}

/// Pixels that are summed in one go. Sums of runs are added in order, so that threads do not change a bit.
const RUN: usize = 1 << 14;

fn compare(pairs: &[Pair<'_>], width: usize, pixels: usize, threshold: f64) -> (LayerDifference, Vec<f32>) {
    let run = |start: usize| {
        let mut sums = Sums::default();
        for pixel in start..(start + RUN).min(pixels) {
            sums.add(pairs, pixel, threshold);
        }
        sums
    };
    let runs: Vec<Sums> = (0..pixels).step_by(RUN).collect::<Vec<_>>().into_par_iter().map(run).collect();
    let mut all = Sums::default();
    for sums in runs {
        if sums.max > all.max {
            (all.max, all.max_at) = (sums.max, sums.max_at);
        }
        all.squares += sums.squares;
        all.total += sums.total;
        all.values += sums.values;
        all.over += sums.over;
        all.not_finite.only_a += sums.not_finite.only_a;
        all.not_finite.only_b += sums.not_finite.only_b;
        all.not_finite.both += sums.not_finite.both;
        all.map.extend(sums.map);
    }
    let count = (all.values as f64).max(1.0);
    let rmse = (all.squares / count).sqrt();
    let place = |(pixel, channel): (usize, usize)| {
        let (a, b) = pairs[channel].values(pixel);
        Place { x: pixel % width, y: pixel / width, channel: pairs[channel].name.to_owned(), a, b }
    };
    let difference = LayerDifference {
        max: all.max,
        max_at: all.max_at.map(place),
        rmse,
        // Differences so small that their squares vanish are told by `max`.
        psnr: (rmse > 0.0).then(|| -20.0 * libm::log10(rmse)),
        mean: all.total / count,
        over_threshold: all.over,
        not_finite: all.not_finite,
    };
    (difference, all.map)
}

impl Sums {
    fn add(&mut self, pairs: &[Pair<'_>], pixel: usize, threshold: f64) {
        let finite = |pick: fn((f64, f64)) -> f64| pairs.iter().all(|pair| pick(pair.values(pixel)).is_finite());
        match (finite(|(a, _)| a), finite(|(_, b)| b)) {
            (true, true) => {}
            (a_finite, b_finite) => {
                let count = match (a_finite, b_finite) {
                    (false, true) => &mut self.not_finite.only_a,
                    (true, _) => &mut self.not_finite.only_b,
                    (false, false) => &mut self.not_finite.both,
                };
                *count += 1;
                self.map.push(f32::NAN);
                return;
            }
        }
        let mut largest = 0.0f64;
        for (channel, pair) in pairs.iter().enumerate() {
            let (a, b) = pair.values(pixel);
            let difference = (a - b).abs();
            self.squares += difference * difference;
            self.total += difference;
            largest = largest.max(difference);
            if difference > self.max {
                (self.max, self.max_at) = (difference, Some((pixel, channel)));
            }
        }
        self.values += pairs.len() as u64;
        self.over += u64::from(largest > threshold);
        self.map.push(largest as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::picture::stored::Channel;

    /// A picture whose channels have these values.
    fn picture(width: usize, names: &[&str], channels: &[&[f32]]) -> StoredPicture {
        let channel = |(name, values): (&&str, &&[f32])| Channel {
            name: name.to_string(),
            samples: Samples::Floats(values.to_vec()),
        };
        let channels: Vec<_> = names.iter().zip(channels).map(channel).collect();
        let height = channels[0].samples.clone();
        let Samples::Floats(values) = height else { unreachable!() };
        StoredPicture {
            width,
            height: values.len() / width,
            is_linear: true,
            color: Layer { name: String::new(), channels },
            layers: Vec::new(),
        }
    }

    const RGB: &[&str] = &["R", "G", "B"];

    #[test]
    fn one_changed_value_has_the_closed_forms() {
        let grey: &[f32] = &[0.5; 6];
        let a = picture(3, RGB, &[grey, grey, grey]);
        let b = picture(3, RGB, &[grey, &[0.5, 0.5, 0.5, 0.5, 0.25, 0.5], grey]);
        let PictureDifference { color, map, space, .. } = PictureDifference::of(a, b, 0.2).unwrap();
        assert_eq!(space, Space::Linear);
        assert_eq!(color.max, 0.25);
        assert_eq!(color.max_at, Some(Place { x: 1, y: 1, channel: "G".into(), a: 0.5, b: 0.25 }));
        // One of 18 values differs by 1/4: rmse = sqrt (1/16 / 18), mean = 1/4 / 18.
        assert!((color.rmse - (1.0f64 / 288.0).sqrt()).abs() < 1e-15);
        assert!((color.psnr.unwrap() - 10.0 * 288f64.log10()).abs() < 1e-12);
        assert!((color.mean - 1.0 / 72.0).abs() < 1e-15);
        assert_eq!(color.over_threshold, 1);
        assert_eq!(map, [0.0, 0.0, 0.0, 0.0, 0.25, 0.0]);
    }

    #[test]
    fn a_constant_offset_is_max_mean_and_rmse_at_once() {
        // More pixels than one run has.
        let (zeros, offset) = (vec![0.0f32; 40_000], vec![0.125f32; 40_000]);
        let a = picture(200, RGB, &[&zeros, &zeros, &zeros]);
        let b = picture(200, RGB, &[&offset, &offset, &offset]);
        let color = PictureDifference::of(a.clone(), b.clone(), 0.125).unwrap().color;
        assert_eq!((color.max, color.mean, color.rmse, color.over_threshold), (0.125, 0.125, 0.125, 0));
        assert_eq!(color.max_at.as_ref().map(|place| (place.x, place.y)), Some((0, 0)));
        assert_eq!(PictureDifference::of(a, b, 0.1249).unwrap().color.over_threshold, 40_000);
    }

    #[test]
    fn equal_pictures_differ_by_nothing() {
        let a = picture(2, RGB, &[&[0.1, 0.2], &[3.0, -4.0], &[0.0, -0.0]]);
        let color = PictureDifference::of(a.clone(), a, 0.0).unwrap().color;
        assert_eq!((color.max, color.rmse, color.mean, color.over_threshold), (0.0, 0.0, 0.0, 0));
        assert_eq!((color.max_at, color.psnr, color.not_finite.total()), (None, None, 0));
    }

    #[test]
    fn what_is_not_finite_is_counted_apart_even_if_equal() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let a = picture(4, RGB, &[&[nan, 0.0, inf, 0.0], &[0.0; 4], &[0.0; 4]]);
        let b = picture(4, RGB, &[&[nan, inf, 0.0, 0.5], &[0.0; 4], &[0.0; 4]]);
        let difference = PictureDifference::of(a, b, 0.0).unwrap();
        assert_eq!(difference.color.not_finite, NotFinite { only_a: 1, only_b: 1, both: 1 });
        assert_eq!((difference.color.max, difference.color.over_threshold), (0.5, 1));
        assert_eq!(difference.map.iter().filter(|value| value.is_nan()).count(), 3);
    }

    #[test]
    fn missing_alpha_is_opaque() {
        let a = picture(2, RGB, &[&[0.5; 2][..]; 3]);
        let opaque = picture(2, &["R", "G", "B", "A"], &[&[0.5; 2], &[0.5; 2], &[0.5; 2], &[1.0, 1.0]]);
        let glassy = picture(2, &["R", "G", "B", "A"], &[&[0.5; 2], &[0.5; 2], &[0.5; 2], &[1.0, 0.25]]);
        assert_eq!(PictureDifference::of(a.clone(), opaque.clone(), 0.0).unwrap().color.max, 0.0);
        let place = PictureDifference::of(glassy, a, 0.0).unwrap().color.max_at.unwrap();
        assert_eq!(place, Place { x: 1, y: 0, channel: "A".into(), a: 0.25, b: 1.0 });
        assert!(PictureDifference::of(opaque, picture(1, RGB, &[&[0.0; 2][..]; 3]), 0.0).is_err(), "other sizes");
    }

    #[test]
    fn layers_are_matched_by_name() {
        let with = |layers: &[(&str, f32)]| {
            let layer = |&(name, value): &(&str, f32)| Layer {
                name: name.into(),
                channels: vec![Channel { name: "Z".into(), samples: Samples::Floats(vec![value]) }],
            };
            StoredPicture { layers: layers.iter().map(layer).collect(), ..picture(1, RGB, &[&[0.0][..]; 3]) }
        };
        let found =
            PictureDifference::of(with(&[("depth", 1.0), ("a", 0.0)]), with(&[("b", 0.0), ("depth", 3.0)]), 0.0);
        let found = found.unwrap();
        assert_eq!((found.layers.len(), found.layers[0].difference.max), (1, 2.0));
        assert_eq!(found.unmatched_layers, ["a", "b"]);
    }
}
