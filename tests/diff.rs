//! `whitted diff`, run as a process on pictures made here.

use image::{Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::Value;

use crate::command_line::{Workshop, assert_documented, text};

/// Pictures of 4x3 pixels: `a.png`, `same.png` with its bytes, `b.png` with two changed pixels.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    let mut picture = RgbImage::from_fn(4, 3, |x, y| Rgb([x as u8 * 60, y as u8 * 100, 51]));
    picture.save(workshop.path("a.png")).unwrap();
    picture.save(workshop.path("same.png")).unwrap();
    picture.put_pixel(1, 2, Rgb([60, 200, 0]));
    picture.put_pixel(3, 0, Rgb([181, 0, 51]));
    picture.save(workshop.path("b.png")).unwrap();
    workshop
}

fn json(workshop: &Workshop, arguments: &str) -> Value {
    serde_json::from_slice(&workshop.succeed(arguments)).unwrap()
}

#[test]
fn numbers_are_those_of_the_closed_forms() {
    let workshop = workshop();
    let found = json(&workshop, "diff a.png b.png --json --threshold 0.1");
    let color = &found["color"];
    // 12 pixels with 3 values each: one differs by 51/255 = 0.2, one by 1/255.
    assert_eq!((&found["width"], &found["height"], &found["space"]), (&4.into(), &3.into(), &"encoded".into()));
    assert_eq!(color["max"], 0.2);
    assert_eq!(color["max_at"], serde_json::json!({"x": 1, "y": 2, "channel": "B", "a": 0.2, "b": 0.0}));
    let squares = 0.2f64 * 0.2 + 1.0 / 255.0 / 255.0;
    let near = |value: &Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-12 * expected;
    assert!(near(&color["rmse"], (squares / 36.0).sqrt()), "{color}");
    assert!(near(&color["psnr"], 10.0 * (36.0 / squares).log10()), "{color}");
    assert!(near(&color["mean"], (0.2 + 1.0 / 255.0) / 36.0), "{color}");
    assert_eq!(color["over_threshold"], 1);
    assert_eq!(json(&workshop, "diff a.png b.png --json")["color"]["over_threshold"], 2);
    let printed = text(&workshop.succeed("diff a.png b.png"));
    assert!(printed.contains("max            0.2 at 1,2 in B: 0.2 and 0") && printed.contains("2 of 12"), "{printed}");
}

#[test]
fn equal_pictures_are_infinitely_close() {
    let workshop = workshop();
    let found = json(&workshop, "diff a.png same.png --json --max-error 0");
    let color = &found["color"];
    assert_eq!((&color["max"], &color["rmse"], &color["psnr"]), (&0.0.into(), &0.0.into(), &Value::Null));
    assert_eq!((&color["max_at"], &found["within"]), (&Value::Null, &true.into()));
    assert!(text(&workshop.succeed("diff a.png same.png")).contains("PSNR           infinite"));
}

#[test]
fn a_limit_decides_the_exit_code() {
    let workshop = workshop();
    workshop.succeed("diff a.png b.png --max-error 0.2");
    let output = workshop.run("diff a.png b.png --json --max-error 0.19");
    assert_eq!(output.status.code(), Some(1));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&found["within"], &found["max_error"]), (&false.into(), &0.19.into()));
    let stderr = text(&output.stderr);
    assert_eq!(stderr, "error: a.png: the pictures differ by 0.2 at 1,2 in B, which is more than 0.19\n");
    for bad in ["--max-error -1", "--max-error nan", "--threshold inf", "--max-error x"] {
        assert_eq!(workshop.run(&format!("diff a.png b.png {bad}")).status.code(), Some(2), "{bad}");
    }
}

#[test]
fn a_heatmap_shows_where() {
    let workshop = workshop();
    workshop.succeed("diff a.png b.png --heatmap where.png");
    let map = image::open(workshop.path("where.png")).unwrap().into_rgb8();
    assert_eq!(map.dimensions(), (4, 3));
    let light = |x, y| map.get_pixel(x, y).0.iter().map(|&value| u32::from(value)).sum::<u32>();
    assert_eq!(map.pixels().filter(|pixel| pixel.0 != [0; 3]).count(), 2);
    assert!(light(1, 2) > light(3, 0) && light(3, 0) > 100, "{map:?}");
    let before = std::fs::read(workshop.path("a.png")).unwrap();
    assert!(workshop.fail("diff a.png b.png --heatmap ./a.png").contains("is not overwritten"));
    assert_eq!(std::fs::read(workshop.path("a.png")).unwrap(), before);
    assert!(workshop.fail("diff a.png b.png --heatmap where.gif").contains(".png"));
    assert!(workshop.fail("diff a.png b.png --heatmap no/where.png").contains("create it first"));
}

#[test]
fn what_cannot_be_compared_is_told() {
    let workshop = workshop();
    RgbImage::new(4, 4).save(workshop.path("taller.png")).unwrap();
    let message = workshop.fail("diff a.png taller.png");
    assert!(message.contains("taller.png: the picture has 4x4 pixels, the other 4x3"), "{message}");
    assert!(workshop.fail("diff a.png missing.png").contains("missing.png"));
    assert!(workshop.fail("diff a.png model.obj").contains("not an image of a known format"));
    let cut = std::fs::read(workshop.path("a.png")).unwrap();
    std::fs::write(workshop.path("cut.png"), &cut[..40]).unwrap();
    assert!(workshop.fail("diff cut.png a.png").contains("cut.png: cannot decode the image"));
}

#[test]
fn every_format_compares_with_itself_and_with_others_where_it_can() {
    let workshop = Workshop::new();
    let formats = ["png", "webp", "tga", "bmp", "jpg", "exr", "hdr"];
    for format in formats {
        workshop.succeed(&format!("render model.obj --size 16x12 --spp 4 -o a.{format}"));
    }
    for format in formats {
        let found = json(&workshop, &format!("diff a.{format} a.{format} --json --max-error 0"));
        assert_eq!(found["space"], if ["exr", "hdr"].contains(&format) { "linear" } else { "encoded" });
    }
    // The others hold the same colours rounded: to half a byte's step of the curve (at most 0.0045 linear), to the noise
    // of JPEG, to 8 bits below the largest channel's exponent.
    workshop.succeed("diff a.png a.bmp --max-error 0");
    workshop.succeed("diff a.exr a.hdr --max-error 0.004");
    let mixed = json(&workshop, "diff a.exr a.webp --json --max-error 0.0045");
    assert_eq!(mixed["space"], "decoded");
}

#[test]
fn values_that_are_not_finite_are_never_silently_equal() {
    let workshop = Workshop::new();
    let channels =
        exr::prelude::SpecificChannels::rgb(
            |at: exr::prelude::Vec2<usize>| {
                if at.x() == 1 { (f32::NAN, 0.0, f32::INFINITY) } else { (0.5, 0.5, 0.5) }
            },
        );
    let path = workshop.path("nan.exr");
    exr::prelude::WritableImage::write(&exr::prelude::Image::from_channels((3, 2), channels)).to_file(path).unwrap();
    let found = json(&workshop, "diff nan.exr nan.exr --json");
    assert_eq!(found["color"]["not_finite"], serde_json::json!({"only_a": 0, "only_b": 0, "both": 2}));
    assert_eq!(found["color"]["max"], 0.0);
    let output = workshop.run("diff nan.exr nan.exr --max-error 1");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("2 pixels are not finite"));
    assert!(text(&output.stdout).contains("0 in A alone, 0 in B alone, 2 in both"));
}

#[test]
fn alpha_counts_and_layers_are_named() {
    let workshop = Workshop::new();
    RgbaImage::from_pixel(2, 2, Rgba([9, 9, 9, 255])).save(workshop.path("opaque.png")).unwrap();
    RgbaImage::from_pixel(2, 2, Rgba([9, 9, 9, 204])).save(workshop.path("clear.png")).unwrap();
    RgbImage::from_pixel(2, 2, Rgb([9, 9, 9])).save(workshop.path("plain.png")).unwrap();
    workshop.succeed("diff opaque.png plain.png --max-error 0");
    let place = &json(&workshop, "diff plain.png clear.png --json")["color"]["max_at"];
    assert_eq!((&place["channel"], &place["a"], &place["b"]), (&"A".into(), &1.0.into(), &0.8.into()));

    workshop.succeed("render model.obj --size 8x6 --spp 1 --aov depth,id -o a.exr");
    workshop.succeed("render model.obj --size 8x6 --spp 1 --aov depth,normal -o b.exr");
    let found = json(&workshop, "diff a.exr b.exr --json --max-error 0");
    assert_eq!((&found["layers"][0]["name"], &found["layers"][0]["max"]), (&"depth".into(), &0.0.into()));
    assert_eq!(found["unmatched_layers"], serde_json::json!(["id", "normal"]));
    let printed = text(&workshop.succeed("diff a.exr b.exr"));
    assert!(printed.contains("layer          depth") && printed.contains("not compared   id, normal"), "{printed}");
}

#[test]
fn the_document_is_in_the_manual() {
    let workshop = workshop();
    let found = json(&workshop, "diff a.png b.png --json --max-error 1");
    let expected = [
        "schema",
        "a",
        "b",
        "threshold",
        "width",
        "height",
        "space",
        "color",
        "layers",
        "unmatched_layers",
        "max_error",
        "within",
        "color.max",
        "color.max_at",
        "color.max_at.x",
        "color.max_at.y",
        "color.max_at.channel",
        "color.max_at.a",
        "color.max_at.b",
        "color.rmse",
        "color.psnr",
        "color.mean",
        "color.over_threshold",
        "color.not_finite",
        "color.not_finite.only_a",
        "color.not_finite.only_b",
        "color.not_finite.both",
    ];
    assert_documented(&found, &expected);
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf8_are_printed_as_well_as_can_be() {
    use std::os::unix::ffi::OsStrExt;
    let workshop = workshop();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.png");
    std::fs::copy(workshop.path("a.png"), workshop.path("").join(name)).unwrap();
    let output = workshop.command("diff a.png --json").arg(name).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["b"], "caf\u{fffd}.png");
}
