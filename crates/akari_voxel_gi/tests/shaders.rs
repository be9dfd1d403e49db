//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! constants and layouts. Needs no GPU: Bevy runs without a renderer, and its shader cache is given naga alone.

use akari_gpu_test::{layout_fault, u32_constants};
use akari_voxel_gi::cones::GpuCones;
use akari_voxel_gi::lights::GpuVoxelLighting;
use akari_voxel_gi::sky::{GpuVoxelInterior, GpuVoxelSurroundings, MOST_INTERIORS};
use akari_voxel_gi::soft_shadows::{GpuCasters, GpuSoftLight, GpuSoftShadows, MOST_BOXES};
use akari_voxel_gi::types::*;
use bevy::math::{IVec3, UVec2, Vec3};
use bevy::render::render_resource::ShaderType;
use std::path::Path;

#[path = "../../akari_render/tests/shader_composer/mod.rs"]
mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

const TYPES: &str = include_str!("../src/types.wgsl");
const CASTERS: &str = include_str!("../src/casters.wgsl");
const SOFT: &str = include_str!("../src/soft_shadows.wgsl");
const SKY: &str = include_str!("../src/sky.wgsl");

/// Modules of this crate that the entry shaders import.
const LIBRARIES: &[(&str, &str)] = &[
    ("types.wgsl", TYPES),
    ("store.wgsl", include_str!("../src/store.wgsl")),
    ("casters.wgsl", CASTERS),
    ("trace.wgsl", include_str!("../src/trace.wgsl")),
    ("mirrors.wgsl", include_str!("../src/mirrors.wgsl")),
    ("sky.wgsl", SKY),
    ("records.wgsl", include_str!("../src/records.wgsl")),
    ("diffuse.wgsl", include_str!("../src/diffuse.wgsl")),
    ("lighting.wgsl", include_str!("../src/lighting.wgsl")),
];

/// Modules of other crates that they import.
const BORROWED: &[(&str, &str)] = &[
    (
        "guides.wgsl",
        include_str!("../../akari_lobes/src/guides.wgsl"),
    ),
    (
        "tiles.wgsl",
        include_str!("../../akari_lobes/src/tiles.wgsl"),
    ),
    (
        "gbuffer.wgsl",
        include_str!("../../akari_render/src/gbuffer.wgsl"),
    ),
    (
        "scene_lights.wgsl",
        include_str!("../../akari_render/src/scene_lights.wgsl"),
    ),
    // Named apart from the file of this crate.
    (
        "render/sky.wgsl",
        include_str!("../../akari_render/src/sky.wgsl"),
    ),
];

/// The voxels are bound as group 1 to what lights them.
const LIT_GROUP: &[&[&str]] = &[&["VOXEL_GROUP=1"]];

fn inject() -> Entry {
    Entry {
        file: "inject.wgsl",
        source: include_str!("../src/inject.wgsl"),
        entry_point: "inject",
        definitions: choices(&[
            LIT_GROUP,
            &[&[], &["EMISSIVE"]],
            &[&[], &["FEEDBACK"]],
            &[&[], &["PLAIN_CONES"]],
        ]),
    }
}

fn gather() -> Entry {
    Entry {
        file: "gather.wgsl",
        source: include_str!("../src/gather.wgsl"),
        entry_point: "gather",
        definitions: choices(&[
            LIT_GROUP,
            &[&["TRACE_RADIANCE", "FEEDBACK"]],
            &[&[], &["SKY_MAP"]],
            &[&[], &["PLAIN_CONES"]],
        ]),
    }
}

fn voxelize() -> Entry {
    Entry {
        file: "voxelize.wgsl",
        source: include_str!("../src/voxelize.wgsl"),
        entry_point: "voxelize",
        definitions: choices(&[&[&[], &["EMISSIVE"]], &[&[], &["FEEDBACK"]]]),
    }
}

fn mips() -> Entry {
    Entry {
        file: "mips.wgsl",
        source: include_str!("../src/mips.wgsl"),
        entry_point: "downsample",
        definitions: choices(&[&[&[], &["EMISSIVE"]], &[&[], &["FEEDBACK"]]]),
    }
}

fn cones() -> Entry {
    Entry {
        file: "cones.wgsl",
        source: include_str!("../src/cones.wgsl"),
        entry_point: "trace",
        definitions: choices(&[
            LIT_GROUP,
            &[&["TRACE_RADIANCE"]],
            &[&[], &["EXTERNAL_GUIDES"]],
            &[&[], &["STORED_LOBES"]],
            &[&[], &["WANG_LOBES"]],
            &[&[], &["SPECULAR"], &["BESIDE_SPECULAR"]],
            &[&[], &["SKY_MAP"]],
            &[&[], &["MIRRORS"]],
            &[&[], &["PLAIN_CONES"]],
        ]),
    }
}

fn soft_shadows(definition: &'static str, entry_point: &'static str) -> Entry {
    Entry {
        file: "soft_shadows.wgsl",
        source: SOFT,
        entry_point,
        definitions: choices(&[
            LIT_GROUP,
            &[&[definition]],
            &[&[], &["CASTERS"]],
            &[&[], &["EXTERNAL_GUIDES"]],
            &[&[], &["PLAIN_CONES"]],
        ]),
    }
}

fn debug(view: &'static str) -> Entry {
    Entry {
        file: "debug.wgsl",
        source: include_str!("../src/debug.wgsl"),
        entry_point: "debug",
        definitions: choices(&[
            LIT_GROUP,
            &[&["TRACE_RADIANCE"]],
            &[&[], &["EXTERNAL_GUIDES"]],
            &[&[], &["STORED_LOBES"]],
            &[&[], &["WANG_LOBES"]],
            &[&[], &["PLAIN_CONES"]],
            &[&[view]],
        ]),
    }
}

fn release(definition: &'static str, entry_point: &'static str) -> Entry {
    Entry {
        file: "release.wgsl",
        source: include_str!("../src/release.wgsl"),
        entry_point,
        definitions: vec![vec![definition]],
    }
}

fn entries() -> [Entry; 15] {
    [
        cones(),
        soft_shadows("TRACE", "trace"),
        soft_shadows("SMOOTH", "smoothen"),
        inject(),
        gather(),
        voxelize(),
        mips(),
        debug("VIEW_CASCADES"),
        debug("VIEW_RADIANCE"),
        debug("VIEW_OPACITY"),
        debug("VIEW_CONE_COUNT"),
        debug("VIEW_LEAKS"),
        release("RELEASE", "release"),
        release("RECLAIM", "reclaim"),
        release("COUNT", "count"),
    ]
}

fn composer() -> Composer {
    Composer::new(&[LIBRARIES, BORROWED].concat(), &entries().each_ref())
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
    let silent = Entry {
        definitions: vec![vec![]],
        ..voxelize()
    };
    let faults = list_faults(&source, &[&silent], LIBRARIES);
    for missing in ["EMISSIVE", "mips.wgsl"] {
        assert!(
            faults.iter().any(|fault| fault.contains(missing)),
            "{faults:?}"
        );
    }
}

/// What is wrong under one set of definitions only, is found under that one.
#[test]
fn wrong_shaders_are_noticed() {
    let mut composer = composer();
    let source = voxelize().source;
    let wrong = source.replacen("vote(lane, reaches)", "vote(lane, 1.0)", 1);
    assert_ne!(wrong, source);
    assert!(composer.compose("a.wgsl", wrong, &[]).is_err());
    let wrong = source.replacen("weight * shine", "weight + vec2(1.0)", 1);
    assert_ne!(wrong, source);
    assert!(composer.compose("b.wgsl", wrong.clone(), &[]).is_ok());
    assert!(composer.compose("b.wgsl", wrong, &["EMISSIVE"]).is_err());
}

/// `types.wgsl` by itself, up to its function, which imports another.
fn types_module(source: &str) -> naga::Module {
    let source: String = source
        .lines()
        .take_while(|line| !line.starts_with("// Slot of a brick"))
        .filter(|line| !line.starts_with('#'))
        .flat_map(|line| [line, "\n"])
        .collect();
    naga::front::wgsl::parse_str(&source).expect("types.wgsl")
}

#[test]
fn constants_agree() {
    let module = types_module(TYPES);
    let mut found = u32_constants(&module);
    // The one constant that is no u32 is `INWARD_SHIFT`.
    assert_eq!(found.len() + 1, module.constants.len());
    let (_, shift) = module
        .constants
        .iter()
        .find(|(_, constant)| constant.name.as_deref() == Some("INWARD_SHIFT"))
        .expect("INWARD_SHIFT");
    assert!(matches!(
        module.global_expressions[shift.init],
        naga::Expression::Literal(naga::Literal::F32(value)) if value == INWARD_SHIFT
    ));
    for (name, value) in [
        ("BRICK_VOXELS", BRICK_VOXELS),
        ("FACES", FACES),
        ("MOST_CASCADES", MOST_CASCADES),
        ("MOST_LEVELS", MOST_LEVELS),
        ("SMALLEST_TAIL", SMALLEST_TAIL),
        ("MOST_PAGES", MOST_PAGES),
        ("BRICK_PENDING", BRICK_PENDING),
        ("ONE_SURFACE", ONE_SURFACE),
        ("INSTANCE_TWO_SIDED", INSTANCE_TWO_SIDED),
        ("INSTANCE_MIRRORED", INSTANCE_MIRRORED),
        ("INSTANCE_LAMPS_ELSEWHERE", INSTANCE_LAMPS_ELSEWHERE),
        ("LAMPS_ELSEWHERE_BIT", LAMPS_ELSEWHERE_BIT),
        ("INSTANCE_METAL", INSTANCE_METAL),
        ("INSTANCE_ROUGHNESS_BIT", INSTANCE_ROUGHNESS_BIT),
        ("CLUSTER_TRIANGLES", CLUSTER_TRIANGLES),
        ("POOL_HEADER", POOL_HEADER),
        ("POOL_FREE", POOL_FREE),
        ("POOL_RETURNED", POOL_RETURNED),
        ("RELEASE_PENDING", RELEASE_PENDING),
        ("POOL_LIT", POOL_LIT),
        ("POOL_FACES", POOL_FACES),
        ("UNKNOWN_IRRADIANCE", UNKNOWN_IRRADIANCE),
        ("IRRADIANCE_STRIDE", IRRADIANCE_STRIDE),
        ("MOST_VISITS", MOST_VISITS),
        ("VISITS_AFTER_CHANGE", VISITS_AFTER_CHANGE),
        ("PAGE_STALE", PAGE_STALE),
    ] {
        assert_eq!(found.remove(name), Some(value), "{name}");
    }
    assert_eq!(BRICK_VOXELS, akari_math::voxel::brick::BRICK_EDGE.pow(3));
    // What is left are the counters; the last name is that of `POOL_FREE`.
    assert_eq!(COUNTER_NAMES.len() as u32, POOL_FREE + 1);
    assert_eq!(found.len() as u32, POOL_FREE, "{found:?}");
    for (constant, index) in found {
        let word = constant
            .strip_prefix("COUNTER_")
            .unwrap_or_else(|| panic!("not compared: {constant}"))
            .to_lowercase();
        let name = COUNTER_NAMES[index as usize];
        assert!(
            name.split(' ').any(|part| part == word),
            "{constant} = {index}: {name}"
        );
    }
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

fn x(value: f32) -> Vec3 {
    Vec3::new(value, 0.0, 0.0)
}

fn bits(value: f32) -> u32 {
    value.to_bits()
}

fn marked_level() -> (GpuVoxelLevel, Vec<(&'static str, u32)>) {
    let level = GpuVoxelLevel {
        anchor: x(1.0),
        voxel_size: 2.0,
        origin: IVec3::new(3, 0, 0),
        bricks: 4,
        first_slot: 5,
        finer: 6,
        pad_a: 7,
        pad_b: 8,
    };
    let fields = vec![
        ("anchor", bits(1.0)),
        ("voxel_size", bits(2.0)),
        ("origin", 3),
        ("bricks", 4),
        ("first_slot", 5),
        ("finer", 6),
        ("pad_a", 7),
        ("pad_b", 8),
    ];
    (level, fields)
}

#[test]
fn structs_have_one_layout() {
    let (level, fields) = marked_level();
    assert_eq!(fault(TYPES, "VoxelLevel", &level, &fields), None);
    let clipmap = GpuVoxelClipmap {
        levels: [level; MOST_LEVELS as usize],
        cascades: 11,
        level_count: 12,
        slots: 13,
        pages: 14,
    };
    let fields = [
        ("levels", bits(1.0)),
        ("cascades", 11),
        ("level_count", 12),
        ("slots", 13),
        ("pages", 14),
    ];
    assert_eq!(fault(TYPES, "VoxelClipmap", &clipmap, &fields), None);
    let dirty = GpuDirtyBrick {
        brick: IVec3::new(1, 0, 0),
        level: 2,
    };
    let fields = [("brick", 1), ("level", 2)];
    assert_eq!(fault(TYPES, "DirtyBrick", &dirty, &fields), None);
    let instance = GpuVoxelInstance {
        x_axis: x(1.0),
        first_cluster: 2,
        y_axis: x(3.0),
        clusters: 4,
        z_axis: x(5.0),
        first_surface: 6,
        offset: x(7.0),
        albedo: 8,
        cell: IVec3::new(9, 0, 0),
        emission: 10,
        low: x(11.0),
        flags: 12,
        high: x(13.0),
        first_triangle: 14,
    };
    let fields = [
        ("x_axis", bits(1.0)),
        ("first_cluster", 2),
        ("y_axis", bits(3.0)),
        ("clusters", 4),
        ("z_axis", bits(5.0)),
        ("first_surface", 6),
        ("offset", bits(7.0)),
        ("albedo", 8),
        ("cell", 9),
        ("emission", 10),
        ("low", bits(11.0)),
        ("flags", 12),
        ("high", bits(13.0)),
        ("first_triangle", 14),
    ];
    assert_eq!(fault(TYPES, "VoxelInstance", &instance, &fields), None);
    let job = GpuVoxelJob {
        first: 1,
        count: 2,
        instances: 3,
        pad: 4,
    };
    let fields = [("first", 1), ("count", 2), ("instances", 3), ("pad", 4)];
    assert_eq!(fault(TYPES, "VoxelJob", &job, &fields), None);
    let cluster = GpuVoxelCluster {
        low: x(1.0),
        first_triangle: 2,
        high: x(3.0),
        triangles: 4,
    };
    let fields = [
        ("low", bits(1.0)),
        ("first_triangle", 2),
        ("high", bits(3.0)),
        ("triangles", 4),
    ];
    assert_eq!(fault(TYPES, "VoxelCluster", &cluster, &fields), None);
}

/// The text of a struct of a shader that imports others.
fn struct_of(source: &str, name: &str) -> String {
    let start = source
        .find(&format!("struct {name} {{"))
        .expect("the struct is there");
    let length = source[start..].find("\n}").expect("it has an end") + 2;
    source[start..start + length].to_owned()
}

#[test]
fn the_uniform_of_the_lighting_has_one_layout() {
    const LIGHTING: &str = include_str!("../src/lighting.wgsl");
    let lighting = GpuVoxelLighting {
        light_count: 2,
        frame: 3,
        cones: 4,
        least_rate: 5.0,
        aperture: 6.0,
        reach: 7.0,
        light_rays: 8,
        most_visits: 9,
        cursor: 10,
        span: 11,
        pad_a: 12,
    };
    let fields = [
        ("light_count", 2),
        ("frame", 3),
        ("cones", 4),
        ("least_rate", bits(5.0)),
        ("aperture", bits(6.0)),
        ("reach", bits(7.0)),
        ("light_rays", 8),
        ("most_visits", 9),
        ("cursor", 10),
        ("span", 11),
        ("pad_a", 12),
    ];
    let source = struct_of(LIGHTING, "VoxelLighting");
    assert_eq!(fault(&source, "VoxelLighting", &lighting, &fields), None);
    let swapped = source.replacen(
        "cursor: u32,\n    span: u32,",
        "span: u32,\n    cursor: u32,",
        1,
    );
    assert_ne!(swapped, source);
    assert!(fault(&swapped, "VoxelLighting", &lighting, &fields).is_some());
}

#[test]
fn the_uniform_of_the_cones_has_one_layout() {
    const CONES: &str = include_str!("../src/cones.wgsl");
    let cones = GpuCones {
        size: UVec2::new(1, 2),
        scale: 3,
        frame: 4,
        eye: x(5.0),
        cones: 6,
        specular_cones: 7,
        aperture: 8.0,
        reach: 9.0,
        pad_a: 10,
    };
    let fields = [
        ("size", 1),
        ("scale", 3),
        ("frame", 4),
        ("eye", bits(5.0)),
        ("cones", 6),
        ("specular_cones", 7),
        ("aperture", bits(8.0)),
        ("reach", bits(9.0)),
        ("pad_a", 10),
    ];
    let source = struct_of(CONES, "Cones");
    assert_eq!(fault(&source, "Cones", &cones, &fields), None);
    let swapped = source.replacen(
        "    aperture: f32,\n    reach: f32,",
        "    reach: f32,\n    aperture: f32,",
        1,
    );
    assert_ne!(swapped, source);
    assert!(fault(&swapped, "Cones", &cones, &fields).is_some());
}

#[test]
fn the_uniform_of_the_surroundings_has_one_layout() {
    let mut surroundings = GpuVoxelSurroundings {
        ambient: x(1.0),
        intensity: 2.0,
        rotation: x(3.0).extend(0.0),
        last_level: 4.0,
        interior_count: 5,
        light_count: 6,
        mirrors_voxels: 7,
        ..Default::default()
    };
    surroundings.interiors[0].x_row.x = 8.0;
    let fields = [
        ("ambient", bits(1.0)),
        ("intensity", bits(2.0)),
        ("rotation", bits(3.0)),
        ("last_level", bits(4.0)),
        ("interior_count", 5),
        ("light_count", 6),
        ("mirrors_voxels", 7),
        ("interiors", bits(8.0)),
    ];
    let interior = struct_of(SKY, "VoxelInterior");
    let source = interior.clone() + &struct_of(SKY, "VoxelSurroundings");
    let check = |source: &str| fault(source, "VoxelSurroundings", &surroundings, &fields);
    assert_eq!(check(&source), None);
    let swapped = source.replacen(
        "    last_level: f32,\n    interior_count: u32,",
        "    interior_count: u32,\n    last_level: f32,",
        1,
    );
    assert_ne!(swapped, source);
    assert!(check(&swapped).is_some());
    // The number of interiors is written twice.
    assert!(SKY.contains(&format!("array<VoxelInterior, {MOST_INTERIORS}>")));
    assert!(SKY.contains(&format!("MOST_INTERIORS: u32 = {MOST_INTERIORS}u")));
    let row = GpuVoxelInterior {
        x_row: x(1.0).extend(0.0),
        y_row: x(2.0).extend(0.0),
        z_row: x(3.0).extend(0.0),
    };
    let fields = [
        ("x_row", bits(1.0)),
        ("y_row", bits(2.0)),
        ("z_row", bits(3.0)),
    ];
    assert_eq!(fault(&interior, "VoxelInterior", &row, &fields), None);
}

#[test]
fn another_layout_is_noticed() {
    let (level, fields) = marked_level();
    let swapped = TYPES.replacen(
        "anchor: vec3<f32>,\n    voxel_size: f32,",
        "voxel_size: f32,\n    anchor: vec3<f32>,",
        1,
    );
    assert_ne!(swapped, TYPES);
    assert!(fault(&swapped, "VoxelLevel", &level, &fields).is_some());
    let mut marks = fields;
    marks[4].1 = 6;
    assert!(fault(TYPES, "VoxelLevel", &level, &marks).is_some());
}

#[test]
fn the_uniforms_of_soft_shadows_have_one_layout() {
    let light = GpuSoftLight {
        normal: x(1.0),
        two_sided: 2,
        cone_area: 3.0,
        pad_a: 4,
        pad_b: 5,
        pad_c: 6,
    };
    let fields = [
        ("normal", bits(1.0)),
        ("two_sided", 2),
        ("cone_area", bits(3.0)),
        ("pad_a", 4),
        ("pad_b", 5),
        ("pad_c", 6),
    ];
    let of_light = struct_of(SOFT, "SoftLight");
    assert_eq!(fault(&of_light, "SoftLight", &light, &fields), None);
    let shadows = GpuSoftShadows {
        eye: x(7.0),
        parts: 8,
        light_count: 9,
        pad_a: 10,
        pad_b: 11,
        pad_c: 12,
        lights: [light; 4],
    };
    let fields = [
        ("eye", bits(7.0)),
        ("parts", 8),
        ("light_count", 9),
        ("pad_a", 10),
        ("pad_b", 11),
        ("pad_c", 12),
        ("lights", bits(1.0)),
    ];
    let source = of_light + "\n" + &struct_of(SOFT, "SoftShadows");
    assert_eq!(fault(&source, "SoftShadows", &shadows, &fields), None);
    let swapped = source.replacen(
        "    parts: u32,\n    light_count: u32,",
        "    light_count: u32,\n    parts: u32,",
        1,
    );
    assert_ne!(swapped, source);
    assert!(fault(&swapped, "SoftShadows", &shadows, &fields).is_some());
    let casters = GpuCasters {
        corners: [x(13.0).extend(0.0); 2 * MOST_BOXES],
        count: 14,
    };
    let fields = [("corners", bits(13.0)), ("count", 14)];
    let source = struct_of(CASTERS, "Casters");
    assert_eq!(fault(&source, "Casters", &casters, &fields), None);
    assert!(CASTERS.contains(&format!("const MOST_BOXES: u32 = {MOST_BOXES}u;")));
}
