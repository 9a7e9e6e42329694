//! "Pay for what is used", counted: bytes and instructions a ray of one small scene without a feature and with it.
//!
//! Instructions are counted by valgrind's callgrind on the program itself, on one thread: user-mode instructions do not
//! depend on what else the machine does. A rendering at one sample and one at five differ by what four samples cost;
//! loading, building and writing cancel. What an absent feature costs is found by comparing with a program whose build
//! left that feature's code out (see [`crate::scene::compiled`]).

use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::measure::features::scene::Feature;
use crate::progress::Progress;

pub mod scene;

/// What a feature costs a scene, by a row of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeatureCost {
    /// The feature.
    pub feature: &'static str,
    /// What the scene has more than the plain one.
    pub adds: &'static str,
    /// Bytes of geometry, textures, trees and top level of the plain scene.
    pub bytes_absent: u64,
    /// The same of the scene with the feature.
    pub bytes_present: u64,
    /// User-mode instructions a ray of the plain scene.
    pub instructions_absent: f64,
    /// The same of the scene with the feature; its rays are counted with it.
    pub instructions_present: f64,
    /// Instructions a ray of the plain scene in a build without the feature, if such a build was given.
    pub instructions_without: Option<f64>,
}

impl FeatureCost {
    /// What the absent feature costs, relative to a build without it: 0.01 is one percent more.
    pub fn cost_of_absence(&self) -> Option<f64> {
        self.instructions_without.map(|without| self.instructions_absent / without - 1.0)
    }
}

/// What one rendering used.
#[derive(Debug, Clone, Copy)]
struct Counted {
    bytes: u64,
    rays: u64,
    instructions: u64,
}

/// Counts the costs of all features with the program `whitted`; `builds` are programs without a feature, by its name.
///
/// # Errors
/// When valgrind cannot be run, a program fails, or a build is of a feature that does not exist.
pub fn count(whitted: &Path, builds: &[(String, PathBuf)], progress: &dyn Progress) -> Result<Vec<FeatureCost>> {
    for (name, _) in builds {
        if !Feature::ALL.iter().any(|feature| feature.name() == name) {
            let known = Feature::ALL.map(Feature::name).join(", ");
            return Err(Error::caller(format!("there is no feature `{name}`")).remedy(format!("choose from {known}")));
        }
    }
    let folder = tempfile::tempdir().map_err(|cause| Error::system(&std::env::temp_dir(), cause))?;
    progress.begin("features", 1 + Feature::ALL.len() as u64 + builds.len() as u64);
    let per_ray = |whitted: &Path, feature: Option<Feature>| -> Result<(u64, f64)> {
        progress.check()?;
        let scene = scene::write(folder.path(), feature)?;
        let once = rendered(whitted, &scene, 1)?;
        let often = rendered(whitted, &scene, 5)?;
        progress.advance(1);
        Ok((often.bytes, (often.instructions - once.instructions) as f64 / (often.rays - once.rays) as f64))
    };
    let (bytes_absent, instructions_absent) = per_ray(whitted, None)?;
    let mut rows = Vec::new();
    for feature in Feature::ALL {
        let (bytes_present, instructions_present) = per_ray(whitted, Some(feature))?;
        let build = builds.iter().find(|(name, _)| name == feature.name());
        let instructions_without =
            build.map(|(_, program)| per_ray(program, None)).transpose()?.map(|(_, count)| count);
        rows.push(FeatureCost {
            feature: feature.name(),
            adds: feature.adds(),
            bytes_absent,
            bytes_present,
            instructions_absent,
            instructions_present,
            instructions_without,
        });
    }
    Ok(rows)
}

/// Renders a scene under callgrind.
fn rendered(whitted: &Path, scene: &Path, samples: u32) -> Result<Counted> {
    let folder = scene.parent().expect("the scene lies in a folder");
    let stats = folder.join("stats.json");
    let output = Command::new("valgrind")
        .arg("--tool=callgrind")
        .arg(format!("--callgrind-out-file={}", folder.join("callgrind.out").display()))
        .arg(whitted)
        .args(["render", "--quiet", "--threads", "1", "--spp", &samples.to_string(), "--stats-json"])
        .arg(&stats)
        .arg("--output")
        .arg(folder.join("picture.exr"))
        .arg(scene)
        .output()
        .map_err(|cause| {
            Error::new(
                crate::error::Fault::System,
                format!("valgrind, which counts instructions, cannot be run: {cause}"),
            )
            .remedy("install valgrind")
        })?;
    let text = String::from_utf8_lossy(&output.stderr);
    let instructions = text
        .lines()
        .find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok())
        .filter(|_| output.status.success());
    let Some(instructions) = instructions else {
        let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it said nothing").to_owned();
        return Err(Error::caller(format!("{} failed under valgrind: {last}", whitted.display())));
    };
    let read = std::fs::read_to_string(&stats).map_err(|cause| Error::system(&stats, cause))?;
    let stats: serde_json::Value =
        serde_json::from_str(&read).map_err(|cause| Error::file(cause.to_string()).at_path(&stats))?;
    let number = |group: &str, name: &str| stats[group][name].as_u64().unwrap_or(0);
    let bytes = ["geometry", "textures", "tree_nodes", "tree_leaves", "top_level"].map(|name| number("bytes", name));
    Ok(Counted { bytes: bytes.iter().sum(), rays: number("rays", "total"), instructions })
}
