//! A server of pages for this machine alone.
//!
//! Requests come from browsers on this machine, under the server's own name: a foreign page that leads here is refused.

use crate::error::CliError;
use serde_json::{Value, json};
use std::{
    io::{self, Read, Write},
    net::{Ipv4Addr, TcpListener, TcpStream},
    sync::Arc,
    thread,
    time::Duration,
};

/// Longest request, bytes.
const MOST_BYTES: usize = 16 << 10;

/// Longest wait for a request, and for a browser that takes what it is sent.
const PATIENCE: Duration = Duration::from_secs(2);

/// A server that runs until the program ends.
pub(crate) struct Loopback {
    pub port: u16,
    /// Whether it is another port than the usual one.
    pub is_other: bool,
}

/// A request.
#[derive(Debug, Default)]
pub(crate) struct Request {
    pub method: String,
    /// The path, without the query.
    pub path: String,
    /// What follows the path behind a question mark; may be empty.
    pub query: String,
    pub body: Vec<u8>,
    pub host: String,
    pub origin: Option<String>,
}

/// The answer to a request, which is still to be given.
pub(crate) struct Answer(TcpStream);

impl Loopback {
    /// Serves at the port that is named, or else at the usual one, or at any that is free if it is taken. `answer` runs on
    /// a thread of its own for each request.
    ///
    /// # Errors
    ///
    /// The port that is named is taken, or the system allows none.
    pub fn open(
        named: Option<u16>,
        usual: u16,
        answer: impl Fn(Request, Answer) + Send + Sync + 'static,
    ) -> Result<Self, CliError> {
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
        let respond = Arc::new(answer);
        let serve = move || {
            for stream in listener.incoming().flatten() {
                let respond = Arc::clone(&respond);
                // A browser that is refused asks again.
                let _ = thread::Builder::new().name("page".to_owned()).spawn(move || hear(stream, port, &*respond));
            }
        };
        thread::Builder::new().name("page".to_owned()).spawn(serve).map_err(failed)?;
        Ok(Self { port, is_other })
    }

    /// Returns its address.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }
}

/// Reads a request and has it answered. A browser that has gone needs no answer.
fn hear(mut stream: TcpStream, port: u16, respond: &dyn Fn(Request, Answer)) {
    let Ok(Some(request)) = read_request(&mut stream) else { return };
    let answer = Answer(stream);
    let own = own_hosts(port);
    // A foreign page could ask under a name that leads here, or send a form.
    let is_ours = own.contains(&request.host)
        && request.origin.as_ref().is_none_or(|origin| own.iter().any(|own| *origin == format!("http://{own}")));
    let is_known = ["GET", "HEAD", "POST"].contains(&request.method.as_str());
    match (is_ours, is_known) {
        (false, _) => answer.plain("403 Forbidden", "This page is at 127.0.0.1 alone."),
        (true, false) => answer.plain("405 Method Not Allowed", "This page is only read."),
        (true, true) => respond(request, answer),
    }
}

/// Returns the names by which browsers ask for a port of this machine.
fn own_hosts(port: u16) -> Vec<String> {
    let names = ["127.0.0.1", "localhost"];
    let mut hosts: Vec<String> = names.iter().map(|name| format!("{name}:{port}")).collect();
    // Browsers leave out the usual port of their protocol.
    if port == 80 {
        hosts.extend(names.map(str::to_owned));
    }
    hosts
}

impl Answer {
    /// Answers with a page, which may load nothing from elsewhere.
    pub fn html(mut self, html: &str) {
        let policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; \
                      img-src data:";
        let more = format!("Content-Security-Policy: {policy}\r\n");
        let _ = write_answer(&mut self.0, "200 OK", "text/html; charset=utf-8", &more, html);
    }

    /// Answers with JSON.
    pub fn json(mut self, value: &Value) {
        let _ = write_answer(&mut self.0, "200 OK", "application/json", "", &value.to_string());
    }

    /// Answers with JSON that has an `error`.
    pub fn failed(mut self, words: &str) {
        let value = json!({ "error": words }).to_string();
        let _ = write_answer(&mut self.0, "422 Unprocessable Content", "application/json", "", &value);
    }

    /// Answers that there is nothing.
    pub fn missing(self) {
        self.plain("404 Not Found", "There is nothing here: the page is /.");
    }

    /// Answers that the page is only read.
    pub fn only_read(self) {
        self.plain("405 Method Not Allowed", "This page is only read.");
    }

    /// Begins an answer that goes on: events that the server sends, of HTML's standard.
    ///
    /// # Errors
    ///
    /// The browser has gone.
    pub fn events(mut self) -> io::Result<TcpStream> {
        let head = "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n\
                    Connection: close\r\n\r\nretry: 300\n\n";
        self.0.write_all(head.as_bytes())?;
        Ok(self.0)
    }

    fn plain(mut self, status: &str, words: &str) {
        let _ = write_answer(&mut self.0, status, "text/plain; charset=utf-8", "", &format!("{words}\n"));
    }
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

/// Reads a request; `None` if it is none, or too long.
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
        let mut parsed = httparse::Request::new(&mut headers);
        match parsed.parse(&bytes) {
            Ok(httparse::Status::Complete(head)) => {
                let header = |name: &str| {
                    let found = parsed.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
                    found.map(|header| String::from_utf8_lossy(header.value).into_owned())
                };
                let length = header("content-length").and_then(|length| length.parse().ok()).unwrap_or(0_usize);
                if head + length > MOST_BYTES {
                    return Ok(None);
                }
                if bytes.len() < head + length && count > 0 {
                    continue;
                }
                let path = parsed.path.unwrap_or_default();
                let (path, query) = path.split_once('?').unwrap_or((path, ""));
                return Ok(Some(Request {
                    method: parsed.method.unwrap_or_default().to_owned(),
                    path: path.to_owned(),
                    query: query.to_owned(),
                    host: header("host").unwrap_or_default(),
                    origin: header("origin"),
                    body: bytes[head..bytes.len().min(head + length)].to_vec(),
                }));
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

    fn open() -> Loopback {
        Loopback::open(Some(0), 0, |request, answer| match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/") => answer.html("<p>here</p>"),
            ("POST", "/") => answer.json(&json!({ "query": request.query, "length": request.body.len() })),
            _ => answer.missing(),
        })
        .expect("a free port")
    }

    fn sent(server: &Loopback, bytes: &[u8]) -> String {
        let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, server.port)).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
        // It may hang up before it has read all.
        let _ = stream.write_all(bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut text = Vec::new();
        let _ = stream.read_to_end(&mut text);
        String::from_utf8_lossy(&text).into_owned()
    }

    #[test]
    fn only_browsers_of_this_machine_under_its_own_name_are_answered() {
        let server = open();
        let host = format!("127.0.0.1:{}", server.port);
        let ask = |first: &str, more: &str| sent(&server, format!("{first} HTTP/1.1\r\n{more}\r\n\r\n").as_bytes());
        assert!(ask("GET /", &format!("Host: {host}")).contains("<p>here</p>"));
        assert!(ask("GET /", &format!("Host: localhost:{}", server.port)).starts_with("HTTP/1.1 200"));
        for (first, more, status) in [
            ("GET /", "Host: somewhere.example".to_owned(), "403"),
            ("GET /", "Accept: */*".to_owned(), "403"),
            ("POST /", format!("Host: {host}\r\nOrigin: http://somewhere.example"), "403"),
            ("DELETE /", format!("Host: {host}"), "405"),
            ("GET /../Cargo.toml", format!("Host: {host}"), "404"),
        ] {
            let text = ask(first, &more);
            assert!(text.starts_with(&format!("HTTP/1.1 {status}")), "{first} {more}: {text}");
        }
    }

    #[test]
    fn the_usual_port_of_browsers_may_be_left_out() {
        assert_eq!(own_hosts(80), ["127.0.0.1:80", "localhost:80", "127.0.0.1", "localhost"]);
        assert_eq!(own_hosts(8080), ["127.0.0.1:8080", "localhost:8080"]);
    }

    #[test]
    fn a_body_is_read_to_its_end_and_what_is_no_request_gets_no_answer() {
        let server = open();
        let host = format!("127.0.0.1:{}", server.port);
        let head =
            format!("POST /?a=1 HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nContent-Length: 3000\r\n\r\n");
        let text = sent(&server, &[head.as_bytes(), &[b'x'; 3000]].concat());
        assert!(text.ends_with(r#"{"length":3000,"query":"a=1"}"#), "{text}");
        for bytes in [&b"\x16\x03\x01\x02\x00\x01\x00"[..], &[b'a'; 40_000], b"GET"] {
            assert_eq!(sent(&server, bytes), "");
        }
    }

    #[test]
    fn a_port_that_is_taken_is_refused_by_name_and_else_another_one_is_found() {
        let taken = open();
        let none = |_: Request, _: Answer| {};
        let error = Loopback::open(Some(taken.port), 0, none).err().map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.contains("is taken: name another with --port")));
        let other = Loopback::open(None, taken.port, none).expect("another port");
        assert!(other.is_other && other.port != taken.port);
    }
}
