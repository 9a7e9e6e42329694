//! Build, closest hit and any hit of every tree on generated meshes, one thread, one public call a batch of rays.
//!
//! `cargo bench --bench accel`. Trees must agree on every ray, and with `linear` on some, before anything is timed.

use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{Vec2, Vec3};
use whitted::accel::{Kind, Linear, Params, Preset, TriangleAccelerator, dispatch_kind};
use whitted::geometry::{Hit, Ray, TriangleMesh};
use whitted::math::random::{hash2, unit};
use whitted::progress::Silent;

/// Triangles over the unit square, bent into shape by `point`: a map from [0, 1]^2.
fn sheet(name: &str, columns: u32, rows: u32, point: impl Fn(Vec2) -> Vec3) -> TriangleMesh {
    let corner = |x: u32, y: u32| y * (columns + 1) + x;
    let positions = (0..=rows)
        .flat_map(|y| (0..=columns).map(move |x| Vec2::new(x as f32 / columns as f32, y as f32 / rows as f32)));
    let indices = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).flat_map(|(x, y)| {
        let (a, b, c, d) = (corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1));
        [[a, b, d], [a, d, c]]
    });
    let mesh = TriangleMesh {
        name: name.into(),
        positions: positions.map(point).collect(),
        indices: indices.collect(),
        ..TriangleMesh::default()
    };
    mesh.finish().expect("the generator makes consistent arrays")
}

/// A ball with a small hole at each pole, where triangles would become slivers.
fn sphere() -> TriangleMesh {
    sheet("sphere", 316, 158, |p| {
        let (polar, azimuth) = ((0.005 + 0.99 * p.y) * std::f32::consts::PI, p.x * std::f32::consts::TAU);
        Vec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
    })
}

fn terrain() -> TriangleMesh {
    sheet("terrain", 500, 500, |p| {
        let wave = |frequency: f32| ((p.x * frequency).sin() + (p.y * frequency * 1.3).cos()) / frequency;
        Vec3::new(p.x * 2.0 - 1.0, p.y * 2.0 - 1.0, wave(7.0) + wave(31.0) + wave(97.0) + wave(211.0))
    })
}

fn random(number: u32, salt: u32) -> Vec3 {
    let component = |axis| 2.0 * unit(hash2(number, salt + axis)) as f32 - 1.0;
    Vec3::new(component(0), component(1), component(2))
}

/// What a camera sends out, row by row.
fn primary() -> Vec<Ray> {
    const SIDE: u32 = 256;
    let (eye, right) = (Vec3::new(1.5, -2.5, 1.2), Vec3::new(2.5, 1.5, 0.0).normalize());
    let forward = -eye.normalize();
    let up = right.cross(forward);
    let offset = |i: u32| (i as f32 + 0.5) / SIDE as f32 - 0.5;
    let ray = |i: u32| Ray::new(eye, forward + (right * offset(i % SIDE) + up * offset(i / SIDE)) * 0.9);
    (0..SIDE * SIDE).map(ray).collect()
}

/// Rays from points on the mesh in all directions, none like the one before: what diffuse reflection sends out.
fn scattered(mesh: &TriangleMesh) -> Vec<Ray> {
    let ray = |i: u32| {
        let [a, b, c] = mesh.triangle(hash2(i, 99) % mesh.indices.len() as u32);
        Ray { t_min: 1e-3, ..Ray::new((a + b + c) / 3.0, random(i, 5)) }
    };
    (0..65_536).map(ray).collect()
}

fn closest<A: TriangleAccelerator>(accelerator: &A, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    accelerator.closest_batch(rays, &[], 0, &mut hits);
    hits
}

fn occluded<A: TriangleAccelerator>(accelerator: &A, rays: &[Ray]) -> Vec<bool> {
    let mut occluded = vec![false; rays.len()];
    accelerator.occluded_batch(rays, &[], &mut occluded);
    occluded
}

fn bench(criterion: &mut Criterion) {
    for mesh in [sphere(), terrain()].map(Arc::new) {
        let ray_sets = [("primary", primary()), ("scattered", scattered(&mesh))];
        let linear = Linear::build(&mesh, &Params::default(), &Silent).expect("nothing cancels");
        let expected = ray_sets.each_ref().map(|(_, rays)| closest(&linear, &rays[..64]));
        let mut agreed: [Option<Vec<Hit>>; 2] = [None, None];
        for &kind in &Kind::ALL[1..] {
            dispatch_kind!(kind, A => {
                let mut builds = criterion.benchmark_group(format!("build {}", mesh.name));
                builds.sample_size(10).throughput(Throughput::Elements(mesh.live_count() as u64));
                for &preset in Preset::ALL {
                    let params = Params { kind, preset };
                    let id = BenchmarkId::new(kind.name(), format!("{preset:?}"));
                    builds.bench_function(id, |bencher| bencher.iter(|| A::build(&mesh, &params, &Silent)));
                }
                builds.finish();

                let accelerator = A::build(&mesh, &Params::default(), &Silent).expect("nothing cancels");
                eprintln!("{} {}: {:?}", mesh.name, kind.name(), accelerator.stats());
                for (((name, rays), expected), agreed) in ray_sets.iter().zip(&expected).zip(&mut agreed) {
                    let hits = closest(&accelerator, rays);
                    let any: Vec<bool> = hits.iter().map(Hit::is_hit).collect();
                    assert_eq!(&hits[..64], expected, "{}", kind.name());
                    assert_eq!(&hits, agreed.get_or_insert_with(|| hits.clone()), "{}", kind.name());
                    assert_eq!(occluded(&accelerator, rays), any, "{}", kind.name());

                    let mut group = criterion.benchmark_group(format!("{} {name}", mesh.name));
                    group.sample_size(20).throughput(Throughput::Elements(rays.len() as u64));
                    group.bench_function(BenchmarkId::new("closest", kind.name()), |bencher| {
                        bencher.iter(|| closest(&accelerator, rays));
                    });
                    group.bench_function(BenchmarkId::new("any hit", kind.name()), |bencher| {
                        bencher.iter(|| occluded(&accelerator, rays));
                    });
                    group.finish();
                }
            });
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
