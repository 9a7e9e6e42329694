//! `whitted bench`, run as a process: equal hits, what the documents say, and what is refused.

use std::collections::BTreeSet;
use std::fs;

use serde_json::Value;

use crate::command_line::{Workshop, text};
use crate::report::assert_well_formed;

const MANUAL: &str = include_str!("../src/manual/command_line.md");

fn document(workshop: &Workshop, flags: &str) -> Value {
    serde_json::from_slice(&workshop.succeed(&format!("bench {flags} --json"))).unwrap()
}

/// The rows of the renderer's own structures.
fn rows(document: &Value) -> Vec<&Value> {
    document["rows"].as_array().unwrap().iter().filter(|row| row["peer"] == false).collect()
}

/// The rows of other programs whose names begin so.
fn peers<'a>(document: &'a Value, name: &str) -> Vec<&'a Value> {
    let own = |row: &&Value| row["peer"] == true && row["accelerator"].as_str().unwrap().starts_with(name);
    document["rows"].as_array().unwrap().iter().filter(own).collect()
}

/// The values of a field, each once.
fn values(document: &Value, field: &str) -> BTreeSet<String> {
    rows(document).iter().map(|row| row[field].as_str().unwrap_or("null").to_owned()).collect()
}

#[test]
fn all_structures_give_the_same_hits_and_the_json_is_documented() {
    let workshop = Workshop::new();
    let bench = document(
        &workshop,
        "model.obj --views outside --rays 3000 --presets all --threads 1,2 --rounds 2 --svg plot.svg",
    );
    assert_eq!((&bench["schema"], &bench["complete"], &bench["rounds"]), (&1.into(), &true.into(), &2.into()));
    let kinds = ["primary", "shadow", "reflect", "diffuse"];
    assert_eq!(values(&bench, "ray_kind"), kinds.map(String::from).into());
    let structures: BTreeSet<String> = whitted::accel::Kind::ALL.iter().map(|kind| kind.name().to_owned()).collect();
    assert_eq!(values(&bench, "accelerator"), structures);
    // linear has no presets.
    assert_eq!(rows(&bench).len(), 4 * 2 * 2 * (1 + 3 * (structures.len() - 1)));
    for row in rows(&bench) {
        assert_eq!(
            (&row["differing"], &row["first_differing"], &row["peer"]),
            (&0.into(), &Value::Null, &false.into())
        );
        let positive = |key: &str| row[key].as_f64().unwrap() > 0.0;
        assert!(positive("mrays_per_s") && positive("build_s") && positive("bytes_per_triangle"), "{row}");
        // Every triangle, or some and boxes before them.
        let (boxes, triangles) = (row["boxes_per_ray"].as_f64().unwrap(), row["triangles_per_ray"].as_f64().unwrap());
        let is_linear = row["accelerator"] == "linear";
        assert!(is_linear == (boxes == 0.0) && triangles > 0.0 && triangles <= 13.0, "{row}");
        assert!(!is_linear || triangles == 13.0 || row["ray_kind"] == "shadow", "{row}");
        assert!(row["spread"].as_f64().unwrap() >= 0.0 && row["ratio_to_embree"].is_null(), "{row}");
    }
    for kind in kinds {
        let own: Vec<&Value> = rows(&bench).into_iter().filter(|row| row["ray_kind"] == kind).collect();
        let hashes: BTreeSet<&str> = own.iter().map(|row| row["hit_hash"].as_str().unwrap()).collect();
        assert_eq!(hashes.len(), 1, "{kind}");
        assert!(own[0]["rays"].as_u64().unwrap() > 100 && own[0]["hits"].as_u64().unwrap() > 3, "{}", own[0]);
    }
    let (_, manual) = MANUAL.split_once("### `bench --json`").unwrap();
    for object in [&bench, &bench["models"][0], rows(&bench)[0]] {
        for key in object.as_object().unwrap().keys() {
            assert!(manual.contains(&format!("\"{key}\":")), "`{key}` is missing");
        }
    }
    assert_well_formed(&fs::read_to_string(workshop.path("plot.svg")).unwrap());
    let svg = fs::read_to_string(workshop.path("plot.svg")).unwrap();
    assert!(svg.contains("model: outside diffuse") && svg.contains("cwbvh best x2"), "{svg}");
}

#[test]
fn tables_name_every_contender_and_the_calls() {
    let workshop = Workshop::new();
    let page = text(
        &workshop.succeed("bench model.obj ./model.obj --views outside --rays 200 --rounds 1 --ray-kinds primary"),
    );
    for line in ["## model: 13 triangles", "## model-2: 13 triangles", "### model: outside primary, 256 rays ("] {
        assert!(page.lines().any(|own| own.starts_with(line)), "{line}: {page}");
    }
    for contender in
        ["| bvh2 | balanced | single | 1 |", "| cwbvh | balanced | batch | 1 |", "| linear | - | batch | 1 |"]
    {
        assert_eq!(page.lines().filter(|line| line.starts_with(contender)).count(), 2, "{contender}: {page}");
    }
}

#[test]
fn hits_can_be_compared_with_a_tree_that_culls_nothing() {
    let workshop = Workshop::new();
    let bench = document(&workshop, "model.obj --rays 3000 --rounds 0 --reference loose");
    assert_eq!(bench["models"][0]["reference"], "loose");
    assert!(rows(&bench).iter().all(|row| row["differing"] == 0));
    let page = text(&workshop.succeed("bench model.obj --rays 200 --rounds 0 --ray-kinds primary --reference loose"));
    assert!(page.contains("The reference, loose, equals linear on "), "{page}");
}

#[test]
fn rays_of_files_are_asked_as_their_names_say_and_hits_are_those_of_query() {
    let workshop = Workshop::new();
    workshop.write("x.shadow.rays", "0.5 3 0.5 0 -1 0\n9 9 9 1 0 0\n-0.5 3 -0.5 0 -1 0 0 0.5\n");
    let rays: [[f32; 8]; 2] = [[0.5, 3.0, 0.5, 0.0, 0.0, -1.0, 0.0, 9.0], [-0.5, 3.0, -0.5, 0.0, 0.0, -1.0, 0.0, 9.0]];
    fs::write(workshop.path("y.rays"), rays.concat().iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
        .unwrap();
    let flags = "model.obj --ray-file x.shadow.rays y.rays --accelerators bvh2,cwbvh --calls batch --rounds 0";
    let bench = document(&workshop, &format!("{flags} --hits-out hits.bin"));
    let rows = rows(&bench);
    let told: Vec<_> = rows
        .iter()
        .map(|row| (row["ray_kind"].as_str().unwrap(), row["hits"].as_u64().unwrap(), row["hits_at"].as_u64().unwrap()))
        .collect();
    let kinds = told.iter().map(|&(kind, hits, _)| (kind, hits)).collect::<Vec<_>>();
    assert_eq!(kinds, [("shadow", 1), ("shadow", 1), ("file", 2), ("file", 2)]);
    assert!(rows.iter().all(|row| row["mrays_per_s"].is_null() && row["view"].is_null()));
    let hits = fs::read(workshop.path("hits.bin")).unwrap();
    let asked = workshop.succeed("query model.obj --ray-file y.rays --format f32");
    assert_eq!(asked.len(), 40);
    for (kind, _, at) in told {
        let expected = if kind == "shadow" { &[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] } else { &asked[..] };
        assert!(hits[at as usize..].starts_with(expected), "{kind} at {at}");
    }
    // Every contender wrote its answers to both files once, peers too.
    assert_eq!(hits.len(), bench["rows"].as_array().unwrap().len() / 2 * (12 + 40));
}

#[test]
fn rooms_are_seen_from_inside_too() {
    let workshop = Workshop::new();
    // The box [-1, 1]^3, faces inward.
    workshop.write(
        "room.obj",
        "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n\
         f 1 2 4 3\nf 6 5 7 8\nf 5 1 3 7\nf 2 6 8 4\nf 5 6 2 1\nf 3 4 8 7\n",
    );
    let flags = "room.obj --rays 500 --rounds 0 --accelerators bvh2";
    let bench = document(&workshop, flags);
    assert_eq!(values(&bench, "view"), ["inside", "outside"].map(String::from).into());
    for row in rows(&bench).iter().filter(|row| row["view"] == "inside" && row["ray_kind"] != "shadow") {
        assert_eq!(row["hits"], row["rays"], "{row}");
    }
    assert_eq!(values(&document(&workshop, &format!("{flags} --views outside")), "view").len(), 1);
    assert_eq!(values(&document(&workshop, "model.obj --rays 500 --rounds 0 --views inside"), "view").len(), 1);
}

#[test]
fn bad_input_is_refused_in_one_line_and_nothing_is_left() {
    let workshop = Workshop::new();
    workshop.write("bad.rays", "0.5 3 0.5 0 -1 0\n1 2 x 0 0 1\n");
    workshop.write("empty.obj", "v 0 0 0\n");
    let names = workshop.names();
    for (flags, told) in [
        ("nowhere.obj", "nowhere.obj"),
        ("empty.obj", "empty.obj"),
        ("model.obj --ray-file bad.rays", "bad.rays:2:5: "),
        ("model.obj --ray-file nowhere.rays", "nowhere.rays"),
        ("model.obj --svg nowhere/plot.svg", "nowhere"),
        ("model.obj --hits-out model.obj", "model.obj"),
        ("model.obj --embree nowhere.so", "nowhere.so: cannot be loaded"),
    ] {
        let error = workshop.fail(
            &format!("bench {flags} --hits-out hits.bin --rays 100")
                .replace("--hits-out model.obj --hits-out hits.bin", "--hits-out model.obj"),
        );
        assert!(error.contains(told), "{flags}: {error}");
    }
    assert_eq!(workshop.names(), names);
    for flags in ["", "model.obj --accelerators kdtree", "model.obj --threads 0", "model.obj --rays 0"] {
        assert_eq!(workshop.run(&format!("bench {flags}")).status.code(), Some(2), "{flags}");
    }
}

#[cfg(feature = "embree")]
#[test]
fn what_is_not_embree_is_refused_with_a_remedy() {
    let workshop = Workshop::new();
    let error = workshop.fail("bench model.obj --embree model.obj --rays 100");
    assert!(error.contains("model.obj: cannot be loaded: ") && error.contains("libembree4.so.4"), "{error}");
    // The C library, which every Linux with a dynamic loader has.
    if cfg!(all(target_os = "linux", target_env = "gnu")) {
        let error = workshop.fail("bench model.obj --embree libc.so.6 --rays 100");
        assert!(error.contains("libc.so.6: is not Embree 4: there is no `rtcNewDevice` in it"), "{error}");
    }
}

#[cfg(feature = "embree")]
#[test]
fn embree_takes_part_where_there_is_one() {
    let Some(library) = std::env::var_os("WHITTED_EMBREE").filter(|name| !name.is_empty()) else {
        eprintln!("left out: WHITTED_EMBREE names no library");
        return;
    };
    let workshop = Workshop::new();
    let flags = "bench model.obj --views outside --rays 20000 --rounds 1 --accelerators bvh2 --threads 1,2 --json";
    let output = workshop.command(flags).env("WHITTED_EMBREE", library).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let bench: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(bench["notes"][0].as_str().unwrap().starts_with("Embree 4."), "{}", bench["notes"]);
    let peers = peers(&bench, "embree");
    assert_eq!(peers.len(), 4 * 2 * 3);
    for peer in peers {
        assert_agrees(&bench, peer);
        assert!((peer["accelerator"] == "embree") == (peer["ratio_to_embree"] == 1.0), "{peer}");
    }
}

#[cfg(feature = "embree")]
#[test]
fn embree_gives_whole_records_alone_and_in_packets() {
    use whitted::accel::Params;
    use whitted::geometry::{Hit, Ray};
    use whitted::glam::Vec3;
    use whitted::measure::peers::embree::{EmbreeScene, Library};
    use whitted::measure::peers::{Peer, Surface};
    use whitted::progress::Silent;
    let Some(path) = std::env::var_os("WHITTED_EMBREE").filter(|name| !name.is_empty()) else {
        eprintln!("left out: WHITTED_EMBREE names no library");
        return;
    };
    let workshop = Workshop::new();
    // A second instance, moved and mirrored, has a number of its own.
    workshop.write(
        "two.toml",
        "[[object]]\nmesh = \"model.obj\"\ninstances = [[], [{ scale = [-1, 1, 1] }, { translate = [6, 0, 0] }]]\n",
    );
    let loaded = whitted::formats::open(&workshop.path("two.toml"), &Default::default(), &Silent).unwrap();
    let renderer = whitted::render::Renderer::build(loaded.scene, &Params::default(), &Silent).unwrap();
    let library = Library::load(path.as_ref()).unwrap();
    let surfaces = Surface::all(renderer.scene()).unwrap().into();
    let fast = EmbreeScene::build(&library, &surfaces, false, 1).unwrap().peer;
    let robust = EmbreeScene::build(&library, &surfaces, true, 2).unwrap().peer;
    // 37 is no multiple of a packet.
    let rays: Vec<Ray> = (0..37u8)
        .map(|i| Ray {
            t_max: 7.0,
            ..Ray::new(Vec3::new(f32::from(i) * 0.27 - 2.1, 5.0, 0.11), Vec3::new(0.03, -1.0, 0.02))
        })
        .collect();
    let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    fast.closest_in_packets(&rays, &mut hits);
    fast.occluded_in_packets(&rays, &mut occluded);
    let mut instances = BTreeSet::new();
    for (number, ray) in rays.iter().enumerate() {
        let ours = renderer.closest(ray);
        instances.insert(ours.instance);
        for hit in [fast.closest(ray), robust.closest(ray), hits[number]] {
            assert_eq!((hit.instance, hit.primitive), (ours.instance, ours.primitive), "{number}");
            let near = |a: f32, b: f32| a == b || (a - b).abs() < 1e-5;
            assert!(near(hit.t, ours.t) && near(hit.u, ours.u) && near(hit.v, ours.v), "{number}: {hit:?} {ours:?}");
        }
        assert_eq!([fast.occluded(ray), robust.occluded(ray), occluded[number]], [ours.is_hit(); 3], "{number}");
    }
    assert!(instances.len() == 3, "both instances and misses: {instances:?}");
}

#[cfg(feature = "peers")]
#[test]
fn other_crates_take_part() {
    let workshop = Workshop::new();
    let bench = document(&workshop, "model.obj --views outside --rays 20000 --rounds 1 --accelerators bvh2");
    for name in ["obvhs-bvh2", "obvhs-cwbvh", "parry3d", "bvh"] {
        let peers = peers(&bench, name);
        assert_eq!(peers.len(), 4, "{name}");
        peers.into_iter().for_each(|peer| assert_agrees(&bench, peer));
    }
}

/// Panics unless a peer's answers are nearly ours: rays of pictures seldom meet edges, where it may miss.
fn assert_agrees(bench: &Value, peer: &Value) {
    let ours = rows(bench).into_iter().find(|row| row["ray_kind"] == peer["ray_kind"]).unwrap();
    let rays = peer["rays"].as_u64().unwrap();
    let differing = peer["differing"].as_u64().unwrap() + peer["other_triangle"].as_u64().unwrap();
    assert!(differing <= rays / 1000 + 1, "{peer}");
    assert!(peer["hits"].as_u64().unwrap().abs_diff(ours["hits"].as_u64().unwrap()) <= differing, "{peer}");
    assert!(peer["bytes_per_triangle"].as_f64().unwrap() > 10.0 && peer["mrays_per_s"].as_f64().unwrap() > 0.0);
}
