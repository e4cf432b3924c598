//! The page of a watch, and the server that shows it, on this machine alone.
//!
//! The page asks for `/events`, where the server sends all saves and then each one that is new, as server-sent events of
//! HTML's standard. Nothing else is served, nothing is taken from the page, and nothing is loaded from elsewhere.

use crate::{
    error::CliError,
    loopback::{Answer, Loopback},
    verbs::watch::saves::Save,
};
use playbot_report::{PAGE_STYLE, escape::escape};
use playbot_test::verdict_report::STYLE;
use std::{
    collections::BTreeMap,
    io::{self, Write},
    net::TcpStream,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{self, Sender},
    },
};

/// Style of this page, after that of reports.
const OWN_STYLE: &str = include_str!("watch.css");

/// The script of the page.
const SCRIPT: &str = include_str!("watch.js");

/// The page without style and script.
const BODY: &str = include_str!("watch.html");

/// A page that is shown until the program ends.
pub(super) struct Page {
    server: Loopback,
    state: Arc<Mutex<State>>,
}

#[derive(Default)]
struct State {
    /// Each save as JSON, by its number.
    saves: BTreeMap<u64, Arc<str>>,
    /// Browsers that listen, each on a thread of its own: one that reads slowly keeps neither the watch nor others waiting.
    listeners: Vec<Sender<Arc<str>>>,
}

impl Page {
    /// Opens the page at the port that is named, or else at the usual one, or at any that is free if it is taken.
    ///
    /// # Errors
    ///
    /// The port that is named is taken, or the system allows none.
    pub fn open(named: Option<u16>, usual: u16, game: &str, saves: &[Save]) -> Result<Self, CliError> {
        let html = BODY
            .replace("{game}", &escape(game))
            .replace("{style}", &format!("{PAGE_STYLE}{STYLE}{OWN_STYLE}"))
            .replace("{script}", SCRIPT);
        let saves = saves.iter().map(|save| (save.number, json(save))).collect();
        let state = Arc::new(Mutex::new(State { saves, ..State::default() }));
        let shared = Arc::clone(&state);
        let server = Loopback::open(named, usual, move |request, answer| match request.path.as_str() {
            _ if request.method == "POST" => answer.only_read(),
            "/" => answer.html(&html),
            // A browser that has gone needs no answer.
            "/events" => drop(listen(answer, &shared)),
            _ => answer.missing(),
        })?;
        Ok(Self { server, state })
    }

    /// Returns its address.
    pub fn address(&self) -> String {
        self.server.address()
    }

    /// Returns whether it is at another port than the usual one.
    pub fn is_other(&self) -> bool {
        self.server.is_other
    }

    /// Shows a save, which replaces what was known of it.
    pub fn publish(&self, save: &Save) {
        let text = json(save);
        let mut state = lock(&self.state);
        state.listeners.retain(|listener| listener.send(Arc::clone(&text)).is_ok());
        state.saves.insert(save.number, text);
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn json(save: &Save) -> Arc<str> {
    // The types have no maps with other keys than words, and no numbers that JSON lacks.
    serde_json::to_string(save).unwrap_or_else(|_| "null".to_owned()).into()
}

/// Sends an event. Its data have no line break, as JSON has none.
fn send(listener: &mut TcpStream, event: &str, data: &str) -> io::Result<()> {
    listener.write_all(format!("event: {event}\ndata: {data}\n\n").as_bytes())
}

/// Sends all saves to a browser, and then each new one, until it has gone or reads too slowly.
fn listen(answer: Answer, state: &Mutex<State>) -> io::Result<()> {
    let mut stream = answer.events()?;
    let (sender, fresh) = mpsc::channel();
    let all = {
        let mut state = lock(state);
        // Under the same lock, so that no save is lost in between.
        state.listeners.push(sender);
        let all: Vec<&str> = state.saves.values().map(AsRef::as_ref).collect();
        format!("[{}]", all.join(","))
    };
    send(&mut stream, "all", &all)?;
    fresh.iter().try_for_each(|text| send(&mut stream, "save", &text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{
        io::{BufRead, BufReader, Read},
        time::Duration,
    };

    fn open() -> Page {
        Page::open(Some(0), 0, "coin<run>", &[Save::new(1)]).expect("a free port")
    }

    fn ask(page: &Page, method: &str, path: &str) -> TcpStream {
        let host = format!("127.0.0.1:{}", page.server.port);
        let mut stream = TcpStream::connect(&host).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
        stream.write_all(format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).expect("it reads");
        stream
    }

    fn answered(page: &Page, method: &str, path: &str) -> String {
        let mut text = String::new();
        ask(page, method, path).read_to_string(&mut text).expect("it answers");
        text
    }

    #[test]
    fn the_page_loads_nothing_and_is_only_read() {
        let page = open();
        let text = answered(&page, "GET", "/");
        assert!(text.starts_with("HTTP/1.1 200") && text.contains("coin&lt;run&gt;"), "{text}");
        for words in ["http:", "https:", "src=\"", "url(", "@import"] {
            let own = text.replace("http://www.w3.org/2000/svg", "").replace("url(#", "");
            assert!(!own.contains(words), "{words}");
        }
        assert!(answered(&page, "POST", "/").starts_with("HTTP/1.1 405"));
        assert!(answered(&page, "GET", "/../Cargo.toml").starts_with("HTTP/1.1 404"));
    }

    #[test]
    fn listeners_hear_of_all_saves_and_may_go_away() {
        let page = open();
        drop(ask(&page, "GET", "/events"));
        let mut lines = BufReader::new(ask(&page, "GET", "/events")).lines().map(|line| line.expect("a line"));
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
    fn a_browser_that_does_not_read_keeps_neither_the_watch_nor_others_waiting() {
        let page = open();
        let slow = ask(&page, "GET", "/events");
        let mut lines = BufReader::new(ask(&page, "GET", "/events")).lines().map(|line| line.expect("a line"));
        assert!(lines.any(|line| line == "event: all"));
        // More than a connection holds.
        let problem = "x".repeat(1 << 20);
        for number in 2..34 {
            page.publish(&Save { problem: Some(problem.clone()), ..Save::new(number) });
        }
        assert!(lines.any(|line| line.starts_with("data: {\"number\":33,")), "the other one hears of all");
        drop(slow);
    }

    #[test]
    fn the_legend_explains_what_is_drawn_alone() {
        let drawn: Vec<String> = BODY
            .split("data-of=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next())
            .map(|words| words.replace("&quot;", "\""))
            .collect();
        assert_eq!(drawn.len(), 8, "{drawn:?}");
        let explained =
            |svg: &str| drawn.iter().filter(|words| svg.contains(words.as_str())).cloned().collect::<Vec<String>>();
        assert_eq!(explained("<path class=\"way\" d=\"M1 1\"/>"), ["class=\"way\""]);
        assert_eq!(explained("<path class=\"way lost-way\" d=\"M1 1\"/>"), ["class=\"way lost-way\""]);
        assert_eq!(explained("<circle class=\"start\" cx=\"1\"/>"), ["class=\"start\""]);
    }
}
