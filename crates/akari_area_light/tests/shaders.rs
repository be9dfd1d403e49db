//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! constants and layouts. Needs no GPU: Bevy runs without a renderer, and its shader cache is given naga alone.

use akari_area_light::types::{
    COUNTER_NAMES, CULL_WORKGROUP, FLAG_TWO_SIDED, GpuAreaLight, GpuAreaLightView, LIGHTS_PER_WORD,
    NO_TEXTURE, TILE_SIZE,
};
use bevy::asset::AssetId;
use bevy::asset::uuid::Uuid;
use bevy::log::LogPlugin;
use bevy::math::{Vec3, Vec4};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::{DownlevelFlags, ShaderType};
use bevy::render::settings::{WgpuFeatures, WgpuSettings};
use bevy::shader::{
    Shader, ShaderCache, ShaderCacheError, ShaderCacheSource, ShaderDefVal, ShaderImport,
    ValidateShader,
};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A shader with an entry point.
struct Entry {
    file: &'static str,
    source: &'static str,
    entry_point: &'static str,
    /// Every set of definitions that a pipeline asks for.
    definitions: &'static [&'static [&'static str]],
}

const ENTRIES: &[Entry] = &[
    Entry {
        file: "cull.wgsl",
        source: include_str!("../src/cull.wgsl"),
        entry_point: "cull",
        definitions: &[&[]],
    },
    Entry {
        file: "shade.wgsl",
        source: include_str!("../src/shade.wgsl"),
        entry_point: "fragment",
        definitions: &[&[], &["TEXTURED"]],
    },
    Entry {
        file: "prefilter.wgsl",
        source: include_str!("../src/prefilter.wgsl"),
        entry_point: "prefilter",
        definitions: &[&["RESAMPLE"], &["DOWNSAMPLE"], &["CONVOLVE"]],
    },
    Entry {
        file: "capture.wgsl",
        source: include_str!("../../akari_render/src/capture.wgsl"),
        entry_point: "capture",
        definitions: &[&[]],
    },
];

/// Those of the files above and below that stand in `akari_render`, since other passes share them.
const SHARED: [&str; 2] = ["capture.wgsl", "gbuffer.wgsl"];

const TYPES: &str = include_str!("../src/types.wgsl");

/// Modules of this crate that the entry shaders import.
const LIBRARIES: &[(&str, &str)] = &[
    ("types.wgsl", TYPES),
    (
        "gbuffer.wgsl",
        include_str!("../../akari_render/src/gbuffer.wgsl"),
    ),
];

/// Bevy's fullscreen triangle: embedded by its plugin, but loaded only with a renderer.
const FULLSCREEN: &str = "embedded://bevy_core_pipeline/fullscreen_vertex_shader/fullscreen.wgsl";

/// How long the embedded shaders may take to load.
const PATIENCE: Duration = Duration::from_secs(60);

/// The modules of Bevy, of `akari_math` and of this crate, with the entry shaders that are asked for.
struct Composer {
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

/// All shaders that Bevy's plugins and ours register, by what imports them.
fn library() -> Vec<Shader> {
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

    let ours = || {
        let libraries = LIBRARIES.iter().copied();
        libraries.chain(ENTRIES.iter().map(|entry| (entry.file, entry.source)))
    };
    let start = Instant::now();
    loop {
        app.update();
        let mut shaders: Vec<Shader> = app
            .world()
            .resource::<Assets<Shader>>()
            .iter()
            .map(|(_, shader)| shader.clone())
            .collect();
        shaders.extend(
            LIBRARIES
                .iter()
                .map(|(file, source)| Shader::from_wgsl(*source, *file)),
        );
        let wanted = ours().flat_map(|(file, source)| Shader::from_wgsl(source, file).imports);
        let missing = unresolved(&shaders, wanted);
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
    fn new() -> Self {
        let mut composer = Self {
            cache: ShaderCache::new((), WgpuFeatures::empty(), DownlevelFlags::all(), validated),
            shaders: 0,
        };
        for shader in library() {
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

    fn compose(
        &mut self,
        file: &str,
        source: String,
        definitions: &[&str],
    ) -> Result<Arc<naga::Module>, String> {
        let path = format!("{}_{file}", self.shaders);
        let id = self.add(Shader::from_wgsl(source, path));
        let definitions: Vec<ShaderDefVal> = definitions.iter().map(|&name| name.into()).collect();
        let module = self.cache.get(self.shaders, id, &definitions);
        module.map_err(|error| error.to_string())
    }
}

#[test]
fn every_shader_is_valid_for_every_set_of_definitions() {
    let mut composer = Composer::new();
    for entry in ENTRIES {
        for definitions in entry.definitions {
            let module = composer
                .compose(entry.file, entry.source.to_owned(), definitions)
                .unwrap_or_else(|error| panic!("{} {definitions:?}: {error}", entry.file));
            let names: Vec<&str> = module
                .entry_points
                .iter()
                .map(|point| point.name.as_str())
                .collect();
            assert!(
                names.contains(&entry.entry_point),
                "{} {definitions:?}: {names:?}",
                entry.file
            );
        }
    }
}

/// What is wrong under one set of definitions only, is found under that one.
#[test]
fn wrong_shaders_are_noticed() {
    let mut composer = Composer::new();
    let shade = &ENTRIES[1];
    let changed = |from: &str, to: &str| {
        assert!(shade.source.contains(from), "nothing to change: {from}");
        shade.source.replacen(from, to, 1)
    };
    let wrong_everywhere = changed(
        "return vec4(radiance * view.exposure, 0.0);",
        "return radiance * view.exposure;",
    );
    assert!(composer.compose("a.wgsl", wrong_everywhere, &[]).is_err());
    let wrong_name = changed(
        "#import akari_math::frame::shading_frame",
        "#import akari_math::frame::no_such_frame",
    );
    assert!(composer.compose("b.wgsl", wrong_name, &[]).is_err());
    let wrong_module = changed("bevy_render::view::View", "bevy_render::no_such_view::View");
    assert!(composer.compose("c.wgsl", wrong_module, &[]).is_err());
    let wrong_textured = changed("footprint.spread != 0u", "footprint.spread != 0.5");
    assert!(
        composer
            .compose("d.wgsl", wrong_textured.clone(), &[])
            .is_ok()
    );
    assert!(
        composer
            .compose("d.wgsl", wrong_textured, &["TEXTURED"])
            .is_err()
    );
}

/// Names of the definitions that the preprocessor looks at.
fn definitions_in(source: &str) -> BTreeSet<&str> {
    source
        .lines()
        .filter_map(|line| {
            let directive = line.trim().strip_prefix('#')?;
            let directive = directive.strip_prefix("else ").unwrap_or(directive);
            let condition = ["ifdef ", "ifndef ", "if "]
                .iter()
                .find_map(|word| directive.strip_prefix(word))?;
            condition.split_whitespace().next()
        })
        .collect()
}

#[test]
fn every_definition_is_tried() {
    for entry in ENTRIES {
        let tried: BTreeSet<&str> = entry
            .definitions
            .iter()
            .flat_map(|set| set.iter().copied())
            .collect();
        let used = definitions_in(entry.source);
        assert!(
            used.is_subset(&tried),
            "{}: uses {used:?}, tried {tried:?}",
            entry.file
        );
    }
    for (file, source) in LIBRARIES {
        assert_eq!(
            definitions_in(source),
            BTreeSet::new(),
            "{file}: a library that reads definitions"
        );
    }
    assert_eq!(
        definitions_in("#ifdef A\n #else ifdef B\n#ifndef C\n#if D == 1\n#endif\nlet a = b;"),
        BTreeSet::from(["A", "B", "C", "D"])
    );
}

fn wgsl_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries =
        std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    for path in entries.map(|entry| entry.expect("entry of a folder").path()) {
        if path.is_dir() {
            wgsl_files(&path, found);
        } else if path
            .extension()
            .is_some_and(|extension| extension == "wgsl")
        {
            found.push(path);
        }
    }
}

/// No WGSL file of the workspace is left out: it is one of the above, or a module of `akari_math`, whose own tests
/// validate each of them (no definitions, no entry points).
#[test]
fn every_shader_file_is_tested() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the folder of the crates");
    let mut files = Vec::new();
    wgsl_files(crates, &mut files);
    let here = ENTRIES
        .iter()
        .map(|entry| entry.file)
        .chain(LIBRARIES.iter().map(|(file, _)| *file));
    let mut known: BTreeSet<PathBuf> = here
        .map(|file| {
            let owner = if SHARED.contains(&file) {
                "akari_render"
            } else {
                "akari_area_light"
            };
            crates.join(owner).join("src").join(file)
        })
        .collect();
    for (import_path, source) in akari_math::WGSL_MODULES {
        let file = import_path
            .trim_start_matches("akari_math::")
            .replace("::", "/");
        known.insert(crates.join(format!("akari_math/src/{file}.wgsl")));
        assert_eq!(
            definitions_in(source),
            BTreeSet::new(),
            "{import_path}: a formula that reads definitions"
        );
    }
    let files: BTreeSet<PathBuf> = files.into_iter().collect();
    let untested: Vec<_> = files.difference(&known).collect();
    assert!(
        untested.is_empty(),
        "WGSL files that no test validates: {untested:?}"
    );
    let gone: Vec<_> = known.difference(&files).collect();
    assert!(gone.is_empty(), "tested, but not there: {gone:?}");
}

/// `types.wgsl` by itself.
fn types_module(source: &str) -> naga::Module {
    let source: String = source
        .lines()
        .filter(|line| !line.starts_with('#'))
        .flat_map(|line| [line, "\n"])
        .collect();
    naga::front::wgsl::parse_str(&source).expect("types.wgsl")
}

fn constants(module: &naga::Module) -> BTreeMap<&str, u32> {
    module
        .constants
        .iter()
        .filter_map(|(_, constant)| {
            let naga::Expression::Literal(naga::Literal::U32(value)) =
                module.global_expressions[constant.init]
            else {
                return None;
            };
            Some((constant.name.as_deref()?, value))
        })
        .collect()
}

#[test]
fn constants_agree() {
    let module = types_module(TYPES);
    let mut found = constants(&module);
    assert_eq!(
        found.len(),
        module.constants.len(),
        "a constant that is not a u32"
    );
    for (name, value) in [
        ("TILE_SIZE", TILE_SIZE),
        ("CULL_WORKGROUP", CULL_WORKGROUP),
        ("LIGHTS_PER_WORD", LIGHTS_PER_WORD),
        ("NO_TEXTURE", NO_TEXTURE),
        ("FLAG_TWO_SIDED", FLAG_TWO_SIDED),
    ] {
        assert_eq!(found.remove(name), Some(value), "{name}");
    }
    assert_eq!(LIGHTS_PER_WORD, u32::BITS, "a mask is whole words");
    // What is left are the counters: COUNTER_OUT_OF_RANGE is the index of the name with the word "out".
    assert_eq!(found.len(), COUNTER_NAMES.len(), "{found:?}");
    for (constant, index) in found {
        let words = constant
            .strip_prefix("COUNTER_")
            .unwrap_or_else(|| panic!("not compared: {constant}"));
        let word = words.split('_').next().unwrap_or(words).to_lowercase();
        let name = COUNTER_NAMES[index as usize];
        assert!(
            name.split(' ').any(|part| part == word),
            "{constant} = {index}: {name}"
        );
    }
}

#[test]
fn workgroups_and_counters_agree() {
    let mut composer = Composer::new();
    let cull = &ENTRIES[0];
    let module = composer
        .compose(cull.file, cull.source.to_owned(), &[])
        .expect("cull.wgsl");
    let point = module
        .entry_points
        .iter()
        .find(|point| point.name == cull.entry_point)
        .expect("entry point");
    assert_eq!(point.workgroup_size, [CULL_WORKGROUP, 1, 1]);
    let (_, counters) = module
        .global_variables
        .iter()
        .find(|(_, v)| v.name.as_deref() == Some("counters"))
        .expect("counters");
    let naga::TypeInner::Array { size, .. } = &module.types[counters.ty].inner else {
        panic!("the counters are an array");
    };
    let naga::ArraySize::Constant(size) = size else {
        panic!("the counters are an array of fixed size");
    };
    assert_eq!(size.get() as usize, COUNTER_NAMES.len());
}

/// Where a struct of `source` differs from its Rust type: fields, size, and where each mark of `value` lies.
fn layout_fault<T: ShaderType + encase::internal::WriteInto>(
    source: &str,
    name: &str,
    value: &T,
    fields: &[(&str, u32)],
) -> Option<String> {
    let module = types_module(source);
    let found = module
        .types
        .iter()
        .find_map(|(_, r#type)| match &r#type.inner {
            naga::TypeInner::Struct { members, span } if r#type.name.as_deref() == Some(name) => {
                Some((members, *span))
            }
            _ => None,
        });
    let Some((members, span)) = found else {
        return Some(format!("no struct {name}"));
    };
    let mut buffer = encase::StorageBuffer::new(Vec::<u8>::new());
    buffer.write(value).expect("a write to memory");
    let bytes = buffer.into_inner();
    if u64::from(span) != T::min_size().get() {
        return Some(format!(
            "{name} has {span} bytes in WGSL, {} in Rust",
            T::min_size()
        ));
    }
    let names: Vec<&str> = members
        .iter()
        .map(|member| member.name.as_deref().unwrap_or_default())
        .collect();
    let expected: Vec<&str> = fields.iter().map(|(field, _)| *field).collect();
    if names != expected {
        return Some(format!(
            "{name} has the fields {names:?} in WGSL, {expected:?} in Rust"
        ));
    }
    for (member, (field, mark)) in members.iter().zip(fields) {
        let at = member.offset as usize;
        let word = u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        if word != *mark {
            return Some(format!("{name}.{field} is not at byte {at} in Rust"));
        }
    }
    None
}

fn marked_light() -> (GpuAreaLight, Vec<(&'static str, u32)>) {
    let light = GpuAreaLight {
        center_ws: Vec3::new(1.0, 0.0, 0.0),
        radius: 2.0,
        radiance: Vec3::new(3.0, 0.0, 0.0),
        flags: 4,
        normal_ws: Vec3::new(5.0, 0.0, 0.0),
        area: 6.0,
        range_center_ws: Vec3::new(7.0, 0.0, 0.0),
        inverse_range_squared: 8.0,
        texture_u: Vec4::new(9.0, 0.0, 0.0, 0.0),
        texture_v: Vec4::new(10.0, 0.0, 0.0, 0.0),
        vertex_offset: 11,
        vertex_count: 12,
        render_layers: 13,
        texture_layer: 14,
        cell_size: 16.0,
    };
    let fields = vec![
        ("center_ws", 1.0_f32.to_bits()),
        ("radius", 2.0_f32.to_bits()),
        ("radiance", 3.0_f32.to_bits()),
        ("flags", 4),
        ("normal_ws", 5.0_f32.to_bits()),
        ("area", 6.0_f32.to_bits()),
        ("range_center_ws", 7.0_f32.to_bits()),
        ("inverse_range_squared", 8.0_f32.to_bits()),
        ("texture_u", 9.0_f32.to_bits()),
        ("texture_v", 10.0_f32.to_bits()),
        ("vertex_offset", 11),
        ("vertex_count", 12),
        ("render_layers", 13),
        ("texture_layer", 14),
        ("cell_size", 16.0_f32.to_bits()),
    ];
    (light, fields)
}

#[test]
fn structs_have_one_layout() {
    let (light, fields) = marked_light();
    assert_eq!(layout_fault(TYPES, "AreaLight", &light, &fields), None);
    let view = GpuAreaLightView {
        light_count: 1,
        words_per_tile: 2,
        tiles_x: 3,
        tiles_y: 4,
        cutoff_per_light: 5.0,
        render_layers: 6,
        lighting_pass_id: 7,
        culling: 8,
    };
    let fields = [
        ("light_count", 1),
        ("words_per_tile", 2),
        ("tiles_x", 3),
        ("tiles_y", 4),
        ("cutoff_per_light", 5.0_f32.to_bits()),
        ("render_layers", 6),
        ("lighting_pass_id", 7),
        ("culling", 8),
    ];
    assert_eq!(layout_fault(TYPES, "AreaLightView", &view, &fields), None);
}

#[test]
fn another_layout_is_noticed() {
    let (light, fields) = marked_light();
    let swapped = TYPES.replacen(
        "center_ws: vec3<f32>,\n    radius: f32,",
        "radius: f32,\n    center_ws: vec3<f32>,",
        1,
    );
    let wider = TYPES.replacen("cell_size: f32,", "cell_size: array<vec4<f32>, 2>,", 1);
    let mut marks = fields.clone();
    marks[3].1 = 5;
    for (source, fields) in [
        (swapped.as_str(), &fields),
        (wider.as_str(), &fields),
        (TYPES, &marks),
    ] {
        assert!(layout_fault(source, "AreaLight", &light, fields).is_some());
    }
}
