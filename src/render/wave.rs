//! `Trace` and `Shade` for many rays at once, depth by depth: the frame loop's way.
//!
//! What the recursion of [`Tracer::trace`] does ray by ray is done here step by step for all rays of a batch, by the same
//! functions in the same order for each ray, so that colours are equal bit for bit: first hits, then light after light a batch of
//! shadow rays, then all reflected and refracted rays as the next batch. What these see is added on the way back, so that clamping
//! comes where it does in the recursion.

use std::borrow::Cow;

use crate::geometry::Hit;
use crate::math::lanes::{Flags, LANES, Numbers, Vectors, Vectors32, whole_rows};
use crate::math::simd::{Level, Task};
use crate::render::answers::{Answers, Meetings};
use crate::render::points::{Found, Points};
use crate::render::settings::ThreadSeconds;
use crate::render::shade::{diffused, glossy, r_dot_v, reflect_all};
use crate::render::shadow::Illuminations;
use crate::render::trace::{TracedRay, Tracer, background};
use crate::scene::camera::ViewRay;
use crate::scene::{Material, Rgb, Scene, Shape, compiled};

/// Rays that are traced together. More make packets of rays that go alike, but what is known of them leaves the cache.
pub const LARGEST: usize = 1024;

/// Rays of a batch: in the precision of what answers them, and in f64 for shading.
struct Rays<R> {
    rays: Vec<R>,
    views: Vec<ViewRay>,
}

/// Hits that are being shaded.
struct Block {
    found: Found,
    /// The hits' instance; [`MIXED`] if they have several, or one that is no mesh.
    instance: u32,
    points: Points,
    /// Od.
    diffuse: Vectors32,
    /// What has been summed up.
    color: Vectors32,
    /// Whether a material has a highlight.
    is_glossy: bool,
    /// Whether a material reflects or lets light through.
    goes_on: bool,
    /// Whether a material absorbs light inside.
    absorbs: bool,
    /// The terms of those materials that differ from point to point: their numbers follow those of the scene's.
    local: Vec<Material>,
}

const MIXED: u32 = u32::MAX;

/// Once a batch has so many blocks, twice those that its rays fill, what hits other instances goes to the mixed one, so that many
/// instances do not each make a block.
const MOST_BLOCKS: usize = 2 * LARGEST / LANES;

/// What a ray's colour still lacks.
struct Pending {
    ray: u32,
    kr: Rgb,
    kt: Rgb,
    /// What is left of all at the end of the ray's way.
    left: Rgb,
    /// Positions among the rays of the next depth.
    reflected: Option<u32>,
    transmitted: Option<u32>,
}

impl<I: Answers> Tracer<'_, I> {
    /// [`trace_camera`](Self::trace_camera) for each ray: what it sees and what it hit.
    pub fn trace_cameras(&self, views: Vec<ViewRay>) -> (Vec<Rgb>, Vec<Hit>) {
        self.count(|counts| counts.camera += views.len() as u64);
        // Traversal is timed within.
        let before = self.seconds().traversal;
        let all = |seconds: &mut ThreadSeconds, all: f64| seconds.shading += all - (seconds.traversal - before);
        self.timed(all, || {
            let mut rays = Vec::with_capacity(views.len());
            for view in &views {
                rays.push(self.intersect.camera_ray(view));
            }
            self.trace_wave(Rays { rays, views }, 0)
        })
    }

    fn trace_all(&self, all: Rays<I::Ray>, depth: u32) -> Vec<Rgb> {
        if all.rays.len() <= LARGEST {
            return self.trace_wave(all, depth).0;
        }
        let mut colors = Vec::with_capacity(all.rays.len());
        for (rays, views) in all.rays.chunks(LARGEST).zip(all.views.chunks(LARGEST)) {
            colors.extend(self.trace_wave(Rays { rays: rays.into(), views: views.into() }, depth).0);
        }
        colors
    }

    /// The colours that rays see, and what they hit first.
    fn trace_wave(&self, traced: Rays<I::Ray>, depth: u32) -> (Vec<Rgb>, Vec<Hit>) {
        let mut hits = vec![Hit::MISS; traced.rays.len()];
        self.timed(traversal, || self.intersect.first_hits(&traced.rays, &mut hits));
        if self.world.has_holes {
            for ((hit, ray), view) in hits.iter_mut().zip(&traced.rays).zip(&traced.views) {
                *hit = self.beyond_holes(ray, view.direction, *hit, |_| ());
            }
        }
        let mut colors = vec![Rgb::ZERO; hits.len()];
        let mut blocks = Blocks::default();
        for (number, (hit, color)) in hits.iter().zip(&mut colors).enumerate() {
            if hit.is_hit() {
                let is_mesh = matches!(self.world.instances[hit.instance as usize].shape, Shape::Mesh(_));
                blocks.push(if is_mesh { hit.instance } else { MIXED }, number as u32, *hit);
            } else {
                *color = background(&self.scene.background, traced.views[number].direction);
            }
        }
        let mut blocks = blocks.all;
        for block in &mut blocks {
            self.meet_all(&traced, block, &mut hits);
            self.color_all(block);
        }
        self.add_lights(&traced.views, &mut blocks);

        // Mirror and transmission.
        let mut next = Rays { rays: Vec::new(), views: Vec::new() };
        let mut pending = Vec::new();
        let deeper = depth < self.scene.film.max_depth;
        for block in &blocks {
            let meetings = block.meetings(&traced.views);
            if !(deeper && block.goes_on) {
                for (at, &ray) in block.found.rays[..block.found.count].iter().enumerate() {
                    colors[ray as usize] = self.clamp(block.color.get(at) * self.left(block, at, &traced.views));
                }
                continue;
            }
            // Those that are reflected are the next, in order.
            let mut reflected = next.rays.len() as u32;
            let reflects = self.reflect_block(block, &meetings, &mut next);
            for at in 0..block.found.count {
                let (ray, color) = (block.found.rays[at], block.color.get(at));
                let material = block.material(self.scene, at);
                let left = self.left(block, at, &traced.views);
                let reflects = reflects[at] != 0;
                let transmits = !self.is_opaque() && material.is_transmissive();
                if !reflects && !transmits {
                    colors[ray as usize] = self.clamp(color * left);
                    continue;
                }
                colors[ray as usize] = color;
                let transmitted =
                    transmits.then(|| next.push(meetings.with(at, |here| self.transmitted(here, material))));
                let (kr, kt) = (material.kr, material.kt);
                pending.push(Pending { ray, kr, kt, left, reflected: reflects.then_some(reflected), transmitted });
                reflected += u32::from(reflects);
            }
        }
        // The deepest recursion has this batch's colours and hits on every level, but not the rest.
        drop((traced, blocks));
        if !pending.is_empty() {
            let seen = self.trace_all(next, depth + 1);
            for one in pending {
                let color = &mut colors[one.ray as usize];
                if let Some(at) = one.reflected {
                    *color += one.kr * seen[at as usize];
                }
                if let Some(at) = one.transmitted {
                    *color += one.kt * seen[at as usize];
                }
                *color = self.clamp(*color * one.left);
            }
        }
        (colors, hits)
    }

    /// Out of line, as the next ones, since the deepest recursion must not have their arrays on every level. Finds the points of a
    /// block's hits, and corrects hits behind which a ray came in.
    #[inline(never)]
    fn meet_all(&self, traced: &Rays<I::Ray>, block: &mut Block, hits: &mut [Hit]) {
        let Block { found, points, .. } = block;
        if block.instance == MIXED {
            points.solve_each(self.scene, self.world, &traced.views, found);
        } else {
            points.solve(Level::chosen(), self.scene, self.world, &traced.views, found);
        }
        for at in 0..found.count {
            if points.from_outside[at] == 0 {
                let number = found.rays[at] as usize;
                let ray = TracedRay { ray: traced.rays[number], view: traced.views[number] };
                if let Some((hit, point)) = self.entry_before(&ray, &found.hits[at], &points.get(at)) {
                    (found.hits[at], hits[number]) = (hit, hit);
                    points.set(at, &point);
                }
            }
        }
    }

    /// Looks up the colours of a block's points.
    fn color_all(&self, block: &mut Block) {
        // Neighbours have the same material most of the time, and without an image the same colours.
        let mut last = None;
        for at in 0..block.found.count {
            let number = block.points.materials[at];
            let detailed = self.is_detailed(&self.scene.materials[number as usize], &block.found.hits[at]);
            let colors = match last {
                Some((same, colors)) if same == number && !detailed => colors,
                _ => {
                    let (point, hit) = (block.points.get(at), block.found.hits[at]);
                    let terms = self.terms(&point, &hit);
                    block.is_glossy |= terms.ks != Rgb::ZERO;
                    block.goes_on |= terms.is_reflective() || terms.is_transmissive();
                    block.absorbs |= terms.is_absorbing();
                    let colors = self.material_colors(&terms, || (point, hit));
                    last = (!detailed && terms.diffuse_texture.is_none()).then_some((number, colors));
                    if let Cow::Owned(terms) = terms {
                        block.points.materials[at] = (self.scene.materials.len() + block.local.len()) as u32;
                        block.local.push(terms);
                    }
                    colors
                }
            };
            block.color.set(at, colors.own());
            block.diffuse.set(at, colors.diffuse);
        }
    }

    /// What is left of the colour of a block's point at the end of its ray's way; 1 where nothing absorbs.
    #[inline(always)]
    fn left(&self, block: &Block, at: usize, views: &[ViewRay]) -> Rgb {
        if !block.absorbs {
            return Rgb::ONE;
        }
        let view = &views[block.found.rays[at] as usize];
        self.way_inside(block.material(self.scene, at), &block.points.get(at), view).map_or(Rgb::ONE, |(_, left)| left)
    }

    /// Adds the mirror rays of a block's points to the next rays, and tells which have one.
    #[inline(never)]
    fn reflect_block(&self, block: &Block, meetings: &Meetings<'_>, next: &mut Rays<I::Ray>) -> Flags {
        let mut reflects = [0; LANES];
        let count = block.found.count;
        let mut any = false;
        for (at, flag) in reflects[..count].iter_mut().enumerate() {
            let reflective = compiled::REFLECTION && block.material(self.scene, at).is_reflective();
            *flag = u32::from(reflective);
            any |= reflective;
        }
        if any {
            let mut directions = Vectors::ZERO;
            reflect_all(Level::chosen(), &block.points, count, &mut directions);
            self.intersect.rays_outside(meetings, &directions, &reflects, &mut next.rays);
            let chosen = (0..count).filter(|&at| reflects[at] != 0);
            let before = next.views.len();
            let view = |at| ViewRay { origin: block.points.position.get(at), direction: directions.get(at) };
            next.views.extend(chosen.map(view));
            self.count(|counts| counts.reflected += (next.views.len() - before) as u64);
        }
        reflects
    }

    /// Adds each light's diffuse and specular terms where it is seen.
    #[inline(never)]
    fn add_lights(&self, views: &[ViewRay], blocks: &mut [Block]) {
        let mut illuminations = Vec::new();
        illuminations.resize_with(blocks.len(), || Illuminations::NONE);
        let mut rays = Vec::new();
        let mut blocked = Vec::new();
        for light in self.lights() {
            rays.clear();
            for (block, illuminations) in blocks.iter().zip(&mut illuminations) {
                illuminations.find(Level::chosen(), light, &block.points, block.found.count);
                self.intersect.shadow_rays(&block.meetings(views), illuminations, &mut rays);
            }
            self.count(|counts| counts.shadow += rays.len() as u64);
            blocked.clear();
            blocked.resize(rays.len(), false);
            self.timed(traversal, || self.intersect.are_blocked_by_opaque(&rays, &mut blocked));
            let mut answers = rays.iter().zip(&blocked);
            for (block, illuminations) in blocks.iter_mut().zip(&mut illuminations) {
                let count = block.found.count;
                for at in 0..count {
                    if illuminations.is_lit[at] == 0 {
                        continue;
                    }
                    let (ray, is_blocked) = answers.next().expect("one ray where there is light");
                    if *is_blocked {
                        // Until the next light is asked.
                        illuminations.is_lit[at] = 0;
                    } else if !self.is_opaque() {
                        self.add_through(ray, at, views, block, illuminations);
                    }
                }
                if self.is_opaque() {
                    self.add_light(block, illuminations);
                }
            }
        }
    }

    /// Adds the light of one lamp to a point from which nothing opaque hides it.
    fn add_through(&self, ray: &I::Ray, at: usize, views: &[ViewRay], block: &mut Block, from: &Illuminations) {
        let Some(illumination) = from.get(at) else { return };
        let (point, view) = (block.points.get(at), &views[block.found.rays[at] as usize]);
        let visible = self.visible_through(ray, &point, &illumination, &mut ());
        if visible != Rgb::ZERO {
            let material = block.material(self.scene, at);
            let more = self.lit(visible, &illumination, material, block.diffuse.get(at), &point, view);
            block.color.set(at, block.color.get(at) + more);
        }
    }

    /// Adds the light of one lamp to all points that it reaches, in a scene that lets no light through.
    fn add_light(&self, block: &mut Block, illuminations: &Illuminations) {
        let Block { found, points, diffuse, color, local, .. } = block;
        let lanes = whole_rows(found.count);
        if !block.is_glossy {
            return Level::chosen().run(AddLight::<false> {
                lanes,
                illuminations,
                diffuse,
                gloss: &Gloss::NONE,
                color,
            });
        }
        let mut gloss = Gloss::NONE;
        let mut r_dot_v = [0.0; LANES];
        Level::chosen().run(Mirrored { lanes, illuminations, points, r_dot_v: &mut r_dot_v });
        for at in (0..found.count).filter(|&at| illuminations.is_lit[at] != 0 && r_dot_v[at] > 0.0) {
            let material = material_of(self.scene, local, points.materials[at]);
            if material.ks != Rgb::ZERO {
                gloss.color.set(at, glossy(material, r_dot_v[at]));
                gloss.is_any[at] = 1;
            }
        }
        Level::chosen().run(AddLight::<true> { lanes, illuminations, diffuse, gloss: &gloss, color });
    }
}

/// Highlights of points.
struct Gloss {
    color: Vectors32,
    /// Where there is one.
    is_any: Flags,
}

impl Gloss {
    const NONE: Self = Self { color: Vectors32::ZERO, is_any: [0; LANES] };
}

/// Finds R.V.
struct Mirrored<'a> {
    lanes: usize,
    illuminations: &'a Illuminations,
    points: &'a Points,
    r_dot_v: &'a mut Numbers,
}

impl Task for Mirrored<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        mirror(self.lanes, self.illuminations, self.points, self.r_dot_v);
    }
}

#[inline(always)]
fn mirror(lanes: usize, illuminations: &Illuminations, points: &Points, to: &mut Numbers) {
    for at in 0..lanes.min(LANES) {
        let (n_dot_l, to_light) = (illuminations.n_dot_l[at], illuminations.to_light.get(at));
        to[at] = r_dot_v(n_dot_l, points.normal.get(at), to_light, points.direction.get(at));
    }
}

/// Adds light where there is any.
struct AddLight<'a, const GLOSSY: bool> {
    lanes: usize,
    illuminations: &'a Illuminations,
    diffuse: &'a Vectors32,
    gloss: &'a Gloss,
    color: &'a mut Vectors32,
}

impl<const GLOSSY: bool> Task for AddLight<'_, GLOSSY> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        add_light::<GLOSSY>(self.lanes, self.illuminations, self.diffuse, self.gloss, self.color);
    }
}

#[inline(always)]
fn add_light<const GLOSSY: bool>(
    lanes: usize,
    illuminations: &Illuminations,
    diffuse: &Vectors32,
    gloss: &Gloss,
    color: &mut Vectors32,
) {
    let pick = |choice: bool, yes: Rgb, no: Rgb| {
        let pick = |yes: f32, no: f32| if choice { yes } else { no };
        Rgb::new(pick(yes.x, no.x), pick(yes.y, no.y), pick(yes.z, no.z))
    };
    for at in 0..lanes.min(LANES) {
        let mut direct = diffused(diffuse.get(at), illuminations.n_dot_l[at]);
        if GLOSSY {
            direct = pick(gloss.is_any[at] != 0, direct + gloss.color.get(at), direct);
        }
        let before = color.get(at);
        let after = before + illuminations.color.get(at) * direct;
        color.set(at, pick(illuminations.is_lit[at] != 0, after, before));
    }
}

/// Blocks as hits are put into them.
#[derive(Default)]
struct Blocks {
    all: Vec<Block>,
    /// Of each key the position of the block that has room, or had.
    open: Vec<(u32, usize)>,
}

impl Blocks {
    /// Adds a hit to the block of its instance, or to the mixed one where many have blocks.
    #[inline(always)]
    fn push(&mut self, instance: u32, ray: u32, hit: Hit) {
        let block = match self.open.last() {
            // Most rays follow one that hit the same.
            Some(&(key, block)) if key == instance && !self.all[block].found.is_full() => block,
            _ => self.block_for(instance),
        };
        self.all[block].found.push(ray, hit);
    }

    /// A block with room, the last of the open ones afterwards.
    #[inline(never)]
    fn block_for(&mut self, instance: u32) -> usize {
        let find = |open: &[(u32, usize)], key: u32| open.iter().position(|(of, _)| *of == key);
        let (key, open) = match find(&self.open, instance) {
            None if self.all.len() >= MOST_BLOCKS => (MIXED, find(&self.open, MIXED)),
            found => (instance, found),
        };
        let block = open.map(|at| self.open.remove(at).1).filter(|&block| !self.all[block].found.is_full());
        let block = block.unwrap_or_else(|| {
            self.all.push(Block::new(key));
            self.all.len() - 1
        });
        self.open.push((key, block));
        block
    }
}

/// A material of the scene, or terms whose numbers follow theirs.
#[inline(always)]
fn material_of<'a>(scene: &'a Scene, local: &'a [Material], number: u32) -> &'a Material {
    let number = number as usize;
    scene.materials.get(number).unwrap_or_else(|| &local[number - scene.materials.len()])
}

fn traversal(seconds: &mut ThreadSeconds, spent: f64) {
    seconds.traversal += spent;
}

impl<R> Rays<R> {
    /// Adds a ray and returns its position.
    fn push(&mut self, ray: TracedRay<R>) -> u32 {
        self.rays.push(ray.ray);
        self.views.push(ray.view);
        self.rays.len() as u32 - 1
    }
}

impl Block {
    fn new(instance: u32) -> Self {
        let (diffuse, color) = (Vectors32::ZERO, Vectors32::ZERO);
        Self {
            found: Found::NONE,
            instance,
            points: Points::NONE,
            diffuse,
            color,
            is_glossy: false,
            goes_on: false,
            absorbs: false,
            local: Vec::new(),
        }
    }

    /// The material of a point, or its terms there.
    #[inline(always)]
    fn material<'a>(&'a self, scene: &'a Scene, at: usize) -> &'a Material {
        material_of(scene, &self.local, self.points.materials[at])
    }

    fn meetings<'a>(&'a self, views: &'a [ViewRay]) -> Meetings<'a> {
        Meetings { views, found: &self.found, points: &self.points }
    }
}
