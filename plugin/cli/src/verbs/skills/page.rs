//! The page, its server on this machine, and the same page as a file.
//!
//! The page asks for `/about`, for `/tile?z=0.1,-0.5` and, with POST, for `/name`. What it asks for is answered on the
//! thread that has the game.

use crate::{
    error::CliError,
    loopback::{Answer, Loopback, Request},
    verbs::skills::{SkillNames, rollouts::Rollout},
};
use bevy_playbot::skill_prior::NamedSkill;
use playbot_report::{PAGE_STYLE, escape::escape};
use serde_json::{Value, json};
use std::{
    sync::{
        Mutex, PoisonError,
        mpsc::{Receiver, channel},
    },
    time::Duration,
};

const OWN_STYLE: &str = include_str!("skills.css");
const SCRIPT: &str = include_str!("skills.js");
const BODY: &str = include_str!("skills.html");

/// Time after which the thread with the game looks for Ctrl-C.
const GLANCE: Duration = Duration::from_millis(100);

/// What the page asks for.
pub(super) enum Ask {
    About,
    Tile(Vec<f32>),
    Name(NamedSkill),
}

/// A page that is shown until the program ends.
pub(super) struct Page {
    server: Loopback,
    asked: Mutex<Receiver<(Ask, Answer)>>,
}

impl Page {
    /// Opens the page at the port that is named, or else at the usual one, or at any that is free if it is taken.
    ///
    /// # Errors
    ///
    /// The port that is named is taken, or the system allows none.
    pub fn open(named: Option<u16>, usual: u16) -> Result<Self, CliError> {
        let (send, asked) = channel();
        let html = html("Skills", "null");
        let server = Loopback::open(named, usual, move |request, answer| {
            let ask = match (request.method.as_str(), request.path.as_str()) {
                ("GET", "/") => return answer.html(&html),
                ("GET", "/about") => Some(Ask::About),
                ("GET", "/tile") => skill(&request).map(Ask::Tile),
                ("POST", "/name") => serde_json::from_slice(&request.body).ok().map(Ask::Name),
                _ => return answer.missing(),
            };
            match ask {
                // The game is gone if the program ends.
                Some(ask) => drop(send.send((ask, answer))),
                None => answer.failed("this cannot be read"),
            }
        })?;
        Ok(Self { server, asked: Mutex::new(asked) })
    }

    pub fn address(&self) -> String {
        self.server.address()
    }

    pub fn is_other(&self) -> bool {
        self.server.is_other
    }

    /// Returns what the page asks for next; `None` if it asks for nothing for a while.
    pub fn next(&self) -> Option<(Ask, Answer)> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(GLANCE).ok()
    }
}

/// Reads the values of z in a request.
fn skill(request: &Request) -> Option<Vec<f32>> {
    let z = request.query.split('&').find_map(|part| part.strip_prefix("z="))?;
    z.replace("%2C", ",").split(',').map(|value| value.parse().ok()).collect()
}

/// Returns the page as one file, with all tiles in it.
pub(super) fn as_file(about: &Value, skills: &[Vec<f32>], tiles: &[Rollout], names: &SkillNames) -> String {
    let tiles: Vec<Value> = skills.iter().zip(tiles).map(|(z, tile)| tile.with_picture(z, names)).collect();
    let data = json!({ "about": about, "skills": skills, "names": names.regions, "tiles": tiles });
    html(about["game"].as_str().unwrap_or_default(), &data.to_string())
}

fn html(title: &str, data: &str) -> String {
    // A script ends at its closing tag, wherever that stands.
    let data = data.replace('<', "\\u003c");
    BODY.replace("{title}", &escape(title))
        .replace("{style}", &format!("{PAGE_STYLE}{OWN_STYLE}"))
        .replace("{script}", SCRIPT)
        .replace("{data}", &data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(query: &str) -> Request {
        Request { query: query.to_owned(), ..Request::default() }
    }

    #[test]
    fn skills_are_read_from_addresses() {
        assert_eq!(skill(&request("z=0.5,-1")), Some(vec![0.5, -1.0]));
        assert_eq!(skill(&request("a=1&z=0.5%2C-1")), Some(vec![0.5, -1.0]));
        assert_eq!(skill(&request("z=0.5,x")), None);
        assert_eq!(skill(&request("")), None);
    }

    #[test]
    fn a_name_cannot_end_the_script() {
        let names =
            SkillNames { regions: vec![NamedSkill { name: "</script>".to_owned(), z: vec![0.0], radius: 1.0 }] };
        let page = as_file(&json!({ "game": "a<b" }), &[], &[], &names);
        assert_eq!(page.matches("</script>").count(), BODY.matches("</script>").count());
        assert!(page.contains("a&lt;b"));
    }
}
