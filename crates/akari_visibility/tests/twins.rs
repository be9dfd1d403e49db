//! Every WGSL function of this crate against its Rust twin.
//!
//! The twins themselves are tested beside their code; the traversal as a whole is in `gpu.rs`.

use akari_gpu_test::{
    Gpu, Kernel, compose_module, gpu_or_skip, module_functions, run_kernel, ulp_distance,
};
use akari_visibility::WGSL_MODULES;
use akari_visibility::face::*;
use akari_visibility::grid::*;
use akari_visibility::sites::Hanging;
use akari_visibility::tree::*;
use glam::{Vec2, Vec3};
use std::collections::BTreeSet;

struct Case {
    module: &'static str,
    functions: &'static [&'static str],
    body: &'static str,
    inputs: usize,
    outputs: usize,
    rows: Vec<f32>,
    twin: fn(&[f32], &mut Vec<f32>),
    /// Units in the last place by which a device may differ; what only moves and adds exact numbers may not.
    ulp: u32,
    /// Changes of the source that must be noticed: from, to.
    mutations: &'static [(&'static str, &'static str)],
}

const HELPERS: &str = "
fn x_bits(i: u32) -> u32 { return u32(x(i)) | (u32(x(i + 1u)) << 16u); }
fn x_vec3(i: u32) -> vec3<f32> { return vec3<f32>(x(i), x(i + 1u), x(i + 2u)); }
fn y_vec2(i: u32, v: vec2<f32>) { y(i, v.x); y(i + 1u, v.y); }
fn y_vec3(i: u32, v: vec3<f32>) { y(i, v.x); y(i + 1u, v.y); y(i + 2u, v.z); }
// The halves of a word as whole numbers, which every f32 holds exactly.
fn y_bits(i: u32, bits: u32) { y(i, f32(bits & 0xffffu)); y(i + 1u, f32(bits >> 16u)); }
";

fn halves(bits: u32) -> [f32; 2] {
    [(bits & 0xffff) as f32, (bits >> 16) as f32]
}

fn bits(row: &[f32]) -> u32 {
    row[0] as u32 | (row[1] as u32) << 16
}

/// Words without a pattern (`SplitMix64`, Steele et al. 2014).
fn words(count: u64) -> impl Iterator<Item = u32> {
    (1..=count).map(|i| {
        let mut z = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as u32
    })
}

fn numbers(count: u64) -> impl Iterator<Item = f32> {
    words(count).map(|word| word as f32 / 4_294_967_296.0 * 2.0 - 1.0)
}

/// Directions to all faces: without a pattern, and where faces meet.
fn directions() -> Vec<[f32; 3]> {
    let random: Vec<f32> = numbers(900).collect();
    let mut directions: Vec<[f32; 3]> =
        random.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
    for i in 0..27 {
        directions.push([i % 3, i / 3 % 3, i / 9].map(|x| x as f32 - 1.0));
    }
    directions
}

/// Lines: all pairs of ends of some, equal ends included.
fn lines() -> Vec<u32> {
    let ends = [
        0, 1, 4096, 8191, 8192, 12_000, 16_384, 20_001, 24_576, 30_000, 32_767,
    ];
    let mut lines: Vec<u32> = ends
        .iter()
        .flat_map(|&a| ends.map(|b| a | b << LINE_STEP_BITS))
        .collect();
    lines.extend(words(300).map(|word| word & 0x3fff_ffff));
    lines
}

fn face_cases() -> Vec<Case> {
    let module = "akari_visibility::face";
    let faces_and_directions = || {
        (0..6)
            .flat_map(|face| {
                directions()
                    .into_iter()
                    .flat_map(move |[a, b, c]| [face as f32, a, b, c])
            })
            .collect::<Vec<f32>>()
    };
    vec![
        Case {
            module,
            functions: &["face_permute", "face_sign", "face_direction"],
            body: "let face = u32(x(0u));
                y_vec3(0u, face_permute(face, x_vec3(1u)));
                y(3u, face_sign(face));
                y_vec3(4u, face_direction(face, x_vec3(1u).xy));",
            inputs: 4,
            outputs: 7,
            rows: faces_and_directions(),
            twin: |x, y| {
                let (face, v) = (x[0] as u32, Vec3::from_slice(&x[1..]));
                y.extend(face_permute(face, v).to_array());
                y.push(face_sign(face));
                y.extend(face_direction(face, v.truncate()).to_array());
            },
            ulp: 0,
            mutations: &[
                ("v.zxy", "v.yzx"),
                ("v.yzx", "v.zxy"),
                ("select(1.0, -1.0", "select(-1.0, 1.0"),
            ],
        },
        Case {
            module,
            functions: &["cube_from_world", "world_from_cube"],
            body: "y_vec3(0u, cube_from_world(x_vec3(0u))); y_vec3(3u, world_from_cube(x_vec3(0u)));",
            inputs: 3,
            outputs: 6,
            rows: directions().concat(),
            twin: |x, y| {
                let v = Vec3::from_slice(x);
                y.extend(cube_from_world(v).to_array());
                y.extend(world_from_cube(v).to_array());
            },
            // Sums of three products, which may cancel.
            ulp: 64,
            mutations: &[
                ("dot(v, CUBE_X)", "dot(v, CUBE_Y)"),
                ("v.y * CUBE_Y", "v.z * CUBE_Y"),
            ],
        },
        Case {
            module,
            functions: &["face_of"],
            body: "let p = face_of(x_vec3(0u)); y(0u, f32(p.face)); y_vec2(1u, p.at);",
            inputs: 3,
            outputs: 3,
            rows: directions().concat(),
            twin: |x, y| {
                let point = face_of(Vec3::from_slice(x));
                y.extend([point.face as f32, point.at.x, point.at.y]);
            },
            // A division.
            ulp: 3,
            mutations: &[
                ("size.y >= size.z {", "size.y > size.z {"),
                ("size.x >= size.y", "size.x > size.y"),
                ("local = direction.yzx", "local = direction.zxy"),
                ("local = direction.zxy", "local = direction.yzx"),
                ("/ abs(local.z)", "/ local.z"),
                ("select(0u, 1u, local.z < 0.0)", "0u"),
                ("local.z == 0.0", "local.z == 7.0"),
            ],
        },
        Case {
            module,
            functions: &["face_side", "face_onto_side"],
            body: "let face = u32(x(0u));
                for (var side = 0u; side < 4u; side++) {
                    y_vec3(6u * side, face_side(face, side));
                    y_vec3(6u * side + 3u, face_onto_side(face, side, x_vec3(1u)));
                }",
            inputs: 4,
            outputs: 24,
            rows: faces_and_directions(),
            twin: |x, y| {
                let (face, v) = (x[0] as u32, Vec3::from_slice(&x[1..]));
                for side in 0..4 {
                    y.extend(face_side(face, side).to_array());
                    y.extend(face_onto_side(face, side, v).to_array());
                }
            },
            ulp: 0,
            mutations: &[
                (
                    "select(-SQRT_HALF, SQRT_HALF",
                    "select(SQRT_HALF, -SQRT_HALF",
                ),
                ("if side < 2u {", "if side < 3u {"),
                ("select(depth, -depth", "select(-depth, depth"),
                ("> 0.25 * abs(depth)", "> 0.75 * abs(depth)"),
                ("(forward + lateral) >", "lateral >"),
            ],
        },
        Case {
            module,
            functions: &["border_point", "unpack_line"],
            body: "let line = x_bits(0u);
                y_vec2(0u, border_point(line & 0x7fffu));
                y_vec3(2u, unpack_line(line));",
            inputs: 2,
            outputs: 5,
            rows: lines().into_iter().flat_map(halves).collect(),
            twin: |x, y| {
                y.extend(border_point(bits(x) & 0x7fff).to_array());
                y.extend(unpack_line(bits(x)).to_array());
            },
            ulp: 0,
            mutations: &[
                ("SIDE_STEP_BITS: u32 = 13u", "SIDE_STEP_BITS: u32 = 12u"),
                ("f32(side & 2u)", "f32(side & 1u)"),
                ("(side & 1u) == 0u", "(side & 1u) == 1u"),
                ("p.y - q.y", "q.y - p.y"),
                ("p.x * q.y - q.x * p.y", "p.x * q.y + q.x * p.y"),
            ],
        },
        Case {
            module,
            functions: &["line_height", "line_normal"],
            body: "let line = x_bits(0u);
                y(0u, line_height(line, vec2<f32>(x(2u), x(3u))));
                y_vec3(1u, line_normal(u32(x(4u)), line));",
            inputs: 5,
            outputs: 4,
            rows: lines()
                .into_iter()
                .zip(directions().into_iter().cycle())
                .enumerate()
                .flat_map(|(i, (line, [a, b, _]))| {
                    let [low, high] = halves(line);
                    [low, high, a, b, (i % 6) as f32]
                })
                .collect(),
            twin: |x, y| {
                y.push(line_height(bits(x), Vec2::new(x[2], x[3])));
                y.extend(line_normal(x[4] as u32, bits(x)).to_array());
            },
            // A sum that a device may fuse; near 0 on the line.
            ulp: 4,
            mutations: &[
                (
                    "line.x * at.x + line.y * at.y",
                    "line.x * at.y + line.y * at.x",
                ),
                ("face_sign(face) * line.z", "line.z"),
            ],
        },
    ]
}

fn tree_cases() -> Vec<Case> {
    vec![Case {
        module: "akari_visibility::tree",
        functions: &["leaf_visibility", "tree_word", "tree_node"],
        body: "let node = tree_node(x_bits(0u), x_bits(2u), x_bits(4u));
            y_bits(0u, node.line); y_bits(2u, node.negative); y_bits(4u, node.positive);
            y_bits(6u, tree_word(x_bits(0u)));
            y(8u, leaf_visibility(x_bits(2u)));",
        inputs: 6,
        outputs: 9,
        rows: words(600)
            .zip(words(1200).skip(600))
            .enumerate()
            .flat_map(|(i, (a, b))| {
                // Each kind, at even and odd indices, up to the last one.
                let kind = (i as u32 / 2 % 4) << 30;
                let index = if i % 5 == 0 {
                    (1 << 30) - 1 - i as u32
                } else {
                    i as u32
                };
                let head = (a & 0x3fff_ffff) | kind;
                let (word0, word1) = if index.is_multiple_of(2) {
                    (head, b)
                } else {
                    (head << 16 | (a & 0xff), head >> 16 | b << 16)
                };
                [halves(index), halves(word0), halves(word1)].concat()
            })
            .collect(),
        twin: |x, y| {
            let node = tree_node(bits(x), bits(&x[2..]), bits(&x[4..]));
            for word in [node.line, node.negative, node.positive, tree_word(bits(x))] {
                y.extend(halves(word));
            }
            y.push(leaf_visibility(bits(&x[2..])));
        },
        // A division.
        ulp: 3,
        mutations: &[
            ("(index & 1u) == 1u", "(index & 1u) == 0u"),
            ("(word0 >> 16u) | (word1 << 16u)", "(word0 >> 16u)"),
            (
                "select(word1 & 0xffffu, word1 >> 16u",
                "select(word1 & 0xffu, word1 >> 16u",
            ),
            ("TREE_LEAF | (payload >> 8u)", "(payload >> 8u)"),
            ("kind == KIND_ONE_LEAF", "kind == 3u"),
            ("index + 1u + payload", "index + payload"),
            ("KIND_NO_LEAF: u32 = 2u", "KIND_NO_LEAF: u32 = 3u"),
            ("(3u * index) >> 1u", "(3u * index + 1u) >> 1u"),
            ("/ 255.0", "/ 256.0"),
        ],
    }]
}

fn grid_cases() -> Vec<Case> {
    let module = "akari_visibility::grid";
    vec![
        Case {
            module,
            functions: &[
                "grid_pieces",
                "grid_sample_count",
                "grid_local_index",
                "grid_triangle",
            ],
            body: "let word = x_bits(0u);
                let t = grid_triangle(word);
                y(0u, f32(t.level)); y_bits(1u, t.first);
                y(3u, f32(grid_pieces(t.level))); y_bits(4u, grid_sample_count(t.level));
                let n = grid_pieces(t.level);
                let j = u32(x(2u) * f32(n));
                y_bits(6u, grid_local_index(t.level, n - j, j));",
            inputs: 3,
            outputs: 8,
            rows: words(400)
                .zip(numbers(400))
                .flat_map(|(word, t)| {
                    let [low, high] = halves(word);
                    [low, high, t.abs()]
                })
                .collect(),
            twin: |x, y| {
                let triangle = grid_triangle(bits(x));
                let level = triangle.level;
                y.push(level as f32);
                y.extend(halves(triangle.first));
                let n = grid_pieces(level);
                y.push(n as f32);
                y.extend(halves(grid_sample_count(level)));
                let j = (x[2] * n as f32) as u32;
                y.extend(halves(grid_local_index(level, n - j, j)));
            },
            ulp: 0,
            mutations: &[
                ("min(level, MAX_LEVEL)", "level"),
                ("(n + 1u) * (n + 2u) / 2u", "(n + 1u) * (n + 1u) / 2u"),
                ("2u * n + 3u - j", "2u * n + 2u - j"),
                ("word >> LEVEL_SHIFT", "word >> 29u"),
                ("(1u << LEVEL_SHIFT) - 1u", "(1u << 27u) - 1u"),
            ],
        },
        Case {
            module,
            functions: &["micro_triangle"],
            body:
                "let cell = micro_triangle(u32(x(0u)), x_vec3(1u));
                y_vec3(0u, cell.weights);
                y_bits(3u, cell.samples.x); y_bits(5u, cell.samples.y); y_bits(7u, cell.samples.z);",
            inputs: 4,
            outputs: 9,
            rows: (0..=11)
                .flat_map(|level| {
                    let outside = [
                        [-0.5, 0.2],
                        [1.5, 0.1],
                        [0.7, 0.7],
                        [0.0, 1.0],
                        [1.0, 0.0],
                        [1e9, -1e9],
                    ];
                    let inside: Vec<f32> = numbers(120).map(f32::abs).collect();
                    inside
                        .chunks_exact(2)
                        .map(|p| {
                            if p[0] + p[1] > 1.0 {
                                [1.0 - p[0], 1.0 - p[1]]
                            } else {
                                [p[0], p[1]]
                            }
                        })
                        .chain(outside)
                        .flat_map(|[b, c]| [level as f32, 1.0 - b - c, b, c])
                        .collect::<Vec<f32>>()
                })
                .collect(),
            twin: |x, y| {
                let cell = micro_triangle(x[0] as u32, Vec3::from_slice(&x[1..]));
                y.extend(cell.weights.to_array());
                y.extend(cell.samples.into_iter().flat_map(halves));
            },
            // A division, and a difference from 1.
            ulp: 8,
            mutations: &[
                ("sum > 1.0 && i + j + 1u < n", "i + j + 1u < n"),
                ("sum > 1.0 && i + j + 1u < n", "sum > 1.0"),
                (
                    "1.0 - fy, sum - 1.0, 1.0 - fx",
                    "1.0 - fx, sum - 1.0, 1.0 - fy",
                ),
                ("1.0 / max(sum, 1.0)", "1.0"),
                ("min(u32(x), n - 1u)", "u32(x)"),
                ("n - 1u - i", "n - 1u"),
                ("clamp(barycentrics.z, 0.0, 1.0)", "barycentrics.y"),
                ("clamp(y - f32(j), 0.0, 1.0)", "(y - f32(j))"),
            ],
        },
    ]
}

fn table() -> Vec<Case> {
    [face_cases(), tree_cases(), grid_cases()]
        .into_iter()
        .flatten()
        .collect()
}

impl Case {
    fn expected(&self) -> Vec<f32> {
        let mut output = Vec::new();
        for (index, row) in self.rows.chunks_exact(self.inputs).enumerate() {
            (self.twin)(row, &mut output);
            assert_eq!(
                output.len(),
                (index + 1) * self.outputs,
                "{:?}",
                self.functions
            );
        }
        output
    }

    fn on_device(&self, gpu: &Gpu, mutation: Option<(&str, &str)>) -> Vec<f32> {
        let modules: Vec<(&str, String)> = akari_math::WGSL_MODULES
            .iter()
            .chain(WGSL_MODULES)
            .map(|&(path, source)| match mutation {
                Some((from, to)) if path == self.module => {
                    assert!(source.contains(from), "{path}: nothing to mutate: {from}");
                    (path, source.replacen(from, to, 1))
                }
                _ => (path, source.to_owned()),
            })
            .collect();
        let modules: Vec<(&str, &str)> = modules.iter().map(|(p, s)| (*p, s.as_str())).collect();
        let header = format!(
            "#import {}::{{{}}}\n{HELPERS}",
            self.module,
            self.functions.join(", ")
        );
        let kernel = Kernel {
            header: &header,
            body: self.body,
            inputs: self.inputs,
            outputs: self.outputs,
        };
        run_kernel(gpu, &modules, &kernel, &self.rows)
            .unwrap_or_else(|error| panic!("{:?}, {mutation:?}: {error}", self.functions))
    }

    /// The first output that is off by more than allowed: near 0, by more than that of a number of size 1.
    fn violation(&self, actual: &[f32], expected: &[f32]) -> Option<String> {
        let allowed = |e: f32| self.ulp as f32 * f32::EPSILON * e.abs().max(1.0);
        let bad = actual.iter().zip(expected).position(|(&a, &e)| {
            // Not finite: never; −0 is 0.
            !(a.is_finite() && (ulp_distance(a, e) == 0 || (a - e).abs() <= allowed(e)))
        })?;
        Some(format!(
            "output {bad}: {} for {}",
            actual[bad], expected[bad]
        ))
    }
}

#[test]
fn wgsl_agrees_with_the_rust_twins() {
    let Some(gpu) = gpu_or_skip("wgsl_agrees_with_the_rust_twins") else {
        return;
    };
    for case in table() {
        let violation = case.violation(&case.on_device(gpu, None), &case.expected());
        assert_eq!(violation, None, "{:?}", case.functions);
    }
}

#[test]
fn every_mutation_is_noticed() {
    let Some(gpu) = gpu_or_skip("every_mutation_is_noticed") else {
        return;
    };
    let mut missed = Vec::new();
    for case in table() {
        let expected = case.expected();
        for &mutation in case.mutations {
            let actual = case.on_device(gpu, Some(mutation));
            if case.violation(&actual, &expected).is_none() {
                missed.push(mutation);
            }
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

fn all_modules() -> Vec<(&'static str, &'static str)> {
    [akari_math::WGSL_MODULES, WGSL_MODULES].concat()
}

#[test]
fn every_function_is_tested() {
    let covered: BTreeSet<&str> = table()
        .iter()
        .flat_map(|case| case.functions.iter().copied())
        .collect();
    for (path, _) in WGSL_MODULES {
        let functions =
            module_functions(&all_modules(), path).unwrap_or_else(|e| panic!("{path}: {e}"));
        for function in functions {
            // `gpu.rs` runs the traversal as a whole.
            let is_traversal =
                *path == "akari_visibility::query" && function.starts_with("traversal_");
            assert!(
                is_traversal || covered.contains(function.as_str()),
                "{path}::{function}"
            );
        }
    }
}

#[test]
fn modules_are_pure() {
    for (path, _) in WGSL_MODULES {
        let module = compose_module(&all_modules(), path).unwrap_or_else(|e| panic!("{path}: {e}"));
        assert!(
            module.global_variables.is_empty() && module.entry_points.is_empty(),
            "{path} is not pure"
        );
    }
}

/// Constants that are in both languages, and the one structure that is in a buffer.
#[test]
fn both_languages_have_the_same_constants() {
    use akari_visibility::query::{MAX_LIGHT_VERTICES, ON_PLANE, POLYGON_POOL};
    let modules = all_modules();
    let expected: [(&str, &str, f64); 13] = [
        ("face", "FACES", FACES as f64),
        (
            "face",
            "LINE_STEPS_PER_UNIT",
            f64::from(LINE_STEPS_PER_UNIT),
        ),
        ("face", "LINE_STEP_BITS", f64::from(LINE_STEP_BITS)),
        ("face", "SIDE_STEPS", f64::from(2 * LINE_STEPS_PER_UNIT)),
        ("tree", "TREE_LEAF", f64::from(TreeLink::LEAF)),
        ("grid", "MAX_LEVEL", f64::from(MAX_LEVEL)),
        ("grid", "ENTRY_HANGING", f64::from(ENTRY_HANGING)),
        ("query", "POLYGON_POOL", POLYGON_POOL as f64),
        ("query", "MAX_LIGHT_VERTICES", MAX_LIGHT_VERTICES as f64),
        ("query", "MAX_PENDING", MAX_PENDING as f64),
        ("query", "ON_PLANE", f64::from(ON_PLANE)),
        ("query", "SIDE", f64::from(0x7fff_fff0)),
        ("query", "NOTHING", f64::from(0x7fff_ffff)),
    ];
    for (name, constant, value) in expected {
        let path = format!("akari_visibility::{name}");
        let module = compose_module(&modules, &path).unwrap_or_else(|e| panic!("{path}: {e}"));
        let (_, found) = module
            .constants
            .iter()
            .find(|(_, c)| c.name.as_deref() == Some(constant))
            .unwrap_or_else(|| panic!("{path} has no {constant}"));
        let literal = match module.global_expressions[found.init] {
            naga::Expression::Literal(naga::Literal::U32(value)) => f64::from(value),
            naga::Expression::Literal(naga::Literal::F32(value)) => f64::from(value),
            ref other => panic!("{path}::{constant} is {other:?}"),
        };
        assert_eq!(literal, value, "{path}::{constant}");
    }
    let module = compose_module(&modules, "akari_visibility::grid").expect("it composes");
    let hanging = module
        .types
        .iter()
        .find(|(_, t)| t.name.as_deref() == Some("Hanging"));
    let Some((
        _,
        naga::Type {
            inner: naga::TypeInner::Struct { members, span },
            ..
        },
    )) = hanging
    else {
        panic!("no structure Hanging");
    };
    assert_eq!(*span as usize, size_of::<Hanging>());
    let offsets: Vec<usize> = members
        .iter()
        .map(|member| member.offset as usize)
        .collect();
    assert_eq!(
        offsets,
        [
            std::mem::offset_of!(Hanging, first),
            std::mem::offset_of!(Hanging, second),
            std::mem::offset_of!(Hanging, weight),
        ]
    );
}
