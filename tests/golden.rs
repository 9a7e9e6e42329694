//! Golden images: tiny scenes in `tests/golden`, each showing one phenomenon, and the pictures that they must give.
//!
//! The tolerance is 0, since a picture is the same bytes everywhere; pixels are compared, not the files, so that another
//! encoder of PNG changes nothing. A test that fails writes the expected, the actual and the difference picture to
//! `golden` in the target folder.
//!
//! Where pictures change with reason, `WHITTED_REGENERATE_GOLDEN=1 cargo test golden` writes them anew. Look at every one
//! that changed before it is committed: they are what later versions are measured by.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, Rgba, RgbaImage};
use whitted::accel::Params;
use whitted::formats::{LoadOptions, open, picture};
use whitted::progress::Silent;
use whitted::render::{RenderSettings, Renderer};
use whitted::scene::Scene;

/// The variable that, if set, has pictures written instead of compared.
const REGENERATE: &str = "WHITTED_REGENERATE_GOLDEN";

/// One test a scene, and the list of their names.
macro_rules! golden {
    ($($name:ident)+) => {
        const NAMES: &[&str] = &[$(stringify!($name)),+];
        $(
            #[test]
            fn $name() {
                check(stringify!($name));
            }
        )+
    };
}

golden! {
    attached_shadow
    general_quadrics
    gltf_import
    gradient
    instances
    mirror_recursion
    named_quadrics
    normals
    obj_import
    orthographic
    panorama
    refraction
    seed_camera
    spot_cone
    textured_quadrics
    texture_wrap
    total_internal_reflection
    transparent_background
    transparent_shadow
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// Renders a scene and compares it with its picture, or writes that.
fn check(name: &str) {
    let scene = folder().join(name).with_extension("toml");
    compare(name, &png(open(&scene, &LoadOptions::default(), &Silent).unwrap().scene));
}

/// Compares a PNG with the golden one of this name, or writes that.
pub fn compare(name: &str, rendered: &[u8]) {
    let golden = folder().join(name).with_extension("png");
    if std::env::var_os(REGENERATE).is_some() {
        fs::write(&golden, rendered).unwrap();
        return;
    }
    let expected =
        fs::read(&golden).unwrap_or_else(|error| panic!("{}: {error}; {REGENERATE}=1 writes it", golden.display()));
    let (expected, actual) = (decode(&expected), decode(rendered));
    if let Some(difference) = describe(&expected, &actual) {
        let pictures = write_evidence(name, &expected, &actual);
        panic!("{name}: {difference}; see {pictures}");
    }
}

/// The bytes of the PNG that a scene gives.
pub fn png(scene: Scene) -> Vec<u8> {
    let renderer = Renderer::build(scene, &Params::default(), &Silent).unwrap();
    let film = renderer.render(&RenderSettings::default(), &Silent).unwrap();
    let mut bytes = Vec::new();
    picture::write_png(&film, &mut bytes).unwrap();
    bytes
}

fn decode(png: &[u8]) -> DynamicImage {
    image::load_from_memory(png).unwrap()
}

/// What is different between two pictures; `None` where nothing is.
fn describe(expected: &DynamicImage, actual: &DynamicImage) -> Option<String> {
    let layout = |image: &DynamicImage| format!("{}x{} {:?}", image.width(), image.height(), image.color());
    if layout(expected) != layout(actual) {
        return Some(format!("expected {}, rendered {}", layout(expected), layout(actual)));
    }
    let (expected, actual) = (expected.to_rgba8(), actual.to_rgba8());
    let mut different =
        expected.enumerate_pixels().zip(actual.pixels()).filter(|((_, _, expected), actual)| expected != actual);
    let ((x, y, Rgba(from)), Rgba(to)) = different.next()?;
    let count = 1 + different.count();
    let all = expected.width() * expected.height();
    let largest = expected.iter().zip(actual.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or_default();
    Some(format!(
        "{count} of {all} pixels differ, by {largest} at most; the first, ({x}, {y}), is {to:?} instead of {from:?}"
    ))
}

/// Writes expected, actual and, where their sizes allow, the difference; gives their paths.
fn write_evidence(name: &str, expected: &DynamicImage, actual: &DynamicImage) -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("golden");
    fs::create_dir_all(&folder).unwrap();
    let mut paths = Vec::new();
    let mut write = |kind: &str, image: &DynamicImage| {
        let path = folder.join(format!("{}.{kind}.png", name.replace('/', "-")));
        image.save(&path).unwrap();
        paths.push(path.display().to_string());
    };
    write("expected", expected);
    write("actual", actual);
    if (expected.width(), expected.height()) == (actual.width(), actual.height()) {
        write("difference", &difference(expected, actual));
    }
    paths.join(", ")
}

/// Black where two pictures are equal; channels that differ are at least half bright. A different alpha shows in all.
fn difference(expected: &DynamicImage, actual: &DynamicImage) -> DynamicImage {
    let (expected, actual) = (expected.to_rgba8(), actual.to_rgba8());
    let visible = |a: u8, b: u8| if a == b { 0 } else { 128 + a.abs_diff(b) / 2 };
    let pixel = |x, y| {
        let (Rgba(a), Rgba(b)) = (expected.get_pixel(x, y), actual.get_pixel(x, y));
        let alpha = visible(a[3], b[3]);
        let [red, green, blue] = std::array::from_fn(|channel| visible(a[channel], b[channel]).max(alpha));
        Rgba([red, green, blue, 255])
    };
    RgbaImage::from_fn(expected.width(), expected.height(), pixel).into()
}

#[test]
fn every_scene_of_the_folder_is_tested_and_pictures_stay_tiny() {
    let files: Vec<PathBuf> = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let stems = |suffix: &str| -> BTreeSet<String> {
        let with_suffix = files.iter().filter(|file| file.extension().is_some_and(|found| found == suffix));
        with_suffix.map(|file| file.file_stem().unwrap().to_string_lossy().into_owned()).collect()
    };
    let names: BTreeSet<String> = NAMES.iter().map(|&name| name.to_owned()).collect();
    assert_eq!(stems("toml"), names);
    if std::env::var_os(REGENERATE).is_none() {
        assert_eq!(stems("png"), names);
    }
    for file in files.iter().filter(|file| file.is_file()) {
        let bytes = fs::metadata(file).unwrap().len();
        assert!(bytes < 20_000, "{}: {bytes} bytes", file.display());
    }
}

#[test]
fn one_changed_channel_is_found_and_shown() {
    let expected = RgbaImage::from_pixel(3, 2, Rgba([10, 20, 30, 255]));
    let mut actual = expected.clone();
    actual.put_pixel(2, 1, Rgba([10, 21, 30, 255]));
    let (expected, actual): (DynamicImage, DynamicImage) = (expected.into(), actual.into());
    assert_eq!(describe(&expected, &expected), None);
    let message = describe(&expected, &actual).unwrap();
    assert!(message.starts_with("1 of 6 pixels differ, by 1 at most; the first, (2, 1), is"), "{message}");
    let shown = difference(&expected, &actual).to_rgba8();
    assert_eq!((shown.get_pixel(2, 1), shown.get_pixel(1, 1)), (&Rgba([0, 128, 0, 255]), &Rgba([0, 0, 0, 255])));
    assert!(describe(&expected, &DynamicImage::new_rgba8(3, 3)).unwrap().contains("expected 3x2"));
}
