//! Teaching in a window: F9 records, F10 learns from the recording in the background, and Tab hands over to what was
//! learned so far.

use crate::window::{
    notice::Notice,
    record_into,
    session::{Deciders, OwnKeys, leave_level},
};
use bevy::prelude::*;
use bevy_playbot::{
    demo::file::{DemoHeader, DemoWriter},
    engine::{PressesForPeople, flush_unfinished},
    key_bindings::KeyBindings,
    lesson::{Lesson, LessonNews, lesson_command},
    policy::AgentMemory,
    policy_file::{DeviceKind, PolicyFile, install_policy},
};
use playbot_harness::prelude::*;
use playbot_learner::ObsKind;
use playbot_report::counted;
use std::{
    path::{Path, PathBuf},
    process::Command,
};

/// Name of the learned policy in messages.
const LEARNED: &str = "the learned policy";

/// What F9 and F10 need.
#[derive(Clone, Debug)]
pub struct TeachingSetup {
    /// The recording that F9 begins, or goes on with.
    pub recording: PathBuf,
    /// Its header.
    pub header: DemoHeader,
    /// The program with the verb `teach` and this game.
    pub program: PathBuf,
    /// Further options of the verb.
    pub options: Vec<String>,
    /// True if the agent of the window sees pictures, for which no policy is learned here.
    pub has_pictures: bool,
}

/// The state of F9 and F10.
#[derive(Resource, Reflect)]
#[reflect(Component, from_reflect = false)]
pub(super) struct Teaching {
    #[reflect(ignore)]
    setup: TeachingSetup,
    #[reflect(ignore)]
    lesson: Option<Lesson>,
    /// The last news of the lesson.
    words: Option<String>,
    /// The game, if a person's actions in it cannot be recorded.
    unrecorded: Option<&'static str>,
}

impl Teaching {
    pub fn new(setup: TeachingSetup, unrecorded: Option<&'static str>) -> Self {
        Self { setup, lesson: None, words: None, unrecorded }
    }

    /// Returns how far the lesson is, in words, if there is one.
    pub fn words(&self) -> Option<String> {
        self.words.as_ref().map(|words| format!("lesson: {words}"))
    }
}

/// Listens for the keys, and hears the lesson.
pub(super) fn teach(world: &mut World) {
    if !world.contains_resource::<Teaching>() {
        return;
    }
    let pressed = |key| world.resource::<OwnKeys>().just_pressed(key);
    let (records, learns) = (pressed(KeyCode::F9), pressed(KeyCode::F10));
    if records {
        let said = toggle_recording(world);
        say(world, said.unwrap_or_else(|error| error));
    }
    if learns {
        let said = toggle_lesson(world);
        say(world, said.unwrap_or_else(|error| error));
    }
    hear(world);
}

/// Says something in the title and on the terminal.
fn say(world: &mut World, words: String) {
    report!("{words}");
    world.resource_mut::<Notice>().say(words);
}

/// Begins to record, or ends it. Returns what was done.
fn toggle_recording(world: &mut World) -> Result<String, String> {
    let agent = world.resource::<Deciders>().agent;
    if let Some(recorder) = world.get_resource::<Recorder>() {
        let episodes = recorder.episodes();
        flush_unfinished(world).map_err(|error| error.to_string())?;
        let written = world.remove_resource::<Recorder>().map_or(episodes, |recorder| recorder.episodes());
        let mut agent = world.entity_mut(agent);
        agent.remove::<Recording>();
        if !agent.contains::<KeyBindings>() {
            // The game sees the person's devices again as they are.
            agent.remove::<PressesForPeople>();
        }
        return Ok(format!("recorded {}; F10 learns from them", counted(written, "episode")));
    }
    let teaching = world.resource::<Teaching>();
    if let Some(game) = teaching.unrecorded {
        return Err(format!("the actions of a person in {game} cannot be recorded"));
    }
    let path = teaching.setup.recording.clone();
    let writer = DemoWriter::append_or_create(&path, teaching.setup.header.clone());
    let writer = writer.map_err(|error| error.to_string())?;
    record_into(world, agent, writer);
    // A recorded episode needs its first tick.
    leave_level(world);
    Ok(format!("recording into {}; F9 ends it, F10 learns from it", path.display()))
}

/// Begins to learn, or stops it. Returns what was done.
fn toggle_lesson(world: &mut World) -> Result<String, String> {
    if let Some(lesson) = world.resource_mut::<Teaching>().lesson.as_mut().filter(|lesson| !lesson.is_over()) {
        lesson.stop();
        return Ok("the lesson saves and stops; F10 goes on with it".to_owned());
    }
    let setup = world.resource::<Teaching>().setup.clone();
    if setup.has_pictures {
        return Err(
            "this window's policy sees pictures, which take too long to learn from here: use `teach`".to_owned()
        );
    }
    // What was played of this level counts as well.
    flush_unfinished(world).map_err(|error| error.to_string())?;
    let is_recorded = world.get_resource::<Recorder>().is_some_and(|recorder| recorder.episodes() > 0);
    if !is_recorded && !setup.recording.exists() {
        return Err("nothing is recorded yet: F9 records what you play".to_owned());
    }
    let mut command = lesson_command(Command::new(&setup.program), &setup.header.game, &setup.recording);
    command.args(&setup.options);
    let lesson = Lesson::begin(command).map_err(|error| error.to_string())?;
    let mut teaching = world.resource_mut::<Teaching>();
    teaching.lesson = Some(lesson);
    teaching.words = Some("begins".to_owned());
    Ok("learning in the background; Tab hands over as soon as there is a policy".to_owned())
}

/// Hears the lesson, and lets its newest policy play.
fn hear(world: &mut World) {
    let mut teaching = world.resource_mut::<Teaching>();
    let Some(lesson) = &mut teaching.lesson else { return };
    let news = lesson.news();
    if let Some(last) = news.last() {
        teaching.words = Some(last.to_string());
    }
    if let Some(newest @ LessonNews::Policy { file, .. }) = LessonNews::newest_policy(&news) {
        let said = match load(world, file) {
            Ok(true) => format!("{newest}; Tab hands over"),
            Ok(false) => newest.to_string(),
            Err(error) => error,
        };
        say(world, said);
    }
    if let Some(LessonNews::Failed { why }) = news.last() {
        say(world, format!("the lesson failed: {why}"));
    }
}

/// Lets a policy be the autopilot. Returns whether it is the first.
fn load(world: &mut World, file: &Path) -> Result<bool, String> {
    let policy = PolicyFile::load(file, DeviceKind::default()).map_err(|error| error.to_string())?;
    if matches!(policy.policy.observation(), ObsKind::Image(_)) {
        return Err(format!("{} sees pictures: open a window with --policy to watch it", file.display()));
    }
    install_policy(world, &policy, ActionDraw::default());
    let is_first = world.resource_mut::<Deciders>().set_autopilot(LEARNED, Control::Policy);
    let agent = world.resource::<Deciders>().agent;
    if let Some(mut skill) = world.get_mut::<ActiveSkill>(agent) {
        // The new decoder means something else by a skill of the old one.
        skill.ticks_left = 0;
    }
    if let Some(mut memory) = world.get_mut::<AgentMemory>(agent) {
        memory.0.clear();
    }
    Ok(is_first)
}
