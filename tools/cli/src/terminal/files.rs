// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files that commands read and write; `-` is standard input or output.

use crate::terminal::output::Failure;
use crate::terminal::page::Page;
use anyhow::{Context, Result, bail};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use takt_asm::nearest;
use takt_isa::text::visible;

/// Folder of the shipped examples, from the top of the sources.
const EXAMPLES: &str = "programs/examples";

/// The path denotes standard input or output.
pub(crate) fn is_dash(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Data may still arrive, as on standard input or a pipe. (A regular file is complete.)
pub(crate) fn is_live(path: &Path) -> bool {
    is_dash(path) || fs::metadata(path).is_ok_and(|about| !about.is_file())
}

/// Name of an input file in messages.
pub(crate) fn input_name(path: &Path) -> String {
    if is_dash(path) { "standard input".to_owned() } else { path.display().to_string() }
}

/// Number of files that a message names at most.
const NAMED: usize = 6;

/// Suffix for the message about a file that is not there: one of a similar name in the folder, or the shipped example of the name, or the
/// files of the same kind in the folder, or among the examples.
fn near(path: &Path) -> String {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Some(wanted) = path.file_name() else { return String::new() };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    let alike = nearest(&wanted.to_string_lossy(), names.iter().map(String::as_str));
    let alike = alike.map(|name| path.with_file_name(name));
    let example = Path::new(EXAMPLES).join(wanted);
    let mut examples = [example.clone(), example.with_extension("s")].into_iter();
    match alike.or_else(|| examples.find(|example| example.exists())) {
        Some(meant) => format!("; did you mean `{}`?", meant.display()),
        None => {
            let kind = |folder: &Path| of_kind(folder, path).map(|files| (folder.to_owned(), files));
            match kind(folder).or_else(|| kind(Path::new(EXAMPLES))) {
                Some((folder, files)) if folder == Path::new(".") => {
                    format!("; this folder has {files}")
                }
                Some((folder, files)) => format!("; {} has {files}", folder.display()),
                None => String::new(),
            }
        }
    }
}

/// Names of the files in a folder that end as a path does, by the alphabet.
fn of_kind(folder: &Path, path: &Path) -> Option<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let alike = entries.filter(|entry| entry.extension() == path.extension() && entry.is_file());
    let mut names: Vec<String> =
        alike.filter_map(|entry| Some(entry.file_name()?.to_string_lossy().into_owned())).collect();
    names.sort();
    let more = names.len().saturating_sub(NAMED);
    names.truncate(NAMED);
    let list = names.join(", ");
    if list.is_empty() { None } else { Some(if more > 0 { format!("{list} and {more} more") } else { list }) }
}

/// Opens an input file.
pub(crate) fn open(path: &Path) -> Result<Box<dyn Read>> {
    if is_dash(path) {
        return Ok(Box::new(io::stdin().lock()));
    }
    let file = match File::open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            bail!("cannot open {}: No such file or directory{}", path.display(), near(path))
        }
        opened => opened.with_context(|| format!("cannot open {}", path.display()))?,
    };
    if file.metadata().is_ok_and(|about| about.is_dir()) {
        bail!("{} is a folder, not a file", path.display());
    }
    Ok(Box::new(file))
}

/// Reads a whole file of at most `limit` bytes. An empty file is an error for all callers.
pub(crate) fn read(path: &Path, limit: usize) -> Result<Vec<u8>> {
    let name = input_name(path);
    let mut bytes = Vec::new();
    open(path)?
        .take(limit as u64 + 1)
        .read_to_end(&mut bytes)
        .with_context(|| format!("cannot read {name}"))?;
    if bytes.len() > limit {
        bail!("{name} is larger than {} MiB", limit >> 20);
    }
    if bytes.is_empty() {
        bail!("{name} is empty");
    }
    Ok(bytes)
}

/// Buffered standard output or output file.
///
/// A file is written under a temporary name in the same folder and renamed in [`Out::finish`]: until then, and after any failure, the
/// target is unchanged. Files other than regular ones (devices, pipes) are written directly.
pub(crate) struct Out {
    writer: Box<dyn Write>,
    name: String,
    partial: Option<PartialFile>,
    /// Formatting state, if the output is meant for people.
    shown: Option<DisplayState>,
}

/// Formatting state of output meant for people.
#[derive(Default)]
struct DisplayState {
    /// First bytes of an incomplete character.
    begun: Vec<u8>,
    page: Page,
    /// Current line so far, if the page has a width.
    line: String,
}

impl DisplayState {
    /// Adds text; returns complete lines and keeps the remainder.
    fn add(&mut self, text: &str) -> String {
        if self.page.width.is_none() {
            return text.to_owned();
        }
        let mut ready = String::new();
        for piece in text.split_inclusive('\n') {
            self.line.push_str(piece);
            if let Some(line) = self.line.strip_suffix('\n') {
                ready.push_str(&self.page.folded(line));
                ready.push('\n');
                self.line.clear();
            }
        }
        ready
    }
}

/// A file under its temporary name, removed on drop.
struct PartialFile {
    temporary: PathBuf,
    target: PathBuf,
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        // After the rename, the temporary file no longer exists.
        let _ = fs::remove_file(&self.temporary);
    }
}

const BUFFER: usize = 1 << 16;

impl Out {
    /// Standard output, for the contents of a file.
    fn stdout() -> Out {
        let writer = BufWriter::with_capacity(BUFFER, io::stdout());
        Out { writer: Box::new(writer), name: "standard output".to_owned(), partial: None, shown: None }
    }

    /// Standard output, for results. Names and texts from outside are escaped, so that a terminal does not execute control sequences in
    /// them.
    pub(crate) fn results() -> Out {
        Out { shown: Some(DisplayState::default()), ..Out::stdout() }
    }

    /// Sets the format of subsequent results.
    pub(crate) fn set_page(&mut self, page: Page) {
        if let Some(shown) = &mut self.shown {
            shown.page = page;
        }
    }

    /// Format of subsequent results.
    pub(crate) fn page(&self) -> Page {
        self.shown.as_ref().map_or(Page::default(), |shown| shown.page)
    }

    /// Writes lines that may contain bold text from [`Page::strong`]; all other control characters are escaped.
    pub(crate) fn lines(&mut self, text: &str) -> io::Result<()> {
        let text = crate::terminal::output::coloured(text);
        let result = match &mut self.shown {
            None => self.writer.write_all(text.as_bytes()),
            Some(shown) => self.writer.write_all(shown.add(&text).as_bytes()),
        };
        self.named(result)
    }

    /// Writes lines as a paragraph: filled to the page's width, or unchanged if the page has none.
    pub(crate) fn paragraph(&mut self, text: &str) -> io::Result<()> {
        let indent = &text[..text.len() - text.trim_start_matches(' ').len()];
        match self.page().width {
            None => self.write_all(text.as_bytes()),
            Some(_) => {
                let words: Vec<&str> = text.split_whitespace().collect();
                writeln!(self, "{indent}{}", words.join(" "))
            }
        }
    }

    /// Creates a file. Errors in the path are detected here, before any work.
    pub(crate) fn create(path: &Path) -> Result<Out> {
        if is_dash(path) {
            return Ok(Out::stdout());
        }
        let name = path.display().to_string();
        let (file, partial) = begin(path).with_context(|| format!("cannot write {name}"))?;
        let writer = Box::new(BufWriter::with_capacity(BUFFER, file));
        Ok(Out { writer, name, partial, shown: None })
    }

    /// Completes the file and renames it to its target.
    pub(crate) fn finish(mut self) -> Result<()> {
        self.flush()?;
        let Out { writer, name, partial, .. } = self;
        drop(writer);
        partial.map_or(Ok(()), |PartialFile { ref temporary, ref target }| {
            fs::rename(temporary, target).with_context(|| format!("cannot write {name}"))
        })
    }

    fn named<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| io::Error::new(error.kind(), format!("cannot write {}: {error}", self.name)))
    }
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = match &mut self.shown {
            None => self.writer.write(bytes),
            Some(results) => {
                let text = escaped_text(&mut results.begun, bytes);
                self.writer.write_all(results.add(&text).as_bytes()).map(|()| bytes.len())
            }
        };
        self.named(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let begun = self.shown.as_mut().map(|shown| std::mem::take(&mut shown.line)).unwrap_or_default();
        let result = self.writer.write_all(begun.as_bytes()).and_then(|()| self.writer.flush());
        self.named(result)
    }
}

/// Escapes the text of results. `begun` holds the first bytes of an incomplete character, from the previous call and for the next.
fn escaped_text(begun: &mut Vec<u8>, bytes: &[u8]) -> String {
    begun.extend_from_slice(bytes);
    let mut text = String::with_capacity(begun.len());
    let mut rest = 0;
    for chunk in begun.utf8_chunks() {
        text.push_str(&visible(chunk.valid()));
        rest += chunk.valid().len() + chunk.invalid().len();
        let is_last = rest == begun.len();
        // A character has at most four bytes.
        if is_last && std::str::from_utf8(chunk.invalid()).is_err_and(|error| error.error_len().is_none()) {
            rest -= chunk.invalid().len();
            break;
        }
        if !chunk.invalid().is_empty() {
            text.push(char::REPLACEMENT_CHARACTER);
        }
    }
    begun.drain(..rest);
    text
}

fn begin(path: &Path) -> Result<(File, Option<PartialFile>)> {
    // Replace the target of a symbolic link, not the link.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let existing = fs::metadata(&target).ok();
    match &existing {
        Some(about) if about.is_dir() => bail!("it is a folder"),
        Some(about) if !about.is_file() => return Ok((File::options().write(true).open(&target)?, None)),
        Some(about) if about.permissions().readonly() => bail!("it is read-only"),
        _ => {}
    }
    let Some(file_name) = target.file_name() else { bail!("it names no file") };
    let mut temporary = OsString::from(".");
    temporary.push(file_name);
    temporary.push(format!(".{}.partial", std::process::id()));
    let temporary = target.with_file_name(temporary);
    let file = File::create_new(&temporary)?;
    let partial = PartialFile { temporary, target };
    if let Some(about) = existing {
        file.set_permissions(about.permissions())?;
    }
    Ok((file, Some(partial)))
}

/// Writes a complete file.
pub(crate) fn write(path: &Path, contents: &[u8]) -> Result<()> {
    let mut out = Out::create(path)?;
    out.write_all(contents)?;
    out.finish()
}

/// Writes a value as indented JSON; lines are not folded.
pub(crate) fn json(value: &impl serde::Serialize, out: &mut Out) -> Result<()> {
    out.set_page(Page::default());
    // Format to a string first, so that a write error stays an `io::Error`.
    let text = serde_json::to_string_pretty(value)?;
    Ok(writeln!(out, "{text}")?)
}

/// A path, with the option that specified it.
pub(crate) type OptionPath<'a> = (&'static str, &'a Path);

/// Rejects a command line that reads standard input twice, writes a file twice, or overwrites an input.
pub(crate) fn check(reads: &[OptionPath<'_>], writes: &[OptionPath<'_>]) -> Result<()> {
    let usage = |text: String| Err(Failure::Usage(text).into());
    if let [(first, _), (second, _), ..] =
        reads.iter().filter(|(_, path)| is_dash(path)).collect::<Vec<_>>()[..]
    {
        return usage(format!("standard input cannot be both {first} and {second}"));
    }
    for (i, &(option, path)) in writes.iter().enumerate() {
        let Some(file) = identity(path) else { continue };
        if let Some((other, _)) =
            writes[..i].iter().find(|(_, other)| identity(other).as_ref() == Some(&file))
        {
            let what = if is_dash(path) { "standard output".to_owned() } else { path.display().to_string() };
            return usage(format!("{other} and {option} would both write to {what}"));
        }
        let is_read = |(_, read): &&OptionPath<'_>| !is_dash(read) && identity(read).as_ref() == Some(&file);
        if let Some((read, _)) = reads.iter().find(is_read) {
            return usage(format!("{option} would overwrite {}, which is {read}", path.display()));
        }
    }
    Ok(())
}

/// Key that is equal for two paths of one file; `None` for files that may be written twice, such as /dev/null.
fn identity(path: &Path) -> Option<PathBuf> {
    if is_dash(path) {
        return Some(path.to_owned());
    }
    match fs::canonicalize(path) {
        Ok(whole) => whole.is_file().then_some(whole),
        Err(_) => {
            let folder =
                path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_is_independent_of_write_sizes() {
        let text = "a\x1b]0;t\x07 µ𝄞\u{9b}1m\r\n\tend";
        let wanted = "a\\u001b]0;t\\u0007 µ𝄞\\u009b1m\\u000d\n\tend";
        for size in 1..=text.len() {
            let mut begun = Vec::new();
            let all: String =
                text.as_bytes().chunks(size).map(|piece| escaped_text(&mut begun, piece)).collect();
            assert_eq!((all.as_str(), begun.len()), (wanted, 0), "pieces of {size}");
        }
        assert_eq!(escaped_text(&mut Vec::new(), b"a\xffb"), "a\u{fffd}b");
    }
}
