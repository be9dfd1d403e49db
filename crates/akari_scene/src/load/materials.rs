//! Materials and the images they use.

use std::collections::BTreeMap;

use glam::{Affine2, Vec2, Vec3, Vec4};
use gltf::json::Value;

use super::{Loader, images, label, name_or};
use crate::error::SceneError;
use crate::texture::{ColorSpace, Image, Texture};
use crate::types::{AlphaMode, Material};

/// Default cutoff of alpha mode MASK (glTF 2.0, `alphaCutoff`).
const DEFAULT_ALPHA_CUTOFF: f32 = 0.5;

/// Converts all materials; decodes the images that they use, each once.
pub(super) fn load(loader: &mut Loader) -> Result<(Vec<Material>, Vec<Image>), SceneError> {
    let mut materials = Vec::new();
    let mut pool = ImagePool::default();
    let document = loader.document;
    for material in document.materials() {
        let Some(index) = material.index() else {
            continue;
        };
        materials.push(convert(loader, &mut pool, &material, index)?);
    }
    Ok((materials, pool.images))
}

/// Decoded images by their index in the file.
#[derive(Default)]
struct ImagePool {
    images: Vec<Image>,
    by_source: BTreeMap<usize, usize>,
}

impl ImagePool {
    fn get(
        &mut self,
        loader: &Loader,
        image: &gltf::Image,
        place: &str,
    ) -> Result<usize, SceneError> {
        if let Some(&i) = self.by_source.get(&image.index()) {
            return Ok(i);
        }
        self.images.push(images::decode(loader, image, place)?);
        let i = self.images.len() - 1;
        self.by_source.insert(image.index(), i);
        Ok(i)
    }
}

/// What a texture slot says beside the texture.
struct Slot<'a> {
    texture: gltf::Texture<'a>,
    tex_coord: u32,
    transform: Affine2,
}

/// Texture uv from vertex uv: offset · rotation · scale, where a positive angle turns the *texture* against the
/// clock on an image whose v runs down (`KHR_texture_transform`).
fn affine(offset: [f32; 2], rotation: f32, scale: [f32; 2]) -> Affine2 {
    Affine2::from_scale_angle_translation(Vec2::from(scale), -rotation, Vec2::from(offset))
}

impl<'a> From<gltf::texture::Info<'a>> for Slot<'a> {
    fn from(info: gltf::texture::Info<'a>) -> Self {
        let transform = info.texture_transform();
        Self {
            tex_coord: transform
                .as_ref()
                .and_then(gltf::texture::TextureTransform::tex_coord)
                .unwrap_or(info.tex_coord()),
            transform: transform.map_or(Affine2::IDENTITY, |t| {
                affine(t.offset(), t.rotation(), t.scale())
            }),
            texture: info.texture(),
        }
    }
}

impl<'a> From<gltf::material::NormalTexture<'a>> for Slot<'a> {
    /// The `gltf` crate leaves this slot's transform as JSON.
    fn from(info: gltf::material::NormalTexture<'a>) -> Self {
        let transform = info.extension_value("KHR_texture_transform");
        Self::from_json(info.texture(), info.tex_coord(), transform)
    }
}

impl<'a> Slot<'a> {
    /// A slot whose `KHR_texture_transform` is still JSON.
    fn from_json(texture: gltf::Texture<'a>, tex_coord: u32, transform: Option<&Value>) -> Self {
        let number = |v: &Value| v.as_f64().map(|x| x as f32);
        let pair = |key: &str, default: f32| {
            let list = transform.and_then(|j| j.get(key)).and_then(Value::as_array);
            [0, 1].map(|k| {
                list.and_then(|l| l.get(k))
                    .and_then(number)
                    .unwrap_or(default)
            })
        };
        let rotation = transform
            .and_then(|j| j.get("rotation"))
            .and_then(number)
            .unwrap_or(0.0);
        let moved_tex_coord = transform
            .and_then(|j| j.get("texCoord"))
            .and_then(Value::as_u64)
            .and_then(|t| u32::try_from(t).ok());
        Self {
            tex_coord: moved_tex_coord.unwrap_or(tex_coord),
            transform: affine(pair("offset", 0.0), rotation, pair("scale", 1.0)),
            texture,
        }
    }

    /// The slot `key` of a material extension that is still JSON. Nothing where it is absent or names no texture.
    fn of_extension(
        document: &'a gltf::Document,
        extension: Option<&Value>,
        key: &str,
    ) -> Option<Self> {
        let info = extension?.get(key)?;
        let index = usize::try_from(info.get("index")?.as_u64()?).ok()?;
        let tex_coord = info.get("texCoord").and_then(Value::as_u64).unwrap_or(0);
        let transform = info
            .get("extensions")
            .and_then(|e| e.get("KHR_texture_transform"));
        Some(Self::from_json(
            document.textures().nth(index)?,
            u32::try_from(tex_coord).unwrap_or(0),
            transform,
        ))
    }
}

fn convert(
    loader: &mut Loader,
    pool: &mut ImagePool,
    material: &gltf::Material,
    index: usize,
) -> Result<Material, SceneError> {
    let place = format!("material {}", label(material.name(), index));
    let document = loader.document;
    let mut texture = |slot: Option<Slot>, use_name: &str, color_space: ColorSpace| {
        slot.map(|slot| convert_slot(loader, pool, slot, &place, use_name, color_space))
            .transpose()
    };
    let pbr = material.pbr_metallic_roughness();
    // Read as JSON: if the `gltf` crate parsed it, Bevy's loader, which shares that crate, would no longer see it.
    let specular = material.extension_value("KHR_materials_specular");
    let base_color_texture = texture(
        pbr.base_color_texture().map(Slot::from),
        "baseColorTexture",
        ColorSpace::Srgb,
    )?;
    let metallic_roughness_texture = texture(
        pbr.metallic_roughness_texture().map(Slot::from),
        "metallicRoughnessTexture",
        ColorSpace::Linear,
    )?;
    let normal_texture = texture(
        material.normal_texture().map(Slot::from),
        "normalTexture",
        ColorSpace::Linear,
    )?;
    let emissive_texture = texture(
        material.emissive_texture().map(Slot::from),
        "emissiveTexture",
        ColorSpace::Srgb,
    )?;
    let specular_texture = texture(
        Slot::of_extension(document, specular, "specularTexture"),
        "specularTexture",
        ColorSpace::Linear,
    )?;
    let specular_color_texture = texture(
        Slot::of_extension(document, specular, "specularColorTexture"),
        "specularColorTexture",
        ColorSpace::Srgb,
    )?;

    let strength = material.emissive_strength().unwrap_or(1.0);
    let emission = Vec3::from(material.emissive_factor()) * strength;
    if !emission.is_finite() || emission.min_element() < 0.0 || strength < 0.0 {
        return Err(loader.invalid(
            &place,
            format!(
                "its emission is {:?} (factor {:?}, strength {strength})",
                emission.to_array(),
                material.emissive_factor()
            ),
            "emission must be finite and not negative: correct emissiveFactor and emissiveStrength",
        ));
    }
    for (name, present) in [
        (
            "KHR_materials_transmission",
            material.transmission().is_some(),
        ),
        ("KHR_materials_volume", material.volume().is_some()),
    ] {
        if present {
            loader.warnings.push(format!(
                "{place}: {name} is not honoured, the surface is opaque"
            ));
        }
    }
    let mut within = |value: f32, low: f32, high: f32, what: &str| {
        // `clamp` keeps NaN, which JSON cannot hold; infinities end at a bound.
        let clamped = value.clamp(low, high);
        if clamped != value {
            loader.warnings.push(format!(
                "{place}: {what} {value} is outside of [{low}, {high}] and becomes {clamped}"
            ));
        }
        clamped
    };
    let base_color = Vec4::from(
        pbr.base_color_factor()
            .map(|c| within(c, 0.0, 1.0, "base colour")),
    );
    let metallic = within(pbr.metallic_factor(), 0.0, 1.0, "metallicFactor");
    let roughness = within(pbr.roughness_factor(), 0.0, 1.0, "roughnessFactor");
    let number = |v: &Value| v.as_f64().map(|x| x as f32);
    let specular_factor = specular
        .and_then(|s| s.get("specularFactor"))
        .and_then(number)
        .unwrap_or(1.0);
    let specular_factor = within(specular_factor, 0.0, 1.0, "specularFactor");
    let specular_color = [0, 1, 2]
        .map(|k| {
            specular
                .and_then(|s| s.get("specularColorFactor"))
                .and_then(|c| c.get(k))
                .and_then(number)
                .unwrap_or(1.0)
        })
        .map(|c| within(c, 0.0, 1e6, "specularColorFactor"));
    // 0 is the extension's special value for "no Fresnel"; below 1 there is no such dielectric.
    let ior = within(material.ior().unwrap_or(1.5), 1.0, 100.0, "ior");
    let normal_scale = material
        .normal_texture()
        .map_or(1.0, |t| within(t.scale(), -100.0, 100.0, "normal scale"));
    let alpha_mode = match material.alpha_mode() {
        gltf::material::AlphaMode::Opaque => AlphaMode::Opaque,
        gltf::material::AlphaMode::Mask => AlphaMode::Mask {
            cutoff: material.alpha_cutoff().unwrap_or(DEFAULT_ALPHA_CUTOFF),
        },
        gltf::material::AlphaMode::Blend => AlphaMode::Blend,
    };
    Ok(Material {
        name: name_or(material.name(), "material", index),
        base_color,
        base_color_texture,
        metallic,
        roughness,
        metallic_roughness_texture,
        normal_texture,
        normal_scale,
        emission,
        emissive_texture,
        specular: specular_factor,
        specular_texture,
        specular_color: Vec3::from(specular_color),
        specular_color_texture,
        ior,
        unlit: material.unlit(),
        alpha_mode,
        double_sided: material.double_sided(),
    })
}

fn convert_slot(
    loader: &Loader,
    pool: &mut ImagePool,
    slot: Slot,
    place: &str,
    use_name: &str,
    color_space: ColorSpace,
) -> Result<Texture, SceneError> {
    let place = format!(
        "{place}: {use_name} (texture {})",
        label(slot.texture.name(), slot.texture.index())
    );
    if slot.tex_coord > 1 {
        return Err(loader.invalid(
            place,
            format!(
                "uses TEXCOORD_{}, and only 0 and 1 are read",
                slot.tex_coord
            ),
            "move its coordinates to TEXCOORD_0 or 1",
        ));
    }
    if !slot.transform.is_finite() {
        return Err(loader.invalid(
            place,
            "its KHR_texture_transform is not finite",
            "correct offset, rotation and scale",
        ));
    }
    let image = pool.get(loader, &slot.texture.source(), &place)?;
    let sampler = slot.texture.sampler();
    Ok(Texture {
        image,
        color_space,
        tex_coord: slot.tex_coord as usize,
        transform: slot.transform,
        wrap_u: images::wrap(sampler.wrap_s()),
        wrap_v: images::wrap(sampler.wrap_t()),
        filter: images::filter(sampler.mag_filter()),
    })
}
