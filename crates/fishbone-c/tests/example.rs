//! The example in C is built and run as the page on C says, in C and in C++, and prints what the core computes.

#![cfg(unix)]

use fishbone::analysis::tracking::{Goal, Tracker};
use fishbone::problem::Problem;
use fishbone::scenario::Scenario;
use fishbone::solve::solve;
use nalgebra::Vector3;
use std::env::{self, consts::DLL_EXTENSION};
use std::fs;
use std::io::{Write, stderr};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const PAGE: &str = include_str!("../../../docs/c.md");
const EXAMPLE: &str = include_str!("../examples/track.c");

/// Warnings of each compiler, none of which the example may have.
const COMPILERS: [(&str, &str); 2] = [
    ("cc", "-Wall -Wextra -Werror -pedantic"),
    ("c++", "-Wall -Wextra -Werror"),
];

/// The blocks of a language on the page.
fn blocks(language: &str) -> Vec<&'static str> {
    let fence = format!("```{language}\n");
    let blocks = PAGE.split(&fence).skip(1);
    blocks
        .map(|rest| rest.split("```").next().unwrap())
        .collect()
}

/// The command on the page that begins with a word, on one line.
fn command(word: &str) -> String {
    let lines = blocks("sh").concat().replace("\\\n", " ");
    let mut found = lines
        .lines()
        .filter(|line| line.starts_with(&format!("{word} ")));
    let command = found.next().unwrap().to_owned();
    assert_eq!(found.next(), None);
    command
}

/// The library, built as this test is: its folder.
fn library() -> PathBuf {
    let test = env::current_exe().unwrap();
    let folder = test.ancestors().nth(2).unwrap();
    let profile = match folder.file_name().unwrap().to_str().unwrap() {
        "debug" => "test",
        other => other,
    };
    let arguments = [
        "build",
        "--quiet",
        "--locked",
        "--lib",
        "--package",
        "fishbone-c",
        "--profile",
        profile,
    ];
    let built = Command::new(env!("CARGO"))
        .args(arguments)
        .status()
        .unwrap();
    assert!(built.success());
    assert!(
        folder
            .join("libfishbone")
            .with_extension(DLL_EXTENSION)
            .exists()
    );
    folder.to_owned()
}

/// What a command of a shell prints, in the folder of the repository.
fn printed(command: &str) -> String {
    let done = Command::new("sh")
        .args(["-c", command])
        .current_dir(ROOT)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.success() && errors.is_empty(),
        "{command}\n{errors}"
    );
    String::from_utf8(done.stdout).unwrap()
}

/// What the example prints, computed by the core.
fn expected() -> String {
    let text = fs::read_to_string(Path::new(ROOT).join("scenarios/example1.toml")).unwrap();
    let problem = Problem::new(Scenario::from_toml(&text).unwrap()).unwrap();
    let go_on = &mut || ControlFlow::Continue(());
    let mut tracker = Tracker::new(&solve(&problem, go_on), &[1]).unwrap();
    let mut lines = String::new();
    for step in 1..=20 {
        let share = f64::from(step);
        let goal = Goal {
            support: 1,
            position: Some(Vector3::new(0.0, 0.5 + 0.005 * share, 0.1)),
            rotation: Some(Vector3::new(0.0, 0.0, 0.01 * share)),
        };
        tracker.update(&[goal], go_on).unwrap();
        let middle = tracker.positions().nth(tracker.nodes().len() / 2).unwrap();
        let [x, f] = [middle, tracker.reaction(1).force];
        lines += &format!("{step:2}  middle {:9.6} {:9.6} {:9.6}", x.x, x.y, x.z);
        lines += &format!("  force {:10.5} {:10.5} {:10.5}\n", f.x, f.y, f.z);
    }
    lines
}

#[test]
fn test_the_example_prints_what_the_core_computes_in_c_and_in_cpp() {
    let library = library();
    let expected = expected();
    for (compiler, warnings) in COMPILERS {
        if Command::new(compiler).arg("--version").output().is_err() {
            writeln!(
                stderr(),
                "left out: the example built by {compiler}, which is not there"
            )
            .unwrap();
            continue;
        }
        let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("track-{compiler}"));
        let program = program.to_str().unwrap();
        let command = command(compiler)
            .replacen(compiler, &format!("{compiler} {warnings}"), 1)
            .replace("target/release", library.to_str().unwrap())
            .replace("-o track", &format!("-o '{program}'"));
        assert!(command.contains(program) && command.contains(library.to_str().unwrap()));
        printed(&command);
        assert_eq!(
            printed(&format!("'{program}' scenarios/example1.toml")),
            expected
        );
    }
}

#[test]
fn test_the_code_of_the_page_is_that_of_the_example() {
    let blocks = blocks("c");
    assert!(!blocks.is_empty());
    for block in blocks {
        assert!(EXAMPLE.contains(block), "{block}");
    }
}
