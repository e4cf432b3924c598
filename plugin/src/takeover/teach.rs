//! Teaching a shipped build: F10 starts a program that learns from the recording, and Tab hands over to what it has
//! learned so far.

use crate::{
    demo::recorder::flush_unfinished,
    fault::Faults,
    lesson::{Lesson, LessonNews, lesson_command},
    takeover::{DEFAULT_MODE, GameIdentity, Takeover, TakeoverRequest, play},
};
use bevy::prelude::*;
use std::{
    path::{Path, PathBuf},
    process::Command,
};

/// The environment variable that names the program.
const VARIABLE: &str = "PLAYBOT_TEACH";

/// How a game is taught: the program that learns, and the keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TeachOptions {
    /// The program with playbot's verbs and this game, and its first arguments; empty for none.
    pub program: Vec<String>,
    /// The key that starts and stops to learn; `None` for no key.
    pub learn_key: Option<KeyCode>,
    /// The key that hands over and takes over again; `None` for no key.
    pub hand_over_key: Option<KeyCode>,
}

impl Default for TeachOptions {
    /// F10 and Tab, and the program of the environment variable `PLAYBOT_TEACH`: a path, or words separated by blanks.
    fn default() -> Self {
        let program = words(&std::env::var(VARIABLE).unwrap_or_default());
        Self { program, learn_key: Some(KeyCode::F10), hand_over_key: Some(KeyCode::Tab) }
    }
}

/// Returns a program and its first arguments. The path of a file is one word, blanks and all.
fn words(command: &str) -> Vec<String> {
    match Path::new(command).is_file() {
        true => vec![command.to_owned()],
        false => command.split_whitespace().map(str::to_owned).collect(),
    }
}

/// The lesson of a game.
#[derive(Resource, Debug, Reflect)]
#[reflect(Component, from_reflect = false)]
pub struct Teaching {
    #[reflect(ignore)]
    options: TeachOptions,
    #[reflect(ignore)]
    lesson: Option<Lesson>,
    /// The policy that was learned last.
    learned: Option<PathBuf>,
    /// The last news, in words.
    words: Option<String>,
}

impl Teaching {
    pub(super) fn new(options: TeachOptions) -> Self {
        Self { options, lesson: None, learned: None, words: None }
    }

    /// Returns how far the lesson is, in words; `None` before it begins.
    pub fn words(&self) -> Option<&str> {
        self.words.as_deref()
    }

    /// Returns the policy that was learned last, if there is one.
    pub fn learned(&self) -> Option<&Path> {
        self.learned.as_deref()
    }

    fn say(&mut self, words: impl Into<String>) {
        let words = words.into();
        tracing::info!("{words}");
        self.words = Some(words);
    }
}

/// Listens for the keys, and hears the lesson.
pub(super) fn teach(world: &mut World) {
    if world.resource::<Faults>().has_caller() {
        return;
    }
    let options = &world.resource::<Teaching>().options;
    let keys = world.get_resource::<ButtonInput<KeyCode>>();
    let pressed = |key: Option<KeyCode>| key.zip(keys).is_some_and(|(key, keys)| keys.just_pressed(key));
    let (learns, hands_over) = (pressed(options.learn_key), pressed(options.hand_over_key));
    if learns {
        toggle(world);
    }
    if hands_over {
        hand_over(world);
    }
    hear(world);
}

/// Begins to learn, or stops it.
fn toggle(world: &mut World) {
    let mut teaching = world.resource_mut::<Teaching>();
    if let Some(lesson) = teaching.lesson.as_mut().filter(|lesson| !lesson.is_over()) {
        lesson.stop();
        return teaching.say("the lesson saves and stops");
    }
    let [program, args @ ..] = teaching.options.program.as_slice() else {
        return teaching.say(format!("no program learns: name the one with playbot's verbs in {VARIABLE}"));
    };
    let (program, args) = (program.clone(), args.to_vec());
    let takeover = world.resource::<Takeover>();
    let Some(recording) = takeover.recording.clone() else {
        let words =
            "nothing is recorded while PLAYBOT names a policy or a recording to play: start the game without it";
        return world.resource_mut::<Teaching>().say(words);
    };
    if takeover.is_recording()
        && let Err(error) = flush_unfinished(world)
    {
        return world.resource_mut::<Faults>().report(error.to_string());
    }
    if !recording.exists() {
        return world.resource_mut::<Teaching>().say("nothing is recorded yet: F9 records");
    }
    let GameIdentity { name, mode, .. } = world.resource();
    let mut command = Command::new(program);
    command.args(args);
    let mut command = lesson_command(command, name, &recording);
    if mode != DEFAULT_MODE {
        command.arg("--set").arg(format!("train={mode}:0..63"));
    }
    let begun = Lesson::begin(command);
    let mut teaching = world.resource_mut::<Teaching>();
    match begun {
        Ok(lesson) => {
            teaching.lesson = Some(lesson);
            teaching.say("the lesson begins");
        }
        Err(error) => teaching.say(error.to_string()),
    }
}

/// Lets the learned policy play, or gives the agents back.
fn hand_over(world: &mut World) {
    let Some(learned) = world.resource::<Teaching>().learned.clone() else { return };
    let request = TakeoverRequest::Policy(learned);
    let mut takeover = world.resource_mut::<Takeover>();
    match takeover.is_running() && takeover.request == request {
        true => takeover.stop(),
        false => takeover.start(request),
    }
}

/// Hears the lesson, and lets its newest policy play if an older one does.
fn hear(world: &mut World) {
    let mut teaching = world.resource_mut::<Teaching>();
    let Some(lesson) = &mut teaching.lesson else { return };
    let news = lesson.news();
    let Some(last) = news.last() else { return };
    teaching.words = Some(last.to_string());
    if let LessonNews::Failed { why } = last {
        tracing::error!("the lesson failed: {why}");
    }
    let Some(newest @ LessonNews::Policy { file, .. }) = LessonNews::newest_policy(&news) else { return };
    teaching.learned = Some(file.clone());
    tracing::info!("{newest}");
    let takeover = world.resource::<Takeover>();
    if takeover.is_running()
        && takeover.request == TakeoverRequest::Policy(file.clone())
        && let Err(error) = play::reload(world, file)
    {
        world.resource_mut::<Faults>().report(error.to_string());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_a_path_or_words() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("my bots");
        std::fs::write(&path, "").expect("writable");
        let path = path.display().to_string();
        assert_eq!(words(&path), std::slice::from_ref(&path));
        assert_eq!(words("cargo run --"), ["cargo", "run", "--"]);
        assert!(words("").is_empty());
    }
}
