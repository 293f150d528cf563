// SPDX-License-Identifier: MIT OR Apache-2.0
//! The folder that a static host serves: the book as its first page, the playground, and the examples. All links are relative, so that it
//! may lie anywhere.

use crate::book;
use anyhow::{Context, Result};
use clap::Args;
use std::fmt::Write;
use std::path::Path;
use takt_automation::command::root;
use takt_programs::{EXAMPLES, RECORDS, title};

/// What is done beyond writing the folder.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Take the playground as it was built last, if it was.
    #[arg(long)]
    no_web: bool,
    /// Open it in a headless browser, below a folder of its host: the search, and every listing in the playground.
    #[arg(long)]
    test: bool,
}

/// The folder.
const PAGES: &str = "target/pages";

pub(crate) fn pages(arguments: &Arguments) -> Result<()> {
    book::book(&book::Arguments::pages(arguments.no_web))?;
    let folder = root().join(PAGES);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| format!("cannot empty {}", folder.display()))?;
    }
    book::copy(&root().join(book::SITE), &folder)?;
    examples(&folder.join("examples"))?;
    // GitHub's Jekyll would leave out files that begin with an underscore.
    std::fs::write(folder.join(".nojekyll"), "")?;
    let (pages, links) = book::check_links(&folder)?;
    println!("{pages} pages in {PAGES}, {links} links checked: any static host serves this folder as it is");
    if arguments.test { book::test(&folder) } else { Ok(()) }
}

/// Writes the examples as texts, with a page that lists them.
fn examples(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let mut list = String::new();
    for (name, text) in EXAMPLES.iter().chain(RECORDS) {
        // Browsers display this extension, and offer others as downloads.
        std::fs::write(folder.join(format!("{name}.txt")), text)?;
        if !name.ends_with(".s") {
            continue;
        }
        let _ = writeln!(
            list,
            "<li><a href=\"../playground/index.html#example={name}\">{name}</a>: {} (<a href=\"{name}.txt\">source</a>)</li>",
            title(text).replace('&', "&amp;").replace('<', "&lt;")
        );
    }
    let page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>Takt: examples</title>\n\
         <body style=\"max-width: 50em; margin: 2em auto; padding: 0 1em; font: 1em/1.5 system-ui, sans-serif\">\n\
         <h1>Examples</h1>\n<p>Each opens in the <a href=\"../playground/index.html\">playground</a>, and runs there. <a href=\"../index.html\">Takt</a></p>\n\
         <ul>\n{list}</ul>\n"
    );
    Ok(std::fs::write(folder.join("index.html"), page)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_example_is_listed_and_there() {
        let folder = std::env::temp_dir().join(format!("takt-examples-{}", std::process::id()));
        examples(&folder).expect("they can be written");
        let page = std::fs::read_to_string(folder.join("index.html")).expect("it was just written");
        for (name, text) in EXAMPLES.iter().filter(|(name, _)| name.ends_with(".s")) {
            assert!(page.contains(&format!("#example={name}\">{name}</a>: ")), "{name}");
            assert_eq!(
                std::fs::read_to_string(folder.join(format!("{name}.txt"))).expect("it is there"),
                *text
            );
        }
        std::fs::remove_dir_all(&folder).expect("it can be emptied");
    }
}
