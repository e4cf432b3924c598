//! The page, its server on this machine, and the same page as a file; and the rollouts on it.
//!
//! The page asks for `/about`, for `/tile?z=0.1,-0.5` and, with POST, for `/name`. What it asks for is answered on the
//! thread that has the game: a tile is the rollout of a skill from the state.

use crate::{
    error::CliError,
    loopback::{Answer, Loopback, Request},
    pictures::{
        Film,
        caption::{NumberBars, Reach},
        episode_world::EpisodeWorld,
    },
    verbs::skills::SkillNames,
};
use bevy_playbot::{episode::EpisodeEnd, skill_prior::NamedSkill, vision::ObservationConfig};
use playbot_harness::{eval::Player, game::Game};
use playbot_learner::{SkillDraw, rng};
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

// The state, and the rollout of a skill from it.

/// Rollouts of skills from one state. Each begins at the start of the level, so that all share the same state.
pub(super) struct Rollouts<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    pub seed: u64,
    pub player: &'a Player,
    pub observation_config: ObservationConfig,
    /// Tick at which a skill begins.
    pub tick: u32,
    /// Ticks for which it is followed.
    pub ticks: u32,
    pub scale: u32,
}

/// What a skill does.
pub(super) struct Rollout {
    /// An animated PNG.
    pub picture: Vec<u8>,
    /// Sum of rewards, from the state on.
    pub sum: f64,
    /// Ticks that were played from the state on.
    pub ticks: u32,
    /// The end, if the episode ended.
    pub end: Option<EpisodeEnd>,
    /// Positions of the agent, if the game reports them.
    pub path: Vec<[f32; 2]>,
}

impl Rollouts<'_> {
    /// Returns the number of values of a skill.
    pub fn latent(&self) -> usize {
        match self.player {
            Player::Policy { prior: Some(prior), .. } => prior.prior.latent(),
            _ => 0,
        }
    }

    /// Plays up to the state.
    fn state(&self) -> Result<EpisodeWorld, CliError> {
        let Self { game, mode, level, seed, player, .. } = *self;
        let mut world = EpisodeWorld::playing(game, mode, &self.observation_config, level, player, seed)?;
        while world.ticks() < self.tick {
            if world.next()?.is_none() {
                return Err(CliError::Usage(format!(
                    "there is no tick {}: the policy ends level {level} after {} ticks",
                    self.tick,
                    world.ticks()
                )));
            }
        }
        Ok(world)
    }

    /// Follows a skill from the state on.
    pub fn of(&mut self, z: &[f32], names: &SkillNames) -> Result<Rollout, CliError> {
        let mut world = self.state()?;
        world.name_skills(names.regions.clone());
        world.follow(z);
        let (mut steps, mut reach, mut path) = (Vec::new(), Reach::default(), Vec::new());
        // Before the first tick there is no level, and the agent has no position in it.
        let start = if self.tick > 0 { world.position(self.game) } else { None };
        path.extend(start.map(|position| position.to_array()));
        while (steps.len() as u32) < self.ticks {
            let Some(step) = world.next()? else { break };
            reach.include(&step.vector);
            path.extend(world.position(self.game).map(|position| position.to_array()));
            steps.push(step);
        }
        let film = if self.observation_config.is_image() {
            Film::new(self.observation_config.image, self.scale, self.game.tick_hz())?
        } else {
            Film::of_numbers(NumberBars::new(self.game.observation().names, self.scale, &reach), self.game.tick_hz())
        };
        let (picture, _) = film.animated(&steps, || {})?;
        let sum = steps.iter().map(|step| f64::from(step.reward)).sum();
        Ok(Rollout { picture, sum, ticks: steps.len() as u32, end: world.end().map(|end| end.result.end), path })
    }

    /// Draws skills from the prior at the state.
    pub fn draws(&mut self, count: usize) -> Result<Vec<Vec<f32>>, CliError> {
        let Player::Policy { prior: Some(prior), .. } = self.player else { return Ok(Vec::new()) };
        let mut draws = Vec::new();
        for index in 0..count {
            // The state's own observation is made in its first tick.
            let mut world = self.state()?;
            let mut stream = rng::Streams::new(self.seed).stream("skills", index as u64);
            draws.push(world.draw_skill(prior, SkillDraw::Sample, &mut || rng::normal(&mut stream))?);
        }
        Ok(draws)
    }
}

impl Rollout {
    fn end_words(&self) -> &'static str {
        match self.end {
            Some(EpisodeEnd::Terminated { success: true }) => "won",
            Some(EpisodeEnd::Terminated { success: false }) => "lost",
            Some(EpisodeEnd::Truncated) => "out of time",
            None => "goes on",
        }
    }

    /// Returns all but the picture.
    pub fn as_json(&self, z: &[f32], names: &SkillNames) -> Value {
        json!({
            "z": z, "return": self.sum, "ticks": self.ticks, "end": self.end_words(), "name": names.of(z),
            "path": self.path,
        })
    }

    /// Returns all, with the picture as a `data:` address.
    pub fn with_picture(&self, z: &[f32], names: &SkillNames) -> Value {
        let mut value = self.as_json(z, names);
        value["picture"] = format!("data:image/png;base64,{}", playbot_report::base64(&self.picture)).into();
        value
    }
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
