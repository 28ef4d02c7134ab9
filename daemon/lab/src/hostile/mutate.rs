//! Configurations with anything in them: wrong keys, wrong values, wrong bytes.

use admittance_host::config::Section as _;
use admittance_host::config::mutation::{Mutation, mutations};
use admittance_runner::config::Config;
use rand::{Rng, RngExt as _};

/// What may stand where a value stands.
const VALUES: [&str; 26] = [
    "nan",
    "inf",
    "-inf",
    "0",
    "-1",
    "0.0",
    "-0.0",
    "1e308",
    "5e-324",
    "1e-9",
    "1e6",
    "9223372036854775807",
    "99999999999999999999",
    "0x7f",
    "true",
    "\"\"",
    "\"text\"",
    "[]",
    "[[]]",
    "{}",
    "[1.0, nan]",
    "1979-05-27",
    "'''x'''",
    "\"\\u0000\"",
    "\"\u{202e}\u{1b}[2J\"",
    "",
];
/// What may be put between two bytes.
const PIECES: [&str; 16] = [
    "\n",
    "\r",
    "\0",
    "=",
    "[",
    "]]",
    "{",
    "\"",
    "'''",
    "#",
    ".",
    "\u{feff}",
    "\u{1b}[2J",
    "\u{202e}",
    "[control]\n",
    "= =",
];

/// Draws texts from a valid one.
pub(crate) struct Mutations {
    valid: String,
    of_keys: Vec<Mutation>,
}

impl Mutations {
    pub(crate) fn of(valid: &str) -> Self {
        Self { valid: valid.to_owned(), of_keys: mutations(&Config::keys(""), valid) }
    }

    /// The next text: bytes, since it need not be UTF-8.
    pub(crate) fn draw(&self, random: &mut impl Rng) -> Vec<u8> {
        let start = match random.random_range(0..3) {
            0 => &self.of_keys[random.random_range(0..self.of_keys.len())].text,
            _ => &self.valid,
        };
        let mut text = start.clone();
        for _ in 0..random.random_range(0..4) {
            text = match random.random_range(0..6) {
                0 => with_line(&text, random, |lines, at, _| {
                    lines.remove(at);
                }),
                1 => with_line(&text, random, |lines, at, random| {
                    let to = random.random_range(0..=lines.len());
                    lines.insert(to, lines[at]);
                }),
                2 => with_line(&text, random, |lines, at, random| {
                    let other = random.random_range(0..lines.len());
                    lines.swap(at, other);
                }),
                _ => with_value(&text, random),
            };
        }
        let mut bytes = text.into_bytes();
        if random.random_bool(0.3) {
            spoil(&mut bytes, random);
        }
        bytes
    }
}

fn with_line<R: Rng>(text: &str, random: &mut R, change: impl FnOnce(&mut Vec<&str>, usize, &mut R)) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    if !lines.is_empty() {
        let at = random.random_range(0..lines.len());
        change(&mut lines, at, random);
    }
    lines.join("\n")
}

/// Another value for some key, or another element of its list.
fn with_value(text: &str, random: &mut impl Rng) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let keys: Vec<usize> = (0..lines.len()).filter(|line| lines[*line].contains(" = ")).collect();
    if keys.is_empty() {
        return text.to_owned();
    }
    let line = &mut lines[keys[random.random_range(0..keys.len())]];
    let (key, value) = line.split_once(" = ").unwrap_or((line, ""));
    let strange = VALUES[random.random_range(0..VALUES.len())].to_owned();
    let new = match value.parse::<f64>() {
        Ok(number) if random.random_bool(0.7) => format!("{:?}", number * 10f64.powf(random.random_range(-2.0..2.0))),
        Ok(_) => strange,
        Err(_) if value.starts_with('[') && random.random_bool(0.8) => {
            let mut elements: Vec<&str> = value.trim_matches(['[', ']']).split(", ").collect();
            let at = random.random_range(0..elements.len());
            match random.random_range(0..4) {
                0 => drop(elements.remove(at)),
                1 => elements.insert(at, elements[at]),
                _ => elements[at] = &strange,
            }
            format!("[{}]", elements.join(", "))
        }
        Err(_) => strange,
    };
    *line = format!("{key} = {new}");
    lines.join("\n")
}

/// Bytes that no editor writes.
fn spoil(bytes: &mut Vec<u8>, random: &mut impl Rng) {
    for _ in 0..random.random_range(1..=4) {
        if bytes.is_empty() {
            return;
        }
        let at = random.random_range(0..bytes.len());
        match random.random_range(0..5) {
            0 => bytes[at] = random.random(),
            1 => bytes.truncate(at),
            2 => drop(bytes.drain(at..(at + random.random_range(0..200)).min(bytes.len()))),
            3 => {
                let again = bytes[at..(at + random.random_range(0..200)).min(bytes.len())].to_vec();
                bytes.splice(at..at, again);
            }
            _ => drop(bytes.splice(at..at, PIECES[random.random_range(0..PIECES.len())].bytes())),
        }
    }
}
