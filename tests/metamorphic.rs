//! Relations between the hits of a scene and those of the same scene seen differently. They need no oracle: axes
//! exchanged, mirrored or scaled by a power of two leave every rounding as it was, so that hits agree bit for bit.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use proptest::prelude::*;
use whitted::accel::{Kind, Params, Preset};
use whitted::geometry::{Hit, Ray, TriangleMesh};
use whitted::progress::Silent;
use whitted::render::Renderer;
use whitted::scene::Scene;

use crate::common::*;

/// Triangles and rays that ask something of them; everything else about a scene stays as it is.
#[derive(Debug, Clone)]
struct Question {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
    rays: Vec<Ray>,
}

impl Question {
    fn renderer(&self, params: &Params) -> Renderer {
        self.placed_renderer(DAffine3::IDENTITY, params)
    }

    /// The triangles placed by a transform; rays stay.
    fn placed_renderer(&self, transform: DAffine3, params: &Params) -> Renderer {
        let mut scene: Scene = empty_scene();
        let mesh = TriangleMesh {
            positions: self.positions.clone().into(),
            indices: self.indices.clone().into(),
            ..Default::default()
        };
        add_mesh(&mut scene, mesh, transform, white());
        Renderer::build(scene, params, &Silent).unwrap()
    }

    /// The same with every point and every vector changed.
    fn map(&self, point: impl Fn(Vec3) -> Vec3, vector: impl Fn(Vec3) -> Vec3) -> Self {
        let ray = |ray: &Ray| Ray { origin: point(ray.origin), direction: vector(ray.direction), ..*ray };
        Self {
            positions: self.positions.iter().map(|&p| point(p)).collect(),
            indices: self.indices.clone(),
            rays: self.rays.iter().map(ray).collect(),
        }
    }
}

/// A coordinate: on a lattice, so that edges, planes and vertices are met exactly, or anywhere.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![(-4i8..=4).prop_map(|n| f32::from(n) * 0.5), -2.0f32..2.0]
}

fn vector() -> impl Strategy<Value = Vec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

/// How a ray is aimed.
#[derive(Debug, Clone)]
enum Aim {
    Along(Vec3),
    AtVertex(prop::sample::Index),
    AtEdge(prop::sample::Index, f32),
}

fn aim() -> impl Strategy<Value = Aim> {
    prop_oneof![
        vector().prop_map(Aim::Along),
        any::<prop::sample::Index>().prop_map(Aim::AtVertex),
        (any::<prop::sample::Index>(), 0.0f32..1.0).prop_map(|(which, at)| Aim::AtEdge(which, at)),
    ]
}

/// Up to 20 triangles over up to 12 shared vertices, and up to 24 rays.
fn question() -> impl Strategy<Value = Question> {
    let positions = prop::collection::vec(vector(), 3..12);
    let corners = prop::collection::vec(any::<[prop::sample::Index; 3]>(), 1..20);
    let aims = prop::collection::vec((vector(), aim()), 1..24);
    (positions, corners, aims).prop_map(|(positions, corners, aims)| {
        let indices: Vec<[u32; 3]> =
            corners.iter().map(|at| at.map(|index| index.index(positions.len()) as u32)).collect();
        let ray = |(origin, aim): &(Vec3, Aim)| {
            let direction = match aim {
                Aim::Along(direction) => *direction,
                Aim::AtVertex(which) => *which.get(&positions) - *origin,
                Aim::AtEdge(which, at) => {
                    let [a, b, _] = which.get(&indices).map(|i| positions[i as usize]);
                    a + (b - a) * *at - *origin
                }
            };
            Ray::new(*origin, direction)
        };
        let rays = aims.iter().map(ray).collect();
        Question { positions, indices, rays }
    })
}

/// Whether one component of the direction is larger than the others in magnitude; ties are broken by axis number.
fn has_main_axis(ray: &Ray) -> bool {
    let mut size = ray.direction.abs().to_array();
    size.sort_by(f32::total_cmp);
    size[2] > size[1]
}

fn every_params() -> impl Iterator<Item = Params> {
    Kind::ALL.iter().flat_map(|&kind| Preset::ALL.iter().map(move |&preset| Params { kind, preset }))
}

/// All hits of a ray in order.
fn all(renderer: &Renderer, ray: &Ray) -> Vec<Hit> {
    renderer.hits(ray).collect()
}

/// Asserts that two questions have the same hits, bit for bit, in every mode of every structure, for wanted rays.
fn assert_same(one: &Question, other: &Question, wanted: impl Fn(&Ray) -> bool) -> Result<(), TestCaseError> {
    for params in every_params() {
        let (first, second) = (one.renderer(&params), other.renderer(&params));
        for (a, b) in one.rays.iter().zip(&other.rays).filter(|(ray, _)| wanted(ray)) {
            let hits = all(&first, a);
            prop_assert_eq!(&hits, &all(&second, b), "{:?} {:?} {:?}", params, a, b);
            prop_assert_eq!(hits.first().copied().unwrap_or(Hit::MISS), second.closest(b), "{:?} {:?}", params, b);
            prop_assert_eq!(!hits.is_empty(), second.occluded(b), "{:?} {:?}", params, b);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn exchanging_axes_changes_nothing(question in question(), which in 0usize..6) {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let exchange = |v: Vec3| Vec3::from_array(ORDERS[which].map(|axis| v[axis]));
        assert_same(&question, &question.map(exchange, exchange), has_main_axis)?;
    }

    #[test]
    fn mirroring_changes_nothing(question in question(), signs in any::<[bool; 3]>()) {
        let mirror = |v: Vec3| v * Vec3::from_array(signs.map(|negative| if negative { -1.0 } else { 1.0 }));
        assert_same(&question, &question.map(mirror, mirror), |_| true)?;
    }

    #[test]
    fn scaling_by_a_power_of_two_changes_nothing(question in question(), power in -24i32..24) {
        let factor = f32::from_bits(((127 + power) as u32) << 23);
        assert_same(&question, &question.map(|p| p * factor, |d| d * factor), |_| true)?;
    }

    #[test]
    fn longer_directions_make_t_smaller_by_as_much(question in question(), power in -60i32..60) {
        let factor = f32::from_bits(((127 + power) as u32) << 23);
        let longer = question.map(|p| p, |d| d * factor);
        for params in every_params() {
            let (first, second) = (question.renderer(&params), longer.renderer(&params));
            for (a, b) in question.rays.iter().zip(&longer.rays) {
                let expected: Vec<Hit> = all(&first, a).into_iter().map(|hit| Hit { t: hit.t / factor, ..hit }).collect();
                prop_assert_eq!(expected, all(&second, b), "{:?} {:?}", params, b);
            }
        }
    }

    #[test]
    fn whole_steps_change_nothing(mut question in question(), step in any::<[i8; 3]>()) {
        // Numbers with few digits: every difference of two of them is exact before and after.
        let short = |v: Vec3| (v * 256.0).round() / 256.0;
        question = question.map(short, short);
        let step = Vec3::from_array(step.map(f32::from));
        assert_same(&question, &question.map(|p| p + step, |d| d), |_| true)?;
    }

    #[test]
    fn the_order_of_triangles_decides_only_ties(question in question(), seed in any::<u64>()) {
        let count = question.indices.len();
        let mut random = whitted::math::random::Random::new(seed, 0);
        let mut order: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            order.swap(i, random.below(i as u64 + 1) as usize);
        }
        let indices = order.iter().map(|&from| question.indices[from]).collect();
        let reordered = Question { indices, ..question.clone() };
        for params in every_params() {
            let (first, second) = (question.renderer(&params), reordered.renderer(&params));
            for ray in &question.rays {
                // The hits as a set: in both orders each is at the same place of the same triangle.
                let key = |hit: &Hit| (hit.t.to_bits(), hit.primitive);
                let mut expected = all(&first, ray);
                let mut found: Vec<Hit> = all(&second, ray)
                    .into_iter()
                    .map(|hit| Hit { primitive: order[hit.primitive as usize] as u32, ..hit })
                    .collect();
                expected.sort_by_key(key);
                found.sort_by_key(key);
                prop_assert_eq!(expected, found, "{:?} {:?}", params, ray);
                let (closest, other) = (first.closest(ray), second.closest(ray));
                prop_assert_eq!(closest.t, other.t, "{:?} {:?}", params, ray);
            }
        }
    }

    #[test]
    fn turning_triangles_over_keeps_what_is_hit(question in question()) {
        let indices = question.indices.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let turned = Question { indices, ..question.clone() };
        for params in every_params() {
            let (first, second) = (question.renderer(&params), turned.renderer(&params));
            for ray in &question.rays {
                let primitives = |renderer: &Renderer| {
                    let mut list: Vec<u32> = all(renderer, ray).iter().map(|hit| hit.primitive).collect();
                    list.sort_unstable();
                    list
                };
                prop_assert_eq!(primitives(&first), primitives(&second), "{:?} {:?}", params, ray);
            }
        }
    }

    #[test]
    fn instances_placed_exactly_are_hit_as_rays_placed_backwards(
        question in question(),
        signs in any::<[bool; 3]>(),
        turn in 0usize..3,
        power in -20i32..20,
        step in any::<[i8; 3]>(),
    ) {
        // Rays get few digits, and so do their images: nothing is rounded on the way into the instance.
        let short = |v: Vec3| (v * 256.0).round() / 256.0;
        let mut question = question;
        for ray in &mut question.rays {
            *ray = Ray { origin: short(ray.origin), direction: short(ray.direction), ..*ray };
        }
        let factor = 2f64.powi(power);
        let signs = signs.map(|negative| if negative { -factor } else { factor });
        let step = step.map(|n| f64::from(n) * factor);
        let mut axes = [DVec3::ZERO; 3];
        for axis in 0..3 {
            axes[axis][(axis + turn) % 3] = signs[axis];
        }
        let place = DAffine3 { matrix3: DMat3::from_cols(axes[0], axes[1], axes[2]), translation: DVec3::from(step) };
        let placed = |v: Vec3, w: f64| (place.matrix3 * v.as_dvec3() + place.translation * w).as_vec3();
        for params in every_params() {
            let (bare, instance) = (question.renderer(&params), question.placed_renderer(place, &params));
            for ray in &question.rays {
                let outside = Ray { origin: placed(ray.origin, 1.0), direction: placed(ray.direction, 0.0), ..*ray };
                prop_assert_eq!(all(&bare, ray), all(&instance, &outside), "{:?} {:?}", params, ray);
                prop_assert_eq!(bare.occluded(ray), instance.occluded(&outside), "{:?} {:?}", params, ray);
            }
        }
    }

    #[test]
    fn a_ray_cut_in_two_finds_the_same(question in question(), cut in 0.0f32..4.0) {
        for params in every_params() {
            let renderer = question.renderer(&params);
            for ray in &question.rays {
                let (near, far) = (Ray { t_max: cut, ..*ray }, Ray { t_min: cut, ..*ray });
                let mut pieces = all(&renderer, &near);
                pieces.extend(all(&renderer, &far).into_iter().filter(|hit| hit.t > cut));
                prop_assert_eq!(all(&renderer, ray), pieces, "{:?} {:?}", params, ray);
            }
        }
    }
}
