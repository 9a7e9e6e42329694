//! Values of flags: how they are written, and what is said of those that are not understood.

use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::formats::Limits;
use crate::render::Crop;
use crate::scene::film::{LARGEST_EXPOSURE, LONGEST_SIDE};

/// Accepts one of these names and gives what stands beside it.
pub fn one_of<T: Copy + Send + Sync + 'static>(
    names: impl IntoIterator<Item = (&'static str, T)>,
) -> impl TypedValueParser<Value = T> {
    let table: Vec<(&str, T)> = names.into_iter().collect();
    PossibleValuesParser::new(table.iter().map(|(name, _)| *name)).map(move |name| {
        let (_, value) = table.iter().find(|(known, _)| *known == name).expect("clap accepts the table's names alone");
        *value
    })
}

/// Where an automatic camera stands, seen from the middle of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    /// Radians from +Z towards +X.
    pub azimuth: f64,
    /// Radians above the horizon.
    pub elevation: f64,
}

/// Reads `WIDTHxHEIGHT`.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (width, height) = sides.ok_or("expected WIDTHxHEIGHT in pixels, such as 1280x720")?;
    let sane = 1..=LONGEST_SIDE;
    if sane.contains(&width) && sane.contains(&height) {
        Ok((width, height))
    } else {
        Err(format!("width and height must lie between 1 and {LONGEST_SIDE}"))
    }
}

/// Reads `X0,Y0,X1,Y1`.
pub fn crop(text: &str) -> Result<Crop, String> {
    let [x0, y0, x1, y1] =
        list(text).ok_or("expected X0,Y0,X1,Y1 in pixels from the top left corner, such as 0,0,320,240")?;
    if x0 < x1 && y0 < y1 {
        Ok(Crop { x0, y0, x1, y1 })
    } else {
        Err("nothing lies inside: X1 must be greater than X0 and Y1 greater than Y0".into())
    }
}

/// Reads `X,Y`.
pub fn pixel(text: &str) -> Result<(u32, u32), String> {
    let [x, y] = list(text).ok_or("expected X,Y in pixels from the top left corner, such as 320,240")?;
    Ok((x, y))
}

/// Reads `AZIMUTH,ELEVATION` in degrees.
pub fn orbit(text: &str) -> Result<Orbit, String> {
    let [azimuth, elevation]: [f64; 2] = list(text).ok_or("expected AZIMUTH,ELEVATION in degrees, such as 30,20")?;
    if !azimuth.is_finite() || !(-90.0..=90.0).contains(&elevation) {
        return Err("the elevation must lie between -90 and 90 degrees".into());
    }
    Ok(Orbit { azimuth: azimuth.to_radians(), elevation: elevation.to_radians() })
}

/// Reads a vertical field of view in degrees and gives radians.
pub fn field_of_view(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        // The second conversion makes it a value that a scene file, which has degrees, gives back exactly.
        Ok(degrees) if degrees > 0.0 && degrees < 180.0 => Ok(degrees.to_radians().to_degrees().to_radians()),
        _ => Err("expected degrees between 0 and 180, both excluded".into()),
    }
}

/// Reads an angle in degrees between 0 and 180, in radians.
pub fn angle(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(degrees) if (0.0..=180.0).contains(&degrees) => Ok(degrees.to_radians()),
        _ => Err("expected degrees from 0 to 180".into()),
    }
}

/// Reads a time in seconds.
pub fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() => Ok(seconds),
        _ => Err("expected seconds, such as 1.5".into()),
    }
}

/// Reads a limit of what is read: `texels=1G`.
pub fn limit(text: &str) -> Result<(String, u64), String> {
    let names = Limits::default().by_name().map(|(name, _)| name);
    let (name, value) = text.split_once('=').ok_or("expected NAME=N, such as texels=1G")?;
    if names.contains(&name) {
        Ok((name.to_owned(), bytes(value)?))
    } else {
        Err(format!("known are {}", names.join(", ")))
    }
}

/// Reads an exposure in stops.
pub fn exposure(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(stops) if stops.abs() <= LARGEST_EXPOSURE => Ok(stops),
        _ => Err(format!("expected stops between -{LARGEST_EXPOSURE} and {LARGEST_EXPOSURE}; each doubles the light")),
    }
}

/// Reads a number of bytes: `800M`, `1.5GiB`; a unit is 1024 of the one before.
pub fn bytes(text: &str) -> Result<u64, String> {
    let expected = || "expected a number and a unit, such as 800M or 4G".to_owned();
    let digits = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let shift = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 0,
        "k" | "kb" | "kib" => 10,
        "m" | "mb" | "mib" => 20,
        "g" | "gb" | "gib" => 30,
        "t" | "tb" | "tib" => 40,
        _ => return Err(expected()),
    };
    let number: f64 = number.trim_end().parse().map_err(|_| expected())?;
    let bytes = number * (1u64 << shift) as f64;
    if (1.0..=9e18).contains(&bytes) { Ok(bytes as u64) } else { Err(expected()) }
}

/// Reads a span of time: numbers with units (`90s`, `1h30m`), seconds alone, or hours, minutes and seconds with colons.
pub fn duration(text: &str) -> Result<Duration, String> {
    let expected = || "expected a time, such as 90s, 45m, 1h30m or 1:30:00".to_owned();
    let number = |digits: &str| digits.parse::<u64>().map_err(|_| expected());
    let mut seconds = 0u64;
    let mut add = |count: u64, unit: u64| {
        seconds = count.checked_mul(unit).and_then(|more| seconds.checked_add(more)).ok_or_else(expected)?;
        Ok::<(), String>(())
    };
    if !text.is_ascii() {
        return Err(expected());
    }
    if text.contains(':') {
        let parts: Vec<&str> = text.split(':').collect();
        if parts.len() > 3 {
            return Err(expected());
        }
        for (digits, unit) in parts.iter().rev().zip([1, 60, 3600]) {
            add(number(digits)?, unit)?;
        }
    } else if text.ends_with(|last: char| last.is_ascii_digit()) {
        add(number(text)?, 1)?;
    } else {
        for part in text.split_inclusive(|c: char| c.is_ascii_alphabetic()) {
            let (digits, unit) = part.split_at(part.len() - 1);
            let unit = match unit {
                "s" => 1,
                "m" => 60,
                "h" => 3600,
                "d" => 86_400,
                _ => return Err(expected()),
            };
            add(number(digits)?, unit)?;
        }
    }
    // Far more than any job, and far less than clocks hold.
    if (1..=1 << 32).contains(&seconds) { Ok(Duration::from_secs(seconds)) } else { Err(expected()) }
}

/// Reads a range of frames, `A..B`, or one frame.
pub fn frames(text: &str) -> Result<(i32, i32), String> {
    const LAST: i32 = 1_000_000;
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if -LAST <= first && first <= last && last <= LAST => Ok((first, last)),
        _ => Err("expected A..B, the first frame and the last, such as 1..250".into()),
    }
}

/// Reads a whole number within a range.
pub fn count(range: RangeInclusive<u32>) -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(i64::from(*range.start())..=i64::from(*range.end()))
}

/// Reads exactly N numbers with commas between them.
fn list<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let values: Vec<T> = text.split(',').map(|value| value.trim().parse().ok()).collect::<Option<_>>()?;
    values.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_of_time_are_read_as_people_write_them() {
        let seconds = |text: &str| duration(text).map(|span| span.as_secs()).ok();
        for (text, expected) in
            [("90", 90), ("90s", 90), ("45m", 2700), ("1h30m", 5400), ("2d", 172_800), ("1:30:00", 5400), ("2:05", 125)]
        {
            assert_eq!(seconds(text), Some(expected), "{text}");
        }
        for flawed in
            ["", "0", "s", "5\u{e9}", "90\u{b5}", "1x", "-5", "1:2:3:4", "99999999999999999999", "1.5h", "1h:3"]
        {
            assert_eq!(seconds(flawed), None, "{flawed}");
        }
    }

    #[test]
    fn ranges_of_frames_are_read() {
        assert_eq!([frames("1..250"), frames("-3..-1"), frames("7")], [Ok((1, 250)), Ok((-3, -1)), Ok((7, 7))]);
        for flawed in ["", "5..1", "a..b", "1...3", "1..", "..2", "1..9999999"] {
            assert!(frames(flawed).is_err(), "{flawed}");
        }
    }

    #[test]
    fn sizes_are_read_and_bad_ones_explained() {
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert_eq!(size("1X1"), Ok((1, 1)));
        for bad in ["", "640", "640x", "x480", "640x480x3", "-1x5", "1.5x2", "640,480"] {
            assert!(size(bad).unwrap_err().contains("1280x720"), "{bad}");
        }
        for bad in ["0x5", "5x0", "65537x1"] {
            assert!(size(bad).unwrap_err().contains("between 1 and 65536"), "{bad}");
        }
    }

    #[test]
    fn bytes_are_read_with_and_without_units() {
        for (text, expected) in
            [("1", 1), ("4096", 4096), ("800M", 800 << 20), ("1.5GiB", 3 << 29), ("2kb", 2048), ("3 T", 3 << 40)]
        {
            assert_eq!(bytes(text), Ok(expected), "{text}");
        }
        for bad in ["", "M", "-1G", "0", "1X", "1e30", "nan", "4 G B", "inf", "4gbb", "1Mii", "5gi", "800i"] {
            assert!(bytes(bad).unwrap_err().contains("800M"), "{bad}");
        }
    }

    #[test]
    fn crops_are_half_open_and_never_empty() {
        assert_eq!(crop("1, 2,3,4"), Ok(Crop { x0: 1, y0: 2, x1: 3, y1: 4 }));
        for bad in ["1,2,3", "1,2,3,4,5", "a,2,3,4", "-1,0,3,4", "0 0 1 1"] {
            assert!(crop(bad).unwrap_err().contains("X0,Y0,X1,Y1"), "{bad}");
        }
        for empty in ["3,2,3,4", "1,4,3,4", "4,0,3,4"] {
            assert!(crop(empty).unwrap_err().contains("nothing lies inside"), "{empty}");
        }
    }

    #[test]
    fn pixels_are_two_whole_numbers() {
        assert_eq!(pixel("3, 4"), Ok((3, 4)));
        for bad in ["", "3", "3,4,5", "-1,2", "1.5,2", "3x4"] {
            assert!(pixel(bad).unwrap_err().contains("such as 320,240"), "{bad}");
        }
    }

    #[test]
    fn angles_become_radians() {
        let quarter = orbit("-90,45").unwrap();
        assert_eq!(quarter.azimuth, -std::f64::consts::FRAC_PI_2);
        assert_eq!(quarter.elevation, std::f64::consts::FRAC_PI_4);
        assert_eq!(field_of_view("90"), Ok(std::f64::consts::FRAC_PI_2));
        for bad in ["91", "0,91", "0,-90.5", "nan,0", "0,nan", "inf,0"] {
            assert!(orbit(bad).is_err(), "{bad}");
        }
        for bad in ["0", "180", "-5", "NaN", "wide"] {
            assert!(field_of_view(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn exposures_are_finite() {
        assert_eq!(exposure("-1.5"), Ok(-1.5));
        for bad in ["inf", "nan", "127", "bright"] {
            assert!(exposure(bad).is_err(), "{bad}");
        }
    }
}
