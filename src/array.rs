//! Numbers in a row that lie in memory of their own or in a mapped file, read the same way.

#![allow(unsafe_code)]

use std::fmt;
use std::fs::File;
use std::io;
use std::ops::{Deref, DerefMut, Range};
use std::slice;
use std::sync::Arc;

use bytemuck::Pod;

/// A file that is mapped into memory, to be read: pages come from the disk when they are used, are shared by all processes that map
/// them, and are given back where memory is short.
#[derive(Debug)]
pub struct Mapping(memmap2::Mmap);

impl Mapping {
    /// Maps a file.
    ///
    /// Nobody may change its bytes or cut it while it is mapped: what is read then is not what was checked, and reading what was cut
    /// off ends the process. A file that is replaced by a rename, as this program writes all of its own, stays as long as it is mapped;
    /// but not where another machine replaces it in a network file system.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn of(file: &File) -> io::Result<Self> {
        // SAFETY: the map is read-only, and that nobody changes the file is asked of the user above. All types that are read from it
        // have a value for every pattern of bits.
        unsafe { memmap2::Mmap::map(file) }.map(Self)
    }

    /// All bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Tells the system that all of it will be needed, from front to back. A hint.
    pub fn expect_all(&self) {
        #[cfg(unix)]
        let _ = self.0.advise(memmap2::Advice::WillNeed);
    }
}

/// Values in a row, in a vector of their own or in a part of a mapped file. Those in a file are copied when they are first changed, and
/// all are when the array is cloned, unless they are in a file.
///
/// ```
/// use whitted::array::Array;
/// let mut squares: Array<u32> = (0..4).map(|n| n * n).collect();
/// squares.push(16);
/// assert_eq!(squares, [0, 1, 4, 9, 16]);
/// ```
pub struct Array<T> {
    /// Where the values lie, for reading without a look at the owner.
    start: *const T,
    len: usize,
    owner: Owner<T>,
}

enum Owner<T> {
    Own(Vec<T>),
    Mapped(Arc<Mapping>),
}

// SAFETY: the pointer leads to values of the owner, which are only changed by who has the array for itself.
unsafe impl<T: Send + Sync> Send for Array<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Sync for Array<T> {}

impl<T: Pod> Array<T> {
    /// The values in a range of a mapped file's bytes; `None` where it is not within the file, has no whole number of values, or does
    /// not begin where values may.
    pub fn mapped(mapping: &Arc<Mapping>, range: Range<usize>) -> Option<Self> {
        let values: &[T] = bytemuck::try_cast_slice(mapping.bytes().get(range)?).ok()?;
        Some(Self { start: values.as_ptr(), len: values.len(), owner: Owner::Mapped(Arc::clone(mapping)) })
    }
}

impl<T> Array<T> {
    /// The values.
    #[inline(always)]
    pub fn as_slice(&self) -> &[T] {
        // SAFETY: `start` and `len` are those of the owner's values, which stay where they are until it is changed, when both are
        // set anew.
        unsafe { slice::from_raw_parts(self.start, self.len) }
    }

    /// Whether the values lie in a mapped file.
    pub fn is_mapped(&self) -> bool {
        matches!(self.owner, Owner::Mapped(_))
    }

    /// Bytes of the values.
    pub fn bytes(&self) -> usize {
        size_of_val(self.as_slice())
    }
}

impl<T: Clone> Array<T> {
    /// The values in a vector, copied from a file that they lie in.
    pub fn into_vec(self) -> Vec<T> {
        let copy = if self.is_mapped() { self.to_vec() } else { Vec::new() };
        match self.owner {
            Owner::Own(values) => values,
            Owner::Mapped(_) => copy,
        }
    }

    /// Changes the values as a vector.
    pub fn update<R>(&mut self, change: impl FnOnce(&mut Vec<T>) -> R) -> R {
        let mut values = std::mem::take(self).into_vec();
        let result = change(&mut values);
        *self = values.into();
        result
    }

    /// Appends a value.
    pub fn push(&mut self, value: T) {
        self.update(|values| values.push(value));
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(values: Vec<T>) -> Self {
        Self { start: values.as_ptr(), len: values.len(), owner: Owner::Own(values) }
    }
}

impl<T, const N: usize> From<[T; N]> for Array<T> {
    fn from(values: [T; N]) -> Self {
        Vec::from(values).into()
    }
}

impl<T> FromIterator<T> for Array<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Vec::from_iter(values).into()
    }
}

impl<T: Clone> Extend<T> for Array<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, values: I) {
        self.update(|own| own.extend(values));
    }
}

impl<'a, T> IntoIterator for &'a Array<T> {
    type Item = &'a T;
    type IntoIter = slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.as_slice().iter()
    }
}

impl<'a, T: Clone> IntoIterator for &'a mut Array<T> {
    type Item = &'a mut T;
    type IntoIter = slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

impl<T> Default for Array<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        self.as_slice()
    }
}

impl<T: Clone> DerefMut for Array<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if self.is_mapped() {
            self.update(|_| ());
        }
        match &mut self.owner {
            Owner::Own(values) => values,
            Owner::Mapped(_) => unreachable!("it was copied"),
        }
    }
}

impl<T: Clone> Clone for Array<T> {
    fn clone(&self) -> Self {
        match &self.owner {
            Owner::Own(values) => values.clone().into(),
            Owner::Mapped(mapping) => {
                Self { start: self.start, len: self.len, owner: Owner::Mapped(Arc::clone(mapping)) }
            }
        }
    }
}

impl<T: fmt::Debug> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_slice().fmt(f)
    }
}

impl<T: PartialEq, U: AsRef<[T]> + ?Sized> PartialEq<U> for Array<T> {
    fn eq(&self, other: &U) -> bool {
        self.as_slice() == other.as_ref()
    }
}

impl<T: Eq> Eq for Array<T> {}

impl<T> AsRef<[T]> for Array<T> {
    fn as_ref(&self) -> &[T] {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapping(bytes: &[u8]) -> Arc<Mapping> {
        let mut file = tempfile::tempfile().unwrap();
        io::Write::write_all(&mut file, bytes).unwrap();
        Arc::new(Mapping::of(&file).unwrap())
    }

    #[test]
    fn values_in_a_file_are_copied_when_they_are_changed() {
        let mapping = mapping(bytemuck::cast_slice(&[1u32, 2, 3, 4]));
        let mapped: Array<u32> = Array::mapped(&mapping, 4..16).unwrap();
        assert!(mapped.is_mapped() && mapped.clone().is_mapped());
        assert_eq!((&mapped[..], mapped.bytes()), (&[2, 3, 4][..], 12));
        let mut changed = mapped.clone();
        changed[1] = 9;
        assert!(!changed.is_mapped());
        let mut longer = mapped.clone();
        longer.extend([5, 6]);
        drop(mapping);
        assert_eq!(
            (changed, longer, mapped.into_vec()),
            (vec![2, 9, 4].into(), vec![2, 3, 4, 5, 6].into(), vec![2, 3, 4])
        );
    }

    #[test]
    fn values_begin_where_they_may_and_are_whole() {
        let mapping = mapping(&[0; 64]);
        for range in [1..9, 0..6, 60..68, 80..84] {
            assert!(Array::<u32>::mapped(&mapping, range.clone()).is_none(), "{range:?}");
        }
        assert_eq!(Array::<u32>::mapped(&mapping, 64..64).unwrap().len(), 0);
        assert_eq!(Array::<[u8; 3]>::mapped(&mapping, 1..7).unwrap(), [[0; 3]; 2]);
    }

    #[test]
    fn arrays_change_as_vectors_do() {
        let mut array = Array::from([1, 2, 3]);
        array.push(4);
        array.iter_mut().for_each(|value| *value *= 2);
        array.update(|values| values.retain(|&value| value != 4));
        assert_eq!(array, [2, 6, 8]);
        let moved = array;
        assert_eq!(moved.clone(), moved);
        assert_eq!(moved.into_iter().sum::<i32>(), 16);
    }
}
