//! The image plane: the time of a picture against its error, numeric and sampling errors apart.

use super::subject::Subject;
use crate::accel::Params;
use crate::error::{Error, Result};
use crate::measure::reference::ReferenceRenderer;
use crate::measure::speed::interleaved;
use crate::measure::statistics::Median;
use crate::progress::{Progress, Silent};
use crate::render::{Film, RenderSettings, Renderer};
use crate::scene::Scene;

/// Width of the pictures; their height follows from the scene's film.
const WIDTH: u32 = 64;

/// The samples a pixel of the sweep.
pub const SAMPLES: [u32; 5] = [1, 4, 16, 64, 256];

/// The samples a pixel of what sampling errors are measured against.
pub const CONVERGED_SAMPLES: u32 = 1024;

/// The largest number of samples of pictures that are rendered in f64, which takes a hundred times as long.
const REFERENCE_SAMPLES: u32 = 16;

/// From this difference of a linear colour on a pixel is counted as wrong: a step of 8 bits.
pub const VISIBLE: f64 = 1.0 / 255.0;

/// Which error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// Against the same samples in f64 with exact hits.
    Numeric,
    /// Against many more samples in the same precision.
    Sampling,
}

/// One picture.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ImageRow {
    /// Which error.
    pub error: ErrorKind,
    /// Samples a pixel.
    pub samples: u32,
    /// Seconds to render it on all threads; null if not timed.
    pub seconds: Option<Median>,
    /// Seconds of the picture it is compared with, rendered once.
    pub reference_seconds: f64,
    /// Pixels.
    pub pixels: usize,
    /// Root of the mean squared difference of linear colours, all channels.
    pub rmse: f64,
    /// The largest difference.
    pub max: f64,
    /// Pixels with a difference of a step of 8 bits or more.
    pub wrong_pixels: usize,
}

/// Renders a subject's original scene, small, with more and more samples.
///
/// # Errors
/// A degenerate camera, or a cancellation.
pub fn measure(subject: &Subject, repetitions: u32, progress: &dyn Progress) -> Result<Vec<ImageRow>> {
    let (width, height) = size(&subject.original);
    let settings = RenderSettings { threads: rayon::current_num_threads(), ..RenderSettings::default() };
    let with_samples = |samples: u32| {
        let mut scene = subject.original.clone();
        (scene.film.width, scene.film.height, scene.film.samples) = (width, height, samples);
        scene
    };
    let renderers = SAMPLES
        .iter()
        .map(|&samples| Renderer::build(with_samples(samples), &Params::default(), &Silent))
        .collect::<Result<Vec<_>>>()?;
    let films =
        renderers.iter().map(|renderer| finished(renderer.render(&settings, progress)?)).collect::<Result<Vec<_>>>()?;
    let times = time(&renderers, &settings, repetitions, progress)?;

    let mut rows = Vec::new();
    let sweep = || SAMPLES.iter().zip(&films).zip(&times);
    for ((&samples, film), &seconds) in sweep().filter(|((samples, _), _)| **samples <= REFERENCE_SAMPLES) {
        let reference = ReferenceRenderer::build(with_samples(samples), progress)?;
        let exact = finished(reference.render(&settings, progress)?)?;
        rows.push(row(ErrorKind::Numeric, samples, seconds, film, &exact));
    }
    let converged = Renderer::build(with_samples(CONVERGED_SAMPLES), &Params::default(), &Silent)?;
    let converged = finished(converged.render(&settings, progress)?)?;
    rows.extend(
        sweep().map(|((&samples, film), &seconds)| row(ErrorKind::Sampling, samples, seconds, film, &converged)),
    );
    Ok(rows)
}

/// The pictures' size: the proportions of the scene's film.
fn size(scene: &Scene) -> (u32, u32) {
    let height = f64::from(WIDTH) * f64::from(scene.film.height) / f64::from(scene.film.width);
    (WIDTH, (libm::round(height) as u32).clamp(1, 4 * WIDTH))
}

/// A film that was not cut short.
fn finished(film: Film) -> Result<Film> {
    if film.complete { Ok(film) } else { Err(Error::cancelled()) }
}

fn time(
    renderers: &[Renderer],
    settings: &RenderSettings,
    repetitions: u32,
    progress: &dyn Progress,
) -> Result<Vec<Option<Median>>> {
    if repetitions == 0 {
        return Ok(vec![None; renderers.len()]);
    }
    let render = |renderer: &Renderer| drop(std::hint::black_box(renderer.render(settings, &Silent)));
    let mut work: Vec<_> = renderers.iter().map(|renderer| move || render(renderer)).collect();
    let mut pieces: Vec<&mut dyn FnMut()> = Vec::new();
    for work in &mut work {
        pieces.push(work);
    }
    progress.begin("time", u64::from(repetitions + 1) * renderers.len() as u64);
    Ok(interleaved(&mut pieces, repetitions, progress)?.into_iter().map(Some).collect())
}

fn row(error: ErrorKind, samples: u32, seconds: Option<Median>, film: &Film, reference: &Film) -> ImageRow {
    let (mut sum, mut max, mut wrong_pixels) = (0.0, 0.0f64, 0);
    for (ours, theirs) in film.color.iter().zip(&reference.color) {
        let off: [f64; 3] = std::array::from_fn(|k| (f64::from(ours[k]) - f64::from(theirs[k])).abs());
        sum += off.iter().map(|off| off * off).sum::<f64>();
        let largest = off.into_iter().fold(0.0, f64::max);
        max = max.max(largest);
        wrong_pixels += usize::from(largest >= VISIBLE);
    }
    let pixels = film.color.len();
    ImageRow {
        error,
        samples,
        seconds,
        reference_seconds: reference.stats.seconds,
        pixels,
        rmse: (sum / (3 * pixels) as f64).sqrt(),
        max,
        wrong_pixels,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::report::subject::HardSet;

    #[test]
    fn more_samples_are_nearer_to_many_and_f64_is_near_to_f32() {
        let rows = measure(&Subject::hard(HardSet::Sphere), 0, &Silent).unwrap();
        let of = |kind: ErrorKind| rows.iter().filter(move |row| row.error == kind);
        let sampling: Vec<f64> = of(ErrorKind::Sampling).map(|row| row.rmse).collect();
        assert_eq!(sampling.len(), SAMPLES.len());
        assert!(sampling.windows(2).all(|pair| pair[1] < pair[0]), "{sampling:?}");
        assert_eq!(of(ErrorKind::Numeric).count(), 3);
        for row in of(ErrorKind::Numeric) {
            assert!(row.rmse < 1e-3 && row.wrong_pixels <= 2, "{row:?}");
        }
    }
}
