//! `whitted report`, run as a process: its files, and facts that any honest measurement must find.

use std::collections::BTreeSet;
use std::fs;

use serde_json::Value;

use crate::command_line::{Workshop, text};

const MANUAL: &str = include_str!("../src/manual/report.md");

fn rows<'a>(report: &'a Value, table: &str) -> &'a Vec<Value> {
    report["subjects"][0][table].as_array().unwrap()
}

fn wrong(row: &Value) -> u64 {
    row["misses"]["wrong"].as_u64().unwrap() + row["false_hits"]["wrong"].as_u64().unwrap()
}

/// Panics unless a text is well-formed XML of tags, attributes and text: what a plot needs of it.
pub fn assert_well_formed(xml: &str) {
    let mut open = Vec::new();
    let mut rest = xml.trim();
    while let Some(start) = rest.find('<') {
        let (between, tag) = rest.split_at(start);
        assert!(
            between.matches('&').count()
                == between.matches("&amp;").count()
                    + between.matches("&lt;").count()
                    + between.matches("&gt;").count()
                    + between.matches("&quot;").count()
                    + between.matches("&apos;").count()
        );
        let end = tag.find('>').expect("a tag ends");
        let inner = &tag[1..end];
        rest = &tag[end + 1..];
        if let Some(name) = inner.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "closed in order");
            continue;
        }
        assert!(!inner.contains('<'), "{inner}");
        assert_eq!(inner.matches('"').count() % 2, 0, "{inner}");
        if !inner.ends_with('/') {
            open.push(inner.split_whitespace().next().unwrap().to_owned());
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "{open:?} {rest}");
}

#[test]
fn well_formed_is_told_from_broken() {
    assert_well_formed("<svg a=\"1\"><g/><text>a &lt; b</text></svg>");
    for broken in ["<a><b></a></b>", "<a>&</a>", "<a", "<a b=\"></a>", "<a></a>b<c>"] {
        assert!(std::panic::catch_unwind(|| assert_well_formed(broken)).is_err(), "{broken}");
    }
}

#[test]
fn the_leaks_of_a_closed_sphere_are_found_and_ours_has_none() {
    let workshop = Workshop::new();
    let printed = workshop.succeed(
        "report --hard-set sphere --planes query --ray-kinds random,vertex --rays 3000 --timed-rays 50 --out r",
    );
    assert_eq!(text(&printed).trim(), std::path::Path::new("r").join("report.md").to_str().unwrap());
    let names: BTreeSet<String> = fs::read_dir(workshop.path("r"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let expected = [
        "accuracy-sphere-adversarial.svg",
        "accuracy-sphere-generic.svg",
        "query-sphere-adversarial.svg",
        "query-sphere-generic.svg",
        "report.json",
        "report.md",
    ];
    assert_eq!(names, expected.map(String::from).into());
    for name in names.iter().filter(|name| name.ends_with(".svg")) {
        assert_well_formed(&fs::read_to_string(workshop.path("r").join(name)).unwrap());
    }

    let report: Value = serde_json::from_slice(&fs::read(workshop.path("r/report.json")).unwrap()).unwrap();
    let query = rows(&report, "query");
    let page = fs::read_to_string(workshop.path("r/report.md")).unwrap();
    for row in query {
        let name = row["name"].as_str().unwrap();
        let on_vertices = row["ray_kind"] == "vertex";
        match (row["triangle_test"].as_str().unwrap(), row["box_test"].as_str().unwrap()) {
            ("Möller-Trumbore" | "Baldwin-Weber", _) if on_vertices => assert!(wrong(row) > 10, "{row}"),
            ("Möller-Trumbore" | "Baldwin-Weber" | "Möller-Trumbore f64", _) => {}
            (_, "padded (ours)") => assert_eq!(wrong(row), 0, "{row}"),
            _ => {}
        }
        // A speed has its error beside it, and every row is in the page, dominated or not.
        assert!(row["mrays_per_s"]["value"].as_f64().unwrap() > 0.0 && row["misses"]["total"].as_u64().unwrap() > 0);
        let lines = page.lines().filter(|line| line.starts_with(&format!("| {name} | "))).count();
        assert!(lines >= 4, "{name} is in {lines} lines");
    }
    assert!(query.iter().any(|row| row["dominated"] == true) && query.iter().any(|row| row["dominated"] == false));
    for kind in ["random", "vertex"] {
        let own = |row: &&Value| row["ray_kind"] == kind && row["accelerator"] != "plain";
        let hashes: BTreeSet<&str> = query.iter().filter(own).map(|row| row["hit_hash"].as_str().unwrap()).collect();
        assert_eq!(hashes.len(), 1, "the renderer's trees give one answer: {hashes:?}");
    }
    assert!(page.contains("The default, wide balanced, got 0 of 6000 rays wrong"), "{page}");
    // The exact solver's t is closest; what clamping and shear cost stays below the stated quantile.
    for row in rows(&report, "accuracy").iter().filter(|row| row["triangle_test"] == "Woop (ours)") {
        assert!(row["t_normalized"]["max"].as_f64().unwrap() < 8.0, "{row}");
    }
}

#[test]
fn models_are_measured_and_the_json_is_documented() {
    let workshop = Workshop::new();
    let report: Value =
        serde_json::from_slice(&workshop.succeed("report model.obj --rays 200 --repeat 0 --json")).unwrap();
    for (table, rows) in [("spawn", 15), ("image", 8)] {
        assert_eq!(report["subjects"][0][table].as_array().unwrap().len(), rows, "{table}");
    }
    assert_eq!(
        (report["spheres"].as_array().unwrap().len(), report["light_paths"].as_array().unwrap().len()),
        (24, 35)
    );
    for row in report["subjects"][0]["spawn"].as_array().unwrap().iter().filter(|row| row["default"] == true) {
        assert_eq!(row["self_hits"]["wrong"], 0, "{row}");
    }
    assert_eq!((&report["schema"], &report["complete"]), (&1.into(), &true.into()));
    assert_eq!((&report["subjects"][0]["name"], &report["subjects"][0]["triangles"]), (&"model".into(), &13.into()));
    assert!(rows(&report, "query").iter().all(|row| row["mrays_per_s"].is_null()));
    assert_eq!(rows(&report, "ray_sets").len(), 8);
    let tables = [report["environment"].clone(), report["subjects"][0].clone()];
    let lists = ["ray_sets", "query", "accuracy", "spawn", "image"].map(|table| rows(&report, table)[0].clone());
    let own = ["spheres", "light_paths"].map(|table| report[table][0].clone());
    for object in [&report].into_iter().chain(&tables).chain(&lists).chain(&own) {
        for key in object.as_object().unwrap().keys() {
            assert!(MANUAL.contains(&format!("`{key}`")), "`{key}` is not in the manual");
        }
    }
    assert_eq!(workshop.names().len(), 2, "nothing was written: {:?}", workshop.names());
}

#[test]
fn rays_of_a_file_are_asked_alone() {
    let workshop = Workshop::new();
    workshop.write("rays.txt", "0.5 3 0.5 0 -1 0\n-0.5 3 -0.5 0 -1 0\n9 9 9 1 0 0\n");
    let arguments = "report model.obj --planes query --ray-file rays.txt --repeat 0 --json";
    let report: Value = serde_json::from_slice(&workshop.succeed(arguments)).unwrap();
    let sets = rows(&report, "ray_sets");
    assert_eq!((sets.len(), &sets[0]["ray_kind"], &sets[0]["rays"]), (1, &"file".into(), &3.into()));
    assert_eq!(sets[0]["exact_hits"], 2);
    assert!(rows(&report, "query").iter().all(|row| row["hits"] == 2 && wrong(row) == 0));
    workshop.write("rays.txt", "0.5 3 0.5 0 -1 0\n1 2 x 0 0 1\n");
    assert!(workshop.fail(arguments).contains("rays.txt:2:5: "));
}

#[test]
fn parts_of_one_name_are_numbered_and_a_bad_input_leaves_the_finished_ones() {
    let workshop = Workshop::new();
    workshop.write("empty.obj", "v 0 0 0\n");
    let flags = "--planes query --ray-kinds random --rays 20 --timed-rays 5";
    let output = workshop.run(&format!("report model.obj ./model.obj empty.obj {flags} --out new/r"));
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("empty.obj"), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&fs::read(workshop.path("new/r/report.json")).unwrap()).unwrap();
    assert_eq!(report["complete"], false);
    let names: Vec<&str> =
        report["subjects"].as_array().unwrap().iter().map(|part| part["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["model", "model-2"]);
    for name in names {
        assert!(workshop.path("new/r").join(format!("query-{name}-generic.svg")).is_file(), "{name}");
    }
    let twice = format!("report --hard-set grid,grid {flags} --repeat 0 --json");
    let report: Value = serde_json::from_slice(&workshop.succeed(&twice)).unwrap();
    assert_eq!(report["subjects"].as_array().unwrap().len(), 1);
}

#[test]
fn what_cannot_be_measured_is_refused_before_anything_is_written() {
    let workshop = Workshop::new();
    workshop.write("empty.obj", "v 0 0 0\n");
    for (arguments, told) in [
        ("report missing.obj", "missing.obj: there is no such file"),
        ("report model.mtl", "not supported"),
        ("report model.obj --out model.mtl", "model.mtl"),
    ] {
        let message = workshop.fail(arguments);
        assert!(message.contains(told), "{arguments}: {message}");
        assert_eq!(workshop.names().len(), 3, "{arguments}: {:?}", workshop.names());
    }
    assert!(workshop.fail("report empty.obj --json").contains("empty.obj"));
    assert!(workshop.fail("report empty.obj").contains("empty.obj"));
    assert!(workshop.fail("report empty.obj --out model.obj/r").contains("model.obj"));
    assert_eq!(workshop.names().len(), 3, "{:?}", workshop.names());
    for wrong in ["report", "report model.obj --repeat 5", "report model.obj --ray-kinds all", "report --hard-set cube"]
    {
        assert_eq!(workshop.run(wrong).status.code(), Some(2), "{wrong}");
    }
}
