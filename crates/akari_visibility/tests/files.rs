//! Files: what is written is read, and what is damaged, foreign or hostile is refused without a panic.

#[path = "common/bakes.rs"]
mod bakes;
mod common;
#[path = "common/sealed.rs"]
mod sealed;

use akari_visibility::bake::Bake;
use akari_visibility::container::{Container, FileError, Kind, MAX_RATIO};
use akari_visibility::part::{Part, merge};
use akari_visibility::tree::TreeLink;
use bakes::*;
use proptest::prelude::*;
use sealed::{ENTRY, HEADER, files, put, reseal};
use std::borrow::Cow;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

fn bake() -> &'static Bake {
    static BAKE: OnceLock<Bake> = OnceLock::new();
    BAKE.get_or_init(|| merge(&parts(&topology(5), 1)).expect("a bake"))
}

fn load(bytes: &[u8]) -> Result<(), FileError> {
    let container = Container::from_bytes(Path::new("test.akari"), bytes)?;
    match container.kind() {
        Kind::Bake => Bake::from_container(&container).map(drop),
        Kind::Part => Part::from_container(&container).map(drop),
    }
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bake.akari");
    bake().write(&path).expect("written");
    assert_eq!(&Bake::read(&path).expect("read"), bake());
    // SAFETY: nobody else knows the file.
    #[allow(unsafe_code, reason = "mapping is unsafe")]
    let mapped = unsafe { Container::map(&path) }.expect("mapped");
    assert_eq!(&Bake::from_container(&mapped).expect("read"), bake());
    // The file of another process that has mapped it stays what it was.
    let mut other = bake().clone();
    other.positions[0] = [9.0; 3];
    other.write(&path).expect("written again");
    assert_eq!(&Bake::from_container(&mapped).expect("read"), bake());
    assert_eq!(Bake::read(&path).expect("read"), other);
    // No temporary files are left.
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
    for chunk in mapped.chunks() {
        println!(
            "{} {} bytes, {} in the file",
            chunk.name_text(),
            chunk.bytes,
            chunk.stored_bytes
        );
    }
}

#[test]
fn plain_chunks_are_used_in_place() {
    let container = Container::from_bytes(Path::new("x"), &files()[0]).expect("a bake");
    let (mut plain, mut packed) = (0, 0);
    for chunk in container.chunks() {
        let content = container.chunk::<u8>(chunk.name).expect("there");
        assert_eq!(content.len() as u64, chunk.bytes);
        match content {
            Cow::Borrowed(_) => plain += 1,
            Cow::Owned(_) => packed += 1,
        }
    }
    assert!(plain > 0 && packed > 0, "{plain} {packed}");
    // A chunk that does not shrink, as an array of its elements.
    let triangles = container.chunk::<u32>(*b"TRIS").expect("there");
    assert!(matches!(triangles, Cow::Borrowed(_)));
}

#[test]
fn nothing_is_left_where_writing_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let missing = folder.path().join("no/such/folder.akari");
    let error = bake().write(&missing).expect_err("there is no folder");
    assert!(error.to_string().contains("folder.akari"), "{error}");
    // A folder has the name.
    let taken = folder.path().join("taken");
    fs::create_dir(&taken).expect("made");
    assert!(bake().write(&taken).is_err());
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
    assert!(matches!(Bake::read(&missing), Err(FileError::Io { .. })));
    assert!(matches!(
        Bake::read(&taken),
        Err(FileError::Io { .. } | FileError::Format { .. })
    ));
}

fn refused(bytes: &[u8]) -> String {
    load(bytes).expect_err("refused").to_string()
}

#[test]
fn messages_say_what_to_do() {
    let [bake, part] = files();
    assert!(load(bake).is_ok() && load(part).is_ok());
    let container =
        |bytes: &[u8]| Container::from_bytes(Path::new("f.akari"), bytes).expect("ours");
    let text = Bake::from_container(&container(part))
        .expect_err("a part")
        .to_string();
    assert!(
        text.contains("f.akari") && text.contains("akari merge"),
        "{text}"
    );
    let text = Part::from_container(&container(bake))
        .expect_err("a bake")
        .to_string();
    assert!(text.contains("whole bake"), "{text}");

    for other in [&b""[..], b"glTF", &[0; 4096], b"\x89AKARI\r\n"] {
        assert!(refused(other).contains("is not a bake"));
    }
    // A text transfer.
    let mut text_mode = bake.clone();
    text_mode.remove(6);
    assert!(refused(&text_mode).contains("is not a bake"));
    let mut newer = bake.clone();
    put(&mut newer, 8, &2_u32.to_le_bytes());
    assert!(refused(&newer).contains("version 2"));
    let mut kind = bake.clone();
    put(&mut kind, 12, b"WHAT");
    reseal(&mut kind);
    assert!(refused(&kind).contains("WHAT"));
    for length in [HEADER, bake.len() / 2, bake.len() - 1] {
        let text = refused(&bake[..length]);
        assert!(
            text.contains("damaged at its end") && text.contains("bake again"),
            "{text}"
        );
    }
    // A bit of each chunk.
    let entries = u32::from_le_bytes(bake[24..28].try_into().expect("four bytes")) as usize;
    for entry in 0..entries {
        let at = HEADER + entry * ENTRY;
        let name = String::from_utf8_lossy(&bake[at..at + 4]).into_owned();
        let offset = u64::from_le_bytes(bake[at + 8..at + 16].try_into().expect("eight bytes"));
        let size = u64::from_le_bytes(bake[at + 16..at + 24].try_into().expect("eight bytes"));
        if size == 0 {
            continue;
        }
        let mut flipped = bake.clone();
        flipped[(offset + size / 2) as usize] ^= 4;
        let text = refused(&flipped);
        assert!(
            text.contains(&name) && text.contains("checksum"),
            "{name}: {text}"
        );
    }
    let mut flipped = bake.clone();
    flipped[40] ^= 1;
    assert!(refused(&flipped).contains("damaged at its header"));
}

/// Entry of a chunk in the table.
fn entry_of(bytes: &[u8], name: &[u8; 4]) -> usize {
    (HEADER..)
        .step_by(ENTRY)
        .find(|&at| &bytes[at..at + 4] == name)
        .expect("there is such a chunk")
}

#[test]
fn hostile_tables_are_refused_before_memory_is_taken() {
    let bake = &files()[0];
    let table = |name: &[u8; 4], field: usize, value: u64| {
        let mut changed = bake.clone();
        let at = entry_of(bake, name);
        put(&mut changed, at + field, &value.to_le_bytes());
        reseal(&mut changed);
        refused(&changed)
    };
    for huge in [
        u64::MAX,
        u64::MAX - 8,
        1 << 40,
        bake.len() as u64 * MAX_RATIO + 1,
    ] {
        assert!(table(b"ENTR", 24, huge).contains("impossible length"));
        assert!(table(b"POSI", 24, huge).contains("impossible length"));
        assert!(table(b"ENTR", 16, huge).contains("not within the file"));
        assert!(table(b"ENTR", 8, huge & !15).contains("not within the file"));
    }
    // Not aligned; not whole elements; more or less than what is there.
    let at = entry_of(bake, b"ENTR");
    let offset = u64::from_le_bytes(bake[at + 8..at + 16].try_into().expect("eight bytes"));
    let size = u64::from_le_bytes(bake[at + 24..at + 32].try_into().expect("eight bytes"));
    assert!(table(b"ENTR", 8, offset + 1).contains("not within the file"));
    assert!(table(b"ENTR", 24, size - 1).contains("whole elements"));
    assert!(table(b"ENTR", 24, size - 4).contains("ENTR"));
    assert!(table(b"ENTR", 24, size + 4).contains("ENTR"));
    let mut codec = bake.clone();
    put(&mut codec, at + 4, &7_u32.to_le_bytes());
    reseal(&mut codec);
    assert!(refused(&codec).contains("unknown compression"));
    let mut twice = bake.clone();
    put(&mut twice, at, b"POSI");
    reseal(&mut twice);
    assert!(refused(&twice).contains("there twice"));
    for count in [65, 1 << 20, u32::MAX] {
        let mut many = bake.clone();
        put(&mut many, 24, &count.to_le_bytes());
        reseal(&mut many);
        assert!(refused(&many).contains("damaged at its header"));
    }
    // Unknown chunks: needed ones are refused, others left alone; a known one that has gone is missed.
    let renamed = |name: &[u8; 4]| {
        let mut changed = bake.clone();
        put(&mut changed, at, name);
        reseal(&mut changed);
        refused(&changed)
    };
    assert!(renamed(b"FOGS").contains("FOGS that this version does not know"));
    assert!(renamed(b"fogs").contains("chunk ENTR: is missing"));
}

/// What a reader says to a bake that was changed before it was written.
fn refused_bake(change: impl Fn(&mut Bake)) -> String {
    let mut changed = bake().clone();
    change(&mut changed);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("odd.akari");
    changed.write(&path).expect("written");
    let text = Bake::read(&path).expect_err("refused").to_string();
    assert!(text.contains("odd.akari"), "{text}");
    text
}

#[test]
fn content_is_checked_behind_its_checksum() {
    let bake = &files()[0];
    let cases: [(&str, &dyn Fn(&mut Bake)); 9] = [
        ("not finite", &|b| b.positions[3][1] = f32::NAN),
        ("POSI: it is not of all samples", &|b| {
            b.positions.truncate(2);
        }),
        ("TREE: it is not of all samples", &|b| {
            b.trees.push(b.trees[0]);
        }),
        ("is not the root", &|b| {
            b.trees[1][2] = TreeLink::node(1 << 29);
        }),
        ("is not the root", &|b| {
            b.trees[1][2] = TreeLink(TreeLink::LEAF | 256);
        }),
        ("a sample that is not there", &|b| {
            b.grid.entries[1] = b.grid.sample_count;
        }),
        ("beyond the entries", &|b| {
            b.grid.triangles[1] |= 0x7000_0000;
        }),
        ("the instances have", &|b| {
            b.instances[1].triangle_count -= 1;
        }),
        ("the settings are not", &|b| b.settings.face_size += 1),
    ];
    for (expected, change) in cases {
        let text = refused_bake(change);
        assert!(text.contains(expected), "{expected}: {text}");
    }
    // Another scene in the header is not a damaged file, but other settings than those inside are.
    let mut other = bake.clone();
    other[32] ^= 1;
    reseal(&mut other);
    assert!(load(&other).is_ok());
    let mut other = bake.clone();
    other[64] ^= 1;
    reseal(&mut other);
    assert!(refused(&other).contains("settings"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, rng_seed: proptest::test_runner::RngSeed::Fixed(31), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bits_are_found(which in 0usize..2, at in any::<prop::sample::Index>(), bit in 0u8..8) {
        let mut bytes = files()[which].clone();
        let at = at.index(bytes.len());
        bytes[at] ^= 1 << bit;
        // Only the zeros between chunks may change.
        if load(&bytes).is_ok() {
            prop_assert!(bytes[at].is_power_of_two());
        }
    }

    #[test]
    fn truncated_files_are_refused(which in 0usize..2, length in any::<prop::sample::Index>()) {
        let bytes = &files()[which];
        prop_assert!(load(&bytes[..length.index(bytes.len())]).is_err());
    }

    /// Changes that the checksums do not see: refused or not, but never a panic, and what loads can be used.
    #[test]
    fn sealed_nonsense_does_no_harm(
        which in 0usize..2,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        in_table in any::<bool>(),
    ) {
        let mut bytes = files()[which].clone();
        if let Some(cut) = cut {
            bytes.truncate(HEADER + cut.index(bytes.len() - HEADER));
        }
        let range = if in_table { (HEADER + 10 * ENTRY).min(bytes.len()) } else { bytes.len() };
        for (at, value) in changes {
            bytes[at.index(range)] = value;
        }
        reseal(&mut bytes);
        akari_visibility::fuzz::load_and_use(&bytes);
    }

    #[test]
    fn noise_does_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let mut ours = files()[0][..HEADER].to_vec();
        ours.extend(&bytes);
        reseal(&mut ours);
        akari_visibility::fuzz::load_and_use(&bytes);
        akari_visibility::fuzz::load_and_use(&ours);
    }
}
