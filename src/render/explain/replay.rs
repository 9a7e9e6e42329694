//! The sums done again from what is listed alone.

use super::{End, Explanation, Lighting, RayNode, Sample, Surface, Term};
use crate::scene::Rgb;

impl Explanation {
    /// The pixel's colour again, from the listed samples: those that are explained are replayed.
    pub fn replay(&self) -> Rgb {
        let mut sum = [0.0f64; 3];
        for sample in &self.samples {
            for (sum, value) in sum.iter_mut().zip(sample.replay().unwrap_or(sample.color).to_array()) {
                *sum += f64::from(value);
            }
        }
        let count = self.samples.len() as f64;
        Rgb::from_array(sum.map(|sum| (sum / count) as f32))
    }
}

impl Sample {
    /// The sample's colour again, from its rays; `None` if these are not listed.
    pub fn replay(&self) -> Option<Rgb> {
        self.rays.as_ref().map(|rays| replay(rays).first().copied().unwrap_or(Rgb::ZERO))
    }
}

/// The colours of listed rays, each again from its terms and the colours of the rays that follow it.
pub fn replay(rays: &[RayNode]) -> Vec<Rgb> {
    let mut colors = vec![Rgb::ZERO; rays.len()];
    for (number, ray) in rays.iter().enumerate().rev() {
        colors[number] = match &ray.end {
            End::Background { color, .. } => *color,
            End::Surface(surface) => surface.replay(&colors),
        };
    }
    colors
}

impl Surface {
    /// The sum of the terms; `seen` are the colours of the list's rays, of which those that came of this one are asked.
    fn replay(&self, seen: &[Rgb]) -> Rgb {
        self.terms.iter().fold(Rgb::ZERO, |sum, term| term.apply(sum, seen))
    }
}

impl Term {
    fn apply(&self, sum: Rgb, seen: &[Rgb]) -> Rgb {
        match self {
            Self::Ambient { color } => *color,
            Self::Emission { color } => sum + *color,
            Self::Light(term) => match &term.lighting {
                Lighting::Shines(arrival) if arrival.visible != Rgb::ZERO => sum + arrival.adds(),
                _ => sum,
            },
            Self::Seen { weight, ray, .. } => match ray.and_then(|ray| seen.get(ray)) {
                Some(color) => sum + *weight * *color,
                None => sum,
            },
            Self::Absorbed { left, .. } => sum * *left,
            Self::Clamped { .. } => sum.min(Rgb::ONE),
        }
    }
}

impl super::Arrival {
    /// `Si Ipi [diffuse + specular]`, and Si again from what is between.
    pub(super) fn adds(&self) -> Rgb {
        let direct = self.specular.map_or(self.diffuse, |specular| self.diffuse + specular);
        self.visible() * self.color * direct
    }

    /// Si from what is listed.
    fn visible(&self) -> Rgb {
        self.crossed.iter().fold(Rgb::ONE, |visible, crossing| {
            let visible = visible * crossing.passes;
            crossing.left.map_or(visible, |left| visible * left)
        })
    }
}
