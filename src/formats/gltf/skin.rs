//! Skins: vertices that follow joints (glTF 2.0, section 3.7.3.3).

use ::gltf::json::Root;
use glam::{DAffine3, DMat3, DVec3, Vec4};

use super::accessor::Accessor;
use super::budget::Budget;
use super::buffers::Buffers;
use super::nodes::affine;
use crate::error::{Error, Result};
use crate::math::transform::{apply, compose, point};
use crate::math::vector::{cross, dot};

/// A skin whose joints stand somewhere.
#[derive(Debug)]
pub(super) struct Skin {
    /// For each joint, from the mesh's space to the world.
    matrices: Vec<DAffine3>,
    /// The same for vertices that no joint moves.
    unmoved: DAffine3,
}

/// One set of joints and their weights, for all vertices: JOINTS_n and WEIGHTS_n.
pub(super) struct Influences {
    /// Positions in the skin's list of joints.
    pub joints: Vec<[u16; 4]>,
    /// How much each counts.
    pub weights: Vec<Vec4>,
}

/// What was wrong with vertices, by count.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Faults {
    /// A joint that the skin does not have: not moved.
    pub missing_joints: u64,
    /// No weight above 0: moved by the first joint.
    pub without_weights: u64,
}

/// How a vertex is moved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    to_world: DAffine3,
    /// What normals are multiplied by: the inverse transpose but for a factor above 0.
    for_normals: DMat3,
    /// Whether it turns a counter-clockwise triangle clockwise.
    pub is_mirroring: bool,
}

impl Skin {
    /// Reads a skin. `worlds` has, by node, where those of the scene stand; `unmoved` is for vertices without joints.
    ///
    /// # Errors
    /// A file's error for joints that are not in the scene, or too few inverse bind matrices; a limit.
    pub fn read(
        root: &Root,
        buffers: &Buffers,
        number: usize,
        worlds: &[Option<DAffine3>],
        unmoved: DAffine3,
        budget: &mut Budget,
    ) -> Result<Self> {
        let skin = root.skins.get(number).ok_or_else(|| Error::file("does not exist"))?;
        budget.take::<[DAffine3; 2]>(skin.joints.len())?;
        let inverse_binds = match skin.inverse_bind_matrices {
            Some(index) => Accessor::open(root, buffers, index)?.numbers(0..skin.joints.len())?,
            None => Vec::new(),
        };
        let inverse_binds = inverse_binds.as_chunks::<16>().0;
        if skin.inverse_bind_matrices.is_some() && inverse_binds.len() != skin.joints.len() {
            return Err(Error::file("has inverse bind matrices that are no matrices"));
        }
        let matrix = |(at, joint): (usize, &::gltf::json::Index<::gltf::json::Node>)| {
            let world = worlds.get(joint.value()).copied().flatten();
            let world = world.ok_or_else(|| Error::file(format!("has joint {at} outside of the scene")))?;
            Ok(inverse_binds.get(at).map_or(world, |numbers| compose(&world, &affine(numbers))))
        };
        let matrices = skin.joints.iter().enumerate().map(matrix).collect::<Result<Vec<_>>>()?;
        Ok(Self { matrices, unmoved })
    }

    /// How a vertex is moved: by the mean of its joints' matrices, weighted. Weights below 0 and NaN count as 0; they
    /// are divided by their sum.
    pub fn motion(&self, sets: &[Influences], vertex: usize, faults: &mut Faults) -> Motion {
        let all = sets.iter().flat_map(|set| {
            set.joints[vertex].into_iter().zip(set.weights[vertex].to_array()).map(|(j, w)| (usize::from(j), w))
        });
        let weighty = all.clone().map(|(joint, weight)| (joint, f64::from(weight))).filter(|&(_, weight)| weight > 0.0);
        let mut sum = 0.0;
        let mut matrix3 = DMat3::ZERO;
        let mut translation = DVec3::ZERO;
        for (joint, weight) in weighty {
            let Some(matrix) = self.matrices.get(joint) else {
                faults.missing_joints += 1;
                return Motion::by(self.unmoved);
            };
            sum += weight;
            matrix3 += matrix.matrix3 * weight;
            translation += matrix.translation * weight;
        }
        if sum > 0.0 && sum < f64::INFINITY {
            return Motion::by(DAffine3 { matrix3: matrix3 * (1.0 / sum), translation: translation / sum });
        }
        faults.without_weights += 1;
        let first = all.map(|(joint, _)| joint).next().and_then(|joint| self.matrices.get(joint));
        Motion::by(*first.unwrap_or(&self.unmoved))
    }

    /// How what has no joints at all is moved.
    pub fn unmoved(&self) -> Motion {
        Motion::by(self.unmoved)
    }
}

impl Motion {
    fn by(to_world: DAffine3) -> Self {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = to_world.matrix3;
        let cofactors = DMat3::from_cols(cross(y, z), cross(z, x), cross(x, y));
        let is_mirroring = dot(x, cofactors.x_axis) < 0.0;
        Self { to_world, for_normals: if is_mirroring { cofactors * -1.0 } else { cofactors }, is_mirroring }
    }

    /// Where a point goes.
    pub fn point(&self, p: DVec3) -> DVec3 {
        point(&self.to_world, p)
    }

    /// Where a direction along the surface goes, not normalised.
    pub fn vector(&self, v: DVec3) -> DVec3 {
        apply(&self.to_world.matrix3, v)
    }

    /// Where a normal goes, not normalised; outward stays outward.
    pub fn normal(&self, n: DVec3) -> DVec3 {
        apply(&self.for_normals, n)
    }
}
