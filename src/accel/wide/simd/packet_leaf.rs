//! The triangles of a leaf, one after the other, with the rays of a packet.
//!
//! Step by step what [`intersect_triangle`](crate::geometry::intersect_triangle) does, a lane a ray, in the same order of
//! operations, so that it gives the same bits.

use glam::Vec3;

use super::Rows;
use super::packet::Packet;
use crate::geometry::triangle::hit_bounds;

/// Meets some rays of a packet with the triangles of a leaf.
///
/// # Safety
/// The processor has the instructions of `L`, and `numbers` is a leaf of `count` triangles, [laid
/// out](super::super::leaf::Leaves::laid_out).
#[inline(always)]
pub unsafe fn meet<L: Rows, const ANY: bool>(
    numbers: *const f32,
    count: usize,
    packet: &mut Packet<'_, L>,
    mut lanes: u32,
) {
    unsafe {
        let [kx, ky, kz] = packet.axes;
        for triangle in 0..count {
            let coordinate = |corner: usize, axis: usize| *numbers.add((3 * corner + axis) * count + triangle);
            let origin_x = packet.origin[kx];
            let origin_y = packet.origin[ky];
            let origin_z = packet.origin[kz];
            let shear_x = packet.shear[0];
            let shear_y = packet.shear[1];
            // No closures around what becomes instructions: these might stay calls.
            let mut corners = [[origin_x; 3]; 3];
            for (corner, sheared) in corners.iter_mut().enumerate() {
                let along = L::row_sub(L::row(coordinate(corner, kz)), origin_z);
                let x = L::row_sub(L::row(coordinate(corner, kx)), origin_x);
                let y = L::row_sub(L::row(coordinate(corner, ky)), origin_y);
                *sheared =
                    [L::row_sub(x, L::row_mul(shear_x, along)), L::row_sub(y, L::row_mul(shear_y, along)), along];
            }
            let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = corners;
            let weight_a = L::row_sub(L::row_mul(cx, by), L::row_mul(cy, bx));
            let weight_b = L::row_sub(L::row_mul(ax, cy), L::row_mul(ay, cx));
            let weight_c = L::row_sub(L::row_mul(bx, ay), L::row_mul(by, ax));
            let zero = L::row(0.0);
            let least = L::row_lesser(L::row_lesser(weight_a, weight_b), weight_c);
            let most = L::row_greater(L::row_greater(weight_a, weight_b), weight_c);
            let left = lanes & !(L::row_less(least, zero) & L::row_less(zero, most));
            if left == 0 {
                continue;
            }
            let corner = |number: usize| Vec3::new(coordinate(number, 0), coordinate(number, 1), coordinate(number, 2));
            let primitive = (*numbers.add(9 * count + triangle)).to_bits();
            decide::<L, ANY>(packet, &corners, [corner(0), corner(1), corner(2)], left, primitive);
            if ANY {
                lanes &= packet.alive;
                if lanes == 0 {
                    return;
                }
            }
        }
    }
}

/// What [`decide`](crate::geometry::triangle::decide) does, for the rays that are `left`.
///
/// # Safety
/// The processor has the instructions of `L`.
#[inline(always)]
unsafe fn decide<L: Rows, const ANY: bool>(
    packet: &mut Packet<'_, L>,
    sheared: &[[L::Row; 3]; 3],
    corners: [Vec3; 3],
    left: u32,
    primitive: u32,
) {
    unsafe {
        let mut left = left;
        let infinity = L::double(f64::INFINITY);
        let zero = L::double(0.0);
        let along_row = packet.along;
        let nothing = L::splat(0.0);
        // Of the first eight rays and of the last.
        let mut found = [nothing; 2];
        let mut weights = [[zero; 3]; 2];
        for (half, found) in found.iter_mut().enumerate() {
            if left >> (8 * half) & 0xff == 0 {
                continue;
            }
            let mut wide = [[zero; 3]; 3];
            for corner in 0..3 {
                for part in 0..3 {
                    wide[corner][part] = L::widen(L::half(sheared[corner][part], half == 1));
                }
            }
            let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = wide;
            let weight_a = L::double_sub(L::double_mul(cx, by), L::double_mul(cy, bx));
            let weight_b = L::double_sub(L::double_mul(ax, cy), L::double_mul(ay, cx));
            let weight_c = L::double_sub(L::double_mul(bx, ay), L::double_mul(by, ax));
            let least = L::double_lesser(L::double_lesser(weight_a, weight_b), weight_c);
            let most = L::double_greater(L::double_greater(weight_a, weight_b), weight_c);
            let determinant = L::double_add(L::double_add(weight_a, weight_b), weight_c);
            let both_signs = L::double_less(least, zero) & L::double_less(zero, most);
            // Neither 0 nor NaN nor infinite.
            let negative =
                L::double_less(determinant, zero) & L::double_less(L::double_sub(zero, infinity), determinant);
            let positive = L::double_less(zero, determinant) & L::double_less(determinant, infinity);
            let meets = !both_signs & (negative | positive);
            left &= meets << (8 * half) | 0xff << (8 - 8 * half);
            let sum = L::double_add(L::double_mul(weight_a, az), L::double_mul(weight_b, bz));
            let sum = L::double_add(sum, L::double_mul(weight_c, cz));
            let t = L::double_div(sum, L::double_mul(determinant, L::widen(L::half(along_row, half == 1))));
            *found = L::narrow(t);
            weights[half] = [weight_b, weight_c, determinant];
        }
        if left == 0 {
            return;
        }
        let t = L::join(found[0], found[1]);

        // Keep t where the ray crosses the triangle's box, then where it crosses the instance's.
        let own = hit_bounds(corners);
        let mut near = L::row(f32::NEG_INFINITY);
        let mut far = L::row(f32::INFINITY);
        for axis in 0..3 {
            let (enter, leave) = packet.planes(axis, &own);
            let origin = packet.origin[axis];
            let inverse = packet.inverse[axis];
            let inverse_far = packet.inverse_far[axis];
            near = L::row_greater(L::row_mul(L::row_sub(origin, L::row(enter)), inverse), near);
            far = L::row_lesser(L::row_mul(L::row_sub(origin, L::row(leave)), inverse_far), far);
        }
        left &= L::row_at_most(near, far);
        let mut t = L::row_lesser(L::row_greater(t, near), far);
        if packet.is_clipped {
            let (near, far) = (packet.clip_near, packet.clip_far);
            t = L::row_lesser(L::row_greater(t, near), far);
        }
        let zero = L::row(0.0);
        let t = L::row_add(t, zero); // turns -0 into 0
        left &=
            L::row_at_most(packet.t_min, t) & L::row_at_most(t, packet.t_max) & L::row_less(t, L::row(f32::INFINITY));
        if ANY {
            packet.alive &= !left;
            return;
        }
        let best = packet.best_t;
        let mut better = left & L::row_less(t, best);
        let mut ties = left & L::row_at_most(t, best) & !better;
        while ties != 0 {
            let lane = ties.trailing_zeros() as usize;
            ties &= ties - 1;
            let first = (packet.instance, primitive) < packet.best_place(lane);
            better |= u32::from(first) << lane;
        }
        if better == 0 {
            return;
        }
        packet.best_t = L::row_select(better, best, t);
        for (half, (best, found)) in packet.best_weights.iter_mut().zip(weights).enumerate() {
            for (best, found) in best.iter_mut().zip(found) {
                *best = L::double_select(better >> (8 * half) & 0xff, *best, found);
            }
        }
        packet.unfinished |= better;
        packet.best_instance = L::row_select(better, packet.best_instance, L::row(f32::from_bits(packet.instance)));
        packet.best_primitive = L::row_select(better, packet.best_primitive, L::row(f32::from_bits(primitive)));
        packet.update_far();
    }
}
