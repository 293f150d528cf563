// SPDX-License-Identifier: MIT OR Apache-2.0
//! Format of results on a terminal: lines are folded between words at the terminal's width, and important figures are bold. Output to a
//! pipe or a file is plain and not folded.

use std::io::{IsTerminal, stderr, stdout};
use takt_isa::text::visible;
use textwrap::core::display_width;
use textwrap::{Options, WordSplitter, WrapAlgorithm};

/// Terminal sequences that begin and end bold text.
const BOLD: (&str, &str) = ("\x1b[1m", "\x1b[0m");

/// Minimum width of a comment beside an example, in columns.
const BESIDE: usize = 24;

/// Width of help on a page without a width, and its largest: longer lines are hard to read.
const HELP: usize = 100;
const LONGEST: usize = 110;

/// Format of printed results.
#[derive(Clone, Copy, Default)]
pub(crate) struct Page {
    /// Width of the terminal in columns; `None`: lines are not folded.
    pub(crate) width: Option<usize>,
    pub(crate) is_bold: bool,
}

impl Page {
    /// Format for standard output; `colors` is the user's choice, which also applies to bold text.
    pub(crate) fn of_stdout(colors: Option<bool>) -> Page {
        let is_terminal = stdout().is_terminal();
        let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
        Page { width: width.filter(|_| is_terminal), is_bold: colors.unwrap_or(is_terminal && !refused) }
    }

    /// Format of help: as wide as the terminal, or, in a pipe, as the environment's `COLUMNS`.
    pub(crate) fn of_help() -> Page {
        let page = Page::of_stdout(None);
        let stated = || std::env::var("COLUMNS").ok()?.parse().ok().filter(|columns| *columns > 0);
        let width = page.width.or_else(stated).unwrap_or(HELP).min(LONGEST);
        Page { width: Some(width), ..page }
    }

    /// Width in columns, also of a page that folds no lines.
    pub(crate) fn columns(self) -> usize {
        self.width.unwrap_or(HELP)
    }

    /// Format of messages on standard error.
    pub(crate) fn of_stderr() -> Page {
        let width = terminal_size::terminal_size_of(stderr()).map(|(width, _)| usize::from(width.0));
        Page { width: width.filter(|_| stderr().is_terminal()), is_bold: false }
    }

    /// Makes a text bold; it must not contain control characters.
    pub(crate) fn strong(self, text: &str) -> String {
        if self.is_bold { format!("{}{text}{}", BOLD.0, BOLD.1) } else { text.to_owned() }
    }

    /// Folds a line. Continuation lines are aligned with the last column of the first line, or, if space is short, slightly to the right
    /// of its indentation.
    pub(crate) fn folded(self, line: &str) -> String {
        self.folded_under(line, |width| width / 2)
    }

    /// Folds the text below a command's help. Clap folds prose; a comment beside an example continues under its own start, not under the
    /// example.
    pub(crate) fn below_help(self, text: &str) -> String {
        let lines = text.lines().map(|line| match line.starts_with("  ") {
            true => self.folded_under(line, |width| width.saturating_sub(BESIDE)),
            false => line.to_owned(),
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// Folds a line; `furthest` is the maximum indentation of continuation lines as a function of the width.
    fn folded_under(self, line: &str, furthest: fn(usize) -> usize) -> String {
        let Some(width) = self.width.filter(|width| display_width(line) > *width) else {
            return line.to_owned();
        };
        let indent = " ".repeat(indent(line, width, furthest(width)));
        let options = Options::new(width)
            .subsequent_indent(&indent)
            .break_words(false)
            .word_splitter(WordSplitter::NoHyphenation)
            .wrap_algorithm(WrapAlgorithm::FirstFit);
        textwrap::wrap(&together(line), options).join("\n").replace(TIED, " ")
    }
}

/// Placeholder for a space at which lines must not break.
const TIED: char = '\u{a0}';

/// Protects code in backticks, and percentages with the name before them, from line breaks.
fn together(line: &str) -> String {
    let line = line.replace(" %", &format!("{TIED}%"));
    let mut parts = line.split(" (");
    let mut line = parts.next().unwrap_or("").to_owned();
    for part in parts {
        let is_percentage = part.trim_start_matches(|c: char| c.is_ascii_digit()).starts_with(TIED);
        line.push(if is_percentage { TIED } else { ' ' });
        line.push('(');
        line.push_str(part);
    }
    let pieces = line.split('`').enumerate();
    let pieces = pieces.map(|(number, piece)| match number % 2 {
        1 => piece.replace(' ', &TIED.to_string()),
        _ => piece.to_owned(),
    });
    pieces.collect::<Vec<String>>().join("`")
}

/// Indentation of continuation lines, at most `furthest`.
fn indent(line: &str, width: usize, furthest: usize) -> usize {
    let begin = line.len() - line.trim_start_matches(' ').len();
    let least = (begin + 2).min(width / 2);
    let Some(gap) = line[begin..].rfind("  ").map(|gap| begin + gap + 2) else { return least };
    let longest = line[gap..].split(' ').map(display_width).max().unwrap_or(0);
    match display_width(&line[..gap]) {
        // Otherwise the terminal would break a long word.
        column if column <= furthest && column + longest <= width => column,
        _ => least,
    }
}

/// A column of a table.
#[derive(Clone, Copy)]
pub(crate) struct Column {
    /// Minimum width in characters.
    pub(crate) width: usize,
    pub(crate) side: Side,
    /// Rank for omission on a narrow page: highest rank first, rank 0 never.
    pub(crate) rank: u8,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

/// A right-aligned column of numbers.
pub(crate) const fn right(width: usize, rank: u8) -> Column {
    Column { width, side: Side::Right, rank }
}

/// A left-aligned column of names.
pub(crate) const fn left(width: usize, rank: u8) -> Column {
    Column { width, side: Side::Left, rank }
}

/// Columns that fit on the page.
pub(crate) struct Columns<'c> {
    all: &'c [Column],
    page: Page,
    /// Columns of higher rank are omitted.
    most: u8,
}

impl<'c> Columns<'c> {
    pub(crate) fn new(all: &'c [Column], page: Page) -> Columns<'c> {
        let needs = |most: u8| -> usize {
            all.iter().filter(|column| column.rank <= most).map(|column| column.width).sum()
        };
        let highest = all.iter().map(|column| column.rank).max().unwrap_or(0);
        let fits = |most: &u8| page.width.is_none_or(|width| needs(*most) <= width);
        let most = (0..=highest).rev().find(fits).unwrap_or(0);
        Columns { all, page, most }
    }

    /// Highest rank of the columns that are shown.
    pub(crate) fn most(&self) -> u8 {
        self.most
    }

    /// Some columns are omitted.
    pub(crate) fn leave_out_some(&self) -> bool {
        self.all.iter().any(|column| column.rank > self.most)
    }

    /// Formats a table row; the cell with index `strong` is bold.
    pub(crate) fn row<S: AsRef<str>>(&self, cells: &[S], strong: Option<usize>) -> String {
        let mut row = String::new();
        for (index, (column, cell)) in self.all.iter().zip(cells).enumerate() {
            if column.rank > self.most {
                continue;
            }
            let cell = visible(cell.as_ref());
            let blanks = " ".repeat(column.width.saturating_sub(cell.chars().count()));
            let shown = match strong == Some(index) {
                true => self.page.strong(&cell),
                false => cell.into_owned(),
            };
            match column.side {
                Side::Left => row.extend([shown, blanks]),
                Side::Right => row.extend([blanks, shown]),
            }
        }
        row.truncate(row.trim_end().len());
        row + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(width: usize) -> Page {
        Page { width: Some(width), is_bold: true }
    }

    #[test]
    fn lines_are_folded_between_words_and_under_their_last_column() {
        let line = "  try        Does what stands after `else` if the robot refuses";
        let folded =
            "  try        Does what stands after\n             `else` if the robot\n             refuses";
        assert_eq!(page(36).folded(line), folded);
        assert_eq!(page(80).folded(line), line);
        assert_eq!(Page::default().folded(line), line);
        // Bold sequences have no width, and a word longer than the line is not broken.
        assert_eq!(page(8).folded("a \x1b[1mbold\x1b[0m b"), "a \x1b[1mbold\x1b[0m b");
        assert_eq!(page(10).folded("to https://example.org/path it"), "to\n  https://example.org/path\n  it");
        assert_eq!(page(20).folded("  u  1e-4  pi.s:26 (100 %)"), "  u  1e-4\n    pi.s:26 (100 %)");
        for width in 1..60 {
            let folded = page(width).folded(line);
            let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(words(&folded), words(line), "{width}");
        }
    }

    #[test]
    fn comments_beside_examples_go_on_under_their_beginning() {
        let text = "A sentence that is longer than that.\n\nExamples:\n  takt robot --check   whether it can run at all\n  takt robot";
        let folded = "A sentence that is longer than that.\n\nExamples:\n  takt robot --check   whether it can run at\n                       all\n  takt robot";
        assert_eq!(page(47).below_help(text), folded);
        assert_eq!(Page::default().below_help(text), text);
        // A word that does not fit at the indentation starts further left.
        let long = "  takt robot --check   and programs/controller.toml is run";
        let under = "  takt robot --check   and\n    programs/controller.toml is run";
        assert_eq!(page(46).below_help(long), under);
        assert_eq!(
            page(47).below_help(long),
            "  takt robot --check   and\n                       programs/controller.toml\n                       is run"
        );
        let narrow = "A sentence that is longer than that.\n\nExamples:\n  takt robot --check\n    whether it can run\n    at all\n  takt robot";
        assert_eq!(page(23).below_help(text), narrow);
    }

    #[test]
    fn columns_are_left_out_by_rank() {
        let columns = [left(6, 0), right(4, 2), right(4, 0), right(4, 1)];
        let cells = ["ab", "1", "µ2", "3"];
        let row = |width| Columns::new(&columns, Page { width, is_bold: false }).row(&cells, None);
        assert_eq!(row(None), "ab       1  µ2   3\n");
        assert_eq!(row(Some(18)), "ab       1  µ2   3\n");
        assert_eq!(row(Some(17)), "ab      µ2   3\n");
        assert_eq!(row(Some(13)), "ab      µ2\n");
        assert_eq!(row(Some(1)), "ab      µ2\n");
        let strong = Columns::new(&columns, page(80));
        assert!(!strong.leave_out_some() && Columns::new(&columns, page(10)).leave_out_some());
        assert_eq!(strong.row(&cells, Some(2)), "ab       1  \x1b[1mµ2\x1b[0m   3\n");
    }
}
