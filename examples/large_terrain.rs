//! Writes a terrain of any size as a model, to see how large scenes may be.
//!
//! ```text
//! cargo run --release --example large_terrain -- 100000000 terrain.glb      or terrain.obj
//! ```
//!
//! The first argument is about the number of triangles. A `.glb` of 100 million takes 1.8 GB, an `.obj` 4.6 GB.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use rayon::prelude::*;
use whitted::measure::generated::height;

/// Rows that are made at once.
const ROWS: u32 = 256;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: large_terrain TRIANGLES OUT.glb|OUT.obj";
    let (Some(triangles), Some(out)) = (arguments.next(), arguments.next()) else { return Err(usage.into()) };
    let side = (triangles.parse::<f64>()? / 2.0).sqrt().round() as u32;
    if !(1..=20_000).contains(&side) {
        return Err("from 2 to 800000000 triangles".into());
    }
    let mut file = BufWriter::with_capacity(1 << 20, File::create(&out)?);
    match Path::new(&out).extension().and_then(|suffix| suffix.to_str()) {
        Some("glb") => write_glb(&mut file, side)?,
        Some("obj") => write_obj(&mut file, side)?,
        _ => return Err(usage.into()),
    }
    file.flush()?;
    println!("{out}: {} triangles, {} vertices", 2 * u64::from(side).pow(2), (u64::from(side) + 1).pow(2));
    Ok(())
}

/// Rows of corners, some at a time: `side` squares and one corner more in each, over [-1, 1]^2.
fn rows(side: u32) -> impl Iterator<Item = Vec<[f32; 3]>> {
    let place = move |i: u32| 2.0 * f64::from(i) / f64::from(side) - 1.0;
    (0..=side).step_by(ROWS as usize).map(move |first| {
        let rows = first..(first + ROWS).min(side + 1);
        let row =
            |z: u32| (0..=side).map(move |x| [place(x) as f32, height(place(x), place(z)) as f32, place(z) as f32]);
        rows.into_par_iter().flat_map_iter(row).collect()
    })
}

/// The triangles of a row of squares.
fn squares(side: u32, z: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..side).flat_map(move |x| {
        let corner = |x: u32, z: u32| z * (side + 1) + x;
        let (a, b, c, d) = (corner(x, z), corner(x + 1, z), corner(x, z + 1), corner(x + 1, z + 1));
        [[a, c, d], [a, d, b]]
    })
}

fn write_glb(out: &mut impl Write, side: u32) -> Result<(), Box<dyn std::error::Error>> {
    let (vertices, triangles) = ((u64::from(side) + 1).pow(2), 2 * u64::from(side).pow(2));
    let (positions, indices) = (12 * vertices, 12 * triangles);
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],"buffers":[{{"byteLength":{}}}],
"bufferViews":[{{"buffer":0,"byteLength":{positions}}},{{"buffer":0,"byteOffset":{positions},"byteLength":{indices}}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":[-1,-1,-1],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}]}}"#,
        positions + indices,
        3 * triangles
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let total = 12 + 8 + json.len() as u64 + 8 + positions + indices;
    let total = u32::try_from(total).map_err(|_| "a .glb cannot be larger than 4 GiB; write an .obj")?;
    out.write_all(b"glTF")?;
    out.write_all(&[2, total].map(u32::to_le_bytes).concat())?;
    out.write_all(&(json.len() as u32).to_le_bytes())?;
    out.write_all(b"JSON")?;
    out.write_all(json.as_bytes())?;
    out.write_all(&((positions + indices) as u32).to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    for some in rows(side) {
        out.write_all(&some.iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    for z in 0..side {
        out.write_all(&squares(side, z).flatten().flat_map(u32::to_le_bytes).collect::<Vec<u8>>())?;
    }
    Ok(())
}

fn write_obj(out: &mut impl Write, side: u32) -> std::io::Result<()> {
    for some in rows(side) {
        some.iter().try_for_each(|[x, y, z]| writeln!(out, "v {x} {y} {z}"))?;
    }
    for z in 0..side {
        squares(side, z).map(|t| t.map(|v| v + 1)).try_for_each(|[a, b, c]| writeln!(out, "f {a} {b} {c}"))?;
    }
    Ok(())
}
