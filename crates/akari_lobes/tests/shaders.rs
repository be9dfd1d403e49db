//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! bindings and constants. Needs no GPU.

use akari_gpu_test::{struct_layout, undecorated, workgroup_size};
use akari_lobes::pipeline::{GEOMETRIC_FILTER_BYTES, GuideKey, LOBE_FORMAT, WORD_FORMAT};
use bevy::render::render_resource::{
    BindGroupLayoutEntry, BindingType, BufferBindingType, StorageTextureAccess, TextureFormat,
    TextureSampleType, TextureViewDimension,
};
use naga::{AddressSpace, ImageClass, ImageDimension, Module, ScalarKind, TypeInner};
use std::path::Path;

#[path = "../../akari_render/tests/shader_composer/mod.rs"]
mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

const GUIDES: &str = include_str!("../src/guides.wgsl");
const TILES: &str = include_str!("../src/tiles.wgsl");
const LIBRARIES: &[(&str, &str)] = &[("guides.wgsl", GUIDES), ("tiles.wgsl", TILES)];
const GBUFFER: (&str, &str) = (
    "gbuffer.wgsl",
    include_str!("../../akari_render/src/gbuffer.wgsl"),
);

/// What the shader that stores lobes is composed with: it reads none.
fn build() -> Entry {
    Entry {
        file: "build.wgsl",
        source: include_str!("../src/build.wgsl"),
        entry_point: "build",
        definitions: choices(&[&[&[], &["EXTERNAL_GUIDES"]], &[&[], &["WANG_LOBES"]]]),
    }
}

/// What sorts tiles reads no lobes.
fn classify() -> Entry {
    Entry {
        file: "classify.wgsl",
        source: include_str!("../src/classify.wgsl"),
        entry_point: "classify",
        definitions: choices(&[&[&[], &["EXTERNAL_GUIDES"]], &[&[], &["WANG_LOBES"]]]),
    }
}

fn filter_roughness() -> Entry {
    Entry {
        file: "filter_roughness.wgsl",
        source: include_str!("../src/filter_roughness.wgsl"),
        entry_point: "filter_roughness",
        definitions: choices(&[]),
    }
}

fn store_roughness() -> Entry {
    Entry {
        file: "store_roughness.wgsl",
        source: include_str!("../src/store_roughness.wgsl"),
        entry_point: "store_roughness",
        definitions: choices(&[]),
    }
}

/// A pass that asks for all that the guides know, as those of other crates do.
fn reader() -> Entry {
    Entry {
        file: "reader.wgsl",
        source: "
#import akari_lobes::guides::{
    anisotropic_lobe, demodulation_of, diffuse_albedo, load_diffuse_guide, load_specular_guide, matte_albedo,
    specular_albedo,
}
#import akari_lobes::tiles::{GLOSSY_TILES, HOLDS_GLOSSY, listed_texel, tile_holds}

@group(1) @binding(0) var<storage, read_write> results: array<vec4<f32>>;

@compute @workgroup_size(8, 8, 1)
fn read(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let work = listed_texel(GLOSSY_TILES, 1u, group.xy, invocation);
    if !work.listed || !tile_holds(work.texel, HOLDS_GLOSSY) {
        return;
    }
    let pixel = vec2<i32>(work.texel);
    let specular = load_specular_guide(pixel);
    let diffuse = load_diffuse_guide(pixel);
    let lobe = anisotropic_lobe(specular);
    results[0] = vec4(specular.axis, specular.inverse_sharpness);
    results[1] = vec4(diffuse.axis, diffuse.inverse_sharpness);
    results[2] = vec4(specular_albedo(pixel, specular) * diffuse_albedo(pixel), lobe.axis.x);
    results[3] = vec4(demodulation_of(matte_albedo(pixel, diffuse)), 0.0);
}",
        entry_point: "read",
        definitions: choices(&[
            &[&[], &["EXTERNAL_GUIDES"]],
            &[&[], &["STORED_LOBES"]],
            &[&[], &["WANG_LOBES"]],
        ]),
    }
}

fn entries() -> [Entry; 5] {
    [
        build(),
        classify(),
        filter_roughness(),
        store_roughness(),
        reader(),
    ]
}

fn composer() -> Composer {
    Composer::new(
        &[LIBRARIES, &[GBUFFER]].concat(),
        &entries().each_ref().map(|entry| entry),
    )
}

/// The key of a set of definitions.
fn key(definitions: &[&str]) -> GuideKey {
    let set = |name| definitions.contains(&name);
    GuideKey {
        external: set("EXTERNAL_GUIDES"),
        stored: set("STORED_LOBES"),
        wang: set("WANG_LOBES"),
        tiles: true,
    }
}

#[test]
fn every_shader_is_valid_for_every_set_of_definitions() {
    let mut composer = composer();
    for entry in entries() {
        if let Err(error) = composer.compose_all(&entry) {
            panic!("{error}");
        }
    }
}

#[test]
fn wrong_shaders_are_noticed() {
    let mut composer = composer();
    let build = build();
    let changed = |from: &str, to: &str| {
        assert!(build.source.contains(from), "nothing to change: {from}");
        build.source.replacen(from, to, 1)
    };
    let wrong = changed("vec4(packed, 0u, 0u)", "vec4(packed, 0.0, 0.0)");
    assert!(composer.compose("a.wgsl", wrong, &[]).is_err());
    let wrong = changed("load_specular_guide", "load_no_guide");
    assert!(composer.compose("b.wgsl", wrong, &[]).is_err());
    // A guide that is wrong under one definition only, is wrong to whoever imports it under that one.
    let wrong = GUIDES.replacen(
        "lobe_unpack(textureLoad(lobe_texture, pixel, 0).xy)",
        "lobe_unpack(textureLoad(lobe_texture, pixel, 0).x)",
        1,
    );
    assert_ne!(wrong, GUIDES);
    let libraries = [
        ("guides.wgsl", &*wrong.leak()),
        ("tiles.wgsl", TILES),
        GBUFFER,
    ];
    let reader = reader();
    let mut composer = Composer::new(&libraries, &[&reader]);
    let mut outcome = |definitions: &[&str]| {
        composer
            .compose(reader.file, reader.source.to_owned(), definitions)
            .is_ok()
    };
    assert!(outcome(&[]));
    assert!(!outcome(&["STORED_LOBES"]));
}

#[test]
fn every_shader_and_definition_is_tried() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let [build, classify, filter, store, _] = entries();
    // The modules' definitions count as tried by whoever imports them, so that the reader's sets are compared here.
    let with_all = Entry {
        definitions: reader().definitions,
        ..build
    };
    let listed = [&with_all, &classify, &filter, &store];
    assert_eq!(list_faults(&source, &listed, LIBRARIES), [""; 0]);
    let faults = list_faults(&source, &[&self::build(), &classify, &filter], LIBRARIES);
    for missing in ["STORED_LOBES", "store_roughness.wgsl"] {
        assert!(
            faults.iter().any(|fault| fault.contains(missing)),
            "{missing}: {faults:?}"
        );
    }
}

#[test]
fn the_host_gives_these_definitions() {
    for definitions in reader().definitions {
        let given = key(&definitions).shader_defs();
        let expected: Vec<_> = definitions.iter().map(|&name| name.into()).collect();
        assert_eq!(given, expected);
    }
}

/// The kind of binding that a global variable asks for, without what only the layout knows (visibility, dynamic offset,
/// size); `None` if no layout can have it.
fn asked_for(module: &Module, variable: &naga::GlobalVariable) -> Option<BindingType> {
    let buffer = |ty| BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let view_dimension = TextureViewDimension::D2;
    match (variable.space, &module.types[variable.ty].inner) {
        (AddressSpace::Uniform, _) => Some(buffer(BufferBindingType::Uniform)),
        (AddressSpace::Storage { access }, _) => Some(buffer(BufferBindingType::Storage {
            read_only: !access.contains(naga::StorageAccess::STORE),
        })),
        (
            AddressSpace::Handle,
            TypeInner::Image {
                dim: ImageDimension::D2,
                arrayed: false,
                class,
            },
        ) => match class {
            ImageClass::Sampled { kind, multi: false } => Some(BindingType::Texture {
                sample_type: match kind {
                    ScalarKind::Float => TextureSampleType::Float { filterable: false },
                    ScalarKind::Uint => TextureSampleType::Uint,
                    ScalarKind::Sint => TextureSampleType::Sint,
                    _ => return None,
                },
                view_dimension,
                multisampled: false,
            }),
            ImageClass::Depth { multi: false } => Some(BindingType::Texture {
                sample_type: TextureSampleType::Depth,
                view_dimension,
                multisampled: false,
            }),
            ImageClass::Storage { format, access } => Some(BindingType::StorageTexture {
                access: if access.contains(naga::StorageAccess::LOAD | naga::StorageAccess::STORE) {
                    StorageTextureAccess::ReadWrite
                } else if access.contains(naga::StorageAccess::STORE) {
                    StorageTextureAccess::WriteOnly
                } else {
                    StorageTextureAccess::ReadOnly
                },
                format: match format {
                    naga::StorageFormat::R32Uint => TextureFormat::R32Uint,
                    naga::StorageFormat::Rg32Uint => TextureFormat::Rg32Uint,
                    _ => return None,
                },
                view_dimension,
            }),
            _ => None,
        },
        _ => None,
    }
}

/// Where the bindings of a group differ from its layout. A layout may hold more than the shader reads.
fn binding_faults(module: &Module, group: u32, layout: &[BindGroupLayoutEntry]) -> Vec<String> {
    let mut faults = Vec::new();
    for (_, variable) in module.global_variables.iter() {
        let Some(binding) = variable.binding.filter(|binding| binding.group == group) else {
            continue;
        };
        let name = undecorated(variable.name.as_deref().unwrap_or_default());
        let entry = layout
            .iter()
            .find(|entry| entry.binding == binding.binding)
            .map(|entry| match entry.ty {
                BindingType::Buffer { ty, .. } => BindingType::Buffer {
                    ty,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                other => other,
            });
        let asked = asked_for(module, variable);
        if entry.is_none() || entry != asked {
            faults.push(format!("{name}: asks for {asked:?}, is given {entry:?}"));
        }
    }
    faults
}

/// Bindings of a group that a module declares.
fn bindings(module: &Module, group: u32) -> Vec<u32> {
    let mut bindings: Vec<u32> = module
        .global_variables
        .iter()
        .filter_map(|(_, variable)| variable.binding)
        .filter(|binding| binding.group == group)
        .map(|binding| binding.binding)
        .collect();
    bindings.sort_unstable();
    bindings
}

#[test]
fn guides_are_bound_as_they_are_declared() {
    let mut composer = composer();
    let reader = reader();
    let modules = composer.compose_all(&reader).expect("a valid shader");
    for (module, definitions) in modules.iter().zip(&reader.definitions) {
        let layout = key(definitions).layout();
        let faults = binding_faults(module, 0, &layout.entries);
        assert_eq!(faults, [""; 0], "{definitions:?}");
        // The reader reads all of it, so that nothing is bound in vain, but for the view: images know their places.
        let unread = |binding: &u32| *binding == 0 && definitions.contains(&"EXTERNAL_GUIDES");
        let given = layout.entries.iter().map(|entry| entry.binding);
        let given: Vec<u32> = given.filter(|binding| !unread(binding)).collect();
        assert_eq!(bindings(module, 0), given, "{definitions:?}");
        let view = layout.entries.first().map(|entry| entry.ty);
        assert!(
            matches!(
                view,
                Some(BindingType::Buffer {
                    has_dynamic_offset: true,
                    ..
                })
            ),
            "the view's uniform has a dynamic offset: {view:?}"
        );
    }
    // Another source's layout is noticed.
    let other = key(&["EXTERNAL_GUIDES"]).layout();
    assert!(!binding_faults(&modules[0], 0, &other.entries).is_empty());
    assert!(!binding_faults(&modules[0], 0, &other.entries[..1]).is_empty());
}

#[test]
fn targets_have_the_formats_of_the_host() {
    let mut composer = composer();
    let target = |binding, format| BindGroupLayoutEntry {
        binding,
        visibility: bevy::render::render_resource::ShaderStages::COMPUTE,
        ty: BindingType::StorageTexture {
            access: StorageTextureAccess::WriteOnly,
            format,
            view_dimension: TextureViewDimension::D2,
        },
        count: None,
    };
    for module in composer.compose_all(&build()).expect("a valid shader") {
        assert_eq!(
            binding_faults(&module, 1, &[target(0, LOBE_FORMAT)]),
            [""; 0]
        );
        assert!(!binding_faults(&module, 1, &[target(0, WORD_FORMAT)]).is_empty());
    }
    let filter = composer
        .compose_all(&filter_roughness())
        .expect("a valid shader");
    let words = binding_faults(&filter[0], 0, &[target(3, WORD_FORMAT)]);
    assert!(
        !words.iter().any(|fault| fault.starts_with("first_words")),
        "{words:?}"
    );
}

/// The side of a workgroup by which the host divides an image.
fn host_workgroup() -> u32 {
    let declaration = "const WORKGROUP: u32 = ";
    include_str!("../src/pass.rs")
        .lines()
        .find_map(|line| {
            line.split(declaration)
                .nth(1)?
                .strip_suffix(';')?
                .parse()
                .ok()
        })
        .expect("the size of a workgroup in pass.rs")
}

#[test]
fn workgroups_and_uniforms_agree() {
    let mut composer = composer();
    let side = host_workgroup();
    for entry in [build(), classify(), filter_roughness()] {
        for module in composer.compose_all(&entry).expect("a valid shader") {
            assert_eq!(
                workgroup_size(&module, entry.entry_point),
                Some([side, side, 1]),
                "{}",
                entry.file
            );
        }
    }
    let filter = composer
        .compose_all(&filter_roughness())
        .expect("a valid shader");
    let (members, bytes) = struct_layout(&filter[0], "GeometricFilter").expect("the uniform");
    assert_eq!(u64::from(bytes), GEOMETRIC_FILTER_BYTES);
    let names: Vec<_> = members.iter().filter_map(|m| m.name.as_deref()).collect();
    assert_eq!(
        names,
        ["sigma_squared", "limit", "looks"],
        "the order in which the host writes them"
    );
}
