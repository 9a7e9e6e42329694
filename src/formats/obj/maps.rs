//! What an MTL statement says about an image: its file and how it is read.

use glam::DVec2;

use super::texels::STEEPEST;
use crate::scene::detail::Channel;

/// The options and the file of a `map_` statement.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MapStatement<'a> {
    /// The file as it is named.
    pub file: &'a str,
    /// `-s`: what texture coordinates are multiplied by.
    pub scale: DVec2,
    /// `-o`: what is added to them.
    pub offset: DVec2,
    /// `-clamp on`: the border texel goes on.
    pub clamp: bool,
    /// `-bm`: what slopes are multiplied by.
    pub bump: f64,
    /// `-imfchan`: which value of the image is meant, where a number is wanted; `None` where it does not say.
    pub channel: Option<Channel>,
    /// `-mm`: what is added to values after they are multiplied by the second.
    pub base_gain: [f64; 2],
    /// Options that are not used.
    pub unused: Vec<&'a str>,
}

impl<'a> MapStatement<'a> {
    /// Options come first, and the file is all that follows them: its name may contain spaces.
    pub fn parse(statement: &'a str) -> Self {
        let mut map = Self {
            file: "",
            scale: DVec2::ONE,
            offset: DVec2::ZERO,
            clamp: false,
            bump: 1.0,
            channel: None,
            base_gain: [0.0, 1.0],
            unused: Vec::new(),
        };
        let mut rest = statement.trim();
        while let Some((option, after)) = split_word(rest).filter(|(word, _)| word.starts_with('-')) {
            match option {
                "-s" => (map.scale, rest) = vector(after, DVec2::ONE),
                "-o" => (map.offset, rest) = vector(after, DVec2::ZERO),
                "-clamp" => {
                    let (value, after) = split_word(after).unwrap_or(("", ""));
                    map.clamp = value == "on";
                    rest = after;
                }
                "-bm" => {
                    let (found, after) = numbers(after, 1);
                    map.bump = found.first().map_or(map.bump, |bump| bump.clamp(-STEEPEST, STEEPEST));
                    rest = after;
                }
                "-mm" => {
                    let (found, after) = numbers(after, 2);
                    if let [base, gain] = found[..] {
                        map.base_gain = [base, gain];
                    } else {
                        map.unused.push(option);
                    }
                    rest = after;
                }
                "-imfchan" => {
                    let (value, after) = split_word(after).unwrap_or(("", ""));
                    map.channel = channel(value);
                    if map.channel.is_none() {
                        map.unused.push(option);
                    }
                    rest = after;
                }
                "-t" => {
                    map.unused.push(option);
                    rest = vector(after, DVec2::ZERO).1;
                }
                "-blendu" | "-blendv" | "-cc" | "-texres" | "-boost" | "-type" | "-colorspace" => {
                    map.unused.push(option);
                    rest = split_word(after).map_or("", |(_, after)| after);
                }
                // A file whose name begins with a dash.
                _ => break,
            }
        }
        map.file = rest;
        map
    }

    /// Whether both read an image at the same places.
    pub fn is_placed_as(&self, other: &Self) -> bool {
        (self.scale, self.offset, self.clamp) == (other.scale, other.offset, other.clamp)
    }
}

/// The channel that a letter means; none for the depth, which no image has here.
fn channel(letter: &str) -> Option<Channel> {
    match letter {
        "r" => Some(Channel::Red),
        "g" => Some(Channel::Green),
        "b" => Some(Channel::Blue),
        "m" => Some(Channel::Alpha),
        "l" => Some(Channel::Luminance),
        _ => None,
    }
}

fn split_word(text: &str) -> Option<(&str, &str)> {
    let (word, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
    (!word.is_empty()).then_some((word, rest.trim_start()))
}

/// One to three numbers, of which the third is for volumes; `default` for the second if it is not there.
fn vector(text: &str, default: DVec2) -> (DVec2, &str) {
    let (numbers, rest) = numbers(text, 3);
    let component = |i: usize| numbers.get(i).copied().unwrap_or(default[i]);
    (DVec2::new(component(0), component(1)), rest)
}

/// Up to `most` numbers and what follows them.
fn numbers(text: &str, most: usize) -> (Vec<f64>, &str) {
    let (mut numbers, mut rest) = (Vec::new(), text);
    while numbers.len() < most
        && let Some((word, after)) = split_word(rest)
        && let Ok(number) = word.parse::<f64>()
        && number.is_finite()
    {
        numbers.push(number);
        rest = after;
    }
    (numbers, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_a_name_with_spaces() {
        let map = MapStatement::parse("-s 2 3 1 -o 0.5 -blendu off -clamp on  -mm 0.1 2 -t 1 -bm 0.25 a b -s 1.png");
        assert_eq!(map.file, "a b -s 1.png");
        assert_eq!((map.scale, map.offset, map.clamp), (DVec2::new(2.0, 3.0), DVec2::new(0.5, 0.0), true));
        assert_eq!((map.bump, map.base_gain), (0.25, [0.1, 2.0]));
        assert_eq!(map.unused, ["-blendu", "-t"]);
        assert_eq!(MapStatement::parse("-s 2 a.png").scale, DVec2::new(2.0, 1.0));
        assert_eq!(MapStatement::parse("-a.png").file, "-a.png");
        assert_eq!(MapStatement::parse("-s").file, "");
    }

    #[test]
    fn channels_have_letters() {
        let channel = |text| MapStatement::parse(text).channel;
        assert_eq!(channel("-imfchan m a.png"), Some(Channel::Alpha));
        assert_eq!(channel("-imfchan l a.png"), Some(Channel::Luminance));
        assert_eq!(channel("a.png"), None);
        let depth = MapStatement::parse("-imfchan z a.png");
        assert_eq!((depth.channel, depth.unused.as_slice(), depth.file), (None, ["-imfchan"].as_slice(), "a.png"));
    }
}
