//! What building takes in memory, and which structure stays within a limit.

use super::{Kind, ONE_THREAD};

/// Bytes a triangle while a wide tree is built, beside the tree: 28 for its box and number and 4 in the list of live triangles, and what
/// the allocator loses; `tests/memory.rs` holds builds to it.
const REFERENCE: u64 = 36;

/// Bytes for each triangle of the chunks that threads are building: more than was measured on one million with two threads.
const CHUNK: u64 = 512;

impl Kind {
    /// Bytes a triangle of the finished structure, a little more than was measured: 49 to 52, and 13 to 16.
    fn finished(self) -> u64 {
        match self {
            Self::Compact => 17,
            _ => 54,
        }
    }

    /// The most bytes that a wide tree, compact or not, over each of some meshes takes while they are built, beside the meshes; about,
    /// and rather too many. `triangles` are the meshes' numbers of live triangles.
    pub fn peak_bytes(self, triangles: impl IntoIterator<Item = usize>, threads: usize) -> u64 {
        let (mut all, mut largest) = (0, 0);
        for triangles in triangles {
            all += triangles as u64;
            largest = largest.max(triangles as u64);
        }
        // Small meshes are built side by side, large ones one after the other.
        let busy = all.min((threads * ONE_THREAD) as u64);
        self.finished() * all + REFERENCE * largest.max(busy) + CHUNK * busy
    }

    /// The fastest structure that can be built within so many bytes; `None` if none can.
    pub fn within(bytes: u64, triangles: &[usize], threads: usize) -> Option<Self> {
        let fits = |kind: &Self| kind.peak_bytes(triangles.iter().copied(), threads) <= bytes;
        [Self::Auto.resolve(), Self::Compact].into_iter().find(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_compact_form_is_chosen_where_the_fast_one_is_too_large() {
        let [wide, compact] = [Kind::Wide, Kind::Compact].map(|kind| kind.peak_bytes([1_000_000, 3_000_000], 2));
        assert!(compact < wide && wide < 4_000_000 * 100);
        let chosen = |bytes: u64| Kind::within(bytes, &[1_000_000, 3_000_000], 2);
        assert_eq!(chosen(u64::MAX), Some(Kind::Wide));
        assert_eq!(chosen(wide), Some(Kind::Wide));
        assert_eq!(chosen(wide - 1), Some(Kind::Compact));
        assert_eq!(chosen(compact), Some(Kind::Compact));
        assert_eq!(chosen(compact - 1), None);
        assert_eq!(Kind::within(0, &[], 8), Some(Kind::Wide));
        // As much as one mesh of all their triangles, as far as threads take them at once.
        let small = [ONE_THREAD; 8];
        assert_eq!(Kind::Wide.peak_bytes(small, 8), Kind::Wide.peak_bytes([8 * ONE_THREAD], 8));
    }
}
