//! Loading a `.glb` of a million triangles beside the crate `gltf` alone, which parses the file, keeps it in memory and
//! hands out its arrays element by element.
//!
//! `cargo bench --bench load_glb --no-default-features`. Both get the same file with positions, normals, texture
//! coordinates and 32-bit indices from the system's cache, by turns; both must find the same arrays before anything is
//! timed. Ours also chooses an origin, finds the finest edge and decides which triangles can be hit.

use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use whitted::formats::{self, LoadOptions};
use whitted::geometry::TriangleMesh;
use whitted::glam::{Vec2, Vec3};
use whitted::progress::Silent;

/// Squares along a side of the hills: a million triangles, nearly.
const SIDE: u32 = 707;
/// Runs of each; the median is told, and the fastest.
const RUNS: usize = 15;

/// Hills of `2 side^2` triangles as a `.glb`.
fn write_hills(file: &mut impl std::io::Write, side: u32) -> std::io::Result<()> {
    let corner = |i: u32| i as f32 / side as f32;
    let grid = || (0..=side).flat_map(|j| (0..=side).map(move |i| (corner(i), corner(j))));
    let height = |x: f32, z: f32| 0.1 * libm::sinf(9.0 * x) * libm::sinf(7.0 * z) + 0.001 * libm::sinf(900.0 * x);
    let at = |i: u32, j: u32| j * (side + 1) + i;
    let square = |i: u32, j: u32| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [a, c, b, a, d, c]
    };
    let mut bytes: Vec<u8> = Vec::new();
    bytes.extend(grid().flat_map(|(x, z)| [x, height(x, z), z]).flat_map(f32::to_le_bytes));
    let normals = bytes.len();
    bytes.extend(grid().flat_map(|(x, _)| [0.1 * x, 1.0, 0.0]).flat_map(f32::to_le_bytes));
    let uvs = bytes.len();
    bytes.extend(grid().flat_map(|(x, z)| [x, z]).flat_map(f32::to_le_bytes));
    let indices = bytes.len();
    bytes.extend((0..side).flat_map(|j| (0..side).flat_map(move |i| square(i, j))).flat_map(u32::to_le_bytes));
    let (vertices, corners) = ((side + 1).pow(2), 6 * side.pow(2));
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2}},"indices":3}}]}}],
        "buffers":[{{"byteLength":{}}}],"bufferViews":[
        {{"buffer":0,"byteOffset":0,"byteLength":{normals}}},
        {{"buffer":0,"byteOffset":{normals},"byteLength":{}}},
        {{"buffer":0,"byteOffset":{uvs},"byteLength":{}}},
        {{"buffer":0,"byteOffset":{indices},"byteLength":{}}}],"accessors":[
        {{"bufferView":0,"componentType":5126,"type":"VEC3","count":{vertices},"min":[0,-1,0],"max":[1,1,1]}},
        {{"bufferView":1,"componentType":5126,"type":"VEC3","count":{vertices}}},
        {{"bufferView":2,"componentType":5126,"type":"VEC2","count":{vertices}}},
        {{"bufferView":3,"componentType":5125,"type":"SCALAR","count":{corners}}}]}}"#,
        bytes.len(),
        uvs - normals,
        indices - uvs,
        bytes.len() - indices
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let word = |n: usize| (n as u32).to_le_bytes();
    file.write_all(b"glTF\x02\0\0\0")?;
    file.write_all(&word(28 + json.len() + bytes.len()))?;
    file.write_all(&word(json.len()))?;
    file.write_all(b"JSON")?;
    file.write_all(json.as_bytes())?;
    file.write_all(&word(bytes.len()))?;
    file.write_all(b"BIN\0")?;
    file.write_all(&bytes)
}

fn ours(path: &Path) -> TriangleMesh {
    let mut model = formats::load_model(path, &LoadOptions::default(), &Silent).expect("the file is valid");
    model.meshes.remove(0)
}

/// All arrays of the first primitive, as the crate alone reads them.
struct Arrays {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<[u32; 3]>,
}

fn theirs(path: &Path) -> Arrays {
    let file = gltf::Gltf::open(path).expect("the file is valid");
    let blob = file.blob.as_deref();
    let primitive = file.meshes().next().and_then(|mesh| mesh.primitives().next()).expect("there is one");
    let reader = primitive.reader(|_| blob);
    let corners: Vec<u32> = reader.read_indices().expect("there are some").into_u32().collect();
    Arrays {
        positions: reader.read_positions().expect("there are some").map(Vec3::from_array).collect(),
        normals: reader.read_normals().expect("there are some").map(Vec3::from_array).collect(),
        uvs: reader
            .read_tex_coords(0)
            .expect("there are some")
            .into_f32()
            .map(|[u, v]| Vec2::new(u, 1.0 - v))
            .collect(),
        indices: corners.as_chunks::<3>().0.to_vec(),
    }
}

fn timed<T>(run: impl FnOnce() -> T) -> Duration {
    let start = Instant::now();
    let result = run();
    let time = start.elapsed();
    drop(result);
    time
}

/// How often each is timed: once where `cargo bench -- --test` asks whether it runs at all.
fn runs() -> usize {
    if std::env::args().any(|argument| argument == "--test") { 1 } else { RUNS }
}

fn main() {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    write_hills(&mut file, SIDE).and_then(|()| file.flush()).expect("it can be written");
    let path = file.path();
    let (mesh, arrays) = (ours(path), theirs(path));
    assert_eq!((mesh.positions, mesh.indices), (arrays.positions.into(), arrays.indices.into()));
    assert_eq!((mesh.normals, mesh.uvs), (Some(arrays.normals.into()), Some(arrays.uvs.into())));

    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..runs() {
        times[0].push(timed(|| ours(path)));
        times[1].push(timed(|| theirs(path)));
    }
    let bytes = path.metadata().expect("it is there").len() as f64;
    println!("{} triangles, {:.1} MB, {} runs by turns", 2 * SIDE * SIDE, bytes / 1e6, runs());
    for (name, times) in ["whitted", "gltf alone"].into_iter().zip(&mut times) {
        times.sort();
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let (median, fastest) = (times[times.len() / 2], times[0]);
        let rate = bytes / 1e6 / median.as_secs_f64();
        println!(
            "{name}: median {:.1} ms, fastest {:.1} ms, {rate:.0} MB/s",
            milliseconds(median),
            milliseconds(fastest)
        );
    }
}
