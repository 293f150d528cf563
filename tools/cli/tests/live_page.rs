// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt live serve`: who may connect, one page that sets and others that watch, a port that goes and comes back; on an emulated board.
//! Parameters and the scope on a simulated one.
#![cfg(unix)]

use crate::common::{Folder, SimulatedBoard};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use takt_asm::{FileLoader, Options, assemble};
use takt_board::emulated::EmulatedBoard;
use takt_board::terminal::Terminal;
use takt_board::{Board, Wiring};
use takt_system::{Description, ProgramError, Request};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message, WebSocket};

/// Time limit for an answer on a busy machine.
const PATIENCE: Duration = Duration::from_secs(100);

fn axis() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../programs/examples/board/axis")
}

/// Example of a system on an emulated board, behind a pseudo-terminal.
struct Emulated {
    path: PathBuf,
    ends: Arc<AtomicBool>,
    /// Ends with the number of bytes that the board has received.
    thread: Option<JoinHandle<usize>>,
}

impl Emulated {
    fn start() -> Emulated {
        let folder = axis();
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("an example");
        let description: Description =
            takt_system::read("axis.toml", &read("axis.toml"), |request: &Request<'_>| {
                let options =
                    Options { machine: request.machine.expect("the file says it"), ..Options::default() };
                let assembled = assemble(request.path, &FileLoader::new(&folder), &options);
                Ok::<_, ProgramError<()>>(assembled.unwrap_or_else(|error| panic!("{error:?}")).program)
            })
            .unwrap_or_else(|_| panic!("the example is right"));
        let ulx3s = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
        let wiring = Wiring::read("wiring.toml", &read("wiring.toml"), &ulx3s).expect("a right wiring");
        let mut board = EmulatedBoard::new(&wiring, &description).expect("it has a circuit");
        let mut line = Terminal::new().expect("a pseudo-terminal");
        let (path, ends) = (line.path().to_owned(), Arc::new(AtomicBool::new(false)));
        let stops = ends.clone();
        let thread = std::thread::spawn(move || {
            let mut received = 0;
            while !stops.load(Ordering::Relaxed) {
                let bytes = line.receive().expect("the terminal is there");
                received += bytes.len();
                let mut answers = board.receive(&bytes);
                answers.extend(board.pass());
                line.send(&answers).expect("the terminal is there");
                std::thread::sleep(Duration::from_millis(1));
            }
            received
        });
        Emulated { path, ends, thread: Some(thread) }
    }

    /// Pulls the cable; returns the number of bytes that the board has received.
    fn end(&mut self) -> usize {
        self.ends.store(true, Ordering::Relaxed);
        self.thread.take().map_or(0, |thread| thread.join().expect("it has not failed"))
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
    }
}

/// A `takt live serve` process, killed on drop.
struct Server {
    process: Child,
    /// Port and token of the address that it prints.
    port: u16,
    token: String,
}

impl Server {
    fn start(folder: &Path, line: &str) -> Server {
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        command.args(line.split_whitespace()).current_dir(folder);
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut said).unwrap();
        let rest = said.trim().strip_prefix("http://127.0.0.1:").unwrap_or_else(|| panic!("`{said}`"));
        let (port, token) = rest.split_once('/').unwrap();
        let token = token.strip_suffix('/').unwrap().to_owned();
        Server { process, port: port.parse().unwrap(), token }
    }

    /// Answer to a request, as text.
    fn ask(&self, head: &str) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = Vec::new();
        // Who is let in by mistake would be told the board's state for ever.
        while !answer.starts_with(b"HTTP/1.1 101") {
            let mut bytes = [0; 4096];
            match stream.read(&mut bytes).unwrap() {
                0 => break,
                count => answer.extend(&bytes[..count]),
            }
        }
        String::from_utf8(answer).unwrap()
    }

    fn get(&self, path: &str) -> String {
        self.ask(&format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", self.port))
    }

    fn page(&self) -> Page {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let address = format!("ws://127.0.0.1:{}/{}/socket", self.port, self.token);
        let mut request = address.into_client_request().unwrap();
        let origin = format!("http://127.0.0.1:{}", self.port);
        request.headers_mut().insert("origin", origin.parse().unwrap());
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        Page { socket, asked: 0 }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A page, as the server sees it.
struct Page {
    socket: WebSocket<TcpStream>,
    asked: u64,
}

impl Page {
    /// Next message for which a condition holds; others are dropped.
    #[track_caller]
    fn wait(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        let (begin, mut last) = (Instant::now(), Value::Null);
        while begin.elapsed() < PATIENCE {
            let Message::Text(text) = self.socket.read().expect("the server is there") else { continue };
            last = serde_json::from_str(&text).unwrap();
            if wanted(&last) {
                return last;
            }
        }
        panic!("at last came {last}");
    }

    #[track_caller]
    fn kind(&mut self, kind: &str) -> Value {
        self.wait(|message| message["type"] == kind)
    }

    /// Sends a request; returns the error of the answer, empty if there is none.
    #[track_caller]
    fn ask(&mut self, wish: Value) -> String {
        let answer = self.answer(wish);
        answer["error"].as_str().unwrap_or_default().to_owned()
    }

    #[track_caller]
    fn answer(&mut self, mut wish: Value) -> Value {
        self.asked += 1;
        wish["id"] = self.asked.into();
        self.socket.send(Message::text(wish.to_string())).unwrap();
        let id = self.asked;
        self.wait(|message| message["type"] == "answer" && message["id"] == id)
    }

    /// Waits for a state in which the value number `at` is this.
    #[track_caller]
    fn value(&mut self, at: usize, value: &str) {
        self.wait(|message| message["type"] == "state" && message["values"][at] == value);
    }
}

/// Place of a value in the messages with states.
fn place(hello: &Value, name: &str) -> usize {
    let all =
        ["parameters", "inputs", "outputs"].into_iter().flat_map(|kind| hello[kind].as_array().unwrap());
    all.map(|shown| &shown["name"]).position(|known| known == name).expect(name)
}

fn axis_server(folder: &Folder, port: &Path, options: &str) -> Server {
    let system = axis().join("axis.toml");
    let line = format!("live {} --program {} serve {options}", port.display(), system.display());
    Server::start(folder.path(), line.trim())
}

/// Everyone on this computer can connect; only who has read the address may ask, and no foreign page.
#[test]
fn token_host_and_origin_are_checked() {
    let (folder, board) = (Folder::new(), Emulated::start());
    let server = axis_server(&folder, &board.path, "");
    let Server { port, token, .. } = &server;
    assert_eq!(token.len(), 32);
    let page = server.get(&format!("/{token}/"));
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n") && page.contains("<title>Takt live</title>"), "{page}");
    assert!(page.contains("Content-Security-Policy: default-src 'self'"), "{page}");
    // The page and its scripts load what the server has, and nothing from elsewhere.
    for name in ["live.js", "chart.js", "parts.js", "style.css", "live.css"] {
        let file = server.get(&format!("/{token}/{name}"));
        assert!(file.starts_with("HTTP/1.1 200 OK\r\n"), "{name}: {file}");
        for line in file.lines().filter(|line| line.starts_with("import ")) {
            let from = line.split('"').nth(1).unwrap().strip_prefix("./").unwrap();
            assert!(server.get(&format!("/{token}/{from}")).starts_with("HTTP/1.1 200 OK\r\n"), "{line}");
        }
    }
    for name in page.split("href=\"").chain(page.split("src=\"")).skip(1) {
        let name = name.split('"').next().unwrap();
        let known =
            name.starts_with("data:") || server.get(&format!("/{token}/{name}")).starts_with("HTTP/1.1 200");
        assert!(known || !page.contains(&format!("=\"{name}\"")), "{name}");
    }

    let wrong = format!("{:032x}", u128::from_str_radix(token, 16).unwrap() ^ 1);
    let host = format!("Host: 127.0.0.1:{port}\r\n");
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let get = |path: &str, headers: &str| server.ask(&format!("GET {path} HTTP/1.1\r\n{headers}\r\n"));
    for (path, headers, status, says) in [
        ("/", host.clone(), 403, "the address lacks the token"),
        (&*format!("/{wrong}/"), host.clone(), 403, "the address lacks the token"),
        (&format!("/{wrong}/socket"), format!("{host}{upgrade}"), 403, "the address lacks the token"),
        (&format!("/{token}x/"), host.clone(), 403, "the address lacks the token"),
        (
            &format!("/{token}/socket"),
            format!("{host}{upgrade}Origin: http://evil.example\r\n"),
            403,
            "a page of",
        ),
        (
            &format!("/{token}/socket"),
            format!("{host}{upgrade}Origin: http://127.0.0.1:1\r\n"),
            403,
            "a page of",
        ),
        (&format!("/{token}/socket"), format!("{host}{upgrade}Origin: null\r\n"), 403, "a page of"),
        // A name of someone else that leads to this computer.
        (&format!("/{token}/"), format!("Host: evil.example:{port}\r\n"), 403, "on 127.0.0.1 only"),
        (&format!("/{token}/"), String::new(), 403, "on 127.0.0.1 only"),
        (&format!("/{token}/../../etc/passwd"), host.clone(), 404, "there is no"),
        (
            &format!("/{token}/socket"),
            format!("{host}Connection: Upgrade\r\nUpgrade: websocket\r\n"),
            400,
            "WebSocket",
        ),
        ("/", format!("{host}X: {}\r\n", "x".repeat(20_000)), 431, "bytes at most"),
    ] {
        let answer = get(path, &headers);
        let begins = format!("HTTP/1.1 {status} ");
        assert!(answer.starts_with(&begins) && answer.contains(says), "{path} {headers}: {answer}");
    }
    let post = server.ask(&format!("POST /{token}/ HTTP/1.1\r\n{host}\r\n"));
    assert!(post.starts_with("HTTP/1.1 405 "), "{post}");
    assert!(server.ask("nonsense\r\n\r\n").starts_with("HTTP/1.1 400 "));
    assert!(TcpStream::connect(("::1", *port)).is_err(), "it listens on 127.0.0.1 only");
    // After all this, it serves.
    let hello = server.page().kind("hello");
    assert_eq!(
        (&hello["program"], &hello["machine"]),
        (&json!("axis.toml"), &json!("profile t1, servo t1, watch t1"))
    );
}

/// The first page sets and controls, the second one only sees it.
#[test]
fn one_page_has_control() {
    let (folder, mut board) = (Folder::new(), Emulated::start());
    let server = axis_server(&folder, &board.path, "");
    let mut first = server.page();
    let hello = first.kind("hello");
    assert_eq!(first.kind("role"), json!({ "type": "role", "writer": true, "free": false, "pages": 1 }));
    let limit = place(&hello, "limit");
    let shown = hello["inputs"].as_array().unwrap().iter().find(|shown| shown["name"] == "limit");
    assert_eq!(shown.unwrap()["fixed"], Value::Null);
    let mut second = server.page();
    assert_eq!(second.kind("role"), json!({ "type": "role", "writer": false, "free": false, "pages": 2 }));

    assert_eq!(first.ask(json!({ "do": "input", "name": "limit", "value": "2.5" })), "");
    first.value(limit, "2.5");
    second.value(limit, "2.5");
    let refused = "another page has control: this one only shows";
    for wish in [
        json!({ "do": "input", "name": "limit", "value": "7" }),
        json!({ "do": "control", "command": "stop" }),
        json!({ "do": "parameters", "values": {} }),
        json!({ "do": "end" }),
        json!({ "do": "release" }),
    ] {
        assert_eq!(second.ask(wish.clone()), refused, "{wish}");
    }
    assert_eq!(second.ask(json!({ "do": "claim" })), "another page has control");
    second.value(limit, "2.5");

    // Malformed requests, and requests that cannot be fulfilled, get an error; the pages go on.
    for (wish, says) in [
        (json!({ "do": "input", "name": "limit", "value": "fast" }), "`fast` is not a value of `limit`"),
        (json!({ "do": "input", "name": "none", "value": "1" }), "none"),
        (json!({ "do": "control", "command": "step" }), "the program is not held"),
        (json!({ "do": "save", "extra": 1 }), ""),
        (json!({ "do": "csv" }), "there is no recording yet"),
        (
            json!({ "do": "arm", "request": { "channels": ["servo.n"], "triggers": [], "every": 1, "samples": null, "before": null, "repeat": false } }),
            "the board has no scope",
        ),
    ] {
        let error = first.ask(wish.clone());
        assert!(error.contains(says) && error.is_empty() == says.is_empty(), "{wish}: {error}");
    }
    for text in ["{", "[]", "{\"id\":1}", "{\"id\":-1,\"do\":\"end\"}", "{\"id\":1,\"do\":\"explode\"}"] {
        first.socket.send(Message::text(text)).unwrap();
        let answer = first.kind("answer");
        assert!(answer["error"].as_str().unwrap().contains("a message that is none"), "{text}: {answer}");
    }

    // Stop, start, hold: both pages see the outputs.
    assert_eq!(first.ask(json!({ "do": "control", "command": "stop" })), "");
    let stopped = second.wait(|message| message["report"]["runs"] == false);
    assert_eq!(stopped["report"]["state"], "the system stopped");
    assert_eq!(stopped["report"]["safe"], json!(["it is stopped, and not started again"]));
    assert_eq!(first.ask(json!({ "do": "control", "command": "start" })), "");
    second.wait(|message| message["report"]["safe"] == json!([]) && message["report"]["runs"] == true);
    assert_eq!(first.ask(json!({ "do": "control", "command": "hold" })), "");
    second.wait(|message| message["report"]["held"] == true);
    assert_eq!(first.ask(json!({ "do": "control", "command": "step" })), "");

    // The page is reloaded: it has control again, and reads the state from the board.
    drop(first);
    second.wait(|message| message["type"] == "role" && message["free"] == true);
    let mut first = server.page();
    assert_eq!(first.kind("role")["writer"], true);
    let state = first.kind("state");
    assert_eq!(
        (&state["report"]["held"], &state["values"][limit]),
        (&json!(true), &json!("0")),
        "a start resets it"
    );
    // It hands control over.
    assert_eq!(first.ask(json!({ "do": "release" })), "");
    assert_eq!(first.ask(json!({ "do": "end" })), "no page has control: this one only shows");
    second.wait(|message| message["type"] == "role" && message["free"] == true);
    assert_eq!(second.ask(json!({ "do": "claim" })), "");
    assert_eq!(first.wait(|message| message["type"] == "role" && message["free"] == false)["writer"], false);
    assert_eq!(first.ask(json!({ "do": "control", "command": "go" })), refused);
    assert_eq!(second.ask(json!({ "do": "control", "command": "go" })), "");

    // A message that is too long ends its page; the other goes on.
    let _ = first.socket.send(Message::text("x".repeat(2 << 20)));
    second.wait(|message| message["type"] == "role" && message["pages"] == 1);
    assert!(board.end() > 0);
}

/// The cable is pulled, and plugged in again; another board is no replacement.
#[test]
fn a_port_that_goes_is_looked_for() {
    let folder = Folder::new();
    let port = folder.path().join("port");
    let mut board = Emulated::start();
    symlink(&board.path, &port).unwrap();
    let server = axis_server(&folder, &port, "");
    let mut page = server.page();
    page.kind("state");
    board.end();
    std::fs::remove_file(&port).unwrap();
    let lost = page.wait(|message| message["type"] == "link" && message["connected"] == false);
    assert!(lost["text"].as_str().unwrap().contains("the port was unplugged"), "{lost}");
    let error = page.ask(json!({ "do": "control", "command": "stop" }));
    assert!(error.starts_with("the board is not there: "), "{error}");
    let lost = page.wait(|message| message["type"] == "link" && message["text"] != lost["text"]);
    assert!(lost["text"].as_str().unwrap().contains("is the board plugged in"), "{lost}");
    // A page that comes now is told at once.
    let mut second = server.page();
    assert_eq!(second.kind("link")["connected"], false);
    let board = Emulated::start();
    symlink(&board.path, &port).unwrap();
    page.wait(|message| message["type"] == "link" && message["connected"] == true);
    second.kind("state");
    assert_eq!(page.ask(json!({ "do": "control", "command": "stop" })), "");
}

/// Mistakes before the page is served.
#[test]
fn a_page_that_cannot_be_served_says_why() {
    let (folder, board) = (Folder::new(), Emulated::start());
    let taken = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let number = taken.local_addr().unwrap().port();
    let (path, system) = (board.path.display(), axis().join("axis.toml"));
    let system = system.display();
    for (line, says) in [
        (
            format!("live {path} --program {system} serve --listen {number}"),
            format!("cannot listen at port {number} of 127.0.0.1: choose another with --listen"),
        ),
        (format!("live {path} --program {system} serve --listen 0"), "1..=65535".to_owned()),
        (format!("live {path} serve"), "give it with --program FILE".to_owned()),
        (
            format!("live none --program {system} --serve"),
            "cannot open none: is the board plugged in".to_owned(),
        ),
    ] {
        let done = folder.line(&line);
        assert!(
            done.status != Some(0) && done.stdout.is_empty() && done.stderr.contains(&says),
            "{line}: {done:?}"
        );
    }
    // The flag is the command.
    let server = Server::start(folder.path(), &format!("live {path} --program {system} --serve"));
    assert!(server.get(&format!("/{}/", server.token)).contains("200 OK"));
}

/// A law whose output rises by a gain.
const RAMP: &str = "\
.param  gain = 0.5 range 0..8           ; m/s²
.param  K[2]:int = 1, 2 range -9..9
.input  on:int
.output y                               ; m/s
.output k:int, both:int
.range  on = 0, 1
.state  sum count:int
.once
        sum, count, y, k, both = 0, 0, 0, 0, 0
        wait    period
.period
period: count = count + 1
        sum = on ? sum + gain : 0
        iand    k, count, 7
        y, both = sum, K[1] + K[2]
        wait    period
";

/// Parameters within their ranges, at once and from files; recordings; on a board in Verilator.
#[test]
fn parameters_and_recordings() {
    let folder = Folder::new();
    folder.write("ramp.s", RAMP);
    let head = "board = \"ulx3s-85f\"\nclock = 50\nperiod = 40\nbaud = 10_000_000\nautostart = true\n";
    folder.write("scoped.toml", format!("{head}[scope]\nchannels = 2\ndepth = 64\n"));
    let options = "--program ramp.s --wiring scoped.toml --machine t1";
    let board = SimulatedBoard::start(&format!("board sim {options}"), folder.path());
    let live = format!("live {} --baud {} {options}", board.port, board.baud);
    let server = Server::start(folder.path(), &format!("{live} serve"));
    let mut page = server.page();
    let hello = page.kind("hello");
    assert_eq!(
        hello["parameters"][0],
        json!({ "name": "gain", "type": "float", "unit": "m/s²", "range": ["0.0", "8.0"], "fixed": null })
    );
    assert_eq!(hello["inputs"][0]["range"], json!(["0", "1"]));
    assert!(hello["channels"].as_array().unwrap().contains(&json!("sum")), "{hello}");
    let link = page.kind("link");
    assert_eq!((&link["cycles"], &link["scope"]), (&json!(2000), &json!({ "channels": 2, "depth": 64 })));
    let (gain, second) = (place(&hello, "gain"), place(&hello, "K[2]"));
    page.value(gain, "0.5");

    let set = |page: &mut Page, values: Value| page.ask(json!({ "do": "parameters", "values": values }));
    assert_eq!(set(&mut page, json!({ "gain": "0.25", "K[2]": "-9" })), "");
    let state = page.kind("state");
    assert_eq!((&state["values"][gain], &state["values"][second]), (&json!("0.25"), &json!("-9")));
    for (values, says) in [
        (
            json!({ "gain": "8.5" }),
            "8.5 is no value of the parameter `gain`: the source states the range 0 to 8",
        ),
        (json!({ "gain": "NaN" }), "NaN"),
        (json!({ "gain": "much" }), "`much` is not a number"),
        (json!({ "gain": "" }), "is not a number"),
        (json!({ "K[1]": "1.5" }), "`1.5` is not an integer"),
        // All or none.
        (json!({ "K[1]": "3", "gain": "9" }), "9 is no value of the parameter `gain`"),
        (json!({ "on": "1" }), "no parameter `on`"),
    ] {
        let error = set(&mut page, values.clone());
        assert!(error.contains(says), "{values}: {error}");
    }
    let file = page.answer(json!({ "do": "save" }))["file"].as_str().unwrap().to_owned();
    assert_eq!(file, "gain = 0.25\n\"K[1]\" = 1\n\"K[2]\" = -9\n");
    let error = page.ask(json!({ "do": "load", "text": "gain = " }));
    assert!(error.contains("the file: TOML"), "{error}");
    assert_eq!(page.ask(json!({ "do": "load", "text": file.replace("0.25", "0.5") })), "");
    page.value(gain, "0.5");

    // A recording around a trigger, for each page, and as CSV.
    let mut watcher = server.page();
    let arm = |page: &mut Page, channels: &[&str], triggers: &[&str], repeat: bool| {
        let request = json!({ "channels": channels, "triggers": triggers, "every": 1, "samples": 12, "before": 4, "repeat": repeat });
        page.ask(json!({ "do": "arm", "request": request }))
    };
    assert_eq!(arm(&mut page, &["y", "k"], &["y rises 3", "fault"], false), "");
    let armed = watcher.wait(|message| message["phase"] == "armed");
    assert_eq!(armed["text"], "y rises 3 or fault");
    assert_eq!(page.ask(json!({ "do": "input", "name": "on", "value": "1" })), "");
    for page in [&mut page, &mut watcher] {
        let recording = page.kind("recording");
        assert_eq!(recording["trigger"], 4);
        assert_eq!(
            recording["values"][0],
            json!([1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5])
        );
        assert_eq!(recording["channels"][1], json!({ "name": "k", "type": "int" }));
        assert!((recording["seconds"].as_f64().unwrap() - 40e-6).abs() < 1e-9, "{recording}");
        page.wait(|message| message["phase"] == "rest");
    }
    let csv = watcher.answer(json!({ "do": "csv" }))["file"].as_str().unwrap().to_owned();
    let rows: Vec<&str> = csv.lines().collect();
    assert!(rows[0] == "period,y,k" && rows.len() == 13 && rows[1].contains(",1.0,"), "{csv}");
    // Again and again, until it is ended.
    assert_eq!(arm(&mut page, &["k"], &["k falls 1"], true), "");
    for _ in 0..2 {
        assert_eq!(watcher.kind("recording")["values"][0][4], 0);
    }
    assert_eq!(page.ask(json!({ "do": "end" })), "");
    watcher.wait(|message| message["phase"] == "rest");
    // A page that comes later has the last recording, too.
    drop(watcher);
    assert_eq!(server.page().kind("recording")["channels"][0]["name"], "k");
    for (channels, triggers, says) in [
        (&["gian"][..], &[][..], "no port, register or data word `gian`"),
        (&["y", "k", "sum"], &[], "3 channels are asked for; the board's scope has 2"),
        (&["y"], &["sum > 1"], "the trigger compares `sum`, which is not a channel"),
        (&["y"], &["y > high"], "`high` is not a level"),
        (&[], &[], "0 channels are asked for"),
    ] {
        let error = arm(&mut page, channels, triggers, false);
        assert!(error.contains(says), "{channels:?} {triggers:?}: {error}");
    }

    // Another command at the port would take answers of the server; then the board ends.
    let done = folder.line(&format!("{live} status"));
    assert!(
        done.status == Some(1) && done.stderr.contains("is in use by another command of takt"),
        "{done:?}"
    );
    drop(board);
    let lost = page.wait(|message| message["type"] == "link");
    assert!(
        lost["connected"] == false && lost["text"].as_str().unwrap().contains("the port was unplugged"),
        "{lost}"
    );
}
