//! glTF → [`Scene`].
//!
//! `mod` parses and drives, `buffers` reads bytes and accessors, `images` decodes, `materials`, `meshes` and `nodes`
//! convert. Every function checks what it uses: nothing after loading has to.

mod buffers;
mod images;
mod materials;
mod meshes;
mod nodes;

use std::path::Path;

use gltf::json;

use crate::error::SceneError;
use crate::types::Scene;

pub(crate) use images::{check_claim, image_limits};

/// Extensions that are honoured, whether or not the `gltf` crate knows them.
const HONOURED: [&str; 9] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_lights_area",
    // Says nothing that a picture shows.
    "KHR_xmp_json_ld",
];

/// What the conversion steps share.
struct Loader<'a> {
    path: &'a Path,
    document: &'a gltf::Document,
    buffers: Vec<Vec<u8>>,
    warnings: Vec<String>,
}

impl Loader<'_> {
    fn invalid(
        &self,
        place: impl Into<String>,
        problem: impl Into<String>,
        advice: impl Into<String>,
    ) -> SceneError {
        SceneError::invalid(self.path, place, problem, advice)
    }
}

impl Scene {
    /// Reads a `.glb` or `.gltf` file with everything it refers to.
    ///
    /// Domain: any file. Errors name the file, the place and the remedy; oddities that have an obvious reading
    /// become [`Scene::warnings`]. The file's default scene is read, else its first, else all root nodes.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let bytes = std::fs::read(path).map_err(|e| SceneError::read(path, e))?;
        Self::from_bytes(path, &bytes)
    }

    /// [`Scene::load`] of a file's content; `path` is for messages and for the files that it refers to.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self, SceneError> {
        let (document, blob) = parse(path, bytes)?;
        let buffers = buffers::load(path, &document, blob)?;
        let mut loader = Loader {
            path,
            document: &document,
            buffers,
            warnings: Vec::new(),
        };
        warn_of_extensions(&mut loader);
        let (materials, images) = materials::load(&mut loader)?;
        let mut scene = Self {
            source: path.to_owned(),
            materials,
            images,
            ..Self::default()
        };
        meshes::load(&mut loader, &mut scene)?;
        nodes::load(&mut loader, &mut scene)?;
        scene.warnings = loader
            .warnings
            .into_iter()
            .map(|w| format!("{}: {w}", path.display()))
            .collect();
        Ok(scene)
    }
}

/// The validated document and the binary chunk of a `.glb`.
fn parse(path: &Path, bytes: &[u8]) -> Result<(gltf::Document, Option<Vec<u8>>), SceneError> {
    let damaged = "export it again (the file is damaged or no glTF 2.0)";
    let (text, blob) = if bytes.starts_with(b"glTF") {
        check_glb_length(path, bytes, damaged)?;
        let glb = gltf::Glb::from_slice(bytes).map_err(|e| {
            SceneError::invalid(
                path,
                "GLB container",
                format!("cannot be read ({e}); it has {} bytes", bytes.len()),
                damaged,
            )
        })?;
        (glb.json, glb.bin.map(std::borrow::Cow::into_owned))
    } else {
        (std::borrow::Cow::Borrowed(bytes), None)
    };
    let mut root: json::Root = json::deserialize::from_slice(&text).map_err(|e| {
        SceneError::invalid(
            path,
            format!("JSON, line {} column {}", e.line(), e.column()),
            e.to_string(),
            damaged,
        )
    })?;
    // The crate refuses extensions that it does not know; these we read ourselves.
    root.extensions_required
        .retain(|name| !HONOURED.contains(&name.as_str()));
    let unknown: Vec<&str> = root
        .extensions_required
        .iter()
        .map(String::as_str)
        .filter(|name| !json::extensions::ENABLED_EXTENSIONS.contains(name))
        .collect();
    if !unknown.is_empty() {
        return Err(SceneError::invalid(
            path,
            "extensionsRequired",
            format!("needs {}, which is not supported", unknown.join(", ")),
            "export without it (no mesh or texture compression)",
        ));
    }
    check_attribute_accessors(path, &root)?;
    check_cameras(path, &root)?;
    let document = gltf::Document::from_json(root).map_err(|e| match e {
        gltf::Error::Validation(list) => {
            let first = list.first().map_or_else(String::new, |(place, problem)| {
                format!("{place}: {problem}")
            });
            SceneError::invalid(
                path,
                "glTF structure",
                format!("{first} ({} such findings)", list.len()),
                damaged,
            )
        }
        other => SceneError::invalid(path, "glTF structure", other.to_string(), damaged),
    })?;
    Ok((document, blob))
}

/// Checks the length in the header of a `.glb`, from which the `gltf` crate (1.4.1) takes that of the header without a look.
fn check_glb_length(path: &Path, bytes: &[u8], advice: &str) -> Result<(), SceneError> {
    /// Magic, version, length.
    const HEADER: u32 = 12;
    let length = bytes.get(8..12).and_then(|word| word.try_into().ok());
    match length.map(u32::from_le_bytes) {
        // What is cut off before it is told by the crate.
        None => Ok(()),
        Some(length) if length >= HEADER => Ok(()),
        Some(length) => Err(SceneError::invalid(
            path,
            "GLB container",
            format!("claims a length of {length} bytes, less than its own header's {HEADER}"),
            advice,
        )),
    }
}

/// Checks the one index that the `gltf` crate uses before it validates it (1.4.1: a primitive's POSITION accessor,
/// whose bounds it looks up).
fn check_attribute_accessors(path: &Path, root: &json::Root) -> Result<(), SceneError> {
    for (i, mesh) in root.meshes.iter().enumerate() {
        for (j, primitive) in mesh.primitives.iter().enumerate() {
            for accessor in primitive.attributes.values() {
                if accessor.value() >= root.accessors.len() {
                    return Err(SceneError::invalid(
                        path,
                        format!("mesh {} primitive {j}", label(mesh.name.as_deref(), i)),
                        format!(
                            "accessor {} does not exist ({} accessors)",
                            accessor.value(),
                            root.accessors.len()
                        ),
                        "export the file again",
                    ));
                }
            }
        }
    }
    Ok(())
}

/// Checks that a camera has the object that its type calls for, which the `gltf` crate (1.4.1) takes for granted.
fn check_cameras(path: &Path, root: &json::Root) -> Result<(), SceneError> {
    use json::camera::Type;
    use json::validation::Checked::Valid;
    for (i, camera) in root.cameras.iter().enumerate() {
        let there = match camera.type_ {
            Valid(Type::Perspective) => camera.perspective.is_some(),
            Valid(Type::Orthographic) => camera.orthographic.is_some(),
            _ => true,
        };
        if !there {
            return Err(SceneError::invalid(
                path,
                format!("camera {}", label(camera.name.as_deref(), i)),
                "has no parameters for its type",
                "export the file again",
            ));
        }
    }
    Ok(())
}

fn warn_of_extensions(loader: &mut Loader) {
    for name in loader.document.extensions_used() {
        if !HONOURED.contains(&name) {
            loader
                .warnings
                .push(format!("extension {name} is not honoured"));
        }
    }
    if loader.document.animations().len() > 0 {
        loader
            .warnings
            .push("animations are not played: the rest pose is used".to_owned());
    }
    if loader.document.skins().len() > 0 {
        loader
            .warnings
            .push("skins are not applied: meshes stay as modelled".to_owned());
    }
}

/// `'name'` or `number N`, for messages.
fn label(name: Option<&str>, index: usize) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("'{name}'"),
        _ => format!("number {index}"),
    }
}

/// The name, or `kind N`.
fn name_or(name: Option<&str>, kind: &str, index: usize) -> String {
    match name {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("{kind} {index}"),
    }
}
