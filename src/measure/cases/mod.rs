//! The numerically hard cases: what each asks, of every structure, and what it found.
//!
//! A case makes rays whose answers are known (by construction, by a closed form or by the exact oracle), asks the
//! renderer, and counts what is wrong. Bars are fixed in the case; nothing is scaled to what was measured. The manual's
//! page on them is [`crate::manual::hard_cases`].

mod agreement;
mod boundaries;
mod closed_walls;
mod dark_lights;
pub mod exact;
mod extremes;
mod far_quadrics;
pub mod histogram;
mod instances;
pub mod meshes;
mod mirrors;
pub mod outcome;
mod quadratics;
mod quadrics;
pub mod reduce;
mod shadows;
mod spawning;
mod stand;
pub mod structure;
mod tightness;
mod trees;
mod triangles;
mod watertight;

use glam::Vec3;
use rayon::prelude::*;

pub use outcome::{Drawn, Failure, Figure, Outcome};
pub use structure::{Answer, Structure};

use crate::accel::{Kind, Params, Preset};
use crate::error::Result;
use crate::math::random::Random;
use crate::progress::Progress;
use crate::scene::Scene;

/// A hard case.
pub struct Case {
    /// What it is called on the command line: `D1`, `D2`, ...
    pub id: &'static str,
    /// What it stands for, in a few words.
    pub title: &'static str,
    /// What must hold for it to pass, in words.
    pub bar: &'static str,
    /// Asks and counts.
    ///
    /// # Errors
    /// Only a cancellation, or a build that was refused; wrong answers are counted, not returned.
    pub run: fn(&Context<'_>) -> Result<Outcome>,
}

/// All cases, in groups; [`all`] has them in their order.
pub const ALL: &[&[Case]] = &[
    watertight::CASES,
    triangles::CASES,
    tightness::CASES,
    boundaries::CASES,
    trees::CASES,
    agreement::CASES,
    extremes::CASES,
    instances::CASES,
    spawning::CASES,
    shadows::CASES,
    dark_lights::CASES,
    closed_walls::CASES,
    mirrors::CASES,
    quadratics::CASES,
    quadrics::CASES,
    far_quadrics::CASES,
];

/// How many rays a case may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Seconds for all cases together, unoptimised: the form of `cargo test`.
    Quick,
    /// As many as the bars ask for.
    Full,
}

/// What a case is run with.
pub struct Context<'a> {
    /// How many rays.
    pub effort: Effort,
    /// The structures to ask.
    pub kinds: &'a [Kind],
    /// Where progress goes, and what says to stop.
    pub progress: &'a dyn Progress,
    /// Which of all possible rays are drawn; 0 unless someone wants others.
    pub seed: u64,
}

/// How many rays each kind of structure is asked; its presets share them.
#[derive(Debug, Clone, Copy)]
pub struct Rays {
    /// With little effort.
    pub quick: u64,
    /// With full effort.
    pub full: u64,
    /// The reference without a tree gets one in this many: it asks every triangle.
    pub linear: u64,
}

impl<'a> Context<'a> {
    /// Every structure with little effort, silently: what tests start from.
    pub fn quick(progress: &'a dyn Progress) -> Self {
        Self { effort: Effort::Quick, kinds: Kind::ALL, progress, seed: 0 }
    }

    /// One of two counts, by effort.
    pub fn count(&self, quick: u64, full: u64) -> u64 {
        match self.effort {
            Effort::Quick => quick,
            Effort::Full => full,
        }
    }

    /// Every structure with every preset that changes it; `linear` has none.
    pub fn params(&self) -> impl Iterator<Item = Params> + '_ {
        self.kinds.iter().flat_map(|&kind| presets(kind).iter().map(move |&preset| Params { kind, preset }))
    }

    /// The scene in every structure, built one after the other as the iterator goes on.
    pub fn structures<'s>(&'s self, scene: &'s Scene) -> impl Iterator<Item = Result<Structure>> + 's {
        self.params().map(move |params| Structure::build(scene, params, self.progress))
    }

    /// Asks every structure over a scene as many questions as `rays` says, in parallel, and adds up what was found.
    ///
    /// All kinds are asked the same questions as far as their counts go, and each of a kind's presets its own part of
    /// them: no question is put to a kind twice. `body` gets the structure, a source of random numbers, and the question's
    /// number among those of its preset.
    ///
    /// # Errors
    /// A cancellation, or a build that was refused.
    pub fn ask_all(
        &self,
        scene: &Scene,
        seed: u64,
        rays: Rays,
        body: impl Fn(&Structure, &mut Random, u64, &mut Outcome) + Sync,
    ) -> Result<Outcome> {
        let mut sum = Outcome::default();
        for structure in self.structures(scene) {
            sum = sum.and(self.ask(&structure?, seed, rays, &body)?);
        }
        Ok(sum)
    }

    /// [`Self::ask_all`] of one structure.
    ///
    /// # Errors
    /// A cancellation.
    pub fn ask(
        &self,
        structure: &Structure,
        seed: u64,
        rays: Rays,
        body: impl Fn(&Structure, &mut Random, u64, &mut Outcome) + Sync,
    ) -> Result<Outcome> {
        let params = &structure.params;
        let body = |random: &mut Random, number: u64, outcome: &mut Outcome| body(structure, random, number, outcome);
        self.for_params(params, seed, self.share(params, rays), body)
    }

    /// [`Self::for_all`] with other random numbers for each preset of a kind, counted as questions to that kind.
    ///
    /// # Errors
    /// A cancellation.
    pub fn for_params(
        &self,
        params: &Params,
        seed: u64,
        total: u64,
        body: impl Fn(&mut Random, u64, &mut Outcome) + Sync,
    ) -> Result<Outcome> {
        let preset = presets(params.kind).iter().position(|preset| *preset == params.preset).unwrap_or(0);
        Ok(self.for_all(seed ^ (preset as u64) << 48, total, body)?.of_kind(params.kind.resolve()))
    }

    /// The bar of a measured time: with little effort it is only reported, since other work runs beside tests.
    pub fn time_bar(&self, bar: f64) -> Option<f64> {
        (self.effort == Effort::Full).then_some(bar)
    }

    /// The part of `rays` that one structure with one preset gets.
    pub fn share(&self, params: &Params, rays: Rays) -> u64 {
        let total = self.count(rays.quick, rays.full);
        let total = if params.kind.resolve() == Kind::Linear { total.div_ceil(rays.linear) } else { total };
        total.div_ceil(presets(params.kind).len() as u64)
    }

    /// Runs `body` for 0 to `total` - 1 on all threads and adds up what it found, in order, whatever the threads.
    ///
    /// Each piece of the numbers draws from a stream of its own, which depends on `seed` and the piece alone.
    ///
    /// # Errors
    /// A cancellation.
    pub fn for_all(
        &self,
        seed: u64,
        total: u64,
        body: impl Fn(&mut Random, u64, &mut Outcome) + Sync,
    ) -> Result<Outcome> {
        // Long enough to pay for the bookkeeping, short enough to share among threads.
        const PIECE: u64 = 1024;
        let seed = Random::new(self.seed, seed).bits();
        self.progress.begin("rays", total);
        (0..total.div_ceil(PIECE))
            .into_par_iter()
            .map(|piece| {
                self.progress.check()?;
                let mut random = Random::new(seed, piece);
                let mut outcome = Outcome::default();
                let numbers = piece * PIECE..((piece + 1) * PIECE).min(total);
                let steps = numbers.end - numbers.start;
                let mut drawn = Drawn { kind: None, questions: 0, wrong: 0 };
                for number in numbers {
                    let (rays, wrong) = (outcome.rays, outcome.wrong);
                    body(&mut random, number, &mut outcome);
                    drawn.questions += u64::from(outcome.rays > rays);
                    drawn.wrong += u64::from(outcome.wrong > wrong);
                }
                outcome.draw(drawn);
                self.progress.advance(steps);
                Ok(outcome)
            })
            .try_reduce(Outcome::default, |a, b| Ok(a.and(b)))
    }
}

/// The seed of a case's questions on one of its scenes: those of another scene are no copies of them, moved or scaled.
fn scene_seed(case: u64, scene: u64) -> u64 {
    case + (scene << 16)
}

/// A direction made as long as 1, rounded once; zero stays.
fn unit(v: Vec3) -> Vec3 {
    crate::math::vector::normalize(v.as_dvec3()).map_or(v, |unit| unit.as_vec3())
}

/// The presets that change a structure.
fn presets(kind: Kind) -> &'static [Preset] {
    if kind.resolve() == Kind::Linear { &Preset::ALL[..1] } else { Preset::ALL }
}

/// The case of that name, in upper or lower case.
pub fn find(id: &str) -> Option<&'static Case> {
    ALL.iter().copied().flatten().find(|case| case.id.eq_ignore_ascii_case(id))
}

/// All cases in their order: D1, D2, ...
pub fn all() -> impl Iterator<Item = &'static Case> {
    let mut cases: Vec<&Case> = ALL.iter().copied().flatten().collect();
    cases.sort_by_key(|case| case.id[1..].parse::<u32>().unwrap_or(u32::MAX));
    cases.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn cases_have_names_of_their_own_and_come_in_their_order() {
        let ids: Vec<&str> = all().map(|case| case.id).collect();
        let numbers: Vec<u32> = ids.iter().map(|id| id.strip_prefix('D').unwrap().parse().unwrap()).collect();
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "{ids:?}");
        assert_eq!(find("d1").unwrap().id, "D1");
        assert!(find("D0").is_none());
    }

    #[test]
    fn presets_share_the_rays_of_their_kind() {
        let context = Context::quick(&Silent);
        let rays = Rays { quick: 100, full: 1000, linear: 10 };
        let of = |kind| context.share(&Params { kind, preset: Preset::Fast }, rays);
        assert_eq!((of(Kind::Linear), of(Kind::Bvh2), of(Kind::Auto)), (10, 34, 34));
        assert_eq!(context.params().filter(|params| params.kind == Kind::Linear).count(), 1);
        assert_eq!(context.params().filter(|params| params.kind == Kind::CwBvh).count(), 3);
    }

    #[test]
    fn no_question_is_put_to_a_kind_twice_and_kinds_are_asked_the_same() {
        use std::collections::BTreeMap;
        use std::sync::Mutex;
        let scene = meshes::scene(vec![meshes::square()]);
        let context = Context::quick(&Silent);
        let asked: Mutex<BTreeMap<&str, Vec<u64>>> = Mutex::default();
        // More than one piece for each preset.
        let rays = Rays { quick: 6000, full: 0, linear: 3 };
        let outcome = context.ask_all(&scene, 7, rays, |structure, random, _, outcome| {
            outcome.check(true, || unreachable!());
            asked.lock().unwrap().entry(structure.params.kind.name()).or_default().push(random.bits());
        });
        assert_eq!(outcome.unwrap().bound().unwrap().0, 6000);
        let mut asked = asked.into_inner().unwrap();
        for questions in asked.values_mut() {
            let count = questions.len();
            questions.sort_unstable();
            questions.dedup();
            assert_eq!(questions.len(), count);
        }
        let trees: Vec<_> = asked.iter().filter(|(kind, _)| **kind != Kind::Linear.name()).collect();
        assert!(trees.iter().all(|(_, questions)| questions.len() == 6000 && *questions == trees[0].1));
        assert_eq!(asked[Kind::Linear.name()].len(), 2000);
    }

    #[test]
    fn questions_do_not_depend_on_threads_and_change_with_the_seed() {
        let ask = |seed, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let context = Context { seed, ..Context::quick(&Silent) };
            let body = |random: &mut Random, number: u64, outcome: &mut Outcome| {
                outcome.check(true, || unreachable!());
                outcome.figure("largest", random.unit() + number as f64 * 1e-9, None);
            };
            pool.install(|| context.for_all(5, 5000, body)).unwrap()
        };
        let (one, three, other) = (ask(0, 1), ask(0, 3), ask(1, 1));
        assert_eq!((one.rays, &one.figures), (5000, &three.figures));
        assert_ne!(one.figures, other.figures);
    }
}
