//! What images and vertices say at a point: a material's terms there, holes in surfaces, and mapped normals.

use std::borrow::Cow;

use glam::{DVec2, DVec3, Vec4};

use crate::geometry::{Hit, TriangleMesh};
use crate::math::vector::{cross, dot, length, normalize};
use crate::render::answers::Answers;
use crate::render::surface::{Place, SurfacePoint, uv_at};
use crate::render::trace::Tracer;
use crate::render::world::{Instance, World};
use crate::scene::detail::NormalMap;
use crate::scene::{Material, Rgb, Scene, Shape, TextureRef};

/// Where a point of a triangle is in images.
pub(super) struct ImagePlace<'a> {
    scene: &'a Scene,
    /// Texture coordinates, both sets.
    uvs: [DVec2; 2],
    /// The square of the side that a pixel has in each, as far as that is known; 0 reads single texels.
    footprints: [f64; 2],
}

impl<'a> ImagePlace<'a> {
    /// That of a point, which `hit` found.
    pub fn of(scene: &'a Scene, world: &World, point: &SurfacePoint, hit: &Hit) -> Self {
        let instance = &world.instances[hit.instance as usize];
        match (instance.shape, point.place) {
            (Shape::Mesh(mesh), Place::Weights(weights)) => {
                let mesh = &scene.meshes[mesh as usize];
                let mut place = Self::on_triangle(scene, mesh, hit.primitive, weights);
                let [a, b, c] = mesh.triangle(hit.primitive).map(|corner| corner.as_dvec3());
                let to_world = |edge: DVec3| match instance.is_unmoved() {
                    true => edge,
                    false => instance.transform.vector_to_world(edge),
                };
                let twice_area = length(cross(to_world(b - a), to_world(c - a)));
                let side = world.pixels.side_at(point.position, point.geometric_normal);
                let per_area = side * side / twice_area;
                for (set, uvs) in [&mesh.uvs, &mesh.second_uvs].into_iter().enumerate() {
                    let Some(uvs) = uvs else { continue };
                    let [a, b, c] = mesh.indices[hit.primitive as usize].map(|i| uvs[i as usize].as_dvec2());
                    let (ab, ac) = (b - a, c - a);
                    place.footprints[set] = per_area * (ab.x * ac.y - ab.y * ac.x).abs();
                }
                place
            }
            _ => Self { scene, uvs: [point.texture_coordinates(scene, hit); 2], footprints: [0.0; 2] },
        }
    }

    /// That of a point given by the weights of a triangle's corners, of no extent.
    fn on_triangle(scene: &'a Scene, mesh: &TriangleMesh, primitive: u32, weights: [f64; 3]) -> Self {
        let uvs = [&mesh.uvs, &mesh.second_uvs]
            .map(|uvs| uvs.as_ref().map_or(DVec2::ZERO, |uvs| uv_at(mesh, uvs, primitive, weights)));
        Self { scene, uvs, footprints: [0.0; 2] }
    }

    /// What an image has there.
    pub fn texel(&self, used: &TextureRef) -> Vec4 {
        let texture = &self.scene.textures[used.texture as usize];
        let set = usize::from(used.second_uvs);
        let (x, y) = (used.matrix.x_axis, used.matrix.y_axis);
        let stretch = (x.x * y.y - x.y * y.x).abs() * f64::from(texture.width) * f64::from(texture.height);
        let texels = (self.footprints[set] * stretch).sqrt();
        texture.sample_footprint(used.place(self.uvs[set]), texels as f32)
    }
}

/// The linear colour and alpha of vertices at a point of a mesh; white where there are none.
fn vertex_color(mesh: &TriangleMesh, primitive: u32, weights: [f64; 3]) -> Vec4 {
    let Some(colors) = &mesh.colors else { return Vec4::ONE };
    let corners = mesh.indices[primitive as usize].map(|i| colors[i as usize]);
    let channel = |at: usize| {
        let [a, b, c] = corners.map(|corner| f64::from(corner[at]));
        ((a * weights[0] + b * weights[1] + c * weights[2]) / 65535.0) as f32
    };
    Vec4::new(channel(0), channel(1), channel(2), channel(3))
}

impl<'a, I: Answers> Tracer<'a, I> {
    /// A material's terms at a point, which `hit` found, but for its diffuse texture where that is all there is.
    #[inline(always)]
    pub(super) fn terms(&self, point: &SurfacePoint, hit: &Hit) -> Cow<'a, Material> {
        let material = &self.scene.materials[point.material as usize];
        if self.is_detailed(material, hit) {
            self.detailed_terms(material, point, hit)
        } else {
            Cow::Borrowed(material)
        }
    }

    /// Whether a material's terms differ from point to point of what was hit, apart from its diffuse texture.
    #[inline(always)]
    pub(super) fn is_detailed(&self, material: &Material, hit: &Hit) -> bool {
        material.detail.is_some() || self.world.instances[hit.instance as usize].has_colors
    }

    /// Out of line, since scenes without detail need not pay.
    #[inline(never)]
    fn detailed_terms(&self, material: &'a Material, point: &SurfacePoint, hit: &Hit) -> Cow<'a, Material> {
        let place = ImagePlace::of(self.scene, self.world, point, hit);
        let color = match (self.scene.objects[hit.instance as usize].shape, point.place) {
            (Shape::Mesh(mesh), Place::Weights(weights)) => {
                vertex_color(&self.scene.meshes[mesh as usize], hit.primitive, weights)
            }
            _ => Vec4::ONE,
        };
        Cow::Owned(material.at(color, |used| place.texel(used)))
    }

    /// What a surface that was hit lets through of light that travels in a direction, straight on: kt, or all of it where
    /// the surface is not there.
    pub(super) fn passes(&self, hit: &Hit, direction: DVec3) -> Rgb {
        let material = self.material_hit(hit);
        if self.shows_no_back(material, hit, direction) {
            return Rgb::ONE;
        }
        match material.detail {
            Some(_) => self.at_hit(hit, |color, place| material.passes_at(color, |used| place.texel(used))),
            None => material.kt,
        }
    }

    /// Whether the surface that a ray in this direction hit is not there.
    pub(super) fn is_hole(&self, hit: &Hit, direction: DVec3) -> bool {
        let material = self.material_hit(hit);
        self.shows_no_back(material, hit, direction)
            || material.has_alpha()
                && self.at_hit(hit, |color, place| material.alpha_at(color, |used| place.texel(used))) == 0.0
    }

    /// Whether a ray in this direction hit a back that is not there.
    fn shows_no_back(&self, material: &Material, hit: &Hit, direction: DVec3) -> bool {
        material.single_sided && self.is_from_inside(hit, direction)
    }

    /// Whether some of what was hit may not be there.
    #[inline(always)]
    pub(super) fn has_holes(&self, hit: &Hit) -> bool {
        self.world.instances[hit.instance as usize].has_holes
    }

    /// The first hit of those from `hit` on whose surface is there; `pass` is told of those before it.
    #[inline(never)]
    pub(super) fn beyond_holes(&self, ray: &I::Ray, direction: DVec3, mut hit: Hit, mut pass: impl FnMut(&Hit)) -> Hit {
        while hit.is_hit() && self.has_holes(&hit) && self.is_hole(&hit, direction) {
            pass(&hit);
            hit = self.intersect.next_hit(ray, hit.key());
        }
        hit
    }

    /// Asks what vertices and images have where a triangle was hit, texel by texel.
    fn at_hit<T>(&self, hit: &Hit, ask: impl FnOnce(Vec4, &ImagePlace<'_>) -> T) -> T {
        let Shape::Mesh(mesh) = self.scene.objects[hit.instance as usize].shape else {
            unreachable!("materials of quadrics have no detail")
        };
        let mesh = &self.scene.meshes[mesh as usize];
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let weights = [1.0 - u - v, u, v];
        let place = ImagePlace::on_triangle(self.scene, mesh, hit.primitive, weights);
        ask(vertex_color(mesh, hit.primitive, weights), &place)
    }

    /// The material of what was hit.
    #[inline(always)]
    pub(super) fn material_hit(&self, hit: &Hit) -> &'a Material {
        &self.scene.materials[self.scene.material_of(hit.instance, hit.primitive) as usize]
    }

    /// Whether a ray in this direction meets the back of a triangle; of quadrics that is not asked.
    pub(super) fn is_from_inside(&self, hit: &Hit, direction: DVec3) -> bool {
        let instance = &self.world.instances[hit.instance as usize];
        let Shape::Mesh(mesh) = instance.shape else { return false };
        let [a, b, c] = self.scene.meshes[mesh as usize].triangle(hit.primitive).map(|corner| corner.as_dvec3());
        let local = if instance.is_unmoved() { direction } else { instance.transform.vector_to_object(direction) };
        dot(cross(b - a, c - a), local) > 0.0
    }
}

impl SurfacePoint {
    /// Turns the shading normal to where a normal map points.
    ///
    /// The map's axes are the mesh's tangent and bitangent, or where it has none those of the triangle's texture
    /// coordinates, made perpendicular to the normal. A normal that looks away from the true surface's front is raised
    /// to its horizon.
    #[inline(never)]
    pub(super) fn map_normal(&mut self, scene: &Scene, world: &World, instance: &Instance, hit: &Hit, map: &NormalMap) {
        let (Shape::Mesh(mesh), Place::Weights(weights)) = (instance.shape, self.place) else { return };
        let mesh = &scene.meshes[mesh as usize];
        // All is found on the front.
        let side = if self.from_outside { 1.0 } else { -1.0 };
        let normal = self.normal * side;
        let Some([tangent, bitangent]) = tangents(mesh, instance, hit.primitive, weights, map.texture.second_uvs)
        else {
            return;
        };
        let upright = |axis: DVec3| normalize(axis - normal * dot(axis, normal));
        let (Some(tangent), Some(bitangent)) = (upright(tangent), upright(bitangent)) else { return };
        let texel = ImagePlace::of(scene, world, self, hit).texel(&map.texture).as_dvec4();
        let [x, y, z] = [texel.x, texel.y, texel.z].map(|value| 2.0 * value - 1.0);
        let scale = f64::from(map.scale);
        let mapped = tangent * (x * scale) + bitangent * (y * scale) + normal * z;
        let Some(mapped) = normalize(mapped) else { return };
        let front = self.geometric_normal * side;
        let lacking = (HORIZON - dot(mapped, front)).max(0.0);
        if let Some(mapped) = normalize(mapped + front * lacking) {
            self.normal = mapped * side;
        }
    }
}

/// How far a mapped normal rises above the surface at least: 0.6 degrees, so that it sees all that stands before it.
const HORIZON: f64 = 0.01;

/// The world's directions in which u and v of a set of texture coordinates grow at a point of a triangle, of any length.
fn tangents(
    mesh: &TriangleMesh,
    instance: &Instance,
    primitive: u32,
    weights: [f64; 3],
    second_uvs: bool,
) -> Option<[DVec3; 2]> {
    let indices = mesh.indices[primitive as usize].map(|i| i as usize);
    let to_world = |v: DVec3| if instance.is_unmoved() { v } else { instance.transform.vector_to_world(v) };
    if let (Some(tangents), Some(normals)) = (&mesh.tangents, &mesh.normals) {
        let corners = indices.map(|i| tangents[i]);
        let mix = |[a, b, c]: [DVec3; 3]| a * weights[0] + b * weights[1] + c * weights[2];
        let tangent = mix(corners.map(|corner| corner.truncate().as_dvec3()));
        let normal = mix(indices.map(|i| normals[i].as_dvec3()));
        if tangent != DVec3::ZERO && normal != DVec3::ZERO {
            let bitangent = cross(normal, tangent) * f64::from(corners[0].w.signum());
            return Some([to_world(tangent), to_world(bitangent)]);
        }
    }
    let uvs = if second_uvs { &mesh.second_uvs } else { &mesh.uvs }.as_ref()?;
    let [a, b, c] = mesh.triangle(primitive).map(|corner| corner.as_dvec3());
    let [uv_a, uv_b, uv_c] = indices.map(|i| uvs[i].as_dvec2());
    let (ab, ac, uv_ab, uv_ac) = (b - a, c - a, uv_b - uv_a, uv_c - uv_a);
    let area = uv_ab.x * uv_ac.y - uv_ab.y * uv_ac.x;
    let sign = if area > 0.0 { 1.0 } else { -1.0 };
    let tangent = (ab * uv_ac.y - ac * uv_ab.y) * sign;
    let bitangent = (ac * uv_ab.x - ab * uv_ac.x) * sign;
    (area != 0.0).then(|| [to_world(tangent), to_world(bitangent)])
}
