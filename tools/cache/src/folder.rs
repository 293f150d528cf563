// SPDX-License-Identifier: MIT OR Apache-2.0
//! Location of the cache folder, and checks of its permissions.

use std::ffi::OsString;
use std::fs::{self, DirBuilder, Metadata};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Reason why the cache cannot be used.
#[derive(Debug, Error)]
#[error(
    "{path} {reason}, so that nothing can be kept there; set XDG_CACHE_HOME to a folder of your own, by its whole path"
)]
pub struct CacheError {
    path: String,
    reason: String,
}

/// Cache folder, created on demand: `takt` in `$XDG_CACHE_HOME`, or in `$HOME/.cache`; without either, a folder with the user's number in
/// the temporary folder.
///
/// # Errors
/// If the folder cannot be created, belongs to another user, or is writable by others.
pub fn folder() -> Result<PathBuf, CacheError> {
    folder_among(|name| std::env::var_os(name), &std::env::temp_dir())
}

/// [`folder`] with explicit environment variables and temporary folder.
///
/// # Errors
/// As [`folder`].
pub fn folder_among(
    variable: impl Fn(&str) -> Option<OsString>,
    temporary: &Path,
) -> Result<PathBuf, CacheError> {
    // The XDG specification requires relative paths to be ignored: they would depend on the current folder.
    let absolute = |name: &str| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = absolute("XDG_CACHE_HOME")
        .or_else(|| Some(absolute("HOME")?.join(".cache")))
        .or_else(|| absolute("LOCALAPPDATA"));
    let folder = match &base {
        Some(base) => base.join("takt"),
        None => temporary.join(owner::temporary_name()),
    };
    let error = |reason: String| CacheError { path: folder.display().to_string(), reason };
    if !folder.is_absolute() {
        return Err(error("is a relative path".to_owned()));
    }
    make(&folder).map_err(|reason| error(format!("cannot be made ({reason})")))?;
    owner::check(&folder).map_err(error)?;
    Ok(folder)
}

/// Creates a missing folder, accessible to its user only.
fn make(folder: &Path) -> io::Result<()> {
    if let Some(parent) = folder.parent() {
        fs::create_dir_all(parent)?;
    }
    let mut builder = DirBuilder::new();
    owner::only(&mut builder);
    match builder.create(folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
        _ => Ok(()),
    }
}

/// The file or folder belongs to the user.
pub(crate) fn is_own(about: &Metadata) -> bool {
    owner::is_own(about)
}

#[cfg(unix)]
mod owner {
    use super::{DirBuilder, Metadata, Path, fs};
    use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};

    fn user() -> u32 {
        rustix::process::geteuid().as_raw()
    }

    pub(super) fn temporary_name() -> String {
        format!("takt-{}", user())
    }

    pub(super) fn only(builder: &mut DirBuilder) {
        builder.mode(0o700);
    }

    pub(super) fn is_own(about: &Metadata) -> bool {
        about.uid() == user()
    }

    pub(super) fn check(folder: &Path) -> Result<(), String> {
        let read =
            |about: std::io::Result<Metadata>| about.map_err(|error| format!("cannot be read ({error})"));
        // For a symbolic link, both link and target must belong to the user: another user may have created the link.
        let (link, about) = (read(fs::symlink_metadata(folder))?, read(fs::metadata(folder))?);
        if !about.is_dir() {
            return Err("is not a folder".to_owned());
        }
        if let Some(other) = [&link, &about].into_iter().find(|about| !is_own(about)) {
            return Err(format!("belongs to user {}, not to the current user {}", other.uid(), user()));
        }
        let mode = about.mode() & 0o777;
        if mode & 0o022 != 0 {
            return Err(format!(
                "can be written by others (mode {mode:o}; delete it, and it is created again)"
            ));
        }
        if mode != 0o700 {
            fs::set_permissions(folder, fs::Permissions::from_mode(0o700))
                .map_err(|error| format!("has mode {mode:o}, which cannot be changed ({error})"))?;
        }
        Ok(())
    }
}

/// On other systems these folders are private to the user.
#[cfg(not(unix))]
mod owner {
    use super::{DirBuilder, Metadata, Path};

    pub(super) fn temporary_name() -> String {
        "takt".to_owned()
    }

    pub(super) fn only(_: &mut DirBuilder) {}

    pub(super) fn is_own(_: &Metadata) -> bool {
        true
    }

    pub(super) fn check(folder: &Path) -> Result<(), String> {
        if folder.is_dir() { Ok(()) } else { Err("is not a folder".to_owned()) }
    }
}
