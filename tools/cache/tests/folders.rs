// SPDX-License-Identifier: MIT OR Apache-2.0
//! Location of the cache folder, and rejected folders.

use crate::{Folder, pipe};
use std::ffi::OsString;
use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};
use takt_cache::folder_among;

/// Cache folder for the given environment variables and temporary folder.
fn folder(variables: &[(&str, &Path)], temporary: &Path) -> Result<PathBuf, String> {
    let find = |name: &str| variables.iter().find(|(own, _)| *own == name);
    folder_among(|name| find(name).map(|(_, value)| OsString::from(value)), temporary)
        .map_err(|error| error.to_string())
}

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().mode() & 0o777
}

#[test]
fn the_folder_follows_the_specification() {
    let root = Folder::new("places");
    let (cache, home, temporary) = (root.0.join("cache"), root.0.join("home"), root.0.join("tmp"));
    let both = [("XDG_CACHE_HOME", cache.as_path()), ("HOME", &home)];
    assert_eq!(folder(&both, &temporary), Ok(cache.join("takt")));
    assert_eq!(folder(&both[1..], &temporary), Ok(home.join(".cache/takt")));
    // Relative and empty paths are ignored.
    for ignored in ["cache", "./cache", ""] {
        let variables = [("XDG_CACHE_HOME", Path::new(ignored)), ("HOME", &home)];
        assert_eq!(folder(&variables, &temporary), Ok(home.join(".cache/takt")));
        let user = fs::metadata(&root.0).unwrap().uid();
        let own = folder(&[("XDG_CACHE_HOME", Path::new(ignored)), ("HOME", Path::new("home"))], &temporary);
        assert_eq!(own, Ok(temporary.join(format!("takt-{user}"))));
    }
    for made in [cache.join("takt"), home.join(".cache/takt")] {
        assert_eq!(mode(&made), 0o700);
    }
    assert!(folder(&[], Path::new("tmp")).unwrap_err().contains("relative"));
    assert!(!Path::new("tmp").exists());
}

#[test]
fn folder_writable_by_others_is_not_used() {
    let root = Folder::new("modes");
    let variables = [("XDG_CACHE_HOME", root.0.as_path())];
    let own = root.0.join("takt");
    fs::create_dir(&own).unwrap();
    for open in [0o777, 0o770, 0o702, 0o1777] {
        fs::set_permissions(&own, Permissions::from_mode(open)).unwrap();
        assert!(folder(&variables, &root.0).unwrap_err().contains("can be written by others"), "{open:o}");
    }
    // A folder that others can read is made private.
    for readable in [0o755, 0o750, 0o500] {
        fs::set_permissions(&own, Permissions::from_mode(readable)).unwrap();
        assert_eq!(folder(&variables, &root.0), Ok(own.clone()));
        assert_eq!(mode(&own), 0o700);
    }
}

#[test]
fn files_in_place_of_the_folder_are_not_used() {
    let root = Folder::new("kinds");
    let variables = [("XDG_CACHE_HOME", root.0.as_path())];
    let own = root.0.join("takt");
    pipe(&own);
    assert!(folder(&variables, &root.0).unwrap_err().contains("is not a folder"));
    fs::remove_file(&own).unwrap();
    fs::write(&own, "").unwrap();
    assert!(folder(&variables, &root.0).unwrap_err().contains("is not a folder"));
    fs::remove_file(&own).unwrap();
    symlink(root.0.join("nowhere"), &own).unwrap();
    assert!(folder(&variables, &root.0).is_err());
    // The user's own link to the user's own folder is accepted.
    fs::create_dir(root.0.join("nowhere")).unwrap();
    assert_eq!(folder(&variables, &root.0), Ok(own));
}

/// Needs the right to change a file's owner; without it, prints a note and passes.
#[test]
fn a_folder_of_another_user_is_not_used() {
    let root = Folder::new("owners");
    let user = fs::metadata(&root.0).unwrap().uid();
    let (temporary, own) = (root.0.join("tmp"), root.0.join(format!("tmp/takt-{user}")));
    fs::create_dir_all(own.join("programs")).unwrap();
    if chown(&own, Some(user + 1000), None).is_err() {
        eprintln!("skipped: this user cannot give a folder to another one");
        return;
    }
    let refused = format!("belongs to user {}, not to the current user {user}", user + 1000);
    assert!(folder(&[], &temporary).unwrap_err().contains(&refused));
    fs::rename(&own, root.0.join("takt")).unwrap();
    assert!(folder(&[("XDG_CACHE_HOME", &root.0)], &temporary).unwrap_err().contains(&refused));
    // Another user's link to a folder of this user is rejected.
    fs::create_dir_all(root.0.join("mine")).unwrap();
    symlink(root.0.join("mine"), &own).unwrap();
    std::os::unix::fs::lchown(&own, Some(user + 1000), None).unwrap();
    assert!(folder(&[], &temporary).unwrap_err().contains(&refused));
}
