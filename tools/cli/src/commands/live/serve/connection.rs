// SPDX-License-Identifier: MIT OR Apache-2.0
//! A browser's connections: files of the page over HTTP, then messages over a WebSocket.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, sync_channel};
use std::time::{Duration, Instant};
use tungstenite::error::{Error, ProtocolError};
use tungstenite::handshake::machine::TryParse as _;
use tungstenite::handshake::server::{Request, create_response, write_response};
use tungstenite::http::header::{HOST, ORIGIN, UPGRADE};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

/// Time between two looks for messages in the other direction.
pub(super) const PAUSE: Duration = Duration::from_millis(10);
/// Time that a browser has for its request, and a socket for a write.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time that a browser has to close its end after an answer.
const LINGER: Duration = Duration::from_secs(1);
/// Most bytes of a request.
const HEAD: usize = 16 << 10;
/// Most bytes of a message from a page.
const MESSAGE: usize = 1 << 20;
/// Most connections at a time.
const CONNECTIONS: usize = 64;
/// Messages to a page that may wait. A page that reads more slowly is disconnected, and begins anew.
const WAITING: usize = 256;

/// Files of the page: name, media type, contents.
const FILES: [(&str, &str, &str); 7] = [
    ("", "text/html", include_str!("../../../../../web/page/live/index.html")),
    ("live.js", "text/javascript", include_str!("../../../../../web/page/live/live.js")),
    ("line.js", "text/javascript", include_str!("../../../../../web/page/live/line.js")),
    ("chart.js", "text/javascript", include_str!("../../../../../web/page/live/chart.js")),
    ("parts.js", "text/javascript", include_str!("../../../../../web/page/src/parts.js")),
    ("style.css", "text/css", include_str!("../../../../../web/page/src/style.css")),
    ("live.css", "text/css", include_str!("../../../../../web/page/live/live.css")),
];

/// Headers of each answer. The page loads nothing from elsewhere, and no other page may contain it.
const HEADERS: &str =
    "Content-Security-Policy: default-src 'self'; img-src 'self' data:; frame-ancestors 'none'\r
Referrer-Policy: no-referrer\r
X-Content-Type-Options: nosniff\r
Cache-Control: no-store\r
Connection: close\r
";

/// Something that a page has done.
pub(super) enum Event {
    /// A page is there, and takes messages.
    Joined(u64, SyncSender<Arc<str>>),
    /// A page has sent a message.
    Sent(u64, String),
    Left(u64),
}

/// Conditions for a connection.
pub(super) struct Gate {
    /// Names of this server in a browser's requests.
    names: [String; 2],
    token: String,
    open: AtomicUsize,
    pages: AtomicU64,
}

impl Gate {
    pub(super) fn new(port: u16, token: String) -> Gate {
        let names = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}"));
        Gate { names, token, open: AtomicUsize::new(0), pages: AtomicU64::new(0) }
    }

    /// Checks a request; returns the path behind the token.
    fn admit<'r>(&self, request: &'r Request) -> Result<&'r str, Refusal> {
        let header = |name| request.headers().get(name).map(|value| value.to_str().unwrap_or_default());
        // A name that leads to 127.0.0.1 does not make a foreign page one of ours.
        let host = header(HOST).unwrap_or_default();
        if !self.names.iter().any(|name| name == host) {
            return Err(Refusal(403, "this server answers on 127.0.0.1 only".to_owned()));
        }
        if let Some(origin) = header(ORIGIN).filter(|origin| origin.strip_prefix("http://") != Some(host)) {
            return Err(Refusal(403, format!("a page of {origin:?} may not talk to this server")));
        }
        let path = request.uri().path().strip_prefix('/').and_then(|path| path.strip_prefix(&self.token));
        path.and_then(|path| path.strip_prefix('/')).ok_or_else(|| {
            let text = "the address lacks the token that `takt live PORT serve` has printed when it began";
            Refusal(403, text.to_owned())
        })
    }
}

/// A request that is refused: status and reason.
struct Refusal(u16, String);

impl Refusal {
    fn of(error: &Error) -> Refusal {
        match error {
            Error::Protocol(ProtocolError::WrongHttpMethod) => Refusal(405, "only GET is there".to_owned()),
            error => Refusal(400, error.to_string()),
        }
    }
}

/// Handles a connection in a thread of its own.
pub(super) fn spawn(stream: TcpStream, gate: &Arc<Gate>, events: &Sender<Event>) {
    // Beyond the limit, the connection is closed at once.
    if gate.open.fetch_add(1, Ordering::Relaxed) >= CONNECTIONS {
        gate.open.fetch_sub(1, Ordering::Relaxed);
        return;
    }
    let (gate, events) = (gate.clone(), events.clone());
    std::thread::spawn(move || {
        // A browser that goes away is no error.
        let _ = handle(stream, &gate, &events);
        gate.open.fetch_sub(1, Ordering::Relaxed);
    });
}

fn handle(mut stream: TcpStream, gate: &Gate, events: &Sender<Event>) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let request = match request(&mut stream)? {
        Ok(request) => request,
        Err(refusal) => return refuse(&mut stream, &refusal),
    };
    let path = match gate.admit(&request) {
        Ok(path) => path,
        Err(refusal) => return refuse(&mut stream, &refusal),
    };
    if path == "socket" && request.headers().contains_key(UPGRADE) {
        let response = match create_response(&request) {
            Ok(response) => response,
            Err(error) => return refuse(&mut stream, &Refusal::of(&error)),
        };
        write_response(&mut stream, &response).map_err(io::Error::other)?;
        return converse(stream, gate.pages.fetch_add(1, Ordering::Relaxed), events);
    }
    match FILES.iter().find(|(name, ..)| *name == path) {
        Some((_, media, text)) => answer(&mut stream, "200 OK", media, text),
        None => refuse(&mut stream, &Refusal(404, format!("there is no {path:?}"))),
    }
}

/// Reads a request without a body.
fn request(stream: &mut TcpStream) -> io::Result<Result<Request, Refusal>> {
    let begin = Instant::now();
    let mut head = Vec::new();
    loop {
        let left = PATIENCE.saturating_sub(begin.elapsed());
        if left.is_zero() {
            return Ok(Err(Refusal(408, "the request did not come to its end".to_owned())));
        }
        stream.set_read_timeout(Some(left))?;
        let mut bytes = [0; 4096];
        match stream.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => head.extend(&bytes[..count]),
            Err(error) if is_pause(&error) => continue,
            Err(error) => return Err(error),
        }
        match Request::try_parse(&head) {
            Ok(Some((_, request))) => return Ok(Ok(request)),
            Ok(None) if head.len() < HEAD => {}
            Ok(None) => return Ok(Err(Refusal(431, format!("a request has {HEAD} bytes at most")))),
            Err(error) => return Ok(Err(Refusal::of(&error))),
        }
    }
}

/// Nothing has come within the time limit.
fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

fn refuse(stream: &mut TcpStream, Refusal(status, text): &Refusal) -> io::Result<()> {
    let reason = match status {
        403 => "403 Forbidden",
        404 => "404 Not Found",
        405 => "405 Method Not Allowed",
        408 => "408 Request Timeout",
        431 => "431 Request Header Fields Too Large",
        _ => "400 Bad Request",
    };
    answer(stream, reason, "text/plain", &format!("{reason}: {text}\n"))
}

fn answer(stream: &mut TcpStream, status: &str, media: &str, text: &str) -> io::Result<()> {
    let length = text.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {media}; charset=utf-8\r\nContent-Length: {length}\r\n");
    stream.write_all(format!("{head}{HEADERS}\r\n{text}").as_bytes())?;
    // With bytes that nobody has read, closing would take the answer away from the browser.
    stream.shutdown(Shutdown::Write)?;
    stream.set_read_timeout(Some(LINGER))?;
    io::copy(&mut stream.take(MESSAGE as u64), &mut io::sink())?;
    Ok(())
}

/// Passes messages between a page and the server until one of them leaves.
fn converse(stream: TcpStream, page: u64, events: &Sender<Event>) -> io::Result<()> {
    stream.set_read_timeout(Some(PAUSE))?;
    let limits = WebSocketConfig::default().max_message_size(Some(MESSAGE)).max_frame_size(Some(MESSAGE));
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(limits));
    let (sender, outgoing) = sync_channel(WAITING);
    if events.send(Event::Joined(page, sender)).is_ok() {
        // The page left, or its messages were wrong.
        let _ = pass(&mut socket, page, events, &outgoing);
        let _ = socket.close(None);
        let _ = socket.flush();
        let _ = events.send(Event::Left(page));
    }
    Ok(())
}

fn pass(
    socket: &mut WebSocket<TcpStream>,
    page: u64,
    events: &Sender<Event>,
    outgoing: &Receiver<Arc<str>>,
) -> Result<(), Error> {
    loop {
        match socket.read() {
            Ok(Message::Text(text)) => {
                if events.send(Event::Sent(page, text.to_string())).is_err() {
                    return Ok(());
                }
            }
            Ok(_) => {}
            Err(Error::Io(error)) if is_pause(&error) => {}
            Err(error) => return Err(error),
        }
        loop {
            match outgoing.try_recv() {
                Ok(text) => socket.write(Message::text(&*text))?,
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
        }
        socket.flush()?;
    }
}
