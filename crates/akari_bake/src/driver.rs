//! From geometry to a file: levels, samples, journal, parts.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use akari_visibility::bake::Bake;
use akari_visibility::face::{FACES as FACE_COUNT, world_from_cube_f64};
use akari_visibility::grid::{grid_pieces, grid_sample_count};
use akari_visibility::identity::{BakeSettings, Identity};
use akari_visibility::part::{Part, PartBuilder, Shard, merge};
use akari_visibility::sites::Site;
use akari_visibility::tree::{Tree, TreeBuilder};
use rayon::prelude::*;

use crate::Error;
use crate::fit::{FitQuality, FitSettings, Fitter, Outline};
use crate::geometry::Geometry;
use crate::journal::{Journal, Kind, Record};
use crate::levels::{ChosenLevel, LevelChooser};
use crate::mask::FaceMask;
use crate::morton;
use crate::options::{Options, Phase, Progress, Status};
use crate::report::Report;
use crate::sampling::SamplePoint;

/// Triangles whose levels are one unit of work: a room of 36 triangles is to keep all threads busy.
const LEVEL_UNIT: usize = 4;
/// Samples that are one unit of work.
const SAMPLE_UNIT: usize = 64;
/// Level of a triangle that another shard chooses.
const UNKNOWN: u8 = u8::MAX;

/// What a bake is known by: same scene, same settings.
#[must_use]
pub fn identity(geometry: &Geometry<'_>, options: &Options) -> Identity {
    Identity {
        source: geometry.source(),
        settings: settings(geometry, options).hash(),
    }
}

/// The settings that the file states.
fn settings(geometry: &Geometry<'_>, options: &Options) -> BakeSettings {
    options.settings(geometry.enclosure())
}

/// Bakes `geometry` into the file `output`: a bake, or, if the options name a shard of several, a part for
/// [`merge`](akari_visibility::part::merge).
///
/// The bytes of the file depend on the geometry and the options alone, not on threads, on how often the bake was
/// interrupted, nor (once merged) into how many shards it was cut. Finished work is kept in a journal beside the output
/// ([`crate::journal_path`]); the output itself appears when it is complete.
///
/// Memory: see the crate's documentation.
pub fn bake(
    geometry: &Geometry<'_>,
    options: &Options,
    output: &Path,
    progress: &dyn Progress,
) -> Result<Report, Error> {
    options.check()?;
    match options.threads {
        None => bake_here(geometry, options, output, progress),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Options(format!("cannot start {threads} threads: {e}")))?
            .install(|| bake_here(geometry, options, output, progress)),
    }
}

/// Counts work and tells of it.
struct Meter<'a> {
    progress: &'a dyn Progress,
    phase: Phase,
    total: u64,
    resumed: u64,
    done: AtomicU64,
    start: Instant,
}

impl<'a> Meter<'a> {
    fn new(progress: &'a dyn Progress, phase: Phase, total: u64, resumed: u64) -> Self {
        let meter = Self {
            progress,
            phase,
            total,
            resumed,
            done: AtomicU64::new(resumed),
            start: Instant::now(),
        };
        meter.add(0);
        meter
    }

    fn add(&self, count: u64) {
        let done = self.done.fetch_add(count, Ordering::Relaxed) + count;
        let elapsed = self.start.elapsed();
        let here = done - self.resumed;
        let left = (here > 0).then(|| {
            let share = (self.total - done) as f64 / here as f64;
            Duration::try_from_secs_f64(elapsed.as_secs_f64() * share).unwrap_or(Duration::MAX)
        });
        self.progress.update(&Status {
            phase: self.phase,
            done,
            total: self.total,
            resumed: self.resumed,
            elapsed,
            left,
        });
    }
}

struct Job<'a> {
    geometry: &'a Geometry<'a>,
    options: &'a Options,
    progress: &'a dyn Progress,
    journal: &'a Journal,
    records: &'a [Record],
    /// Place of each triangle in the order along the curve.
    rank: Vec<u32>,
    /// This shard's triangles in that order.
    triangles: Vec<u32>,
}

fn bake_here(
    geometry: &Geometry<'_>,
    options: &Options,
    output: &Path,
    progress: &dyn Progress,
) -> Result<Report, Error> {
    let start = Instant::now();
    let cpu_start = cpu_seconds();
    let identity = identity(geometry, options);
    let triangle_count = geometry.receivers.len() as u32;
    let (journal, records) = Journal::open(
        output,
        &identity,
        options.shard,
        triangle_count,
        options.resume,
    )?;
    let mut report = Report {
        triangles: u64::from(triangle_count),
        ..Report::default()
    };
    if options.resume && is_complete(output, &identity, options.shard, &mut report) {
        journal.remove();
        report.seconds = start.elapsed().as_secs_f64();
        return Ok(report);
    }

    let (rank, triangles) = order(geometry, options.shard);
    let job = Job {
        geometry,
        options,
        progress,
        journal: &journal,
        records: &records,
        rank,
        triangles,
    };
    let levels = job.levels(&mut report)?;
    let sites = job.sites(&levels);
    let units = job.samples(&levels, &sites, &mut report)?;

    let writing = Meter::new(progress, Phase::Writing, sites.len() as u64, 0);
    let mut builder = PartBuilder::new(
        identity,
        settings(geometry, options),
        options.shard,
        triangle_count,
    );
    // One part has to have them; the first is never missing.
    if options.shard.index == 1 {
        builder.topology(geometry.topology.clone());
    }
    add_levels(&mut builder, &levels);
    let mut encoder = TreeBuilder::new();
    for (chunk, record) in sites.chunks(SAMPLE_UNIT).zip(&units) {
        let content = journal.read(record)?;
        let unit = read_samples(&content, chunk.len()).ok_or_else(|| damaged(output))?;
        report.add(&unit.quality);
        for (&site, (position, outlines)) in chunk.iter().zip(&unit.samples) {
            let mut trees = std::array::from_fn(|_| Tree::leaf(0.0));
            for (tree, outline) in trees.iter_mut().zip(outlines) {
                *tree = outline.tree(&mut encoder)?;
            }
            builder.site(site, *position, &trees)?;
        }
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        writing.add(chunk.len() as u64);
    }
    report.samples = sites.len() as u64;
    drop(sites);
    let part = builder.finish()?;
    if options.shard.count == 1 {
        let name = output.display().to_string();
        let bake = merge(&[(name, part)])?;
        bake.write(output)?;
    } else {
        part.write(output)?;
    }
    report.bytes = std::fs::metadata(output).map_or(0, |m| m.len());
    journal.remove();
    report.seconds = start.elapsed().as_secs_f64();
    report.cpu_seconds = cpu_start.zip(cpu_seconds()).map(|(a, b)| b - a);
    Ok(report)
}

fn damaged(output: &Path) -> Error {
    Error::Journal {
        path: crate::journal_path(output),
        problem: "holds other units than this bake; remove it and run the same command again"
            .into(),
    }
}

/// Whether the output is there already, of this scene and these settings.
fn is_complete(output: &Path, identity: &Identity, shard: Shard, report: &mut Report) -> bool {
    let samples = if shard.count == 1 {
        Bake::read(output)
            .ok()
            .filter(|bake| bake.identity == *identity)
            .map(|bake| bake.trees.len())
    } else {
        Part::read(output)
            .ok()
            .filter(|part| part.identity == *identity && part.shard == shard)
            .map(|part| part.trees.len())
    };
    let Some(samples) = samples else { return false };
    report.was_complete = true;
    report.samples = samples as u64;
    report.resumed_samples = samples as u64;
    report.bytes = std::fs::metadata(output).map_or(0, |m| m.len());
    true
}

/// Places of all triangles along a curve through space, and the triangles of the shard in that order.
fn order(geometry: &Geometry<'_>, shard: Shard) -> (Vec<u32>, Vec<u32>) {
    let corners: Vec<glam::Vec3> = {
        let all = geometry.receivers.iter().flatten().copied();
        let min = all.clone().reduce(glam::Vec3::min).unwrap_or_default();
        let max = all.reduce(glam::Vec3::max).unwrap_or_default();
        vec![min, max]
    };
    let mut order: Vec<(u64, u32)> = geometry
        .receivers
        .iter()
        .zip(0_u32..)
        .map(|([a, b, c], t)| (morton::key((*a + *b + *c) / 3.0, &corners), t))
        .collect();
    order.sort_unstable();
    let mut rank = vec![0; order.len()];
    for (&(_, t), r) in order.iter().zip(0_u32..) {
        rank[t as usize] = r;
    }
    let bound = |k: u32| (order.len() as u64 * u64::from(k) / u64::from(shard.count)) as usize;
    let range = bound(shard.index - 1)..bound(shard.index);
    (rank, order[range].iter().map(|&(_, t)| t).collect())
}

/// Vertices in the order in which a whole bake samples them.
pub(crate) fn vertices_along_curve(geometry: &Geometry<'_>) -> Vec<u32> {
    let (_, triangles) = order(geometry, Shard { index: 1, count: 1 });
    let mut seen = vec![false; geometry.adjacency.vertex_count()];
    triangles
        .iter()
        .flat_map(|&t| geometry.topology.triangles[t as usize])
        .filter(|&v| !std::mem::replace(&mut seen[v as usize], true))
        .collect()
}

fn add_levels(builder: &mut PartBuilder, levels: &[u8]) {
    let mut first = 0_u32;
    for run in levels.chunk_by(|a, b| (*a == UNKNOWN) == (*b == UNKNOWN)) {
        if run[0] != UNKNOWN {
            builder.levels(first, run);
        }
        first += run.len() as u32;
    }
}

impl Job<'_> {
    /// Content of the units of a kind that are in the journal, by number.
    fn found(&self, kind: Kind, count: usize) -> Vec<Option<Record>> {
        let mut found = vec![None; count];
        for record in self.records.iter().filter(|r| r.kind == kind) {
            if let Some(slot) = found.get_mut(record.unit as usize) {
                *slot = Some(*record);
            }
        }
        found
    }

    /// The level of each triangle of this shard.
    fn levels(&self, report: &mut Report) -> Result<Vec<u8>, Error> {
        let count = self.triangles.len().div_ceil(LEVEL_UNIT);
        let found = self.found(Kind::Levels, count);
        let chunk = |unit: usize| {
            let end = (LEVEL_UNIT * (unit + 1)).min(self.triangles.len());
            &self.triangles[LEVEL_UNIT * unit..end]
        };
        let resumed = (0..count)
            .filter(|&unit| found[unit].is_some())
            .map(|unit| chunk(unit).len() as u64)
            .sum();
        let meter = Meter::new(
            self.progress,
            Phase::Levels,
            self.triangles.len() as u64,
            resumed,
        );
        let cancelled = || self.progress.cancelled();
        let chosen: Vec<Vec<u8>> = (0..count)
            .into_par_iter()
            .map_init(
                || LevelChooser::new(self.geometry, self.options),
                |chooser, unit| {
                    if let Some(record) = &found[unit] {
                        let content = self.journal.read(record)?;
                        if content.len() == chunk(unit).len() {
                            return Ok(content);
                        }
                    }
                    let content = chunk(unit)
                        .iter()
                        .map(|&t| chooser.choose(t, &cancelled).map(ChosenLevel::to_byte))
                        .collect::<Option<Vec<u8>>>()
                        .ok_or(Error::Cancelled)?;
                    self.journal.append(Kind::Levels, unit as u32, &content)?;
                    meter.add(content.len() as u64);
                    Ok(content)
                },
            )
            .collect::<Result<_, Error>>()?;
        let mut levels = vec![UNKNOWN; self.geometry.receivers.len()];
        for (&t, &byte) in self.triangles.iter().zip(chosen.iter().flatten()) {
            let ChosenLevel { level, capped } = ChosenLevel::from_byte(byte);
            levels[t as usize] = level;
            report.capped_triangles += u64::from(capped);
            let at = usize::from(level);
            if report.levels.len() <= at {
                report.levels.resize(at + 1, 0);
            }
            report.levels[at] += 1;
        }
        Ok(levels)
    }

    /// The sites that this shard samples: those of its triangles that no triangle earlier on the curve has.
    ///
    /// Whatever the shards, each site has one owner, so that nothing is sampled twice. Where the triangle that shares
    /// an edge is another shard's, its level is not known here, and points may be sampled that nobody will need.
    fn sites(&self, levels: &[u8]) -> Vec<Site> {
        let triangles = &self.geometry.topology.triangles;
        let adjacency = &self.geometry.adjacency;
        let mut sites = Vec::new();
        for &t in &self.triangles {
            let level = u32::from(levels[t as usize]);
            let vertices = triangles[t as usize];
            let n = grid_pieces(level);
            sites.reserve(grid_sample_count(level) as usize);
            // A triangle that has a vertex twice has sites twice.
            let begin = sites.len();
            for j in 0..=n {
                for i in 0..=n - j {
                    let site = Site::of(t, vertices, level, i, j);
                    let first = |other: usize| self.rank[other] < self.rank[t as usize];
                    let owned = match site {
                        Site::Vertex(v) => !adjacency.corners(v).any(|(o, _)| first(o)),
                        Site::Edge {
                            low, high, level, ..
                        } => {
                            !adjacency.edge(triangles, low, high).any(first)
                                && !adjacency
                                    .edge(triangles, low, high)
                                    .any(|o| levels[o] < level)
                        }
                        Site::Interior { .. } => true,
                    };
                    let twice = vertices[0] == vertices[1]
                        || vertices[1] == vertices[2]
                        || vertices[2] == vertices[0];
                    if owned && !(twice && sites[begin..].contains(&site)) {
                        sites.push(site);
                    }
                }
            }
        }
        sites
    }

    /// Makes all units of samples, and tells where they are in the journal.
    fn samples(
        &self,
        levels: &[u8],
        sites: &[Site],
        report: &mut Report,
    ) -> Result<Vec<Record>, Error> {
        let chunks: Vec<&[Site]> = sites.chunks(SAMPLE_UNIT).collect();
        let found = self.found(Kind::Samples, chunks.len());
        let resumed = chunks
            .iter()
            .zip(&found)
            .filter(|(_, record)| record.is_some())
            .map(|(chunk, _)| chunk.len() as u64)
            .sum();
        report.resumed_samples = resumed;
        let meter = Meter::new(self.progress, Phase::Samples, sites.len() as u64, resumed);
        (0..chunks.len())
            .into_par_iter()
            .map_init(
                || Sampler::new(self.geometry, self.options),
                |sampler, unit| {
                    if let Some(record) = found[unit] {
                        return Ok(record);
                    }
                    let mut content = Unit::default();
                    for &site in chunks[unit] {
                        if self.progress.cancelled() {
                            return Err(Error::Cancelled);
                        }
                        let neighbours = || {
                            let owner = self.geometry.owner(site, &self.rank);
                            owner.map_or_else(Vec::new, |t| {
                                let level = levels[t as usize].into();
                                self.geometry.neighbours(site, t, level)
                            })
                        };
                        sampler.sample(site, neighbours, &mut content);
                    }
                    let bytes = content.finish();
                    let record = self.journal.append(Kind::Samples, unit as u32, &bytes)?;
                    meter.add(chunks[unit].len() as u64);
                    Ok(record)
                },
            )
            .collect()
    }
}

impl ChosenLevel {
    const CAPPED: u8 = 1 << 7;

    fn to_byte(self) -> u8 {
        self.level | if self.capped { Self::CAPPED } else { 0 }
    }

    fn from_byte(byte: u8) -> Self {
        Self {
            level: byte & !Self::CAPPED,
            capped: byte & Self::CAPPED != 0,
        }
    }
}

/// Makes samples; one per thread.
struct Sampler<'a> {
    geometry: &'a Geometry<'a>,
    options: &'a Options,
    masks: [FaceMask; FACE_COUNT],
    fitter: Fitter,
}

impl<'a> Sampler<'a> {
    fn new(geometry: &'a Geometry<'a>, options: &'a Options) -> Self {
        Self {
            geometry,
            options,
            masks: std::array::from_fn(|_| FaceMask::new(options.face_size)),
            fitter: Fitter::new(FitSettings {
                tolerance: options.leaf_tolerance,
                max_depth: options.max_depth,
            }),
        }
    }

    fn see(&mut self, site: Site) -> (SamplePoint, bool) {
        let point = self.geometry.sample_point(site);
        self.geometry
            .see(&point, self.options.max_distance, &mut self.masks);
        let buried = self.geometry.is_buried(&point, &self.masks);
        (point, buried)
    }

    /// Samples a site into `unit`. `neighbours` tells where else it may be taken from.
    fn sample(&mut self, site: Site, neighbours: impl Fn() -> Vec<Site>, unit: &mut Unit) {
        let (mut point, buried) = self.see(site);
        if buried {
            let open = neighbours().into_iter().find_map(|neighbour| {
                let (point, buried) = self.see(neighbour);
                (!buried).then_some(point)
            });
            match open {
                Some(neighbour) => point = neighbour,
                // All around is buried too: it is as dark as it looks, and nobody sees it.
                None => (point, _) = self.see(site),
            }
        }
        let position = (world_from_cube_f64(point.position) + self.geometry.origin).as_vec3();
        for component in position.to_array() {
            unit.bytes.extend(component.to_le_bytes());
        }
        for mask in &self.masks {
            unit.quality.add(&self.fitter.fit_outline(mask));
            for word in &self.fitter.outline().0 {
                unit.bytes.extend(word.to_le_bytes());
            }
        }
    }
}

/// Samples on their way into the journal.
#[derive(Default)]
struct Unit {
    bytes: Vec<u8>,
    quality: FitQuality,
}

impl Unit {
    /// Quality last.
    fn finish(mut self) -> Vec<u8> {
        let q = self.quality;
        for number in [q.leaves, q.texels, q.misclassified] {
            self.bytes.extend(number.to_le_bytes());
        }
        self.bytes.extend(q.absolute_error.to_le_bytes());
        self.bytes
    }
}

struct ReadUnit {
    samples: Vec<([f32; 3], [Outline; FACE_COUNT])>,
    quality: FitQuality,
}

/// What [`Unit`] wrote; none if it is something else.
fn read_samples(bytes: &[u8], count: usize) -> Option<ReadUnit> {
    let mut rest = bytes;
    let mut samples = Vec::with_capacity(count);
    for _ in 0..count {
        let mut position = [0.0; 3];
        for component in &mut position {
            *component = f32::from_le_bytes(take(&mut rest)?);
        }
        let mut outlines = std::array::from_fn(|_| Outline::default());
        for outline in &mut outlines {
            let mut words = std::iter::from_fn(|| take(&mut rest).map(u32::from_le_bytes));
            *outline = Outline::read(&mut words)?;
        }
        samples.push((position, outlines));
    }
    let mut number = || take(&mut rest).map(u32::from_le_bytes);
    let (leaves, texels, misclassified) = (number()?, number()?, number()?);
    let absolute_error = f64::from_le_bytes(take(&mut rest)?);
    rest.is_empty().then_some(ReadUnit {
        samples,
        quality: FitQuality {
            leaves,
            texels,
            misclassified,
            absolute_error,
        },
    })
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = rest.split_first_chunk()?;
    *rest = tail;
    Some(*head)
}

/// CPU time of the process so far.
fn cpu_seconds() -> Option<f64> {
    /// Clock ticks per second in `/proc`, the same on all Linux systems.
    const TICKS: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name of the process, in parentheses, may hold anything.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    // Fields 14 and 15 of proc(5); the first after the name is field 3.
    let user: f64 = fields.nth(11)?.parse().ok()?;
    let system: f64 = fields.next()?.parse().ok()?;
    Some((user + system) / TICKS)
}
