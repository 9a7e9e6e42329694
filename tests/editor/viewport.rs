//! The viewport in a real window: what it draws against what the renderer renders, and how fast.
//!
//! `cargo test --features editor --test viewport` checks; without a display it says so and checks nothing. With
//! `-- FOLDER FILE...` it writes pictures of these files, drawn and rendered, and measures an orbit around each.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui;
use glam::DVec3;
use whitted::accel::Params;
use whitted::editor::viewport::gl::Gl;
use whitted::editor::viewport::{Options, Viewport};
use whitted::formats::{LoadOptions, open};
use whitted::progress::Silent;
use whitted::render::{RenderSettings, Renderer};
use whitted::scene::{Camera, Scene, quantize};

const SIZE: (u32, u32) = (1280, 800);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let has_display = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    if !has_display {
        println!("viewport: no display, nothing checked");
        return;
    }
    let options = eframe::NativeOptions { renderer: eframe::Renderer::Glow, ..Default::default() };
    let outcome = eframe::run_native(
        "viewport",
        options,
        Box::new(move |context| {
            let gl = context.gl.clone().ok_or("no OpenGL")?;
            match arguments.split_first() {
                Some((folder, files)) => {
                    let files: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
                    measure(&gl, Path::new(folder), &files);
                }
                None => check(&gl),
            }
            Ok(Box::new(Done))
        }),
    );
    outcome.expect("the window opens");
}

/// Closes the window at once.
struct Done;

impl eframe::App for Done {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
    }
}

fn load(path: &Path) -> Scene {
    let mut loaded = open(path, &LoadOptions::default(), &Silent).unwrap_or_else(|error| panic!("{error}"));
    (loaded.scene.film.width, loaded.scene.film.height) = SIZE;
    if loaded.automatic.camera {
        loaded.scene.cameras[0].camera = loaded.automatic.default_camera(&loaded.scene, 35f64.to_radians());
        if loaded.automatic.lights {
            let automatic = loaded.automatic;
            automatic.light_from_camera(&mut loaded.scene);
        }
    }
    loaded.scene
}

/// The renderer's bytes.
fn rendered(scene: &Scene) -> Vec<[u8; 4]> {
    let mut scene = scene.clone();
    scene.film.samples = 1;
    let film = scene.film;
    let renderer = Renderer::build(scene, &Params::default(), &Silent).unwrap();
    let image = renderer.render(&RenderSettings::default(), &Silent).unwrap();
    let exposure = film.exposure.exp2();
    let byte = |value: f32| quantize::byte(value * exposure, film.transfer);
    image.color.iter().map(|&[r, g, b]| [byte(r), byte(g), byte(b), 255]).collect()
}

/// The share of pixels of which no channel differs by more than this.
fn alike(one: &[[u8; 4]], other: &[[u8; 4]], most: u8) -> f64 {
    assert_eq!(one.len(), other.len());
    let near = |(a, b): (&[u8; 4], &[u8; 4])| (0..3).all(|k| a[k].abs_diff(b[k]) <= most);
    one.iter().zip(other).map(|pair| f64::from(u8::from(near(pair)))).sum::<f64>() / one.len() as f64
}

fn check(gl: &Arc<eframe::glow::Context>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (shaders, embedded) in [("desktop", false), ("ES", true)] {
        let context = Gl::new(gl.clone()).unwrap();
        let context = if embedded { context.with_embedded_shaders() } else { context };
        let mut viewport = Viewport::with(context).unwrap();
        // What shadows, mirrors and glass show is not drawn, nor small pools of light on large triangles: the shares of pixels
        // that are alike are what each scene had when this was written, less a little.
        for (name, least) in
            [("quadrics", 0.85), ("seed_camera", 0.9), ("teapot", 0.75), ("textured_crate", 0.77), ("cornell_box", 0.9)]
        {
            let scene = Arc::new(load(&root.join(format!("scenes/{name}.toml"))));
            let camera = *scene.camera();
            let stats = viewport.draw(&scene, &camera, SIZE, &Options::default()).unwrap();
            assert!(stats.triangles > 0 && stats.is_new);
            assert!(!viewport.draw(&scene, &camera, SIZE, &Options::default()).unwrap().is_new);
            let share = alike(&viewport.pixels(), &rendered(&scene), 24);
            println!("viewport: {name}, {shaders} shaders: {:.1} % of pixels are alike", share * 100.0);
            assert!(share >= least, "{name}: {share}");
        }
        overlays_are_seen(&mut viewport, root);
        flawed_views_are_errors(&mut viewport, root);
        viewport.destroy();
    }
}

fn overlays_are_seen(viewport: &mut Viewport, root: &Path) {
    let scene = Arc::new(load(&root.join("scenes/teapot.toml")));
    let camera = *scene.camera();
    viewport.draw(&scene, &camera, SIZE, &Options::default()).unwrap();
    let plain = viewport.pixels();
    let cases = [
        ("grid", Options { grid: true, ..Options::default() }),
        ("selection", Options { selected: vec![0], ..Options::default() }),
        ("wireframe", Options { wireframe: true, ..Options::default() }),
    ];
    for (name, options) in cases {
        viewport.draw(&scene, &camera, SIZE, &options).unwrap();
        let share = 1.0 - alike(&viewport.pixels(), &plain, 8);
        println!("viewport: {name} changes {:.2} % of pixels", share * 100.0);
        assert!(share > 1e-3, "{name}: {share}");
    }
}

fn flawed_views_are_errors(viewport: &mut Viewport, root: &Path) {
    let scene = Arc::new(load(&root.join("scenes/teapot.toml")));
    let camera = *scene.camera();
    assert!(viewport.draw(&scene, &camera, (0, 5), &Options::default()).is_err());
    assert!(viewport.draw(&scene, &camera, (u32::MAX, 5), &Options::default()).is_err());
    let Camera::LookAt { eye, up, projection, .. } = camera else { panic!("the teapot has another camera") };
    let nowhere = Camera::LookAt { eye, target: eye, up, projection };
    assert!(viewport.draw(&scene, &nowhere, SIZE, &Options::default()).is_err());
    assert!(viewport.draw(&scene, &camera, SIZE, &Options::default()).is_ok());
}

/// Writes what is drawn and what is rendered, and prints frames a second of an orbit.
fn measure(gl: &Arc<eframe::glow::Context>, folder: &Path, files: &[PathBuf]) {
    std::fs::create_dir_all(folder).unwrap();
    let mut viewport = Viewport::new(gl.clone()).unwrap();
    for file in files {
        let scene = Arc::new(load(file));
        let camera = *scene.camera();
        let stem = file.file_stem().unwrap().to_string_lossy().into_owned();
        let start = Instant::now();
        let options = Options { grid: true, selected: vec![0], ..Options::default() };
        let mut stats = viewport.draw(&scene, &camera, SIZE, &Options::default()).unwrap();
        let blocked = start.elapsed();
        while !stats.is_whole {
            std::thread::sleep(Duration::from_millis(5));
            stats = viewport.draw(&scene, &camera, SIZE, &Options::default()).unwrap();
        }
        viewport.finish();
        let first = start.elapsed();
        let drawn = viewport.pixels();
        save(&drawn, &folder.join(format!("{stem}.drawn.png")));
        let truth = rendered(&scene);
        save(&truth, &folder.join(format!("{stem}.rendered.png")));
        viewport.draw(&scene, &camera, SIZE, &options).unwrap();
        save(&viewport.pixels(), &folder.join(format!("{stem}.overlays.png")));
        println!(
            "{stem}: first picture {:.2} s, of which {:.2} s without one, {} of {} triangles, {:.1} % alike",
            first.as_secs_f64(),
            blocked.as_secs_f64(),
            stats.triangles,
            stats.of,
            100.0 * alike(&drawn, &truth, 24)
        );
        let moving = Options { moving: true, ..Options::default() };
        viewport.draw(&scene, &camera, SIZE, &moving).unwrap();
        let start = Instant::now();
        while !viewport.has_stand_ins() && start.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(5));
        }
        println!("  stand-ins after {:.2} s", start.elapsed().as_secs_f64());
        for (what, options) in [("full", Options::default()), ("moving", moving)] {
            let (mut frames, mut triangles) = (0u32, 0);
            let (start, busy) = (Instant::now(), busy_seconds());
            while frames < 40 && (frames < 4 || start.elapsed() < Duration::from_secs(10)) {
                frames += 1;
                let stats = viewport.draw(&scene, &turned(&camera, frames), SIZE, &options).unwrap();
                viewport.finish();
                triangles = stats.triangles;
            }
            let rate = f64::from(frames) / start.elapsed().as_secs_f64();
            let busy = (busy_seconds() - busy) * 1000.0 / f64::from(frames);
            println!(
                "  {what}: {rate:.1} frames a second, {busy:.0} ms of all cores each, {triangles} triangles in the last"
            );
            save(&viewport.pixels(), &folder.join(format!("{stem}.{what}.png")));
        }
    }
    viewport.destroy();
}

/// Time of all cores that this program had; 0 where that is not told. On a machine with other work it says more than the clock.
fn busy_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}

/// The camera, gone around its target a little.
fn turned(camera: &Camera, step: u32) -> Camera {
    match *camera {
        Camera::LookAt { eye, target, up, projection } => {
            let (sin, cos) = (f64::from(step) * 0.05).sin_cos();
            let offset = eye - target;
            let turned = DVec3::new(offset.x * cos + offset.z * sin, offset.y, offset.z * cos - offset.x * sin);
            Camera::LookAt { eye: target + turned, target, up, projection }
        }
        other => other,
    }
}

fn save(pixels: &[[u8; 4]], path: &Path) {
    let bytes: Vec<u8> = pixels.iter().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    image::save_buffer(path, &bytes, SIZE.0, SIZE.1, image::ColorType::Rgb8).unwrap();
}
