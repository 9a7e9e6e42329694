//! An animation at a moment: where nodes stand, and how far meshes are morphed.

use std::collections::{HashMap, HashSet};

use super::budget::Budget;
use super::buffers::Buffers;
use super::choice::choose;
use super::document::{Animation, Channel, Document, Placement};
use super::sampler::{self, Values};
use crate::error::{Error, Fault, Result};
use crate::formats::{Ledger, LoadOptions, Treatment};

/// How everything stands.
#[derive(Debug)]
pub(super) struct Pose {
    /// By node.
    pub placements: Vec<Placement>,
    /// By node, where an animation sets them: the weights of its mesh's morph targets.
    pub weights: HashMap<usize, Vec<f64>>,
}

/// The pose at the time that is asked for; without one, everything stands as in the file.
///
/// Channels that are broken go to the ledger, and what they would move stays as it is.
///
/// # Errors
/// A caller's error for an animation that does not exist, or a time that is not finite; a limit.
pub(super) fn pose(
    document: &Document,
    buffers: &Buffers,
    options: &LoadOptions,
    budget: &mut Budget,
    ledger: &mut Ledger,
) -> Result<Pose> {
    let mut pose = Pose { placements: document.placements.clone(), weights: HashMap::new() };
    let count = document.animations.len() as u64;
    let Some(time) = options.time else {
        if count > 0 {
            ledger.note(Treatment::Ignored, "animation: not applied without a time (see --time)", count);
        }
        return Ok(pose);
    };
    if !time.is_finite() {
        return Err(Error::caller(format!("there is nothing to show at a time of {time} seconds")));
    }
    if count == 0 && options.animation.is_none() {
        ledger.note(Treatment::Warning, "a time is given, but the file has no animation", 1);
        return Ok(pose);
    }
    let names = document.animations.iter().map(|animation| animation.name.as_deref());
    let wanted = options.animation.as_deref().map(|wanted| choose("animation", wanted, names)).transpose()?;
    let animation = &document.animations[wanted.unwrap_or(0)];
    if count > 1 {
        ledger.note(Treatment::Ignored, "other animation (see --animation)", count - 1);
    }
    let mut mover = Mover { document, buffers, animation, time, pose: &mut pose, budget, ledger };
    let mut moved = HashSet::new();
    for (number, channel) in animation.channels.iter().enumerate() {
        if !moved.insert((channel.target.node, channel.target.path.as_str())) && channel.target.node.is_some() {
            mover.warn("animation channel for what another one moves too: the later one counts");
        }
        match mover.apply(channel) {
            Err(error) if matches!(error.fault(), Fault::File | Fault::Unsupported) => {
                mover.warn(&format!("animation channel {number}: {}: left out", error.message()));
            }
            outcome => outcome?,
        }
    }
    Ok(pose)
}

struct Mover<'a, 'b> {
    document: &'a Document,
    buffers: &'a Buffers<'b>,
    animation: &'a Animation,
    time: f64,
    pose: &'a mut Pose,
    budget: &'a mut Budget,
    ledger: &'a mut Ledger,
}

impl Mover<'_, '_> {
    fn warn(&mut self, text: &str) {
        self.ledger.note(Treatment::Warning, text, 1);
    }

    /// Moves what a channel is for.
    fn apply(&mut self, channel: &Channel) -> Result<()> {
        let values = match channel.target.path.as_str() {
            "translation" | "scale" => Some(Values::Vectors),
            "rotation" => Some(Values::Rotations),
            "weights" => None,
            _ => return self.ignore(),
        };
        let Some(number) = channel.target.node else { return self.ignore() };
        let node =
            self.document.root.nodes.get(number).ok_or_else(|| Error::file("moves a node that does not exist"))?;
        if values.is_some() && self.pose.placements[number].matrix.is_some() {
            return Err(Error::file("moves a node that has a matrix"));
        }
        let values = match values {
            Some(values) => values,
            None => {
                let mesh = node.mesh.ok_or_else(|| Error::file("has weights for a node without a mesh"))?;
                Values::Weights(target_count(self.document, mesh.value()))
            }
        };
        let sampler = self.animation.samplers.get(channel.sampler);
        let sampler = sampler.ok_or_else(|| Error::file("has a sampler that does not exist"))?;
        let value = sampler::evaluate(&self.document.root, self.buffers, sampler, values, self.time, self.budget)?;
        if !value.iter().all(|number| number.is_finite()) {
            return Err(Error::file("has values that are not finite"));
        }
        self.store(number, &channel.target.path, value);
        self.ledger.note(Treatment::Honoured, format!("animation of {}", channel.target.path), 1);
        Ok(())
    }

    fn store(&mut self, node: usize, path: &str, value: Vec<f64>) {
        let placement = &mut self.pose.placements[node];
        match (path, value.as_slice()) {
            ("translation", &[x, y, z]) => placement.translation = Some([x, y, z]),
            ("scale", &[x, y, z]) => placement.scale = Some([x, y, z]),
            ("rotation", &[x, y, z, w]) => placement.rotation = Some([x, y, z, w]),
            _ => {
                self.pose.weights.insert(node, value);
            }
        }
    }

    fn ignore(&mut self) -> Result<()> {
        self.ledger.note(Treatment::Ignored, "animation channel for something else than a node", 1);
        Ok(())
    }
}

/// The largest number of morph targets that a primitive of a mesh has.
pub(super) fn target_count(document: &Document, mesh: usize) -> usize {
    document.targets[mesh].iter().map(Vec::len).max().unwrap_or(0)
}
