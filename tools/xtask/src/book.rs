// SPDX-License-Identifier: MIT OR Apache-2.0
//! Documentation site: `docs/` in mdbook, the crates' API documentation, and the playground, in which every listing opens.

mod colour;

use crate::web;
use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use miniz_oxide::deflate::compress_to_vec_zlib;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Component, Path, PathBuf};
use std::process::Command;
use takt_automation::check_cache::Inputs;
use takt_automation::command::{cargo, root, run};
use takt_automation::progress;
use takt_programs::listings::listings;

/// The parts of the site.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Leave out the crates' documentation, which takes longest.
    #[arg(long)]
    no_rustdoc: bool,
    /// Take the playground as it was built last, if it was.
    #[arg(long)]
    no_web: bool,
    /// Leave out the playground, which compiles Takt for browsers.
    #[arg(long, conflicts_with_all = ["no_web", "test"])]
    no_playground: bool,
    /// Open it in a headless browser: the search, and every listing in the playground.
    #[arg(long)]
    test: bool,
}

impl Arguments {
    /// The whole site, without browser tests.
    pub(crate) const WHOLE: Arguments =
        Arguments { no_rustdoc: false, no_web: false, no_playground: false, test: false };
    /// Documents alone, with a check of links.
    pub(crate) const DOCUMENTS: Arguments =
        Arguments { no_rustdoc: true, no_web: false, no_playground: true, test: false };

    /// Documents and playground, as a static host serves them; `no_web`: with the playground as it was built last.
    pub(crate) const fn pages(no_web: bool) -> Arguments {
        Arguments { no_rustdoc: true, no_web, no_playground: false, test: false }
    }
}

/// mdbook version that the site supports.
const MDBOOK: &str = "0.5.4";
/// Installation folder of mdbook.
const TOOLS: &str = "target/tools";
/// Input and output folders of mdbook.
const SOURCE: &str = "target/book/source";
pub(crate) const SITE: &str = "target/book/site";

/// Title page: the document, and its chapter, from which mdbook makes `index.html`.
const TITLE_PAGE: (&str, &str) = ("README.md", "index.md");
/// Documents in reading order, by part; every document must be listed.
const PARTS: &[(&str, &[&str])] = &[
    ("Start", &["first-controller", "tour", "coming-from", "what-fits", "examples", "figures"]),
    ("Writing programs", &["language", "editors", "playground", "library", "fast-code", "scheduling"]),
    ("Time and accuracy", &["analysis", "accuracy", "timing", "verify"]),
    ("Running programs", &["debugging", "python", "plant", "fmi", "mujoco", "batch", "traces"]),
    ("Programs from models and C", &["model", "models", "readers", "c"]),
    ("Motors and boards", &["motor", "power-stage", "board", "protocol", "safety", "linuxcnc"]),
    ("Several cores, your own design", &["system", "hardware", "headers", "image"]),
    ("Robots", &["robot", "friction", "generation", "arm", "controller", "robot-commands"]),
    ("The processor", &["isa", "machines", "synthesis", "machine-choice", "trig"]),
    ("Evidence", &["verification", "campaigns", "speed"]),
    ("Reference", &["glossary", "reach"]),
];
/// Title of the page with links to the playground and the crates' documentation.
const BESIDE: &str = "Playground and API";

pub(crate) fn book(arguments: &Arguments) -> Result<()> {
    let mdbook = mdbook()?;
    let is_built = arguments.no_web && root().join(web::PAGE).join("index.html").exists();
    if !arguments.no_playground && !is_built {
        web::build()?;
    }
    let (source, site) = (root().join(SOURCE), root().join(SITE));
    for folder in [&source, &site] {
        if folder.exists() {
            std::fs::remove_dir_all(folder).with_context(|| format!("cannot empty {}", folder.display()))?;
        }
    }
    write_source(&root().join("docs"), &source)?;
    progress::step("the book's pages", || {
        run(Command::new(mdbook).arg("build").arg(&source).arg("--dest-dir").arg(&site))
    })?;
    if !arguments.no_playground {
        copy(&root().join(web::PAGE), &site.join("playground"))?;
        // Beside the book, its name leads there.
        let page = site.join("playground/index.html");
        let text = std::fs::read_to_string(&page)?;
        let home = r#"<a id="home" href="../index.html" title="Takt, and its documents">"#;
        std::fs::write(page, text.replace(r#"<a id="home">"#, home))?;
    }
    if !arguments.no_rustdoc {
        // Document the libraries only; packages for work on the project itself have no external users.
        let excluded = ["xtask", "unify", "takt-benches", "takt"];
        let excluded = excluded.iter().flat_map(|package| ["--exclude", package]);
        let mut document = cargo();
        document.args(["doc", "--workspace", "--no-deps", "--lib", "--release"]).args(excluded);
        progress::step("the crates' documentation", || run(&mut document))?;
        copy(&root().join("target/doc"), &site.join("api"))?;
    }
    let (pages, links) = check_links(&site)?;
    println!(
        "{pages} pages in {SITE}, {links} links checked: `python3 -m http.server -d {SITE}` serves them"
    );
    if arguments.test { test(&site) } else { Ok(()) }
}

/// Opens a site in a headless browser, below a folder of its host.
pub(crate) fn test(site: &Path) -> Result<()> {
    web::in_browser("test/book.test.mjs", &[("TAKT_BOOK", site)])
}

/// Inputs of the documentation check.
pub(crate) fn inputs() -> Result<Inputs> {
    let files = ["docs", "tools/xtask/src/book.rs", "tools/xtask/src/book/colour.rs"];
    files.iter().try_fold(Inputs::default().and(MDBOOK), |inputs, path| inputs.files(path))
}

/// mdbook in the pinned version: the installed program, or a local build.
fn mdbook() -> Result<PathBuf> {
    let is_it = |program: &Path| {
        let output = Command::new(program).arg("--version").output();
        output.is_ok_and(|output| {
            String::from_utf8_lossy(&output.stdout).trim().ends_with(&format!("v{MDBOOK}"))
        })
    };
    let own = root().join(TOOLS).join("bin/mdbook");
    for program in [PathBuf::from("mdbook"), own.clone()] {
        if is_it(&program) {
            return Ok(program);
        }
    }
    // A debug build: mdbook runs for only a second, so compile time dominates.
    let install = ["install", "mdbook", "--version", MDBOOK, "--locked", "--debug", "--root", TOOLS];
    progress::step(&format!("installing mdbook {MDBOOK} into {TOOLS}, as it is missing"), || {
        run(cargo().args(install).args(["--no-default-features", "--features", "search"]))
    })?;
    Ok(own)
}

/// Writes mdbook's input: documents with links and listings adapted to the site.
fn write_source(docs: &Path, folder: &Path) -> Result<()> {
    let chapters = folder.join("src");
    std::fs::create_dir_all(&chapters)?;
    let (mut titles, mut texts) = (BTreeMap::new(), Vec::new());
    for entry in std::fs::read_dir(docs).context("cannot read docs/")? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let Some(stem) = name.strip_suffix(".md") else { continue };
        let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read docs/{name}"))?;
        let title = text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or(stem).to_owned();
        titles.insert(stem.to_owned(), title);
        texts.push((name, text));
    }
    let (title_page, index) = TITLE_PAGE;
    for (name, text) in texts {
        let file = if name == title_page { index } else { &name };
        std::fs::write(chapters.join(file), titled(&chapter(&name, &text, &chapters)?, &titles))?;
    }
    copy(&docs.join("pictures"), &chapters.join("pictures"))?;
    let title = titles.remove(title_page.trim_end_matches(".md")).context("docs/ has no title page")?;
    let mut summary = format!("# Summary\n\n[{title}]({index})\n");
    let mut contents = String::new();
    let mut put = |part: &str, chapters: Vec<(String, String)>| {
        if !chapters.is_empty() {
            let list =
                chapters.iter().map(|(name, title)| format!("- [{title}]({name}.md)\n")).collect::<String>();
            let _ = write!(summary, "\n# {part}\n\n{list}");
            let _ = write!(contents, "\n## {part}\n\n{list}");
        }
    };
    for (part, names) in PARTS {
        put(part, names.iter().filter_map(|name| titles.remove_entry(*name)).collect());
    }
    ensure!(titles.is_empty(), "name these documents in `PARTS` of {}: {titles:?}", file!());
    let _ = write!(summary, "\n---\n\n[{BESIDE}](beside.md)\n");
    let front = format!(
        "# {BESIDE}\n\n\
         <a href=\"playground/index.html\" target=\"_blank\"><b>Open the playground</b></a>: write, assemble and run programs in this browser, \
         without installing anything.\n\nThe crates' documentation: <a href=\"api/takt_isa/index.html\" target=\"_blank\">API</a>.\n{contents}"
    );
    std::fs::write(chapters.join("beside.md"), front)?;
    std::fs::write(chapters.join("SUMMARY.md"), summary)?;
    std::fs::write(folder.join("takt.css"), format!("{CSS}{}", colour::CSS))?;
    std::fs::write(folder.join("takt.js"), SCRIPT)?;
    std::fs::create_dir_all(folder.join("theme"))?;
    std::fs::write(folder.join("theme/favicon.svg"), FAVICON)?;
    std::fs::write(folder.join("book.toml"), CONFIGURATION)?;
    Ok(())
}

const CONFIGURATION: &str = "\
[book]
title = \"Takt\"
language = \"en\"

[output.html]
additional-css = [\"takt.css\"]
additional-js = [\"takt.js\"]
no-section-label = true

[output.html.search]
limit-results = 40
";

/// Icon of the site, in place of mdbook's: ticks, and a period that ends before the next one.
const FAVICON: &str = "\
<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 32 32\">
<rect width=\"32\" height=\"32\" rx=\"6\" fill=\"#1f4e79\"/>
<path d=\"M6 7v18M26 7v18\" stroke=\"#fff\" stroke-width=\"3\" stroke-linecap=\"round\"/>
<rect x=\"6\" y=\"12\" width=\"13\" height=\"8\" fill=\"#ffb000\"/>
</svg>
";

const CSS: &str = "\
:root { --content-max-width: 980px; }
.playground-link { display: block; text-align: right; font-size: 0.85em; margin: -1em 0 1.2em; }
.content main table { font-size: 0.95em; }
.content pre > code { font-size: 0.82em; line-height: 1.45; }
a.to-playground { color: var(--icons); padding: 0 8px; font-size: 0.9em; white-space: nowrap; }
html:is(.navy, .coal, .ayu) { --links: #82b6f5; --sidebar-active: #82b6f5; }
@media (max-width: 500px) { .to-playground span { display: none; } .menu-title { font-size: 1.5rem; } .content main table :is(td, th) { padding: 3px 8px; } }
";

/// Script that adds a link to the playground to the buttons of each page.
const SCRIPT: &str = "\
const buttons = document.querySelector('.right-buttons');
const link = Object.assign(document.createElement('a'), {
  href: 'playground/index.html',
  target: '_blank', className: 'to-playground', title: 'Open the playground in a new tab',
});
link.append('Playground', Object.assign(document.createElement('span'), { textContent: ' ↗' }));
buttons?.prepend(link);
";

/// Converts a document to a chapter: adds a playground link below each listing, and links files outside `docs/` to copies beside the book.
fn chapter(name: &str, text: &str, folder: &Path) -> Result<String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    for listing in listings(text) {
        let at = listing.text.as_ptr() as usize - rest.as_ptr() as usize;
        let end = at + listing.text.len();
        let fence = rest[end..].find('\n').map_or(rest.len(), |offset| end + offset + 1);
        // Copy up to the line that opens the block, and replace the block by its coloured version.
        let opening = rest[..at].trim_end_matches('\n').rfind('\n').map_or(0, |offset| offset + 1);
        out.push_str(&rest[..opening]);
        out.push_str(&colour::html(listing.text, &listing.program));
        let stem = name.trim_end_matches(".md");
        let program = json!({ "name": format!("{stem}.s"), "source": listing.program });
        let _ = write!(
            out,
            "\n<a class=\"playground-link\" target=\"_blank\" href=\"playground/index.html#{}\">Open in the playground</a>\n",
            fragment(&program.to_string())
        );
        rest = &rest[fence..];
    }
    out.push_str(rest);
    outside(name, &uncommented(&out), folder)
}

/// Drops comments, which are for those who write the documents.
fn uncommented(text: &str) -> String {
    let mut parts = text.split("<!--");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let rest = part.split_once("-->").map_or(part, |(_, rest)| rest);
        // A comment on lines of its own leaves none.
        let is_alone = out.is_empty() || out.ends_with('\n');
        let rest = if is_alone { rest.strip_prefix('\n').unwrap_or(rest) } else { rest };
        out.push_str(rest);
    }
    out
}

/// Replaces file names in link texts, as in `[glossary.md](glossary.md)`, by titles.
fn titled(text: &str, titles: &BTreeMap<String, String>) -> String {
    let link = |text: String, (stem, title): (&String, &String)| {
        let shown = format!("[{stem}.md]({stem}.md");
        text.replace(&shown, &format!("[{title}]({stem}.md"))
    };
    titles.iter().fold(text.to_owned(), link)
}

/// URL fragment that contains the program, unpacked by `tools/web/page/src/link.js`.
fn fragment(program: &str) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    let mut text = "p1=".to_owned();
    for chunk in compress_to_vec_zlib(program.as_bytes(), 9).chunks(3) {
        let group =
            chunk.iter().fold(0u32, |group, byte| group << 8 | u32::from(*byte)) << (8 * (3 - chunk.len()));
        for digit in 0..=chunk.len() {
            text.push(char::from(DIGITS[(group >> (18 - 6 * digit)) as usize & 63]));
        }
    }
    text
}

/// Redirects links to files outside `docs/` to copies beside the book. Links to folders and missing files become plain text.
fn outside(name: &str, text: &str, folder: &Path) -> Result<String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("](../") {
        let (before, link) = rest.split_at(at + 2);
        let end = link.find(')').with_context(|| format!("docs/{name}: a link does not end"))?;
        let target = link[..end].split('#').next().unwrap_or_default();
        let inner = normal(&Path::new("docs").join(target));
        let file = root().join(&inner);
        if file.is_file() {
            out.push_str(before);
            let copied = folder.join("files").join(&inner);
            std::fs::create_dir_all(copied.parent().unwrap_or(folder))?;
            std::fs::copy(&file, as_text(&copied))?;
            let _ = write!(out, "files/{}", as_text(&inner));
        } else if file.is_dir() {
            // `[text](folder)` becomes `text (folder)`.
            let open = before.rfind('[').with_context(|| format!("docs/{name}: a link does not begin"))?;
            let _ = write!(out, "{}{} (`{}`", &before[..open], &before[open + 1..at], inner.display());
        } else {
            bail!("docs/{name}: there is no {}", inner.display());
        }
        rest = &link[end..];
    }
    out.push_str(rest);
    Ok(out)
}

/// File name with an extension that browsers display; mdbook would take a linked `.md` for a chapter.
fn as_text(path: &Path) -> String {
    let path = path.display().to_string();
    format!("{}.txt", path.strip_suffix(".md").unwrap_or(&path))
}

/// Path with `..` resolved.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(out.pop()),
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

pub(crate) fn copy(from: &Path, to: &Path) -> Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let path = entry?.path();
        let target = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy(&path, &target)?;
        } else {
            std::fs::copy(&path, &target).with_context(|| format!("cannot copy {}", path.display()))?;
        }
    }
    Ok(())
}

/// Values of an attribute in an HTML page.
fn attributes<'p>(page: &'p str, name: &str) -> Vec<&'p str> {
    let pattern = format!(" {name}=\"");
    page.split(pattern.as_str()).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

/// Follows every link from `index.html` on, and checks that it is relative and leads to a file, and to a place in it if it names one.
/// Returns the numbers of pages and links. The crates' documentation is not followed.
pub(crate) fn check_links(site: &Path) -> Result<(usize, usize)> {
    let [api, playground] = ["api", "playground"].map(|part| site.join(part));
    let left_out: Vec<&PathBuf> = [&api, &playground].into_iter().filter(|part| !part.exists()).collect();
    let mut pages = BTreeMap::new();
    let mut places = Vec::new();
    let (mut left, mut broken, mut count) = (vec![site.join("index.html")], Vec::new(), 0);
    while let Some(path) = left.pop() {
        if pages.contains_key(&path) || path.starts_with(&api) {
            continue;
        }
        let page =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let name = path.strip_prefix(site).unwrap_or(&path).display().to_string();
        let folder = path.parent().unwrap_or(site);
        let of = |attribute| attributes(&page, attribute).into_iter().map(move |link| (attribute, link));
        for (attribute, link) in of("href").chain(of("src")).filter(|(_, link)| !link.is_empty()) {
            let link = link.replace("&amp;", "&");
            if link.starts_with('/') || attribute == "src" && link.contains("://") {
                broken.push(format!("{name}: {link} is not relative"));
                continue;
            }
            if link.contains(':') {
                continue;
            }
            let (file, place) = link.split_once('#').unwrap_or((&link, ""));
            let mut target = if file.is_empty() { path.clone() } else { normal(&folder.join(file)) };
            if left_out.iter().any(|part| target.starts_with(part)) {
                continue;
            }
            count += 1;
            if target.is_dir() {
                target.push("index.html");
            }
            if !target.exists() {
                broken.push(format!("{name}: {link}: there is no such file"));
            } else if target.extension().is_some_and(|extension| extension == "html") {
                places.extend(
                    (!place.is_empty())
                        .then(|| (target.clone(), place.to_owned(), format!("{name}: {link}"))),
                );
                left.push(target);
            }
        }
        pages.insert(path, page);
    }
    // The playground's fragments are programs.
    for (page, place, link) in places.iter().filter(|(page, ..)| !page.starts_with(&playground)) {
        if pages.get(page).is_some_and(|page| !attributes(page, "id").contains(&place.as_str())) {
            broken.push(format!("{link}: there is no such place"));
        }
    }
    if !broken.is_empty() {
        bail!("broken links:\n{}", broken.join("\n"));
    }
    Ok((pages.len(), count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A browser draws a picture only if the file is well-formed; a comment with two hyphens is not.
    #[test]
    fn drawings_are_well_formed() {
        let folder = std::fs::read_dir(root().join("docs/pictures")).expect("it is there");
        let drawings = folder.map(|entry| entry.expect("it can be read").path());
        let drawings: Vec<PathBuf> =
            drawings.filter(|path| path.extension().is_some_and(|e| e == "svg")).collect();
        assert!(drawings.len() > 5, "{drawings:?}");
        for path in drawings {
            let text = std::fs::read_to_string(&path).expect("it is a text");
            let read = roxmltree::Document::parse(&text).map(|_| ());
            assert_eq!(read, Ok(()), "{}", path.display());
        }
    }

    #[test]
    fn listings_get_a_link() {
        let text = "# T\n\n<!-- around:\n.period\n...\n-->\n```asm\na\n```\n\nend\n";
        let chapter = chapter("x.md", text, Path::new("/nowhere")).expect("no link leads outside");
        let (before, link) = chapter.split_once("#p1=").expect("it has a link");
        assert!(
            before.contains("<pre><code class=\"language-takt nohighlight hljs\">a\n</code></pre>\n"),
            "{before}"
        );
        assert!(!before.contains("-->") && !before.contains("```"), "{before}");
        assert!(link.ends_with("\">Open in the playground</a>\n\nend\n"), "{link}");
    }

    /// Links of the documents resolve to chapters, anchors, or files beside the book; checked without mdbook.
    #[test]
    fn every_link_of_the_documents_leads_somewhere() {
        let folder = std::env::temp_dir().join(format!("takt-book-{}", std::process::id()));
        let docs = root().join("docs");
        write_source(&docs, &folder).expect("the documents become a book");
        let chapters = folder.join("src");
        let summary = std::fs::read_to_string(chapters.join("SUMMARY.md")).expect("it was just written");
        let first = summary.lines().find_map(|line| line.split_once("](")).expect("it has chapters").1;
        assert_eq!(first, "index.md)", "the site opens with the title page");
        let icon = std::fs::read_to_string(folder.join("theme/favicon.svg")).expect("it was just written");
        assert!(icon.starts_with("<svg ") && icon.ends_with("</svg>\n"), "{icon}");
        let (mut broken, mut count) = (Vec::new(), 0);
        for entry in std::fs::read_dir(&chapters).expect("there are some") {
            let path = entry.expect("it can be read").path();
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            // Text in code blocks contains no links.
            let prose: Vec<&str> = text.split("```").step_by(2).collect();
            for link in prose.iter().flat_map(|part| part.split("](").skip(1)) {
                let target = link.split([')', '#', ' ']).next().unwrap_or_default();
                if target.is_empty() || target.contains(':') {
                    continue;
                }
                count += 1;
                let is_chapter = target.ends_with(".md");
                // mdbook turns every `.md` into a chapter, and every `README.md` into an index.
                if !chapters.join(target).is_file() || is_chapter && target.contains('/') {
                    broken.push(format!("{}: {target}", path.display()));
                }
            }
        }
        std::fs::remove_dir_all(&folder).expect("it can be emptied");
        assert!(broken.is_empty() && count > 300, "{count} links, of which lead nowhere: {broken:#?}");
    }

    #[test]
    fn comments_stay_out_of_the_book() {
        let text = "# T\n\n<!-- Generated; do not edit. -->\n\n1<!-- =n --> µs\n<!-- a\nb -->\nend\n";
        assert_eq!(uncommented(text), "# T\n\n\n1 µs\nend\n");
    }

    /// Each broken link is found, whatever the page that has it.
    #[test]
    fn links_are_followed_from_the_first_page() {
        let site = std::env::temp_dir().join(format!("takt-site-{}", std::process::id()));
        std::fs::create_dir_all(site.join("a")).expect("it can be made");
        let write =
            |name: &str, text: &str| std::fs::write(site.join(name), text).expect("it can be written");
        write("index.html", "<a href=\"a/x.html#p\">");
        write(
            "a/x.html",
            "<b id=\"p\"><a href=\"..\"><a href=\"https://example.org\"><a href=\"../api/y.html\">",
        );
        assert_eq!(check_links(&site).expect("all lead somewhere"), (2, 2));
        for (link, says) in [
            ("href=\"/index.html\"", "is not relative"),
            ("src=\"https://example.org/x.js\"", "is not relative"),
            ("href=\"z.html\"", "there is no such file"),
            ("href=\"x.html#q\"", "there is no such place"),
        ] {
            write("a/x.html", &format!("<b id=\"p\"><a {link}>"));
            let error = check_links(&site).expect_err(link).to_string();
            assert!(error.contains("a/x.html: ") && error.contains(says), "{error}");
        }
        std::fs::remove_dir_all(&site).expect("it can be emptied");
    }

    #[test]
    fn files_outside_the_book_are_no_chapters() {
        assert_eq!(as_text(Path::new("rtl/README.md")), "rtl/README.txt");
        assert_eq!(as_text(Path::new("isa/src/lib.rs")), "isa/src/lib.rs.txt");
    }

    #[test]
    fn links_show_titles() {
        let titles = BTreeMap::from([("glossary".to_owned(), "Glossary".to_owned())]);
        assert_eq!(
            titled("([glossary.md](glossary.md#ulp), [x](glossary.md), [isa.md](isa.md))", &titles),
            "([Glossary](glossary.md#ulp), [x](glossary.md), [isa.md](isa.md))"
        );
    }

    #[test]
    fn fragments_are_base_64_for_addresses() {
        let fragment = fragment("{}");
        let packed = fragment.strip_prefix("p1=").expect("it says how it is packed");
        assert!(packed.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte)), "{packed}");
    }

    #[test]
    fn attributes_are_found() {
        assert_eq!(attributes("<a href=\"x#y\" id=\"z\"><b href=\"w\">", "href"), ["x#y", "w"]);
    }
}
