//! An island with mountains, from fractal noise.

use glam::{DVec2, DVec3};
use serde_json::json;
use whitted::math::random::{hash2, unit};

use crate::OutputFile;
use crate::gltf::Writer;
use crate::mesh::Mesh;
use crate::picture::{Color, Picture};

/// Along X and Z; the middle is the origin and the sea's level is y = 0.
const SIZE: DVec2 = DVec2::new(20.0, 10.0);

/// The terrain as `terrain.glb`, with at least `triangles` triangles: as many exactly where that is four times a square.
pub fn files(triangles: u32) -> Vec<OutputFile> {
    let mut writer = Writer::default();
    writer.add_mesh("terrain", &mesh(triangles), 0);
    let image = writer.add_png(&ground().png());
    let bytes = writer.into_glb(json!({
        "samplers": [{ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 }],
        "textures": [{ "source": image, "sampler": 0 }],
        "materials": [{ "name": "ground", "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0, "roughnessFactor": 1.0 } }],
        "nodes": [{ "name": "terrain", "mesh": 0 }],
        "scenes": [{ "nodes": [0] }],
        "scene": 0,
    }));
    vec![OutputFile::new("terrain.glb", bytes)]
}

/// A height field over a grid of squares.
fn mesh(triangles: u32) -> Mesh {
    let rows = (1..).find(|rows| 4 * rows * rows >= u64::from(triangles)).unwrap_or(1) as u32;
    let columns = 2 * rows;
    let step = SIZE.x / f64::from(columns);
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let uv = DVec2::new(f64::from(column) / f64::from(columns), 1.0 - f64::from(row) / f64::from(rows));
            let at = place(uv);
            mesh.push_vertex(DVec3::new(at.x, height(at), at.y), uv, normal(at, step));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let far_left = row * (columns + 1) + column;
            let near_left = far_left + columns + 1;
            mesh.push_triangle([near_left, near_left + 1, far_left + 1]);
            mesh.push_triangle([near_left, far_left + 1, far_left]);
        }
    }
    mesh
}

/// X and Z of texture coordinates; the picture's upper edge lies towards -Z.
fn place(uv: DVec2) -> DVec2 {
    DVec2::new(uv.x - 0.5, 0.5 - uv.y) * SIZE
}

/// The upward unit normal, by central differences over `step`.
fn normal(at: DVec2, step: f64) -> DVec3 {
    let slope = |along: DVec2| height(at + along * step) - height(at - along * step);
    DVec3::new(-slope(DVec2::X), 2.0 * step, -slope(DVec2::Y)).normalize()
}

/// The ground's picture: sand, grass, rock and snow by height and steepness.
fn ground() -> Picture {
    const SAND: DVec3 = DVec3::new(196.0, 178.0, 132.0);
    const GRASS: DVec3 = DVec3::new(84.0, 106.0, 52.0);
    const ROCK: DVec3 = DVec3::new(112.0, 102.0, 94.0);
    const SNOW: DVec3 = DVec3::new(242.0, 244.0, 250.0);
    let [width, height_px] = [1024, 512];
    Picture::from_fn(width, height_px, |x, y| -> Color {
        let (u, v) = ((f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height_px));
        let at = place(DVec2::new(u, 1.0 - v));
        let level = normal(at, 0.02).y;
        // Borders between the zones are frayed.
        let above_sea = height(at) + 0.15 * noise(at * 3.0, 77);
        let green = SAND.lerp(GRASS, smooth_step(0.04, 0.14, above_sea));
        let bare = green.lerp(ROCK, smooth_step(0.8, 0.6, level).max(smooth_step(0.7, 1.0, above_sea)));
        let color = bare.lerp(SNOW, smooth_step(0.95, 1.15, above_sea) * smooth_step(0.4, 0.6, level));
        (color * (1.0 + 0.12 * noise(at * 12.0, 78))).to_array().map(|value| value as u8)
    })
}

/// Height above the sea.
fn height(at: DVec2) -> f64 {
    // Coarse shapes are bent by noise of their own, so that no direction of the grid shows.
    let bent = at + 0.6 * DVec2::new(noise(at * 0.5, 31), noise(at * 0.5, 32));
    let mut ridges = 0.0;
    let mut detail = 0.0;
    let mut weight = 1.0;
    let mut frequency = 0.35;
    let mut amplitude = 1.0;
    for octave in 0..10 {
        let value = noise(bent * frequency, octave);
        // Ridged noise (F. K. Musgrave): sharp where it is high, smooth in the valleys, rough only where it is ridged.
        let ridge = (1.0 - value.abs()) * (1.0 - value.abs());
        ridges += amplitude * weight * ridge;
        detail += amplitude * value;
        weight = (weight * ridge * 1.6).min(1.0);
        frequency *= 2.03;
        amplitude *= 0.48;
    }
    // The land sinks into the sea all around.
    let from_middle = (at / (SIZE / 2.0)).length_squared();
    let land = smooth_step(1.0, 0.1, from_middle);
    land * (1.1 * ridges - 0.62 + 0.2 * detail) - 0.35 * (1.0 - land)
}

/// Gradient noise (K. Perlin) between -1 and 1, without trigonometry: the gradients are eight directions.
fn noise(at: DVec2, seed: u32) -> f64 {
    let cell = at.floor();
    let within = at - cell;
    let corner = |dx: f64, dy: f64| {
        let node = cell + DVec2::new(dx, dy);
        let h = hash2(hash2(node.x as i64 as u32, node.y as i64 as u32), seed);
        let sign = |bit: u32| if h >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let (a, b) = (sign(30), sign(29) * unit(h << 4));
        let gradient = if h >> 31 == 0 { DVec2::new(a, b) } else { DVec2::new(b, a) };
        gradient.dot(within - DVec2::new(dx, dy))
    };
    let fade = within * within * within * (within * (within * 6.0 - 15.0) + 10.0);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let near = mix(corner(0.0, 0.0), corner(1.0, 0.0), fade.x);
    let far = mix(corner(0.0, 1.0), corner(1.0, 1.0), fade.x);
    mix(near, far, fade.y)
}

/// 0 at `from`, 1 at `to`, smooth between; `from` may be the larger.
fn smooth_step(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Part, Topology};

    #[test]
    fn the_ground_is_one_sheet_that_faces_up() {
        let mesh = mesh(4 * 150 * 150);
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|corner| mesh.positions[corner.position as usize]);
            assert!((b - a).cross(c - a).y > 0.0);
        }
        assert_eq!(Topology::of(&mesh).parts, [Part { euler: 1, boundary_loops: 1, triangles: 90_000 }]);
        assert!(mesh.normals.iter().all(|normal| normal.y > 0.0));
    }

    #[test]
    fn there_is_land_and_sea() {
        let mesh = mesh(4 * 50 * 50);
        let peak = mesh.positions.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
        assert!(peak > 1.0 && peak < 3.0, "{peak}");
        let border = mesh.positions.iter().filter(|p| p.x.abs() == 10.0 || p.z.abs() == 5.0);
        assert!(border.into_iter().all(|p| p.y < 0.0));
    }

    #[test]
    fn a_million_is_a_million() {
        assert_eq!(mesh(1_000_000).triangles.len(), 1_000_000);
    }
}
