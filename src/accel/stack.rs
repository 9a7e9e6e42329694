//! The traversal that all trees share, and its stack: never overflows, and costs little to start.

use std::ops::{ControlFlow, Range};

/// Part of a tree that is yet to be visited.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Where the ray enters its box.
    pub near: f32,
    /// The node's number, or the first item of the leaf.
    pub first: u32,
    /// The leaf's number of items; 0 for an inner node.
    pub count: u32,
}

/// Entries held without allocation. Trees over 10 million triangles rarely need more; what does goes to the heap, so
/// that degenerate trees are slow instead of wrong. Each slot costs every ray its initialisation.
const FIXED: usize = 32;

/// A stack of entries.
pub struct Stack {
    fixed: [Entry; FIXED],
    spilled: Vec<Entry>,
    len: usize,
}

impl Stack {
    /// No entries.
    #[inline(always)]
    pub fn new() -> Self {
        Self { fixed: [Entry { near: 0.0, first: 0, count: 0 }; FIXED], spilled: Vec::new(), len: 0 }
    }

    /// Puts an entry on top.
    #[inline(always)]
    pub fn push(&mut self, entry: Entry) {
        match self.fixed.get_mut(self.len) {
            Some(slot) => *slot = entry,
            None => self.spill(entry),
        }
        self.len += 1;
    }

    /// How many entries there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Puts an entry where it belongs among those above the first `base`, which are in order: the nearest on top.
    #[inline(always)]
    pub fn insert(&mut self, base: usize, entry: Entry) {
        self.push(entry);
        let mut at = self.len - 1;
        if at >= FIXED {
            // The order of the few that spilled does not matter to the result.
            return;
        }
        while at > base && self.fixed[at - 1].near < entry.near {
            self.fixed[at] = self.fixed[at - 1];
            at -= 1;
        }
        self.fixed[at] = entry;
    }

    /// Takes the topmost entry that is entered no later than `far`, and drops those above it.
    #[inline(always)]
    pub fn pop(&mut self, far: f32) -> Option<Entry> {
        while self.len > 0 {
            self.len -= 1;
            let entry = match self.fixed.get(self.len) {
                Some(&entry) => entry,
                None => self.unspill()?,
            };
            if entry.near <= far {
                return Some(entry);
            }
        }
        None
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self, entry: Entry) {
        self.spilled.push(entry);
    }

    #[cold]
    #[inline(never)]
    fn unspill(&mut self) -> Option<Entry> {
        self.spilled.pop()
    }
}

/// Walks a tree from node 0, roughly front to back, as far as its boxes are entered no later than `far`.
///
/// `expand(node, far, stack)` puts those children of a node on the stack that the ray crosses up to `far`, and may hold
/// one back to return it: that one is next. `visit` gets the positions of a leaf's items; it returns the new `far`, no
/// larger than before, or breaks off the whole traversal. A box that is entered exactly at `far` is visited: what it
/// holds may tie.
#[inline(always)]
pub fn traverse(
    far: f32,
    mut expand: impl FnMut(u32, f32, &mut Stack) -> Option<Entry>,
    mut visit: impl FnMut(Range<usize>) -> ControlFlow<(), f32>,
) -> ControlFlow<()> {
    let mut far = far;
    let mut stack = Stack::new();
    let mut current = Entry { near: f32::NEG_INFINITY, first: 0, count: 0 };
    loop {
        let next = if current.count == 0 {
            expand(current.first, far, &mut stack)
        } else {
            let first = current.first as usize;
            far = visit(first..first + current.count as usize)?;
            None
        };
        match next.or_else(|| stack.pop(far)) {
            Some(entry) => current = entry,
            None => return ControlFlow::Continue(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_back_in_reverse_order_beyond_the_fixed_part_too() {
        let mut stack = Stack::new();
        let count = 3 * FIXED as u32;
        for first in 0..count {
            stack.push(Entry { near: first as f32, first, count: 1 });
        }
        for first in (0..count).rev().filter(|&first| first <= 70) {
            assert_eq!(stack.pop(70.0).map(|entry| entry.first), Some(first));
        }
        assert!(stack.pop(70.0).is_none());
    }
}
