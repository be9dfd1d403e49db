//! Reads the meshes that the bench is given: OBJ and PLY, plain or gzipped.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use glam::Vec3;

/// An indexed mesh.
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// Reads by the extension, which may end in `.gz`.
pub fn read(path: &Path) -> std::io::Result<Mesh> {
    let file = std::fs::File::open(path)?;
    let name = path.to_string_lossy().into_owned();
    let (name, reader): (&str, Box<dyn Read>) = match name.strip_suffix(".gz") {
        Some(name) => (name, Box::new(flate2::read::GzDecoder::new(file))),
        None => (name.as_str(), Box::new(file)),
    };
    let reader = BufReader::new(reader);
    if name.ends_with(".ply") {
        read_ply(reader)
    } else {
        read_obj(reader)
    }
}

fn bad(what: &str) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::InvalidData, what.to_owned())
}

fn number<T: std::str::FromStr>(word: Option<&str>) -> std::io::Result<T> {
    word.and_then(|w| w.parse().ok())
        .ok_or_else(|| bad("a number is missing"))
}

fn add_polygon(triangles: &mut Vec<[u32; 3]>, polygon: &[u32]) {
    for i in 1..polygon.len().saturating_sub(1) {
        triangles.push([polygon[0], polygon[i], polygon[i + 1]]);
    }
}

fn read_obj(reader: impl BufRead) -> std::io::Result<Mesh> {
    let mut mesh = Mesh {
        positions: Vec::new(),
        triangles: Vec::new(),
    };
    for line in reader.lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => mesh.positions.push(Vec3::new(
                number(words.next())?,
                number(words.next())?,
                number(words.next())?,
            )),
            Some("f") => {
                let polygon = words
                    .map(|w| {
                        let i: i64 = number(w.split('/').next())?;
                        let i = if i < 0 {
                            mesh.positions.len() as i64 + i
                        } else {
                            i - 1
                        };
                        u32::try_from(i)
                            .ok()
                            .filter(|&i| (i as usize) < mesh.positions.len())
                            .ok_or_else(|| bad("a face names a vertex that is not there"))
                    })
                    .collect::<std::io::Result<Vec<u32>>>()?;
                add_polygon(&mut mesh.triangles, &polygon);
            }
            _ => {}
        }
    }
    Ok(mesh)
}

fn read_ply(mut reader: impl BufRead) -> std::io::Result<Mesh> {
    let (mut vertices, mut faces, mut properties) = (0_usize, 0_usize, 0_usize);
    let mut in_vertices = false;
    let mut ascii = false;
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? == 0 {
            return Err(bad("the header does not end"));
        }
        let mut words = line.split_whitespace();
        match (words.next(), words.next()) {
            (Some("end_header"), _) => break,
            (Some("format"), Some(format)) => ascii = format == "ascii",
            (Some("element"), Some("vertex")) => {
                vertices = number(words.next())?;
                in_vertices = true;
            }
            (Some("element"), Some("face")) => {
                faces = number(words.next())?;
                in_vertices = false;
            }
            (Some("property"), _) if in_vertices => properties += 1,
            _ => {}
        }
    }
    if !ascii || properties < 3 {
        return Err(bad("only ASCII PLY with x, y, z first is read"));
    }
    let mut text = String::new();
    reader.read_to_string(&mut text)?;
    let mut words = text.split_whitespace();
    let mut mesh = Mesh {
        positions: Vec::with_capacity(vertices),
        triangles: Vec::with_capacity(faces),
    };
    for _ in 0..vertices {
        mesh.positions.push(Vec3::new(
            number(words.next())?,
            number(words.next())?,
            number(words.next())?,
        ));
        for _ in 3..properties {
            words.next();
        }
    }
    for _ in 0..faces {
        let corners: usize = number(words.next())?;
        let polygon = (0..corners)
            .map(|_| number(words.next()))
            .collect::<std::io::Result<Vec<u32>>>()?;
        if polygon.iter().any(|&i| i as usize >= mesh.positions.len()) {
            return Err(bad("a face names a vertex that is not there"));
        }
        add_polygon(&mut mesh.triangles, &polygon);
    }
    Ok(mesh)
}
