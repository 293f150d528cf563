// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language server of the assembly language.
//!
//! A single thread answers: it drains the client's messages, reads and checks the changed programs ([`program::check`] takes a fraction
//! of the time between two keystrokes), and answers from the result. A second thread schedules programs and counts cycles; results for
//! outdated text are dropped, and a newer job replaces one that is waiting.
//!
//! All diagnostics come from the assembler: immediately from [`takt_asm::check`], later from the scheduler.

mod complete;
mod diagnostics;
mod dispatch;
mod functions;
mod hover;
mod inline;
mod names;
mod outline;
mod pipeline;
mod program;
mod requests;
mod rewrite;
mod signature;
mod text;
mod timing;
mod uri;
mod worker;
mod workspace;

pub use inline::Inline;

use crossbeam_channel::{Receiver, Sender, unbounded};
use lsp_server::{Connection, ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::{Diagnostic, PublishDiagnosticsParams};
use program::{AssemblyResult, Front};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use takt_asm::levels::Levels;
use takt_isa::Machine;
use takt_isa::timing::Cycle;
use text::Encoding;
use worker::{Job, JobResult, Worker};
use workspace::Workspace;

/// Lower and upper bound of the client's pause after which changes are read.
const PAUSE: (Duration, Duration) = (Duration::from_millis(10), Duration::from_secs(1));
/// Pause of the client after which a program is scheduled.
const LONG_PAUSE: Duration = Duration::from_millis(150);

/// Settings of the server, fixed at its start.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Machine of programs without a `.machine`.
    pub machine: &'static Machine,
    /// Warning levels of the assembler.
    pub levels: Levels,
    /// Additional folders in which `.include` searches.
    pub folders: Vec<PathBuf>,
    /// Names and texts of the library's files.
    pub library: &'static [(&'static str, &'static str)],
    /// Names and texts of sources that documents without a file can include.
    pub beside: &'static [(&'static str, &'static str)],
    /// Folder for copies of library files opened in an editor; `None`: library files cannot be opened.
    pub library_folder: Option<PathBuf>,
    /// The client opens library files by name: the URI of `<math.s>` is `%3Cmath.s%3E`.
    pub library_by_name: bool,
    /// Cycle limit of a period; exceeding it causes a warning.
    pub deadline: Option<Cycle>,
}

impl Default for Settings {
    fn default() -> Settings {
        let options = takt_asm::Options::default();
        Settings {
            machine: options.machine,
            levels: options.levels,
            folders: Vec::new(),
            library: &[],
            beside: &[],
            library_folder: None,
            library_by_name: false,
            deadline: None,
        }
    }
}

/// Analysis results of a program.
struct Program {
    front: Front,
    full: Option<AssemblyResult>,
    /// Number of times that the program has been read.
    generation: u64,
}

/// Capabilities of the client.
#[derive(Clone, Copy, Debug, Default)]
struct Client {
    encoding: Encoding,
    snippets: bool,
    refreshes_hints: bool,
    refreshes_lenses: bool,
    /// The client draws the pipeline itself, and is notified when a program's cycles have been counted.
    wants_counted: bool,
    /// The client has the commands `takt.run` and `takt.debug`.
    runs: bool,
}

/// Phase of the session.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Starting,
    Running,
    /// `shutdown` has been answered.
    Ending,
}

/// Source of time; returns `None` if the host has none.
type Clock = fn() -> Option<Instant>;

struct Server {
    settings: Settings,
    sender: Sender<Message>,
    /// Clock for delays; without one, nothing is delayed.
    clock: Clock,
    client: Client,
    phase: Phase,
    workspace: Workspace,
    /// Programs, keyed by the path of their first source.
    programs: BTreeMap<PathBuf, Program>,
    /// Programs to read again, and the time at which to do so.
    stale: BTreeSet<PathBuf>,
    read_at: Option<Instant>,
    /// Programs to schedule again.
    unscheduled: BTreeSet<PathBuf>,
    schedule_at: Option<Instant>,
    /// Duration of the last read.
    took: Duration,
    /// Published diagnostics, by file and by program.
    published: BTreeMap<PathBuf, BTreeMap<PathBuf, Vec<Diagnostic>>>,
    /// Scheduling thread, if any.
    worker: Option<Worker>,
    /// Number of requests that the server has sent.
    asked: i32,
}

/// Serves a client until `exit` or the end of its stream. Returns whether the client exited properly.
pub fn serve(connection: &Connection, settings: Settings) -> bool {
    let (done_sender, done): (_, Receiver<JobResult>) = unbounded();
    let worker = Worker::new(settings.clone(), done_sender.clone());
    let clock = || Some(Instant::now());
    let mut server = Server::new(settings, connection.sender.clone(), clock, Some(worker));
    // Keep the channel open even if the thread ends.
    let _kept = done_sender;
    let mut queue: VecDeque<Message> = VecDeque::new();
    loop {
        let due = [server.read_at, server.schedule_at].into_iter().flatten().min();
        let timer = due.map_or_else(crossbeam_channel::never, crossbeam_channel::at);
        crossbeam_channel::select! {
            recv(connection.receiver) -> message => match message {
                Ok(message) => queue.push_back(message),
                // The client has closed its stream.
                Err(_) => return false,
            },
            recv(done) -> done => if let Ok(done) = done { server.scheduled(done) },
            recv(timer) -> _ => server.due(),
        }
        // Drain the queue first: it may contain cancellations.
        queue.extend(connection.receiver.try_iter());
        while let Some(message) = queue.pop_front() {
            match message {
                Message::Notification(notification) if notification.method == "exit" => {
                    return server.phase == Phase::Ending;
                }
                Message::Notification(notification) => server.notification(notification),
                Message::Request(request) if is_cancelled(&queue, &request.id) => {
                    let text = "cancelled".to_owned();
                    server.send(Response::new_err(request.id, ErrorCode::RequestCanceled as i32, text));
                }
                Message::Request(request) => server.request(request),
                Message::Response(_) => {}
            }
            queue.extend(connection.receiver.try_iter());
        }
    }
}

fn is_cancelled(queue: &VecDeque<Message>, id: &RequestId) -> bool {
    queue.iter().any(|message| match message {
        Message::Notification(Notification { method, params }) if method == "$/cancelRequest" => {
            serde_json::from_value::<RequestId>(params["id"].clone()).is_ok_and(|cancelled| cancelled == *id)
        }
        _ => false,
    })
}

/// Formats a number with a noun in singular or plural.
fn plural(number: u64, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

impl Server {
    fn new(settings: Settings, sender: Sender<Message>, clock: Clock, worker: Option<Worker>) -> Server {
        Server {
            settings,
            sender,
            clock,
            client: Client::default(),
            phase: Phase::Starting,
            workspace: Workspace::default(),
            programs: BTreeMap::new(),
            stale: BTreeSet::new(),
            read_at: None,
            unscheduled: BTreeSet::new(),
            schedule_at: None,
            took: Duration::ZERO,
            published: BTreeMap::new(),
            worker,
            asked: 0,
        }
    }

    fn send(&self, message: impl Into<Message>) {
        // If the receiver is gone, so is the client; the loop will notice.
        let _ = self.sender.send(message.into());
    }

    fn log(&self, message: &str) {
        self.send(Notification::new(
            "window/logMessage".to_owned(),
            json!({ "type": 1, "message": message }),
        ));
    }

    fn ask(&mut self, method: &str) {
        self.asked += 1;
        self.send(Request::new(format!("takt-{}", self.asked).into(), method.to_owned(), Value::Null));
    }

    /// Schedules the programs of a changed document for reading after the client's pause.
    fn touch(&mut self, path: &Path) {
        let mut roots = self.workspace.roots(path);
        // A changed include may remove the document from a program.
        let of = |(root, program): (&PathBuf, &Program)| program.front.files.of(path).map(|_| root.clone());
        roots.extend(self.programs.iter().filter_map(of));
        self.stale.extend(roots);
        self.read_at = (self.clock)().map(|now| now + self.took.clamp(PAUSE.0, PAUSE.1));
    }

    /// Schedules all programs for reading.
    fn touch_all(&mut self) {
        self.workspace.scan();
        let open: Vec<PathBuf> = self.workspace.open.keys().cloned().collect();
        open.iter().for_each(|path| self.touch(path));
    }

    fn due(&mut self) {
        let now = Instant::now();
        if self.read_at.is_some_and(|at| at <= now) {
            self.read();
        }
        if self.schedule_at.is_some_and(|at| at <= now) && self.stale.is_empty() {
            self.schedule_at = None;
            let texts = self.workspace.texts();
            for root in std::mem::take(&mut self.unscheduled) {
                if let (Some(program), Some(worker)) = (self.programs.get(&root), &self.worker) {
                    let open = texts.clone();
                    worker.start(Job { root, generation: program.generation, open });
                }
            }
        }
    }

    /// Determines which included files are programs by themselves: they open a section and assemble alone. They show their own cycles,
    /// not those of a program that includes them.
    fn find_programs(&mut self) {
        for path in self.workspace.candidates() {
            let roots = self.workspace.roots(&path);
            if roots.contains(&path) || !roots.iter().any(|root| self.stale.contains(root)) {
                continue;
            }
            let (front, _) = program::check(&self.settings, &path, &self.workspace.texts());
            if !front.diagnostics.has_errors() {
                self.workspace.is_program(&path);
                self.stale.insert(path);
            }
        }
    }

    /// Reads and checks the changed programs.
    fn read(&mut self) {
        self.read_at = None;
        self.find_programs();
        let wanted: BTreeSet<PathBuf> =
            self.workspace.open.keys().flat_map(|path| self.workspace.roots(path)).collect();
        // Programs without open documents.
        let gone: Vec<PathBuf> =
            self.programs.keys().filter(|root| !wanted.contains(*root)).cloned().collect();
        for root in gone {
            self.programs.remove(&root);
            self.worker.iter().for_each(|worker| worker.forget(&root));
            self.publish(&root, BTreeMap::new());
        }
        let texts = self.workspace.texts();
        let started = (self.clock)();
        for root in std::mem::take(&mut self.stale).into_iter().filter(|root| wanted.contains(root)) {
            let (front, checked) = program::check(&self.settings, &root, &texts);
            drop(checked);
            let before = self.programs.remove(&root);
            let generation = before.as_ref().map_or(0, |before| before.generation) + 1;
            self.worker.iter().for_each(|worker| worker.is_at(&root, generation));
            let by_file = diagnostics::by_file(&front.files, &front.diagnostics, &root, self.client.encoding);
            // A program with errors is not scheduled; the results for its previous text are kept.
            if front.diagnostics.has_errors() {
                self.unscheduled.remove(&root);
            } else {
                self.unscheduled.insert(root.clone());
                self.schedule_at = (self.clock)().map(|now| now + LONG_PAUSE);
            }
            let full = before.and_then(|before| before.full);
            self.programs.insert(root.clone(), Program { front, full, generation });
            self.publish(&root, by_file);
        }
        self.took = started.map_or(Duration::ZERO, |started| started.elapsed());
    }

    /// Handles a result of the scheduling thread.
    fn scheduled(&mut self, done: JobResult) {
        let JobResult { root, generation, full } = done;
        let Some(program) = self.programs.get_mut(&root).filter(|program| program.generation == generation)
        else {
            return;
        };
        let by_file = diagnostics::by_file(&full.files, &full.diagnostics, &root, self.client.encoding);
        program.full = Some(full);
        self.publish(&root, by_file);
        if self.client.wants_counted {
            let counted = json!({ "uri": uri::of_path(&root) });
            self.send(Notification::new("takt/counted".to_owned(), counted));
        }
        if self.client.refreshes_hints {
            self.ask("workspace/inlayHint/refresh");
        }
        if self.client.refreshes_lenses {
            self.ask("workspace/codeLens/refresh");
        }
    }

    /// Publishes the diagnostics of a program for each of its files.
    fn publish(&mut self, root: &Path, mut by_file: BTreeMap<PathBuf, Vec<Diagnostic>>) {
        let before =
            self.published.iter().filter(|(_, by)| by.contains_key(root)).map(|(path, _)| path.clone());
        let mut paths: BTreeSet<PathBuf> = before.collect();
        paths.extend(by_file.keys().cloned());
        // A document without mistakes gets an empty list once it has been read.
        paths.extend(self.workspace.open.keys().filter(|path| !self.published.contains_key(*path)).cloned());
        for path in paths {
            let new = by_file.remove(&path).unwrap_or_default();
            let known = self.published.contains_key(&path);
            let by = self.published.entry(path.clone()).or_default();
            let old = if new.is_empty() { by.remove(root) } else { by.insert(root.to_owned(), new.clone()) };
            if known && old.unwrap_or_default() == new {
                continue;
            }
            // If several programs report the same diagnostic for a file, publish it once.
            let mut all: Vec<Diagnostic> = Vec::new();
            for one in by.values().flatten() {
                if !all.contains(one) {
                    all.push(one.clone());
                }
            }
            let Some(uri) = uri::of_path(&path) else { continue };
            let version = None;
            let params = PublishDiagnosticsParams { uri, diagnostics: all, version };
            self.send(Notification::new("textDocument/publishDiagnostics".to_owned(), params));
        }
    }
}
