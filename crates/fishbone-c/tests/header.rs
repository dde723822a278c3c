//! The header that is committed is that of the code.

use std::fs;
use std::path::Path;

/// Writes the header instead of comparing where `FISHBONE_WRITE_HEADER` is set.
#[test]
fn test_header_is_that_of_the_code() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut builder = cbindgen::Builder::new()
        .with_config(cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap());
    for room in ["status", "scenario", "equilibrium", "tracker"] {
        builder = builder.with_src(folder.join("src").join(room).with_extension("rs"));
    }
    let mut made = Vec::new();
    builder.generate().unwrap().write(&mut made);
    let file = folder.join("include/fishbone.h");
    if std::env::var_os("FISHBONE_WRITE_HEADER").is_some() {
        fs::write(&file, &made).unwrap();
    }
    let committed = fs::read_to_string(&file).unwrap();
    assert!(
        committed.as_bytes() == made,
        "{} is out of date: run FISHBONE_WRITE_HEADER=1 cargo test -p fishbone-c header",
        file.display()
    );
}
