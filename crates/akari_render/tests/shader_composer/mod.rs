//! Composes shaders as Bevy's pipeline cache does, with Bevy's own modules, and validates them. Needs no GPU: Bevy runs
//! without a renderer, and its shader cache is given naga alone.
//!
//! Included by the test `shaders` of every crate with passes of its own.

use bevy::asset::AssetId;
use bevy::asset::uuid::Uuid;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::DownlevelFlags;
use bevy::render::settings::{WgpuFeatures, WgpuSettings};
use bevy::shader::{
    Shader, ShaderCache, ShaderCacheError, ShaderCacheSource, ShaderDefVal, ShaderImport,
    ValidateShader,
};
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A shader with an entry point.
pub struct Entry {
    /// Name of the file in the crate's `src`.
    pub file: &'static str,
    /// Its text.
    pub source: &'static str,
    /// The function that a pipeline runs.
    pub entry_point: &'static str,
    /// Every set of definitions that a pipeline asks for: names, or `NAME=number`.
    pub definitions: Vec<Vec<&'static str>>,
}

/// All ways to take one choice of each list: the definitions of parts that do not know of one another.
pub fn choices(parts: &[&[&[&'static str]]]) -> Vec<Vec<&'static str>> {
    parts.iter().fold(vec![Vec::new()], |sets, part| {
        sets.iter()
            .flat_map(|set| part.iter().map(move |more| [set.as_slice(), more].concat()))
            .collect()
    })
}

/// Bevy's fullscreen triangle: embedded by its plugin, but loaded only with a renderer.
const FULLSCREEN: &str = "embedded://bevy_core_pipeline/fullscreen_vertex_shader/fullscreen.wgsl";

/// How long the embedded shaders may take to load.
const PATIENCE: Duration = Duration::from_secs(60);

/// The modules of Bevy, of `akari_math` and of the crate at hand, with the shaders that were composed so far.
pub struct Composer {
    cache: ShaderCache<naga::Module, ()>,
    /// Shaders so far. Each gets an id of its own, since the cache keeps what it composed by id and definitions.
    shaders: usize,
}

/// What the renderer would compile, validated.
fn validated(
    _: &(),
    source: ShaderCacheSource,
    _: &ValidateShader,
) -> Result<naga::Module, ShaderCacheError> {
    let ShaderCacheSource::Naga(module) = source else {
        return Err(ShaderCacheError::CreateShaderModule(
            "not composed by naga".to_owned(),
        ));
    };
    naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::default(),
    )
    .validate(&module)
    .map_err(|error| ShaderCacheError::CreateShaderModule(format!("{error:?}")))?;
    Ok(module)
}

/// All shaders that Bevy's plugins and ours register, with `libraries`, once they hold all that `wanted` asks for.
fn library(libraries: &[(&'static str, &'static str)], wanted: &[&Entry]) -> Vec<Shader> {
    let mut app = App::new();
    let no_renderer = RenderPlugin {
        render_creation: WgpuSettings {
            backends: None,
            ..default()
        }
        .into(),
        ..default()
    };
    app.add_plugins(
        DefaultPlugins
            .build()
            .disable::<LogPlugin>()
            .set(no_renderer),
    );
    akari_render::ensure_render_plugin(&mut app);
    let fullscreen: Handle<Shader> = app.world().resource::<AssetServer>().load(FULLSCREEN);
    app.finish();
    app.cleanup();

    let start = Instant::now();
    loop {
        app.update();
        let mut shaders: Vec<Shader> = libraries
            .iter()
            .map(|(file, source)| Shader::from_wgsl(*source, *file))
            .collect();
        let ours: Vec<ShaderImport> = shaders.iter().map(|s| s.import_path.clone()).collect();
        // A module that a plugin registers, too, is the one at hand, whenever the other one has loaded.
        let others = (app.world().resource::<Assets<Shader>>().iter())
            .map(|(_, shader)| shader)
            .filter(|shader| !ours.contains(&shader.import_path));
        shaders.extend(others.cloned());
        let imports = wanted
            .iter()
            .flat_map(|entry| Shader::from_wgsl(entry.source, entry.file).imports);
        let missing = unresolved(&shaders, imports);
        if missing.is_empty() {
            drop(fullscreen);
            return shaders;
        }
        assert!(
            start.elapsed() < PATIENCE,
            "shaders that nothing provides: {missing:?}"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The imports, followed from `wanted`, that none of `shaders` provides.
fn unresolved(shaders: &[Shader], wanted: impl Iterator<Item = ShaderImport>) -> Vec<String> {
    let by_import: HashMap<String, &Shader> = shaders
        .iter()
        .map(|shader| (shader.import_path.module_name().into_owned(), shader))
        .collect();
    let mut open: Vec<String> = wanted
        .map(|import| import.module_name().into_owned())
        .collect();
    let (mut seen, mut missing) = (BTreeSet::new(), Vec::new());
    while let Some(name) = open.pop() {
        if !seen.insert(name.clone()) {
            continue;
        }
        match by_import.get(&name) {
            Some(shader) => open.extend(
                shader
                    .imports
                    .iter()
                    .map(|import| import.module_name().into_owned()),
            ),
            None => missing.push(name),
        }
    }
    missing
}

impl Composer {
    /// With the modules `(file, source)` of this crate, ready to compose `entries`.
    pub fn new(libraries: &[(&'static str, &'static str)], entries: &[&Entry]) -> Self {
        let mut composer = Self {
            cache: ShaderCache::new((), WgpuFeatures::empty(), DownlevelFlags::all(), validated),
            shaders: 0,
        };
        for shader in library(libraries, entries) {
            composer.add(shader);
        }
        composer
    }

    fn add(&mut self, shader: Shader) -> AssetId<Shader> {
        self.shaders += 1;
        let id = AssetId::Uuid {
            uuid: Uuid::from_u128(self.shaders as u128),
        };
        self.cache.set_shader(id, shader);
        id
    }

    /// A shader under one set of definitions.
    pub fn compose(
        &mut self,
        file: &str,
        source: String,
        definitions: &[&str],
    ) -> Result<Arc<naga::Module>, String> {
        let path = format!("{}_{file}", self.shaders);
        let id = self.add(Shader::from_wgsl(source, path));
        self.get(id, definitions)
    }

    fn get(
        &mut self,
        id: AssetId<Shader>,
        definitions: &[&str],
    ) -> Result<Arc<naga::Module>, String> {
        let definition = |text: &&str| match text.split_once('=') {
            Some((name, value)) => {
                let value = value.parse().map_err(|_| format!("{text}: no number"))?;
                Ok(ShaderDefVal::UInt(name.to_owned(), value))
            }
            None => Ok((*text).into()),
        };
        let definitions = definitions
            .iter()
            .map(definition)
            .collect::<Result<Vec<ShaderDefVal>, String>>()?;
        self.cache
            .get(self.shaders, id, &definitions)
            .map_err(|error| match error {
                ShaderCacheError::ProcessShaderError(error) => {
                    error.emit_to_string(&self.cache.composer)
                }
                other => other.to_string(),
            })
    }

    /// An entry under every set of definitions that a pipeline asks for; each must have the entry point.
    pub fn compose_all(&mut self, entry: &Entry) -> Result<Vec<Arc<naga::Module>>, String> {
        let Entry {
            file, entry_point, ..
        } = entry;
        let path = format!("{}_{file}", self.shaders);
        let id = self.add(Shader::from_wgsl(entry.source, path));
        let composed = entry.definitions.iter().map(|set| {
            let module = self
                .get(id, set)
                .map_err(|error| format!("{file} {set:?}: {error}"))?;
            if module
                .entry_points
                .iter()
                .all(|point| point.name != *entry_point)
            {
                return Err(format!("{file} {set:?}: no entry point {entry_point}"));
            }
            Ok(module)
        });
        composed.collect()
    }
}

/// What is wrong with the list of a crate's shaders: a file of its `src` that is not among them, one that is not there,
/// or a definition that they look at and no pipeline gives.
pub fn list_faults(
    source_folder: &Path,
    entries: &[&Entry],
    libraries: &[(&str, &str)],
) -> Vec<String> {
    let mut faults = Vec::new();
    let there = akari_gpu_test::wgsl_files(source_folder)
        .unwrap_or_else(|error| panic!("{}: {error}", source_folder.display()));
    let listed: BTreeSet<_> = entries
        .iter()
        .map(|entry| entry.file)
        .chain(libraries.iter().map(|(file, _)| *file))
        .map(|file| source_folder.join(file))
        .collect();
    for file in there.symmetric_difference(&listed) {
        faults.push(format!("{}: not there, or not listed", file.display()));
    }
    // Two pipelines may run functions of the same file, each under definitions of its own.
    let given_to = |file: Option<&str>| -> BTreeSet<&str> {
        entries
            .iter()
            .filter(|entry| file.is_none_or(|file| file == entry.file))
            .flat_map(|entry| entry.definitions.iter().flatten().copied())
            .collect()
    };
    let files = entries.iter().map(|entry| (entry.source, Some(entry.file)));
    let modules = libraries.iter().map(|(_, source)| (*source, None));
    for (source, file) in files.chain(modules) {
        let given = given_to(file);
        for name in akari_gpu_test::definitions_in(source).difference(&given) {
            faults.push(format!(
                "{}: no pipeline gives {name}",
                file.unwrap_or("a module")
            ));
        }
    }
    faults
}
