//! What a case found.

use glam::Vec3;

use crate::geometry::Ray;
use crate::measure::cases::reduce::reduce;
use crate::measure::statistics::rate_bound;

/// What a case found: how many answers it checked, how many were wrong, and what it measured on the way.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// Answers checked.
    pub rays: u64,
    /// Answers that break the case's rule.
    pub wrong: u64,
    /// The simplest of the wrong answers.
    pub failure: Option<Failure>,
    /// What was measured beside right and wrong, some of it with bars.
    pub figures: Vec<Figure>,
}

/// A wrong answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    /// The ray, if one ray is to blame.
    pub ray: Option<Ray>,
    /// The triangle, if one triangle is.
    pub triangle: Option<[Vec3; 3]>,
    /// What was expected and what came, with the structure.
    pub what: String,
}

/// A measured number.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Figure {
    /// What it is, with its unit.
    pub name: String,
    /// The number. Of two outcomes added up the larger stays.
    pub value: f64,
    /// The largest value that passes; `None` where the number is only reported.
    pub bar: Option<f64>,
}

impl Failure {
    /// A wrong answer to one ray.
    pub fn of_ray(ray: &Ray, what: impl Into<String>) -> Self {
        Self { ray: Some(*ray), triangle: None, what: what.into() }
    }

    /// A wrong answer that no single ray is to blame for.
    pub fn text(what: impl Into<String>) -> Self {
        Self { ray: None, triangle: None, what: what.into() }
    }

    /// How much it takes to write the failure down: bits of all mantissas. Simpler failures are easier to understand.
    fn bits(&self) -> u32 {
        let length = |x: f32| 24 - (x.to_bits() & 0x7f_ffff | 0x80_0000).trailing_zeros();
        let vector = |v: Vec3| length(v.x) + length(v.y) + length(v.z);
        let ray = self.ray.map_or(0, |ray| vector(ray.origin) + vector(ray.direction));
        ray + self.triangle.map_or(0, |corners| corners.map(vector).iter().sum())
    }
}

impl Outcome {
    /// Counts one answer; a wrong one is described by `describe`.
    pub fn check(&mut self, right: bool, describe: impl FnOnce() -> Failure) {
        self.rays += 1;
        if !right {
            self.wrong += 1;
            self.keep(describe());
        }
    }

    /// Notes a number; of two with one name the larger stays, and NaN is larger than anything.
    pub fn figure(&mut self, name: impl Into<String> + AsRef<str>, value: f64, bar: Option<f64>) {
        match self.figures.iter_mut().find(|figure| figure.name == name.as_ref()) {
            Some(figure) if value.is_nan() || value > figure.value => figure.value = value,
            Some(_) => {}
            None => self.figures.push(Figure { name: name.into(), value, bar }),
        }
    }

    /// Both outcomes in one.
    pub fn and(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.wrong += other.wrong;
        if let Some(failure) = other.failure {
            self.keep(failure);
        }
        for Figure { name, value, bar } in other.figures {
            self.figure(name, value, bar);
        }
        self
    }

    /// Whether nothing was wrong, something was checked, and every figure is within its bar; NaN is not.
    pub fn passes(&self) -> bool {
        self.wrong == 0
            && self.rays > 0
            && self.figures.iter().all(|figure| figure.bar.is_none_or(|bar| figure.value <= bar))
    }

    /// The upper end of the 95 % interval of the rate of wrong answers.
    pub fn bound(&self) -> f64 {
        rate_bound(self.wrong, self.rays)
    }

    /// Makes the kept failure simpler where it names a ray: `fails` says whether a simpler ray, and triangle if there is
    /// one, is still answered wrongly.
    pub fn simplify(mut self, fails: impl Fn(&Ray, Option<&[Vec3; 3]>) -> bool) -> Self {
        if let Some(failure) = &mut self.failure
            && let Some(ray) = failure.ray
        {
            let (ray, triangle) = reduce(ray, failure.triangle, fails);
            (failure.ray, failure.triangle) = (Some(ray), triangle);
        }
        self
    }

    fn keep(&mut self, failure: Failure) {
        if self.failure.as_ref().is_none_or(|kept| failure.bits() < kept.bits()) {
            self.failure = Some(failure);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failure(x: f32) -> Failure {
        Failure { ray: Some(Ray::new(Vec3::splat(x), Vec3::X)), triangle: None, what: String::new() }
    }

    #[test]
    fn outcomes_add_up_and_keep_the_simplest_failure() {
        let mut a = Outcome::default();
        a.check(true, || unreachable!());
        a.check(false, || failure(0.1));
        a.figure("error", 2.0, Some(3.0));
        let mut b = Outcome::default();
        b.check(false, || failure(0.5));
        b.figure("error", 4.0, Some(3.0));
        let sum = a.and(b);
        assert_eq!((sum.rays, sum.wrong), (3, 2));
        assert_eq!(sum.failure, Some(failure(0.5)));
        assert_eq!(sum.figures.len(), 1);
        assert_eq!(sum.figures[0].value, 4.0);
        assert!(!sum.passes());
    }

    #[test]
    fn figures_beyond_their_bar_and_empty_cases_fail() {
        let mut outcome = Outcome::default();
        assert!(!outcome.passes());
        outcome.check(true, || unreachable!());
        assert!(outcome.passes());
        outcome.figure("only reported", 9.0, None);
        outcome.figure("with a bar", 1.0, Some(1.0));
        assert!(outcome.passes());
        outcome.figure("with a bar", f64::NAN, Some(1.0));
        assert!(!outcome.passes());
    }
}
