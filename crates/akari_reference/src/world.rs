//! The scene in one frame, ready for rays: world-space triangles about a common origin, and what shading needs.

use akari_scene::{AlphaMode, AreaLightShape, Material, Primitive, Scene};
use glam::{DVec3, Vec2, Vec3, Vec4};

use crate::emitter_grid;
use crate::ray_scene::{Cwbvh, Hit, Ray, RayScene, offset_for};
use crate::sampler::hash_unit;

/// Triangles that stand for a disk of `EXT_lights_area`. The polygon has the disk's area, so its flux is exact.
const DISK_SEGMENTS: u32 = 128;

/// One primitive of one instance.
pub(crate) struct Part<'a> {
    pub(crate) primitive: &'a Primitive,
    pub(crate) material: &'a Material,
    /// World-space unit normals per vertex.
    normals: Vec<Vec3>,
    /// World-space tangents per vertex; may be empty.
    tangents: Vec<Vec4>,
    /// The instance mirrors: the second and third vertex of each triangle are exchanged.
    mirrored: bool,
    /// Alpha has to be looked up at hits.
    cut: bool,
}

/// An emitting triangle, of the scene or of an area light.
#[derive(Clone, Copy)]
pub(crate) struct Emitter {
    pub(crate) vertices: [Vec3; 3],
    /// Unit geometric normal, the emitting side.
    pub(crate) normal: Vec3,
    pub(crate) double_sided: bool,
    /// Largest channel mean of the radiance, for choosing lights.
    pub(crate) strength: f32,
    /// Where the radiance comes from.
    pub(crate) source: EmitterSource,
}

#[derive(Clone, Copy)]
pub(crate) enum EmitterSource {
    /// A triangle of the scene, or the part of it between these barycentric `(u, v)`.
    Triangle { triangle: u32, corners: [Vec2; 3] },
    /// A light without a surface, of this radiance.
    Unseen(Vec3),
}

/// Interpolated vertex data at a hit.
pub(crate) struct Vertex {
    pub(crate) position: Vec3,
    pub(crate) geometric_normal: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) tangent: Option<Vec4>,
    pub(crate) offset: f32,
}

/// The flattened scene.
pub(crate) struct World<'a> {
    pub(crate) scene: &'a Scene,
    /// World position of the computation's origin: the centre of the scene, so that `f32` serves it best.
    pub(crate) origin: DVec3,
    pub(crate) parts: Vec<Part<'a>>,
    pub(crate) triangles: Vec<[Vec3; 3]>,
    /// Part and triangle in its primitive.
    owners: Vec<(u32, u32)>,
    pub(crate) bvh: Cwbvh,
    pub(crate) emitters: Vec<Emitter>,
    /// First emitter of each triangle, or `u32::MAX`.
    emitter_of: Vec<u32>,
    /// A textured emissive triangle is cut into the square of this many emitters.
    cuts: u32,
    /// Some hits need a look at alpha.
    any_cut: bool,
    /// Some surface is stochastic.
    pub(crate) any_blend: bool,
}

impl<'a> World<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Self {
        let origin = scene.bounds().map_or(DVec3::ZERO, |b| b.center());
        let mut world = Self {
            scene,
            origin,
            parts: Vec::new(),
            triangles: Vec::new(),
            owners: Vec::new(),
            bvh: Cwbvh::build(&[]),
            emitters: Vec::new(),
            emitter_of: Vec::new(),
            cuts: cuts_for(scene),
            any_cut: false,
            any_blend: false,
        };
        for instance in &scene.instances {
            let m = instance.world_from_local;
            let mirrored = m.matrix3.determinant() < 0.0;
            // The cofactor matrix turns normals also under mirroring and non-uniform scale.
            let normal_matrix = m.matrix3.inverse().transpose();
            for primitive in &scene.meshes[instance.mesh].primitives {
                let material = &scene.materials[primitive.material];
                let cut = !matches!(material.alpha_mode, AlphaMode::Opaque);
                let normals = primitive
                    .normals
                    .iter()
                    .map(|n| {
                        (normal_matrix * n.as_dvec3())
                            .normalize_or(DVec3::Y)
                            .as_vec3()
                    })
                    .collect();
                let tangents = primitive
                    .tangents
                    .iter()
                    .map(|t| {
                        let w = if mirrored { -t.w } else { t.w };
                        (m.matrix3 * t.truncate().as_dvec3())
                            .normalize_or(DVec3::X)
                            .as_vec3()
                            .extend(w)
                    })
                    .collect();
                let part = world.parts.len() as u32;
                world.parts.push(Part {
                    primitive,
                    material,
                    normals,
                    tangents,
                    mirrored,
                    cut,
                });
                world.any_cut |= cut;
                world.any_blend |= material.alpha_mode == AlphaMode::Blend;
                let positions: Vec<Vec3> = primitive
                    .positions
                    .iter()
                    .map(|p| (m.transform_point3(p.as_dvec3()) - origin).as_vec3())
                    .collect();
                for (k, t) in primitive.indices.chunks_exact(3).enumerate() {
                    let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
                    let triangle = if mirrored { [a, c, b] } else { [a, b, c] };
                    world.add_triangle(triangle, part, k as u32);
                }
            }
        }
        world.add_area_lights();
        world.bvh = Cwbvh::build(&world.triangles);
        world
    }

    fn add_triangle(&mut self, vertices: [Vec3; 3], part: u32, k: u32) {
        // Far from the origin, f32 may have collapsed it.
        let Some(normal) = unit_normal(&vertices) else {
            return;
        };
        let index = self.triangles.len() as u32;
        self.triangles.push(vertices);
        self.owners.push((part, k));
        self.emitter_of.push(u32::MAX);
        let material = self.parts[part as usize].material;
        if !material.is_emissive() {
            return;
        }
        let textured = material.emissive_texture.is_some();
        self.emitter_of[index as usize] = self.emitters.len() as u32;
        let [a, b, c] = vertices;
        for corners in emitter_grid::cells(if textured { self.cuts } else { 1 }) {
            self.emitters.push(Emitter {
                vertices: corners.map(|w| a + (b - a) * w.x + (c - a) * w.y),
                normal,
                double_sided: material.double_sided,
                strength: self.mean_emission(index, corners).element_sum(),
                source: EmitterSource::Triangle {
                    triangle: index,
                    corners,
                },
            });
        }
    }

    /// The emitter at a place of a triangle.
    pub(crate) fn emitter_at(&self, triangle: u32, u: f32, v: f32) -> Option<u32> {
        let first = self.emitter_of[triangle as usize];
        if first == u32::MAX {
            return None;
        }
        let textured = self.owner(triangle).0.material.emissive_texture.is_some();
        Some(if textured {
            first + emitter_grid::cell_of(self.cuts, u, v)
        } else {
            first
        })
    }

    fn add_area_lights(&mut self) {
        for light in &self.scene.area_lights {
            let at = |x: f32, y: f32| {
                let p = DVec3::new(x.into(), y.into(), 0.0);
                (light.world_from_local.transform_point3(p) - self.origin).as_vec3()
            };
            // Clockwise in local XY: the light shines along −Z.
            let outline: Vec<Vec3> = match light.shape {
                AreaLightShape::Rect { width, height } => {
                    let (x, y) = (0.5 * width, 0.5 * height);
                    vec![at(-x, -y), at(-x, y), at(x, y), at(x, -y)]
                }
                AreaLightShape::Disk { diameter } => {
                    let step = std::f32::consts::TAU / DISK_SEGMENTS as f32;
                    let radius = 0.5 * diameter * (step / step.sin()).sqrt();
                    (0..DISK_SEGMENTS)
                        .map(|i| {
                            let (s, c) = (i as f32 * step).sin_cos();
                            at(radius * c, -radius * s)
                        })
                        .collect()
                }
            };
            for i in 1..outline.len() - 1 {
                let vertices = [outline[0], outline[i], outline[i + 1]];
                if let Some(normal) = unit_normal(&vertices) {
                    self.emitters.push(Emitter {
                        vertices,
                        normal,
                        double_sided: false,
                        strength: light.radiance.element_sum(),
                        source: EmitterSource::Unseen(light.radiance),
                    });
                }
            }
        }
    }

    /// Radiance averaged over a part of a triangle: for choosing lights only, so a coarse average will do, but it
    /// must not miss a lit texel altogether: the floor keeps every emitter possible.
    fn mean_emission(&self, triangle: u32, [a, b, c]: [Vec2; 3]) -> Vec3 {
        const STEPS: u32 = 4;
        const FLOOR: f32 = 0.01;
        let (part, _) = self.owner(triangle);
        let material = part.material;
        if material.emissive_texture.is_none() {
            return material.emission;
        }
        let mut sum = Vec3::ZERO;
        let mut count = 0.0;
        for i in 0..STEPS {
            for j in 0..STEPS - i {
                let u = (i as f32 + 1.0 / 3.0) / STEPS as f32;
                let v = (j as f32 + 1.0 / 3.0) / STEPS as f32;
                let at = a + (b - a) * u + (c - a) * v;
                sum += self.emission(triangle, at.x, at.y);
                count += 1.0;
            }
        }
        (sum / count).max(FLOOR * material.emission)
    }

    pub(crate) fn owner(&self, triangle: u32) -> (&Part<'a>, u32) {
        let (part, k) = self.owners[triangle as usize];
        (&self.parts[part as usize], k)
    }

    /// Vertex indices of a triangle in its primitive, in world winding.
    fn corners(part: &Part, k: u32) -> [usize; 3] {
        let i = 3 * k as usize;
        let t = &part.primitive.indices[i..i + 3];
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| i as usize);
        if part.mirrored { [a, c, b] } else { [a, b, c] }
    }

    /// Texture coordinates at barycentric `u`, `v`.
    pub(crate) fn uv(&self, triangle: u32, set: usize, u: f32, v: f32) -> Vec2 {
        let (part, k) = self.owner(triangle);
        let uvs = &part.primitive.uvs[set];
        if uvs.is_empty() {
            return Vec2::ZERO;
        }
        let [a, b, c] = Self::corners(part, k).map(|i| uvs[i]);
        a * (1.0 - u - v) + b * u + c * v
    }

    /// A texture of a surface at barycentric `u`, `v`; 1 without one.
    pub(crate) fn texture(
        &self,
        triangle: u32,
        texture: Option<&akari_scene::Texture>,
        u: f32,
        v: f32,
    ) -> Vec4 {
        texture.map_or(Vec4::ONE, |t| {
            t.sample(&self.scene.images, self.uv(triangle, t.tex_coord, u, v))
        })
    }

    /// Linear RGBA base colour.
    pub(crate) fn base_color(&self, triangle: u32, u: f32, v: f32) -> Vec4 {
        let (part, k) = self.owner(triangle);
        let material = part.material;
        let mut color = material.base_color
            * self.texture(triangle, material.base_color_texture.as_ref(), u, v);
        let colors = &part.primitive.colors;
        if !colors.is_empty() {
            let [a, b, c] = Self::corners(part, k).map(|i| colors[i]);
            color *= a * (1.0 - u - v) + b * u + c * v;
        }
        color
    }

    /// Radiance that a triangle emits from its front.
    pub(crate) fn emission(&self, triangle: u32, u: f32, v: f32) -> Vec3 {
        let material = self.owner(triangle).0.material;
        match &material.emissive_texture {
            None => material.emission,
            Some(t) => material.emission * self.texture(triangle, Some(t), u, v).truncate(),
        }
    }

    /// Everything that is interpolated at a hit.
    pub(crate) fn vertex(&self, hit: &Hit) -> Vertex {
        let vertices = &self.triangles[hit.triangle as usize];
        let [a, b, c] = *vertices;
        let w = 1.0 - hit.u - hit.v;
        let geometric_normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let (part, k) = self.owner(hit.triangle);
        let corners = Self::corners(part, k);
        let [na, nb, nc] = corners.map(|i| part.normals[i]);
        let normal = (na * w + nb * hit.u + nc * hit.v).normalize_or(geometric_normal);
        let tangent = (!part.tangents.is_empty()).then(|| {
            let [ta, tb, tc] = corners.map(|i| part.tangents[i]);
            (ta.truncate() * w + tb.truncate() * hit.u + tc.truncate() * hit.v).extend(ta.w)
        });
        Vertex {
            position: a * w + b * hit.u + c * hit.v,
            geometric_normal,
            normal,
            tangent,
            offset: offset_for(vertices),
        }
    }

    /// Whether the surface is there: alpha cutoff, or chance by coverage, the same for the same `seed`.
    #[inline]
    pub(crate) fn covers(&self, hit: &Hit, seed: u32) -> bool {
        if !self.any_cut {
            return true;
        }
        let (part, _) = self.owner(hit.triangle);
        if !part.cut {
            return true;
        }
        let alpha = self.base_color(hit.triangle, hit.u, hit.v).w;
        match part.material.alpha_mode {
            AlphaMode::Opaque => true,
            AlphaMode::Mask { cutoff } => alpha >= cutoff,
            AlphaMode::Blend => hash_unit(seed, hit.triangle) < alpha,
        }
    }

    /// Nearest surface on a path.
    pub(crate) fn closest(&self, ray: &Ray, seed: u32) -> Option<Hit> {
        self.bvh.closest(ray, |hit| self.covers(hit, seed))
    }

    /// Nearest surface that the camera sees: backs of one-sided materials are culled.
    pub(crate) fn closest_seen(&self, ray: &Ray, seed: u32) -> Option<Hit> {
        self.bvh.closest(ray, |hit| {
            let (part, _) = self.owner(hit.triangle);
            if !part.material.double_sided {
                let [a, b, c] = self.triangles[hit.triangle as usize];
                if (b - a).cross(c - a).dot(ray.direction) >= 0.0 {
                    return false;
                }
            }
            self.covers(hit, seed)
        })
    }

    /// Whether anything but the triangle `target` (`u32::MAX`: anything) blocks the ray.
    pub(crate) fn occluded(&self, ray: &Ray, seed: u32, target: u32) -> bool {
        self.bvh
            .occluded(ray, |hit| hit.triangle != target && self.covers(hit, seed))
    }
}

/// How finely to cut textured emitters: 16² pieces each, fewer where there are many, about 65,000 in all.
fn cuts_for(scene: &Scene) -> u32 {
    const MOST: u32 = 16;
    const BUDGET: f64 = 65_536.0;
    let textured: usize = scene
        .instances
        .iter()
        .flat_map(|i| &scene.meshes[i.mesh].primitives)
        .filter(|p| {
            let material = &scene.materials[p.material];
            material.is_emissive() && material.emissive_texture.is_some()
        })
        .map(|p| p.indices.len() / 3)
        .sum();
    ((BUDGET / textured.max(1) as f64).sqrt() as u32).clamp(1, MOST)
}

/// Unit normal of a triangle; none if it has no area in `f32`.
pub(crate) fn unit_normal(&[a, b, c]: &[Vec3; 3]) -> Option<Vec3> {
    (b - a)
        .as_dvec3()
        .cross((c - a).as_dvec3())
        .try_normalize()
        .map(|n| n.as_vec3())
}
