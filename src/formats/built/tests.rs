//! Files whose checksums are right and whose numbers are not.

use std::path::PathBuf;
use std::time::Duration;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::container::{Container, Kind as SectionKind, reseal};
use super::*;
use crate::accel::Params;
use crate::geometry::{Bounds, Hit, PreparedRay, Ray, shapes};
use crate::math::random::Random;
use crate::progress::Silent;
use crate::scene::material::TextureRef;
use crate::scene::{Camera, Material, NamedCamera, Object, Projection, Shape};

/// Something of everything: two meshes, one with all attributes and a dropped triangle, a quadric, an image with smaller versions, which is the
/// background too.
fn scene() -> Scene {
    let mut random = Random::new(5, 0x51d);
    let positions: Vec<Vec3> = (0..300).map(|_| random.in_cube().as_vec3()).collect();
    let mut indices: Vec<[u32; 3]> = (0..298).map(|n| [n, n + 1, n + 2]).collect();
    indices[17] = [4, 4, 5];
    let full = TriangleMesh {
        name: "full".into(),
        uvs: Some(positions.iter().map(|p| Vec2::new(p.x, p.y)).collect()),
        second_uvs: Some(positions.iter().map(|p| Vec2::new(p.y, p.z)).collect()),
        normals: Some(positions.clone().into()),
        colors: Some(positions.iter().map(|_| [1, 2, 3, 65535]).collect()),
        tangents: Some(positions.iter().map(|p| p.extend(1.0)).collect()),
        materials: Materials::PerTriangle((0..298).map(|n| n % 2).collect()),
        source_faces: Some((0..298).map(|n| n / 2).collect()),
        groups: vec![Group { name: "a".into(), first_triangle: 0 }, Group { name: "b".into(), first_triangle: 7 }],
        positions: positions.into(),
        indices: indices.into(),
        ..TriangleMesh::default()
    };
    let small = TriangleMesh {
        name: "small".into(),
        positions: [Vec3::ZERO, Vec3::X, Vec3::Y].into(),
        indices: [[0, 1, 2]].into(),
        ..TriangleMesh::default()
    };
    let texels = (0..64u8).map(|n| [n, n, n, 255]).collect::<Vec<_>>();
    let image = Texture::new("image", 8, 8, Texels::Srgb8(texels.into())).with_levels();
    assert!(!image.levels.is_empty());
    let bright = Texture::new("bright", 2, 1, Texels::Linear32(vec![[1.0, 2.0, 3.0]; 2].into()));
    let textured = Material { diffuse_texture: Some(TextureRef::new(0)), ..Material::default() };
    let object = |shape, shift: DVec3, material| Object {
        name: "object".into(),
        shape,
        transform: DAffine3::from_translation(shift),
        material,
    };
    let projection = Projection::Perspective { fov_y: 0.7 };
    let camera = Camera::LookAt { eye: DVec3::new(1.0, 2.0, 4.0), target: DVec3::ZERO, up: DVec3::Y, projection };
    Scene {
        cameras: vec![NamedCamera::new("camera", camera)],
        background: Background::Image { texture: bright, intensity: 0.5 },
        materials: vec![Material::default(), textured],
        textures: vec![image.clone(), Texture { name: "same texels".into(), ..image }],
        meshes: vec![full.finish().unwrap().into(), small.finish().unwrap().into()],
        quadrics: vec![shapes::sphere()],
        objects: vec![
            object(Shape::Mesh(0), DVec3::ZERO, None),
            object(Shape::Mesh(1), DVec3::X, None),
            object(Shape::Mesh(0), DVec3::Y, Some(1)),
            object(Shape::Quadric(0), DVec3::Z * 3.0, Some(0)),
        ],
        ..Scene::default()
    }
}

/// Keeps what is said to have been read from a file since a moment.
fn save_from(input: &Path, since: SystemTime, renderer: &Renderer, path: &Path) -> Result<u64> {
    let mut ledger = Ledger::default();
    ledger.note_file(input);
    let (options, automatic) = (&LoadOptions::default(), Automatic::default());
    save(
        renderer,
        &Origin { input, options, since, ledger: &ledger, automatic, preset: Preset::Balanced },
        path,
        &Silent,
    )
}

/// When a file that was just written is older.
fn later() -> SystemTime {
    SystemTime::now() + Duration::from_secs(1)
}

/// A built scene in a folder, beside the file that it is said to be built from.
fn built(kind: Kind) -> (tempfile::TempDir, PathBuf, Renderer) {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("input.toml");
    std::fs::write(&input, "not read").unwrap();
    let renderer = Renderer::build(scene(), &Params { kind, ..Params::default() }, &Silent).unwrap();
    let path = folder.path().join("scene.whb");
    let bytes = save_from(&input, later(), &renderer, &path).unwrap();
    assert_eq!(bytes, std::fs::metadata(&path).unwrap().len());
    (folder, path, renderer)
}

fn rays() -> Vec<Ray> {
    let mut random = Random::new(6, 0x51d);
    let mut ray = || {
        let origin = random.in_cube() * 4.0;
        Ray::new(origin.as_vec3(), (random.in_cube() - origin).as_vec3())
    };
    (0..500).map(|_| ray()).collect()
}

/// Asks rays in every way: what is found does not matter.
fn ask(renderer: &Renderer) {
    let rays = rays();
    renderer.closest_batch(&rays, &mut vec![Hit::MISS; rays.len()]);
    renderer.occluded_batch(&rays, &mut vec![false; rays.len()]);
    for ray in &rays[..20] {
        std::hint::black_box((renderer.closest(ray), renderer.occluded(ray), renderer.hits(ray).take(20).count()));
    }
}

/// What there is of a file, ready for rays.
fn restored(path: &Path) -> Result<Renderer> {
    let loaded = open(path, &Silent)?;
    loaded.built.unwrap().renderer(loaded.scene, &Silent)
}

#[test]
fn what_is_kept_is_what_was_built_and_lies_in_the_file() {
    for kind in [Kind::Wide, Kind::Compact] {
        let (_folder, path, renderer) = built(kind);
        let read = restored(&path).unwrap();
        let (before, after) = (renderer.scene(), read.scene());
        for (one, other) in before.meshes.iter().zip(&after.meshes) {
            // All fields, in their words.
            assert_eq!(format!("{one:?}"), format!("{other:?}"));
            assert!(other.positions.is_mapped() && other.indices.is_mapped());
        }
        assert!(after.meshes[0].uvs.as_ref().unwrap().is_mapped());
        assert_eq!(before.materials, after.materials);
        assert_eq!(before.textures, after.textures);
        assert!(after.textures[0].texels.is_shared_with(&after.textures[1].texels));
        assert_eq!(before.background, after.background);
        assert_eq!(before.quadrics, after.quadrics);
        assert_eq!(before.objects, after.objects);
        assert_eq!(before.cameras, after.cameras);
        assert_eq!((before.film, before.origin, before.ambient), (after.film, after.origin, after.ambient));
        read.validate().unwrap();
        let bits = |bounds: Option<Bounds>| bounds.map(|bounds| bounds.min.to_array().map(f32::to_bits));
        let boxes = |renderer: &Renderer| -> Vec<_> {
            renderer.world().instances.iter().map(|instance| bits(instance.bounds)).collect()
        };
        assert_eq!(boxes(&renderer), boxes(&read));
        let hits = |renderer: &Renderer| rays().iter().map(|ray| renderer.closest(ray)).collect::<Vec<_>>();
        assert_eq!(hits(&renderer), hits(&read));
        assert!(hits(&read).iter().filter(|hit| hit.is_hit()).count() > 100);
        assert!(rays().iter().all(|ray| PreparedRay::new(ray).is_some()));
    }
}

#[test]
fn every_flipped_and_every_missing_byte_is_found() {
    let (_folder, path, _) = built(Kind::Compact);
    let whole = std::fs::read(&path).unwrap();
    let mut random = Random::new(8, 0x51d);
    let flawed = path.with_file_name("flawed.whb");
    let refused = |bytes: &[u8], what: &str| {
        std::fs::write(&flawed, bytes).unwrap();
        let error = open(&flawed, &Silent).err().unwrap_or_else(|| panic!("{what} was missed"));
        assert_eq!(error.path(), Some(flawed.as_path()), "{what}: {error}");
    };
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << random.below(8);
        refused(&bytes, &format!("a flipped bit of byte {at}"));
    }
    for length in (0..whole.len()).rev().step_by(7).chain(0..200) {
        refused(&whole[..length], &format!("a file of {length} bytes"));
    }
    refused(&[&whole[..], &[0]].concat(), "a byte more");
}

#[test]
fn damage_is_named() {
    let (_folder, path, _) = built(Kind::Wide);
    let container = Container::open(&path).unwrap();
    for (kind, item, named) in [
        (SectionKind::Description, 0, "the description"),
        (SectionKind::Indices, 1, "the indices of mesh 1"),
        (SectionKind::Nodes, 0, "the nodes of mesh 0"),
        (SectionKind::Texels, 2, "the texels of image 2"),
    ] {
        let range = container.range(kind, item).unwrap();
        let mut bytes = container.mapping.bytes().to_vec();
        bytes[range.start + 5] ^= 1;
        let flawed = path.with_file_name("flawed.whb");
        std::fs::write(&flawed, bytes).unwrap();
        let message = open(&flawed, &Silent).unwrap_err().to_string();
        let place = format!("{} to {}", range.start, range.end);
        assert!(message.contains(named) && message.contains(&place), "{message}");
        assert!(message.contains("build it again"), "{message}");
    }
}

#[test]
fn numbers_that_name_nothing_are_refused_whatever_the_checksum_says() {
    for kind in [Kind::Wide, Kind::Compact] {
        let (_folder, path, _) = built(kind);
        let whole = std::fs::read(&path).unwrap();
        let container = Container::open(&path).unwrap();
        let flawed = path.with_file_name("flawed.whb");
        let with_word = |section: SectionKind, item: u32, at: usize, word: u32| {
            let range = container.range(section, item).unwrap();
            let mut bytes = whole.clone();
            bytes[range][4 * at..][..4].copy_from_slice(&word.to_ne_bytes());
            reseal(&mut bytes);
            std::fs::write(&flawed, bytes).unwrap();
            restored(&flawed)
        };
        let words = |section, item| container.range(section, item).unwrap().len() / 4;
        let refused = |section: SectionKind, item, at, word| {
            let error = with_word(section, item, at, word).err();
            let error = error.unwrap_or_else(|| panic!("{word} at {at} of {section:?} was missed"));
            assert_eq!(error.path(), Some(flawed.as_path()), "{error}");
            assert!(error.to_string().contains("build it again"), "{error}");
        };
        // Vertices, materials and dropped triangles that are not there; dropped ones may have any.
        refused(SectionKind::Indices, 0, 0, 300);
        refused(SectionKind::Indices, 1, 2, u32::MAX);
        assert!(with_word(SectionKind::Indices, 0, 17 * 3, 1 << 30).is_ok());
        refused(SectionKind::Materials, 0, 5, 2);
        refused(SectionKind::Dropped, 0, 0, 298);
        // Triangles of leaves: not there, or dropped.
        let last = |item| words(SectionKind::Leaves, item) - 8 - 1;
        refused(SectionKind::Leaves, 1, last(1), 1);
        refused(SectionKind::Leaves, 0, last(0), 298);
        if kind == Kind::Compact {
            refused(SectionKind::Leaves, 0, 3, 17);
        }
        // Children: out of range, before their parents, twice; and a box where there is no child.
        let nodes = words(SectionKind::Nodes, 0) / 64;
        assert!(nodes > 2);
        for child in [nodes as u32, 0, u32::MAX, 0xff00_0000, 0x8fff_fff0] {
            refused(SectionKind::Nodes, 0, 48, child);
        }
        // Whatever else is there, rays end.
        let mut random = Random::new(9, 0x51d);
        let sections = [SectionKind::Nodes, SectionKind::Leaves, SectionKind::Positions, SectionKind::Indices];
        for round in 0..400 {
            let section = sections[round % sections.len()];
            let at = random.below(words(section, 0) as u64) as usize;
            let word = if round % 3 == 0 { random.below(400) as u32 } else { random.below(1 << 32) as u32 };
            if let Ok(renderer) = with_word(section, 0, at, word) {
                ask(&renderer);
            }
        }
    }
}

#[test]
fn descriptions_of_anything_end_in_an_error_or_a_scene() {
    let (_folder, path, _) = built(Kind::Compact);
    let whole = std::fs::read(&path).unwrap();
    let range = Container::open(&path).unwrap().range(SectionKind::Description, 0).unwrap();
    let flawed = path.with_file_name("flawed.whb");
    let mut random = Random::new(10, 0x51d);
    let (mut refused, mut read) = (0, 0);
    for round in 0..1000 {
        let mut bytes = whole.clone();
        for _ in 0..=round % 3 {
            bytes[range.start + random.below(range.len() as u64) as usize] = random.below(256) as u8;
        }
        // Numbers that are none, or too large for f32, most of them in transforms, which are half of it.
        if round % 2 == 0 {
            let number = [f64::NAN, f64::INFINITY, 1e300, -3e38, 1e38][random.below(5) as usize];
            let at = range.start + random.below(range.len() as u64 - 8) as usize;
            bytes[at..at + 8].copy_from_slice(&number.to_ne_bytes());
        }
        reseal(&mut bytes);
        std::fs::write(&flawed, bytes).unwrap();
        match restored(&flawed) {
            Ok(renderer) => {
                read += 1;
                if round % 4 == 0 {
                    ask(&renderer);
                }
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 100 && read > 50, "{refused} refused, {read} read");
}

#[test]
fn sources_are_compared_where_they_are() {
    let (folder, path, _) = built(Kind::Wide);
    let input = folder.path().join("input.toml");
    let sources = |path: &Path| open(path, &Silent).map(|loaded| loaded.built.unwrap().sources);
    assert_eq!(sources(&path).unwrap(), std::slice::from_ref(&input));
    // Written again, the same; of the same length, but other; longer.
    std::fs::write(&input, "not read").unwrap();
    assert!(sources(&path).is_ok());
    for other in ["not reaD", "not read "] {
        std::fs::write(&input, other).unwrap();
        let message = sources(&path).unwrap_err().to_string();
        assert!(message.contains("scene.whb") && message.contains("input.toml"), "{message}");
    }
    std::fs::remove_file(&input).unwrap();
    assert_eq!(sources(&path).unwrap(), [] as [PathBuf; 0]);
}

#[test]
fn sources_are_found_through_links_and_are_the_same_links() {
    let (folder, path, renderer) = built(Kind::Wide);
    let input = folder.path().join("input.toml");
    let other = tempfile::tempdir().unwrap();
    #[cfg(unix)]
    {
        // A link to the built scene leads to its sources too.
        let link = other.path().join("link.whb");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert_eq!(open(&link, &Silent).unwrap().built.unwrap().sources.len(), 1);
        // Also to one that is built through it.
        save_from(&input, later(), &renderer, &link).unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(open(&link, &Silent).unwrap().built.unwrap().sources.len(), 1);
        std::fs::write(&input, "other").unwrap();
        assert_eq!(open(&link, &Silent).unwrap_err().path(), Some(link.as_path()));
        // A source that is a link is what it leads to now.
        let [one, two] = ["one", "two"].map(|name| folder.path().join(name));
        std::fs::write(&one, "not read").unwrap();
        std::fs::write(&two, "not reaD").unwrap();
        std::fs::remove_file(&input).unwrap();
        std::os::unix::fs::symlink(&one, &input).unwrap();
        assert!(open(&path, &Silent).is_ok());
        std::fs::remove_file(&input).unwrap();
        std::os::unix::fs::symlink(&two, &input).unwrap();
        assert!(open(&path, &Silent).is_err());
        // Nothing that has no end is read.
        std::fs::remove_file(&input).unwrap();
        std::os::unix::fs::symlink("/dev/zero", &input).unwrap();
        assert!(open(&path, &Silent).is_err());
        std::fs::remove_file(&input).unwrap();
    }
    // A time that is yet to come is no change.
    std::fs::write(&input, "not read").unwrap();
    let tomorrow = SystemTime::now() + Duration::from_secs(86_400);
    std::fs::File::open(&input).unwrap().set_modified(tomorrow).unwrap();
    save_from(&input, SystemTime::now(), &renderer, &path).unwrap();
    assert!(open(&path, &Silent).is_ok());
    // What changes while it is built is found out.
    std::fs::write(&input, "changed").unwrap();
    let before = SystemTime::now() - Duration::from_secs(1);
    let message = save_from(&input, before, &renderer, &path).unwrap_err().to_string();
    assert!(message.contains("input.toml") && message.contains("changed while the scene was built"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn paths_need_not_be_text() {
    use std::os::unix::ffi::OsStrExt;
    let (folder, _, renderer) = built(Kind::Compact);
    let odd = folder.path().join(std::ffi::OsStr::from_bytes(b"odd\xff"));
    std::fs::create_dir(&odd).unwrap();
    let input = odd.join("input.toml");
    std::fs::write(&input, "not read").unwrap();
    let path = folder.path().join("odd.whb");
    save_from(&input, later(), &renderer, &path).unwrap();
    assert_eq!(open(&path, &Silent).unwrap().built.unwrap().sources.len(), 1);
    std::fs::write(&input, "other").unwrap();
    assert!(open(&path, &Silent).is_err());
}

/// A file of one version is laid out in one way: where this fails, raise the number in the first bytes of the format, and put here what is
/// found.
#[test]
fn the_layout_is_that_of_its_version() {
    let found = [Kind::Wide, Kind::Compact].map(|kind| {
        let (_folder, path, _) = built(kind);
        let container = Container::open(&path).unwrap();
        let mut all = blake3::Hasher::new();
        for (kind, item, range) in container.sections() {
            all.update(&(kind as u32).to_le_bytes());
            all.update(&item.to_le_bytes());
            let bytes = &container.mapping.bytes()[range];
            if kind == SectionKind::Description {
                // How old its sources are depends on the machine.
                let mut description: Description = postcard::from_bytes(bytes).unwrap();
                description.sources.clear();
                all.update(&postcard::to_stdvec(&description).unwrap());
            } else {
                all.update(bytes);
            }
        }
        all.finalize().to_hex()[..16].to_owned()
    });
    assert_eq!(found, ["d31b4ece94b7455d", "9881ccafb3c0860a"]);
}
