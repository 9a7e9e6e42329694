//! `whitted diff`: how far two pictures are apart. Its JSON is documented in the manual's page on the command line, and
//! stable: a change that breaks a reader raises `schema`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use serde::Serialize;

use super::outputs::identity;
use super::stats_json::{SCHEMA, lossy};
use super::terminal;
use crate::error::{Error, Result};
use crate::formats::atomic_file::check_writable;
use crate::formats::picture::{self, PictureFormat};
use crate::measure::heatmap;
use crate::measure::picture_difference::{LayerDifference, PictureDifference, Space};

/// Flags of `diff`.
#[derive(Debug, Args)]
pub struct DiffArguments {
    /// A picture.
    #[arg(value_name = "A", value_hint = ValueHint::FilePath)]
    pub a: PathBuf,
    /// A picture of the same size, such as the reference.
    #[arg(value_name = "B", value_hint = ValueHint::FilePath)]
    pub b: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Also write where they differ, in false colours, in the format of the suffix.
    #[arg(long, value_name = "OUT", value_hint = ValueHint::FilePath)]
    pub heatmap: Option<PathBuf>,
    /// Fail if a value of the colours differs by more than this, or is not finite.
    #[arg(long, value_name = "X", value_parser = difference)]
    pub max_error: Option<f64>,
    /// Count the pixels that differ by more than this.
    #[arg(long, value_name = "T", value_parser = difference, default_value = "0")]
    pub threshold: f64,
}

/// The whole document.
#[derive(Debug, Serialize)]
struct Document<'a> {
    schema: u32,
    #[serde(serialize_with = "lossy")]
    a: &'a Path,
    #[serde(serialize_with = "lossy")]
    b: &'a Path,
    threshold: f64,
    #[serde(flatten)]
    difference: &'a PictureDifference,
    /// Null unless `--max-error` was given.
    max_error: Option<f64>,
    /// Whether the colours are within it; null unless it was given.
    within: Option<bool>,
}

/// Prints how far two pictures are apart.
///
/// # Errors
/// Pictures that cannot be read or compared, a heatmap that cannot be written, or colours that are farther apart than
/// `--max-error` says.
pub fn run(arguments: &DiffArguments) -> Result<()> {
    let DiffArguments { a, b, threshold, .. } = arguments;
    if let Some(path) = &arguments.heatmap {
        check_heatmap(path, [a, b])?;
    }
    let difference = PictureDifference::of_files(a, b, *threshold)?;
    if let Some(path) = &arguments.heatmap {
        picture::save(&heatmap::picture(&difference), path)?;
    }
    let color = &difference.color;
    let within = arguments.max_error.map(|most| color.max <= most && color.not_finite.total() == 0);
    let text = if arguments.json {
        let max_error = arguments.max_error;
        let document =
            Document { schema: SCHEMA, a, b, threshold: *threshold, difference: &difference, max_error, within };
        serde_json::to_string_pretty(&document).expect("names and numbers have a JSON form") + "\n"
    } else {
        describe(&difference, *threshold)
    };
    terminal::print(text.as_bytes())?;
    match (within, arguments.max_error) {
        (Some(false), Some(most)) => Err(Error::limit(excess(color, most)).at_path(a)),
        _ => Ok(()),
    }
}

/// Refuses a heatmap that has no format, would replace one of the pictures, or cannot be written.
fn check_heatmap(path: &Path, inputs: [&PathBuf; 2]) -> Result<()> {
    PictureFormat::of(path)?;
    let own = identity(path);
    if own.is_some() && inputs.iter().any(|input| identity(input) == own) {
        return Err(Error::caller("this picture is compared, so it is not overwritten")
            .at_path(path)
            .remedy("name another file to write"));
    }
    check_writable(path)
}

/// Says what is wrong with colours that are not within a limit.
fn excess(color: &LayerDifference, most: f64) -> String {
    let bad = color.not_finite.total();
    match &color.max_at {
        Some(at) if color.max > most => format!(
            "the pictures differ by {} at {},{} in {}, which is more than {most}",
            color.max, at.x, at.y, at.channel
        ),
        _ => format!("{bad} pixels are not finite and cannot be within {most}"),
    }
}

/// The text for a person.
fn describe(difference: &PictureDifference, threshold: f64) -> String {
    let PictureDifference { width, height, .. } = *difference;
    let mut text = String::new();
    let mut row = |label: &str, value: String| text += &format!("{label:<14} {value}\n");
    row("size", format!("{width}x{height}"));
    let space = match difference.space {
        Space::Linear => "linear values",
        Space::Encoded => "values as stored, 0 to 1",
        Space::Decoded => "linear values, one picture decoded from sRGB",
    };
    row("compared", space.into());
    let pixels = width * height;
    let parts = std::iter::once((None, &difference.color))
        .chain(difference.layers.iter().map(|layer| (Some(&layer.name), &layer.difference)));
    for (name, part) in parts {
        if let Some(name) = name {
            row("", String::new());
            row("layer", terminal::printable(name).into_owned());
        }
        match &part.max_at {
            Some(at) => {
                row("max", format!("{} at {},{} in {}: {} and {}", part.max, at.x, at.y, at.channel, at.a, at.b));
            }
            None => row("max", "0".into()),
        }
        row("RMSE", format!("{:.6e}", part.rmse));
        row("PSNR", part.psnr.map_or("infinite".into(), |psnr| format!("{psnr:.2} dB")));
        row("mean", format!("{:.6e}", part.mean));
        row("pixels", format!("{} of {pixels} differ by more than {threshold}", part.over_threshold));
        let bad = part.not_finite;
        if bad.total() > 0 {
            let counts = format!("{} in A alone, {} in B alone, {} in both", bad.only_a, bad.only_b, bad.both);
            row("not finite", format!("{counts}; left out of all else"));
        }
    }
    if !difference.unmatched_layers.is_empty() {
        row("not compared", terminal::printable(&difference.unmatched_layers.join(", ")).into_owned());
    }
    // Rows without a value end in blanks.
    text.lines().map(|line| line.trim_end().to_owned() + "\n").collect()
}

/// Reads a difference of values.
fn difference(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a number that is not negative, such as 0.01".into()),
    }
}
