//! What images and vertices say at each point, against closed forms: alpha, normals, colours, smaller versions, absorption.

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3, Vec4};
use whitted::array::Array;
use whitted::geometry::TriangleMesh;
use whitted::measure::reference::ReferenceRenderer;
use whitted::progress::Silent;
use whitted::render::RenderSettings;
use whitted::scene::detail::{Alpha, AlphaMode, Channel, Detail, MetallicRoughness, NormalMap, Rule};
use whitted::scene::texture::{Filter, Texels, Wrap};
use whitted::scene::{Background, Camera, Material, NamedCamera, Projection, Rgb, Scene, Texture, TextureRef};

use crate::common::*;

/// A square of side 2 around (0, 0, z) that faces +Z, u along x and v along y.
fn square(z: f32) -> TriangleMesh {
    let uvs = Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    TriangleMesh { uvs: uvs.map(Array::from), ..rectangle(Vec3::new(-1.0, -1.0, z), Vec3::X * 2.0, Vec3::Y * 2.0) }
}

/// Adds an image of numbers, one row, nearest.
fn add_row(scene: &mut Scene, texels: &[[u8; 4]]) -> TextureRef {
    let texture = Texture::new("row", texels.len() as u32, 1, Texels::Data8(texels.to_vec().into()));
    scene.textures.push(Texture { filter: Filter::Nearest, wrap: [Wrap::Clamp; 2], ..texture });
    TextureRef::new(scene.textures.len() as u32 - 1)
}

fn with(detail: Detail, material: Material) -> Material {
    Material { detail: Some(Box::new(detail)), ..material }
}

fn masked(map: TextureRef, cutoff: f32) -> Material {
    let alpha = Alpha { mode: AlphaMode::Mask { cutoff }, factor: 1.0, map: Some((map, Channel::Alpha)) };
    with(Detail { alpha: Some(alpha), ..Detail::NONE }, white())
}

/// What is seen at (x, 0) along -Z.
fn seen_at(scene: &mut Scene, x: f64) -> Rgb {
    look(scene, DVec3::new(x, 0.1, 9.0), DVec3::new(x, 0.1, 0.0));
    pixel(scene)
}

/// A scene with all that images and vertices can say, for comparisons of ways to render it.
pub fn everything() -> Scene {
    let mut scene = empty_scene();
    scene.ambient = Rgb::splat(0.1);
    scene.background = Background::Color(Rgb::new(0.2, 0.3, 0.4));
    let row = |i: u32, k: u32| (0..4).map(|c| (i * (37 + 11 * k) + c * 59 + k * 83) as u8).collect::<Vec<_>>();
    let image = |k: u32| (0..8).map(|i| row(i, k).try_into().unwrap()).collect::<Vec<[u8; 4]>>();
    let maps = [0, 1, 2, 3].map(|k| add_row(&mut scene, &image(k)));
    let texture = Texture::new("colours", 4, 2, Texels::Srgb8(image(4).into())).with_levels();
    scene.textures.push(texture);
    let diffuse_texture = Some(TextureRef::scaled(4, DVec2::splat(3.0), DVec2::ZERO));
    let normal = Some(NormalMap { texture: maps[0], scale: 0.3 });
    let model = MetallicRoughness { metallic_roughness: Some(maps[1]), ..MetallicRoughness::DEFAULT };
    let alpha = |mode| Some(Alpha { mode, factor: 0.9, map: Some((maps[2], Channel::Red)) });
    let textured = Material { diffuse_texture, ks: Rgb::splat(0.3), ..white() };
    let details = [
        Detail { rule: Rule::MetallicRoughness(model), normal, ..Detail::NONE },
        Detail { alpha: alpha(AlphaMode::Mask { cutoff: 0.4 }), emission: Some(maps[3]), ..Detail::NONE },
        Detail { alpha: alpha(AlphaMode::Blend), normal, ..Detail::NONE },
        Detail { rule: Rule::Unlit { color: Rgb::splat(0.8) }, ..Detail::NONE },
    ];
    for (number, detail) in details.into_iter().enumerate() {
        let colors = Some(vec![[65535, 30000, 9000, 65535], [9000, 65535, 65535, 40000], [65535; 4], [20000; 4]]);
        let mesh = TriangleMesh {
            colors: colors.filter(|_| number != 1).map(Array::from),
            normals: Some(vec![Vec3::Z; 4].into()),
            ..square(0.0)
        };
        let turn = DAffine3::from_rotation_y(0.4 * number as f64);
        let place = DAffine3::from_translation(DVec3::new(
            0.4 * number as f64 - 0.6,
            0.2 * number as f64,
            -0.5 * number as f64,
        ));
        add_mesh(&mut scene, mesh, place * turn, with(detail, textured.clone()));
    }
    let glass = Material { kt: Rgb::splat(0.8), kr: Rgb::splat(0.1), absorption: Rgb::new(0.1, 0.4, 0.8), ..black() };
    let place = DAffine3::from_translation(DVec3::new(0.3, -0.5, 1.5)) * DAffine3::from_scale(DVec3::splat(0.4));
    add_mesh(&mut scene, cube(), place, glass);
    let shiny = Material { kr: Rgb::splat(0.4), single_sided: true, ..white() };
    add_mesh(&mut scene, square(-4.0), DAffine3::from_scale(DVec3::new(3.0, 3.0, 1.0)), shiny);
    add_light(&mut scene, DVec3::new(3.0, 4.0, 6.0), Rgb::splat(0.7));
    add_light(&mut scene, DVec3::new(-5.0, 1.0, 3.0), Rgb::new(0.3, 0.2, 0.2));
    let projection = Projection::Perspective { fov_y: 0.7 };
    let (eye, target, up) = (DVec3::new(0.5, 0.6, 6.0), DVec3::ZERO, DVec3::Y);
    scene.cameras = vec![NamedCamera::new("all", Camera::LookAt { eye, target, up, projection })];
    scene
}

/// Small squares side by side, a row of them after the other, of one material; every other one has red vertices.
pub fn coloured_and_plain_squares(count: u32) -> Scene {
    let mut scene = empty_scene();
    let side = f64::from(count).sqrt().ceil() as u32;
    for number in 0..count {
        let colors = number.is_multiple_of(2).then(|| vec![[65535, 0, 0, 65535]; 4]);
        let (x, y) = (f64::from(number % side), f64::from(number / side));
        let place =
            DAffine3::from_translation(DVec3::new(x, y, 0.0) * (2.0 / f64::from(side)) - DVec3::new(0.9, 0.9, 0.0));
        let size = DAffine3::from_scale(DVec3::splat(0.9 / f64::from(side)));
        add_mesh(&mut scene, TriangleMesh { colors: colors.map(Array::from), ..square(0.0) }, place * size, white());
    }
    scene.objects.iter_mut().for_each(|object| object.material = Some(1));
    add_light(&mut scene, DVec3::new(1.0, 2.0, 9.0), Rgb::ONE);
    let projection = Projection::Perspective { fov_y: 0.5 };
    let (eye, target, up) = (DVec3::new(0.0, 0.0, 4.5), DVec3::ZERO, DVec3::Y);
    scene.cameras = vec![NamedCamera::new("all", Camera::LookAt { eye, target, up, projection })];
    scene
}

#[test]
fn masked_surfaces_are_there_or_not_for_eyes_and_lights() {
    let mut scene = empty_scene();
    let map = add_row(&mut scene, &[[255, 255, 255, 100], [255, 255, 255, 200]]);
    add_mesh(&mut scene, square(1.0), DAffine3::IDENTITY, masked(map, 0.5));
    let red = Material { diffuse: Rgb::X, ..black() };
    add_mesh(&mut scene, square(0.0), DAffine3::IDENTITY, red);
    // Straight in front, so that the shadow falls where the mask is.
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
    near(seen_at(&mut scene, -0.5), Rgb::X, 1e-5);
    near(seen_at(&mut scene, 0.5), Rgb::ONE, 1e-5);
    // From the side below the mask, where nothing but its shadow reaches.
    look(&mut scene, DVec3::new(0.5, -4.0, 0.5), DVec3::new(0.5, 0.1, 0.0));
    assert_eq!(pixel(&scene), Rgb::ZERO, "in the shadow of what is there");
    look(&mut scene, DVec3::new(-0.5, -4.0, 0.5), DVec3::new(-0.5, 0.1, 0.0));
    near(pixel(&scene), Rgb::X, 1e-5);
}

#[test]
fn many_holes_in_a_row_take_no_depth() {
    let mut scene = empty_scene();
    let map = add_row(&mut scene, &[[0; 4]]);
    for layer in 0..40 {
        add_mesh(&mut scene, square(0.1 * layer as f32), DAffine3::IDENTITY, masked(map, 0.5));
    }
    add_mesh(&mut scene, square(-1.0), DAffine3::IDENTITY, Material { emission: Rgb::Y, ..black() });
    scene.film.max_depth = 0;
    assert_eq!(seen_at(&mut scene, 0.0), Rgb::Y);
}

#[test]
fn blended_surfaces_show_what_lies_behind_by_their_alpha() {
    let mut scene = empty_scene();
    let map = add_row(&mut scene, &[[255, 255, 255, 51], [255, 255, 255, 0]]);
    let alpha = Alpha { mode: AlphaMode::Blend, factor: 0.5, map: Some((map, Channel::Alpha)) };
    let blue = Material { diffuse: Rgb::Z, ..black() };
    add_mesh(&mut scene, square(1.0), DAffine3::IDENTITY, with(Detail { alpha: Some(alpha), ..Detail::NONE }, blue));
    add_mesh(&mut scene, square(0.0), DAffine3::IDENTITY, Material { diffuse: Rgb::X, ..black() });
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
    // A tenth is there: it is lit, takes a tenth of the light behind it, and hides a tenth of that.
    near(seen_at(&mut scene, -0.5), Rgb::new(0.9 * 0.9, 0.0, 0.1), 1e-5);
    near(seen_at(&mut scene, 0.5), Rgb::X, 1e-5);
    // The scene's ambient light is that of what is there, too.
    scene.ambient = Rgb::splat(0.5);
    scene.lights.clear();
    scene.materials.iter_mut().for_each(|material| material.ambient = None);
    near(seen_at(&mut scene, -0.5), Rgb::new(0.45, 0.0, 0.05), 1e-5);
}

#[test]
fn backs_of_single_sided_surfaces_are_not_there() {
    let mut scene = empty_scene();
    let green = Material { diffuse: Rgb::Y, single_sided: true, ..black() };
    add_mesh(&mut scene, square(1.0), DAffine3::IDENTITY, green);
    add_mesh(&mut scene, square(0.0), DAffine3::IDENTITY, Material { diffuse: Rgb::X, ..black() });
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
    near(seen_at(&mut scene, 0.0), Rgb::Y, 1e-5);
    // Turned round, or mirrored, it lets eyes and light pass.
    let turned = [DAffine3::from_rotation_y(std::f64::consts::PI), DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0))];
    for (turn, z) in turned.into_iter().zip([2.0, 2.0]) {
        scene.objects[0].transform = DAffine3::from_translation(DVec3::new(0.0, 0.0, z)) * turn;
        near(seen_at(&mut scene, 0.0), Rgb::X, 1e-5);
        scene.materials[1].single_sided = false;
        near(seen_at(&mut scene, 0.0), Rgb::Y, 1e-5);
        scene.materials[1].single_sided = true;
    }
}

#[test]
fn normal_maps_turn_the_light() {
    // Texels that lean by 30 degrees to +x, to +y, and not at all.
    let byte = |value: f64| (value * 127.5 + 127.5).round() as u8;
    let lean = |x: f64, y: f64| [byte(x), byte(y), byte((1.0 - x * x - y * y).sqrt()), 255];
    let texels = [lean(0.5, 0.0), lean(0.0, 0.5), lean(0.0, 0.0)];
    let to_light = DVec3::new(0.6, 0.0, 0.8);
    let tangents = [None, Some(vec![Vec4::new(2.0, 0.0, 0.0, 1.0); 4])];
    let mirrored = DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
    for (tangents, transform) in tangents.into_iter().flat_map(|t| [(t.clone(), DAffine3::IDENTITY), (t, mirrored)]) {
        let mut scene = empty_scene();
        let map = add_row(&mut scene, &texels);
        let normal = Some(NormalMap { texture: map, scale: 1.0 });
        let mesh =
            TriangleMesh { normals: Some(vec![Vec3::Z; 4].into()), tangents: tangents.map(Array::from), ..square(0.0) };
        add_mesh(&mut scene, mesh, transform, with(Detail { normal, ..Detail::NONE }, white()));
        add_light(&mut scene, to_light * 1e6, Rgb::ONE);
        let (sin, cos) = (0.5, 3f64.sqrt() / 2.0);
        let expected = [0.6 * sin + 0.8 * cos, 0.8 * cos, 0.8];
        for (x, expected) in [-0.8, 0.0, 0.8].into_iter().zip(expected) {
            near(seen_at(&mut scene, x), Rgb::splat(expected as f32), 0.006);
        }
        // From behind the same side is up, and the light is on the other side.
        look(&mut scene, DVec3::new(0.8, 0.1, -9.0), DVec3::new(0.8, 0.1, 0.0));
        assert_eq!(pixel(&scene), Rgb::ZERO);
        scene.lights.clear();
        add_light(&mut scene, DVec3::new(0.6, 0.0, -0.8) * 1e6, Rgb::ONE);
        look(&mut scene, DVec3::new(-0.8, 0.1, -9.0), DVec3::new(-0.8, 0.1, 0.0));
        near(pixel(&scene), Rgb::splat((-0.6 * sin + 0.8 * cos) as f32), 0.006);
    }
}

#[test]
fn the_scale_of_a_normal_map_is_that_of_its_slope() {
    let mut scene = empty_scene();
    // A slope of 1/2, doubled.
    let map = add_row(&mut scene, &[[191, 128, 255, 255]]);
    let normal = Some(NormalMap { texture: map, scale: 2.0 });
    add_mesh(&mut scene, square(0.0), DAffine3::IDENTITY, with(Detail { normal, ..Detail::NONE }, white()));
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
    near(seen_at(&mut scene, 0.0), Rgb::splat(0.5f32.sqrt()), 0.004);
}

#[test]
fn vertex_colours_are_interpolated_and_multiply() {
    let mut scene = empty_scene();
    let (red, green) = ([65535, 0, 0, 65535], [0, 65535, 0, 65535]);
    let mesh = TriangleMesh { colors: Some(vec![red, green, green, red].into()), ..square(0.0) };
    add_mesh(&mut scene, mesh, DAffine3::IDENTITY, Material { diffuse: Rgb::new(0.5, 1.0, 1.0), ..black() });
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
    near(seen_at(&mut scene, -0.5), Rgb::new(0.5 * 0.75, 0.25, 0.0), 1e-5);
    near(seen_at(&mut scene, 0.5), Rgb::new(0.5 * 0.25, 0.75, 0.0), 1e-5);
}

#[test]
fn metalness_and_roughness_are_those_of_the_texel() {
    let mut scene = empty_scene();
    // A mirror on the left, a matt dielectric on the right.
    let map = add_row(&mut scene, &[[0, 0, 255, 255], [0, 255, 0, 255]]);
    let model = MetallicRoughness {
        base: Rgb::new(1.0, 0.5, 0.25),
        metallic_roughness: Some(map),
        specular: 0.0,
        ..MetallicRoughness::DEFAULT
    };
    let detail = Detail { rule: Rule::MetallicRoughness(model), ..Detail::NONE };
    add_mesh(&mut scene, square(0.0), DAffine3::IDENTITY, with(detail, white()));
    scene.background = Background::Color(Rgb::splat(0.5));
    near(seen_at(&mut scene, -0.5), Rgb::new(0.5, 0.25, 0.125), 1e-5);
    assert_eq!(seen_at(&mut scene, 0.5), Rgb::ZERO);
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
    near(seen_at(&mut scene, 0.5), Rgb::new(1.0, 0.5, 0.25), 1e-5);
}

#[test]
fn light_that_is_emitted_is_that_of_the_texel_and_the_second_coordinates() {
    let mut scene = empty_scene();
    let map = add_row(&mut scene, &[[255, 0, 0, 255], [0, 0, 255, 255]]);
    let emission = Some(TextureRef { second_uvs: true, ..map });
    let mesh = TriangleMesh { second_uvs: Some(vec![Vec2::X, Vec2::ZERO, Vec2::Y, Vec2::ONE].into()), ..square(0.0) };
    let bright = Material { emission: Rgb::splat(0.5), ..black() };
    add_mesh(&mut scene, mesh, DAffine3::IDENTITY, with(Detail { emission, ..Detail::NONE }, bright));
    assert_eq!(seen_at(&mut scene, -0.5), Rgb::Z * 0.5, "u runs the other way");
    assert_eq!(seen_at(&mut scene, 0.5), Rgb::X * 0.5);
}

#[test]
fn what_is_far_away_is_seen_as_its_mean() {
    let (black_texel, white_texel) = ([0, 0, 0, 255], [255, 255, 255, 255]);
    let texels: Vec<_> =
        (0..64 * 64).map(|i| if (i / 64 + i % 64) % 2 == 0 { white_texel } else { black_texel }).collect();
    let checker = Texture::new("checker", 64, 64, Texels::Srgb8(texels.into()));
    let seen = |texture: &Texture, distance: f64, samples: u32| {
        let mut scene = empty_scene();
        scene.textures.push(texture.clone());
        let diffuse_texture = Some(TextureRef::scaled(0, DVec2::splat(8.0), DVec2::ZERO));
        add_mesh(&mut scene, square(0.0), DAffine3::IDENTITY, Material { diffuse_texture, ..white() });
        add_light(&mut scene, DVec3::new(0.0, 0.0, 1e6), Rgb::ONE);
        scene.film.samples = samples;
        let middle_of_a_texel = DVec3::new(1.0 / 512.0, 1.0 / 512.0, 0.0);
        look(&mut scene, middle_of_a_texel + DVec3::Z * distance, middle_of_a_texel);
        pixel(&scene).x
    };
    // A texel is 1/256 wide, a pixel 2 tan(0.5 degrees) = 0.01745 times the distance.
    let smaller = checker.clone().with_levels();
    let near_texel = seen(&smaller, 0.05, 1);
    assert!(near_texel == 0.0 || near_texel > 0.99, "a pixel within a texel: {near_texel}");
    assert!((seen(&smaller, 3.0, 1) - 0.5).abs() < 0.01, "13 texels in a pixel");
    let alone = seen(&checker, 3.0, 1);
    assert!(alone == 0.0 || alone > 0.99, "without smaller versions one texel: {alone}");
    // A pixel of 1.3 texels is seen in smaller versions by one sample; each of 256 is smaller than a texel, and needs none.
    assert!((seen(&smaller, 0.3, 1) - seen(&checker, 0.3, 1)).abs() > 0.1);
    assert_eq!(seen(&smaller, 0.3, 256), seen(&checker, 0.3, 256));
}

#[test]
fn light_fades_on_its_way_through_what_absorbs() {
    // A slab of thickness 2 that neither bends nor mirrors, before a bright wall.
    let absorption = Rgb::new(0.0, 0.5, 2.0);
    let glass = Material { kt: Rgb::ONE, ior: 1.0, absorption, ..black() };
    let mut scene = empty_scene();
    add_mesh(&mut scene, cube(), DAffine3::IDENTITY, glass);
    let wall = rectangle(Vec3::new(-9.0, -9.0, -3.0), Vec3::X * 18.0, Vec3::Y * 18.0);
    add_mesh(&mut scene, wall, DAffine3::IDENTITY, Material { emission: Rgb::splat(0.5), ..black() });
    let left = Rgb::new(1.0, (-1.0f32).exp(), (-4.0f32).exp());
    near(pixel(&scene), left * 0.5, 1e-6);
    // From inside there is half the way to go.
    look(&mut scene, DVec3::ZERO, DVec3::NEG_Z);
    near(pixel(&scene), Rgb::new(1.0, (-0.5f32).exp(), (-2.0f32).exp()) * 0.5, 1e-6);
    // Its shadow is what is left of the light.
    scene.materials.last_mut().unwrap().emission = Rgb::ZERO;
    scene.materials.last_mut().unwrap().diffuse = Rgb::ONE;
    add_light(&mut scene, DVec3::new(0.0, 0.0, 1000.0), Rgb::ONE);
    look(&mut scene, DVec3::new(0.0, -4.0, -2.0), DVec3::new(0.0, 0.0, -3.0));
    near(pixel(&scene), left, 1e-5);
}

#[test]
fn the_f64_reference_sees_the_same_details() {
    let mut scene = everything();
    (scene.film.width, scene.film.height, scene.film.samples) = (64, 48, 1);
    let picture = render(&scene);
    let reference = ReferenceRenderer::build(scene, &Silent).unwrap();
    let reference = reference.render(&RenderSettings::default(), &Silent).unwrap();
    let far = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3);
    let different = picture.color.iter().zip(&reference.color).filter(|&pair| far(pair)).count();
    // Edges of texels that are read one by one may fall to either side.
    assert!(different <= 6, "{different} of {} pixels", picture.color.len());
}
