//! Visibility of a scene made by code, baked in the background at the first start and kept in a file.
//!
//! A glTF scene needs none of this: `akari bake SCENE.glb --out SCENE.akari` makes the file, and
//! `BakedVisibility(asset_server.load("SCENE.akari"))` loads it.

use akari_bake::{Geometry, GeometryOptions, MeshInput, Options, Phase, Progress, Roles, Status};
use bevy::math::{Affine3A, DAffine3, DMat3, DVec3, Vec3A};
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari::visibility::bake::Bake;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A mesh that throws and receives baked shadows.
#[derive(Debug, Clone)]
pub struct StaticMesh {
    name: String,
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    world_from_mesh: DAffine3,
}

impl StaticMesh {
    /// A mesh as it stands in the world.
    ///
    /// # Errors
    /// If it is no list of triangles with positions on the CPU.
    pub fn new(name: &str, mesh: &Mesh, place: &Transform) -> Result<Self, String> {
        Self::placed(name, mesh, &place.compute_affine())
    }

    /// The same with its place in the world as it is.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn placed(name: &str, mesh: &Mesh, affine: &Affine3A) -> Result<Self, String> {
        let Some(VertexAttributeValues::Float32x3(positions)) =
            mesh.attribute(Mesh::ATTRIBUTE_POSITION)
        else {
            return Err(format!("{name}: a mesh without positions"));
        };
        let mut indices: Vec<u32> = match mesh.indices() {
            Some(indices) => indices.iter().map(|i| i as u32).collect(),
            None => (0..positions.len() as u32).collect(),
        };
        indices.truncate(indices.len() / 3 * 3);
        let column = |v: Vec3A| DVec3::from(Vec3::from(v));
        let m = affine.matrix3;
        Ok(Self {
            name: name.to_owned(),
            positions: positions.iter().copied().map(Vec3::from).collect(),
            triangles: indices
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect(),
            world_from_mesh: DAffine3::from_mat3_translation(
                DMat3::from_cols(column(m.x_axis), column(m.y_axis), column(m.z_axis)),
                column(affine.translation),
            ),
        })
    }
}

impl StaticMesh {
    /// In the space of the mesh.
    #[must_use]
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Indices of their corners.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
}

/// Where the bake is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BakeFile {
    /// Beside the program, in Cargo's target folder. Replaced without asking if it does not fit.
    Kept(PathBuf),
    /// Where the user says. Never replaced by anything else.
    Named(PathBuf),
}

impl BakeFile {
    /// `named`, or a file of this name beside the program.
    ///
    /// # Errors
    /// If the place of the program is unknown.
    pub fn new(named: Option<PathBuf>, name: &str) -> Result<Self, String> {
        match named {
            Some(path) => Ok(Self::Named(path)),
            None => std::env::current_exe()
                .map(|program| Self::Kept(program.with_file_name(name)))
                .map_err(|error| {
                    format!(
                        "the program does not know where it is ({error}): name a file with --bake"
                    )
                }),
        }
    }

    fn path(&self) -> &Path {
        match self {
            Self::Kept(path) | Self::Named(path) => path,
        }
    }

    /// Refuses a named file that is there and is something else.
    fn check(&self, geometry: &Geometry, options: &Options) -> Result<(), String> {
        let Self::Named(path) = self else {
            return Ok(());
        };
        if !path.exists() {
            let folder = path
                .parent()
                .filter(|folder| !folder.as_os_str().is_empty());
            return match folder {
                Some(folder) if !folder.is_dir() => Err(format!(
                    "--bake {}: there is no folder {}",
                    path.display(),
                    folder.display()
                )),
                _ => Ok(()),
            };
        }
        let bake = Bake::read(path)
            .map_err(|error| format!("--bake {error}. Name another file, or remove this one"))?;
        if bake.identity == akari_bake::identity(geometry, options) {
            return Ok(());
        }
        Err(format!(
            "--bake {}: a bake of another scene or of other settings. Name another file, or remove this one",
            path.display()
        ))
    }
}

/// Prints a line about the bake, and keeps it for a window's title.
struct Reporter {
    line: Arc<Mutex<String>>,
    printed: Mutex<Option<Instant>>,
}

impl Progress for Reporter {
    fn update(&self, status: &Status) {
        /// Between two lines on a terminal, where one replaces the other, and in a log.
        const EVERY: Duration = Duration::from_millis(250);
        const EVERY_IN_LOG: Duration = Duration::from_secs(5);
        let (what, of) = match status.phase {
            Phase::Levels => ("choosing samples", "triangles"),
            Phase::Samples => ("visibility", "samples"),
            Phase::Writing => ("writing", "samples"),
        };
        let left = status.left.map_or_else(String::new, |left| {
            format!(", {} s left", left.as_secs_f32().ceil())
        });
        let line = format!(
            "baking shadows: {what}, {} of {} {of}{left}",
            status.done, status.total
        );
        line.clone_into(&mut self.line.lock().unwrap_or_else(PoisonError::into_inner));
        let terminal = std::io::stderr().is_terminal();
        let every = if terminal { EVERY } else { EVERY_IN_LOG };
        let mut printed = self.printed.lock().unwrap_or_else(PoisonError::into_inner);
        if printed.is_none_or(|last| last.elapsed() >= every) {
            *printed = Some(Instant::now());
            let end = if terminal { "\x1b[K\r" } else { "\n" };
            // Whoever closed the console does not want to know.
            let _ = write!(std::io::stderr(), "{line}{end}");
        }
    }
}

/// Bakes `meshes`, or takes over what the file holds of them.
///
/// # Errors
/// If the file is something else, or cannot be written.
pub fn bake(
    meshes: &[StaticMesh],
    options: &Options,
    file: &BakeFile,
    line: Arc<Mutex<String>>,
) -> Result<Bake, String> {
    let inputs: Vec<MeshInput> = meshes
        .iter()
        .map(|mesh| MeshInput {
            name: &mesh.name,
            positions: &mesh.positions,
            triangles: &mesh.triangles,
            world_from_mesh: mesh.world_from_mesh,
            roles: Roles::BOTH,
            two_sided: false,
        })
        .collect();
    let text = |error: akari_bake::Error| error.to_string();
    let geometry = Geometry::from_meshes(&inputs, GeometryOptions::default()).map_err(text)?;
    file.check(&geometry, options)?;
    let reporter = Reporter {
        line,
        printed: Mutex::new(None),
    };
    let report = akari_bake::bake(&geometry, options, file.path(), &reporter).map_err(text)?;
    if !report.was_complete {
        let cores = report.cpu_seconds.map_or_else(String::new, |seconds| {
            format!(" ({seconds:.1} core-seconds)")
        });
        eprintln!(
            "baked {} samples of {} triangles in {:.1} s{cores} into {}, {:.1} MB",
            report.samples,
            report.triangles,
            report.seconds,
            file.path().display(),
            report.bytes as f64 / 1e6
        );
    }
    Bake::read(file.path()).map_err(|error| error.to_string())
}

/// A bake in the background. The app goes on; shadows appear when it is done.
#[derive(Resource)]
pub struct Baking {
    /// How far it is, in words.
    line: Arc<Mutex<String>>,
    result: Mutex<Receiver<Result<Bake, String>>>,
}

impl Baking {
    /// Starts a thread that bakes.
    #[must_use]
    pub fn start(meshes: Vec<StaticMesh>, options: Options, file: BakeFile) -> Self {
        let line = Arc::new(Mutex::new(String::new()));
        let (sender, receiver) = channel();
        let shared = Arc::clone(&line);
        std::thread::spawn(move || {
            // An app that is gone needs no bake; what is done stays in the journal.
            let _ = sender.send(bake(&meshes, &options, &file, shared));
        });
        Self {
            line,
            result: Mutex::new(receiver),
        }
    }

    /// How far it is, in words.
    #[must_use]
    pub fn line(&self) -> String {
        self.line
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// Gives a bake to the scene.
pub fn attach_bake(world: &mut World, bake: Bake) {
    let handle = world
        .resource_mut::<Assets<VisibilityBake>>()
        .add(VisibilityBake::from(bake));
    world.spawn(BakedVisibility(handle));
}

/// Takes over what [`Baking`] has made; ends the app if it could not.
pub fn finish_baking(world: &mut World) {
    let Some(baking) = world.get_resource::<Baking>() else {
        return;
    };
    let result = baking
        .result
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .try_recv();
    let done = match result {
        Err(TryRecvError::Empty) => return,
        Err(TryRecvError::Disconnected) => Err("the bake broke off".to_owned()),
        Ok(done) => done,
    };
    world.remove_resource::<Baking>();
    match done {
        Ok(bake) => attach_bake(world, bake),
        Err(error) => {
            error!("{error}");
            world.write_message(AppExit::error());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad() -> Vec<StaticMesh> {
        let mesh = Mesh::from(Rectangle::new(1.0, 1.0));
        vec![StaticMesh::new("quad", &mesh, &Transform::from_xyz(1.0, 2.0, 3.0)).expect("a mesh")]
    }

    fn bake_quad(file: &BakeFile, face_size: u32) -> Result<Bake, String> {
        let options = Options {
            face_size,
            max_level: 0,
            ..default()
        };
        bake(&quad(), &options, file, Arc::default())
    }

    #[test]
    fn a_named_file_is_made_once_and_never_replaced() {
        let folder = std::env::temp_dir().join(format!("akari_examples_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let named = |name: &str| BakeFile::Named(folder.join(name));
        let first = bake_quad(&named("quad.akari"), 32).expect("a bake");
        assert_eq!(first.instances.len(), 1);
        assert_eq!(bake_quad(&named("quad.akari"), 32), Ok(first));
        let other = bake_quad(&named("quad.akari"), 64).expect_err("other settings");
        assert!(other.contains("other settings"), "{other}");
        std::fs::write(folder.join("note.txt"), "mine").expect("a file");
        let foreign = bake_quad(&named("note.txt"), 32).expect_err("no bake");
        assert!(foreign.contains("note.txt"), "{foreign}");
        assert_eq!(
            std::fs::read(folder.join("note.txt")).expect("kept"),
            b"mine"
        );
        let missing = bake_quad(&named("none/quad.akari"), 32).expect_err("no folder");
        assert!(missing.contains("no folder"), "{missing}");
        // A file that is kept beside the program is replaced.
        let kept = BakeFile::Kept(folder.join("note.txt"));
        assert!(bake_quad(&kept, 32).is_ok());
        std::fs::remove_dir_all(&folder).expect("the folder");
    }
}
