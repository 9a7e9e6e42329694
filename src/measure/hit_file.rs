//! How answers to rays are written: text, or 32-bit little-endian words.
//!
//! A hit is `t u v instance primitive`, with the source face last where that is asked for. As words t, u and v are f32 and
//! the rest u32; a miss has t infinite, u and v 0, and all bits set in the numbers. As text a miss is `miss`, and every
//! f32 has as few digits as read back bit for bit. Whether anything is hit is 0 or 1. A list of hits is their count and
//! then each of them, as text on a line each.

use std::fmt::Write;

use crate::geometry::Hit;
use crate::measure::ray_file::RecordFormat;
use crate::scene::{Scene, Shape};

/// Writes answers one after the other.
pub struct HitWriter<'a> {
    format: RecordFormat,
    /// Where source faces come from, if they are written.
    faces_of: Option<&'a Scene>,
}

impl<'a> HitWriter<'a> {
    /// A writer; `faces_of` is the scene whose source faces are written, if they are.
    pub fn new(format: RecordFormat, faces_of: Option<&'a Scene>) -> Self {
        Self { format, faces_of }
    }

    /// Appends a hit or miss.
    pub fn hit(&self, hit: &Hit, out: &mut Vec<u8>) {
        let face = self.faces_of.map(|scene| face(scene, hit));
        match self.format {
            RecordFormat::F32 => {
                let words = [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.instance, hit.primitive];
                let face = face.map(|face| face.unwrap_or(u32::MAX));
                out.extend(words.into_iter().chain(face).flat_map(u32::to_le_bytes));
            }
            RecordFormat::Text if !hit.is_hit() => out.extend(b"miss\n"),
            RecordFormat::Text => {
                let Hit { t, u, v, instance, primitive } = hit;
                let mut line = format!("{t:?} {u:?} {v:?} {instance} {primitive}");
                // Writing to a string cannot fail.
                let _ = match face {
                    Some(Some(face)) => writeln!(line, " {face}"),
                    Some(None) => writeln!(line, " -"),
                    None => writeln!(line),
                };
                out.extend(line.bytes());
            }
        }
    }

    /// Appends a yes or no.
    pub fn occluded(&self, occluded: bool, out: &mut Vec<u8>) {
        self.number(u32::from(occluded), out);
    }

    /// Appends a list of hits.
    pub fn all(&self, hits: &[Hit], out: &mut Vec<u8>) {
        self.number(hits.len() as u32, out);
        hits.iter().for_each(|hit| self.hit(hit, out));
    }

    fn number(&self, number: u32, out: &mut Vec<u8>) {
        match self.format {
            RecordFormat::Text => out.extend(format!("{number}\n").bytes()),
            RecordFormat::F32 => out.extend(number.to_le_bytes()),
        }
    }
}

/// The source face of a hit; misses and quadrics have none.
fn face(scene: &Scene, hit: &Hit) -> Option<u32> {
    let object = scene.objects.get(hit.instance as usize)?;
    match object.shape {
        Shape::Mesh(mesh) => Some(scene.meshes[mesh as usize].source_face(hit.primitive)),
        Shape::Quadric(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(format: RecordFormat, hits: &[Hit]) -> Vec<u8> {
        let mut out = Vec::new();
        HitWriter::new(format, None).all(hits, &mut out);
        out
    }

    #[test]
    fn text_reads_back_to_the_bit() {
        for t in [0.1f32, 1e-45, 3.4e38, 16_777_216.0, 1.0 / 3.0, 0.0, 1e7, 123_456.79] {
            let hit = Hit { t, u: t.next_up(), v: -t, instance: 7, primitive: 4_000_000_000 };
            let text = String::from_utf8(written(RecordFormat::Text, &[hit, Hit::MISS])).unwrap();
            let lines: Vec<&str> = text.lines().collect();
            assert_eq!((lines[0], lines[2], lines.len()), ("2", "miss", 3));
            let words: Vec<&str> = lines[1].split(' ').collect();
            let bits = |word: &str| word.parse::<f32>().unwrap().to_bits();
            assert_eq!([bits(words[0]), bits(words[1]), bits(words[2])], [hit.t, hit.u, hit.v].map(f32::to_bits));
            assert_eq!(words[3..], ["7", "4000000000"]);
        }
    }

    #[test]
    fn words_are_little_endian_and_a_miss_is_all_ones() {
        let hit = Hit { t: 1.0, u: 0.5, v: 0.25, instance: 1, primitive: 258 };
        let bytes = written(RecordFormat::F32, &[hit, Hit::MISS]);
        assert_eq!(bytes[..4], [2, 0, 0, 0]);
        assert_eq!(bytes[4..24], [0, 0, 128, 63, 0, 0, 0, 63, 0, 0, 128, 62, 1, 0, 0, 0, 2, 1, 0, 0]);
        assert_eq!(bytes[24..], [0, 0, 128, 127, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255]);
    }
}
