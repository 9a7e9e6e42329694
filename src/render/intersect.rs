//! The two-level intersection: trees over triangles below, a tree over instances and bounded quadrics above,
//! unbounded quadrics beside it. Here accelerators and scenes meet.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;

use crate::accel::{
    self, BoxTree, Counting, KeptTree, Kind, Params, Tests, TreeArrays, TreeStats, TriangleAccelerator,
};
use crate::error::{Error, Result};
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, Quadric, Ray, TriangleMesh};
use crate::progress::Progress;
use crate::render::world::{Instance, World};
use crate::scene::{Scene, Shape, compiled};

/// Everything that a ray can ask of a scene. All implementations give the same answers, bit for bit.
pub trait Intersect: Sync {
    /// The first hit in the order of [`Key`].
    fn closest(&self, ray: &Ray) -> Hit;

    /// Whether anything is hit.
    fn occluded(&self, ray: &Ray) -> bool;

    /// Whether anything is hit that is known to be opaque as a whole.
    fn occluded_by_opaque(&self, ray: &Ray) -> bool;

    /// The first hit after `key`.
    fn next_after(&self, ray: &Ray, key: Key) -> Hit;

    /// The first hit after `key` on an instance that is not opaque as a whole.
    fn next_transmissive_after(&self, ray: &Ray, key: Key) -> Hit;

    /// [`closest`](Self::closest) for each ray.
    ///
    /// # Panics
    /// If the slices have different lengths.
    fn closest_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest(ray);
        }
    }

    /// [`occluded`](Self::occluded) for each ray.
    ///
    /// # Panics
    /// If the slices have different lengths.
    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }

    /// [`occluded_by_opaque`](Self::occluded_by_opaque) for each ray.
    ///
    /// # Panics
    /// If the slices have different lengths.
    fn occluded_by_opaque_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded_by_opaque(ray);
        }
    }
}

/// A scene's instances over one kind of triangle accelerator.
pub struct TwoLevel<A> {
    pub(super) meshes: Vec<Arc<A>>,
    quadrics: Vec<Quadric>,
    pub(super) world: World,
    pub(super) top: Top,
}

/// What need not be built of a scene's structures.
pub enum Ready<'a, A> {
    /// Everything is to be built.
    Nothing,
    /// The trees of meshes that another state of the scene shares.
    State(&'a Scene, &'a TwoLevel<A>),
    /// The trees of all meshes, in a file.
    Kept(&'a [KeptTree]),
}

/// How instances are found.
pub(super) enum Top {
    /// The scene is one untransformed mesh.
    Single,
    /// A tree over the bounded instances, and the numbers of the others.
    Tree { tree: BoxTree, unbounded: Vec<u32> },
    /// Every instance is asked: the reference.
    Linear,
}

/// The instances' boxes; empty for those without end.
fn boxes(instances: &[Instance]) -> Vec<Bounds> {
    instances.iter().map(|instance| instance.bounds.unwrap_or(Bounds::EMPTY)).collect()
}

/// Which instances a search considers.
pub(super) trait Filter {
    fn wants(instance: &Instance) -> bool;
}

pub(super) struct Everything;
struct Opaque;
struct Transmissive;

impl Filter for Everything {
    fn wants(_: &Instance) -> bool {
        true
    }
}

impl Filter for Opaque {
    fn wants(instance: &Instance) -> bool {
        instance.opaque
    }
}

impl Filter for Transmissive {
    fn wants(instance: &Instance) -> bool {
        !instance.opaque
    }
}

/// The trees of a scene's meshes that a file has.
fn restore<A: TriangleAccelerator>(scene: &Scene, trees: &[KeptTree], progress: &dyn Progress) -> Result<Vec<Arc<A>>> {
    if trees.len() != scene.meshes.len() {
        return Err(Error::file(format!("there are {} trees for {} meshes", trees.len(), scene.meshes.len())));
    }
    let restore = |(mesh, kept): (&Arc<TriangleMesh>, &KeptTree)| {
        progress.check()?;
        let tree = A::restore(mesh, kept)
            .map_err(|what| Error::file(format!("the tree of mesh `{}` is damaged: {what}", mesh.name)))?;
        progress.advance(mesh.live_count() as u64);
        Ok(Arc::new(tree))
    };
    scene.meshes.par_iter().zip(trees).map(restore).collect()
}

impl<A: TriangleAccelerator> TwoLevel<A> {
    /// Builds the trees of all meshes that are not `ready`, and the top level. Advances by one step a live triangle.
    ///
    /// # Errors
    /// A singular transform, or one that leads too far; a cancellation; trees that are no trees of the scene's meshes.
    pub fn build(scene: &Scene, ready: &Ready<'_, A>, params: &Params, progress: &dyn Progress) -> Result<Self> {
        let (world, meshes) = match *ready {
            Ready::Nothing => (World::new(scene)?, Self::build_meshes(scene, None, params, progress)?),
            Ready::State(other, structure) => {
                (World::new(scene)?, Self::build_meshes(scene, Some((other, structure)), params, progress)?)
            }
            Ready::Kept(trees) => {
                let meshes = restore(scene, trees, progress)?;
                let bounds: Vec<Bounds> = meshes.iter().map(|mesh: &Arc<A>| mesh.bounds()).collect();
                (World::with_bounds(scene, &bounds)?, meshes)
            }
        };
        let instances = &world.instances;
        let is_held = |bounds: &Bounds| bounds.is_empty() || (bounds.min.is_finite() && bounds.max.is_finite());
        if let Some(far) = instances.iter().position(|instance| !instance.bounds.as_ref().is_none_or(is_held)) {
            let name = &scene.objects[far].name;
            return Err(Error::caller(format!("object `{name}` reaches beyond what numbers hold"))
                .remedy("bring it nearer to the origin, or make it smaller"));
        }
        let single = matches!(instances.as_slice(), [one] if one.identity && one.shape == Shape::Mesh(0));
        let top = if single {
            Top::Single
        } else if params.kind.resolve() == Kind::Linear {
            Top::Linear
        } else {
            let unbounded = (0..instances.len() as u32).filter(|&i| instances[i as usize].bounds.is_none()).collect();
            Top::Tree { tree: BoxTree::build(&boxes(instances), params, progress)?, unbounded }
        };
        Ok(Self { meshes, quadrics: scene.quadrics.clone(), world, top })
    }

    fn build_meshes(
        scene: &Scene,
        before: Option<(&Scene, &Self)>,
        params: &Params,
        progress: &dyn Progress,
    ) -> Result<Vec<Arc<A>>> {
        let address = |mesh: &Arc<TriangleMesh>| Arc::as_ptr(mesh) as usize;
        let known: HashMap<usize, &Arc<A>> = before.map_or_else(HashMap::new, |(scene, structure)| {
            scene.meshes.iter().map(address).zip(&structure.meshes).collect()
        });
        // Small meshes side by side; what is large is built on all threads by itself, one after the other for the sake of memory.
        let build = |mesh: &Arc<TriangleMesh>| match known.get(&address(mesh)) {
            Some(&tree) => {
                progress.advance(mesh.live_count() as u64);
                Ok(Arc::clone(tree))
            }
            None => A::build(mesh, params, progress).map(Arc::new),
        };
        let is_small = |mesh: &TriangleMesh| mesh.live_count() <= accel::ONE_THREAD;
        let small = scene.meshes.par_iter().map(|mesh| is_small(mesh).then(|| build(mesh)).transpose());
        let small = small.collect::<Result<Vec<_>>>()?;
        let meshes = scene.meshes.iter().zip(small).map(|(mesh, built)| built.map_or_else(|| build(mesh), Ok));
        meshes.collect()
    }

    /// The arrays of the meshes' trees; `None` where they cannot be kept.
    pub fn arrays(&self) -> Option<Vec<TreeArrays<'_>>> {
        self.meshes.iter().map(|mesh| mesh.arrays()).collect()
    }

    /// The objects as rays meet them.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Statistics of the meshes' trees.
    pub fn mesh_stats(&self) -> impl Iterator<Item = TreeStats> + '_ {
        self.meshes.iter().map(|mesh| mesh.stats())
    }

    /// Bytes of the top level.
    pub fn top_level_bytes(&self) -> usize {
        let tree = match &self.top {
            Top::Tree { tree, unbounded } => {
                (tree.stats().node_bytes + tree.stats().leaf_bytes) as usize
                    + std::mem::size_of_val(unbounded.as_slice())
            }
            Top::Single | Top::Linear => 0,
        };
        tree + std::mem::size_of_val(self.world.instances.as_slice())
    }

    /// Checks every tree.
    ///
    /// # Errors
    /// Says what is wrong.
    pub fn validate(&self) -> std::result::Result<(), String> {
        for (number, mesh) in self.meshes.iter().enumerate() {
            mesh.validate().map_err(|what| format!("mesh {number}: {what}"))?;
        }
        match &self.top {
            Top::Tree { tree, .. } => {
                tree.validate(&boxes(&self.world.instances)).map_err(|what| format!("top level: {what}"))
            }
            Top::Single | Top::Linear => Ok(()),
        }
    }

    /// The first hit strictly after `after` on wanted instances.
    pub(super) fn search<F: Filter>(&self, ray: &PreparedRay, after: Option<Key>) -> Hit {
        let mut best = Hit::MISS;
        match &self.top {
            Top::Single if F::wants(&self.world.instances[0]) => self.meet_mesh(0, 0, ray, after, &mut best),
            Top::Single => {}
            Top::Linear => {
                for number in 0..self.world.instances.len() as u32 {
                    self.meet::<F>(number, ray, after, &mut best);
                }
            }
            Top::Tree { tree, unbounded } => {
                for &number in unbounded {
                    self.meet::<F>(number, ray, after, &mut best);
                }
                let near = after.map_or(ray.t_min, |key| if key.t > ray.t_min { key.t } else { ray.t_min });
                let far = if best.t < ray.t_max { best.t } else { ray.t_max };
                let _ = tree.traverse(ray, near, far, |number| {
                    self.meet::<F>(number, ray, after, &mut best);
                    ControlFlow::Continue(if best.t < ray.t_max { best.t } else { ray.t_max })
                });
            }
        }
        best
    }

    /// Improves `best` by what one instance has to offer.
    #[inline]
    pub(super) fn meet<F: Filter>(&self, number: u32, ray: &PreparedRay, after: Option<Key>, best: &mut Hit) {
        let instance = &self.world.instances[number as usize];
        if !F::wants(instance) {
            return;
        }
        let clip = instance.clip(ray);
        // Every t of this instance will lie within the clip interval: nothing to gain if it starts after the best.
        if clip.is_empty() || clip.near > best.t || clip.near > ray.t_max || clip.far < ray.t_min {
            return;
        }
        match instance.shape {
            Shape::Mesh(mesh) if instance.is_unmoved() => self.meet_mesh(mesh, number, ray, after, best),
            Shape::Mesh(mesh) => {
                if let Some(local) = instance.local_ray(ray, clip) {
                    self.meet_mesh(mesh, number, &local, after, best);
                }
            }
            Shape::Quadric(_) if !compiled::QUADRICS => {}
            Shape::Quadric(quadric) => self.meet_quadric(quadric, number, ray, clip, after, best),
        }
    }

    /// Kept out of the search, which is smaller and faster without it where there are only meshes.
    #[inline(never)]
    fn meet_quadric(
        &self,
        quadric: u32,
        number: u32,
        ray: &PreparedRay,
        clip: Interval,
        after: Option<Key>,
        best: &mut Hit,
    ) {
        for (t, primitive) in self.crossings(quadric, number, ray, clip) {
            let hit = Hit { t, u: 0.0, v: 0.0, instance: number, primitive };
            if after.is_none_or(|key| key.is_before(&hit.key())) && hit.key().is_before(&best.key()) {
                *best = hit;
            }
        }
    }

    /// Where a ray meets a quadric, and on which of its surfaces.
    #[inline]
    fn crossings(
        &self,
        quadric: u32,
        number: u32,
        ray: &PreparedRay,
        clip: Interval,
    ) -> impl Iterator<Item = (f32, u32)> {
        let instance = &self.world.instances[number as usize];
        let (origin, direction) = instance.local_line(ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (t_min, t_max) = (ray.t_min, ray.t_max);
        let crossings = self.quadrics[quadric as usize].intersect_quadratic(origin, direction);
        let crossings =
            crossings.into_iter().map(move |crossing| (clip.clamp(crossing.t as f32) + 0.0, crossing.surface));
        crossings.filter(move |&(t, _)| t >= t_min && t <= t_max && t < f32::INFINITY)
    }

    #[inline(never)]
    fn quadric_blocks(&self, quadric: u32, number: u32, ray: &PreparedRay, clip: Interval) -> bool {
        self.crossings(quadric, number, ray, clip).next().is_some()
    }

    #[inline]
    fn meet_mesh(&self, mesh: u32, number: u32, ray: &PreparedRay, after: Option<Key>, best: &mut Hit) {
        let mesh = &self.meshes[mesh as usize];
        match after {
            None => mesh.closest(ray, number, best),
            Some(key) => mesh.next_after(ray, number, key, best),
        }
    }

    /// Whether any wanted instance is hit.
    pub(super) fn any<F: Filter>(&self, ray: &PreparedRay) -> bool {
        match &self.top {
            Top::Single => F::wants(&self.world.instances[0]) && self.meshes[0].occluded(ray),
            Top::Linear => (0..self.world.instances.len() as u32).any(|number| self.blocks::<F>(number, ray)),
            Top::Tree { tree, unbounded } => {
                if unbounded.iter().any(|&number| self.blocks::<F>(number, ray)) {
                    return true;
                }
                let mut blocked = false;
                let _ = tree.traverse(ray, ray.t_min, ray.t_max, |number| {
                    blocked = self.blocks::<F>(number, ray);
                    if blocked { ControlFlow::Break(()) } else { ControlFlow::Continue(ray.t_max) }
                });
                blocked
            }
        }
    }

    /// Whether one instance is hit.
    #[inline]
    pub(super) fn blocks<F: Filter>(&self, number: u32, ray: &PreparedRay) -> bool {
        let instance = &self.world.instances[number as usize];
        if !F::wants(instance) {
            return false;
        }
        let clip = instance.clip(ray);
        if clip.is_empty() || clip.near > ray.t_max || clip.far < ray.t_min {
            return false;
        }
        match instance.shape {
            Shape::Mesh(mesh) if instance.is_unmoved() => self.meshes[mesh as usize].occluded(ray),
            Shape::Mesh(mesh) => {
                instance.local_ray(ray, clip).is_some_and(|local| self.meshes[mesh as usize].occluded(&local))
            }
            Shape::Quadric(_) if !compiled::QUADRICS => false,
            Shape::Quadric(quadric) => self.quadric_blocks(quadric, number, ray, clip),
        }
    }
}

impl<A: TriangleAccelerator> Intersect for TwoLevel<A> {
    #[inline(always)]
    fn closest(&self, ray: &Ray) -> Hit {
        if let Top::Single = self.top {
            return self.meshes[0].closest_alone(ray);
        }
        PreparedRay::new(ray).map_or(Hit::MISS, |ray| self.search::<Everything>(&ray, None))
    }

    #[inline(always)]
    fn occluded(&self, ray: &Ray) -> bool {
        if let Top::Single = self.top {
            return self.meshes[0].occluded_alone(ray);
        }
        PreparedRay::new(ray).is_some_and(|ray| self.any::<Everything>(&ray))
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        self.closest_all(rays, hits);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        self.occluded_all::<Everything>(rays, occluded);
    }

    fn occluded_by_opaque_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        self.occluded_all::<Opaque>(rays, occluded);
    }

    fn occluded_by_opaque(&self, ray: &Ray) -> bool {
        PreparedRay::new(ray).is_some_and(|ray| self.any::<Opaque>(&ray))
    }

    fn next_after(&self, ray: &Ray, key: Key) -> Hit {
        PreparedRay::new(ray).map_or(Hit::MISS, |ray| self.search::<Everything>(&ray, Some(key)))
    }

    fn next_transmissive_after(&self, ray: &Ray, key: Key) -> Hit {
        PreparedRay::new(ray).map_or(Hit::MISS, |ray| self.search::<Transmissive>(&ray, Some(key)))
    }
}

impl<A: Counting> TwoLevel<A> {
    /// What the search for a ray's first hit, or for any, compares it with. Quadrics are not counted, but their boxes are.
    pub fn count(&self, ray: &Ray, any: bool) -> Tests {
        let (mut best, mut tests) = (Hit::MISS, Tests::default());
        let Some(ray) = PreparedRay::new(ray) else { return tests };
        let all = 0..self.world.instances.len() as u32;
        match &self.top {
            Top::Single => self.meshes[0].count(&ray, any, &mut best, &mut tests),
            Top::Linear => {
                let _ = all.into_iter().try_for_each(|number| self.count_one(number, &ray, any, &mut best, &mut tests));
            }
            Top::Tree { tree, unbounded } => {
                let first = unbounded.iter();
                let found =
                    first.copied().try_for_each(|number| self.count_one(number, &ray, any, &mut best, &mut tests));
                if found.is_continue() {
                    let far = |best: &Hit| if best.t < ray.t_max { best.t } else { ray.t_max };
                    let mut boxes = 0;
                    let compared = |more| boxes += u64::from(more);
                    let _ = tree.traverse_and_tell(&ray, ray.t_min, far(&best), compared, |number| {
                        self.count_one(number, &ray, any, &mut best, &mut tests)?;
                        ControlFlow::Continue(far(&best))
                    });
                    tests.boxes += boxes;
                }
            }
        }
        tests
    }

    /// [`meet`](Self::meet) with counts; breaks off where any hit will do and one was found.
    fn count_one(
        &self,
        number: u32,
        ray: &PreparedRay,
        any: bool,
        best: &mut Hit,
        tests: &mut Tests,
    ) -> ControlFlow<()> {
        tests.boxes += 1;
        let instance = &self.world.instances[number as usize];
        let clip = instance.clip(ray);
        if !(clip.is_empty() || clip.near > best.t || clip.near > ray.t_max || clip.far < ray.t_min) {
            match instance.shape {
                Shape::Mesh(mesh) => {
                    let local = if instance.is_unmoved() { Some(*ray) } else { instance.local_ray(ray, clip) };
                    if let Some(local) = local {
                        self.meshes[mesh as usize].count(&local, any, best, tests);
                    }
                }
                Shape::Quadric(quadric) => self.meet_quadric(quadric, number, ray, clip, None, best),
            }
        }
        if any && best.is_hit() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Wide;
    use crate::math::random::Random;
    use crate::progress::Silent;
    use crate::scene::{Material, Object};

    #[test]
    fn many_large_and_small_meshes_are_built_on_any_number_of_threads() {
        let mut random = Random::new(2, 0x51d);
        let mut confetti = |count: usize| {
            let positions: Vec<_> = (0..count)
                .flat_map(|_| {
                    let center = random.in_cube();
                    [(); 3].map(|()| (center + random.in_cube() * 0.01).as_vec3())
                })
                .collect();
            let indices = (0..count as u32).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
            TriangleMesh { positions: positions.into(), indices, ..TriangleMesh::default() }.finish().unwrap().into()
        };
        let meshes: Vec<_> = [50_000, 10, 40_000, 1, 40_000, 300, 60_000].into_iter().map(&mut confetti).collect();
        let object = |mesh: u32| Object {
            name: String::new(),
            shape: Shape::Mesh(mesh),
            transform: glam::DAffine3::IDENTITY,
            material: Some(0),
        };
        let objects = (0..meshes.len() as u32).map(object).collect();
        let scene = Scene { meshes, objects, materials: vec![Material::default()], ..Scene::default() };
        let ray = Ray::new(glam::Vec3::new(0.01, 0.02, 5.0), glam::Vec3::NEG_Z);
        let mut found = Vec::new();
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let build = || TwoLevel::<Wide>::build(&scene, &Ready::Nothing, &Params::default(), &Silent).unwrap();
            let built = pool.install(build);
            assert_eq!(built.validate(), Ok(()));
            found.push(Intersect::closest(&built, &ray));
        }
        assert!(found[0].is_hit() && found.iter().all(|hit| *hit == found[0]), "{found:?}");
    }
}
