//! Tiny meshes, each with one flaw, and a closed cube with none.

use glam::Vec3;

use super::*;

/// The cube [0, 1]^3, closed, faces outward: vertex number x + 2 y + 4 z.
fn cube() -> TriangleMesh {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriangleMesh {
        positions: (0..8).map(corner).collect(),
        indices: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..Default::default()
    }
}

/// The cube with vertices of its own at every corner, and the faces' normals.
fn split_cube() -> TriangleMesh {
    let cube = cube();
    let corner = |&[a, b, c]: &[u32; 3]| [a, b, c].map(|vertex| cube.positions[vertex as usize]);
    let corners: Vec<[Vec3; 3]> = cube.indices.iter().map(corner).collect();
    let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
    TriangleMesh {
        positions: corners.as_flattened().to_vec().into(),
        indices: (0..12).map(|number| [3 * number, 3 * number + 1, 3 * number + 2]).collect(),
        normals: Some(corners.iter().flat_map(|&corners| [normal(corners); 3]).collect()),
        ..Default::default()
    }
}

/// Triangle and vertex.
type Places = Vec<(Option<u32>, Option<u32>)>;

fn found(mesh: TriangleMesh) -> Vec<(Flaw, u64, Places)> {
    let findings = examine(&mesh.finish().unwrap(), &|_, _| false);
    let places = |finding: &Finding| finding.places.iter().map(|place| (place.triangle, place.vertex)).collect();
    findings.iter().map(|(flaw, finding)| (flaw, finding.count, places(finding))).collect()
}

/// Changes the cube and expects one flaw, once, there.
fn expect(change: impl Fn(&mut TriangleMesh), flaw: Flaw, triangle: Option<u32>, vertex: Option<u32>) {
    let mut mesh = cube();
    change(&mut mesh);
    assert_eq!(found(mesh), [(flaw, 1, vec![(triangle, vertex)])]);
}

#[test]
fn a_closed_cube_has_no_flaw_however_its_vertices_are_split() {
    assert_eq!(found(cube()), []);
    assert_eq!(found(split_cube()), []);
    let mut signed = split_cube();
    let odd = signed.positions.iter_mut().step_by(2);
    odd.for_each(|p| *p = Vec3::select(p.cmpeq(Vec3::ZERO), -Vec3::ZERO, *p));
    assert_eq!(found(signed), [], "zeros of either sign are one coordinate");
}

#[test]
fn triangles_that_cannot_be_hit_are_told_apart() {
    expect(|mesh| mesh.indices.push([0, 1, 99]), Flaw::BadIndex, Some(12), None);
    expect(|mesh| mesh.indices.push([0, 1, 1]), Flaw::Degenerate, Some(12), None);
    let far = |mesh: &mut TriangleMesh| {
        mesh.positions.push(Vec3::new(f32::NAN, 0.0, 0.0));
        mesh.indices.push([0, 1, 8]);
    };
    expect(far, Flaw::NonFinite, Some(12), None);
}

#[test]
fn duplicates_count_whichever_way_round_and_do_not_spoil_the_edges() {
    expect(|mesh| mesh.indices.push([0, 2, 3]), Flaw::Duplicate, Some(12), None);
    expect(|mesh| mesh.indices.push([3, 0, 2]), Flaw::Duplicate, Some(12), None);
    expect(|mesh| mesh.indices.push([3, 2, 0]), Flaw::Duplicate, Some(12), None);
    let mut mesh = cube();
    mesh.indices.extend([[7, 6, 4], [0, 2, 3], [4, 7, 6]]);
    assert_eq!(found(mesh), [(Flaw::Duplicate, 3, vec![(Some(12), None), (Some(13), None), (Some(14), None)])]);
}

#[test]
fn a_triangle_turned_round_has_three_edges_of_wrong_winding() {
    let mut mesh = cube();
    mesh.indices[5] = [0, 4, 5];
    let [(flaw, count, places)] = &found(mesh)[..] else { panic!() };
    assert_eq!((*flaw, *count, places.len()), (Flaw::InconsistentWinding, 3, 3));
    assert!(places.iter().all(|(triangle, _)| *triangle <= Some(5)));
}

#[test]
fn a_hole_has_open_edges_with_their_places() {
    let mut mesh = cube();
    mesh.indices.update(|indices| indices.remove(11));
    // The triangle was 1, 7, 5.
    let places = [(2, 5), (4, 1), (10, 7)].map(|(triangle, vertex)| (Some(triangle), Some(vertex))).to_vec();
    assert_eq!(found(mesh), [(Flaw::OpenEdge, 3, places)]);
}

#[test]
fn a_fin_is_not_manifold_and_open() {
    let mut mesh = cube();
    mesh.positions.push(Vec3::new(-1.0, -1.0, 0.5));
    mesh.indices.push([0, 4, 8]);
    let found = found(mesh);
    let counts: Vec<_> = found.iter().map(|(flaw, count, _)| (*flaw, *count)).collect();
    assert_eq!(counts, [(Flaw::OpenEdge, 2), (Flaw::NonManifoldEdge, 1)]);
}

#[test]
fn unused_vertices_are_counted_and_only_a_few_are_named() {
    expect(|mesh| mesh.positions.push(Vec3::ONE), Flaw::UnreferencedVertex, None, Some(8));
    let mut mesh = cube();
    mesh.positions.update(|positions| positions.resize(108, Vec3::ZERO));
    let places = (8..13).map(|vertex| (None, Some(vertex))).collect();
    assert_eq!(found(mesh), [(Flaw::UnreferencedVertex, 100, places)]);
}

#[test]
fn normals_that_cannot_be_right_are_found() {
    let with = |vertex: usize, normal: Vec3| {
        let mut mesh = split_cube();
        mesh.normals.as_mut().unwrap()[vertex] = normal;
        found(mesh)
    };
    let right = split_cube().normals.unwrap()[7];
    let at = |triangle, flaw| [(flaw, 1, vec![(triangle, Some(7))])];
    assert_eq!(with(7, -right), at(Some(2), Flaw::OpposedNormal));
    assert_eq!(with(7, Vec3::ZERO), at(None, Flaw::ZeroNormal));
    assert_eq!(with(7, right * 1.02), at(None, Flaw::NonUnitNormal));
    assert_eq!(with(7, Vec3::splat(f32::NAN)), at(None, Flaw::NonUnitNormal));
    assert_eq!(with(7, right * 1.005), []);
    assert_eq!(with(7, right + Vec3::splat(1e-3)), []);
}

#[test]
fn texture_coordinates_are_judged_by_material_and_vertex() {
    let mesh = cube().finish().unwrap();
    let findings = examine(&mesh, &|material, vertex| material == 0 && vertex == 7);
    let [(flaw, finding)] = &findings.iter().collect::<Vec<_>>()[..] else { panic!() };
    let around = mesh.indices.iter().filter(|corners| corners.contains(&7)).count() as u64;
    assert_eq!((*flaw, finding.count), (Flaw::OutsideImage, around));
    assert!(examine(&mesh, &|material, _| material == 1).iter().next().is_none());
}

#[test]
fn a_flat_triangle_beside_a_t_junction_closes_it() {
    // A square cut into two, with a vertex in the middle of one side that only a flat triangle uses on the other.
    let positions = vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 2.0, 0.0), Vec3::X, Vec3::new(1.0, -1.0, 0.0)];
    let indices = vec![[0, 1, 2], [3, 1, 0], [0, 3, 4], [3, 4, 1]];
    let mesh = TriangleMesh { positions: positions.into(), indices: indices.into(), ..Default::default() };
    let open = found(mesh).into_iter().find(|(flaw, ..)| *flaw == Flaw::OpenEdge).unwrap().1;
    // Around: 1-2, 2-0, 0-4, 4-1; the edges along the x axis are shared with the flat triangle.
    assert_eq!(open, 4);
}
