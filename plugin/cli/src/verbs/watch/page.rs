//! The page of a watch, and the server that shows it, on this machine alone.
//!
//! The page asks for `/events`, where the server sends all saves and then each one that is new, as server-sent events of
//! HTML's standard. Nothing else is served, nothing is taken from the page, and nothing is loaded from elsewhere.

use crate::{error::CliError, verbs::watch::saves::Save};
use playbot_report::{PAGE_STYLE, escape::escape};
use playbot_test::verdict_report::STYLE;
use std::{
    collections::BTreeMap,
    io::{self, Read, Write},
    net::{Ipv4Addr, TcpListener, TcpStream},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

/// Style of this page, after that of reports.
const OWN_STYLE: &str = include_str!("watch.css");

/// The script of the page.
const SCRIPT: &str = include_str!("watch.js");

/// The page without style and script.
const BODY: &str = include_str!("watch.html");

/// Longest request, bytes.
const MOST_BYTES: usize = 16 << 10;

/// Longest wait for a request, and for a browser that takes what it is sent.
const PATIENCE: Duration = Duration::from_secs(2);

/// A page that is shown until the program ends.
pub(super) struct Page {
    port: u16,
    /// Whether it is another port than the usual one.
    pub is_other: bool,
    shared: Arc<Shared>,
}

/// What the threads of the server share.
struct Shared {
    html: String,
    port: u16,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// Each save as JSON, by its number.
    saves: BTreeMap<u64, String>,
    /// Browsers that listen.
    listeners: Vec<TcpStream>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Page {
    /// Opens the page at the port that is named, or else at the usual one, or at any that is free if it is taken.
    ///
    /// # Errors
    ///
    /// The port that is named is taken, or the system allows none.
    pub fn open(named: Option<u16>, usual: u16, game: &str, saves: &[Save]) -> Result<Self, CliError> {
        let bind = |port| TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let (bound, is_other) = match (bind(named.unwrap_or(usual)), named) {
            (Err(error), None) if error.kind() == io::ErrorKind::AddrInUse => (bind(0), true),
            (bound, _) => (bound, false),
        };
        let port = named.unwrap_or(usual);
        let failed = |error: io::Error| match error.kind() {
            io::ErrorKind::AddrInUse => {
                CliError::Usage(format!("port {port} is taken: name another with --port, or any with --port 0"))
            }
            _ => CliError::Io(format!("the page cannot be served at port {port}: {error}; name another with --port")),
        };
        let listener = bound.map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let html = BODY
            .replace("{game}", &escape(game))
            .replace("{style}", &format!("{PAGE_STYLE}{STYLE}{OWN_STYLE}"))
            .replace("{script}", SCRIPT);
        let state = State { saves: saves.iter().map(|save| (save.number, json(save))).collect(), ..State::default() };
        let shared = Arc::new(Shared { html, port, state: Mutex::new(state) });
        let serving = Arc::clone(&shared);
        let serve = move || {
            for stream in listener.incoming().flatten() {
                let shared = Arc::clone(&serving);
                // A browser that is refused asks again.
                let _ = thread::Builder::new().name("page".to_owned()).spawn(move || answer(stream, &shared));
            }
        };
        thread::Builder::new().name("page".to_owned()).spawn(serve).map_err(failed)?;
        Ok(Self { port, is_other, shared })
    }

    /// Returns its address.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    /// Shows a save, which replaces what was known of it.
    pub fn publish(&self, save: &Save) {
        let text = json(save);
        let mut state = self.shared.lock();
        state.listeners.retain_mut(|listener| send(listener, "save", &text).is_ok());
        state.saves.insert(save.number, text);
    }
}

fn json(save: &Save) -> String {
    // The types have no maps with other keys than words, and no numbers that JSON lacks.
    serde_json::to_string(save).unwrap_or_else(|_| "null".to_owned())
}

/// Sends an event. Its data have no line break, as JSON has none.
fn send(listener: &mut TcpStream, event: &str, data: &str) -> io::Result<()> {
    listener.write_all(format!("event: {event}\ndata: {data}\n\n").as_bytes())
}

/// Answers one request. A browser that has gone needs no answer, so errors end it.
fn answer(mut stream: TcpStream, shared: &Shared) {
    let Ok(Some(request)) = read_request(&mut stream) else { return };
    // A page of somebody else's could ask under a name that leads here.
    let is_ours = ["127.0.0.1", "localhost"].iter().any(|name| request.host == format!("{name}:{}", shared.port));
    let is_read = ["GET", "HEAD"].contains(&request.method.as_str());
    let path = request.path.split('?').next().unwrap_or_default();
    let _ = match path {
        _ if !is_ours => plain(&mut stream, "403 Forbidden", "This page is at 127.0.0.1 alone."),
        _ if !is_read => plain(&mut stream, "405 Method Not Allowed", "This page is only read."),
        "/" => {
            let policy =
                "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'";
            let kind = "text/html; charset=utf-8";
            write_answer(&mut stream, "200 OK", kind, &format!("Content-Security-Policy: {policy}\r\n"), &shared.html)
        }
        "/events" => listen(stream, shared),
        _ => plain(&mut stream, "404 Not Found", "There is nothing here: the page is /."),
    };
}

/// Sends all saves to a browser, and keeps it among those that hear of new ones.
fn listen(mut stream: TcpStream, shared: &Shared) -> io::Result<()> {
    let head = "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\nretry: 300\n\n";
    stream.write_all(head.as_bytes())?;
    let mut state = shared.lock();
    let all: Vec<&str> = state.saves.values().map(String::as_str).collect();
    send(&mut stream, "all", &format!("[{}]", all.join(",")))?;
    state.listeners.push(stream);
    Ok(())
}

fn plain(stream: &mut TcpStream, status: &str, words: &str) -> io::Result<()> {
    write_answer(stream, status, "text/plain; charset=utf-8", "", &format!("{words}\n"))
}

fn write_answer(stream: &mut TcpStream, status: &str, kind: &str, more: &str, body: &str) -> io::Result<()> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\n{more}Connection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())
}

/// The parts of a request that matter.
struct Request {
    method: String,
    path: String,
    host: String,
}

/// Reads the head of a request; `None` if it is none, or too long.
fn read_request(stream: &mut TcpStream) -> io::Result<Option<Request>> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    // An event is to arrive at once.
    stream.set_nodelay(true)?;
    let mut bytes = Vec::new();
    let mut piece = [0; 2048];
    while bytes.len() < MOST_BYTES {
        let count = stream.read(&mut piece)?;
        bytes.extend_from_slice(&piece[..count]);
        let mut headers = [httparse::EMPTY_HEADER; 64];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(&bytes) {
            Ok(httparse::Status::Complete(_)) => {
                let host = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case("host"));
                let host = host.map(|header| String::from_utf8_lossy(header.value).into_owned());
                let [method, path] = [request.method, request.path].map(|word| word.unwrap_or_default().to_owned());
                return Ok(Some(Request { method, path, host: host.unwrap_or_default() }));
            }
            Ok(httparse::Status::Partial) if count > 0 => {}
            _ => return Ok(None),
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};

    fn open() -> Page {
        Page::open(Some(0), 0, "coin<run>", &[Save::new(1)]).expect("a free port")
    }

    fn ask(page: &Page, method: &str, path: &str, host: &str) -> TcpStream {
        let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, page.port)).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
        stream.write_all(format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).expect("it reads");
        stream
    }

    fn answered(page: &Page, method: &str, path: &str, host: &str) -> String {
        let mut text = String::new();
        ask(page, method, path, host).read_to_string(&mut text).expect("it answers");
        text
    }

    #[test]
    fn the_page_is_served_to_this_machine_alone() {
        let page = open();
        let host = format!("127.0.0.1:{}", page.port);
        let text = answered(&page, "GET", "/", &host);
        assert!(text.starts_with("HTTP/1.1 200") && text.contains("coin&lt;run&gt;"), "{text}");
        for words in ["http:", "https:", "src=\"", "url(", "@import"] {
            assert!(!text.replace("http://www.w3.org/2000/svg", "").contains(words), "{words}");
        }
        let localhost = format!("localhost:{}", page.port);
        assert!(answered(&page, "GET", "/", &localhost).starts_with("HTTP/1.1 200"));
        for (method, path, host, status) in [
            ("GET", "/", "somewhere.example", "403"),
            ("GET", "/", "", "403"),
            ("POST", "/", host.as_str(), "405"),
            ("GET", "/../Cargo.toml", host.as_str(), "404"),
        ] {
            let text = answered(&page, method, path, host);
            assert!(text.starts_with(&format!("HTTP/1.1 {status}")), "{method} {path} {host}: {text}");
        }
    }

    #[test]
    fn listeners_hear_of_all_saves_and_may_go_away() {
        let page = open();
        let host = format!("127.0.0.1:{}", page.port);
        drop(ask(&page, "GET", "/events", &host));
        let mut lines = BufReader::new(ask(&page, "GET", "/events", &host)).lines().map(|line| line.expect("a line"));
        assert!(lines.any(|line| line == "event: all"));
        let all = lines.next().expect("its data");
        assert!(all.starts_with("data: [{\"number\":1,"), "{all}");
        for number in 2..5 {
            page.publish(&Save::new(number));
            assert!(lines.any(|line| line == "event: save"));
            let data = lines.next().expect("its data");
            assert!(data.starts_with(&format!("data: {{\"number\":{number},")), "{data}");
        }
    }

    #[test]
    fn a_port_that_is_taken_is_refused_by_name_and_else_another_one_is_found() {
        let taken = open();
        let error = Page::open(Some(taken.port), 0, "a", &[]).err().map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.contains("is taken: name another with --port")));
        let other = Page::open(None, taken.port, "a", &[]).expect("another port");
        assert!(other.is_other && other.port != taken.port);
    }

    #[test]
    fn what_is_no_request_gets_no_answer() {
        let page = open();
        for bytes in [&b"\x16\x03\x01\x02\x00\x01\x00"[..], &[b'a'; 40_000], b"GET"] {
            let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, page.port)).expect("it listens");
            // It may hang up before it has read all.
            let _ = stream.write_all(bytes);
            let _ = stream.shutdown(std::net::Shutdown::Write);
            let mut text = Vec::new();
            let _ = stream.read_to_end(&mut text);
            assert!(text.is_empty());
        }
        assert!(answered(&page, "GET", "/", &format!("localhost:{}", page.port)).starts_with("HTTP/1.1 200"));
    }
}
