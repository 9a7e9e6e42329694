//! The tiles of a picture: how it is cut, shared among machines, and put together again.

use crate::error::{Error, Result};
use crate::render::settings::{Crop, RayCounts, ThreadSeconds};
use crate::scene::FilmSettings;

/// Side of a tile in pixels: 32 x 32 pixels keep a thread busy for long enough and share well.
const SIDE: u32 = 32;

/// The most pixels that are rendered at once: 2^28, which take 6 GiB while tiles are put together.
const LARGEST_PICTURE: u64 = 1 << 28;

/// One tile's pixels, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// Which of the picture's [`Tiles`] it is.
    pub number: u32,
    /// Where it is in the picture.
    pub area: Crop,
    /// Linear colours.
    pub color: Vec<[f32; 3]>,
    /// How much of each pixel is covered; empty unless the background is transparent.
    pub alpha: Vec<f32>,
    /// Extra values, one array a channel, in the order of the settings' kinds and their channels.
    pub aovs: Vec<Vec<f32>>,
    /// Rays that were traced for it.
    pub rays: RayCounts,
    /// What its thread did.
    pub seconds: ThreadSeconds,
}

/// How a picture, or a part of it, is cut into tiles: row by row, on the grid of the full picture, so that a crop traces the
/// same tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tiles {
    area: Crop,
}

impl Tiles {
    /// Those of a picture, or of a crop of it.
    ///
    /// # Errors
    /// A film beyond its limits, a crop that does not lie within it, or more than 2^28 pixels.
    pub fn of(film: &FilmSettings, crop: Option<Crop>) -> Result<Self> {
        film.check()?;
        let area = crop.unwrap_or(Crop { x0: 0, y0: 0, x1: film.width, y1: film.height });
        if !(area.x0 < area.x1 && area.y0 < area.y1 && area.x1 <= film.width && area.y1 <= film.height) {
            return Err(Error::caller(format!(
                "the crop {},{},{},{} does not lie within the {}x{} picture",
                area.x0, area.y0, area.x1, area.y1, film.width, film.height
            )));
        }
        if u64::from(area.width()) * u64::from(area.height()) > LARGEST_PICTURE {
            return Err(Error::limit(format!(
                "a picture of more than {LARGEST_PICTURE} pixels does not fit in memory"
            ))
            .remedy("render parts of it with a crop"));
        }
        Ok(Self { area })
    }

    /// The pixels that they cover.
    pub fn area(&self) -> Crop {
        self.area
    }

    /// The first column and row of the grid, and how many columns and rows it has.
    fn grid(&self) -> [u32; 4] {
        let (x, y) = (self.area.x0 / SIDE, self.area.y0 / SIDE);
        [x, y, self.area.x1.div_ceil(SIDE) - x, self.area.y1.div_ceil(SIDE) - y]
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        let [_, _, columns, rows] = self.grid();
        columns * rows
    }

    /// Where a tile is; `None` if there is none of this number.
    pub fn tile(&self, number: u32) -> Option<Crop> {
        if number >= self.count() {
            return None;
        }
        let [x, y, columns, _] = self.grid();
        let (x, y) = ((x + number % columns) * SIDE, (y + number / columns) * SIDE);
        Some(Crop {
            x0: x.max(self.area.x0),
            y0: y.max(self.area.y0),
            x1: x.saturating_add(SIDE).min(self.area.x1),
            y1: y.saturating_add(SIDE).min(self.area.y1),
        })
    }

    /// The numbers of the tiles of one of several shares that cost alike, ascending; shares are numbered from 0.
    ///
    /// Along a curve that stays among neighbours (Morton 1966) each tile goes to the next share, so that all shares look
    /// at all of the picture.
    pub fn share(&self, share: u32, shares: u32) -> Vec<u32> {
        let own = self.along_curve().into_iter().skip(share as usize).step_by(shares.max(1) as usize);
        let mut own: Vec<u32> = own.collect();
        own.sort_unstable();
        own
    }

    /// The numbers of all tiles along the curve: neighbours there are neighbours in the picture.
    pub fn along_curve(&self) -> Vec<u32> {
        let [_, _, columns, _] = self.grid();
        let mut order: Vec<u32> = (0..self.count()).collect();
        order.sort_by_cached_key(|number| morton(number % columns, number / columns));
        order
    }
}

/// The bits of two numbers, in turn.
fn morton(x: u32, y: u32) -> u64 {
    let spread = |x: u32| (0..u32::BITS).fold(0, |code, bit| code | u64::from(x >> bit & 1) << (2 * bit));
    spread(x) | spread(y) << 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_an_area_once() {
        let film = FilmSettings::default();
        for area in [Crop { x0: 0, y0: 0, x1: 70, y1: 33 }, Crop { x0: 31, y0: 5, x1: 65, y1: 6 }] {
            let tiles = Tiles::of(&film, Some(area)).unwrap();
            let mut seen = std::collections::HashSet::new();
            for tile in (0..tiles.count()).map(|number| tiles.tile(number).unwrap()) {
                for y in tile.y0..tile.y1 {
                    for x in tile.x0..tile.x1 {
                        assert!(seen.insert((x, y)));
                    }
                }
            }
            assert_eq!(seen.len() as u32, area.width() * area.height());
            assert_eq!([tiles.tile(tiles.count()), tiles.tile(u32::MAX)], [None, None]);
        }
    }

    #[test]
    fn shares_are_alike_and_hold_each_tile_once() {
        let tiles = Tiles::of(&FilmSettings::default(), None).unwrap();
        for shares in [1, 2, 3, 8, 40, 2000] {
            let all: Vec<Vec<u32>> = (0..shares).map(|share| tiles.share(share, shares)).collect();
            let (least, most) = (all.iter().map(Vec::len).min().unwrap(), all.iter().map(Vec::len).max().unwrap());
            assert!(most - least <= 1, "{shares}: {least} to {most}");
            let mut numbers = all.concat();
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..tiles.count()));
        }
        // Every quarter of the picture is looked at by every one of eight.
        for own in (0..8).map(|share| tiles.share(share, 8)) {
            for (right, low) in [(false, false), (true, false), (false, true), (true, true)] {
                let is_there = |&&number: &&u32| {
                    let tile = tiles.tile(number).unwrap();
                    (tile.x0 >= 640) == right && (tile.y0 >= 360) == low
                };
                let there = own.iter().filter(is_there).count();
                assert!((24..=34).contains(&there), "{there} of {}", own.len());
            }
        }
    }
}
