//! RON files that were changed: settings and ladders. Never a panic, and an error says where.
//!
//! The changes are the same in each run; `AKARI_FUZZ_MUTATIONS=1000000 cargo test -p bevy_akari --release --lib fuzz`
//! makes a long run of it, and `AKARI_FUZZ_SEED` another one.

use crate::budget::ladders;
use crate::settings::AkariSettings;
use akari_render::quality::Quality;

/// Random changes of each file in a run of the tests.
const MUTATIONS: u64 = 5000;
const SEED: u64 = 1;
/// What a value is replaced by.
const OTHERS: [&str; 20] = [
    "",
    "0",
    "-1",
    "1e39",
    "-1e39",
    "inf",
    "-inf",
    "NaN",
    "1e-45",
    "99999999999999999999",
    "\"",
    "\"a\"",
    "()",
    "[]",
    "{}",
    "None",
    "Some(1)",
    "true",
    "/*",
    "\u{0}",
];

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n.max(1) as u64) as usize
    }
}

fn number(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text.parse().expect(name),
        Err(_) => default,
    }
}

/// Whether a text is accepted; an error says something, and what is accepted is used.
type Reader = fn(&str) -> Result<(), String>;

fn read_settings(text: &str) -> Result<(), String> {
    let settings = AkariSettings::from_ron(text)?;
    for (effect, knob, value) in settings.knobs() {
        assert!(
            (knob.min..=knob.max).contains(&value),
            "{effect}.{}: {value} got through",
            knob.name
        );
    }
    let text = settings.to_ron().expect("serialisable");
    assert_eq!(AkariSettings::from_ron(&text), Ok(settings));
    Ok(())
}

fn read_ladders(text: &str) -> Result<(), String> {
    let ladders = ladders::parse(text).map_err(|error| error.to_string())?;
    for ladder in &ladders {
        for rung in &ladder.rungs {
            assert!(rung.cost.is_finite() && rung.cost > 0.0, "{rung:?}");
            assert!(rung.error.is_finite() && rung.error >= 0.0, "{rung:?}");
        }
    }
    Ok(())
}

/// Every length, every word as something else, random changes of several bytes.
fn spoil(name: &str, read: Reader, text: &str) {
    read(text).unwrap_or_else(|error| panic!("{name}, unchanged: {error}"));
    let check = |changed: &str| {
        let result = read(changed);
        if let Err(error) = &result {
            assert!(error.len() > 5, "{name}: says too little: {error:?}");
        }
        result.is_ok()
    };
    for (length, _) in text.char_indices() {
        check(&text[..length]);
    }
    // Words, and what is between them.
    let is_word = |c: char| c.is_alphanumeric() || "._-\"+".contains(c);
    let mut starts: Vec<usize> = text
        .char_indices()
        .zip(text.char_indices().skip(1))
        .filter(|((_, a), (_, b))| is_word(*a) != is_word(*b))
        .map(|(_, (at, _))| at)
        .collect();
    starts.insert(0, 0);
    starts.push(text.len());
    let mut tried = 0;
    for range in starts.windows(2) {
        for other in OTHERS {
            check(&format!(
                "{}{other}{}",
                &text[..range[0]],
                &text[range[1]..]
            ));
            tried += 1;
        }
    }
    let (mutations, seed) = (
        number("AKARI_FUZZ_MUTATIONS", MUTATIONS),
        number("AKARI_FUZZ_SEED", SEED),
    );
    let mut accepted = 0;
    for mutation in 0..mutations {
        let mut random = Random(seed.wrapping_add(mutation));
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            match random.below(3) {
                0 => bytes[at] = b"0123456789.-e()[]{}:,\"abc \n"[random.below(27)],
                1 => {
                    bytes.remove(at);
                }
                _ => {
                    let from = random.below(bytes.len());
                    let count = random.below(32).min(bytes.len() - from.max(at));
                    bytes.copy_within(from..from + count, at);
                }
            }
        }
        accepted += u64::from(check(&String::from_utf8_lossy(&bytes)));
    }
    println!("{name}: {tried} words, {accepted} of {mutations} random changes accepted");
    assert!(accepted < mutations, "{name}: no change is felt");
    for open in ["(", "[", "{", "Some("] {
        assert!(!check(&open.repeat(100_000)), "{name}: depth of {open}");
    }
}

#[test]
fn changed_settings_do_no_harm() {
    let text = AkariSettings::preset(Quality::High).to_ron();
    spoil("settings", read_settings, &text.expect("serialisable"));
}

#[test]
fn changed_ladders_do_no_harm() {
    let text = include_str!("budget/ladders.ron");
    // A part of it that holds all there is: each change is tried on every word.
    let ladders: Vec<ladders::Ladder> = ladders::measured()
        .expect("valid ladders")
        .into_iter()
        .take(2)
        .map(|mut ladder| {
            ladder.rungs.truncate(3);
            ladder
        })
        .collect();
    let small = ron::ser::to_string_pretty(&ladders, ron::ser::PrettyConfig::default());
    spoil("ladders", read_ladders, &small.expect("serialisable"));
    assert!(text.len() > 100);
}
