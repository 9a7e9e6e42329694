//! Accessors: typed arrays in buffers, with strides, integers that stand for fractions, and sparse changes.
//!
//! The crate's own reader asserts that counts fit their buffers; here a file that lies is an error. Everything is
//! checked when an accessor is opened, before anything is allocated, and read piece by piece once it is asked for.

use std::ops::Range;

use ::gltf::json::accessor::{ComponentType, IndexComponentType, Type};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Index, Root, buffer};

use super::buffers::Buffers;
use super::bytes::Bytes;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// How many bytes are read at once: few enough to stay in a processor's cache until they are decoded.
const PIECE: usize = 1 << 17;

/// Elements with more bytes than this between them are read apart: about where a second reading costs as much as the
/// bytes that it saves.
const GAP: usize = 1 << 12;

/// An accessor whose place was found and checked: elements `0..count` can be read.
pub(super) struct Accessor<'a> {
    number: usize,
    count: usize,
    component: ComponentType,
    shape: Type,
    normalized: bool,
    /// `None` where every element is zero unless the sparse part changes it.
    base: Option<Elements<'a>>,
    sparse: Option<Sparse<'a>>,
    progress: &'a dyn Progress,
}

/// Evenly spaced elements of a buffer.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a Bytes<'a>,
    /// Where the first one starts.
    start: u64,
    stride: usize,
    size: usize,
}

/// Elements that replace those of the base.
struct Sparse<'a> {
    /// Numbers of the replaced elements, strictly ascending.
    replaced: Vec<usize>,
    values: Elements<'a>,
}

impl<'a> Elements<'a> {
    /// Finds `count` elements of `size` bytes from `offset` in a buffer view.
    fn find(
        root: &Root,
        buffers: &'a Buffers,
        view: Index<buffer::View>,
        (offset, count, size): (u64, usize, usize),
    ) -> Result<Self> {
        let (bytes, range) = buffers.locate(root, view)?;
        // A stride of 0 is what some exporters write for "tightly packed".
        let stride = root.buffer_views[view.value()].byte_stride.map_or(0, |stride| stride.0);
        let stride = if stride == 0 { size } else { stride };
        if stride < size {
            let number = view.value();
            let text =
                format!("the stride of {stride} bytes in bufferViews[{number}] is less than an element's {size}");
            return Err(Error::file(text));
        }
        let length = match count.checked_sub(1) {
            Some(last) => last.checked_mul(stride).and_then(|start| start.checked_add(size)),
            None => Some(0),
        };
        let start = range.start.checked_add(offset);
        let end = start.zip(length).and_then(|(start, length)| start.checked_add(length as u64));
        match start.zip(end) {
            Some((start, end)) if end <= range.end => Ok(Self { bytes, start, stride, size }),
            _ => {
                let (number, have) = (view.value(), range.end - range.start);
                Err(Error::file(format!(
                    "{count} elements of {size} bytes from {offset} reach beyond bufferViews[{number}], which has {have}"
                )))
            }
        }
    }

    /// Gives `visit` the bytes of each element whose number is in the range, in order.
    fn each(
        &self,
        numbers: Range<usize>,
        progress: &dyn Progress,
        scratch: &mut Vec<u8>,
        mut visit: impl FnMut(&[u8]),
    ) -> Result<()> {
        let at_once = (PIECE / self.stride.max(1)).max(1);
        for first in numbers.clone().step_by(at_once) {
            progress.check()?;
            let count = at_once.min(numbers.end - first);
            let bytes = self.read(first..first + count, scratch)?;
            match self.stride == self.size && self.size > 0 {
                true => bytes.chunks_exact(self.size).for_each(&mut visit),
                false => (0..count).for_each(|i| visit(&bytes[i * self.stride..][..self.size])),
            }
            progress.advance((count * self.size) as u64);
        }
        Ok(())
    }

    /// The same for numbers that ascend.
    fn each_of(
        &self,
        numbers: &[u32],
        progress: &dyn Progress,
        scratch: &mut Vec<u8>,
        mut visit: impl FnMut(&[u8]),
    ) -> Result<()> {
        let mut rest = numbers;
        while let Some(&first) = rest.first() {
            progress.check()?;
            let is_near = |pair: &[u32]| {
                let (gap, length) = ((pair[1] - pair[0]) as usize, (pair[1] - first) as usize);
                gap.saturating_mul(self.stride) <= GAP && length.saturating_mul(self.stride) <= PIECE
            };
            let run;
            (run, rest) = rest.split_at(1 + rest.windows(2).take_while(|pair| is_near(pair)).count());
            let last = run[run.len() - 1];
            let bytes = self.read(first as usize..last as usize + 1, scratch)?;
            run.iter().for_each(|&number| visit(&bytes[(number - first) as usize * self.stride..][..self.size]));
            progress.advance((run.len() * self.size) as u64);
        }
        Ok(())
    }

    /// The bytes from the start of the first to the end of the last of some elements, at least one.
    fn read<'s>(&'s self, numbers: Range<usize>, scratch: &'s mut Vec<u8>) -> Result<&'s [u8]> {
        let place = |number: usize| self.start + (number * self.stride) as u64;
        self.bytes.read(place(numbers.start)..place(numbers.end - 1) + self.size as u64, scratch)
    }
}

impl<'a> Accessor<'a> {
    /// Finds and checks the bytes of an accessor.
    ///
    /// # Errors
    /// A file's error that names the accessor, if it reaches beyond its buffer view or is inconsistent.
    pub fn open(root: &Root, buffers: &'a Buffers, index: Index<json::Accessor>) -> Result<Self> {
        let number = index.value();
        let named = |error: Error| error.within(format_args!("accessors[{number}]"));
        let accessor = root.accessors.get(number).ok_or_else(|| named(Error::file("does not exist")))?;
        Self::check(root, buffers, number, accessor).map_err(named)
    }

    fn check(root: &Root, buffers: &'a Buffers, number: usize, accessor: &json::Accessor) -> Result<Self> {
        let Checked::Valid(component) = accessor.component_type else {
            return Err(Error::file("componentType is none of 5120, 5121, 5122, 5123, 5125, 5126"));
        };
        let (component, Checked::Valid(shape)) = (component.0, accessor.type_) else {
            return Err(Error::file("type is none of SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3, MAT4"));
        };
        let too_many = |count: u64| Error::limit(format!("{count} elements are too many"));
        let count = usize::try_from(accessor.count.0).map_err(|_| too_many(accessor.count.0))?;
        let size = component.size() * shape.multiplicity();
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let base = match accessor.buffer_view {
            Some(view) => Some(Elements::find(root, buffers, view, (offset, count, size))?),
            // Nothing in the file vouches for the count of an array of zeros. Indices take a byte each, so beyond this
            // limit there are elements that nothing can refer to.
            None if accessor.count.0 > buffers.total_bytes() => return Err(too_many(accessor.count.0)),
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => Some(Sparse::find(root, buffers, sparse, (count, size))?),
            None => None,
        };
        Ok(Self {
            number,
            count,
            component,
            shape,
            normalized: accessor.normalized,
            base,
            sparse,
            progress: buffers.progress,
        })
    }

    /// Number of elements.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether the file has bytes for it, rather than zeros that an extension was to replace.
    pub fn has_data(&self) -> bool {
        self.base.is_some() || self.sparse.is_some()
    }

    fn expect(&self, shape: Type) -> Result<()> {
        if self.shape == shape {
            return Ok(());
        }
        let text =
            format!("accessors[{}] has elements of type {:?} where {shape:?} is needed", self.number, self.shape);
        Err(Error::file(text))
    }

    /// Appends what `decode` makes of the bytes of each element: of all, or of those that `selection` lists.
    fn extend<T>(&self, selection: Option<&[u32]>, out: &mut Vec<T>, decode: impl Fn(&[u8]) -> T) -> Result<()> {
        let wanted = selection.map_or(self.count, <[u32]>::len);
        reserve(out, wanted)?;
        let start = out.len();
        let mut scratch = Vec::new();
        let visit = |bytes: &[u8]| out.push(decode(bytes));
        match (&self.base, selection) {
            (Some(base), None) => base.each(0..self.count, self.progress, &mut scratch, visit)?,
            (Some(base), Some(numbers)) => base.each_of(numbers, self.progress, &mut scratch, visit)?,
            (None, _) => {
                let zeros = vec![0; self.component.size() * self.shape.multiplicity()];
                out.extend((0..wanted).map(|_| decode(&zeros)));
            }
        }
        let Some(sparse) = &self.sparse else { return Ok(()) };
        let mut places = sparse.replaced.iter().map(|&number| match selection {
            None => Some(number),
            Some(numbers) => numbers.binary_search(&(number as u32)).ok(),
        });
        sparse.values.each(0..sparse.replaced.len(), self.progress, &mut scratch, |bytes| {
            if let Some(Some(place)) = places.next() {
                out[start + place] = decode(bytes);
            }
        })
    }

    /// Reads whole numbers: what `indices` of a primitive refers to.
    ///
    /// # Errors
    /// A file's error if the elements are not unsigned scalars.
    pub fn indices(&self) -> Result<Vec<u32>> {
        let mut indices = Vec::new();
        match self.index_type()? {
            ComponentType::U8 => self.extend(None, &mut indices, |bytes| u32::from(bytes[0]))?,
            ComponentType::U16 => self.extend(None, &mut indices, |bytes| u32::from(u16_at(bytes, 0)))?,
            _ => self.extend(None, &mut indices, |bytes| u32_at(bytes, 0))?,
        }
        Ok(indices)
    }

    /// Appends every three whole numbers, each as `vertex` makes it; up to two that are left over are not read.
    ///
    /// # Errors
    /// As [`indices`](Self::indices).
    pub fn triangles(&self, out: &mut Vec<[u32; 3]>, vertex: impl Fn(u32) -> u32) -> Result<()> {
        let component = self.index_type()?;
        let whole = match (&self.base, &self.sparse) {
            (Some(base), None) if base.stride == base.size => base,
            _ => {
                reserve(out, self.count / 3)?;
                out.extend(self.indices()?.as_chunks::<3>().0.iter().map(|corners| corners.map(&vertex)));
                return Ok(());
            }
        };
        // Three indices are one element.
        let base = Elements { stride: 3 * whole.stride, size: 3 * whole.size, ..*whole };
        let triples = Self { count: self.count / 3, base: Some(base), sparse: None, ..*self };
        let three = |read: &dyn Fn(usize) -> u32| [0, 1, 2].map(|corner| vertex(read(corner)));
        match component {
            ComponentType::U8 => triples.extend(None, out, |bytes| three(&|corner| u32::from(bytes[corner]))),
            ComponentType::U16 => triples.extend(None, out, |bytes| three(&|corner| u32::from(u16_at(bytes, corner)))),
            _ => triples.extend(None, out, |bytes| three(&|corner| u32_at(bytes, corner))),
        }
    }

    fn index_type(&self) -> Result<ComponentType> {
        self.expect(Type::Scalar)?;
        match self.component {
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32 => Ok(self.component),
            _ => Err(Error::file(format!("accessors[{}] has signed or fractional vertex numbers", self.number))),
        }
    }

    /// Reads the numbers of joints: four a vertex.
    ///
    /// # Errors
    /// A file's error if the elements are not four unsigned bytes or shorts.
    pub fn joints(&self, selection: Option<&[u32]>) -> Result<Vec<[u16; 4]>> {
        self.expect(Type::Vec4)?;
        let mut joints = Vec::new();
        match self.component {
            ComponentType::U8 => {
                self.extend(selection, &mut joints, |bytes| std::array::from_fn(|i| u16::from(bytes[i])))?;
            }
            ComponentType::U16 => {
                self.extend(selection, &mut joints, |bytes| std::array::from_fn(|i| u16_at(bytes, i)))?;
            }
            _ => return Err(Error::file(format!("accessors[{}] has joints that are no whole numbers", self.number))),
        }
        Ok(joints)
    }

    /// Reads elements of `N` numbers: all, or those that `selection` lists, ascending and each below
    /// [`count`](Self::count).
    ///
    /// # Errors
    /// As [`extend_vectors`](Self::extend_vectors).
    pub fn vectors<const N: usize, T: From<[f32; N]>>(&self, selection: Option<&[u32]>) -> Result<Vec<T>> {
        let mut vectors = Vec::new();
        self.extend_vectors(selection, &mut vectors, T::from)?;
        Ok(vectors)
    }

    /// Appends what `make` makes of each element of `N` numbers: of all, or of those that `selection` lists, ascending
    /// and each below [`count`](Self::count).
    ///
    /// Normalised integers become fractions in [0, 1] or [-1, 1] (glTF 2.0, section 3.11), others keep their value.
    ///
    /// # Errors
    /// A file's error if the elements are not vectors of `N` numbers.
    pub fn extend_vectors<const N: usize, T>(
        &self,
        selection: Option<&[u32]>,
        out: &mut Vec<T>,
        make: impl Fn([f32; N]) -> T,
    ) -> Result<()> {
        self.expect(match N {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            4 => Type::Vec4,
            _ => Type::Mat4,
        })?;
        let lanes = |lane: &dyn Fn(usize) -> f32| make(std::array::from_fn(lane));
        use ComponentType::{F32, I8, I16, U8, U16, U32};
        match (self.component, self.normalized) {
            (F32, _) => self.extend(selection, out, |bytes| {
                let words = bytes.as_chunks::<4>().0;
                make(std::array::from_fn(|i| f32::from_le_bytes(words[i])))
            }),
            (U8, true) => self.extend(selection, out, |bytes| lanes(&|i| f32::from(bytes[i]) / 255.0)),
            (U8, false) => self.extend(selection, out, |bytes| lanes(&|i| f32::from(bytes[i]))),
            (I8, true) => {
                self.extend(selection, out, |bytes| lanes(&|i| (f32::from(bytes[i] as i8) / 127.0).max(-1.0)))
            }
            (I8, false) => self.extend(selection, out, |bytes| lanes(&|i| f32::from(bytes[i] as i8))),
            (U16, true) => self.extend(selection, out, |bytes| lanes(&|i| f32::from(u16_at(bytes, i)) / 65535.0)),
            (U16, false) => self.extend(selection, out, |bytes| lanes(&|i| f32::from(u16_at(bytes, i)))),
            (I16, true) => self
                .extend(selection, out, |bytes| lanes(&|i| (f32::from(u16_at(bytes, i) as i16) / 32767.0).max(-1.0))),
            (I16, false) => self.extend(selection, out, |bytes| lanes(&|i| f32::from(u16_at(bytes, i) as i16))),
            (U32, _) => Err(Error::file(format!("accessors[{}] has 32-bit integers in a vertex", self.number))),
        }
    }

    /// Reads some elements as numbers, one after the other: scalars, vectors of three or four, or matrices of 16.
    ///
    /// # Errors
    /// A file's error if the elements are of another type, or beyond the end.
    pub fn numbers(&self, elements: Range<usize>) -> Result<Vec<f64>> {
        if elements.end > self.count {
            let (number, count, end) = (self.number, self.count, elements.end);
            return Err(Error::file(format!("accessors[{number}] has {count} elements where {end} are needed")));
        }
        let selection: Vec<u32> = elements.map(|element| element as u32).collect();
        match self.shape {
            Type::Vec3 => self.flat::<3>(&selection),
            Type::Vec4 => self.flat::<4>(&selection),
            Type::Mat4 => self.flat::<16>(&selection),
            _ => self.flat::<1>(&selection),
        }
    }

    fn flat<const N: usize>(&self, selection: &[u32]) -> Result<Vec<f64>> {
        let mut elements = Vec::new();
        self.extend_vectors(Some(selection), &mut elements, |numbers: [f32; N]| numbers.map(f64::from))?;
        Ok(elements.into_flattened())
    }

    /// What an element is.
    pub fn shape(&self) -> Type {
        self.shape
    }

    /// Whether its numbers are integers.
    pub fn has_integers(&self) -> bool {
        self.component != ComponentType::F32
    }

    /// Whether integers stand for fractions.
    pub fn is_normalized(&self) -> bool {
        self.normalized
    }

    /// The same numbers, taken for fractions.
    pub fn in_fractions(self) -> Self {
        Self { normalized: true, ..self }
    }

    /// Whether some elements are replaced by a sparse part.
    pub fn is_sparse(&self) -> bool {
        self.sparse.is_some()
    }
}

impl<'a> Sparse<'a> {
    fn find(
        root: &Root,
        buffers: &'a Buffers,
        sparse: &json::accessor::sparse::Sparse,
        (base_count, size): (usize, usize),
    ) -> Result<Self> {
        let Checked::Valid(IndexComponentType(component)) = sparse.indices.component_type else {
            return Err(Error::file("sparse.indices.componentType is none of 5121, 5123, 5125"));
        };
        let count = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
        let (indices, values) = (&sparse.indices, &sparse.values);
        let place = (indices.byte_offset.0, count, component.size());
        let numbers = Elements::find(root, buffers, indices.buffer_view, place)
            .map_err(|error| error.within("sparse.indices"))?;
        let values = Elements::find(root, buffers, values.buffer_view, (values.byte_offset.0, count, size))
            .map_err(|error| error.within("sparse.values"))?;
        let mut replaced = Vec::new();
        reserve(&mut replaced, count)?;
        numbers.each(0..count, buffers.progress, &mut Vec::new(), |bytes| {
            replaced.push(match component {
                ComponentType::U8 => usize::from(bytes[0]),
                ComponentType::U16 => usize::from(u16_at(bytes, 0)),
                _ => u32_at(bytes, 0) as usize,
            });
        })?;
        if !replaced.is_sorted_by(|a, b| a < b) || replaced.last().is_some_and(|&last| last >= base_count) {
            return Err(Error::file(format!("sparse.indices do not ascend strictly, or reach beyond {base_count}")));
        }
        Ok(Self { replaced, values })
    }
}

/// Makes room for more, the failure of which is an error. Where there is nothing yet the room is exact.
fn reserve<T>(vec: &mut Vec<T>, more: usize) -> Result<()> {
    let outcome = if vec.is_empty() { vec.try_reserve_exact(more) } else { vec.try_reserve(more) };
    outcome.map_err(|_| Error::limit(format!("not enough memory for {more} elements")))
}

#[inline(always)]
fn u16_at(bytes: &[u8], lane: usize) -> u16 {
    u16::from_le_bytes([bytes[2 * lane], bytes[2 * lane + 1]])
}

#[inline(always)]
fn u32_at(bytes: &[u8], lane: usize) -> u32 {
    u32::from_le_bytes([bytes[4 * lane], bytes[4 * lane + 1], bytes[4 * lane + 2], bytes[4 * lane + 3]])
}
