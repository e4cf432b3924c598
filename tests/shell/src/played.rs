//! Tests of `play`: a window, in which each frame is a tick of the game.

use std::collections::BTreeSet;

use crate::{desk::Desk, game_program::GameProgram, shell::Shell};

/// Ticks that the demonstrator plays of each level.
const TICKS: u32 = 40;

/// Returns whether a pixel has the colour of the overlay's words, of which rounding may take one.
fn is_overlay_text(pixel: u32) -> bool {
    let near = |channel: u32, value: u32| (pixel >> channel & 0xff).abs_diff(value) <= 1;
    near(16, 237) && near(8, 240) && near(0, 245)
}

impl GameProgram {
    /// `play --record`, and `demo verify` of it without a display. A person and the demonstrator play in a window, on
    /// several levels in one World, and the same actions give the same bits elsewhere.
    pub fn what_a_window_records_replays(&self) {
        let (desk, shell) = (Desk::new(self.program), Shell::new(self.program));
        let args = ["play", self.game, "--levels", "0..1", "--bot", self.demonstrator, "--record", "seen.demo"];
        let mut seat = desk.open(shell.folder(), &args);
        assert!(seat.title().contains("you play"), "{}", seat.title());

        seat.tap("Tab");
        seat.read(&format!("{} plays", self.demonstrator));
        seat.pass_ticks(TICKS);
        let colours: BTreeSet<u32> = desk.pixels(400).into_iter().collect();
        assert!(colours.len() > 1, "the window shows the game");
        seat.tap("n");
        seat.read(&format!("{} default 1 · tick", self.game));
        seat.pass_ticks(TICKS);
        seat.tap("Tab");
        seat.read("you play");
        seat.hold(&[self.key]);
        seat.pass_ticks(5);
        seat.release(&[self.key]);
        // The same level from its start: for the World it is the third episode at least.
        seat.tap("r");
        seat.pass_ticks(5);
        seat.tap("Escape");
        let (status, said) = seat.leave();
        assert!(status.success(), "{said}");
        assert!(said.contains("demo verify seen.demo"), "{said}");

        let episodes = shell.answers(&["demo", "show", "seen.demo", "--json"]);
        let count = |level: u64| episodes.iter().filter(|episode| episode["level"] == level).count();
        assert!(count(0) >= 1 && count(1) >= 2, "{episodes:?}");
        let decided = |who: &str| -> u64 {
            episodes.iter().filter_map(|episode| episode["steps_by_decider"][who].as_u64()).sum()
        };
        let (bot, human) = (decided("Bot"), decided("Human"));
        assert!(bot >= u64::from(TICKS) && human >= 5, "{bot} ticks by the bot, {human} by hand");
        let verified = shell.answer(&["demo", "verify", "seen.demo", "--json"]);
        assert_eq!(verified["report"]["episodes"], episodes.len(), "{verified}");
        assert_eq!(verified["report"]["divergences"].as_array().map(Vec::len), Some(0), "{verified}");
    }

    /// F9, F10 and Tab in a window: what a person plays is recorded, learned from in the background and played. The
    /// window closes while it learns, and nothing is lost.
    pub fn a_window_learns_while_one_plays(&self) {
        let (desk, shell) = (Desk::new(self.program), Shell::new(self.program));
        let mut seat = desk.open(shell.folder(), &["play", self.game, "--levels", "0..1"]);
        seat.tap("F10");
        seat.read("nothing is recorded yet");
        seat.tap("F9");
        seat.read("recording, 0 episodes");
        for _ in 0..4 {
            seat.hold(&[self.key]);
            seat.pass_ticks(20);
            seat.release(&[self.key]);
            seat.pass_ticks(20);
        }
        seat.tap("F10");
        seat.read("lesson: ");
        seat.read("by imitation");
        seat.tap("Tab");
        seat.read("the learned policy plays");
        seat.pass_ticks(10);
        // The game is given none of the keys now, and the overlay hears its own.
        let is_shown = || desk.pixels(200).into_iter().any(is_overlay_text);
        seat.wait("overlay", |_| is_shown());
        seat.tap("F8");
        seat.wait("end of the overlay", |_| !is_shown());
        seat.tap("F8");
        seat.wait("overlay again", |_| is_shown());
        seat.tap("Tab");
        seat.read("you play");
        seat.tap("Escape");
        let (status, said) = seat.leave();
        assert!(status.success(), "{said}");

        let recording = format!("{}.demo", self.game);
        let verified = shell.answer(&["demo", "verify", &recording, "--json"]);
        assert_eq!(verified["report"]["divergences"].as_array().map(Vec::len), Some(0), "{verified}");
        let policy = format!("{}.lessons/learned.policy", self.game);
        let shown = shell.answer(&["policy", "show", &policy, "--json"]);
        assert_eq!(shown["card"]["game"], self.game, "{shown}");
    }

    /// `play --record` in a window that is minimised while a key is held: the key is let go of, time goes on, and the
    /// recording replays.
    pub fn a_hidden_window_holds_no_key_and_plays_on(&self) {
        let (desk, shell) = (Desk::new(self.program), Shell::new(self.program));
        let args = ["play", self.game, "--levels", "0..1", "--record", "hidden.demo"];
        let mut seat = desk.open(shell.folder(), &args);
        seat.hold(&[self.key]);
        seat.pass_ticks(20);
        seat.hide();
        seat.pass_ticks(40);
        seat.show();
        seat.release(&[self.key]);
        seat.pass_ticks(5);
        seat.tap("Escape");
        let (status, said) = seat.leave();
        assert!(status.success(), "{said}");

        let verified = shell.answer(&["demo", "verify", "hidden.demo", "--json"]);
        assert_eq!(verified["report"]["divergences"].as_array().map(Vec::len), Some(0), "{verified}");
        let ticks = shell.answers(&["demo", "show", "hidden.demo", "--episode", "0", "--json"]);
        let actions: Vec<u64> = ticks.iter().filter_map(|tick| tick["action"].as_u64()).collect();
        // Runs of ticks with the key, and without any.
        let runs: Vec<&[u64]> = actions.chunk_by(|one, next| one == next).collect();
        let held = runs.iter().position(|run| run[0] != 0 && run.len() >= 10);
        let after = held.map(|held| &runs[held + 1..]).unwrap_or_default();
        assert!(after.iter().any(|run| run[0] == 0 && run.len() >= 30), "held before, and not while hidden: {runs:?}");
    }
}
