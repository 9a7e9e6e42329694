//! One of several things in a file, chosen by name or number.

use crate::error::{Error, Result};

/// The position of the thing of this name; where none has it, of this number, counted from 0.
///
/// # Errors
/// A caller's error that lists what there is.
pub(super) fn choose<'a>(
    what: &str,
    wanted: &str,
    names: impl ExactSizeIterator<Item = Option<&'a str>> + Clone,
) -> Result<usize> {
    if let Some(found) = names.clone().position(|name| name == Some(wanted)) {
        return Ok(found);
    }
    let count = names.len();
    if let Some(number) = wanted.parse().ok().filter(|&number: &usize| number < count) {
        return Ok(number);
    }
    let error = Error::caller(format!("the file has no {what} `{wanted}`"));
    if count == 0 {
        return Err(error.remedy(format!("it has no {what}s at all")));
    }
    let listed = names.enumerate().take(MOST_LISTED).map(|(number, name)| match name {
        Some(name) => format!("{number} `{name}`"),
        None => number.to_string(),
    });
    let more = if count > MOST_LISTED { format!(" and {} more", count - MOST_LISTED) } else { String::new() };
    Err(error.remedy(format!("it has {}{more}", listed.collect::<Vec<_>>().join(", "))))
}

/// How many things a message lists.
const MOST_LISTED: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_before_numbers_and_errors_list_what_there_is() {
        let find = |wanted: &str| choose("scene", wanted, [Some("hall"), None, Some("0")].into_iter());
        assert_eq!((find("hall").unwrap(), find("1").unwrap(), find("0").unwrap()), (0, 1, 2));
        for wanted in ["3", "-1", "attic"] {
            let error = find(wanted).unwrap_err();
            assert_eq!(error.fault(), crate::error::Fault::Caller);
            let text = format!("the file has no scene `{wanted}`; it has 0 `hall`, 1, 2 `0`");
            assert_eq!(error.to_string(), text);
        }
        assert!(choose("scene", "0", [].into_iter()).unwrap_err().to_string().contains("no scenes at all"));
        let many = choose("scene", "x", vec![None; 25].into_iter()).unwrap_err().to_string();
        assert!(many.ends_with("19 and 5 more"), "{many}");
    }
}
