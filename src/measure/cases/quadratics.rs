//! Quadratic equations: D30.

use std::cmp::Ordering;

use super::{Case, Context, Failure, Outcome};
use crate::error::Result;
use crate::math::quadratic::{Roots, solve};
use crate::measure::dyadic::Dyadic;

/// The cases of this file.
pub const CASES: &[Case] = &[Case {
    id: "D30",
    title: "a t^2 + 2 b t + c: degenerate coefficients, and tangents to the last bit",
    bar: "roots to 4 ulp of f64, no wrong sign of a discriminant, no NaN",
    run: quadratic_roots,
}];

/// The quadratic at t, exact.
fn at([a, b, c]: &[Dyadic; 3], t: f64) -> Dyadic {
    let t = Dyadic::new(t);
    (a * &t + b.scaled(1)) * t + c.clone()
}

/// Half its slope at t, exact.
fn slope([a, b, _]: &[Dyadic; 3], t: f64) -> Dyadic {
    a * &Dyadic::new(t) + b.clone()
}

/// The f64 `steps` above, or below.
fn beside(t: f64, steps: i32) -> f64 {
    (0..steps.abs()).fold(t, |t, _| if steps > 0 { t.next_up() } else { t.next_down() })
}

/// Whether a true root lies within 4 ulp: the quadratic, or between a pair of roots its slope, changes sign there.
fn brackets(exact: &[Dyadic; 3], t: f64) -> bool {
    let changes = |low: Ordering, high: Ordering| low != high || low == Ordering::Equal;
    let (low, high) = (beside(t, -4), beside(t, 4));
    if !(low.is_finite() && high.is_finite()) {
        return false;
    }
    changes(at(exact, low).sign(), at(exact, high).sign())
        || changes(slope(exact, low).sign(), slope(exact, high).sign())
}

fn check_roots([a, b, c]: [f64; 3], outcome: &mut Outcome) {
    let exact = [a, b, c].map(Dyadic::new);
    let discriminant = (&exact[1] * &exact[1] - &exact[0] * &exact[2]).sign();
    let roots = solve(a, b, c);
    let right = match roots {
        Roots::None if a == 0.0 => b == 0.0,
        Roots::None => discriminant == Ordering::Less,
        Roots::One(t) if a == 0.0 => b != 0.0 && brackets(&exact, t),
        // A tangent, or two roots that are one f64, or of which one is beyond f64.
        Roots::One(t) => discriminant != Ordering::Less && brackets(&exact, t),
        Roots::Two(s, t) => discriminant == Ordering::Greater && s < t && brackets(&exact, s) && brackets(&exact, t),
    };
    outcome.check(right, || {
        Failure::text(format!("{a:e} t^2 + 2 ({b:e}) t + {c:e} (discriminant {discriminant:?} than 0) gave {roots:?}"))
    });
}

fn quadratic_roots(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let expected = [
        ([1e-17, 1.0, -1.0], Roots::Two(-2e17, 0.5)),
        ([0.0, 1.0, -1.0], Roots::One(0.5)),
        ([0.0, 0.0, 1.0], Roots::None),
        ([0.0, 0.0, 0.0], Roots::None),
        ([1.0, 0.0, 0.0], Roots::One(0.0)),
        ([1.0, 0.0, -4.0], Roots::Two(-2.0, 2.0)),
        ([-1.0, 0.0, 4.0], Roots::Two(-2.0, 2.0)),
        ([1.0, -1.0, 1.0], Roots::One(1.0)),
        ([1.0, 1.0, 0.0], Roots::Two(-2.0, 0.0)),
        ([1.0, 0.0, 4.0], Roots::None),
    ];
    for (coefficients, roots) in expected {
        let [a, b, c] = coefficients;
        let found = solve(a, b, c);
        let near = |s: f64, t: f64| (s - t).abs() <= 4.0 * f64::EPSILON * t.abs();
        let same = match (found, roots) {
            (Roots::None, Roots::None) => true,
            (Roots::One(s), Roots::One(t)) => near(s, t),
            (Roots::Two(s, t), Roots::Two(u, v)) => near(s, u) && near(t, v),
            _ => false,
        };
        sum.check(same, || Failure::text(format!("{coefficients:?} gave {found:?}, not {roots:?}")));
        if roots != Roots::None {
            check_roots(coefficients, &mut sum);
        }
    }
    for position in 0..3 {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut k = [1.0, 2.0, -3.0];
            k[position] = bad;
            let found = solve(k[0], k[1], k[2]);
            let number = match found {
                Roots::None => true,
                Roots::One(t) => t.is_finite(),
                Roots::Two(s, t) => s.is_finite() && t.is_finite(),
            };
            sum.check(number, || Failure::text(format!("{k:?} gave {found:?}")));
        }
    }
    let found = context.for_all(0xd30, context.count(4000, 300_000), |random, number, outcome| {
        // Numbers of all sizes that squares of do not leave f64.
        let mut any =
            |range: f64| libm::exp2(random.between(-range, range)) * if random.unit() < 0.5 { -1.0 } else { 1.0 };
        let range = [1.0, 20.0, 150.0][(number % 3) as usize];
        let (a, b, free) = (any(range), any(range), any(range));
        // c = b^2 / a up to 3 ulp beside it, or anything, or nearly linear, or with a root at 0.
        let c = match number % 5 {
            0..=2 => beside(b * b / a, (number / 5 % 7) as i32 - 3),
            3 => free,
            _ => 0.0,
        };
        check_roots([if number % 11 == 10 { a * 1e-30 } else { a }, b, c], outcome);
        // Short numbers, whose discriminant is exactly 0.
        let short =
            |x: f64| libm::ldexp(libm::rint(libm::ldexp(x / libm::exp2(libm::ceil(libm::log2(x.abs()))), 20)), -20);
        let (p, q) = (short(a), short(b));
        check_roots([p * p, p * q, q * q], outcome);
    })?;
    Ok(sum.and(found))
}
