//! The oracle against closed forms, against another formula without any filter, and against itself scaled and permuted.

use glam::{DMat3, DVec3};

use super::*;
use crate::geometry::{Ray, TriangleMesh, shapes};
use crate::math::random::Random;
use crate::scene::Object;

/// A scene of placed meshes.
fn scene(meshes: Vec<(TriangleMesh, DAffine3)>) -> Scene {
    let mut scene = Scene::default();
    for (number, (mesh, transform)) in (0..).zip(meshes) {
        scene.meshes.push(mesh.finish().unwrap().into());
        scene.objects.push(Object { name: String::new(), shape: Shape::Mesh(number), transform, material: None });
    }
    scene
}

fn mesh(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh { positions: positions.into(), indices: indices.into(), ..TriangleMesh::default() }
}

/// The cube [0, 2]^3: triangles 2 k and 2 k + 1 lie on the lower (k = 0, 1, 2) and upper (3, 4, 5) sides of the axes.
fn cube() -> TriangleMesh {
    let positions = (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0).collect();
    let mut indices = Vec::new();
    for upper in [0, 1] {
        for axis in 0..3u32 {
            let (i, j) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            let corner = upper << axis;
            indices.extend([[corner, corner + i, corner + i + j], [corner, corner + i + j, corner + j]]);
        }
    }
    mesh(positions, indices)
}

/// Every hit by Cramer's rule on `o + t d = a + u (b - a) + v (c - a)` (Moeller and Trumbore 1997), all dyadic, all
/// triangles.
fn brute_force(scene: &Scene, ray: &Ray) -> Vec<(u32, u32, f64)> {
    let world = World::new(scene).unwrap();
    let mut found = Vec::new();
    for (number, instance) in (0u32..).zip(&world.instances) {
        let Shape::Mesh(mesh_number) = instance.shape else { continue };
        let mesh = &scene.meshes[mesh_number as usize];
        for triangle in mesh.live_triangles() {
            let m = instance.transform.to_world();
            let exact = |v: DVec3| v.to_array().map(Dyadic::new);
            let [a, b, c] = mesh.triangle(triangle).map(|p| {
                let p = exact(p.as_dvec3());
                let [x, y, z, t] = [m.x_axis, m.y_axis, m.z_axis, m.translation].map(exact);
                std::array::from_fn(|k| &(&(&(&x[k] * &p[0]) + &(&y[k] * &p[1])) + &(&z[k] * &p[2])) + &t[k])
            });
            let subtract = |a: &[Dyadic; 3], b: &[Dyadic; 3]| -> [Dyadic; 3] { std::array::from_fn(|k| &a[k] - &b[k]) };
            let times = |a: &[Dyadic; 3], b: &[Dyadic; 3]| -> [Dyadic; 3] {
                std::array::from_fn(|k| {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    &(&a[i] * &b[j]) - &(&a[j] * &b[i])
                })
            };
            let onto = |a: &[Dyadic; 3], b: &[Dyadic; 3]| (0..3).fold(Dyadic::ZERO, |s, k| &s + &(&a[k] * &b[k]));
            let (o, d) = (exact(ray.origin.as_dvec3()), exact(ray.direction.as_dvec3()));
            let (e1, e2, from_a) = (subtract(&b, &a), subtract(&c, &a), subtract(&o, &a));
            let (p, q) = (times(&d, &e2), times(&from_a, &e1));
            let mut determinant = onto(&e1, &p);
            let mut numerators = [onto(&from_a, &p), onto(&d, &q), onto(&e2, &q)];
            match determinant.sign() {
                Ordering::Equal => continue,
                Ordering::Less => {
                    determinant = -determinant;
                    numerators = numerators.map(|n| -n);
                }
                Ordering::Greater => {}
            }
            let [u, v, t] = numerators;
            let inside = u >= Dyadic::ZERO && v >= Dyadic::ZERO && &u + &v <= determinant;
            let after = t >= Dyadic::new(f64::from(ray.t_min).max(0.0)) * determinant.clone();
            let before = ray.t_max == f32::INFINITY || t <= Dyadic::new(ray.t_max.into()) * determinant.clone();
            if inside && after && before {
                found.push((Parameter::ratio(t, determinant), number, triangle));
            }
        }
    }
    found.sort();
    found.into_iter().map(|(t, instance, triangle)| (instance, triangle, t.to_f64())).collect()
}

fn records(hits: &[ExactHit]) -> Vec<(u32, u32, f64)> {
    hits.iter().map(|hit| (hit.instance, hit.primitive, hit.t.to_f64())).collect()
}

/// All three questions agree with the brute force.
fn check(scene: &Scene, oracle: &Oracle, ray: &Ray) -> bool {
    let expected = brute_force(scene, ray);
    let all = oracle.all(ray);
    assert_eq!(records(&all), expected, "{ray:?}");
    assert_eq!(records(oracle.closest(ray).as_slice()), expected[..expected.len().min(1)], "{ray:?}");
    assert_eq!(oracle.occluded(ray), !expected.is_empty(), "{ray:?}");
    !expected.is_empty()
}

/// A vector of small whole numbers.
fn lattice(random: &mut Random, size: f64) -> DVec3 {
    (random.in_cube() * size).round()
}

#[test]
fn a_cube_is_met_where_lattice_rays_must_meet_it() {
    let scene = scene(vec![(cube(), DAffine3::IDENTITY)]);
    let oracle = Oracle::new(&scene).unwrap();
    let hits = |origin: [f32; 3], direction: [f32; 3]| {
        let ray = Ray::new(Vec3::from(origin), direction.into());
        check(&scene, &oracle, &ray);
        records(&oracle.all(&ray))
    };
    // Through two faces' interiors, through their diagonals, and along the space diagonal: six triangles at each corner.
    assert_eq!(hits([1.5, 0.5, -2.0], [0.0, 0.0, 1.0]), [(0, 4, 2.0), (0, 10, 4.0)]);
    assert_eq!(hits([1.0, 1.0, -2.0], [0.0, 0.0, 2.0]).len(), 4);
    let corners = hits([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]);
    assert_eq!(corners.iter().filter(|hit| hit.2 == 1.0).count(), corners.len() / 2);
    assert_eq!(corners.len(), 12);
    // Along an edge: the faces beside it lie in the ray's plane, and those across its ends are met at the ends of their
    // diagonals.
    assert_eq!(hits([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [(0, 0, 1.0), (0, 1, 1.0), (0, 6, 3.0), (0, 7, 3.0)]);
    // From inside, from a face, and just beside.
    assert_eq!(hits([1.0, 0.5, 0.5], [-1.0, 0.0, 0.0])[0].2, 1.0);
    assert_eq!(hits([0.0, 0.5, 0.75], [-1.0, 0.0, 0.0])[0].2, 0.0);
    assert_eq!(hits([2.0f32.next_up(), 0.5, -1.0], [0.0, 0.0, 1.0]), []);
    assert_eq!(hits([2.0, 0.5, -1.0], [0.0, 0.0, 1.0]).len(), 2);
}

#[test]
fn filter_and_culling_change_no_answer() {
    let mut random = Random::new(31, 0);
    let mut hits = 0;
    for round in 0..12 {
        // Even rounds have lattice vertices: repeated points, flat triangles, rays along edges and in planes.
        let exact = round % 2 == 0;
        let draw = |random: &mut Random, size: f64| if exact { lattice(random, size) } else { random.in_cube() * size };
        let positions: Vec<Vec3> = (0..24).map(|_| draw(&mut random, 3.0).as_vec3()).collect();
        let corner = |random: &mut Random| random.below(24) as u32;
        let triangles =
            (0..40).map(|_| [corner(&mut random), corner(&mut random), corner(&mut random)]).collect::<Vec<_>>();
        let map = DAffine3 {
            matrix3: DMat3::from_cols(draw(&mut random, 2.0), draw(&mut random, 2.0), draw(&mut random, 2.0)),
            translation: draw(&mut random, 2.0),
        };
        let placed = if map.matrix3.determinant() == 0.0 { DAffine3::IDENTITY } else { map };
        let scene = scene(vec![
            (mesh(positions.clone(), triangles.clone()), DAffine3::IDENTITY),
            (mesh(positions.clone(), triangles), placed),
        ]);
        let oracle = Oracle::new(&scene).unwrap();
        for number in 0..60 {
            let from = draw(&mut random, 5.0).as_vec3();
            let to = match number % 3 {
                0 => positions[random.below(24) as usize],
                1 => draw(&mut random, 3.0).as_vec3(),
                _ => 0.5 * (positions[random.below(24) as usize] + positions[random.below(24) as usize]),
            };
            let mut ray = Ray::new(from, to - from);
            if number % 4 == 0 {
                (ray.t_min, ray.t_max) = (0.5, 1.0);
            }
            hits += u32::from(check(&scene, &oracle, &ray));
        }
    }
    assert!(hits > 200, "{hits}");
}

#[test]
fn answers_do_not_depend_on_scale_or_on_the_order_of_axes() {
    let mut random = Random::new(32, 0);
    let positions: Vec<Vec3> = (0..30).map(|_| random.in_cube().as_vec3()).collect();
    let triangles: Vec<[u32; 3]> = (0..60).map(|_| [0; 3].map(|_: u32| random.below(30) as u32)).collect();
    let oracle_of = |change: &dyn Fn(Vec3) -> Vec3| {
        let positions = positions.iter().map(|p| change(*p)).collect();
        Oracle::new(&scene(vec![(mesh(positions, triangles.clone()), DAffine3::IDENTITY)])).unwrap()
    };
    let changes: [&dyn Fn(Vec3) -> Vec3; 4] =
        [&|p| p * 2f32.powi(-30), &|p| p * 2f32.powi(20), &|p| Vec3::new(p.z, p.x, p.y), &|p| {
            Vec3::new(-p.y, p.x, p.z)
        }];
    let plain = oracle_of(&|p| p);
    let changed = changes.map(oracle_of);
    for number in 0..300 {
        let from = random.in_cube().as_vec3() * 3.0;
        let to = if number % 2 == 0 { positions[random.below(30) as usize] } else { random.in_cube().as_vec3() };
        let ray = Ray::new(from, to - from);
        let expected = records(&plain.all(&ray));
        for (change, oracle) in changes.iter().zip(&changed) {
            let moved = Ray::new(change(ray.origin), change(ray.direction));
            assert_eq!(records(&oracle.all(&moved)), expected, "{ray:?}");
        }
    }
}

#[test]
fn surfaces_of_different_kinds_are_ordered_by_exact_t() {
    // The unit sphere, and planes that touch it at its far and near side and one that cuts it.
    let square = |z: f32| {
        let positions = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
        mesh(positions.map(|[x, y]: [f32; 2]| Vec3::new(x, y, z)).to_vec(), vec![[0, 1, 2], [0, 2, 3]])
    };
    let mut scene = scene([1.0, -1.0, 0.5].map(|z| (square(z), DAffine3::IDENTITY)).to_vec());
    let transform = DAffine3::IDENTITY;
    scene.quadrics.push(shapes::sphere());
    scene.objects.push(Object { name: String::new(), shape: Shape::Quadric(0), transform, material: None });
    let oracle = Oracle::new(&scene).unwrap();
    let down = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 4.0), Vec3::NEG_Z);
    let order = |ray: &Ray| oracle.all(ray).iter().map(|hit| (hit.instance, hit.primitive)).collect::<Vec<_>>();
    // At the pole all meet at t = 3 and t = 5; beside it the sphere lies behind, by 2^-41 or so.
    assert_eq!(order(&down(0.0, -0.0)), [(0, 0), (0, 1), (3, 0), (2, 0), (2, 1), (1, 0), (1, 1), (3, 1)]);
    let beside = down(2f32.powi(-20), -(2f32.powi(-21)));
    assert_eq!(order(&beside), [(0, 0), (3, 0), (2, 0), (3, 1), (1, 0)]);
    assert_eq!(oracle.closest(&Ray { t_min: 3.0f32.next_up(), ..beside }).unwrap().instance, 2);
    // Where the cutting plane meets the sphere, x^2 + y^2 = 3/4: never exactly at numbers of f32.
    for x in [0.866f32, 0.8660254, 0.866_025_45, 0.867] {
        let outside = Dyadic::new(x.into()) * Dyadic::new(x.into()) > Dyadic::new(0.75);
        let found = order(&down(x, 0.0));
        let place = |what| found.iter().position(|(instance, _)| *instance == what).unwrap();
        assert_eq!(place(2) < place(3), outside, "{x}: {found:?}");
    }
}

#[test]
fn rays_that_are_not_valid_meet_nothing() {
    let oracle = Oracle::new(&scene(vec![(cube(), DAffine3::IDENTITY)])).unwrap();
    let good = Ray::new(Vec3::ONE, Vec3::X);
    assert!(oracle.occluded(&good) && oracle.closest(&good).is_some());
    for bad in [
        Ray { origin: Vec3::NAN, ..good },
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::INFINITY, ..good },
        Ray { t_max: f32::NAN, ..good },
        Ray { t_min: 2.0, t_max: 1.0, ..good },
    ] {
        assert!(!oracle.occluded(&bad) && oracle.closest(&bad).is_none() && oracle.all(&bad).is_empty());
    }
}
