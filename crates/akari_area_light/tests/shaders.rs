//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! constants and layouts. Needs no GPU: Bevy runs without a renderer, and its shader cache is given naga alone.

use akari_area_light::shadows::debug::AreaShadowDebugView;
use akari_area_light::shadows::moving::{GpuMovingCaster, GpuMovingCasters, MOST_CASTERS};
use akari_area_light::shadows::types::{
    GpuReceiver, GpuShadowDebug, GpuShadowParams, GpuSlot, RATIO_WORKGROUP, RECEIVER_MIRRORED,
    RECEIVER_TWO_SIDED,
};
use akari_area_light::types::{
    COUNTER_NAMES, CULL_WORKGROUP, FLAG_TWO_SIDED, GpuAreaLight, GpuAreaLightView, LIGHTS_PER_WORD,
    NO_TEXTURE, TILE_COORDINATE_BITS, TILE_CORNERS, TILE_SIZE,
};
use akari_gpu_test::{layout_fault, u32_constants, workgroup_size};
use bevy::math::{Vec2, Vec3, Vec4};
use bevy::render::render_resource::ShaderType;
use std::path::Path;

#[path = "../../akari_render/tests/shader_composer/mod.rs"]
mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

fn cull() -> Entry {
    Entry {
        file: "cull.wgsl",
        source: include_str!("../src/cull.wgsl"),
        entry_point: "cull",
        definitions: choices(&[]),
    }
}

fn shade() -> Entry {
    Entry {
        file: "shade.wgsl",
        source: include_str!("../src/shade.wgsl"),
        entry_point: "fragment",
        definitions: choices(&[
            &[&[], &["TEXTURED"]],
            &[
                &[],
                &["SHADOWS"],
                &["SHADOWS", "MOVING_CASTERS"],
                &["SOFT_SHADOWS", "SOFT_GROUP=1"],
                &["SHADOWS", "SOFT_SHADOWS", "SOFT_GROUP=2"],
                &["SHADOWS", "SOFT_SHADOWS", "SOFT_BY_CASTER", "SOFT_GROUP=2"],
                &[
                    "SHADOWS",
                    "MOVING_CASTERS",
                    "SOFT_SHADOWS",
                    "SOFT_BY_CASTER",
                    "SOFT_GROUP=2",
                ],
            ],
        ]),
    }
}

fn prefilter() -> Entry {
    Entry {
        file: "prefilter.wgsl",
        source: include_str!("../src/prefilter.wgsl"),
        entry_point: "prefilter",
        definitions: choices(&[&[&["RESAMPLE"], &["DOWNSAMPLE"], &["CONVOLVE"]]]),
    }
}

fn ratios() -> Entry {
    Entry {
        file: "shadows/ratios.wgsl",
        source: include_str!("../src/shadows/ratios.wgsl"),
        entry_point: "ratio",
        definitions: choices(&[]),
    }
}

fn receivers(entry_point: &'static str) -> Entry {
    Entry {
        file: "shadows/receivers.wgsl",
        source: include_str!("../src/shadows/receivers.wgsl"),
        entry_point,
        definitions: choices(&[]),
    }
}

fn shadow_debug() -> Entry {
    Entry {
        file: "shadows/debug.wgsl",
        source: include_str!("../src/shadows/debug.wgsl"),
        entry_point: "debug",
        definitions: AreaShadowDebugView::ALL
            .map(|view| vec![view.shader_def()])
            .to_vec(),
    }
}

/// Every entry point of this crate.
fn entries() -> [Entry; 7] {
    [
        cull(),
        shade(),
        prefilter(),
        ratios(),
        receivers("vertex"),
        receivers("fragment"),
        shadow_debug(),
    ]
}

const TYPES: &str = include_str!("../src/types.wgsl");
const SHADOW_TYPES: &str = include_str!("../src/shadows/types.wgsl");

/// Modules of this crate that the entry shaders import.
const LIBRARIES: &[(&str, &str)] = &[
    ("types.wgsl", TYPES),
    ("shadows/types.wgsl", SHADOW_TYPES),
    (
        "shadows/trees.wgsl",
        include_str!("../src/shadows/trees.wgsl"),
    ),
    (
        "shadows/shadows.wgsl",
        include_str!("../src/shadows/shadows.wgsl"),
    ),
];

/// With what is imported from other crates.
fn composer() -> Composer {
    let gbuffer = include_str!("../../akari_render/src/gbuffer.wgsl");
    let ltc_layer = include_str!("../../akari_render/src/ltc_layer.wgsl");
    let libraries = [
        LIBRARIES,
        &[("gbuffer.wgsl", gbuffer), ("ltc_layer.wgsl", ltc_layer)],
        akari_visibility::WGSL_MODULES,
    ]
    .concat();
    Composer::new(&libraries, &entries().each_ref())
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
fn every_shader_and_definition_is_tried() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let faults = list_faults(&source, &entries().each_ref(), LIBRARIES);
    assert_eq!(faults, [""; 0]);
    let untextured = Entry {
        definitions: vec![vec![]],
        ..shade()
    };
    let faults = list_faults(&source, &[&cull(), &untextured], LIBRARIES);
    assert!(
        faults.iter().any(|fault| fault.contains("TEXTURED")),
        "{faults:?}"
    );
    assert!(
        faults.iter().any(|fault| fault.contains("prefilter.wgsl")),
        "{faults:?}"
    );
}

/// What is wrong under one set of definitions only, is found under that one.
#[test]
fn wrong_shaders_are_noticed() {
    let mut composer = composer();
    let shade = shade();
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

/// `types.wgsl` by itself.
fn types_module(source: &str) -> naga::Module {
    let source: String = source
        .lines()
        .filter(|line| !line.starts_with('#'))
        .flat_map(|line| [line, "\n"])
        .collect();
    naga::front::wgsl::parse_str(&source).expect("types.wgsl")
}

#[test]
fn constants_agree() {
    let module = types_module(TYPES);
    let mut found = u32_constants(&module);
    assert_eq!(
        found.len(),
        module.constants.len(),
        "a constant that is not a u32"
    );
    for (name, value) in [
        ("TILE_SIZE", TILE_SIZE),
        ("CULL_WORKGROUP", CULL_WORKGROUP),
        ("TILE_COORDINATE_BITS", TILE_COORDINATE_BITS),
        ("TILE_CORNERS", TILE_CORNERS),
        ("LIGHTS_PER_WORD", LIGHTS_PER_WORD),
        ("NO_TEXTURE", NO_TEXTURE),
        ("FLAG_TWO_SIDED", FLAG_TWO_SIDED),
    ] {
        assert_eq!(found.remove(name), Some(value), "{name}");
    }
    let module = types_module(SHADOW_TYPES);
    let mut shadow_constants = u32_constants(&module);
    assert_eq!(shadow_constants.len(), module.constants.len());
    for (name, value) in [
        ("RATIO_WORKGROUP", RATIO_WORKGROUP),
        ("RECEIVER_TWO_SIDED", RECEIVER_TWO_SIDED),
        ("RECEIVER_MIRRORED", RECEIVER_MIRRORED),
        ("MOST_CASTERS", MOST_CASTERS as u32),
    ] {
        assert_eq!(shadow_constants.remove(name), Some(value), "{name}");
    }
    assert!(shadow_constants.is_empty(), "{shadow_constants:?}");
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
    let mut composer = composer();
    let cull = cull();
    let module = composer
        .compose(cull.file, cull.source.to_owned(), &[])
        .expect("cull.wgsl");
    assert_eq!(
        workgroup_size(&module, cull.entry_point),
        Some([CULL_WORKGROUP, 1, 1])
    );
    let ratios = ratios();
    let ratio_module = composer
        .compose(ratios.file, ratios.source.to_owned(), &[])
        .expect("ratios.wgsl");
    assert_eq!(
        workgroup_size(&ratio_module, ratios.entry_point),
        Some([RATIO_WORKGROUP, 1, 1])
    );
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

/// [`layout_fault`] of a value of a struct in `source`.
fn fault<T: ShaderType + encase::internal::WriteInto>(
    source: &str,
    name: &str,
    value: &T,
    fields: &[(&str, u32)],
) -> Option<String> {
    let mut buffer = encase::StorageBuffer::new(Vec::<u8>::new());
    buffer.write(value).expect("a write to memory");
    let module = types_module(source);
    layout_fault(&module, name, T::min_size().get(), buffer.as_ref(), fields)
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
    assert_eq!(fault(TYPES, "AreaLight", &light, &fields), None);
    let view = GpuAreaLightView {
        light_count: 1,
        words_per_tile: 2,
        tiles_x: 3,
        tiles_y: 4,
        cutoff: 5.0,
        render_layers: 6,
        lighting_pass_id: 7,
        culling: 8,
    };
    let fields = [
        ("light_count", 1),
        ("words_per_tile", 2),
        ("tiles_x", 3),
        ("tiles_y", 4),
        ("cutoff", 5.0_f32.to_bits()),
        ("render_layers", 6),
        ("lighting_pass_id", 7),
        ("culling", 8),
    ];
    assert_eq!(fault(TYPES, "AreaLightView", &view, &fields), None);
}

#[test]
fn shadow_structs_have_one_layout() {
    let receiver = GpuReceiver {
        a: Vec3::new(1.0, 0.0, 0.0),
        grid: 2,
        b: Vec3::new(3.0, 0.0, 0.0),
        flags: 4,
        c: Vec3::new(5.0, 0.0, 0.0),
    };
    let fields = [
        ("a", 1.0_f32.to_bits()),
        ("grid", 2),
        ("b", 3.0_f32.to_bits()),
        ("flags", 4),
        ("c", 5.0_f32.to_bits()),
    ];
    assert_eq!(fault(SHADOW_TYPES, "Receiver", &receiver, &fields), None);
    let slot = GpuSlot {
        position: Vec3::new(1.0, 0.0, 0.0),
        normal: 2,
        trees: [3, 4, 5, 6, 7, 8],
    };
    let fields = [("position", 1.0_f32.to_bits()), ("normal", 2), ("trees", 3)];
    assert_eq!(fault(SHADOW_TYPES, "Slot", &slot, &fields), None);
    let params = GpuShadowParams {
        slot_count: 1,
        hanging_offset: 2,
        pieces_roughness: 3.0,
        parallax: 4,
        penumbra_threshold: 5.0,
    };
    let fields = [
        ("slot_count", 1),
        ("hanging_offset", 2),
        ("pieces_roughness", 3.0_f32.to_bits()),
        ("parallax", 4),
        ("penumbra_threshold", 5.0_f32.to_bits()),
    ];
    assert_eq!(fault(SHADOW_TYPES, "ShadowParams", &params, &fields), None);
    let row = |x: f32| Vec4::new(x, 0.0, 0.0, 0.0);
    let caster = GpuMovingCaster {
        unit_x: row(1.0),
        unit_y: row(2.0),
        unit_z: row(3.0),
        world_x: row(4.0),
        world_y: row(5.0),
        world_z: row(6.0),
        bounds: row(7.0),
    };
    let names = [
        "unit_x", "unit_y", "unit_z", "world_x", "world_y", "world_z", "bounds",
    ];
    let rows: Vec<_> = (1..)
        .zip(names)
        .map(|(i, name)| (name, (i as f32).to_bits()))
        .collect();
    assert_eq!(fault(SHADOW_TYPES, "MovingCaster", &caster, &rows), None);
    let casters = GpuMovingCasters {
        casters: [caster; MOST_CASTERS],
        count: 9,
    };
    let first = ("casters", 1.0_f32.to_bits());
    assert_eq!(
        fault(
            SHADOW_TYPES,
            "MovingCasters",
            &casters,
            &[first, ("count", 9)]
        ),
        None
    );
    let debug = GpuShadowDebug {
        cursor: Vec2::new(1.0, 0.0),
        light_count: 2,
        face_pixels: 3.0,
    };
    let fields_of_debug = [
        ("cursor", 1.0_f32.to_bits()),
        ("light_count", 2),
        ("face_pixels", 3.0_f32.to_bits()),
    ];
    assert_eq!(
        fault(SHADOW_TYPES, "ShadowDebug", &debug, &fields_of_debug),
        None
    );
    // And another order is noticed.
    let swapped = SHADOW_TYPES.replacen(
        "slot_count: u32,\n    hanging_offset: u32,",
        "hanging_offset: u32,\n    slot_count: u32,",
        1,
    );
    assert!(fault(&swapped, "ShadowParams", &params, &fields).is_some());
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
        assert!(fault(source, "AreaLight", &light, fields).is_some());
    }
}
