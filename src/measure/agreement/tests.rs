//! The judge on the renderer's answers, and on answers that were made wrong.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::*;
use crate::accel::{Kind, Preset};
use crate::geometry::quadric::Clip;
use crate::geometry::{Quadric, shapes};
use crate::measure::scenes;
use crate::progress::Silent;

/// A cube, a sphere of triangles sheared and squashed, a smooth sphere, a tilted capped cylinder and a plane.
fn scene() -> Scene {
    let mut scene = scenes::empty();
    let mesh = |(points, triangles): (Vec<DVec3>, Vec<[u32; 3]>)| scenes::mesh_at(&points, triangles).unwrap();
    let at = DAffine3::from_translation;
    scenes::add_mesh(&mut scene, mesh(scenes::cube_points()), DAffine3::IDENTITY, scenes::white());
    let matrix3 = DMat3::from_cols(DVec3::new(0.9, 0.3, 0.1), DVec3::new(-2.1, 0.7, 0.2), DVec3::new(0.3, 0.1, 0.01));
    let squashed = DAffine3 { matrix3, translation: DVec3::new(4.0, 0.1, 0.3) };
    scenes::add_mesh(&mut scene, mesh(scenes::sphere_points(12, 24)), squashed, scenes::white());
    scenes::add_quadric(&mut scene, shapes::sphere(), at(DVec3::new(-3.0, 0.2, 0.0)), scenes::white());
    let round = [1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
    let cylinder = Quadric::new(round, Some(Clip::between(-1.0, 0.5)), true).unwrap();
    let tilted = DAffine3 { translation: DVec3::new(0.0, 0.5, 4.0), ..squashed };
    scenes::add_quadric(&mut scene, cylinder, tilted, scenes::white());
    let plane = Quadric::new([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0], None, false).unwrap();
    scenes::add_quadric(&mut scene, plane, at(DVec3::new(0.0, -3.1, 0.0)), scenes::white());
    scene
}

#[test]
fn all_structures_agree_with_the_oracle() {
    let structures: Vec<Params> = Kind::ALL.iter().map(|&kind| Params { kind, preset: Preset::Balanced }).collect();
    let found = check(&scene(), &structures, &RayFamily::ALL, 4000, 1, &Silent).unwrap();
    let all = found.iter().fold(Agreement::default(), |all, (_, agreement)| all.and(agreement.clone()));
    assert!(all.passes(), "{all:#?}");
    assert_eq!(found.len(), 8, "no camera");
    assert_eq!((all.rays, all.classes.iter().sum()), (4000, 4000u64));
    // The bounds are not so wide that they say nothing, and the rays are hard enough to need them.
    assert!(all.worst_t > 0.1 && all.hits > 2000 && all.count(Class::Neighbour) > 50, "{all:#?}");
    assert!(all.count(Class::Same) > 3200, "{all:#?}");
}

#[test]
fn wrong_answers_are_told_from_rounded_ones() {
    let scene = scene();
    let judge = Judge::new(&scene).unwrap();
    let renderer = Renderer::build(scene.clone(), &Params::default(), &Silent).unwrap();
    let class = |ray: &Ray, hit: &Hit| judge.judge(ray, hit).class;

    // Inside a face of the cube: a miss, a hit behind, another triangle of the same face.
    let ray = Ray::new(Vec3::new(0.3, 0.2, 9.0), Vec3::NEG_Z);
    let ray = Ray { t_max: 9.5, ..ray };
    let hit = renderer.closest(&ray);
    assert_eq!(hit.instance, 3, "the cylinder");
    let behind = renderer.next_after(&ray, hit.key());
    assert_eq!(class(&ray, &hit), Class::Same);
    assert_eq!(class(&ray, &Hit::MISS), Class::Wrong);
    assert_eq!(class(&ray, &behind), Class::Wrong);
    let ray = Ray { t_min: 7.5, ..ray };
    let hit = renderer.closest(&ray);
    assert_eq!((hit.t, hit.instance), (8.0, 0));
    assert_eq!(class(&ray, &Hit::MISS), Class::Wrong);
    let mut other = (0..12).map(|primitive| Hit { primitive, ..hit }).filter(|other| other.primitive != hit.primitive);
    assert!(other.all(|other| class(&ray, &other) == Class::Wrong));

    // t off by some ulp is outside its bound; one ulp is not.
    let off = |ulps: u32| Hit { t: f32::from_bits(hit.t.to_bits() + ulps), ..hit };
    assert!(judge.judge(&ray, &off(1)).t_error <= 1.0);
    assert!(judge.judge(&ray, &off(40)).t_error > 1.0);

    // Near an end of the interval a hit may be lost; away from it not.
    assert_eq!(class(&Ray { t_max: 8.0, ..ray }, &Hit::MISS), Class::Range);
    assert_eq!(class(&Ray { t_max: 8.001, ..ray }, &Hit::MISS), Class::Wrong);
}

#[test]
fn inside_a_closed_surface_nothing_is_missed() {
    let mut scene = scenes::empty();
    let (points, triangles) = scenes::cube_points();
    let cube = scenes::mesh_at(&points, triangles.clone()).unwrap();
    let open = scenes::mesh_at(&points, triangles[1..].to_vec()).unwrap();
    let removed = triangles[0].map(|vertex| points[vertex as usize]);
    scenes::add_mesh(&mut scene, cube, DAffine3::IDENTITY, scenes::white());
    let closed = Judge::new(&scene).unwrap();
    let mut with_hole = scenes::empty();
    scenes::add_mesh(&mut with_hole, open, DAffine3::IDENTITY, scenes::white());
    let with_hole = Judge::new(&with_hole).unwrap();
    let class = |judge: &Judge<'_>, ray: &Ray| judge.judge(ray, &Hit::MISS).class;

    // Through the middle of the diagonal of a face, from inside, square to it.
    let middle = (0..3).map(|k| 0.5 * (removed[k] + removed[(k + 1) % 3]));
    let face = middle.min_by(|a, b| a.length().total_cmp(&b.length())).unwrap();
    let ray = Ray::new(Vec3::ZERO, face.as_vec3());
    assert_eq!(class(&closed, &ray), Class::Wrong, "a leak");
    assert_eq!(class(&with_hole, &ray), Class::MissNearEdge, "a border");
    // At an edge of the cube from outside, one face seen from behind; and at the same edge from inside.
    let outside = Ray::new(Vec3::new(1.0, 3.0, 0.25), Vec3::new(0.0, -1.0, 0.0));
    assert_eq!(class(&closed, &outside), Class::MissNearEdge, "a silhouette");
    let inside = Ray::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.25));
    assert_eq!(class(&closed, &inside), Class::Wrong, "a leak");
    let corner = Ray::new(Vec3::ZERO, Vec3::ONE);
    assert_eq!(class(&closed, &corner), Class::Wrong, "a leak");
    assert_eq!(class(&closed, &Ray::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.999))), Class::Wrong, "a leak");
}

#[test]
fn what_lies_behind_a_lost_silhouette_must_be_found() {
    let mut scene = scenes::empty();
    let (points, triangles) = scenes::cube_points();
    scenes::add_mesh(&mut scene, scenes::mesh_at(&points, triangles).unwrap(), DAffine3::IDENTITY, scenes::white());
    let wall = [DVec3::new(-9.0, -5.0, -9.0), DVec3::new(9.0, -5.0, -9.0), DVec3::new(0.0, -5.0, 9.0)];
    let wall = scenes::mesh_at(&wall, vec![[0, 1, 2]]).unwrap();
    scenes::add_mesh(&mut scene, wall, DAffine3::IDENTITY, scenes::white());
    let judge = Judge::new(&scene).unwrap();
    let ray = Ray::new(Vec3::new(1.0, 3.0, 0.25), Vec3::NEG_Y);
    let wall = Hit { t: 8.0, u: 0.0, v: 0.0, instance: 1, primitive: 0 };
    assert_eq!(judge.judge(&ray, &wall).class, Class::MissNearEdge);
    assert_eq!(judge.judge(&ray, &Hit::MISS).class, Class::Wrong, "the wall is lost as well");

    // Beside the cube by an ulp a hit is explained where the cube's top is, and nowhere else.
    let beside = Ray { origin: Vec3::new(1.0f32.next_up(), 3.0, 0.25), ..ray };
    let top = judge.judge(&ray, &wall).exact;
    assert_eq!((top.t, top.instance), (2.0, 0));
    let verdict = judge.judge(&beside, &top);
    assert!(verdict.class == Class::HitNearEdge && verdict.t_error <= 1.0, "{verdict:?}");
    for t in [1.5, 1.9999, 2.0001, 5.0] {
        assert!(judge.judge(&beside, &Hit { t, ..top }).t_error > 1.0, "{t}");
    }
    let farther = Ray { origin: Vec3::new(1.0 + 1e-5, 3.0, 0.25), ..ray };
    assert_eq!(judge.judge(&farther, &top).class, Class::Wrong);
}

#[test]
fn tangents_may_be_lost_and_nothing_beside_them() {
    let mut scene = scenes::empty();
    scenes::add_quadric(&mut scene, shapes::sphere(), DAffine3::IDENTITY, scenes::white());
    let judge = Judge::new(&scene).unwrap();
    let miss_at = |x: f32| judge.judge(&Ray::new(Vec3::new(x, 0.0, 3.0), Vec3::NEG_Z), &Hit::MISS).class;
    assert_eq!(miss_at(1.0), Class::MissNearEdge);
    assert_eq!(miss_at(1.0f32.next_up()), Class::Same);
    assert_eq!(miss_at(1.0f32.next_down()), Class::Wrong, "f64 tells this from a tangent");
    let extra = Hit { t: 3.0, u: 0.0, v: 0.0, instance: 0, primitive: 0 };
    let hit_at = |x: f32| judge.judge(&Ray::new(Vec3::new(x, 0.0, 3.0), Vec3::NEG_Z), &extra).class;
    assert_eq!(hit_at(1.0f32.next_up()), Class::Wrong);
}

#[test]
fn outcomes_add_up() {
    let verdict = Verdict { class: Class::Wrong, t_error: 0.5, exact: Hit::MISS };
    let mut one = Agreement::default();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    one.add(&ray, &Hit::MISS, &verdict);
    let mut other = Agreement::default();
    other.add(&ray, &Hit::MISS, &Verdict { class: Class::Same, t_error: 1.5, ..verdict });
    assert!(!one.passes() && !other.passes());
    let both = one.and(other);
    assert_eq!((both.rays, both.count(Class::Wrong), both.t_outside, both.worst_t), (2, 1, 1, 1.5));
    assert_eq!(both.examples.len(), 2, "a t outside its bound is an example of what is wrong");
    let mut nan = Agreement::default();
    nan.add(&ray, &Hit::MISS, &Verdict { class: Class::Same, t_error: f64::NAN, ..verdict });
    assert!(!nan.passes() && both.and(nan).worst_t.is_nan());
}
