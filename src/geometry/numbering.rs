//! Numbers for pairs of things, in the order in which they first come.

use std::collections::HashMap;
use std::collections::hash_map::Entry as Slot;
use std::hash::Hash;

/// How many pairs of one owner are looked through one by one. Beyond that a hash map finds them, so that a file in which all
/// pairs have one owner takes no longer than others.
const MOST_IN_CHAIN: usize = 32;

/// Ends a chain.
const NONE: u32 = u32::MAX;

/// Gives each pair of an owner, such as a position's number, and a key, such as what else a corner has, a number of its own.
///
/// A list for each owner takes less memory and time than a hash map of all: owners have few pairs, and those that follow each
/// other in a file lie near each other here.
#[derive(Debug, Clone)]
pub struct Numbering<K> {
    /// For each owner, its latest pair.
    latest: Vec<u32>,
    pairs: Vec<Pair<K>>,
    /// Pairs of owners with many, and of owners that are not there yet.
    crowd: HashMap<(u32, K), u32>,
}

#[derive(Debug, Clone, Copy)]
struct Pair<K> {
    owner: u32,
    key: K,
    /// The owner's pair before this one.
    before: u32,
}

impl<K: Copy + Eq + Hash> Numbering<K> {
    /// No pairs, and so many owners: those with lower numbers than `owners` are found quickly. There is room for one pair each.
    pub fn new(owners: usize) -> Self {
        Self { latest: vec![NONE; owners], pairs: Vec::with_capacity(owners), crowd: HashMap::new() }
    }

    /// Makes room for more owners.
    pub fn grow(&mut self, owners: usize) {
        if owners > self.latest.len() {
            self.latest.resize(owners, NONE);
        }
    }

    /// The pair's number: the next if it is new. There may be at most 4294967295 pairs.
    pub fn number(&mut self, owner: u32, key: K) -> u32 {
        let latest = self.latest.get(owner as usize).copied();
        let (mut at, mut steps) = (latest.unwrap_or(NONE), 0);
        while at != NONE {
            let pair = &self.pairs[at as usize];
            if pair.key == key {
                return at;
            }
            (at, steps) = (pair.before, steps + 1);
        }
        let next = self.pairs.len() as u32;
        if latest.is_none() || steps >= MOST_IN_CHAIN {
            match self.crowd.entry((owner, key)) {
                Slot::Occupied(known) => return *known.get(),
                Slot::Vacant(slot) => slot.insert(next),
            };
            self.pairs.push(Pair { owner, key, before: NONE });
            return next;
        }
        if !self.crowd.is_empty()
            && let Some(&known) = self.crowd.get(&(owner, key))
        {
            return known;
        }
        self.pairs.push(Pair { owner, key, before: latest.unwrap_or(NONE) });
        self.latest[owner as usize] = next;
        next
    }

    /// How many pairs there are.
    pub fn count(&self) -> usize {
        self.pairs.len()
    }

    /// The pair with this number.
    ///
    /// # Panics
    /// If there is none.
    pub fn pair(&self, number: u32) -> (u32, K) {
        let Pair { owner, key, .. } = self.pairs[number as usize];
        (owner, key)
    }

    /// All pairs, by number.
    pub fn pairs(&self) -> impl ExactSizeIterator<Item = (u32, K)> + '_ {
        self.pairs.iter().map(|pair| (pair.owner, pair.key))
    }

    /// Gives back the memory that only finding takes.
    pub fn stop_finding(&mut self) {
        (self.latest, self.crowd) = (Vec::new(), HashMap::new());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_a_hash_map() {
        let mut expected: HashMap<(u32, u32), u32> = HashMap::new();
        let mut numbering = Numbering::new(10);
        let mut state = 1u32;
        for step in 0..20_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Owner 3 has hundreds of pairs; owners from 10 on come into being halfway.
            let owner = if state & 0x10000 == 0 { 3 } else { (state >> 20) % 20 };
            let key = (state >> 8) % if owner == 3 { 500 } else { 5 };
            let next = expected.len() as u32;
            let number = *expected.entry((owner, key)).or_insert(next);
            assert_eq!(numbering.number(owner, key), number);
            assert_eq!(numbering.pair(number), (owner, key));
            if step == 10_000 {
                numbering.grow(20);
            }
        }
        assert_eq!(numbering.count(), expected.len());
        assert!(numbering.pairs().enumerate().all(|(number, pair)| expected[&pair] == number as u32));
    }
}
