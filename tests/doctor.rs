//! The mesh doctor on models whose flaws are known.

use std::collections::BTreeMap;

use whitted::formats::{LoadOptions, load_model};
use whitted::geometry::doctor::{Flaw, examine};
use whitted::progress::Silent;

use crate::common::shared;

/// The flaws of a model's only mesh by number, and the numbers of its vertices and triangles; `None` where the shared models are
/// absent.
fn flaws(model: &str) -> Option<(BTreeMap<Flaw, u64>, usize, usize)> {
    let model = load_model(&shared(model)?, &LoadOptions::default(), &Silent).unwrap();
    let mesh = &model.meshes[0];
    let findings = examine(mesh, &|_, _| false);
    let counts = findings.iter().map(|(flaw, finding)| (flaw, finding.count)).collect();
    Some((counts, mesh.positions.len(), mesh.triangle_count()))
}

#[test]
fn the_bunny_has_its_five_holes_and_stray_vertices() {
    let Some((found, vertices, triangles)) = flaws("obj/stanford-bunny.obj") else { return };
    assert_eq!(found, BTreeMap::from([(Flaw::OpenEdge, 223), (Flaw::UnreferencedVertex, 1113)]));
    // Euler's formula: a sphere with five holes has V - E + F = 2 - 5, and every edge but the open ones has two triangles.
    let edges = (3 * triangles + 223) / 2;
    assert_eq!((vertices - 1113 + triangles) as i64 - edges as i64, -3);
}

#[test]
fn scans_that_are_closed_have_no_flaw() {
    for model in ["obj/armadillo_86k.obj", "obj/spot.obj", "nasty-obj/obj2gltf/box/box.obj"] {
        let Some((found, ..)) = flaws(model) else { continue };
        assert_eq!(found, BTreeMap::new(), "{model}");
    }
}

#[test]
fn a_box_with_one_face_turned_round_is_found_out() {
    let path = "nasty-obj/obj2gltf/box-incorrect-winding-order/box-incorrect-winding-order.obj";
    let Some((found, ..)) = flaws(path) else { return };
    assert_eq!(found, BTreeMap::from([(Flaw::InconsistentWinding, 3), (Flaw::OpposedNormal, 1)]));
}
