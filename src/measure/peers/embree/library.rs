//! The one file that speaks to Embree: what is used of its C interface (rtcore 4.x), and safe calls around it.
//!
//! Layouts and values are those of `embree4/rtcore_*.h` in version 4.4, one level of instances, as Embree is built unless it
//! is told otherwise. Records may be longer than those of a version without instance arrays: only their ends are unused then.

#![expect(unsafe_code, reason = "a C interface: each block says why it is sound")]

use std::ffi::{CString, c_char, c_void};
use std::path::{Path, PathBuf};
use std::ptr::{null, null_mut};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Instant;

use crate::error::{Error, Result};
use crate::geometry::{Hit, Ray};
use crate::measure::peers::{Built, Peer, Surface};

/// A device, scene or geometry.
type Handle = *mut c_void;

const DEVICE_VERSION_MAJOR: i32 = 1;
const DEVICE_VERSION_MINOR: i32 = 2;
const DEVICE_VERSION_PATCH: i32 = 3;
const DEVICE_NATIVE_PACKETS: [(i32, usize); 3] = [(34, 16), (33, 8), (32, 4)];
const GEOMETRY_TRIANGLES: i32 = 0;
const BUFFER_INDICES: i32 = 0;
const BUFFER_VERTICES: i32 = 1;
const FORMAT_U32_3: i32 = 0x5003;
const FORMAT_F32_3: i32 = 0x9003;
const QUALITY_MEDIUM: i32 = 1;
const SCENE_ROBUST: i32 = 1 << 2;
const QUERY_COHERENT: i32 = 1 << 16;
const ALL_FEATURES: u32 = u32::MAX;
const NOTHING: u32 = u32::MAX;

macro_rules! functions {
    ($($name:ident = $symbol:literal fn($($argument:ty),*) $(-> $result:ty)?;)+) => {
        /// The functions that are used, by what they do.
        #[derive(Clone, Copy)]
        struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)+
        }

        impl Functions {
            /// Looks the functions up; the name of the first one that is not there.
            fn find(library: &libloading::Library) -> std::result::Result<Self, &'static str> {
                Ok(Self {
                    $($name: {
                        // SAFETY: the type is that of the function in Embree's headers; that the library is Embree 4 is
                        // what its user says, and its version is asked for before anything else is called.
                        let found = unsafe { library.get::<unsafe extern "C" fn($($argument),*) $(-> $result)?>($symbol) };
                        *found.map_err(|_| $symbol)?
                    },)+
                })
            }
        }
    };
}

type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

functions! {
    new_device = "rtcNewDevice" fn(*const c_char) -> Handle;
    release_device = "rtcReleaseDevice" fn(Handle);
    device_property = "rtcGetDeviceProperty" fn(Handle, i32) -> isize;
    device_error = "rtcGetDeviceError" fn(Handle) -> i32;
    set_memory_monitor = "rtcSetDeviceMemoryMonitorFunction" fn(Handle, MemoryMonitor, *mut c_void);
    new_scene = "rtcNewScene" fn(Handle) -> Handle;
    release_scene = "rtcReleaseScene" fn(Handle);
    set_scene_flags = "rtcSetSceneFlags" fn(Handle, i32);
    set_scene_quality = "rtcSetSceneBuildQuality" fn(Handle, i32);
    commit_scene = "rtcCommitScene" fn(Handle);
    new_geometry = "rtcNewGeometry" fn(Handle, i32) -> Handle;
    release_geometry = "rtcReleaseGeometry" fn(Handle);
    share_buffer = "rtcSetSharedGeometryBuffer" fn(Handle, i32, u32, i32, *const c_void, usize, usize, usize);
    commit_geometry = "rtcCommitGeometry" fn(Handle);
    attach_geometry = "rtcAttachGeometryByID" fn(Handle, Handle, u32);
    intersect_1 = "rtcIntersect1" fn(Handle, *mut SingleQuery, *mut Arguments);
    occluded_1 = "rtcOccluded1" fn(Handle, *mut SingleRay, *mut Arguments);
    intersect_4 = "rtcIntersect4" fn(*const i32, Handle, *mut PacketQuery<4>, *mut Arguments);
    occluded_4 = "rtcOccluded4" fn(*const i32, Handle, *mut PacketRay<4>, *mut Arguments);
    intersect_8 = "rtcIntersect8" fn(*const i32, Handle, *mut PacketQuery<8>, *mut Arguments);
    occluded_8 = "rtcOccluded8" fn(*const i32, Handle, *mut PacketRay<8>, *mut Arguments);
    intersect_16 = "rtcIntersect16" fn(*const i32, Handle, *mut PacketQuery<16>, *mut Arguments);
    occluded_16 = "rtcOccluded16" fn(*const i32, Handle, *mut PacketRay<16>, *mut Arguments);
}

/// `RTCRay`.
#[repr(C, align(16))]
struct SingleRay {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

/// `RTCHit`.
#[repr(C, align(16))]
struct SingleHit {
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: u32,
    instance_primitive: u32,
}

/// `RTCRayHit`.
#[repr(C)]
struct SingleQuery {
    ray: SingleRay,
    hit: SingleHit,
}

/// `RTCRay4`, `RTCRay8` or `RTCRay16`, aligned as the last, which is enough for all.
#[repr(C, align(64))]
struct PacketRay<const W: usize> {
    origin: [[f32; W]; 3],
    t_near: [f32; W],
    direction: [[f32; W]; 3],
    time: [f32; W],
    t_far: [f32; W],
    mask: [u32; W],
    id: [u32; W],
    flags: [u32; W],
}

/// `RTCHit4`, `RTCHit8` or `RTCHit16`. It follows its rays at once: they fill a multiple of 64 bytes.
#[repr(C, align(64))]
struct PacketHit<const W: usize> {
    normal: [[f32; W]; 3],
    u: [f32; W],
    v: [f32; W],
    primitive: [u32; W],
    geometry: [u32; W],
    instance: [u32; W],
    instance_primitive: [u32; W],
}

/// `RTCRayHit4`, `RTCRayHit8` or `RTCRayHit16`.
#[repr(C)]
struct PacketQuery<const W: usize> {
    ray: PacketRay<W>,
    hit: PacketHit<W>,
}

/// Which rays of a packet count: -1 for those that do.
#[repr(C, align(64))]
struct Valid<const W: usize>([i32; W]);

/// `RTCIntersectArguments` and `RTCOccludedArguments`.
#[repr(C)]
struct Arguments {
    flags: i32,
    features: u32,
    context: *mut c_void,
    filter: *const c_void,
    user_geometry: *const c_void,
    min_width_factor: f32,
}

impl Arguments {
    fn coherent() -> Self {
        Self {
            flags: QUERY_COHERENT,
            features: ALL_FEATURES,
            context: null_mut(),
            filter: null(),
            user_geometry: null(),
            min_width_factor: 0.0,
        }
    }
}

/// The loaded library.
#[derive(Clone)]
pub struct Library {
    functions: Functions,
    path: PathBuf,
    version: [isize; 3],
    packet_width: Option<usize>,
}

impl Library {
    /// Loads the library of that name: a file's path, or a name that the system knows.
    ///
    /// # Errors
    /// What cannot be loaded, or is not Embree 4.
    pub fn load(path: &Path) -> Result<Self> {
        const REMEDY: &str = "name the file of Embree 4, such as libembree4.so.4";
        // The system looks for bare names in its own folders only.
        let place =
            if path.is_file() { path.canonicalize().unwrap_or_else(|_| path.into()) } else { path.to_path_buf() };
        // SAFETY: the library's initialisers run, and the user who named it answers for them.
        let library = unsafe { libloading::Library::new(&place) }.map_err(|cause| {
            Error::caller(format!("cannot be loaded: {}", root_cause(&cause))).at_path(path).remedy(REMEDY)
        })?;
        let functions = Functions::find(&library).map_err(|missing| {
            Error::caller(format!("is not Embree 4: there is no `{missing}` in it")).at_path(path).remedy(REMEDY)
        })?;
        // Its worker threads may outlive every scene: the code stays where it is until the process ends.
        std::mem::forget(library);
        let mut found = Self { functions, path: path.to_path_buf(), version: [0; 3], packet_width: None };
        let device = Device::new(&found, 1)?;
        found.version =
            [DEVICE_VERSION_MAJOR, DEVICE_VERSION_MINOR, DEVICE_VERSION_PATCH].map(|what| device.property(what));
        if found.version[0] != 4 {
            let [major, minor, patch] = found.version;
            let message = format!("is Embree {major}.{minor}.{patch}, and its interface is another one");
            return Err(Error::caller(message).at_path(path).remedy(REMEDY));
        }
        let native = DEVICE_NATIVE_PACKETS.into_iter().find(|(property, _)| device.property(*property) != 0);
        found.packet_width = native.map(|(_, width)| width);
        Ok(found)
    }

    /// Its version, and the instruction set it chose as its widest native packets tell it.
    pub fn description(&self) -> String {
        let [major, minor, patch] = self.version;
        let packets = match self.packet_width {
            Some(16) => "packets of 16, so AVX-512".to_owned(),
            Some(8) => "packets of 8, so AVX or AVX2".to_owned(),
            Some(width) => format!("packets of {width}"),
            None => "no packets".to_owned(),
        };
        format!("Embree {major}.{minor}.{patch}, {packets}")
    }

    /// How many rays its widest native packets hold; `None` if it was built without.
    pub fn packet_width(&self) -> Option<usize> {
        self.packet_width
    }
}

/// What is at the bottom of a chain of errors.
fn root_cause(error: &dyn std::error::Error) -> String {
    error.source().map_or_else(|| error.to_string(), root_cause)
}

/// An Embree device, and the bytes that it has allocated.
struct Device {
    functions: Functions,
    handle: Handle,
    bytes: Box<AtomicI64>,
}

impl Device {
    fn new(library: &Library, threads: usize) -> Result<Self> {
        let functions = library.functions;
        let configuration = CString::new(format!("threads={threads},set_affinity=0")).expect("there is no NUL in it");
        // SAFETY: the string ends with NUL and is read during the call alone.
        let handle = unsafe { (functions.new_device)(configuration.as_ptr()) };
        let device = Self { functions, handle, bytes: Box::default() };
        if handle.is_null() {
            return Err(device.error().at_path(&library.path));
        }
        // SAFETY: the counter is in a box of its own, which is freed after the device.
        unsafe { (functions.set_memory_monitor)(handle, count_bytes, (&raw const *device.bytes).cast_mut().cast()) };
        Ok(device)
    }

    fn property(&self, property: i32) -> isize {
        // SAFETY: the device is alive; properties that it does not know give 0 and an error code that is cleared here.
        unsafe {
            let value = (self.functions.device_property)(self.handle, property);
            (self.functions.device_error)(self.handle);
            value
        }
    }

    /// The last error; without a device that of its making.
    fn error(&self) -> Error {
        // SAFETY: null asks for the error of this thread.
        match unsafe { (self.functions.device_error)(self.handle) } {
            4 => Error::limit("Embree has not enough memory"),
            5 => Error::unsupported("Embree does not support this processor"),
            code => Error::limit(format!("Embree failed with its error code {code}")),
        }
    }

    fn check(&self) -> Result<()> {
        // SAFETY: the device is alive.
        let code = unsafe { (self.functions.device_error)(self.handle) };
        match code {
            0 => Ok(()),
            4 => Err(Error::limit("Embree has not enough memory")),
            _ => Err(Error::limit(format!("Embree failed with its error code {code}"))),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: the only reference of ours, released once; scenes were released before.
            unsafe { (self.functions.release_device)(self.handle) };
        }
    }
}

/// Adds what was allocated, or subtracts what was freed; called by any thread of Embree's.
unsafe extern "C" fn count_bytes(counter: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: the pointer is the one that `Device::new` gave, to a counter that lives longer than the device.
    let counter = unsafe { &*counter.cast::<AtomicI64>() };
    counter.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

/// A committed scene of triangles.
pub struct EmbreeScene {
    functions: Functions,
    handle: Handle,
    packet_width: Option<usize>,
    /// Released after the scene.
    _device: Device,
    /// Embree reads vertices and indices where they are.
    _surfaces: Arc<[Surface]>,
}

// SAFETY: a committed scene may be asked from many threads at once (the manual's section on rtcIntersect1), and nothing of
// it changes until it is released, which any one thread may do.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// Builds a scene of medium quality with this many threads; `robust` asks for its watertight tests.
    ///
    /// # Errors
    /// What Embree reports.
    ///
    /// # Panics
    /// If an index is not below the number of vertices.
    pub fn build(library: &Library, surfaces: &Arc<[Surface]>, robust: bool, threads: usize) -> Result<Built<Self>> {
        let device = Device::new(library, threads)?;
        let functions = library.functions;
        for surface in surfaces.iter() {
            let count = surface.vertex_count() as u32;
            assert!(surface.indices.iter().flatten().all(|&index| index < count), "indices are those of vertices");
            assert!(surface.coordinates.len() > 3 * count as usize, "the last vertex can be read as four numbers");
        }
        let _surfaces = Arc::clone(surfaces);
        // SAFETY: the device is alive. What it gives is owned by the value, whose drop releases it.
        let handle = unsafe { (functions.new_scene)(device.handle) };
        let scene = Self { functions, handle, packet_width: library.packet_width, _device: device, _surfaces };
        scene._device.check()?;
        let start = Instant::now();
        for surface in surfaces.iter() {
            // SAFETY: the handles are alive. The buffers have that many items, vertices with room for a fourth number
            // behind the last, indices were checked above; they are kept unchanged as long as the scene.
            unsafe {
                let geometry = (functions.new_geometry)(scene._device.handle, GEOMETRY_TRIANGLES);
                let vertices = (surface.coordinates.as_ptr().cast(), surface.vertex_count());
                let indices = (surface.indices.as_ptr().cast(), surface.indices.len());
                (functions.share_buffer)(geometry, BUFFER_VERTICES, 0, FORMAT_F32_3, vertices.0, 0, 12, vertices.1);
                (functions.share_buffer)(geometry, BUFFER_INDICES, 0, FORMAT_U32_3, indices.0, 0, 12, indices.1);
                (functions.commit_geometry)(geometry);
                (functions.attach_geometry)(scene.handle, geometry, surface.instance);
                (functions.release_geometry)(geometry);
            }
        }
        // SAFETY: the scene is alive and nobody else has it yet.
        unsafe {
            (functions.set_scene_quality)(scene.handle, QUALITY_MEDIUM);
            (functions.set_scene_flags)(scene.handle, if robust { SCENE_ROBUST } else { 0 });
            (functions.commit_scene)(scene.handle);
        }
        let seconds = start.elapsed().as_secs_f64();
        scene._device.check()?;
        let bytes = scene._device.bytes.load(Ordering::Relaxed).max(0) as u64;
        Ok(Built { peer: scene, seconds, bytes })
    }

    /// The closest hits in packets as wide as Embree has natively, with the coherent flag; the slices have equal lengths
    /// and the rays are valid.
    pub fn closest_in_packets(&self, rays: &[Ray], hits: &mut [Hit]) {
        let f = &self.functions;
        match self.packet_width {
            Some(16) => self.intersect_packets(f.intersect_16, rays, hits),
            Some(8) => self.intersect_packets(f.intersect_8, rays, hits),
            Some(4) => self.intersect_packets(f.intersect_4, rays, hits),
            _ => rays.iter().zip(hits).for_each(|(ray, hit)| *hit = self.closest(ray)),
        }
    }

    /// Whether there are hits, in packets as in [`closest_in_packets`](Self::closest_in_packets).
    pub fn occluded_in_packets(&self, rays: &[Ray], occluded: &mut [bool]) {
        let f = &self.functions;
        match self.packet_width {
            Some(16) => self.occluded_packets(f.occluded_16, rays, occluded),
            Some(8) => self.occluded_packets(f.occluded_8, rays, occluded),
            Some(4) => self.occluded_packets(f.occluded_4, rays, occluded),
            _ => rays.iter().zip(occluded).for_each(|(ray, occluded)| *occluded = self.occluded(ray)),
        }
    }

    fn intersect_packets<const W: usize>(
        &self,
        intersect: unsafe extern "C" fn(*const i32, Handle, *mut PacketQuery<W>, *mut Arguments),
        rays: &[Ray],
        hits: &mut [Hit],
    ) {
        for (rays, hits) in rays.chunks(W).zip(hits.chunks_mut(W)) {
            let (valid, ray) = packet(rays);
            let hit = PacketHit {
                normal: [[0.0; W]; 3],
                u: [0.0; W],
                v: [0.0; W],
                primitive: [NOTHING; W],
                geometry: [NOTHING; W],
                instance: [NOTHING; W],
                instance_primitive: [NOTHING; W],
            };
            let mut query = PacketQuery { ray, hit };
            // SAFETY: the scene is committed, records and mask have the layouts and alignments of RTCRayHit4, 8 or 16, and
            // packets of this width are native.
            unsafe { intersect(valid.0.as_ptr(), self.handle, &mut query, &mut Arguments::coherent()) };
            let PacketQuery { ray, hit } = &query;
            for (lane, slot) in hits.iter_mut().enumerate() {
                let (instance, primitive) = (hit.geometry[lane], hit.primitive[lane]);
                let found = Hit { t: ray.t_far[lane], u: hit.u[lane], v: hit.v[lane], instance, primitive };
                *slot = if instance == NOTHING { Hit::MISS } else { found };
            }
        }
    }

    fn occluded_packets<const W: usize>(
        &self,
        occluded: unsafe extern "C" fn(*const i32, Handle, *mut PacketRay<W>, *mut Arguments),
        rays: &[Ray],
        flags: &mut [bool],
    ) {
        for (rays, flags) in rays.chunks(W).zip(flags.chunks_mut(W)) {
            let (valid, mut ray) = packet(rays);
            // SAFETY: as in `intersect_packets`, with the layouts of RTCRay4, 8 or 16.
            unsafe { occluded(valid.0.as_ptr(), self.handle, &mut ray, &mut Arguments::coherent()) };
            for (flag, t_far) in flags.iter_mut().zip(ray.t_far) {
                *flag = t_far < 0.0;
            }
        }
    }
}

impl Peer for EmbreeScene {
    /// `rtcIntersect1`: the closest hit as Embree finds it.
    #[inline]
    fn closest(&self, ray: &Ray) -> Hit {
        debug_assert!(ray.is_valid());
        let hit = SingleHit {
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: NOTHING,
            geometry: NOTHING,
            instance: NOTHING,
            instance_primitive: NOTHING,
        };
        let mut query = SingleQuery { ray: single(ray), hit };
        // SAFETY: the scene is committed, the record has the layout and alignment of RTCRayHit, and null stands for
        // default arguments.
        unsafe { (self.functions.intersect_1)(self.handle, &mut query, null_mut()) };
        let SingleQuery { ray, hit } = query;
        if hit.geometry == NOTHING {
            return Hit::MISS;
        }
        Hit { t: ray.t_far, u: hit.u, v: hit.v, instance: hit.geometry, primitive: hit.primitive }
    }

    /// `rtcOccluded1`: whether Embree finds any hit.
    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        debug_assert!(ray.is_valid());
        let mut ray = single(ray);
        // SAFETY: the scene is committed, the record has the layout and alignment of RTCRay, and null stands for default
        // arguments.
        unsafe { (self.functions.occluded_1)(self.handle, &mut ray, null_mut()) };
        // A ray that is blocked ends before it begins.
        ray.t_far < 0.0
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: the only reference, released once; device and buffers are dropped after it.
            unsafe { (self.functions.release_scene)(self.handle) };
        }
    }
}

/// A ray as Embree takes it: negative t do not count with us, and are not allowed there.
#[inline(always)]
fn single(ray: &Ray) -> SingleRay {
    SingleRay {
        origin: ray.origin.to_array(),
        t_near: ray.t_min.max(0.0),
        direction: ray.direction.to_array(),
        time: 0.0,
        t_far: ray.t_max,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}

/// At most `W` rays side by side, and which places they fill.
#[inline(always)]
fn packet<const W: usize>(rays: &[Ray]) -> (Valid<W>, PacketRay<W>) {
    let mut valid = Valid([0; W]);
    let mut packet = PacketRay {
        origin: [[0.0; W]; 3],
        t_near: [0.0; W],
        direction: [[0.0; W]; 3],
        time: [0.0; W],
        t_far: [0.0; W],
        mask: [u32::MAX; W],
        id: [0; W],
        flags: [0; W],
    };
    for (lane, ray) in rays.iter().enumerate() {
        valid.0[lane] = -1;
        for axis in 0..3 {
            packet.origin[axis][lane] = ray.origin[axis];
            packet.direction[axis][lane] = ray.direction[axis];
        }
        packet.t_near[lane] = ray.t_min.max(0.0);
        packet.t_far[lane] = ray.t_max;
    }
    (valid, packet)
}

#[cfg(test)]
mod tests {
    use std::mem::{align_of, offset_of, size_of};

    use super::*;

    #[test]
    fn records_are_laid_out_as_in_the_headers() {
        assert_eq!((size_of::<SingleRay>(), align_of::<SingleRay>()), (48, 16));
        assert_eq!((offset_of!(SingleQuery, hit), offset_of!(SingleHit, primitive)), (48, 20));
        assert_eq!((offset_of!(SingleRay, t_far), size_of::<SingleQuery>()), (32, 96));
        assert_eq!((size_of::<PacketRay<16>>(), offset_of!(PacketQuery<16>, hit)), (768, 768));
        assert_eq!((offset_of!(PacketQuery<8>, hit), offset_of!(PacketQuery<4>, hit)), (384, 192));
        assert_eq!(offset_of!(PacketRay<16>, t_far), 512);
        assert_eq!((offset_of!(PacketHit<16>, primitive), offset_of!(PacketHit<8>, geometry)), (320, 192));
        assert_eq!((offset_of!(Arguments, context), offset_of!(Arguments, filter)), (8, 8 + size_of::<usize>()));
    }

    #[test]
    fn a_library_that_is_none_is_refused_with_a_remedy() {
        for path in ["/nowhere/libembree4.so.4", "Cargo.toml"] {
            let error = Library::load(Path::new(path)).map(|_| ()).unwrap_err().to_string();
            assert!(error.starts_with(path) && error.contains("libembree4.so.4"), "{error}");
        }
    }
}
