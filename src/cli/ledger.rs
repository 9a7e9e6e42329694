//! What was noted while reading, as lines for a person.

use super::terminal;
use crate::formats::{Ledger, Treatment};

/// Reports warnings on standard error, and with `everything` also what was honoured, approximated and ignored.
pub fn report(ledger: &Ledger, everything: bool) {
    for (treatment, feature, count) in ledger.entries() {
        if everything || treatment == Treatment::Warning {
            terminal::report(&line(treatment, feature, count));
        }
    }
}

/// One entry, such as `warning: map_bump is not readable (3 times)`.
pub fn line(treatment: Treatment, feature: &str, count: u64) -> String {
    let times = if count > 1 { format!(" ({count} times)") } else { String::new() };
    format!("{}: {feature}{times}", name(treatment))
}

fn name(treatment: Treatment) -> &'static str {
    match treatment {
        Treatment::Honoured => "honoured",
        Treatment::Approximated => "approximated",
        Treatment::Ignored => "ignored",
        Treatment::Warning => "warning",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_told_where_there_are_several() {
        assert_eq!(line(Treatment::Ignored, "map_bump", 1), "ignored: map_bump");
        assert_eq!(line(Treatment::Warning, "no texture `a.png`", 3), "warning: no texture `a.png` (3 times)");
    }
}
