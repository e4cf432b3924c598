//! JSON-RPC 2.0, a message a line: requests, answers, and the thread that reads what a client says.

use serde_json::{Map, Value, json};
use std::{
    io::{self, BufRead, BufReader, Read, Write},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel},
    },
    thread,
    time::Duration,
};

/// The versions of the protocol that are spoken, the newest first.
pub(super) const VERSIONS: [&str; 3] = ["2025-06-18", "2025-03-26", "2024-11-05"];

/// Most bytes of a message: an action has a few hundred.
pub(super) const MOST_BYTES: u64 = 1 << 20;

/// Messages that are read ahead of the one that is worked on.
const AHEAD: usize = 64;

/// Cancelled requests that are remembered. A client cancels what it waits for, which are few.
const MOST_CANCELLED: usize = 64;

/// Time between two looks whether to stop.
const LOOK: Duration = Duration::from_millis(20);

/// Returns the version in which a client is answered: its own if it is spoken, else the newest.
pub(super) fn agreed(wanted: &str) -> &'static str {
    VERSIONS.into_iter().find(|version| *version == wanted).unwrap_or(VERSIONS[0])
}

/// An error of the protocol itself, as JSON-RPC numbers them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RpcError {
    code: i64,
    message: String,
}

impl RpcError {
    pub(super) fn no_json(message: impl Into<String>) -> Self {
        Self { code: -32700, message: message.into() }
    }

    pub(super) fn no_request(message: impl Into<String>) -> Self {
        Self { code: -32600, message: message.into() }
    }

    pub(super) fn no_method(message: impl Into<String>) -> Self {
        Self { code: -32601, message: message.into() }
    }

    pub(super) fn bad_params(message: impl Into<String>) -> Self {
        Self { code: -32602, message: message.into() }
    }
}

/// A request, which gets an answer with its number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Request {
    pub(super) id: Value,
    pub(super) method: String,
    pub(super) params: Map<String, Value>,
}

/// A message of a client.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Incoming {
    Request(Request),
    /// A request has been cancelled.
    Cancelled(Value),
    /// It gets an error, and nothing happens.
    Wrong(Value, RpcError),
    /// It gets no answer: other notifications, and answers to requests that were never sent.
    Nothing,
}

/// Reads a line.
fn parsed(line: &[u8]) -> Incoming {
    let line = line.trim_ascii();
    if line.is_empty() {
        return Incoming::Nothing;
    }
    let wrong = |id: Value, error: RpcError| Incoming::Wrong(id, error);
    let message: Value = match serde_json::from_slice(line) {
        Ok(message) => message,
        Err(error) => return wrong(Value::Null, RpcError::no_json(format!("this line is no JSON: {error}"))),
    };
    let Value::Object(mut message) = message else {
        let words = "a message is one object: batches are no part of this protocol, so send one message a line";
        return wrong(Value::Null, RpcError::no_request(words));
    };
    let id = message.remove("id");
    let known = id.clone().filter(|id| id.is_string() || id.is_number()).unwrap_or(Value::Null);
    if message.get("jsonrpc").and_then(Value::as_str) != Some("2.0") {
        return wrong(known, RpcError::no_request("a message has `\"jsonrpc\": \"2.0\"`"));
    }
    let method = match message.remove("method") {
        Some(Value::String(method)) => method,
        None if message.contains_key("result") || message.contains_key("error") => return Incoming::Nothing,
        _ => return wrong(known, RpcError::no_request("a request names its `method`, which is a text")),
    };
    let params = match message.remove("params") {
        None => Map::new(),
        Some(Value::Object(params)) => params,
        // A notification gets no answer.
        Some(_) if id.is_none() => return Incoming::Nothing,
        Some(_) => return wrong(known, RpcError::bad_params(format!("the `params` of `{method}` are an object"))),
    };
    match id {
        None if method == "notifications/cancelled" => {
            params.get("requestId").map_or(Incoming::Nothing, |id| Incoming::Cancelled(id.clone()))
        }
        None => Incoming::Nothing,
        Some(_) if known.is_null() => {
            wrong(Value::Null, RpcError::no_request("the `id` of a request is a text or a number"))
        }
        Some(id) => Incoming::Request(Request { id, method, params }),
    }
}

/// The messages of a client, which a thread reads: it notices a cancelled request while that is worked on.
#[derive(Debug)]
pub(super) struct Inbox {
    messages: Receiver<Incoming>,
    cancelled: Arc<Mutex<Vec<Value>>>,
}

impl Inbox {
    /// Begins to read.
    ///
    /// # Errors
    ///
    /// The system starts no thread.
    pub(super) fn of(input: impl Read + Send + 'static) -> io::Result<Self> {
        let (sender, messages) = sync_channel(AHEAD);
        let cancelled = Arc::<Mutex<Vec<Value>>>::default();
        let noted = cancelled.clone();
        // It ends with the client, or with the program: nothing else wakes a thread that reads.
        thread::Builder::new().name("client".to_owned()).spawn(move || read(input, &sender, &noted))?;
        Ok(Self { messages, cancelled })
    }

    /// Waits for the next message; `None` if the client is gone, or if it is time to stop.
    pub(super) fn next(&self, stops: &dyn Fn() -> bool) -> Option<Incoming> {
        while !stops() {
            match self.messages.recv_timeout(LOOK) {
                Ok(message) => return Some(message),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
        None
    }

    /// Returns whether this request was cancelled.
    pub(super) fn is_cancelled(&self, id: &Value) -> bool {
        self.cancelled.lock().unwrap_or_else(PoisonError::into_inner).contains(id)
    }
}

/// Reads messages until the client is gone, or the session is over.
fn read(input: impl Read, messages: &SyncSender<Incoming>, cancelled: &Mutex<Vec<Value>>) {
    let mut input = BufReader::new(input);
    let mut line = Vec::new();
    loop {
        line.clear();
        match input.by_ref().take(MOST_BYTES).read_until(b'\n', &mut line) {
            Ok(0) => return,
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => return,
        }
        let is_long = line.len() as u64 == MOST_BYTES && !line.ends_with(b"\n");
        if is_long && input.skip_until(b'\n').is_err() {
            return;
        }
        let message = if is_long {
            let words = format!("a message has at most {MOST_BYTES} bytes");
            Incoming::Wrong(Value::Null, RpcError::no_json(words))
        } else {
            parsed(&line)
        };
        if let Incoming::Cancelled(id) = &message {
            let mut cancelled = cancelled.lock().unwrap_or_else(PoisonError::into_inner);
            if cancelled.len() == MOST_CANCELLED {
                cancelled.remove(0);
            }
            cancelled.push(id.clone());
        }
        if messages.send(message).is_err() {
            return;
        }
    }
}

/// Answers a request.
///
/// # Errors
///
/// The client is gone.
pub(super) fn answer(output: &mut dyn Write, id: &Value, answered: Result<Value, RpcError>) -> io::Result<()> {
    let message = match answered {
        Ok(result) => json!({ "jsonrpc": "2.0", "id": id, "result": result }),
        Err(RpcError { code, message }) => {
            json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code, "message": message } })
        }
    };
    // In one piece: a client reads lines.
    output.write_all(format!("{message}\n").as_bytes())?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(line: &str) -> Option<(Value, i64)> {
        match parsed(line.as_bytes()) {
            Incoming::Wrong(id, error) => Some((id, error.code)),
            _ => None,
        }
    }

    #[test]
    fn what_is_no_request_gets_the_number_of_its_error() {
        for (line, id, expected) in [
            ("{", Value::Null, -32700),
            ("\u{fffd}", Value::Null, -32700),
            ("[]", Value::Null, -32600),
            (r#"[{"jsonrpc":"2.0","id":1,"method":"ping"}]"#, Value::Null, -32600),
            ("7", Value::Null, -32600),
            (r#"{"id":1,"method":"ping"}"#, json!(1), -32600),
            (r#"{"jsonrpc":"1.0","id":"a","method":"ping"}"#, json!("a"), -32600),
            (r#"{"jsonrpc":"2.0","id":1}"#, json!(1), -32600),
            (r#"{"jsonrpc":"2.0","id":1,"method":5}"#, json!(1), -32600),
            (r#"{"jsonrpc":"2.0","id":null,"method":"ping"}"#, Value::Null, -32600),
            (r#"{"jsonrpc":"2.0","id":1,"method":"ping","params":[1]}"#, json!(1), -32602),
        ] {
            assert_eq!(code(line), Some((id, expected)), "{line}");
        }
        assert!(matches!(parsed(&[0xff, b'\n']), Incoming::Wrong(..)));
    }

    #[test]
    fn notifications_and_answers_get_no_answer() {
        for line in [
            "",
            "  \r\n",
            r#"{"jsonrpc":"2.0","method":"notifications/initialized"}"#,
            r#"{"jsonrpc":"2.0","method":"notifications/initialized","params":[]}"#,
            r#"{"jsonrpc":"2.0","id":1,"result":{}}"#,
            r#"{"jsonrpc":"2.0","method":"notifications/cancelled","params":{}}"#,
        ] {
            assert_eq!(parsed(line.as_bytes()), Incoming::Nothing, "{line}");
        }
        let cancelled = r#"{"jsonrpc":"2.0","method":"notifications/cancelled","params":{"requestId":4}}"#;
        assert_eq!(parsed(cancelled.as_bytes()), Incoming::Cancelled(json!(4)));
    }

    #[test]
    fn a_client_gets_its_own_version_if_it_is_spoken() {
        assert_eq!(["2024-11-05", "2025-03-26", "2025-06-18"].map(agreed), ["2024-11-05", "2025-03-26", "2025-06-18"]);
        assert_eq!(["2031-01-01", ""].map(agreed), ["2025-06-18"; 2]);
    }

    #[test]
    fn a_line_that_is_too_long_is_skipped_and_the_next_is_read() {
        let long = [vec![b' '; MOST_BYTES as usize + 5], b"\n".to_vec()].concat();
        let next = br#"{"jsonrpc":"2.0","id":1,"method":"ping"}"#;
        let inbox = Inbox::of(io::Cursor::new([&long[..], next].concat())).expect("a thread");
        assert!(matches!(inbox.next(&|| false), Some(Incoming::Wrong(Value::Null, _))));
        assert!(matches!(inbox.next(&|| false), Some(Incoming::Request(_))));
        assert_eq!(inbox.next(&|| false), None, "the client is gone");
    }
}
