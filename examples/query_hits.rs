//! Asks what rays hit, without rendering: one by one, in batches, yes or no, and every hit along a ray.
//!
//! ```text
//! cargo run --release --example query_hits [-- INPUT]
//! ```
//!
//! The rays are those of the camera through the middle row of a small picture; INPUT is the teapot unless given.

use glam::DVec2;
use whitted::accel::Params;
use whitted::formats::{self, LoadOptions};
use whitted::geometry::{Hit, Key, Ray};
use whitted::progress::Silent;
use whitted::render::Renderer;
use whitted::render::trace::TracedRay;

const COLUMNS: u32 = 9;

/// The rays through the centres of a row of pixels, relative to the scene's origin as all queries are.
fn middle_row(renderer: &Renderer) -> whitted::Result<Vec<Ray>> {
    let scene = renderer.scene();
    let camera = scene.camera().rays(COLUMNS, 5, scene.origin)?;
    let through = |x: u32| camera.ray(DVec2::new(f64::from(x) + 0.5, 2.5));
    Ok((0..COLUMNS).filter_map(through).map(|view| TracedRay::camera(view).ray).collect())
}

/// Every hit of a ray, nearest first: each is the first one after the key of the one before.
fn all_hits(renderer: &Renderer, ray: &Ray) -> impl Iterator<Item = Hit> {
    let after = |key: Key| Some(renderer.next_after(ray, key)).filter(Hit::is_hit);
    std::iter::successors(after(Key::BEFORE_ALL), move |hit| after(hit.key()))
}

/// One line of a table; the point is in the coordinates of the file.
fn print_hit(label: usize, renderer: &Renderer, ray: &Ray, hit: &Hit) {
    let scene = renderer.scene();
    let object = &scene.objects[hit.instance as usize].name;
    let point = scene.origin + ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(hit.t);
    let Hit { t, u, v, primitive, .. } = hit;
    println!("{label:5} {t:10.5} {object:>16} {primitive:9} {u:8.5} {v:8.5}   {point:.4}");
}

fn main() -> whitted::Result<()> {
    let teapot = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/teapot.obj").to_owned();
    let input = std::env::args().nth(1).unwrap_or(teapot);
    let scene = formats::open(input.as_ref(), &LoadOptions::default(), &Silent)?.scene;
    let renderer = Renderer::build(scene, &Params::default(), &Silent)?;
    let rays = middle_row(&renderer)?;
    let header = format!("{:>10} {:>16} {:>9} {:>8} {:>8}   point", "t", "object", "primitive", "u", "v");

    println!("closest hits of a batch\n  ray {header}");
    let mut hits = vec![Hit::MISS; rays.len()];
    renderer.closest_batch(&rays, &mut hits);
    for (number, (ray, hit)) in rays.iter().zip(&hits).enumerate().filter(|(_, (_, hit))| hit.is_hit()) {
        print_hit(number, &renderer, ray, hit);
    }

    // Whether there is a hit at all is cheaper to know than which one is first.
    let mut occluded = vec![false; rays.len()];
    renderer.occluded_batch(&rays, &mut occluded);
    println!("\noccluded: {} of {} rays", occluded.iter().filter(|&&hit| hit).count(), rays.len());

    let middle = rays[rays.len() / 2];
    let first = renderer.closest(&middle);
    let before_it = Ray { t_max: first.t.next_down(), ..middle };
    println!("up to just before its closest hit the middle ray is occluded: {}", renderer.occluded(&before_it));

    println!("\nall hits of the middle ray\n    # {header}");
    for (number, hit) in all_hits(&renderer, &middle).enumerate() {
        print_hit(number + 1, &renderer, &middle, &hit);
    }
    Ok(())
}
