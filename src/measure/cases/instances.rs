//! Placed shapes: D21, D22, D23.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::{Case, Context, Failure, Outcome, Rays, Structure, meshes, scene_seed};
use crate::error::{Error, Fault, Result};
use crate::formats::LoadOptions;
use crate::geometry::quadric::Clip;
use crate::geometry::{Quadric, Ray, TriangleMesh, shapes};
use crate::math::eigen::eigen;
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::random::Random;
use crate::math::transform::{apply, compose, point, rotation_about, rotation_xyz};
use crate::math::vector::{basis, cross, dot, length, normalize};
use crate::measure::dyadic::Dyadic;
use crate::measure::scenes;
use crate::render::Renderer;
use crate::render::surface::SurfacePoint;
use crate::scene::{Scene, Shape};

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D21",
        title: "instances: stretched, sheared, mirrored, turned, against their world-space surface",
        bar: "t within 32 u kappa(M) t, normals within 1e-6 rad, sides right",
        run: placed_shapes,
    },
    Case {
        id: "D22",
        title: "singular, infinite and NaN transforms, quadrics without coefficients",
        bar: "an error of the caller each",
        run: refused_inputs,
    },
    Case {
        id: "D23",
        title: "world boxes of turned and moved shapes against their exact corners",
        bar: "every corner inside, at most 5 u of the summed magnitudes to spare",
        run: world_boxes,
    },
];

/// Transforms whose effects differ, by name.
fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = rotation_about(normalize(DVec3::new(1.0, 2.0, -0.5)).unwrap_or(DVec3::X), 0.9);
    let shift = DVec3::new(3.0, -2.0, 5.0);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(10.0, 1.0, 0.0), DVec3::Z);
    let plain = |matrix3, translation| DAffine3 { matrix3, translation };
    let scale = |x, y, z| plain(DMat3::from_diagonal(DVec3::new(x, y, z)), DVec3::ZERO);
    let turned = |inner: DAffine3| compose(&plain(turn, shift), &inner);
    vec![
        ("turned", plain(turn, shift)),
        ("mirrored", turned(scale(-1.0, 1.0, 1.0))),
        ("turned inside out", turned(scale(-1.0, -1.0, -1.0))),
        ("stretched", plain(scale(1.0, 1e-3, 1e3).matrix3, shift)),
        ("stretched and turned", turned(scale(1.0, 1e-3, 1e3))),
        ("stretched and mirrored", turned(scale(1e3, -1e-3, 1.0))),
        ("sheared", plain(shear, shift)),
        ("sheared both ways", turned(compose(&plain(shear, DVec3::ZERO), &plain(shear.transpose(), DVec3::ZERO)))),
        ("all", compose(&scale(1.0, -2.0, 0.1), &compose(&plain(shear, shift), &plain(turn, DVec3::ZERO)))),
        ("tiny", plain(turned(scale(1e-6, 1e-6, -1e-6)).matrix3, DVec3::ZERO)),
        ("tiny and near", plain(turned(scale(1e-6, 2e-6, 1e-6)).matrix3, shift * 1e-5)),
        ("huge", plain(turned(scale(1e6, 1e6, 3e6)).matrix3, shift * 1e6)),
        ("far", plain(turned(scale(2.0, 1.0, -1.0)).matrix3, DVec3::new(1e4, -2e4, 5e3))),
    ]
}

/// A shape with its map to the world and what follows from that, all found from the map itself: no inverse is taken
/// but by cofactors, no normal transformed but by two tangents.
struct Placed {
    to_world: DAffine3,
    /// The product of the largest stretch and the largest shrinking.
    condition: f64,
    /// Cofactors, column by column: the inverse transpose times the determinant.
    cofactors: [DVec3; 3],
    determinant: f64,
}

impl Placed {
    fn new(to_world: DAffine3) -> Self {
        let m = to_world.matrix3;
        let cofactors = [cross(m.y_axis, m.z_axis), cross(m.z_axis, m.x_axis), cross(m.x_axis, m.y_axis)];
        let determinant = dot(m.x_axis, cofactors[0]);
        let stretch = largest_stretch([m.x_axis, m.y_axis, m.z_axis]);
        let condition = stretch * largest_stretch(cofactors) / determinant.abs();
        Self { to_world, condition, cofactors, determinant }
    }

    fn vector_to_object(&self, v: DVec3) -> DVec3 {
        DVec3::from_array(self.cofactors.map(|column| dot(column, v))) / self.determinant
    }

    fn point_to_object(&self, p: DVec3) -> DVec3 {
        self.vector_to_object(p - self.to_world.translation)
    }

    /// The outward unit normal in the world where the object's own is perpendicular to two right-handed tangents.
    fn normal(&self, first: DVec3, second: DVec3) -> DVec3 {
        let m = &self.to_world.matrix3;
        let across = cross(apply(m, first), apply(m, second)) * self.determinant.signum();
        normalize(across).unwrap_or(DVec3::ZERO)
    }
}

/// The largest singular value of a matrix of these columns.
fn largest_stretch(columns: [DVec3; 3]) -> f64 {
    let [x, y, z] = columns;
    let (squares, _) = eigen(DVec3::new(dot(x, x), dot(y, y), dot(z, z)), DVec3::new(dot(x, y), dot(y, z), dot(x, z)));
    squares.max_element().sqrt()
}

/// Rays at a placed ball of triangles and at a placed quadric sphere, from outside and from within.
fn placed_shapes(context: &Context<'_>) -> Result<Outcome> {
    let mut ball = meshes::sphere(12, 24, 1.0, DVec3::ZERO);
    ball.normals = Some(ball.positions.clone());
    let rays = Rays { quick: 400, full: 200_000, linear: 10 };
    let mut sum = Outcome::default();
    for (number, (name, to_world)) in (0..).zip(transforms()) {
        let placed = Placed::new(to_world);
        for as_mesh in [true, false] {
            let seed = scene_seed(0xd21, 2 * number + u64::from(as_mesh));
            let mut scene = scenes::empty();
            if as_mesh {
                scenes::add_mesh(&mut scene, ball.clone(), to_world, scenes::white());
            } else {
                scenes::add_quadric(&mut scene, shapes::sphere(), to_world, scenes::white());
            }
            sum = sum.and(context.ask_all(&scene, seed, rays, |structure, random, number, outcome| {
                let Some((ray, outside)) = aimed(&placed, random, number) else { return };
                let mesh = as_mesh.then_some(&ball);
                check_placed(structure, &placed, mesh, &ray, outside, outcome, name);
            })?);
        }
    }
    Ok(sum)
}

/// A ray whose line comes within 0.9 of the placed unit sphere's centre, and whether it starts outside; of a random
/// length of direction. `None` where rounding its numbers to f32 moved it away.
fn aimed(placed: &Placed, random: &mut Random, number: u64) -> Option<(Ray, bool)> {
    let outside = !number.is_multiple_of(4);
    let target = random.direction() * random.between(0.0, 0.9);
    // Directions drawn in the object follow the long axis in the world, those drawn in the world the short one here.
    let mut along = random.direction();
    if number.is_multiple_of(2) {
        along = normalize(placed.vector_to_object(along))?;
    }
    // A ray that starts much nearer to the surface than the shape is large would be asked for more digits than its
    // origin has.
    let start = if outside { target - along * random.between(2.5, 30.0) } else { target * 0.3 };
    let origin = point(&placed.to_world, start).as_vec3();
    let goal = if outside { target } else { start + along };
    let toward = point(&placed.to_world, goal) - origin.as_dvec3();
    let size = libm::exp2(random.between(-20.0, 20.0));
    let direction = (toward * (size / length(toward))).as_vec3();
    let (o, d) = (placed.point_to_object(origin.as_dvec3()), placed.vector_to_object(direction.as_dvec3()));
    let nearest = o - d * (dot(o, d) / dot(d, d));
    let as_meant = if outside { dot(o, o) > 4.0 && dot(o, d) < 0.0 } else { dot(o, o) < 0.2 };
    (dot(nearest, nearest) < 0.81 && as_meant).then(|| (Ray::new(origin, direction), outside))
}

fn check_placed(
    structure: &Structure,
    placed: &Placed,
    mesh: Option<&TriangleMesh>,
    ray: &Ray,
    outside: bool,
    outcome: &mut Outcome,
    name: &str,
) {
    let answer = structure.ask(ray);
    if !answer.is_hit() {
        outcome.check(false, || Failure::of_ray(ray, format!("{structure}, {name}: {answer}")));
        return;
    }
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let view = scenes::view(o, d);
    let found = SurfacePoint::of(structure.renderer.scene(), structure.renderer.world(), &view, &answer.hit);
    let local = placed.point_to_object(found.position);
    let (first, second) = basis(normalize(local).unwrap_or(DVec3::X));
    let smooth = placed.normal(first, second);
    let (expected, face) = match mesh {
        Some(mesh) => {
            let [a, b, c] = mesh.triangle(answer.hit.primitive).map(Vec3::as_dvec3);
            let normal = placed.normal(b - a, c - a);
            (dot(point(&placed.to_world, a) - o, normal) / dot(d, normal), normal)
        }
        None => {
            let (o, d) = (placed.point_to_object(o), placed.vector_to_object(d));
            let (a, b, c) = (dot(d, d), dot(o, d), dot(o, o) - 1.0);
            let root = (b * b - a * c).sqrt();
            (if outside { c / (-b + root) } else { (-b + root) / a }, smooth)
        }
    };
    let side = if outside { 1.0 } else { -1.0 };
    let error = (f64::from(answer.hit.t) - expected).abs() / (UNIT_ROUNDOFF * placed.condition * expected);
    let angle = length(cross(found.geometric_normal, face)).max(length(cross(found.normal, smooth)));
    // The shading normal is on the geometric one's side, which under a shear the smooth one need not be.
    let faces = dot(found.geometric_normal, face) * side > 0.0 && dot(found.normal, found.geometric_normal) >= 0.0;
    let kind = if mesh.is_some() { "mesh" } else { "quadric" };
    outcome.figure(format!("{kind}: error of t over u kappa t"), error, Some(32.0));
    outcome.figure(format!("{kind}: angle between normals, rad"), angle, Some(1e-6));
    outcome.check(error <= 32.0 && angle <= 1e-6 && faces && found.from_outside == outside, || {
        Failure::of_ray(
            ray,
            format!(
                "{structure}, {name} {kind}: {answer}, where t is {expected}; normals {angle:e} rad off, \
                 side {faces}, from outside {}",
                found.from_outside
            ),
        )
    });
}

/// Transforms that cannot be inverted and quadrics without coefficients, given to the library and in scene files.
fn refused_inputs(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let plain = |matrix3, translation| DAffine3 { matrix3, translation };
    let columns =
        |x: [f64; 3], y: [f64; 3], z: [f64; 3]| plain(DMat3::from_cols(x.into(), y.into(), z.into()), DVec3::ZERO);
    let scale = |x, y, z| plain(DMat3::from_diagonal(DVec3::new(x, y, z)), DVec3::ONE);
    let mut bad = vec![
        scale(1.0, 1.0, 0.0),
        scale(1.0, -0.0, 1.0),
        scale(0.0, 0.0, 0.0),
        scale(f64::NAN, 1.0, 1.0),
        scale(1.0, f64::INFINITY, 1.0),
        scale(1.0, 1.0, f64::NEG_INFINITY),
        plain(DMat3::IDENTITY, DVec3::new(0.0, f64::NAN, 0.0)),
        plain(DMat3::IDENTITY, DVec3::new(0.0, 0.0, f64::INFINITY)),
        // Columns in one plane, with and without rounding in the determinant.
        columns([1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]),
        columns([1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]),
    ];
    // x, y and x + y or x - y of numbers of 40 bits: exactly singular, whatever the rounded determinant says.
    let mut random = Random::new(0xd22, 0);
    for number in 0..200 {
        let mut short =
            || DVec3::from_array((random.in_cube() * 1e12).to_array().map(|x| libm::ldexp(libm::rint(x), -40)));
        let (x, y) = (short(), short());
        let z = if number % 2 == 0 { x + y } else { x - y };
        bad.push(plain(DMat3::from_cols(x, y, z), DVec3::ZERO));
    }
    for params in context.params() {
        for transform in &bad {
            for as_mesh in [true, false] {
                let mut scene = scenes::empty();
                if as_mesh {
                    scenes::add_mesh(&mut scene, meshes::square(), *transform, scenes::white());
                } else {
                    scenes::add_quadric(&mut scene, shapes::sphere(), *transform, scenes::white());
                }
                let refused = Renderer::build(scene, &params, context.progress).err();
                sum.check(refused.as_ref().is_some_and(|error| error.fault() == Fault::Caller), || {
                    Failure::text(format!("{params:?}: {transform:?} gave {refused:?}"))
                });
            }
        }
    }
    let mut quadrics: Vec<[f64; 10]> = vec![[0.0; 10], [-0.0; 10]];
    for place in 0..10 {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut coefficients = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
            coefficients[place] = value;
            quadrics.push(coefficients);
        }
    }
    let nowhere =
        [Clip { min: DVec3::ONE, max: DVec3::ZERO }, Clip { min: DVec3::new(0.0, f64::NAN, 0.0), max: DVec3::ONE }];
    let clipped = nowhere.map(|clip| Quadric::new([1.0; 10], Some(clip), true));
    for quadric in quadrics.iter().map(|&k| Quadric::new(k, None, false)).chain(clipped) {
        let fault = quadric.err().map(|error| error.fault());
        sum.check(fault == Some(Fault::Caller), || Failure::text(format!("a bad quadric gave {fault:?}")));
    }
    refused_files(context, &mut sum)?;
    Ok(sum)
}

/// The same mistakes in scene files: an error of the file with line and column.
fn refused_files(context: &Context<'_>, sum: &mut Outcome) -> Result<()> {
    let object = |shape: &str, transform: &str| format!("[[object]]\n{shape}\ntransform = {transform}\n");
    let quadric = |form: &str| format!("[[object]]\nquadric = {{ {form} }}\n");
    let texts = [
        object("sphere = {}", "{ scale = [1, 1, 0] }"),
        object("sphere = {}", "{ scale = 0 }"),
        object("cone = { base = [0, 0, 0], apex = [0, 1, 0] }", "{ scale = [1, nan, 1] }"),
        object("sphere = {}", "{ translate = [inf, 0, 0] }"),
        object("sphere = {}", "{ matrix = [1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0, 0, 0, 0, 1] }"),
        object("sphere = {}", "{ matrix = [0.1, 0.7, 0.3, 0, 0.2, 1.4, 0.6, 0, 0, 0, 1, 0, 0, 0, 0, 1] }"),
        object("sphere = {}", "{ matrix = [nan, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }"),
        object("sphere = {}", "[{ scale = 1e-200 }, { scale = 1e-200 }]"),
        "[[object]]\nsphere = { radius = 0 }\n".into(),
        quadric("coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"),
        quadric("coefficients = [1, nan, 0, 0, 0, 0, 0, 0, 0, 0]"),
        quadric("coefficients = [1, 0, 0, 0, 0, 0, 0, 0, 0, -inf]"),
        quadric("matrix = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"),
        // Only the symmetric part counts, and there is none.
        quadric("matrix = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"),
        quadric("coefficients = [1, 1, 1, 0, 0, 0, 0, 0, 0, -1], clip = { min = [1, 1, 1], max = [0, 0, 0] }"),
    ];
    let folder = tempfile::tempdir().map_err(|cause| Error::system(&std::env::temp_dir(), cause))?;
    let path = folder.path().join("bad.toml");
    for text in texts {
        std::fs::write(&path, &text).map_err(|cause| Error::system(&path, cause))?;
        let refused = crate::formats::open(&path, &LoadOptions::default(), context.progress).err();
        let told = refused.as_ref().is_some_and(|error| {
            error.fault() == Fault::File && error.line().is_some_and(|line| line >= 2) && error.column().is_some()
        });
        sum.check(told, || Failure::text(format!("the scene file `{}` gave {refused:?}", text.replace('\n', " / "))));
    }
    Ok(())
}

/// World boxes of meshes and quadrics under random transforms, against their corners in exact arithmetic.
fn world_boxes(context: &Context<'_>) -> Result<Outcome> {
    let total = context.count(600, 200_000);
    let mut sum = context.for_all(0xd23, total, |random, number, outcome| {
        let to_world = any_transform(random, number);
        let mut scene = scenes::empty();
        let corners: Vec<Vec3> = match number % 3 {
            0 => meshes::square().positions.into_vec(),
            1 => (0..4).map(|_| random.in_cube().as_vec3()).collect(),
            _ => shapes::sphere().bounds().map_or(vec![], |bounds| bounds.corners().to_vec()),
        };
        if number % 3 == 2 {
            scenes::add_quadric(&mut scene, shapes::sphere(), to_world, scenes::white());
        } else {
            let mesh = meshes::mesh(corners.clone().into(), vec![[0, 1, 2], [0, 2, 3]].into());
            if mesh.live_count() < 2 {
                return;
            }
            scenes::add_mesh(&mut scene, mesh, to_world, scenes::white());
        }
        check_box(&scene, &corners, outcome);
    })?;
    // The box that the case is known by, and where it must lie.
    let mut scene = scenes::empty();
    let turned =
        DAffine3 { matrix3: rotation_about(DVec3::Z, std::f64::consts::FRAC_PI_4), translation: DVec3::splat(1e4) };
    scenes::add_mesh(&mut scene, meshes::square(), turned, scenes::white());
    check_box(&scene, &meshes::square().positions, &mut sum);
    Ok(sum)
}

/// Scales from 2^-30 to 2^30 per axis, any turn, any mirroring, shears, and places up to 1e7.
fn any_transform(random: &mut Random, number: u64) -> DAffine3 {
    let mut part =
        |range: f64| libm::exp2(random.between(-range, range)) * if random.unit() < 0.5 { -1.0 } else { 1.0 };
    let range = [0.0, 1.0, 30.0][(number / 3 % 3) as usize];
    let scale = DMat3::from_diagonal(DVec3::new(part(range), part(range), part(range)));
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(random.between(-10.0, 10.0), 1.0, 0.0), DVec3::Z);
    let turns = [DMat3::IDENTITY, rotation_xyz(random.in_cube() * 4.0), shear];
    let place = random.direction() * [0.0, 1.0, 1e4, 1e7][(number % 4) as usize];
    let turn = DAffine3 { matrix3: turns[(number / 9 % 3) as usize], translation: place };
    compose(&turn, &DAffine3::from_mat3(scale))
}

/// Compares the box of the scene's one object with its corners, which are exact in the object's space.
fn check_box(scene: &Scene, corners: &[Vec3], outcome: &mut Outcome) {
    let Ok(world) = crate::render::world::World::new(scene) else {
        outcome.check(false, || Failure::text(format!("{:?} was refused", scene.objects[0].transform)));
        return;
    };
    let Some(bounds) = world.instances[0].bounds else { return };
    let m = scene.objects[0].transform;
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    // How far the box may reach beyond the one in which rays look for the shape: that one's corners are transformed.
    let own = match scene.objects[0].shape {
        Shape::Mesh(_) => scene.meshes[0].hit_bounds(),
        Shape::Quadric(_) => scene.quadrics[0].bounds().unwrap_or(bounds),
    };
    for axis in 0..3 {
        // x, y, z and the translation's shares in this coordinate of the world.
        let row = columns.map(|column| column[axis]);
        let exact = |corner: Vec3| {
            let parts = [corner.x, corner.y, corner.z, 1.0].map(f64::from);
            row.iter().zip(parts).fold(Dyadic::ZERO, |sum, (&share, part)| sum + Dyadic::new(share) * Dyadic::new(part))
        };
        let (min, max) = (Dyadic::new(bounds.min[axis].into()), Dyadic::new(bounds.max[axis].into()));
        let inside = corners.iter().map(|&corner| exact(corner)).all(|x| min <= x && x <= max);
        outcome.check(inside, || {
            Failure::text(format!("axis {axis} of the box {bounds:?} does not hold {corners:?} placed by {m:?}"))
        });
        let magnitude = |corner: Vec3| {
            let reach = corner.as_dvec3().abs();
            (0..3).fold(row[3].abs(), |sum, k| sum + row[k].abs() * reach[k])
        };
        let most = own.corners().into_iter().map(magnitude).fold(0.0, f64::max);
        let placed = own.corners().map(exact);
        let (Some(least), Some(greatest)) = (placed.iter().min(), placed.iter().max()) else { continue };
        let spare = (least - &min).to_f64().max((&max - greatest).to_f64());
        if most > 0.0 && m != DAffine3::IDENTITY {
            outcome.figure("room to spare, in u of the summed magnitudes", spare / (UNIT_ROUNDOFF * most), Some(5.0));
        }
    }
}
