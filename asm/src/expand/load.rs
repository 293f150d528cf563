// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loaders of sources. The assembler assumes no file system: it asks a [`Loader`].

use crate::limits;
use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// The reason why a source cannot be loaded.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum LoadError {
    /// No source has that name.
    #[error("there is no such file")]
    NotFound,
    /// The path leads outside the project folder.
    #[error("it lies outside the project folder")]
    Outside,
    /// The path names a folder or a device.
    #[error("it is not a regular file")]
    NotAFile,
    /// The file is larger than [`limits::FILE_BYTES`].
    #[error("it has more than the {} bytes that the assembler reads", limits::FILE_BYTES)]
    TooLarge,
    /// The system refuses, with this message.
    #[error("{0}")]
    System(String),
}

/// Provides sources by their path within the project: relative, `/` between folders, without `.` and `..`.
pub trait Loader {
    /// The bytes of a source.
    ///
    /// # Errors
    /// If the source cannot be loaded.
    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError>;

    /// The source as shared text, if the loader has it in memory; [`Loader::load`] returns equal bytes.
    fn text(&self, path: &str) -> Option<Arc<String>> {
        let _ = path;
        None
    }

    /// Names of the sources in a folder, as far as the loader can list them; the project's own folder is "".
    fn names(&self, folder: &str) -> Vec<String> {
        let _ = folder;
        Vec::new()
    }

    /// The user can add folders to the search: on a command line, not in a web page.
    fn takes_folders(&self) -> bool {
        true
    }

    /// The places beyond the project in which `.include` searches, in this order.
    fn places(&self) -> &[IncludePath] {
        &[]
    }
}

/// A place beyond the project where `.include` looks: a folder, or a library in memory.
#[derive(Clone, Debug)]
pub struct IncludePath(IncludePathKind);

#[derive(Clone, Debug)]
enum IncludePathKind {
    /// Prefix of the folder's paths, and the folder.
    Folder(String, FileLoader),
    Library(MemoryLoader),
}

impl IncludePath {
    /// The place is searched for `"name"` too, not only for `<name>`.
    pub(crate) fn takes_quoted(&self) -> bool {
        matches!(self.0, IncludePathKind::Folder(..))
    }

    /// Name of a file in diagnostics, listings and the debugger: distinct from every path within the project.
    pub(crate) fn name_of(&self, path: &str) -> String {
        match &self.0 {
            IncludePathKind::Folder(prefix, _) => format!("{prefix}{path}"),
            IncludePathKind::Library(_) => format!("<{path}>"),
        }
    }

    /// Names that `.include` can request here; for a folder, its own sources.
    pub(crate) fn sources(&self) -> Vec<String> {
        match &self.0 {
            IncludePathKind::Folder(_, folder) => folder.names(""),
            IncludePathKind::Library(files) => files.files.keys().cloned().collect(),
        }
    }
}

impl Loader for IncludePath {
    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError> {
        match &self.0 {
            IncludePathKind::Folder(_, folder) => folder.load(path),
            IncludePathKind::Library(files) => files.load(path),
        }
    }

    fn text(&self, path: &str) -> Option<Arc<String>> {
        match &self.0 {
            IncludePathKind::Folder(_, folder) => folder.text(path),
            IncludePathKind::Library(files) => files.text(path),
        }
    }
}

/// The sources of a project, and the places beyond it where `.include` looks.
#[derive(Clone, Debug)]
pub struct Search<L> {
    project: L,
    places: Vec<IncludePath>,
}

impl<L: Loader> Search<L> {
    /// Sources of a project without further places.
    pub fn new(project: L) -> Search<L> {
        Search { project, places: Vec::new() }
    }

    /// Adds a folder, searched after the existing places for `"name"` and for `<name>`.
    #[must_use]
    pub fn folder(mut self, folder: impl Into<PathBuf>) -> Search<L> {
        let folder = folder.into();
        let mut prefix = folder.display().to_string();
        // Paths within the project begin with a name: a prefix keeps them apart.
        if matches!(folder.components().next(), Some(Component::Normal(_))) {
            prefix.insert_str(0, "./");
        }
        if !prefix.ends_with('/') {
            prefix.push('/');
        }
        self.places.push(IncludePath(IncludePathKind::Folder(prefix, FileLoader::new(folder))));
        self
    }

    /// Replaces files by the texts that an editor has open, in the folders so far.
    #[must_use]
    pub fn with_open(mut self, open: &Open) -> Search<L> {
        for place in &mut self.places {
            if let IncludePathKind::Folder(_, folder) = &mut place.0 {
                folder.open = Arc::clone(open);
            }
        }
        self
    }

    /// Adds a library in memory, each file a name and its text, searched after the existing places for `<name>` only.
    #[must_use]
    pub fn library<'s>(mut self, files: impl IntoIterator<Item = &'s (&'s str, &'s str)>) -> Search<L> {
        self.places.push(IncludePath(IncludePathKind::Library(MemoryLoader::new(files))));
        self
    }
}

impl<L: Loader> Loader for Search<L> {
    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError> {
        self.project.load(path)
    }

    fn text(&self, path: &str) -> Option<Arc<String>> {
        self.project.text(path)
    }

    fn names(&self, folder: &str) -> Vec<String> {
        self.project.names(folder)
    }

    fn takes_folders(&self) -> bool {
        self.project.takes_folders()
    }

    fn places(&self) -> &[IncludePath] {
        &self.places
    }
}

/// Sources in memory, by path: embedded programs, editors, tests.
#[derive(Clone, Debug, Default)]
pub struct MemoryLoader {
    files: BTreeMap<String, MemorySource>,
}

/// A source in memory: text, or bytes that are not UTF-8.
#[derive(Clone, Debug)]
enum MemorySource {
    Text(Arc<String>),
    Bytes(Vec<u8>),
}

impl MemorySource {
    fn of(bytes: Vec<u8>) -> MemorySource {
        match String::from_utf8(bytes) {
            Ok(text) => MemorySource::Text(Arc::new(text)),
            Err(error) => MemorySource::Bytes(error.into_bytes()),
        }
    }

    fn bytes(&self) -> &[u8] {
        match self {
            MemorySource::Text(text) => text.as_bytes(),
            MemorySource::Bytes(bytes) => bytes,
        }
    }

    fn text(&self) -> Option<Arc<String>> {
        match self {
            MemorySource::Text(text) => Some(Arc::clone(text)),
            MemorySource::Bytes(_) => None,
        }
    }
}

impl MemoryLoader {
    /// A loader of sources, each a path and its text.
    pub fn new<'s>(sources: impl IntoIterator<Item = &'s (&'s str, &'s str)>) -> MemoryLoader {
        let mut loader = MemoryLoader::default();
        for (path, text) in sources {
            loader.add(*path, *text);
        }
        loader
    }

    /// A loader of one source.
    pub fn of(path: impl Into<String>, text: impl Into<Vec<u8>>) -> MemoryLoader {
        let mut loader = MemoryLoader::default();
        loader.add(path, text);
        loader
    }

    /// Adds a source, or replaces it.
    pub fn add(&mut self, path: impl Into<String>, text: impl Into<Vec<u8>>) {
        self.files.insert(path.into(), MemorySource::of(text.into()));
    }
}

impl Loader for MemoryLoader {
    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError> {
        self.files.get(path).map(|file| file.bytes().to_vec()).ok_or(LoadError::NotFound)
    }

    fn text(&self, path: &str) -> Option<Arc<String>> {
        self.files.get(path)?.text()
    }

    fn names(&self, folder: &str) -> Vec<String> {
        let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        let names = self.files.keys().filter_map(|path| path.strip_prefix(&prefix));
        names.filter(|name| !name.contains('/')).map(str::to_owned).collect()
    }

    fn takes_folders(&self) -> bool {
        false
    }
}

/// Loader that serves the first source from memory, and all others through another loader.
pub(crate) struct First<'l> {
    name: &'l str,
    source: MemorySource,
    rest: &'l dyn Loader,
}

impl<'l> First<'l> {
    pub(crate) fn new(name: &'l str, bytes: Vec<u8>, rest: &'l dyn Loader) -> First<'l> {
        First { name, source: MemorySource::of(bytes), rest }
    }
}

impl Loader for First<'_> {
    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError> {
        if path == self.name { Ok(self.source.bytes().to_vec()) } else { self.rest.load(path) }
    }

    fn text(&self, path: &str) -> Option<Arc<String>> {
        if path == self.name { self.source.text() } else { self.rest.text(path) }
    }

    fn names(&self, folder: &str) -> Vec<String> {
        self.rest.names(folder)
    }

    fn takes_folders(&self) -> bool {
        self.rest.takes_folders()
    }

    fn places(&self) -> &[IncludePath] {
        self.rest.places()
    }
}

/// Sources of a project folder. Nothing outside of it is read, whatever the path, and wherever a symbolic link points.
#[derive(Clone, Debug)]
pub struct FileLoader {
    root: PathBuf,
    /// Texts that replace files on the disk, by absolute path.
    open: Open,
}

/// Sources that an editor has open, by absolute path: saved or not, they replace the files on the disk.
pub type Open = Arc<BTreeMap<PathBuf, Arc<String>>>;

impl FileLoader {
    /// The loader of a folder. A missing folder is reported when a file is requested.
    pub fn new(root: impl Into<PathBuf>) -> FileLoader {
        FileLoader { root: root.into(), open: Open::default() }
    }

    /// The loader, with the texts that an editor has open.
    #[must_use]
    pub fn with_open(self, open: Open) -> FileLoader {
        FileLoader { open, ..self }
    }

    /// The loader of a file's folder, and the file's path in it.
    ///
    /// # Errors
    /// If the path names no file.
    pub fn of_file(path: impl AsRef<Path>) -> Result<(FileLoader, String), LoadError> {
        let path = path.as_ref();
        let name = path.file_name().and_then(|name| name.to_str()).ok_or(LoadError::NotFound)?;
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        Ok((FileLoader::new(folder), name.to_owned()))
    }
}

fn system(error: std::io::Error) -> LoadError {
    match error.kind() {
        std::io::ErrorKind::NotFound => LoadError::NotFound,
        _ => LoadError::System(error.to_string()),
    }
}

/// Extensions of sources: Takt's own, and the one that assemblers share.
pub const EXTENSIONS: [&str; 2] = ["tks", "s"];

/// A file's name has an extension of sources.
pub fn is_source(name: &str) -> bool {
    name.rsplit_once('.').is_some_and(|(_, extension)| EXTENSIONS.contains(&extension))
}

impl Loader for FileLoader {
    fn names(&self, folder: &str) -> Vec<String> {
        if !Path::new(folder).components().all(|part| matches!(part, Component::Normal(_))) {
            return Vec::new();
        }
        let entries = std::fs::read_dir(self.root.join(folder)).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut names: Vec<String> = names.filter(|name| is_source(name)).take(limits::CANDIDATES).collect();
        names.sort();
        names
    }

    fn load(&self, path: &str) -> Result<Vec<u8>, LoadError> {
        if path.contains('\0') {
            return Err(LoadError::NotFound);
        }
        let relative = Path::new(path);
        if !relative.components().all(|part| matches!(part, Component::Normal(_))) {
            return Err(LoadError::Outside);
        }
        // A file that is open in an editor need not be on the disk.
        if let Some(text) = self.open.get(&self.root.join(relative)) {
            return Ok(text.as_bytes().to_vec());
        }
        let root = self.root.canonicalize().map_err(system)?;
        let whole = root.join(relative).canonicalize().map_err(system)?;
        if !whole.starts_with(&root) {
            return Err(LoadError::Outside);
        }
        // Another path to the same file.
        if let Some(text) = self.open.get(&whole) {
            return Ok(text.as_bytes().to_vec());
        }
        let about = whole.metadata().map_err(system)?;
        if !about.is_file() {
            return Err(LoadError::NotAFile);
        }
        if about.len() > limits::FILE_BYTES as u64 {
            return Err(LoadError::TooLarge);
        }
        let file = std::fs::File::open(&whole).map_err(system)?;
        let mut bytes = Vec::new();
        // Read one byte more than allowed, to detect a file that grows meanwhile.
        file.take(limits::FILE_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(system)?;
        Ok(bytes)
    }
}

/// The path of an included file within the project, given the path of the including file; `None` if it leaves the project.
pub(crate) fn include_path(from: &str, path: &str) -> Option<String> {
    if path.starts_with('/') || path.contains(['\\', '\0']) || path.contains(':') {
        return None;
    }
    let folder = from.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    (!parts.is_empty()).then(|| parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_text_in_memory_and_rejects_other_bytes() {
        let mut files = MemoryLoader::of("a.s", " nop\n");
        files.add("b.s", [0x6e, 0xff]);
        let (shared, again) = (files.text("a.s").expect("it is text"), files.text("a.s"));
        assert!(again.is_some_and(|again| Arc::ptr_eq(&shared, &again)));
        assert_eq!(files.load("a.s"), Ok(shared.as_bytes().to_vec()));
        assert_eq!((files.text("b.s"), files.load("b.s")), (None, Ok(vec![0x6e, 0xff])));
        assert_eq!((files.text("c.s"), files.load("c.s")), (None, Err(LoadError::NotFound)));
        // Text found by a search is shared, too.
        assert!(Search::new(files).text("a.s").is_some_and(|again| Arc::ptr_eq(&shared, &again)));
    }

    #[test]
    fn include_paths_stay_in_the_project() {
        assert_eq!(include_path("a.s", "b.s").as_deref(), Some("b.s"));
        assert_eq!(include_path("x/a.s", "b.s").as_deref(), Some("x/b.s"));
        assert_eq!(include_path("x/a.s", "../y/./b.s").as_deref(), Some("y/b.s"));
        for outside in ["../b.s", "x/../../b.s", "/etc/passwd", "C:b.s", "..\\b.s", "", "."] {
            assert_eq!(include_path("a.s", outside), None, "{outside}");
        }
    }
}
