//! Makes failures simpler: numbers of few digits close to zero show what goes wrong.

use glam::Vec3;

use crate::geometry::Ray;

/// A ray, and the triangle if one is to blame, with their numbers made as simple as they can be while `fails` holds.
///
/// Each coordinate in turn becomes 0, a whole number, or a number of fewer bits, nearer to zero, whichever is simplest; this
/// goes round until nothing changes. `fails` must hold for what is given, else that comes back as it is.
pub fn reduce(
    ray: Ray,
    triangle: Option<[Vec3; 3]>,
    fails: impl Fn(&Ray, Option<&[Vec3; 3]>) -> bool,
) -> (Ray, Option<[Vec3; 3]>) {
    let mut numbers: Vec<f32> = [ray.origin, ray.direction].iter().flat_map(|v| v.to_array()).collect();
    numbers.extend([ray.t_min, ray.t_max]);
    numbers.extend(triangle.iter().flatten().flat_map(|v| v.to_array()));
    let assemble = |numbers: &[f32]| {
        let vector = |at: usize| Vec3::from_slice(&numbers[at..]);
        let ray = Ray { origin: vector(0), direction: vector(3), t_min: numbers[6], t_max: numbers[7] };
        (ray, triangle.map(|_| [vector(8), vector(11), vector(14)]))
    };
    let still_fails = |numbers: &[f32]| {
        let (ray, triangle) = assemble(numbers);
        fails(&ray, triangle.as_ref())
    };
    if !still_fails(&numbers) {
        return (ray, triangle);
    }
    loop {
        let before = numbers.clone();
        for at in 0..numbers.len() {
            let old = numbers[at];
            let simpler = candidates(old).find(|&candidate| {
                numbers[at] = candidate;
                still_fails(&numbers)
            });
            numbers[at] = simpler.unwrap_or(old);
        }
        if numbers.iter().zip(&before).all(|(a, b)| a.to_bits() == b.to_bits()) {
            return assemble(&numbers);
        }
    }
}

/// Simpler numbers than `x`, simplest first, none of larger magnitude.
fn candidates(x: f32) -> impl Iterator<Item = f32> {
    let zero = (x.to_bits() << 1 != 0).then_some(0.0);
    let finite = x.is_finite();
    let one = (finite && x.abs() > 1.0).then(|| 1f32.copysign(x));
    // Cut after ever more bits of the mantissa.
    let cut = (0..23).rev().map(move |dropped| f32::from_bits(x.to_bits() >> (dropped + 1) << (dropped + 1)));
    zero.into_iter().chain(one).chain(cut.filter(move |c| finite && c.to_bits() != x.to_bits() && *c != 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_matter_becomes_zero_and_the_rest_short() {
        let ray =
            Ray { origin: Vec3::new(0.1, 0.7, -3.3), direction: Vec3::new(0.3, 5.123, 0.9), t_min: 0.5, t_max: 9.0 };
        let triangle = [Vec3::splat(0.123), Vec3::new(7.7, 1.1, 2.2), Vec3::new(-1.9, 4.4, 0.4)];
        // Fails where the direction climbs, the origin is left of 0.05's lower neighbours, and B lies beyond x = 5.
        let fails = |ray: &Ray, triangle: Option<&[Vec3; 3]>| {
            ray.direction.y > 0.0 && ray.origin.x > 0.05 && triangle.unwrap()[1].x > 5.0
        };
        let (ray, triangle) = reduce(ray, Some(triangle), fails);
        assert_eq!(ray.origin, Vec3::new(0.0625, 0.0, 0.0));
        assert_eq!(ray.direction, Vec3::Y);
        assert_eq!((ray.t_min, ray.t_max), (0.0, 0.0));
        assert_eq!(triangle.unwrap(), [Vec3::ZERO, Vec3::new(6.0, 0.0, 0.0), Vec3::ZERO]);
    }

    #[test]
    fn what_does_not_fail_stays() {
        let ray = Ray::new(Vec3::splat(0.3), Vec3::splat(f32::NAN));
        let (same, none) = reduce(ray, None, |_, _| false);
        assert!(same.origin == ray.origin && none.is_none());
    }
}
