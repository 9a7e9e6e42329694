//! `whitted explain`, run as a process.

use serde_json::{Value, json};
use whitted::accel::Params;
use whitted::formats::{self, LoadOptions};
use whitted::progress::Silent;
use whitted::render::Renderer;
use whitted::render::explain::{Explanation, Samples};

use crate::command_line::{Workshop, assert_documented, text};

/// A glass ball, with something red in it that cannot be seen through, above a mirror, under two lamps.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    workshop.write(
        "scene.toml",
        "[film]\nsize = [40, 30]\nsamples = 4\nmax_depth = 3\nclamp = \"shade\"\n\
         [camera]\neye = [0, 2, 6]\ntarget = [0, 0.5, 0]\nfov = 40\n\
         [[light]]\nname = \"above\"\nkind = \"point\"\nposition = [0, 6, 0]\n\
         [[light]]\nname = \"below\"\nkind = \"directional\"\ndirection = [0, 1, 0]\n\
         [[material]]\nname = \"glass\"\ndiffuse = 0.1\nks = 0.2\nkr = 0.1\nkt = 0.8\nior = 1.5\nabsorption = 0.3\n\
         [[material]]\nname = \"red\"\ndiffuse = [0.7, 0.1, 0.1]\nks = 0\n\
         [[material]]\nname = \"floor\"\ndiffuse = 0.4\nks = 0.5\n\
         [[object]]\nname = \"ball\"\nsphere = { center = [0, 1, 0], radius = 0.9 }\nmaterial = \"glass\"\n\
         [[object]]\nname = \"core\"\nsphere = { center = [0, 1, 0], radius = 0.3 }\nmaterial = \"red\"\n\
         [[object]]\nname = \"floor\"\nplane = { size = 5 }\nmaterial = \"floor\"\n",
    );
    workshop
}

fn explained(workshop: &Workshop, x: u32, y: u32) -> Explanation {
    let scene = formats::open(&workshop.path("scene.toml"), &LoadOptions::default(), &Silent).unwrap().scene;
    let renderer = Renderer::build(scene, &Params::default(), &Silent).unwrap();
    renderer.explain(x, y, Samples::All, &Silent).unwrap()
}

fn json_of(workshop: &Workshop, arguments: &str) -> Value {
    serde_json::from_slice(&workshop.succeed(arguments)).unwrap()
}

#[test]
fn json_is_the_librarys_explanation_to_the_bit() {
    let workshop = workshop();
    let expected = explained(&workshop, 20, 17);
    let mut found = json_of(&workshop, "explain scene.toml --pixel 20,17 --json");
    let document = found.as_object_mut().unwrap();
    assert_eq!(document.remove("schema"), Some(json!(1)));
    assert_eq!(document.remove("version"), Some(json!(env!("CARGO_PKG_VERSION"))));
    assert_eq!(document.remove("input"), Some(json!("scene.toml")));
    assert!(document.remove("camera").is_some_and(|name| name.is_string()));
    assert_eq!(document.remove("film").unwrap()["samples"], 4);
    let own: Value = serde_json::from_str(&serde_json::to_string(&expected).unwrap()).unwrap();
    assert_eq!(found, own);
    for (sample, own) in found["samples"].as_array().unwrap().iter().zip(&expected.samples) {
        let read: Vec<u32> = sample["color"]
            .as_array()
            .unwrap()
            .iter()
            .map(|value| value.to_string().parse::<f32>().unwrap().to_bits())
            .collect();
        assert_eq!(read, own.color.to_array().map(f32::to_bits));
    }
}

#[test]
fn every_key_of_the_json_is_in_the_manual() {
    let workshop = workshop();
    let json = json_of(&workshop, "explain scene.toml --pixel 20,17 --json");
    let film = ["width", "height", "samples", "max_depth", "clamp", "transfer", "exposure"];
    let film: Vec<String> = film.iter().map(|key| format!("film.{key}")).collect();
    let top = ["schema", "version", "input", "camera", "film", "x", "y", "color", "alpha", "samples"];
    assert_documented(&json, &top.into_iter().chain(film.iter().map(String::as_str)).collect::<Vec<_>>());
    assert_documented(&json["samples"][0], &["number", "position", "color", "hit", "rays"]);
    let found = ["object", "instance", "primitive", "part", "material", "t"];
    let under = |keys: &[&str], inner: &str| -> Vec<String> {
        let inner = found.iter().map(|key| format!("{inner}.{key}"));
        keys.iter().map(|key| key.to_string()).chain([inner_head(inner.clone())]).chain(inner).collect()
    };
    let rays: Vec<&Value> =
        json["samples"].as_array().unwrap().iter().flat_map(|s| s["rays"].as_array().unwrap()).collect();
    let strip = |value: &Value, keys: &[&str]| {
        let mut value = value.clone();
        keys.iter().for_each(|key| drop(value.as_object_mut().unwrap().remove(*key)));
        value
    };
    for ray in &rays {
        let keys = ["parent", "way", "depth", "origin", "direction", "holes", "color"];
        assert_documented(&strip(ray, &["end"]), &keys);
        if let Some(surface) = ray["end"].get("surface") {
            let keys = under(&["instead_of", "point", "geometric_normal", "normal", "from_outside", "terms"], "found");
            assert_documented(surface, &keys.iter().map(String::as_str).collect::<Vec<_>>());
        } else {
            assert_documented(&ray["end"]["background"], &["kind", "color"]);
        }
    }
    let terms: Vec<&Value> =
        rays.iter().filter_map(|ray| ray["end"]["surface"]["terms"].as_array()).flatten().collect();
    let kinds: std::collections::BTreeSet<&str> = terms.iter().filter_map(|term| term["term"].as_str()).collect();
    assert_eq!(kinds.into_iter().collect::<Vec<_>>(), ["absorbed", "ambient", "clamped", "emission", "light", "seen"]);
    let (mut crossed, mut blocked, mut dark) = (0, 0, 0);
    for term in terms {
        let keys: &[&str] = match term["term"].as_str().unwrap() {
            "ambient" | "emission" => &["term", "color"],
            "seen" => &["term", "way", "weight", "ray", "added"],
            "absorbed" => &["term", "length", "left"],
            "clamped" => &["term", "from", "to"],
            _ => &["term", "number", "light", "added"],
        };
        assert_documented(&strip(term, &["lighting"]), keys);
        if let Some(arrival) = term["lighting"].get("shines") {
            let keys =
                ["to_light", "distance", "color", "n_dot_l", "r_dot_v", "diffuse", "specular", "visible", "crossed"];
            assert_documented(&strip(arrival, &["blocked_by"]), &keys);
            blocked += u32::from(!arrival["blocked_by"].is_null());
            for crossing in arrival["crossed"].as_array().unwrap() {
                let keys = under(&["distance", "passes", "length", "left"], "found");
                assert_documented(crossing, &keys.iter().map(String::as_str).collect::<Vec<_>>());
                crossed += 1;
            }
        } else if term["term"] == "light" {
            assert_documented(&term["lighting"], &["dark", "dark.behind", "dark.behind.n_dot_l"]);
            dark += 1;
        }
    }
    assert!(crossed > 0 && blocked > 0 && dark > 0, "{crossed} {blocked} {dark}");
}

fn inner_head(mut inner: impl Iterator<Item = String>) -> String {
    inner.next().unwrap().split('.').next().unwrap().to_owned()
}

#[test]
fn text_tells_the_first_sample_in_full_and_the_colours_of_all() {
    let workshop = workshop();
    let expected = explained(&workshop, 20, 17);
    let told = text(&workshop.succeed("explain scene.toml --pixel 20,17"));
    let all_digits = |color: whitted::scene::Rgb| {
        let [r, g, b] = color.to_array();
        if r == g && g == b { format!("{r:?}") } else { format!("{r:?} {g:?} {b:?}") }
    };
    assert!(told.starts_with(&format!("pixel 20,17 of 40x30: {}\n", all_digits(expected.color))), "{told}");
    for sample in &expected.samples {
        let line = format!("{:5}  {}", sample.number, all_digits(sample.color));
        assert!(told.lines().any(|found| found == line), "`{line}` is missing:\n{told}");
    }
    assert_eq!(told.matches("\nsample ").count(), 1);
    for part in [
        "sample 0 at",
        "ray 0, of the camera, from 0.0 2.0 6.0 along",
        "hits `ball` (instance 0, primitive 0), material `glass`, from outside at t = ",
        "ambient",
        "light 0 `above`",
        "light 1 `below`: behind the surface, N.L -",
        "ray 1, reflected: kr 0.1 * ",
        "refracted: kt 0.8 * ",
        "hits `core` (instance 1, primitive 0), material `red`",
        "blocked by `core` (instance 1, primitive 0) at a distance of ",
        "through `ball` (instance 0, primitive 0) at t = ",
        "left after",
    ] {
        assert!(told.contains(part), "`{part}` is missing:\n{told}");
    }
    let third = text(&workshop.succeed("explain scene.toml --pixel 20,17 --sample 3"));
    assert!(third.contains("\nsample 3 at") && !third.contains("\nsample 0 at"), "{third}");
    // At depth 0 the branches say that they end.
    let shallow = text(&workshop.succeed("explain scene.toml --pixel 20,17 --max-depth 0 --spp 1"));
    assert!(shallow.contains("refracted: kt 0.8, not followed") && !shallow.contains("ray 1"), "{shallow}");
}

#[test]
fn the_flags_of_render_choose_what_is_explained() {
    let workshop = workshop();
    let flags = "--size 9x7 --spp 2 --clamp output --max-depth 1 --view top --fov 50 --threads 1 --accelerator linear";
    let json = json_of(&workshop, &format!("explain scene.toml --pixel 8,6 --sample 1 --json {flags}"));
    let film = &json["film"];
    assert_eq!((&film["width"], &film["samples"], &film["clamp"]), (&json!(9), &json!(2), &json!("output")));
    assert_eq!(json["camera"], "command line");
    assert!(json["samples"][0]["rays"].is_null() && json["samples"][1]["rays"].is_array());
    // A model alone has its automatic camera and lights.
    let told = text(&workshop.succeed("explain model.obj --pixel 20,15 --size 40x30 --spp 1"));
    assert!(told.contains("material `floor`") && told.contains("light 0 `key`"), "{told}");
}

#[test]
fn mistakes_are_told_in_a_line() {
    let workshop = workshop();
    for (flags, told) in [
        (
            "scene.toml --pixel 40,0",
            "the pixel 40,0 does not lie within the 40x30 picture; X can be 39 and Y 29 at most",
        ),
        ("scene.toml --pixel 0,30 --json", "0,30"),
        ("scene.toml --pixel 1,1 --sample 4", "there is no sample 4: pixels have 4"),
        ("none.toml --pixel 1,1", "none.toml"),
        ("scene.toml --pixel 1,1 --camera none", "there is no camera `none`"),
    ] {
        let error = workshop.fail(&format!("explain {flags}"));
        assert!(error.contains(told), "{flags}: {error}");
    }
    for wrong in ["explain scene.toml", "explain scene.toml --pixel 1", "explain scene.toml --pixel -1,2"] {
        assert_eq!(workshop.run(wrong).status.code(), Some(2), "{wrong}");
    }
}
