//! Tests of the verbs around recordings.

use crate::{game_program::GameProgram, shell::Shell};

/// Returns width and height of a PNG, and the number of colours of its first frame, at most 100.
fn looked_at(shell: &Shell, name: &str) -> (u64, u64, usize) {
    let bytes = shell.read(name);
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let (width, height) = (reader.info().width, reader.info().height);
    let mut pixels = vec![0; reader.output_buffer_size().expect("it is small")];
    let frame = reader.next_frame(&mut pixels).expect("a whole frame");
    let channels = frame.color_type.samples();
    let mut colours = std::collections::BTreeSet::new();
    for pixel in pixels[..frame.buffer_size()].chunks_exact(channels) {
        if colours.len() < 100 {
            colours.insert(pixel);
        }
    }
    (width.into(), height.into(), colours.len())
}

impl GameProgram {
    /// `record`, `demo ls`, `demo show` and `demo verify`: episodes of the demonstrator, with noise, replay, and
    /// recording them again makes the same file.
    pub fn recordings_replay(&self) {
        let shell = self.with_recording();
        let summary = shell.answer(&["demo", "ls", "few.demo", "--json"]);
        assert_eq!((&summary["episodes"], &summary["levels"]), (&3.into(), &3.into()), "{summary}");
        assert_eq!(summary["header"]["demonstrator"], self.demonstrator);
        let episodes = shell.answers(&["demo", "show", "few.demo", "--json"]);
        let levels: Vec<_> = episodes.iter().map(|episode| episode["level"].as_u64()).collect();
        assert_eq!(levels, [0, 1, 2].map(|place| Some(self.recorded + place)));
        let earned = episodes.iter().filter(|episode| episode["return"].as_f64().is_some_and(|sum| sum > 0.0)).count();
        assert!(earned > 0, "the demonstrator earns something: {episodes:?}");

        let verified = shell.answer(&["demo", "verify", "few.demo", "--json"]);
        assert_eq!(verified["report"]["episodes"], 3, "{verified}");
        assert_eq!(verified["report"]["divergences"].as_array().map(Vec::len), Some(0), "{verified}");
        assert!(shell.read("few.demo") == self.with_recording().read("few.demo"), "the same seed, the same file");
    }

    /// `view`: a tick of the demonstrator's play, and one of a recording, as pictures.
    pub fn moments_are_drawn(&self) {
        let shell = self.with_recording();
        let bot = ["view", self.game, "--level", "3", "--tick", "3", "--out", "bot.png", "--json"];
        let recording = ["view", self.game, "--demo", "few.demo", "--episode-number", "1", "--tick", "3"];
        let recording = [&recording[..], &["--out", "demo.png", "--json"]].concat();
        for (args, name, player, level) in
            [(&bot[..], "bot.png", self.demonstrator, 3), (&recording, "demo.png", "recording", self.recorded + 1)]
        {
            let said = shell.answer(args);
            assert_eq!((&said["player"], &said["level"]), (&player.into(), &level.into()), "{said}");
            assert_eq!((&said["frames"], &said["ticks"], &said["divergence"]), (&1.into(), &4.into(), &().into()));
            let (width, height, colours) = looked_at(&shell, name);
            assert_eq!((&said["width"], &said["height"]), (&width.into(), &height.into()), "{said}");
            assert!(colours > 2, "{name} has no more than {colours} colours");
        }
    }
}
