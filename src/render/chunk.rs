//! Some rays as their crossings with boxes need them: number by number, in loops that become vectors.

use glam::Vec3;

use crate::geometry::ray::{Interval, padded};
use crate::geometry::{Bounds, Ray};
use crate::math::Transform;
use crate::math::simd::{Level, Task};

/// Rays that are asked together: what is prepared of them should stay in the nearest cache.
pub const CHUNK: usize = 256;

/// Loops go over whole rows of this many.
const ROW: usize = 16;

/// A number of each ray.
type Numbers = [f32; CHUNK];

/// Up to [`CHUNK`] rays. Those that can meet nothing have the numbers of another with an interval of t that is empty, and so has what
/// follows the last ray in its row.
pub struct Chunk {
    level: Level,
    /// Of whole rows, so many are used.
    lanes: usize,
    origin: [Numbers; 3],
    direction: [Numbers; 3],
    inverse: [Numbers; 3],
    inverse_far: [Numbers; 3],
    /// Intervals of t as [`PreparedRay`](crate::geometry::PreparedRay) has them.
    t_min: Numbers,
    t_max: Numbers,
    /// Per axis what all rays have in common, where they go to the same side of it.
    extremes: [Option<Extremes>; 3],
    /// The least t of all intervals, and the largest.
    ends: [f32; 2],
    /// The parts inside the box that was asked for last.
    near: Numbers,
    far: Numbers,
    /// Whether they meet what is in it, as 1 or 0.
    meets: [u32; CHUNK],
    /// Origins and directions in the object's space that was asked for last.
    moved: [[Numbers; 3]; 2],
}

/// The ends of the origins and inverses along an axis.
#[derive(Clone, Copy)]
struct Extremes {
    negative: bool,
    origin: [f32; 2],
    inverse: [f32; 2],
    inverse_far: [f32; 2],
}

impl Chunk {
    /// Without rays.
    pub fn new(level: Level) -> Box<Self> {
        let nothing = [0.0; CHUNK];
        Box::new(Self {
            level,
            lanes: 0,
            origin: [nothing; 3],
            direction: [nothing; 3],
            inverse: [nothing; 3],
            inverse_far: [nothing; 3],
            t_min: nothing,
            t_max: nothing,
            extremes: [None; 3],
            ends: [f32::INFINITY, f32::NEG_INFINITY],
            near: nothing,
            far: nothing,
            meets: [0; CHUNK],
            moved: [[nothing; 3]; 2],
        })
    }

    /// Takes other rays, at most [`CHUNK`]; false if none of them can meet anything.
    pub fn fill(&mut self, rays: &[Ray]) -> bool {
        self.level.run(Fill { chunk: self, rays })
    }

    /// Where any of the rays may enter a box at the earliest; `None` if none can meet what is in it.
    ///
    /// [`Bounds::interval`] is monotone in the origin and in the inverse, so that its ends for the extremes are ends for all rays.
    pub fn enters(&self, bounds: &Bounds) -> Option<f32> {
        let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
        for (axis, extremes) in self.extremes.iter().enumerate() {
            let Some(extremes) = extremes else { continue };
            let [least, most] = extremes.origin;
            let (enter, leave) = (bounds.min[axis], bounds.max[axis]);
            let (enter, leave) =
                if extremes.negative { (leave - least, enter - most) } else { (enter - most, leave - least) };
            let entry = (enter * extremes.inverse[0]).min(enter * extremes.inverse[1]);
            let exit = (leave * extremes.inverse_far[0]).max(leave * extremes.inverse_far[1]);
            near = if entry > near { entry } else { near };
            far = if exit < far { exit } else { far };
        }
        (near <= far && near <= self.ends[1] && far >= self.ends[0]).then_some(near)
    }

    /// The positions of the rays that meet what is in a box, or may meet anything where there is none; each with its
    /// [`Bounds::interval`].
    pub fn meeting(&mut self, bounds: Option<&Bounds>) -> impl Iterator<Item = (usize, Interval)> + '_ {
        self.level.run(Cross { chunk: self, bounds });
        let meets = self.meets[..self.lanes].iter().enumerate().filter(|(_, meets)| **meets != 0);
        meets.map(|(at, _)| (at, Interval { near: self.near[at], far: self.far[at] }))
    }

    /// Brings all rays into an object's space, and gives origin and direction of the one at a position; each is rounded once.
    pub fn local<'a>(&'a mut self, transform: &Transform) -> impl Fn(usize) -> (Vec3, Vec3) + use<'a> {
        self.level.run(Move { chunk: self, transform });
        let moved = &self.moved;
        move |at| (Vec3::from_array(by_number(&moved[0], at)), Vec3::from_array(by_number(&moved[1], at)))
    }
}

struct Fill<'a, 'b> {
    chunk: &'a mut Chunk,
    rays: &'b [Ray],
}

impl Task for Fill<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Self { chunk, rays } = self;
        assert!(rays.len() <= CHUNK, "no more rays than a chunk holds");
        let lanes = rays.len().next_multiple_of(ROW);
        for (at, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                chunk.origin[axis][at] = ray.origin[axis];
                chunk.direction[axis][at] = ray.direction[axis];
            }
            chunk.t_min[at] = ray.t_min;
            chunk.t_max[at] = ray.t_max;
        }
        let mut valid = [0u32; CHUNK];
        let mut most = 0;
        for at in 0..rays.len() {
            let (origin, direction) = (by_number(&chunk.origin, at), by_number(&chunk.direction, at));
            let is_valid = is_valid(origin, direction, chunk.t_min[at], chunk.t_max[at]);
            valid[at] = u32::from(is_valid);
            most += valid[at];
            chunk.t_min[at] = if chunk.t_min[at] > 0.0 { chunk.t_min[at] } else { 0.0 };
        }
        if (most as usize) < lanes {
            let Some(first) = valid.iter().position(|&valid| valid != 0) else { return false };
            for at in (0..lanes).filter(|&at| valid[at] == 0) {
                for axis in 0..3 {
                    chunk.origin[axis][at] = chunk.origin[axis][first];
                    chunk.direction[axis][at] = chunk.direction[axis][first];
                }
                // Not even what has no ends meets this, and it is no end of the intervals.
                (chunk.t_min[at], chunk.t_max[at]) = (f32::INFINITY, f32::NAN);
            }
        }
        for axis in 0..3 {
            for at in 0..lanes {
                let inverse = 1.0 / chunk.direction[axis][at];
                chunk.inverse[axis][at] = inverse;
                chunk.inverse_far[axis][at] = padded(inverse);
            }
            let inverse = ends(&chunk.inverse[axis][..lanes]);
            let inverse_far = ends(&chunk.inverse_far[axis][..lanes]);
            // Infinite where a ray runs parallel: then a product may be NaN.
            let [least, most] = inverse_far;
            let alike = (least > 0.0) == (most > 0.0) && least.is_finite() && most.is_finite();
            let origin = ends(&chunk.origin[axis][..lanes]);
            chunk.extremes[axis] = alike.then_some(Extremes { negative: most < 0.0, origin, inverse, inverse_far });
        }
        chunk.ends = [ends(&chunk.t_min[..lanes])[0], ends(&chunk.t_max[..lanes])[1]];
        chunk.lanes = lanes;
        true
    }
}

#[inline(always)]
fn by_number(numbers: &[Numbers; 3], at: usize) -> [f32; 3] {
    [numbers[0][at], numbers[1][at], numbers[2][at]]
}

/// [`Ray::is_valid`], without a branch.
#[inline(always)]
fn is_valid(origin: [f32; 3], direction: [f32; 3], t_min: f32, t_max: f32) -> bool {
    let (mut finite, mut nonzero) = (true, false);
    for axis in 0..3 {
        finite &= (origin[axis].abs() <= f32::MAX) & (direction[axis].abs() <= f32::MAX);
        nonzero |= direction[axis] != 0.0;
    }
    finite & nonzero & (t_min <= t_max) & (t_max >= 0.0)
}

/// The least of whole rows and the largest.
#[inline(always)]
fn ends(numbers: &[f32]) -> [f32; 2] {
    let (mut least, mut most) = ([f32::INFINITY; ROW], [f32::NEG_INFINITY; ROW]);
    for row in numbers.as_chunks::<ROW>().0 {
        for lane in 0..ROW {
            let number = row[lane];
            least[lane] = if number < least[lane] { number } else { least[lane] };
            most[lane] = if number > most[lane] { number } else { most[lane] };
        }
    }
    let mut ends = [f32::INFINITY, f32::NEG_INFINITY];
    for (least, most) in least.into_iter().zip(most) {
        ends = [if least < ends[0] { least } else { ends[0] }, if most > ends[1] { most } else { ends[1] }];
    }
    ends
}

struct Move<'a> {
    chunk: &'a mut Chunk,
    transform: &'a Transform,
}

impl Task for Move<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Chunk { lanes, origin, direction, moved, .. } = self.chunk;
        bring(*lanes, self.transform, origin, direction, moved);
    }
}

#[inline(always)]
fn bring(
    lanes: usize,
    transform: &Transform,
    origin: &[Numbers; 3],
    direction: &[Numbers; 3],
    moved: &mut [[Numbers; 3]; 2],
) {
    for at in 0..lanes.min(CHUNK) {
        let of = |numbers: [f32; 3]| Vec3::from_array(numbers).as_dvec3();
        let start = transform.point_to_object(of(by_number(origin, at))).as_vec3();
        let way = transform.vector_to_object(of(by_number(direction, at))).as_vec3();
        (moved[0][0][at], moved[0][1][at], moved[0][2][at]) = (start.x, start.y, start.z);
        (moved[1][0][at], moved[1][1][at], moved[1][2][at]) = (way.x, way.y, way.z);
    }
}

struct Cross<'a> {
    chunk: &'a mut Chunk,
    bounds: Option<&'a Bounds>,
}

impl Task for Cross<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { chunk, bounds } = self;
        let lanes = chunk.lanes.min(CHUNK);
        for at in 0..lanes {
            let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
            if let Some(bounds) = bounds {
                for axis in 0..3 {
                    let (min, max) = (bounds.min[axis], bounds.max[axis]);
                    let (origin, inverse) = (chunk.origin[axis][at], chunk.inverse[axis][at]);
                    let negative = inverse.is_sign_negative();
                    let t_entry = (if negative { max } else { min } - origin) * inverse;
                    let t_exit = (if negative { min } else { max } - origin) * chunk.inverse_far[axis][at];
                    near = if t_entry > near { t_entry } else { near };
                    far = if t_exit < far { t_exit } else { far };
                }
            }
            chunk.near[at] = near;
            chunk.far[at] = far;
            chunk.meets[at] = u32::from((near <= far) & (near <= chunk.t_max[at]) & (far >= chunk.t_min[at]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PreparedRay;
    use crate::math::random::Random;
    use glam::DVec3;

    /// Rays from about one place to about another; of some chunks one runs along an axis, or meets nothing.
    fn rays(random: &mut Random, chunk: usize) -> Vec<Ray> {
        let (origin, target, spread) = (random.in_cube() * 3.0, random.in_cube(), random.unit());
        let mut rays: Vec<Ray> = (0..CHUNK - chunk % 7)
            .map(|_| {
                let start = origin + random.in_cube() * (0.1 * spread);
                let ray = Ray::new(start.as_vec3(), (target + random.in_cube() * spread - start).as_vec3());
                Ray { t_min: random.unit() as f32 * 0.1, t_max: random.between(0.2, 2.0) as f32, ..ray }
            })
            .collect();
        match chunk % 4 {
            0 => rays[3].direction[chunk % 3] = [0.0, -0.0][chunk / 3 % 2],
            1 => rays[5 * (chunk % 8 / 4)].direction = Vec3::ZERO,
            _ => {}
        }
        rays
    }

    #[test]
    fn chunks_cross_boxes_as_their_rays_do() {
        for level in Level::available() {
            let mut random = Random::new(8, 0x2b);
            let (mut passed_by, mut met) = (0, 0);
            let mut chunk = Chunk::new(level);
            for number in 0..400 {
                let rays = rays(&mut random, number);
                assert!(chunk.fill(&rays));
                let (corner, size) = (random.in_cube() * 1.5, random.in_cube().abs());
                let flat = if number % 5 == 0 { 0.0 } else { 1.0 };
                let bounds = Bounds::of([corner.as_vec3(), (corner + size * DVec3::new(1.0, flat, 1.0)).as_vec3()]);
                let enters = chunk.enters(&bounds);
                let mut meeting = chunk.meeting(Some(&bounds));
                for (at, ray) in rays.iter().enumerate() {
                    let Some(ray) = PreparedRay::new(ray) else { continue };
                    let expected = bounds.interval(&ray, f32::NEG_INFINITY, f32::INFINITY);
                    if !expected.is_empty() && expected.near <= ray.t_max && expected.far >= ray.t_min {
                        assert_eq!(meeting.next(), Some((at, expected)));
                        assert!(enters.is_some_and(|near| near <= expected.near), "chunk {number}, ray {at}");
                        met += 1;
                    }
                }
                assert_eq!(meeting.next(), None);
                drop(meeting);
                passed_by += usize::from(enters.is_none());
                let valid = rays.iter().filter(|ray| PreparedRay::new(ray).is_some()).count();
                assert_eq!(chunk.meeting(None).count(), valid);
            }
            assert!(passed_by > 50 && met > 1000, "{passed_by} chunks pass by, {met} rays meet");
            assert!(!chunk.fill(&[Ray::new(Vec3::ZERO, Vec3::ZERO); 3]));
        }
    }
}
