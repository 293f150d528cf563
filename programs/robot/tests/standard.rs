// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images of the standard controller's programs equal the assembler's output for their sources.

use std::path::Path;

#[test]
fn the_images_are_up_to_date() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/standard");
    let files = takt_robot::standard::files().unwrap_or_else(|error| panic!("{error}"));
    for (name, wanted) in files {
        let path = folder.join(&name);
        if std::env::var_os("TAKT_BLESS").is_some() {
            std::fs::write(&path, &wanted).expect("it can be written");
        }
        let is_fresh = std::fs::read(&path).is_ok_and(|old| old == wanted);
        assert!(
            is_fresh,
            "{name} is stale: TAKT_BLESS=1 cargo test --release -p takt-robot --test suite standard:: rewrites it"
        );
    }
}
