//! Findings of a session: those of the detectors, and the model's own.

use crate::mcp::{
    FoundInEpisode,
    episodes::PlayedEpisode,
    session::{Session, Told, read},
    tools::Findings,
};
use serde_json::{Value, json};

/// Most characters of a report: a sentence or a few.
const LONGEST_REPORT: usize = 2000;

impl Session<'_> {
    /// Lets the detectors look at all episodes that they have not seen as they are now.
    pub(super) fn examine(&mut self) {
        for episode in &self.episodes {
            let ticks = episode.ticks() + usize::from(episode.broken.is_some());
            if ticks == 0 || self.examined.get(&episode.number).is_some_and(|(seen, _)| *seen == ticks) {
                continue;
            }
            let found = match episode.agents.len() {
                1 => self.server.examiner.examine(episode, &self.client),
                _ => Ok(Vec::new()),
            };
            let mut found = found.unwrap_or_else(|why| {
                self.problems.push(format!("the findings of episode {} cannot be stored: {why}", episode.number));
                Vec::new()
            });
            let is_named = found.iter().any(|found| ["panic", "fault", "endless"].contains(&found.detector.as_str()));
            if let Some(why) = episode.broken.as_ref().filter(|_| !is_named) {
                let no_file = match episode.agents.len() {
                    1 => "it does not happen when its actions are played again: the game is not deterministic",
                    _ => "the actions of all seats are in episodes.jsonl",
                };
                found.push(FoundInEpisode {
                    detector: "panic".to_owned(),
                    tick: u32::try_from(episode.ticks()).ok(),
                    message: why.clone(),
                    file: Err(no_file.to_owned()),
                });
            }
            self.examined.insert(episode.number, (ticks, found));
        }
    }

    pub(super) fn findings(&mut self, arguments: Value) -> Told {
        let Findings { report, tick } = match read("findings", arguments) {
            Ok(read) => read,
            Err(error) => return Told::Wrong(error),
        };
        let reported = match report.map(|words| self.report(words.trim(), tick)).transpose() {
            Ok(reported) => reported,
            Err(why) => return Told::Refused(why),
        };
        self.examine();
        let of_episode = |number: usize, found: &FoundInEpisode| {
            let level = self.episodes.get(number).map(|episode| episode.level);
            json!({
                "episode": number, "level": level, "detector": found.detector, "tick": found.tick, "message": found.message,
                "file": found.file.as_ref().ok(), "not_stored": found.file.as_ref().err(),
            })
        };
        let detected = self.examined.iter().flat_map(|(number, (_, found))| found.iter().map(|one| (*number, one)));
        let own = self.reports.iter().map(|(number, found)| (*number, found));
        let all: Vec<Value> = detected.chain(own).map(|(number, found)| of_episode(number, found)).collect();
        let several = self.words.seats.len() > 1;
        let note = several.then_some(
            "detectors play episodes again by the actions of the first seat alone, and here all seats are played: start the \
             server with --first-seat to let them look",
        );
        Told::Shown(
            json!({
                "findings": all, "reported": reported,
                "episodes": self.episodes.iter().map(PlayedEpisode::summary).collect::<Vec<Value>>(), "note": note,
            }),
            None,
        )
    }

    /// Stores a finding of the model's own.
    fn report(&mut self, words: &str, tick: Option<u32>) -> Result<Value, String> {
        if words.is_empty() || words.chars().count() > LONGEST_REPORT {
            return Err(format!("a `report` is a sentence of 1 to {LONGEST_REPORT} characters"));
        }
        let Some(episode) = self.episodes.iter().rev().find(|episode| episode.ticks() > 0) else {
            return Err("nothing was played yet: call `reset` and `act`, and report what you saw then".to_owned());
        };
        let last = episode.ticks() as u32 - 1;
        let tick = tick.unwrap_or(last);
        if tick > last {
            return Err(format!("episode {} has the ticks 0 to {last}, and no tick {tick}", episode.number));
        }
        let number = episode.number;
        let found = if episode.agents.len() == 1 {
            self.server.examiner.store(episode, tick, words, &self.client)?
        } else {
            let line = json!({ "report": words, "episode": number, "tick": tick, "by": self.client });
            let file = self.records.add_line(&line)?;
            FoundInEpisode {
                detector: "report".to_owned(),
                tick: Some(tick),
                message: words.to_owned(),
                file: Ok(file),
            }
        };
        let told = json!({ "episode": number, "tick": found.tick, "file": found.file.as_ref().ok() });
        self.reports.push((number, found));
        Ok(told)
    }
}
