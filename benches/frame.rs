//! A whole frame, 320x240 at one sample a pixel on one thread: camera rays, shading, shadows, mirrors and glass.
//!
//! `cargo bench --bench frame`. `scene` has glass, mirrors, textures and quadrics beside the mesh; `model` is the bare
//! mesh. Structures must give equal pictures from equally many rays before anything is timed; rates count all rays.

use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use whitted::accel::{Kind, Params};
use whitted::formats::{self, LoadOptions};
use whitted::progress::Silent;
use whitted::render::{Film, RenderSettings, Renderer};
use whitted::scene::{Scene, auto};

const INPUTS: [(&str, &str); 2] = [("scene", "scenes/teapot.toml"), ("model", "meshes/teapot.obj")];

/// A file as a scene for the small picture; a bare model's camera frames it anew.
fn open(path: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let loaded = formats::open(&path, &LoadOptions::default(), &Silent).expect("our own files are valid");
    let mut scene = loaded.scene;
    (scene.film.width, scene.film.height, scene.film.samples) = (320, 240, 1);
    if loaded.automatic.camera {
        scene.cameras.clear();
        auto::complete_camera(&mut scene);
    }
    scene
}

fn render(renderer: &Renderer) -> Film {
    let settings = RenderSettings { threads: 1, ..RenderSettings::default() };
    renderer.render(&settings, &Silent).expect("the camera is valid")
}

fn bench(criterion: &mut Criterion) {
    for (name, path) in INPUTS {
        let scene = open(path);
        let mut expected: Option<Film> = None;
        let mut group = criterion.benchmark_group(format!("frame {name}"));
        // The first structure is `linear`: each of its rays would meet every triangle.
        for &kind in &Kind::ALL[1..] {
            let params = Params { kind, ..Params::default() };
            let renderer = Renderer::build(scene.clone(), &params, &Silent).expect("nothing cancels");
            let film = render(&renderer);
            let expected = expected.get_or_insert_with(|| film.clone());
            assert!(film.complete && film.color == expected.color, "{path}: {} gives another picture", kind.name());
            assert_eq!(film.stats.rays, expected.stats.rays, "{path}: {}", kind.name());

            group.sample_size(20).throughput(Throughput::Elements(film.stats.rays.total()));
            group.bench_function(kind.name(), |bencher| bencher.iter(|| render(&renderer)));
        }
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
