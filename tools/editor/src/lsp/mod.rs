// SPDX-License-Identifier: MIT OR Apache-2.0
//! The language server.
//!
//! One thread answers: it drains what the client has sent, reads and checks the programs that changed ([`program::check`], which takes a
//! fraction of the time between two keystrokes), and answers from what it knows. A second thread schedules and counts cycles;
//! what it finds for a text that is no longer there is dropped, and a newer job takes the place of one that waits.
//!
//! Every diagnostic is the assembler's own: those of [`takt_asm::check`] at once, those of the scheduler when it is done.

mod complete;
mod diagnostics;
mod dispatch;
mod hover;
mod inline;
mod names;
mod outline;
mod pipeline;
mod program;
mod requests;
mod text;
mod timing;
mod uri;
mod worker;
mod workspace;

pub use inline::Inline;

use crossbeam_channel::{Receiver, Sender, unbounded};
use lsp_server::{Connection, ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::{Diagnostic, PublishDiagnosticsParams};
use program::{Front, Full};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use takt_asm::levels::Levels;
use takt_isa::Machine;
use takt_isa::timing::Cycle;
use text::Encoding;
use worker::{Done, Job, Worker};
use workspace::Workspace;

/// The time for which the client must be silent before changes are read, at least and at most.
const PAUSE: (Duration, Duration) = (Duration::from_millis(10), Duration::from_secs(1));
/// The time for which it must be silent before a program is scheduled.
const LONG_PAUSE: Duration = Duration::from_millis(150);

/// The settings that the server is told once.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The machine that programs are assembled for, unless they name another (`.machine`).
    pub machine: &'static Machine,
    /// The levels of warnings.
    pub levels: Levels,
    /// Folders beyond the project where `.include` looks.
    pub folders: Vec<PathBuf>,
    /// The library: names and texts.
    pub library: &'static [(&'static str, &'static str)],
    /// The sources that a document that lies nowhere can include by name: names and texts.
    pub beside: &'static [(&'static str, &'static str)],
    /// The folder for a copy of the library that an editor is to open; it is not opened if there is none.
    pub library_folder: Option<PathBuf>,
    /// True if the client opens a library's file by its name: the address of `<math.s>` is `%3Cmath.s%3E`.
    pub library_by_name: bool,
    /// Cycles that a period may take.
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

/// The facts about a program.
struct Program {
    front: Front,
    full: Option<Full>,
    /// Counts the times that it was read.
    generation: u64,
}

/// The client's capabilities.
#[derive(Clone, Copy, Debug, Default)]
struct Client {
    encoding: Encoding,
    snippets: bool,
    refreshes_hints: bool,
    refreshes_lenses: bool,
    /// It wants to be told when a program is counted, for a picture of its own.
    wants_counted: bool,
}

/// The phase of the session.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Starting,
    Running,
    /// `shutdown` is answered.
    Ending,
}

/// Tells the time, where there is one to tell.
type Clock = fn() -> Option<Instant>;

struct Server {
    settings: Settings,
    sender: Sender<Message>,
    /// The clock; nothing is put off without one.
    clock: Clock,
    client: Client,
    phase: Phase,
    workspace: Workspace,
    /// By the path of the first source.
    programs: BTreeMap<PathBuf, Program>,
    /// Programs to be read again, and since when.
    stale: BTreeSet<PathBuf>,
    read_at: Option<Instant>,
    /// Programs to be scheduled again.
    unscheduled: BTreeSet<PathBuf>,
    schedule_at: Option<Instant>,
    /// The time that the last reading took.
    took: Duration,
    /// For each file, what each program says of it.
    published: BTreeMap<PathBuf, BTreeMap<PathBuf, Vec<Diagnostic>>>,
    /// The thread that schedules, if there is one.
    worker: Option<Worker>,
    /// Requests of the server's own so far.
    asked: i32,
}

/// Serves a client until it says `exit` or goes. True if it said so in order.
pub fn serve(connection: &Connection, settings: Settings) -> bool {
    let (done_sender, done): (_, Receiver<Done>) = unbounded();
    let worker = Worker::new(settings.clone(), done_sender.clone());
    let clock = || Some(Instant::now());
    let mut server = Server::new(settings, connection.sender.clone(), clock, Some(worker));
    // So that the channel outlives the thread.
    let _kept = done_sender;
    let mut queue: VecDeque<Message> = VecDeque::new();
    loop {
        let due = [server.read_at, server.schedule_at].into_iter().flatten().min();
        let timer = due.map_or_else(crossbeam_channel::never, crossbeam_channel::at);
        crossbeam_channel::select! {
            recv(connection.receiver) -> message => match message {
                Ok(message) => queue.push_back(message),
                // The client is gone.
                Err(_) => return false,
            },
            recv(done) -> done => if let Ok(done) = done { server.scheduled(done) },
            recv(timer) -> _ => server.due(),
        }
        // The client's cancellations are among what it sent since.
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

/// A number and a noun.
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
        // If nobody receives it, the client is gone, and the loop will see that.
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

    /// A document has changed: what it is part of is to be read again, once the client pauses.
    fn touch(&mut self, path: &Path) {
        let mut roots = self.workspace.roots(path);
        // A program that a change of includes takes it out of.
        let of = |(root, program): (&PathBuf, &Program)| program.front.files.of(path).map(|_| root.clone());
        roots.extend(self.programs.iter().filter_map(of));
        self.stale.extend(roots);
        self.read_at = (self.clock)().map(|now| now + self.took.clamp(PAUSE.0, PAUSE.1));
    }

    /// Everything is to be read again.
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

    /// Finds out whether files that others include are programs by themselves: those that open a section and assemble alone. Their
    /// own cycles are shown, not those of a program that includes them.
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

    /// Reads and checks what has changed.
    fn read(&mut self) {
        self.read_at = None;
        self.find_programs();
        let wanted: BTreeSet<PathBuf> =
            self.workspace.open.keys().flat_map(|path| self.workspace.roots(path)).collect();
        // Programs that no open document is part of any more.
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
            // A program with mistakes is not scheduled, also if it had none a moment ago: what is known of the text before stays.
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

    /// The second thread is done with a program.
    fn scheduled(&mut self, done: Done) {
        let Done { root, generation, full } = done;
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

    /// Tells the client what a program says of its files.
    fn publish(&mut self, root: &Path, mut by_file: BTreeMap<PathBuf, Vec<Diagnostic>>) {
        let before =
            self.published.iter().filter(|(_, by)| by.contains_key(root)).map(|(path, _)| path.clone());
        let mut paths: BTreeSet<PathBuf> = before.collect();
        paths.extend(by_file.keys().cloned());
        // A document without mistakes is told so once it is read.
        paths.extend(self.workspace.open.keys().filter(|path| !self.published.contains_key(*path)).cloned());
        for path in paths {
            let new = by_file.remove(&path).unwrap_or_default();
            let known = self.published.contains_key(&path);
            let by = self.published.entry(path.clone()).or_default();
            let old = if new.is_empty() { by.remove(root) } else { by.insert(root.to_owned(), new.clone()) };
            if known && old.unwrap_or_default() == new {
                continue;
            }
            // A diagnostic of several programs on one file is told once.
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
