//! Writes Wavefront OBJ.

use std::fmt::Write;

use crate::mesh::Mesh;

/// The text of an OBJ file. `comment` may have several lines; `library` names the file of the groups' materials.
pub fn text(mesh: &Mesh, comment: &str, library: Option<&str>) -> String {
    let mut out = String::new();
    for line in comment.lines() {
        let _ = writeln!(out, "# {line}");
    }
    if let Some(library) = library {
        let _ = writeln!(out, "mtllib {library}");
    }
    for p in &mesh.positions {
        let _ = writeln!(out, "v {} {} {}", decimal(p.x), decimal(p.y), decimal(p.z));
    }
    for uv in &mesh.uvs {
        let _ = writeln!(out, "vt {} {}", decimal(uv.x), decimal(uv.y));
    }
    for n in &mesh.normals {
        let _ = writeln!(out, "vn {} {} {}", decimal(n.x), decimal(n.y), decimal(n.z));
    }
    let mut groups = mesh.groups.iter().peekable();
    for (number, corners) in mesh.triangles.iter().enumerate() {
        while let Some(group) = groups.next_if(|group| group.first == number) {
            let _ = writeln!(out, "g {0}\nusemtl {0}", group.name);
        }
        out.push('f');
        for corner in corners {
            let _ = write!(out, " {}/{}/{}", corner.position + 1, corner.uv + 1, corner.normal + 1);
        }
        out.push('\n');
    }
    out
}

/// Six decimals, without trailing zeros and without a negative zero.
fn decimal(value: f64) -> String {
    let text = format!("{value:.6}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, expected) in [(1.0, "1"), (-0.0, "0"), (-1e-9, "0"), (0.1, "0.1"), (-2.5, "-2.5"), (100.0, "100")] {
            assert_eq!(decimal(value), expected);
        }
    }

    #[test]
    fn groups_come_before_their_triangles() {
        let mut mesh = Mesh::default();
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]] {
            mesh.push_vertex(glam::DVec3::new(x, y, 0.0), glam::DVec2::new(x, y), glam::DVec3::Z);
        }
        mesh.begin_group("red");
        mesh.push_triangle([0, 1, 2]);
        let text = text(&mesh, "two\nlines", Some("a.mtl"));
        assert!(text.starts_with("# two\n# lines\nmtllib a.mtl\nv 0 0 0\n"));
        assert!(text.ends_with("g red\nusemtl red\nf 1/1/1 2/2/2 3/3/3\n"));
    }
}
