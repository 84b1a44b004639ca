//! The page's server.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::sync::Arc;
use std::thread::JoinHandle;

use tiny_http::{Header, Method, Response, StatusCode};

use super::guard::Guard;
use super::{Handle, Request, page, stream};
use crate::error::{Error, Result};

/// Of a request's body more is not read.
const LARGEST: u64 = 4096;

/// Said with every answer: nothing is kept, nothing is guessed, nobody else may look.
const ALWAYS: [(&str, &str); 4] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
];

type Answer = Response<std::io::Cursor<Vec<u8>>>;

/// A running server, ended when dropped.
pub struct Server {
    http: Arc<tiny_http::Server>,
    guard: Arc<Guard>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves the page on the loopback interface, at this port or any that is free if it is 0.
    pub fn start(handle: Handle, port: u16) -> Result<Self> {
        let refused = |e: &dyn std::fmt::Display| {
            Error::Usage(format!(
                "port {port} of 127.0.0.1 cannot be served: {e}; leave --http out, or choose another port"
            ))
        };
        let place = SocketAddrV4::new(Ipv4Addr::LOCALHOST, port);
        let server = tiny_http::Server::http(place).map_err(|e| refused(&e))?;
        let port = server.server_addr().to_ip().map(|address| address.port());
        let port = port.ok_or_else(|| refused(&"it has no number"))?;
        let server = Arc::new(server);
        let guard = Arc::new(Guard::new(port));
        let thread = {
            let (server, guard) = (Arc::clone(&server), Arc::clone(&guard));
            std::thread::spawn(move || {
                for request in server.incoming_requests() {
                    // None waits for another: one may be slow, and the next may be a stop.
                    let (handle, guard) = (handle.clone(), Arc::clone(&guard));
                    std::thread::spawn(move || serve(&handle, &guard, request));
                }
            })
        };
        Ok(Self {
            http: server,
            guard,
            thread: Some(thread),
        })
    }

    /// The address of the page.
    pub fn address(&self) -> String {
        self.guard.address()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.http.unblock();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn serve(handle: &Handle, guard: &Guard, mut request: tiny_http::Request) {
    let header = |name: &'static str| {
        let found = request.headers().iter().find(|h| h.field.equiv(name));
        found.map(|h| h.value.as_str().to_owned())
    };
    let (host, origin) = (header("Host"), header("Origin"));
    let path = request.url().to_owned();
    let admitted = guard.admit(&path, host.as_deref(), origin.as_deref());
    let answer = match (admitted, request.method()) {
        (Err(denial), _) => said(403, denial.text()),
        (Ok(""), Method::Get) => shown(),
        (Ok("events"), Method::Get) => return follow(handle, request),
        (Ok("stop"), Method::Post) => {
            handle.stop();
            said(204, "")
        }
        (Ok("do"), Method::Post) => match asked(&mut request) {
            Ok(wish) => {
                handle.ask(wish);
                said(204, "")
            }
            Err(why) => said(400, &format!("400: {why}")),
        },
        (Ok("" | "events" | "stop" | "do"), _) => said(405, "405: not by this method"),
        (Ok(_), _) => said(404, "404: there is no such page"),
    };
    // Fails only if nobody waits for it any more.
    let _ = request.respond(answer);
}

/// What a body asks for.
fn asked(request: &mut tiny_http::Request) -> std::result::Result<Request, String> {
    let mut body = Vec::new();
    let read = request.as_reader().take(LARGEST).read_to_end(&mut body);
    read.map_err(|e| e.to_string())?;
    serde_json::from_slice(&body).map_err(|e| e.to_string())
}

fn said(status: u16, text: &str) -> Answer {
    let answer = Response::from_string(text).with_status_code(StatusCode(status));
    ALWAYS.into_iter().fold(answer, with)
}

fn with(answer: Answer, (name, value): (&str, &str)) -> Answer {
    match Header::from_bytes(name, value) {
        Ok(header) => answer.with_header(header),
        // All names and values are ASCII.
        Err(()) => answer,
    }
}

fn shown() -> Answer {
    let page = page::fresh();
    let answer = said(200, &page.html);
    let answer = with(answer, ("Content-Type", "text/html; charset=utf-8"));
    with(answer, ("Content-Security-Policy", &page.policy))
}

/// Sends events, without knowing how many, by hand.
fn follow(handle: &Handle, request: tiny_http::Request) {
    let mut out = request.into_writer();
    let lines = [
        ("Content-Type", "text/event-stream"),
        ("Connection", "close"),
    ];
    let lines = lines.into_iter().chain(ALWAYS);
    let lines: String = lines
        .flat_map(|(name, value)| [name, ": ", value, "\r\n"])
        .collect();
    let sent = write!(out, "HTTP/1.1 200 OK\r\n{lines}\r\n");
    // Fails when the page is gone.
    let _ = sent.and_then(|()| stream::send(handle, &mut out));
}
