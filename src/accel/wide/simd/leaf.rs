//! The triangles of a leaf, up to eight at once.

use std::mem::MaybeUninit;

use glam::Vec3A;

use super::super::node::WIDTH;
use super::Lanes;
use super::single::Query;
use crate::geometry::PreparedRay;
use crate::geometry::triangle::{Sheared, decide};
use crate::math::float::UNIT_ROUNDOFF;

/// Meets a ray with the triangles of a leaf; true ends the search.
///
/// The vectors do what [`intersect_triangle`](crate::geometry::intersect_triangle) does first, up to the signs of the edge
/// functions in f32, which only ever tell what is missed; what they leave is decided one by one.
///
/// # Safety
/// The processor has the instructions of `L`, and `numbers` is a leaf of `count` triangles, [laid
/// out](super::super::leaf::Leaves::laid_out).
#[inline(always)]
pub unsafe fn meet_leaf<L: Lanes, Q: Query>(
    numbers: *const f32,
    count: usize,
    ray: &PreparedRay,
    query: &mut Q,
) -> bool {
    unsafe {
        let [kx, ky, kz] = ray.axes;
        let origin: *const f32 = (&raw const ray.origin).cast();
        let (ox, oy, oz) = (L::splat(*origin.add(kx)), L::splat(*origin.add(ky)), L::splat(*origin.add(kz)));
        let (sx, sy) = (L::splat(ray.shear.x), L::splat(ray.shear.y));
        let mut sheared = [[L::splat(0.0); 3]; 3];
        for (corner, sheared) in sheared.iter_mut().enumerate() {
            let run = numbers.add(3 * corner * count);
            let along = L::sub(L::load(run.add(kz * count)), oz);
            let x = L::sub(L::load(run.add(kx * count)), ox);
            let y = L::sub(L::load(run.add(ky * count)), oy);
            *sheared = [L::sub(x, L::mul(sx, along)), L::sub(y, L::mul(sy, along)), along];
        }
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = sheared;
        let weight_a = L::sub(L::mul(cx, by), L::mul(cy, bx));
        let weight_b = L::sub(L::mul(ax, cy), L::mul(ay, cx));
        let weight_c = L::sub(L::mul(bx, ay), L::mul(by, ax));
        let weights = [weight_a, weight_b, weight_c];
        let zero = L::splat(0.0);
        // One of the operands, so that what is below 0 is a weight's, though not each NaN is passed on.
        let least = L::lesser(L::lesser(weight_a, weight_b), weight_c);
        let most = L::greater(L::greater(weight_a, weight_b), weight_c);
        let both_signs = L::less(least, zero) & L::less(zero, most);
        let mut left = !both_signs & ((1 << count) - 1);
        if left == 0 {
            return false;
        }
        if ray.starts_at_origin() {
            left &= !behind::<L>(&sheared, weights, ray.direction[kz]);
            if left == 0 {
                return false;
            }
        }
        let mut columns = MaybeUninit::<[[f32; WIDTH]; 9]>::uninit();
        let column: *mut f32 = columns.as_mut_ptr().cast();
        for (corner, parts) in sheared.into_iter().enumerate() {
            for (part, vector) in parts.into_iter().enumerate() {
                L::store(column.add((3 * part + corner) * WIDTH), vector);
            }
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let part = |number: usize| {
                let first = column.add(3 * number * WIDTH + lane);
                // Volatile, since a wide load across what was just stored in parts would wait for all of it.
                [first, first.add(WIDTH), first.add(2 * WIDTH)].map(|number| number.read_volatile())
            };
            let sheared = Sheared { x: part(0), y: part(1), z: part(2) };
            let corner = |number: usize| {
                let first = numbers.add(3 * number * count + lane);
                Vec3A::new(*first, *first.add(count), *first.add(2 * count))
            };
            if let Some(hit) = decide(ray, [corner(0), corner(1), corner(2)], &sheared) {
                let primitive = (*numbers.add(9 * count + lane)).to_bits();
                if query.offer(hit, primitive) {
                    return true;
                }
            }
        }
        false
    }
}

/// A bit for each triangle that [`decide`] would certainly put before the ray's origin, if it did not sort it out before. Most
/// rays start on a triangle.
///
/// The sign of t is that of `N / (det d_z)` with `N` the sum of weights times z. Let M be the largest |x| and |y|, Z the
/// largest |z|. A weight, two products of at most M^2 and their difference, is off by 4 u M^2 at most in f32, each of the three
/// terms of N by 6 u M^2 Z, and N with its two sums by less than 32 u M^2 Z; the terms of 2^-100 and 2^-140 are for underflow.
/// The determinant has the sign of the weights that are not 0, or the ray passes by.
///
/// Where N in f32 is beyond 80 u M^2 Z, it is beyond 48 u M^2 Z without rounding, and `|t d_z|` beyond 8 u Z since |det| is at
/// most 6 M^2. Then the near end of the triangle's box is before the origin too, and t cannot be clamped past it: along z the
/// box begins before t does; along another axis the crossing is at `d t (1 + 3 u) + h`, where |h| is less than the box was
/// enlarged by or, where it is flat, at most `3 u e_z |d / d_z|`
/// ([`hit_bounds`](crate::geometry::triangle::hit_bounds)), and e_z is at most 2 Z.
#[inline(always)]
unsafe fn behind<L: Lanes>(sheared: &[[L::Vector; 3]; 3], weights: [L::Vector; 3], along: f32) -> u32 {
    unsafe {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = *sheared;
        let [wa, wb, wc] = weights;
        let sum = L::add(L::add(L::mul(wa, az), L::mul(wb, bz)), L::mul(wc, cz));
        let determinant = L::add(L::add(wa, wb), wc);
        let beside = L::greater(L::greater(L::abs(ax), L::abs(ay)), L::greater(L::abs(bx), L::abs(by)));
        let beside = L::greater(beside, L::greater(L::abs(cx), L::abs(cy)));
        let far = L::greater(L::greater(L::abs(az), L::abs(bz)), L::abs(cz));
        let area = L::add(L::mul(beside, beside), L::splat(TINY_AREA));
        let error = L::add(L::mul(L::mul(area, far), L::splat(80.0 * UNIT_ROUNDOFF as f32)), L::splat(TINY));
        let zero = L::splat(0.0);
        let (below, above) = (L::less(L::add(sum, error), zero), L::less(error, sum));
        let (negative, positive) = (L::less(determinant, zero), L::less(zero, determinant));
        if along > 0.0 { (below & positive) | (above & negative) } else { (above & positive) | (below & negative) }
    }
}

/// 2^-100
const TINY_AREA: f32 = f32::from_bits((127 - 100) << 23);

/// 2^-140
const TINY: f32 = f32::from_bits(1 << (149 - 140));
