// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommand `serve` of `takt live`: a page for a browser on this computer, over HTTP and a WebSocket.
//!
//! One thread owns the board: it reads its state several times a second and carries out what pages ask for. Each connection has a thread
//! that knows only its socket.

mod connection;
mod server;

use super::Port;
use crate::run::application::Application as Loaded;
use crate::terminal::files::Out;
use anyhow::{Context, Result};
use clap::Args;
use connection::Gate;
use server::Server;
use std::io::Write;
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc;
use takt_board::serial::Serial;
use takt_board::{Application, Host, Wiring};
use takt_live::Target;

/// Options of `takt live serve`.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ServeArguments {
    /// TCP port at which to listen, on 127.0.0.1 only [default: a free one].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    listen: Option<u16>,
}

const EXAMPLES: &str = "\
Examples:
  takt live /dev/ttyUSB0 --baud 1000000 --program servo.s serve
  takt live /dev/ttyUSB0 --program servo.s --wiring servo.toml serve --listen 7000    time in seconds, names of trips";

/// Place where browsers find the page.
pub(super) struct Address {
    listener: TcpListener,
    /// Number of the TCP port.
    port: u16,
    /// First part of each path that is served, which only the reader of this command's output knows.
    token: String,
}

impl Address {
    /// Listens on the loopback interface.
    pub(super) fn listen(arguments: &ServeArguments) -> Result<Address> {
        let wanted = arguments.listen.unwrap_or(0);
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, wanted)).with_context(|| {
            let hint = "choose another with --listen, or leave it out for a free one";
            format!("cannot listen at port {wanted} of 127.0.0.1: {hint}")
        })?;
        let port = listener.local_addr().context("the port has no address")?.port();
        let random = || getrandom::u64().context("the system gives no random numbers for the page's token");
        let token = format!("{:016x}{:016x}", random()?, random()?);
        Ok(Address { listener, port, token })
    }
}

/// The board that pages show, and the program that runs there.
pub(super) struct Served<'a> {
    pub(super) port: &'a Port,
    /// File of the program.
    pub(super) file: &'a Path,
    pub(super) loaded: &'a Loaded,
    pub(super) application: &'a Application<'a>,
    pub(super) wiring: Option<&'a Wiring>,
}

/// The board for a session, which owns its parts.
fn target(served: &Served<'_>) -> Target {
    let Served { port, file, loaded, application, wiring } = *served;
    Target {
        program: file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        port: port.port.display().to_string(),
        baud: port.baud,
        application: application.clone().into_owned(),
        sources: loaded.programs().iter().map(|loaded| loaded.sources.clone()).collect(),
        wiring: wiring.cloned(),
    }
}

/// Prints the page's address, then serves it until the process is interrupted.
pub(super) fn run(host: Host<Serial>, served: &Served<'_>, address: Address, out: &mut Out) -> Result<()> {
    let Address { listener, port, token } = address;
    let (events, received) = mpsc::channel();
    let mut server = Server::new(host, served, received)?;
    writeln!(out, "http://127.0.0.1:{port}/{token}/")?;
    out.flush()?;
    let gate = Arc::new(Gate::new(port, token));
    std::thread::spawn(move || {
        loop {
            match listener.accept() {
                Ok((stream, _)) => connection::spawn(stream, &gate, &events),
                // The connection was given up before it was accepted, or too many files are open.
                Err(_) => std::thread::sleep(connection::PAUSE),
            }
        }
    });
    server.run();
    Ok(())
}
