// SPDX-License-Identifier: MIT OR Apache-2.0
//! Full-screen view: draws plain data into cells. It makes no decisions, and depends neither on the session nor on the terminal.

use crate::console::{commands, keys};
use crate::panes::{self, CoreLine, NamedRegister, Panes};
use crate::target::Target;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect, Spacing};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph, Wrap};

/// Minimum width for three columns.
const WIDE: u16 = 110;
/// Maximum number of lines in the log.
const LOG: usize = 2000;
/// Distance between tab stops in columns.
const TAB: usize = 8;
/// Maximum width of a name with text beside it.
const NAME: usize = 20;
/// Width of a slot's name and the blank after it.
const SLOT: usize = 5;
/// Width of a value.
const VALUE: usize = 15;

const CHANGED: Style = Style::new().fg(Color::Yellow).add_modifier(Modifier::BOLD);
const NEXT: Style = Style::new().fg(Color::Black).bg(Color::Green);
/// Style of the other source lines whose operations are in the next bundle.
const PART: Style = Style::new().fg(Color::Green);
const STOP: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
const DIM: Style = Style::new().fg(Color::DarkGray);
const TITLE: Style = Style::new().fg(Color::Cyan);

/// A pane of the view.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs, reason = "they are named for what they show")]
pub enum Pane {
    Source,
    Bundle,
    Output,
    Registers,
    Watches,
    Ports,
    Flight,
    Stalls,
}

impl Pane {
    /// All panes, in the order of the focus key.
    pub const ALL: [Pane; 8] = [
        Pane::Source,
        Pane::Bundle,
        Pane::Output,
        Pane::Registers,
        Pane::Watches,
        Pane::Ports,
        Pane::Flight,
        Pane::Stalls,
    ];
}

/// Kind of a line in the log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LogLineKind {
    /// A command, as entered.
    Command,
    /// An answer to a command.
    Answer,
    /// An error that a command reported.
    Error,
}

/// Contents of the screen, including scroll positions and focus.
pub struct Screen {
    /// Contents of the panes at the present position.
    pub panes: Panes,
    /// Lines of the log: commands with their answers.
    log: Vec<(LogLineKind, String)>,
    /// Index of the last command in the log.
    latest: usize,
    /// Command line: text and cursor column.
    pub typed: Option<(String, usize)>,
    /// Progress text of a running command.
    pub running: Option<String>,
    /// Index of the help's top line; `None` while help is hidden.
    pub help: Option<usize>,
    /// Focused pane, which the scroll keys move.
    pub focus: Pane,
    /// Scroll offset of each pane, in lines.
    scroll: [isize; Pane::ALL.len()],
}

impl Screen {
    /// A screen with these panes and an empty log.
    pub fn new(panes: Panes) -> Screen {
        Screen {
            panes,
            log: Vec::new(),
            latest: 0,
            typed: None,
            running: None,
            help: None,
            focus: Pane::Source,
            scroll: [0; Pane::ALL.len()],
        }
    }

    /// Adds a command and its answer to the log, and replaces the panes.
    pub fn log_command(&mut self, command: &str, answer: &Result<String, String>, panes: Panes) {
        self.log.drain(..self.log.len().saturating_sub(LOG));
        self.latest = self.log.len();
        self.log.push((LogLineKind::Command, command.to_owned()));
        let (said, text) = match answer {
            Ok(text) => (LogLineKind::Answer, text),
            Err(text) => (LogLineKind::Error, text),
        };
        self.log.extend(text.lines().map(|line| (said, line.to_owned())));
        self.panes = panes;
        self.scroll = [0; Pane::ALL.len()];
    }

    /// Scrolls the help if it is shown, otherwise the focused pane.
    pub fn scroll(&mut self, lines: isize) {
        match &mut self.help {
            Some(top) => *top = top.saturating_add_signed(lines),
            None => self.scroll[self.focus as usize] += lines,
        }
    }

    /// Moves the focus forward by a number of panes; backward if negative.
    pub fn turn(&mut self, panes: isize) {
        let at = (self.focus as isize + panes).rem_euclid(Pane::ALL.len() as isize);
        self.focus = Pane::ALL[at as usize];
    }
}

/// Draws all panes, the log and the command line.
pub fn draw(frame: &mut Frame<'_>, screen: &mut Screen) {
    let cores = u16::from(!screen.panes.cores.is_empty());
    let rows = [1, cores].map(Constraint::Length);
    let [head, cores, body, foot] =
        Layout::vertical([rows[0], rows[1], Constraint::Fill(1), Constraint::Length(1)]).areas(frame.area());
    frame.render_widget(Line::from(plain(&screen.panes.head)).style(Style::new().reversed()), head);
    frame.render_widget(core_line(&screen.panes), cores);
    for (pane, area) in areas(body, &screen.panes) {
        draw_pane(frame, screen, pane, area);
    }
    draw_command(frame, screen, foot);
    if let Some(top) = &mut screen.help {
        draw_help(frame, screen.panes.target, top, body);
    }
}

/// One line with all cores of a system and their states.
fn core_line(panes: &Panes) -> Line<'static> {
    let core = |core: &CoreLine| {
        let style = if core.selected { TITLE.reversed() } else { TITLE };
        [
            Span::styled(plain(&core.name), style),
            Span::raw(format!(" {}", plain(&core.state))),
            Span::styled(" │ ", DIM),
        ]
    };
    let mut spans: Vec<Span<'static>> = panes.cores.iter().flat_map(core).collect();
    spans.pop();
    Line::from(spans)
}

/// Screen areas of the visible panes.
fn areas(body: Rect, panes: &Panes) -> Vec<(Pane, Rect)> {
    let rows = |lines: usize| lines as u16 + 1;
    let bundle = Constraint::Length(rows(panes.bundle.len().max(1)));
    let watches =
        Constraint::Length(if panes.displays.is_empty() { 0 } else { rows(panes.displays.len().min(5)) });
    let ports = Constraint::Fill(2);
    let fill = Constraint::Fill;
    let columns =
        |constraints: &[Constraint]| Layout::horizontal(constraints).spacing(Spacing::Space(1)).split(body);
    let left = |area: Rect| {
        let [source, bundle, output] = Layout::vertical([fill(3), bundle, fill(2)]).areas(area);
        [(Pane::Source, source), (Pane::Bundle, bundle), (Pane::Output, output)]
    };
    let mut areas = Vec::new();
    if body.width >= WIDE {
        let columns = columns(&[fill(9), fill(7), fill(7)]);
        areas.extend(left(columns[0]));
        let [registers, watches] = Layout::vertical([fill(1), watches]).areas(columns[1]);
        areas.extend([(Pane::Registers, registers), (Pane::Watches, watches)]);
        let [ports, flight, stalls] = Layout::vertical([ports, fill(1), fill(1)]).areas(columns[2]);
        areas.extend([(Pane::Ports, ports), (Pane::Flight, flight), (Pane::Stalls, stalls)]);
    } else {
        let columns = columns(&[fill(1), fill(1)]);
        areas.extend(left(columns[0]));
        let parts = [fill(3), watches, ports, fill(2), fill(2)];
        let [registers, watches, ports, flight, stalls] = Layout::vertical(parts).areas(columns[1]);
        areas.extend([(Pane::Registers, registers), (Pane::Watches, watches), (Pane::Ports, ports)]);
        areas.extend([(Pane::Flight, flight), (Pane::Stalls, stalls)]);
    }
    areas
}

fn draw_pane(frame: &mut Frame<'_>, screen: &mut Screen, pane: Pane, area: Rect) {
    let height = usize::from(area.height.saturating_sub(1));
    let panes = &screen.panes;
    // Lines of the pane, and its top line unless scrolled.
    let (title, lines, top) = match pane {
        Pane::Source => (plain(&panes.file), source(panes), source_top(panes, height)),
        Pane::Bundle => ("bundle".to_owned(), bundle(panes, area.width), 0),
        Pane::Output => {
            let (lines, latest) = log(&screen.log, screen.latest, area.width);
            let tail = lines.len().saturating_sub(height);
            ("output".to_owned(), lines, tail.min(latest))
        }
        Pane::Registers => ("registers".to_owned(), values(&panes.registers, "", area.width), 0),
        Pane::Watches => ("watches".to_owned(), displays(panes), 0),
        Pane::Ports => ("ports".to_owned(), ports(panes, area.width), 0),
        Pane::Flight => ("in flight".to_owned(), flight(panes, area.width), 0),
        Pane::Stalls => ("stalls".to_owned(), stalls(panes), 0),
    };
    let last = lines.len().saturating_sub(height);
    let scroll = &mut screen.scroll[pane as usize];
    let wanted = top.saturating_add_signed(*scroll);
    let shown = wanted.min(last.max(top));
    *scroll = shown as isize - top as isize;
    let below = lines.len().saturating_sub(shown + height);
    let style = if screen.focus == pane { TITLE.reversed() } else { TITLE };
    let mut block =
        Block::new().borders(Borders::TOP).border_style(DIM).title(Span::styled(format!(" {title} "), style));
    let hidden = if pane == Pane::Source { hidden(panes, shown, height) } else { String::new() };
    if !hidden.is_empty() {
        block = block.title(Line::styled(format!(" also {hidden} "), PART).right_aligned());
    } else if below > 0 {
        block = block.title(Line::from(format!(" {below} more ")).right_aligned());
    }
    let lines: Vec<Line<'_>> = lines.into_iter().skip(shown).take(height).collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn source(panes: &Panes) -> Vec<Line<'static>> {
    let row = |line: &panes::Line| {
        let mark = if line.next {
            '>'
        } else if line.part {
            '+'
        } else {
            ' '
        };
        let text = Span::raw(plain(&line.text));
        Line::from(vec![
            Span::styled(if line.stop { "●" } else { " " }, STOP),
            Span::styled(format!("{mark}{:>4} ", line.number), DIM),
            if line.next {
                text.style(NEXT)
            } else if line.part {
                text.style(PART)
            } else {
                text
            },
        ])
    };
    panes.lines.iter().map(row).collect()
}

/// Top line of the source unless scrolled: shows all lines of the bundle if they fit, otherwise the current line.
fn source_top(panes: &Panes, height: usize) -> usize {
    let marked = |line: &panes::Line| line.next || line.part;
    let next = panes.lines.iter().position(|line| line.next).unwrap_or(0);
    let first = panes.lines.iter().position(marked).unwrap_or(next);
    let last = panes.lines.iter().rposition(marked).unwrap_or(next);
    let usual = next.saturating_sub(height / 3);
    match last - first < height {
        // Stay as close to the usual position as the first and last line allow.
        true => usual.clamp((last + 1).saturating_sub(height), first),
        false => usual,
    }
}

/// Numbers of the bundle's lines outside the visible part.
fn hidden(panes: &Panes, top: usize, height: usize) -> String {
    let outside = |index: usize| !(top..top + height).contains(&index);
    let lines = panes.lines.iter().enumerate();
    let lines = lines.filter(|(index, line)| (line.next || line.part) && outside(*index));
    lines.map(|(_, line)| line.number.to_string()).collect::<Vec<_>>().join(", ")
}

/// Operations of the bundle, with their source lines right-aligned.
fn bundle(panes: &Panes, room: u16) -> Vec<Line<'static>> {
    let row = |(index, (slot, operation)): (usize, &(&str, Option<String>))| {
        let slot = Span::styled(format!("{slot:<5}"), TITLE);
        let Some(operation) = operation else { return Line::from(vec![slot, Span::styled("-", DIM)]) };
        let place = panes.places.get(index).and_then(Option::as_deref).map_or(String::new(), plain);
        let room = usize::from(room).saturating_sub(SLOT + place.chars().count() + 1);
        let operation = shortened(&plain(operation), room);
        Line::from(vec![slot, Span::raw(format!("{operation:<room$} ")), Span::styled(place, PART)])
    };
    panes.bundle.iter().enumerate().map(row).collect()
}

/// Truncates a text to `room` columns; a truncated text ends in an ellipsis.
fn shortened(text: &str, room: usize) -> String {
    if text.chars().count() <= room {
        return text.to_owned();
    }
    text.chars().take(room.saturating_sub(1)).chain(['…']).collect()
}

/// Lines of the log, wrapped, and the index of the last command's line.
fn log(log: &[(LogLineKind, String)], latest: usize, room: u16) -> (Vec<Line<'static>>, usize) {
    let (mut lines, mut top) = (Vec::new(), 0);
    for (i, (said, text)) in log.iter().enumerate() {
        if i == latest {
            top = lines.len();
        }
        let (prompt, style) = match said {
            LogLineKind::Command => ("(takt) ", Style::new().bold()),
            LogLineKind::Answer => ("", Style::new()),
            LogLineKind::Error => ("", STOP),
        };
        let text = prompt.to_owned() + &plain(text);
        lines.extend(
            broken(&text, usize::from(room).max(1)).into_iter().map(|part| Line::styled(part, style)),
        );
    }
    (lines, top)
}

/// Wraps a line into parts of at most `room` columns: at blanks, or inside words that are longer than a line.
fn broken(text: &str, room: usize) -> Vec<String> {
    let mut rest: Vec<char> = text.chars().collect();
    let mut parts = Vec::new();
    while rest.len() > room {
        let blank = (1..=room).rev().find(|at| rest[*at] == ' ' && rest[..*at].iter().any(|c| *c != ' '));
        let (end, next) = blank.map_or((room, room), |at| (at, at + 1));
        let after = rest.split_off(next);
        parts.push(rest[..end].iter().collect());
        rest = after;
    }
    parts.push(rest.into_iter().collect());
    parts
}

/// Rows of names and values, with changed ones marked; bits are shown if they fit into `room` columns.
fn values(rows: &[NamedRegister], prefix: &'static str, room: u16) -> Vec<Line<'static>> {
    let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0).min(NAME);
    let left = usize::from(room).saturating_sub(prefix.len() + 1 + width + 1);
    let has_room = left >= VALUE + 1 + 8;
    let row = |row: &NamedRegister| {
        let style = if row.changed {
            CHANGED
        } else if row.used {
            Style::new().green()
        } else {
            Style::new()
        };
        let (mark, mut value) = (if row.changed { '*' } else { ' ' }, row.value());
        // On a narrow pane, omit the parentheses first.
        if value.len() > left && row.bits.is_none() {
            value = value.trim_matches(['(', ')']).to_owned();
        }
        let mut spans = vec![
            Span::styled(prefix, DIM),
            Span::styled(format!("{mark}{:<width$} {value:<VALUE$} ", row.name), style),
        ];
        spans.extend(row.bits.filter(|_| has_room).map(|bits| Span::styled(format!("{bits:08x}"), DIM)));
        Line::from(spans)
    };
    rows.iter().map(row).collect()
}

fn ports(panes: &Panes, room: u16) -> Vec<Line<'static>> {
    // Show outputs before inputs, since outputs change more often.
    let mut lines = values(&panes.outputs, "out ", room);
    lines.extend(values(&panes.inputs, "in  ", room));
    lines
}

fn displays(panes: &Panes) -> Vec<Line<'static>> {
    panes.displays.iter().map(|(name, value)| Line::raw(plain(&format!("{name} = {value}")))).collect()
}

fn flight(panes: &Panes, room: u16) -> Vec<Line<'static>> {
    let width = panes.flight.iter().map(|row| row.register.len()).max().unwrap_or(0).min(NAME);
    let row = |row: &panes::InFlightOperation| {
        let left = format!("{:>3} ", row.left);
        let what = format!("{:<width$} {:<7} ", row.register, row.mnemonic);
        let from = origin(&row.from, usize::from(room).saturating_sub(left.len() + what.chars().count()));
        Line::from(vec![Span::styled(left, CHANGED), Span::raw(what), Span::styled(from, DIM)])
    };
    panes.flight.iter().map(row).collect()
}

/// Formats `bundle 24 (pi.s:55)` for at most `room` columns; if it is too long, only the place or only the bundle.
fn origin(from: &str, room: usize) -> String {
    if from.chars().count() <= room {
        return from.to_owned();
    }
    let (bundle, place) = from.split_once(" (").unwrap_or((from, ""));
    let place = place.trim_end_matches(')');
    let line = place.rfind(':').map_or("", |colon| &place[colon..]);
    let fits = |text: &&str| !text.is_empty() && text.chars().count() <= room;
    [place, bundle, line].into_iter().find(fits).unwrap_or_default().to_owned()
}

fn stalls(panes: &Panes) -> Vec<Line<'static>> {
    let now = panes.cause.iter().map(|cause| Line::styled(format!("now: {cause}"), CHANGED));
    let rows = panes.stalls.iter().map(|(cycles, what)| Line::raw(format!("{cycles:>10}  {what}")));
    now.chain(rows).collect()
}

/// Draws the command line, or the key hints if there is no input.
fn draw_command(frame: &mut Frame<'_>, screen: &Screen, area: Rect) {
    if let Some(text) = &screen.running {
        frame.render_widget(Line::styled(plain(text), CHANGED), area);
        return;
    }
    const PROMPT: &str = "(takt) ";
    let Some((text, cursor)) = &screen.typed else {
        frame.render_widget(hints(screen.panes.target, area.width), area);
        return;
    };
    // Scroll right just enough to keep the cursor visible.
    let room = usize::from(area.width).saturating_sub(PROMPT.len() + 1);
    let skipped = cursor.saturating_sub(room);
    let shown: String = text.chars().skip(skipped).collect();
    frame.render_widget(Line::from(vec![Span::styled(PROMPT, TITLE), Span::raw(shown)]), area);
    let column = area.x + (PROMPT.len() + cursor - skipped) as u16;
    if column < area.right() && area.height > 0 {
        frame.set_cursor_position((column, area.y));
    }
}

/// Keys in the order in which hints are chosen: quitting and stepping back come first.
const HINTS: &str = "qscplbwgnuidok";

/// Keys with their commands, as many as fit entirely. A key and its capital, which goes back, share one hint.
fn hints(target: Target, room: u16) -> Line<'static> {
    let known: Vec<(char, &str)> = keys(target).collect();
    let line_of =
        |wanted: char| known.iter().find(|(key, _)| *key == wanted).map(|(_, line)| line.trim_end());
    let mut hints = vec![(":".to_owned(), "command".to_owned()), ("?".to_owned(), "help".to_owned())];
    for key in HINTS.chars() {
        let (Some(forth), back) = (line_of(key), line_of(key.to_ascii_uppercase())) else { continue };
        hints.push(match back {
            Some(back) => {
                // "step line" and "back line" end in the same word.
                let object = forth.split_once(' ').map_or("", |(_, object)| object);
                let verbs = [forth, back].map(|line| line.split(' ').next().unwrap_or(line));
                let text = format!("{}/{} {object}", verbs[0], verbs[1]);
                (format!("{key}/{}", key.to_ascii_uppercase()), text.trim_end().to_owned())
            }
            None => (key.to_string(), forth.to_owned()),
        });
    }
    let (mut spans, mut used) = (Vec::new(), 0);
    for (key, text) in hints {
        let gap = if used == 0 { "" } else { "  " };
        let width = gap.len() + key.chars().count() + 1 + text.chars().count();
        if used + width <= usize::from(room) {
            used += width;
            spans.extend([Span::styled(format!("{gap}{key} "), TITLE), Span::raw(text)]);
        }
    }
    Line::from(spans)
}

fn draw_help(frame: &mut Frame<'_>, target: Target, top: &mut usize, body: Rect) {
    const INDENT: &str = "    ";
    let room = usize::from(body.width.saturating_sub(2)).max(INDENT.len() + 1);
    let mut lines = vec![
        Line::raw(
            "Keys that stand for commands are in brackets. `:` types a command (Tab completes, up and down go through earlier ones, Esc \
             leaves), Tab and Shift-Tab choose a pane, up, down, Page Up and Page Down scroll it, Enter repeats the last step, Ctrl-C stops \
             a command that runs. A * marks what the last command changed.",
        ),
        Line::default(),
    ];
    for (usage, keys, text) in commands(target) {
        let keys = if keys.is_empty() { String::new() } else { format!("  [{keys}]") };
        lines.push(Line::from(vec![Span::styled(usage, TITLE), Span::styled(keys, CHANGED)]));
        let parts = textwrap::wrap(&text, room - INDENT.len());
        lines.extend(parts.into_iter().map(|part| Line::raw(format!("{INDENT}{part}"))));
    }
    // Without wrapping, the number of rows equals the number of lines, the minimum.
    *top = (*top).min(lines.len().saturating_sub(1));
    let block = Block::bordered().border_style(DIM).title(Span::styled(" help (Esc leaves) ", TITLE));
    let text = Paragraph::new(lines).wrap(Wrap { trim: false }).scroll((*top as u16, 0)).block(block);
    frame.render_widget(Clear, body);
    frame.render_widget(text, body);
}

/// Expands tabs, and replaces other control characters with `·`.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut column = 0;
    for c in text.chars() {
        if c == '\t' {
            let blanks = TAB - column % TAB;
            plain.extend(std::iter::repeat_n(' ', blanks));
            column += blanks;
        } else {
            plain.push(if c.is_control() { '·' } else { c });
            column += 1;
        }
    }
    plain
}
