//! Accessors: typed arrays in buffers, with strides, integers that stand for fractions, and sparse changes.
//!
//! The crate's own reader asserts that counts fit their buffers; here a file that lies is an error. Everything is
//! checked when an accessor is opened, before anything is allocated.

use ::gltf::json::accessor::{ComponentType, IndexComponentType, Type};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Index, Root, buffer};

use super::buffers::Buffers;
use crate::error::{Error, Result};

/// An accessor whose bytes were found and checked: elements `0..count` can be read.
#[derive(Debug)]
pub(super) struct Accessor<'a> {
    number: usize,
    count: usize,
    component: ComponentType,
    shape: Type,
    normalized: bool,
    /// `None` where every element is zero unless the sparse part changes it.
    base: Option<Elements<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Evenly spaced elements; the bytes reach from the start of the first to the end of the last.
#[derive(Debug)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

/// Elements that replace those of the base.
#[derive(Debug)]
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
        let bytes = buffers.view(root, view)?;
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
        let range = usize::try_from(offset).ok().zip(length).and_then(|(start, length)| {
            let end = start.checked_add(length)?;
            bytes.get(start..end)
        });
        let bytes = range.ok_or_else(|| {
            let (number, have) = (view.value(), bytes.len());
            Error::file(format!(
                "{count} elements of {size} bytes from {offset} reach beyond bufferViews[{number}], which has {have}"
            ))
        })?;
        Ok(Self { bytes, stride, size })
    }

    #[inline(always)]
    fn get(&self, number: usize) -> &'a [u8] {
        &self.bytes[number * self.stride..][..self.size]
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
        Ok(Self { number, count, component, shape, normalized: accessor.normalized, base, sparse })
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

    /// The bytes of an element; `None` for zeros. `number` is below [`count`](Self::count).
    #[inline(always)]
    fn element(&self, number: usize) -> Option<&'a [u8]> {
        if let Some(sparse) = &self.sparse
            && let Ok(place) = sparse.replaced.binary_search(&number)
        {
            return Some(sparse.values.get(place));
        }
        self.base.as_ref().map(|base| base.get(number))
    }

    /// Reads whole numbers: what `indices` of a primitive refers to.
    ///
    /// # Errors
    /// A file's error if the elements are not unsigned scalars.
    pub fn indices(&self) -> Result<Vec<u32>> {
        self.expect(Type::Scalar)?;
        let all = 0..self.count;
        match self.component {
            ComponentType::U8 => collect(all.map(|i| self.element(i).map_or(0, |bytes| u32::from(bytes[0])))),
            ComponentType::U16 => collect(all.map(|i| self.element(i).map_or(0, |bytes| u32::from(u16_at(bytes, 0))))),
            ComponentType::U32 => collect(all.map(|i| self.element(i).map_or(0, |bytes| u32_at(bytes, 0)))),
            _ => Err(Error::file(format!("accessors[{}] has signed or fractional vertex numbers", self.number))),
        }
    }

    /// Reads elements of `N` numbers: all, or those that `selection` lists, each below [`count`](Self::count).
    ///
    /// Normalised integers become fractions in [0, 1] or [-1, 1] (glTF 2.0, section 3.11), others keep their value.
    ///
    /// # Errors
    /// A file's error if the elements are not vectors of `N` numbers.
    pub fn vectors<const N: usize, T: From<[f32; N]>>(&self, selection: Option<&[u32]>) -> Result<Vec<T>> {
        self.expect(match N {
            2 => Type::Vec2,
            3 => Type::Vec3,
            _ => Type::Vec4,
        })?;
        use ComponentType::{F32, I8, I16, U8, U16, U32};
        match (self.component, self.normalized) {
            (F32, _) => self.decode(selection, |bytes, lane| f32::from_bits(u32_at(bytes, lane))),
            (U8, true) => self.decode(selection, |bytes, lane| f32::from(bytes[lane]) / 255.0),
            (U8, false) => self.decode(selection, |bytes, lane| f32::from(bytes[lane])),
            (I8, true) => self.decode(selection, |bytes, lane| (f32::from(bytes[lane] as i8) / 127.0).max(-1.0)),
            (I8, false) => self.decode(selection, |bytes, lane| f32::from(bytes[lane] as i8)),
            (U16, true) => self.decode(selection, |bytes, lane| f32::from(u16_at(bytes, lane)) / 65535.0),
            (U16, false) => self.decode(selection, |bytes, lane| f32::from(u16_at(bytes, lane))),
            (I16, true) => {
                self.decode(selection, |bytes, lane| (f32::from(u16_at(bytes, lane) as i16) / 32767.0).max(-1.0))
            }
            (I16, false) => self.decode(selection, |bytes, lane| f32::from(u16_at(bytes, lane) as i16)),
            (U32, _) => Err(Error::file(format!("accessors[{}] has 32-bit integers in a vertex", self.number))),
        }
    }

    fn decode<const N: usize, T: From<[f32; N]>>(
        &self,
        selection: Option<&[u32]>,
        lane: impl Fn(&[u8], usize) -> f32,
    ) -> Result<Vec<T>> {
        let decode = |number: usize| match self.element(number) {
            Some(bytes) => T::from(std::array::from_fn(|i| lane(bytes, i))),
            None => T::from([0.0; N]),
        };
        match selection {
            None => collect((0..self.count).map(decode)),
            Some(numbers) => collect(numbers.iter().map(|&number| decode(number as usize))),
        }
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
        let number = |i: usize| {
            let bytes = numbers.get(i);
            match component {
                ComponentType::U8 => usize::from(bytes[0]),
                ComponentType::U16 => usize::from(u16_at(bytes, 0)),
                _ => u32_at(bytes, 0) as usize,
            }
        };
        let replaced = collect((0..count).map(number))?;
        if !replaced.is_sorted_by(|a, b| a < b) || replaced.last().is_some_and(|&last| last >= base_count) {
            return Err(Error::file(format!("sparse.indices do not ascend strictly, or reach beyond {base_count}")));
        }
        Ok(Self { replaced, values })
    }
}

/// Collects into one exact allocation, whose failure is an error.
fn collect<T>(items: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut vec = Vec::new();
    vec.try_reserve_exact(items.len())
        .map_err(|_| Error::limit(format!("not enough memory for {} elements", items.len())))?;
    vec.extend(items);
    Ok(vec)
}

#[inline(always)]
fn u16_at(bytes: &[u8], lane: usize) -> u16 {
    u16::from_le_bytes([bytes[2 * lane], bytes[2 * lane + 1]])
}

#[inline(always)]
fn u32_at(bytes: &[u8], lane: usize) -> u32 {
    u32::from_le_bytes([bytes[4 * lane], bytes[4 * lane + 1], bytes[4 * lane + 2], bytes[4 * lane + 3]])
}
