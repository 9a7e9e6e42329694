//! The hard cases in their quick form, every structure, as `whitted check` runs them.

use whitted::measure::cases::{self, Context};
use whitted::progress::Silent;

#[test]
fn all_hard_cases_pass() {
    let context = Context::quick(&Silent);
    let mut failures = Vec::new();
    for case in cases::all() {
        let outcome = (case.run)(&context).unwrap();
        if !outcome.passes() {
            let (wrong, rays) = (outcome.wrong, outcome.rays);
            let details = format!("{:#?}\n{:#?}", outcome.failure, outcome.figures);
            failures.push(format!("{} with seed {}: {wrong} of {rays}\n{details}", case.id, context.seed));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
