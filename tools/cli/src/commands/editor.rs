// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt editor`: writes the configuration of an editor.

use crate::terminal::files::{self, Out};
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use std::fs;
use std::io::{IsTerminal, Write, stdin, stdout};
use std::path::{Path, PathBuf};

const NEOVIM: &str = include_str!("../../../editors/neovim/takt.lua");
const NEOVIM_SYNTAX: &str = include_str!("../../../editors/neovim/syntax/takt.vim");
const HELIX: &str = include_str!("../../../editors/helix/languages.toml");
const EMACS: &str = include_str!("../../../editors/emacs/takt.el");
const EMACS_WORDS: &str = include_str!("../../../editors/emacs/takt-words.el");
/// Line that makes Emacs load the file beside its `init.el`.
const LOAD: &str = "(load (expand-file-name \"takt\" user-emacs-directory))\n";

/// Set an editor up for Takt's sources: Neovim, Helix or Emacs.
///
/// Lists the files, and asks on a terminal before it writes them. VS Code has an extension (docs/editors.md).
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Editor {
    /// The editor.
    #[arg(value_enum)]
    editor: Kind,
    /// Write the files without a question.
    #[arg(long)]
    write: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt editor neovim                 ask, then write ~/.config/nvim/plugin/takt.lua
  takt editor emacs --write          write without a question";

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    Neovim,
    Helix,
    Emacs,
}

/// A file to write, or to extend.
struct Change {
    path: PathBuf,
    contents: String,
    /// Text by which an extended file shows that it has been extended before; `None`: the file is Takt's own.
    mark: Option<&'static str>,
}

impl Change {
    fn own(path: PathBuf, contents: &str) -> Change {
        Change { path, contents: contents.to_owned(), mark: None }
    }

    /// The file's next contents, and the verb for its change; `None` if nothing changes.
    fn next(&self) -> Result<Option<(&'static str, String)>> {
        let before = match fs::read_to_string(&self.path) {
            Ok(text) => Some(text),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => {
                return Err(error).with_context(|| format!("cannot read {}", self.path.display()));
            }
        };
        Ok(match (before, self.mark) {
            (None, _) => Some(("create", self.contents.clone())),
            (Some(before), None) if before == self.contents => None,
            (Some(_), None) => Some(("replace", self.contents.clone())),
            (Some(before), Some(mark)) if before.contains(mark) => None,
            (Some(before), Some(_)) => {
                let gap = if before.is_empty() || before.ends_with('\n') { "" } else { "\n" };
                Some(("extend", format!("{before}{gap}{}", self.contents)))
            }
        })
    }
}

/// Helix's configuration without the grammar: it names a folder of Takt's sources, which need not be there.
fn helix() -> String {
    let rest = HELIX.split_once("[language-server.takt]").map_or(HELIX, |(_, rest)| rest);
    format!("\n# Takt\n[language-server.takt]{rest}")
}

/// Changes for an editor, and the sentence after them.
fn changes(kind: Kind, home: &Path, config: &Path) -> (Vec<Change>, &'static str) {
    match kind {
        Kind::Neovim => (
            vec![
                Change::own(config.join("nvim/plugin/takt.lua"), NEOVIM),
                Change::own(config.join("nvim/syntax/takt.vim"), NEOVIM_SYNTAX),
            ],
            "Neovim colours Takt's sources, and starts `takt lsp` in them; docs/editors.md has the parser for folds by tree-sitter.\n\
             Next: `nvim programs/examples/pi.s`, or a source of yours.",
        ),
        Kind::Helix => (
            vec![Change {
                path: config.join("helix/languages.toml"),
                contents: helix(),
                mark: Some("[language-server.takt]"),
            }],
            "Helix starts `takt lsp` in files *.tks (not tested in Helix itself); docs/editors.md has the grammar for colours.\n\
             Next: `hx law.tks`, a source of yours; `hx --health takt` says whether the server is found.",
        ),
        Kind::Emacs => {
            let (old, new) = (home.join(".emacs.d"), config.join("emacs"));
            let folder = if new.is_dir() && !old.is_dir() { new } else { old };
            let init = Change {
                path: folder.join("init.el"),
                contents: LOAD.to_owned(),
                mark: Some(LOAD.trim_ascii_end()),
            };
            (
                vec![
                    Change::own(folder.join("takt.el"), EMACS),
                    Change::own(folder.join("takt-words.el"), EMACS_WORDS),
                    init,
                ],
                "`M-x eglot` or `M-x lsp` starts `takt lsp` in a source.\n\
                 Next: `emacs programs/examples/pi.s`, or a source of yours; there `M-x eglot` or `M-x lsp`.",
            )
        }
    }
}

pub(crate) fn run(arguments: &Editor, out: &mut Out) -> Result<()> {
    let Some(home) = std::env::home_dir() else { bail!("there is no home folder to write to") };
    let config = std::env::var_os("XDG_CONFIG_HOME").filter(|path| !path.is_empty());
    let config = config.map_or_else(|| home.join(".config"), PathBuf::from);
    let (changes, then) = changes(arguments.editor, &home, &config);
    let mut all = Vec::new();
    for change in &changes {
        match change.next()? {
            Some((verb, contents)) => {
                writeln!(out, "{verb} {}", change.path.display())?;
                all.push((&change.path, contents));
            }
            None => writeln!(out, "leave {} as it is", change.path.display())?,
        }
    }
    if all.is_empty() {
        return Ok(writeln!(out, "nothing to do. {then}")?);
    }
    if !arguments.write && !is_agreed(out)? {
        return Ok(writeln!(out, "nothing is written; --write does it")?);
    }
    for (path, contents) in all {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        }
        files::write(path, contents.as_bytes())?;
    }
    Ok(writeln!(out, "written. {then}")?)
}

/// Question on a terminal; without a terminal, the answer is no.
fn is_agreed(out: &mut Out) -> Result<bool> {
    if !stdin().is_terminal() || !stdout().is_terminal() {
        return Ok(false);
    }
    write!(out, "write? [y/N] ")?;
    out.flush()?;
    let mut answer = String::new();
    stdin().read_line(&mut answer)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
