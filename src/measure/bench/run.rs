//! Compares the hits of all contenders on one set of rays with the reference, then times them in turn.

use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;

use super::contender::{Calls, Contender, EMBREE, Entry};
use super::loose::Loose;
use super::rays::View;
use super::{HitsOut, Options, Row};
use crate::accel::{Kind, Params};
use crate::error::{Error, Fault, Result};
use crate::geometry::{Hit, Ray};
use crate::measure::hit_file::HitWriter;
use crate::measure::ray_file::{RayText, RecordFormat};
use crate::measure::ray_set::{Answered, Question, RaySet};
use crate::measure::speed::{interleaved, millions_per_second};
use crate::measure::statistics::Median;
use crate::progress::Progress;
use crate::render::Renderer;
use crate::render::intersect::{Ready, TwoLevel};

/// Rays that a thread takes at once where there are several threads.
const PIECE: usize = 4096;

/// Rays that are asked before an interrupt is looked for.
const UNINTERRUPTED: usize = 1 << 18;

/// What hits are compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReferenceKind {
    /// The renderer's binary tree.
    Bvh2,
    /// A tree with larger boxes that culls nothing.
    Loose,
}

impl ReferenceKind {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Bvh2, Self::Loose];

    /// The name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bvh2 => "bvh2",
            Self::Loose => "loose",
        }
    }
}

/// What answers as hits are compared with, and what it is compared with itself.
pub struct Reference {
    renderer: Renderer,
    loose: Option<TwoLevel<Loose>>,
    linear: Renderer,
    /// Rays of each set that are compared with `linear`.
    pub checked_a_set: usize,
}

impl Reference {
    /// Builds a tree, and the list of all triangles that it is compared with on one ray a set.
    ///
    /// # Errors
    /// As [`Renderer::build`].
    pub fn build(scene: crate::scene::Scene, kind: ReferenceKind, progress: &dyn Progress) -> Result<Self> {
        let params = |kind| Params { kind, ..Params::default() };
        let build = |scene, kind| Renderer::build(scene, &params(kind), progress);
        let loose = match kind {
            ReferenceKind::Bvh2 => None,
            // Every instance is asked.
            ReferenceKind::Loose => Some(TwoLevel::build(&scene, &Ready::Nothing, &params(Kind::Linear), progress)?),
        };
        let linear = build(scene.clone(), Kind::Linear)?;
        Ok(Self { linear, loose, renderer: build(scene, Kind::Bvh2)?, checked_a_set: 1 })
    }

    /// The scene with the renderer's binary tree.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// What answers.
    fn contender(&self) -> (&dyn Contender, ReferenceKind) {
        match &self.loose {
            Some(loose) => (loose, ReferenceKind::Loose),
            None => (&self.renderer, ReferenceKind::Bvh2),
        }
    }

    /// How many rays of a set are compared with `linear`.
    pub fn checked_rays(&self, set: &RaySet) -> usize {
        set.rays.len().div_ceil(self.stride(set))
    }

    fn stride(&self, set: &RaySet) -> usize {
        set.rays.len().div_ceil(self.checked_a_set.max(1)).max(1)
    }

    /// The answers, a sample of which was compared with those of every triangle asked in turn.
    fn answers(&self, asked: &Asked<'_>, progress: &dyn Progress) -> Result<Answered> {
        let set = asked.set;
        let (contender, kind) = self.contender();
        let rays = set.rays.iter().step_by(self.stride(set)).copied().collect();
        let sample = RaySet { name: set.name.clone(), group: set.group, question: set.question, rays };
        let [own, every] = [contender, &self.linear].map(|asked| answers(asked, Calls::Single, &sample, progress));
        if let Some(number) = Differences::between(&every?, &own?, false).first {
            let ray = RayText::of(&sample.rays[number], asked.origin);
            let message = format!("{}: {} and linear differ on the ray {ray}", asked.model, kind.name());
            return Err(Error::limit(message).remedy("do not rely on this build"));
        }
        answers(contender, Calls::Single, set, progress)
    }
}

/// Boxes and triangles that a ray of a set is compared with: the means over some thousand of them, or as many as take a second.
fn mean_tests(contender: &dyn Contender, set: &RaySet, progress: &dyn Progress) -> Result<Option<[f64; 2]>> {
    const SAMPLE: usize = 10_000;
    const MOST_TRIANGLES: u64 = 50_000_000;
    let rays = set.rays.iter().step_by(set.rays.len().div_ceil(SAMPLE).max(1));
    let (mut boxes, mut triangles, mut count) = (0, 0, 0u64);
    for ray in rays {
        progress.check()?;
        let Some(tests) = contender.tests(ray, set.question == Question::Occluded) else { return Ok(None) };
        boxes += tests.boxes;
        triangles += tests.triangles;
        count += 1;
        if triangles > MOST_TRIANGLES {
            break;
        }
    }
    Ok(Some([boxes, triangles].map(|sum| sum as f64 / count.max(1) as f64)))
}

/// A set of rays of a model.
pub struct Asked<'a> {
    /// The rays.
    pub set: &'a RaySet,
    /// Where the camera stands.
    pub view: Option<View>,
    /// What the model is called.
    pub model: &'a str,
    /// The scene's origin in the file's coordinates.
    pub origin: DVec3,
}

/// Compares and times all contenders on a set of rays.
///
/// # Errors
/// A cancellation; a reference that is itself wrong; what cannot be written.
pub fn ask(
    entries: &[Entry],
    asked: &Asked<'_>,
    reference: &Reference,
    options: &Options,
    mut hits_out: Option<&mut HitsOut<'_>>,
    progress: &dyn Progress,
) -> Result<Vec<Row>> {
    let set = asked.set;
    let turns: Vec<Turn> = turns(entries, set, options);
    progress.begin("compare", (set.rays.len() * (turns.len() / options.threads.len() + 1)) as u64);
    let expected = reference.answers(asked, progress)?;
    let ray_set_hash = set.hash();
    let mut rows: Vec<Row> = Vec::new();
    for (number, entry) in entries.iter().enumerate() {
        let mut written = None;
        let tests = mean_tests(entry.contender.as_ref(), set, progress)?;
        for calls in Calls::ALL {
            let own: Vec<&Turn> = turns.iter().filter(|turn| turn.entry == number && turn.calls == calls).collect();
            if own.is_empty() {
                continue;
            }
            let found = answers(entry.contender.as_ref(), calls, set, progress)?;
            if let Some(out) = hits_out.as_deref_mut()
                && written.is_none()
            {
                let failed = |cause: std::io::Error| Error::new(Fault::System, cause.to_string());
                written = Some(out.append(&records(&found)).map_err(failed)?);
            }
            let differences = Differences::between(&expected, &found, entry.peer);
            let text = |ray: usize| RayText::of(&set.rays[ray], asked.origin).to_string();
            rows.extend(own.iter().map(|turn| Row {
                model: asked.model.into(),
                accelerator: entry.accelerator.clone(),
                preset: entry.preset,
                peer: entry.peer,
                view: asked.view,
                ray_kind: set.name.clone(),
                rays: set.rays.len(),
                ray_set_hash: ray_set_hash.clone(),
                calls,
                threads: turn.threads,
                mrays_per_s: None,
                spread: None,
                ratio_to_embree: None,
                boxes_per_ray: tests.map(|[boxes, _]| boxes),
                triangles_per_ray: tests.map(|[_, triangles]| triangles),
                hits: found.hits_in_first(set.rays.len()),
                hit_hash: found.hash(),
                differing: differences.count,
                other_triangle: entry.peer.then_some(differences.other_triangle),
                first_differing: differences.first.map(text),
                build_s: entry.build_s(turn.threads),
                bytes_per_triangle: entry.bytes_per_triangle,
                hits_at: written,
            }));
        }
    }
    // Rows come in the order of the turns.
    let speeds = time(entries, &turns, &rows, set, options, progress)?;
    for (row, speed) in rows.iter_mut().zip(&speeds) {
        row.mrays_per_s = speed.map(|rate| rate.value);
        row.spread = speed.map(|rate| (rate.high - rate.low) / rate.value);
    }
    let embree = |threads| {
        let mut own = rows.iter().filter(|row| row.accelerator == EMBREE && row.peer && row.threads == threads);
        own.find_map(|row| row.mrays_per_s)
    };
    let ratios: Vec<Option<f64>> = rows.iter().map(|row| Some(row.mrays_per_s? / embree(row.threads)?)).collect();
    rows.iter_mut().zip(ratios).for_each(|(row, ratio)| row.ratio_to_embree = ratio);
    Ok(rows)
}

/// What is timed once a round.
struct Turn {
    entry: usize,
    calls: Calls,
    threads: usize,
}

/// Every contender, way of calling and number of threads. Peers are left out where rays are not valid: what those are to
/// them is not defined.
fn turns(entries: &[Entry], set: &RaySet, options: &Options) -> Vec<Turn> {
    let valid = set.rays.iter().all(Ray::is_valid);
    let mut turns = Vec::new();
    for (number, entry) in entries.iter().enumerate().filter(|(_, entry)| valid || !entry.peer) {
        // A peer takes part whichever calls were chosen: it is what others are compared with.
        let chosen = |calls: &Calls| entry.peer || options.calls.contains(calls);
        for calls in Calls::ALL.into_iter().filter(|calls| entry.calls.contains(calls) && chosen(calls)) {
            turns.extend(options.threads.iter().map(|&threads| Turn { entry: number, calls, threads }));
        }
    }
    turns
}

/// Times all turns whose hits are those of the reference, one after the other in every round.
fn time(
    entries: &[Entry],
    turns: &[Turn],
    rows: &[Row],
    set: &RaySet,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Vec<Option<Median>>> {
    let fair = |row: &Row| row.peer || row.differing == 0;
    if options.rounds == 0 {
        return Ok(vec![None; turns.len()]);
    }
    progress.begin("time", u64::from(options.rounds + 1) * rows.iter().filter(|row| fair(row)).count() as u64);
    // One place for the answers of all: what was compared is not needed again, and caches are the same for everybody.
    let room = |question| if set.question == question { set.rays.len() } else { 0 };
    let hits = &RefCell::new(vec![Hit::MISS; room(Question::Closest)]);
    let flags = &RefCell::new(vec![false; room(Question::Occluded)]);
    let mut work: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for (turn, _) in turns.iter().zip(rows).filter(|(_, row)| fair(row)) {
        let contender = entries[turn.entry].contender.as_ref();
        let (calls, threads) = (turn.calls, turn.threads);
        work.push(match set.question {
            Question::Closest => Box::new(move || {
                let ask = |rays: &[Ray], hits: &mut [Hit]| contender.closest(calls, rays, hits);
                shared(threads, &set.rays, &mut hits.borrow_mut(), &ask);
            }),
            Question::Occluded => Box::new(move || {
                let ask = |rays: &[Ray], flags: &mut [bool]| contender.occluded(calls, rays, flags);
                shared(threads, &set.rays, &mut flags.borrow_mut(), &ask);
            }),
        });
    }
    let mut pieces: Vec<&mut dyn FnMut()> = Vec::new();
    for work in &mut work {
        pieces.push(work.as_mut());
    }
    let mut seconds = interleaved(&mut pieces, options.rounds, progress)?.into_iter();
    let rate = |seconds| millions_per_second(set.rays.len(), seconds);
    Ok(rows.iter().map(|row| if fair(row) { seconds.next().map(rate) } else { None }).collect())
}

/// Asks all rays with some threads: one call where it is one thread, else each takes the next piece when it is ready for it.
fn shared<T: Send>(threads: usize, rays: &[Ray], out: &mut [T], ask: &(impl Fn(&[Ray], &mut [T]) + Sync)) {
    if threads <= 1 {
        return ask(rays, out);
    }
    let pieces = Mutex::new(rays.chunks(PIECE).zip(out.chunks_mut(PIECE)));
    let next = || pieces.lock().unwrap_or_else(PoisonError::into_inner).next();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((rays, out)) = next() {
                    ask(rays, out);
                }
            });
        }
    });
}

/// The answers to a set, found by all threads.
fn answers(contender: &dyn Contender, calls: Calls, set: &RaySet, progress: &dyn Progress) -> Result<Answered> {
    let threads = rayon::current_num_threads();
    let mut answered = match set.question {
        Question::Closest => Answered::Closest(vec![Hit::MISS; set.rays.len()]),
        Question::Occluded => Answered::Occluded(vec![false; set.rays.len()]),
    };
    for (number, rays) in set.rays.chunks(UNINTERRUPTED).enumerate() {
        progress.check()?;
        let part = number * UNINTERRUPTED..number * UNINTERRUPTED + rays.len();
        match &mut answered {
            Answered::Closest(hits) => {
                shared(threads, rays, &mut hits[part], &|rays, hits| contender.closest(calls, rays, hits));
            }
            Answered::Occluded(flags) => {
                shared(threads, rays, &mut flags[part], &|rays, flags| contender.occluded(calls, rays, flags));
            }
        }
        progress.advance(rays.len() as u64);
    }
    Ok(answered)
}

/// Answers as `query` writes them in its binary format.
fn records(answered: &Answered) -> Vec<u8> {
    let writer = HitWriter::new(RecordFormat::F32, None);
    let mut bytes = Vec::new();
    match answered {
        Answered::Closest(hits) => hits.iter().for_each(|hit| writer.hit(hit, &mut bytes)),
        Answered::Occluded(flags) => flags.iter().for_each(|&flag| writer.occluded(flag, &mut bytes)),
    }
    bytes
}

/// How answers differ from those of the reference.
#[derive(Debug, PartialEq, Default)]
struct Differences {
    /// Records that differ in any bit; of a peer answers that differ in whether there is a hit.
    count: u64,
    /// The first of them.
    first: Option<usize>,
    /// Hits of both, of different triangles.
    other_triangle: u64,
}

impl Differences {
    fn between(expected: &Answered, found: &Answered, peer: bool) -> Self {
        let mut differences = Self::default();
        let mut add = |number: usize, differs: bool, other: bool| {
            if differs {
                differences.count += 1;
                differences.first.get_or_insert(number);
            }
            differences.other_triangle += u64::from(other);
        };
        match (expected, found) {
            (Answered::Closest(expected), Answered::Closest(found)) => {
                for (number, (a, b)) in expected.iter().zip(found).enumerate() {
                    let bits = bytemuck::bytes_of(a) != bytemuck::bytes_of(b);
                    let both = a.is_hit() && b.is_hit();
                    let other = both && (a.instance, a.primitive) != (b.instance, b.primitive);
                    add(number, if peer { a.is_hit() != b.is_hit() } else { bits }, other);
                }
            }
            (Answered::Occluded(expected), Answered::Occluded(found)) => {
                expected.iter().zip(found).enumerate().for_each(|(number, (a, b))| add(number, a != b, false));
            }
            _ => unreachable!("the same was asked"),
        }
        differences
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::cases::meshes;
    use crate::measure::ray_set::Group;
    use crate::progress::Silent;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn every_ray_is_asked_once_whatever_the_threads() {
        let rays: Vec<Ray> =
            (0..3 * PIECE + 17).map(|i| Ray::new(glam::Vec3::splat(i as f32), glam::Vec3::X)).collect();
        for threads in [1, 2, 5] {
            let calls = AtomicUsize::new(0);
            let mut out = vec![0.0; rays.len()];
            shared(threads, &rays, &mut out, &|rays, out| {
                calls.fetch_add(1, Ordering::Relaxed);
                rays.iter().zip(out).for_each(|(ray, out)| *out += ray.origin.x + 1.0);
            });
            assert!(out.iter().zip(&rays).all(|(out, ray)| *out == ray.origin.x + 1.0));
            assert_eq!(calls.into_inner(), if threads == 1 { 1 } else { 4 });
        }
    }

    /// Answers right, but for its last ray.
    struct Liar(Renderer);

    impl Contender for Liar {
        fn closest(&self, _: Calls, rays: &[Ray], hits: &mut [Hit]) {
            self.0.closest_batch(rays, hits);
            hits[rays.len() - 1].u += 0.25;
        }

        fn occluded(&self, _: Calls, rays: &[Ray], occluded: &mut [bool]) {
            self.0.occluded_batch(rays, occluded);
        }
    }

    #[test]
    fn what_answers_wrongly_is_found_out_and_not_timed() {
        let scene = meshes::scene(vec![meshes::sphere(6, 8, 1.0, DVec3::ZERO)]);
        let renderer = |kind| Renderer::build(scene.clone(), &Params { kind, ..Params::default() }, &Silent).unwrap();
        let entry = |contender| Entry {
            contender,
            accelerator: "it".into(),
            preset: "-",
            peer: false,
            calls: vec![Calls::Batch],
            builds: vec![(1, 0.5)],
            bytes_per_triangle: 1.0,
        };
        let entries = [entry(Box::new(Liar(renderer(Kind::Bvh2))) as _), entry(Box::new(renderer(Kind::CwBvh)) as _)];
        let reference = Reference::build(scene.clone(), ReferenceKind::Bvh2, &Silent).unwrap();
        let at = |x: f32| Ray::new(glam::Vec3::new(x, 0.1, 5.0), glam::Vec3::NEG_Z);
        let rays = vec![at(0.1), at(7.0), at(-0.2)];
        let set = RaySet { name: "few".into(), group: Group::Generic, question: Question::Closest, rays };
        let asked = Asked { set: &set, view: None, model: "ball", origin: DVec3::ZERO };
        let options = Options {
            structures: Vec::new(),
            kinds: Vec::new(),
            views: Vec::new(),
            rays: 1,
            linear_rays: None,
            calls: Calls::ALL.into(),
            threads: vec![1],
            rounds: 1,
            reference: ReferenceKind::Bvh2,
            #[cfg(feature = "embree")]
            embree: None,
        };
        let mut bytes = Vec::new();
        let mut out = HitsOut::new(&mut bytes);
        let rows = ask(&entries, &asked, &reference, &options, Some(&mut out), &Silent).unwrap();
        let [lie, truth] = rows.as_slice() else { panic!("{rows:?}") };
        assert_eq!((lie.differing, lie.hits, lie.mrays_per_s), (1, 2, None));
        assert!(lie.first_differing.as_ref().unwrap().starts_with("-0x1.99999ap-3 "), "{lie:?}");
        assert_eq!((truth.differing, &truth.first_differing, truth.build_s), (0, &None, 0.5));
        assert!(truth.mrays_per_s.unwrap() > 0.0 && truth.ratio_to_embree.is_none());
        assert_eq!((lie.hits_at, truth.hits_at, bytes.len()), (Some(0), Some(60), 120));
    }

    #[test]
    fn own_answers_are_compared_bit_by_bit_and_those_of_peers_by_what_is_hit() {
        let hit = Hit { t: 1.0, u: 0.25, v: 0.5, instance: 0, primitive: 3 };
        let expected = Answered::Closest(vec![hit, Hit::MISS, hit, hit]);
        let found =
            Answered::Closest(vec![hit, Hit::MISS, Hit { t: 1.0f32.next_up(), ..hit }, Hit { primitive: 4, ..hit }]);
        let own = Differences::between(&expected, &found, false);
        assert_eq!(own, Differences { count: 2, first: Some(2), other_triangle: 1 });
        let peer = Differences::between(&expected, &found, true);
        assert_eq!(peer, Differences { count: 0, first: None, other_triangle: 1 });
        let missed = Answered::Closest(vec![Hit::MISS; 4]);
        let peer = Differences::between(&expected, &missed, true);
        assert_eq!(peer, Differences { count: 3, first: Some(0), other_triangle: 0 });
        let flags = |yes: [bool; 2]| Answered::Occluded(yes.into());
        assert_eq!(Differences::between(&flags([true, false]), &flags([true, true]), false).first, Some(1));
    }
}
