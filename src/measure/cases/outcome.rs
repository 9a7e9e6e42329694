//! What a case found.

use glam::Vec3;

use crate::accel::Kind;
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
    /// The questions that were drawn at random, by the kind of structure that was asked; `None` where there is none.
    pub drawn: Vec<Drawn>,
    /// The simplest of the wrong answers.
    pub failure: Option<Failure>,
    /// What was measured beside right and wrong, some of it with bars.
    pub figures: Vec<Figure>,
}

/// Questions drawn at random, each of its own: none is another's copy. A question may check several answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawn {
    /// What kind of structure was asked, with whichever preset.
    pub kind: Option<Kind>,
    /// Questions of which an answer was checked.
    pub questions: u64,
    /// Those of which an answer was wrong.
    pub wrong: u64,
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
        for drawn in other.drawn {
            self.draw(drawn);
        }
        self
    }

    /// Counts questions that were drawn.
    pub fn draw(&mut self, Drawn { kind, questions, wrong }: Drawn) {
        match self.drawn.iter_mut().find(|drawn| drawn.kind == kind) {
            Some(drawn) => (drawn.questions, drawn.wrong) = (drawn.questions + questions, drawn.wrong + wrong),
            None => self.drawn.push(Drawn { kind, questions, wrong }),
        }
    }

    /// The same, of questions that come from a list: nothing was drawn.
    pub fn of_a_list(self) -> Self {
        Self { drawn: Vec::new(), ..self }
    }

    /// The same, with all questions put to one kind of structure.
    pub fn of_kind(mut self, kind: Kind) -> Self {
        for drawn in &mut self.drawn {
            drawn.kind = Some(kind);
        }
        self
    }

    /// Whether nothing was wrong, something was checked, and every figure is within its bar; NaN is not.
    pub fn passes(&self) -> bool {
        self.wrong == 0
            && self.rays > 0
            && self.figures.iter().all(|figure| figure.bar.is_none_or(|bar| figure.value <= bar))
    }

    /// How many different questions were drawn at random for the kind of structure that was asked the fewest, and the upper
    /// end of the 95 % interval of the rate of those answered wrongly, for the kind where it is highest. `linear` counts
    /// where no tree was asked. `None` where all questions come from a list.
    pub fn bound(&self) -> Option<(u64, f64)> {
        let is_tree = |drawn: &&Drawn| drawn.kind != Some(Kind::Linear);
        let any_tree = self.drawn.iter().any(|drawn| is_tree(&drawn));
        let counted = || self.drawn.iter().filter(move |drawn| !any_tree || is_tree(drawn));
        let fewest = counted().map(|drawn| drawn.questions).min()?;
        Some((fewest, counted().map(|drawn| rate_bound(drawn.wrong, drawn.questions)).fold(0.0, f64::max)))
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
    fn bounds_are_those_of_the_tree_that_was_asked_least() {
        let mut outcome = Outcome::default();
        assert_eq!(outcome.bound(), None);
        let mut draw = |kind, questions, wrong| outcome.draw(Drawn { kind: Some(kind), questions, wrong });
        draw(Kind::Linear, 10, 0);
        draw(Kind::Bvh2, 1000, 0);
        draw(Kind::CwBvh, 2000, 0);
        draw(Kind::Bvh2, 500, 0);
        let (questions, bound) = outcome.bound().unwrap();
        assert_eq!(questions, 1500);
        // With nothing wrong the bound is 1 - 0.05^(1 / n).
        assert!((bound - (1.0 - 0.05f64.powf(1.0 / 1500.0))).abs() < 1e-9, "{bound}");
        let drawn = Drawn { kind: None, questions: 20, wrong: 0 };
        let linear = Outcome { drawn: vec![drawn], ..Outcome::default() }.of_kind(Kind::Linear);
        assert_eq!(linear.bound().unwrap().0, 20);
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
