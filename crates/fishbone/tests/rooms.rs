//! The rooms of the crate are ordered, and each uses only rooms before it.

use std::fs;
use std::path::{Path, PathBuf};

/// Names of the rooms from the lowest to the highest, words. A file may name its own room and the rooms before it.
const ROOMS: [&str; 13] = [
    "names",
    "serial",
    "geometry",
    "strip",
    "board",
    "surface",
    "scenario",
    "problem",
    "equilibrium",
    "ritz",
    "solve",
    "analysis",
    "io",
];

fn rank(room: &str) -> usize {
    let place = ROOMS.iter().position(|name| *name == room);
    place.unwrap_or_else(|| panic!("{room} is no room of the list"))
}

/// All files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut found = Vec::new();
    for path in entries {
        match path.is_dir() {
            true => found.extend(files(&path)),
            false => found.push(path),
        }
    }
    found
}

/// The code of a file without its tests.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default()
        .to_owned()
}

/// The rooms that a text names, as in `crate::room::…`.
fn named(text: &str) -> Vec<String> {
    let word = |rest: &str| -> String {
        rest.chars()
            .take_while(|c| c.is_ascii_lowercase() || *c == '_')
            .collect()
    };
    text.split("crate::")
        .skip(1)
        .map(word)
        .filter(|room| !room.is_empty())
        .collect()
}

#[test]
fn test_every_room_uses_only_rooms_before_it() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    let mut seen = [0; ROOMS.len()];
    for path in files(&source) {
        let place = path.strip_prefix(&source).unwrap();
        let first = place.components().next().unwrap().as_os_str();
        let room = first.to_str().unwrap().trim_end_matches(".rs");
        let name = path.file_name().unwrap().to_str().unwrap();
        if room == "lib" || ["tests.rs", "samples.rs"].contains(&name) {
            continue;
        }
        seen[rank(room)] += 1;
        let used = named(&code(&path));
        let later = used.iter().filter(|other| rank(other) > rank(room));
        wrong.extend(later.map(|other| format!("{} uses {other}", place.display())));
    }
    assert!(seen.iter().all(|files| *files > 0), "{seen:?}");
    assert!(wrong.is_empty(), "{wrong:#?}");
}
