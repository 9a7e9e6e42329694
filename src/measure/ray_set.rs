//! Sets of rays, and fingerprints of rays and answers.

use crate::geometry::{Hit, Ray};
use crate::measure::rays;

/// Whether rays are like those of pictures, or aimed at what is hard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// As pictures have them.
    Generic,
    /// Aimed at what is hard.
    Adversarial,
}

impl Group {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Generic, Self::Adversarial];

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Generic => "generic",
            Self::Adversarial => "adversarial",
        }
    }
}

/// What is asked of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Question {
    /// The closest hit.
    Closest,
    /// Whether there is any hit.
    Occluded,
}

/// Rays of one kind, in the renderer's coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct RaySet {
    /// What kind of rays they are.
    pub name: String,
    /// Generic or adversarial.
    pub group: Group,
    /// What is asked of them.
    pub question: Question,
    /// The rays.
    pub rays: Vec<Ray>,
}

impl RaySet {
    /// A fingerprint of the rays.
    pub fn hash(&self) -> String {
        fingerprint(bytemuck::cast_slice(&self.rays))
    }
}

/// The answers of one choice to a set.
#[derive(Debug, Clone, PartialEq)]
pub enum Answered {
    /// The closest hits.
    Closest(Vec<Hit>),
    /// Yes or no.
    Occluded(Vec<bool>),
}

impl Answered {
    /// How many of the first `count` rays were answered by a hit.
    pub fn hits_in_first(&self, count: usize) -> u64 {
        match self {
            Self::Closest(hits) => hits[..count].iter().filter(|hit| hit.is_hit()).count() as u64,
            Self::Occluded(flags) => flags[..count].iter().filter(|&&yes| yes).count() as u64,
        }
    }

    /// Whether the first answers are these.
    pub fn begins_with(&self, first: &Self) -> bool {
        match (self, first) {
            (Self::Closest(all), Self::Closest(first)) => all.starts_with(first),
            (Self::Occluded(all), Self::Occluded(first)) => all.starts_with(first),
            _ => false,
        }
    }

    /// A fingerprint of the answers as `query` writes them: t, u, v, instance and primitive, or 0 and 1, 32 bits each.
    pub fn hash(&self) -> String {
        match self {
            Self::Closest(hits) => fingerprint(bytemuck::cast_slice(hits)),
            Self::Occluded(flags) => {
                let records: Vec<u32> = flags.iter().map(|&yes| u32::from(yes)).collect();
                fingerprint(bytemuck::cast_slice(&records))
            }
        }
    }
}

/// The [`rays::fingerprint`] of values of 32 bits; sixteen hexadecimal digits.
fn fingerprint(values: &[u32]) -> String {
    format!("{:016x}", rays::fingerprint(values.iter().copied()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_that_differ_have_different_hashes() {
        let hit = Hit { t: 1.0, u: 0.25, v: 0.5, instance: 0, primitive: 3 };
        let answers = Answered::Closest(vec![hit, Hit::MISS]);
        assert_eq!((answers.hits_in_first(1), answers.hits_in_first(2)), (1, 1));
        let first = |hit: Hit| Answered::Closest(vec![hit]);
        assert!(answers.begins_with(&first(hit)) && !answers.begins_with(&first(Hit { primitive: 4, ..hit })));
        assert!(!answers.begins_with(&Answered::Occluded(Vec::new())));
        let other = Answered::Closest(vec![Hit { t: 1.0f32.next_up(), ..hit }, Hit::MISS]);
        assert_ne!(answers.hash(), other.hash());
        assert_ne!(Answered::Occluded(vec![true]).hash(), Answered::Occluded(vec![false]).hash());
    }
}
