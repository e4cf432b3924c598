//! Tests of `doctor`.

use crate::{game_program::GameProgram, shell::Shell};

impl GameProgram {
    /// `doctor` finds nothing: the game is safe to record, to resume and to play in a window.
    pub fn the_doctor_finds_nothing(&self) {
        let shell = Shell::new(self.program);
        let report = shell.answer(&["doctor", self.game, "--ticks", "200", "--json"]);
        assert_eq!((&report["game"], &report["ticks"]), (&self.game.into(), &200.into()));
        assert_eq!(report["findings"].as_array().map(Vec::len), Some(0), "{}", report["findings"]);
        for what in ["recording", "resume", "threads", "window"] {
            let verdict = &report["safety"][what];
            // Data for one thread alone keeps all Worlds on one.
            let is_bound = what == "threads" && verdict["why"].as_str().is_some_and(|why| why.contains("non-send"));
            assert!(verdict["safe"] == true || is_bound, "{what}: {}", report["safety"]);
        }
        assert!(report["ticks_per_second"].as_f64().is_some_and(|speed| speed > 0.0), "it was measured");
    }
}
