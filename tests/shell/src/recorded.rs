//! Tests of the verbs around recordings.

use std::fs;

use crate::{
    game_program::GameProgram,
    output::{ended, ended_in},
    shell::Shell,
};

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
        let shell = self.with_whole_recording();
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
        let [once, again] = [self.with_recording(), self.with_recording()].map(|shell| shell.read("few.demo"));
        assert!(once == again, "the same seed, the same file");
    }

    /// `demo filter`, `demo label`, `demo repair`, `demo merge`, `learn-skills` and `train`: whatever `demo verify`
    /// accepts is learned from, and what it refuses is not.
    pub fn what_verifies_is_learned_from(&self) {
        let shell = self.with_tiny_experiment();
        let one = format!("default:{0}..{0}", self.recorded + 1);
        let change = |args: &[&str]| _ = shell.answer(&[args, &["--json"]].concat());
        change(&["demo", "filter", "few.demo", "--levels", &one, "--without-idle-start", "--out", "one.demo"]);
        change(&["demo", "label", "few.demo", "--player", "alice", "--out", "alice.demo"]);
        let short = ["record", self.game, "--bot", "random", "--noise", "0.1", "--levels", &one, "--steps", "3"];
        shell.done(&[&short[..], &["--out", "short.demo"]].concat());
        // A recording that was cut off, one with a bit of its last episode turned over, and the whole rest of each.
        let whole = shell.read("few.demo");
        let mut bent = whole.clone();
        bent[whole.len() - 60] ^= 1;
        for (name, bytes) in [("torn.demo", &whole[..whole.len() - 40]), ("bent.demo", &bent)] {
            fs::write(shell.path(name), bytes).expect("writable");
            let mended = format!("mended-{name}");
            change(&["demo", "repair", name, "--out", &mended]);
        }
        change(&["demo", "merge", "mended-torn.demo", "short.demo", "--out", "merged.demo"]);

        let mut refused = Vec::new();
        for name in [
            "few.demo",
            "one.demo",
            "alice.demo",
            "short.demo",
            "torn.demo",
            "bent.demo",
            "mended-torn.demo",
            "mended-bent.demo",
            "merged.demo",
        ] {
            let (verified, out, err) = ended_in(shell.command(&["demo", "verify", name]), &[0, 1]);
            let (demos, skills, run) = (format!("demos={name}"), format!("{name}.safetensors"), format!("run-{name}"));
            let tiny = ["--experiment", "tiny.ron", "--set", &demos];
            let learn = [&["learn-skills"][..], &tiny, &["--out", &skills]].concat();
            if verified == 0 {
                ended(shell.command(&learn), 0);
                let train = [&["train"][..], &tiny, &["--skills", &skills, "--run", &run]].concat();
                ended(shell.command(&train), 0);
            } else {
                refused.push(name);
                let words = ended(shell.command(&learn), 3).1;
                assert!(words.contains(name) && words.contains("demo repair"), "{out}{err}: {words}");
            }
        }
        assert_eq!(refused, ["torn.demo", "bent.demo"], "only damaged files are refused");
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
