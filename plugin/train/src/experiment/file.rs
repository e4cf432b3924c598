//! Experiment files in RON.
//!
//! `base: ["coinrun-ppo", "mine.ron"]` at the top of a file names its bases: presets by name, files by their path from
//! the file's own folder. Each overrides the ones before it, and the file's own keys override all of them, key by key;
//! a list is one value. A base may have a base of its own. The number of bases and the length of a file are limited,
//! which keeps hostile files from taking forever.

#[cfg(test)]
mod limits_tests;
#[cfg(test)]
mod tests;

use crate::experiment::{
    Experiment, ExperimentError,
    error::Origin,
    find_preset,
    keys::{self as known, Keys, Value, check_syntax, is_section, no_value, renamed, unknown_key},
};
use playbot_harness::level_files::read::read_text_file;
use playbot_learner::settings::Reader;
use std::path::{Path, PathBuf};

pub use crate::experiment::error::ConfigError;

/// Largest depth of bases.
const MAX_DEPTH: usize = 8;

/// Largest number of bases of an experiment, each counted as often as it is named.
const MAX_BASES: usize = 64;

/// Largest size of a file in bytes. The longest experiments have a few thousand.
const MAX_BYTES: u64 = 1 << 20;

/// Reads and checks an experiment.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn read_experiment(path: &Path) -> Result<Experiment, ConfigError> {
    parse_experiment_with::<&str>(&read_experiment_text(path)?, path, &[])
}

/// Reads an experiment, puts each `key=value` into it (see [`Experiment::with_set`]) and checks the result.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column, or with the `key=value` that does not fit.
pub fn read_experiment_with<S: AsRef<str>>(path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    parse_experiment_with(&read_experiment_text(path)?, path, sets)
}

/// Reads an experiment as [`read_experiment_with`] does, from a text; `path` as for [`parse_experiment`].
///
/// # Errors
///
/// [`ConfigError`].
pub fn parse_experiment_with<S: AsRef<str>>(text: &str, path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    let keys = gather(text, path, &mut Reading::default())?;
    let own = keys.parse(&Origin::start_of(path))?;
    let experiment = own.with_set(sets)?;
    match experiment.check() {
        Ok(()) => Ok(experiment),
        Err(source) => {
            let fails =
                |sets: &[&str]| own.with_set(sets).is_ok_and(|changed| changed.check().as_ref() == Err(&source));
            let sets = if fails(&[]) { Vec::new() } else { blame(sets, fails) };
            Err(placed(&keys, sets, source, path))
        }
    }
}

/// Adds the position of the wrong key to an error that was found after reading, such as one about the game. Text, path
/// and sets are those that the experiment was read from.
pub fn locate<S: AsRef<str>>(text: &str, path: &Path, sets: &[S], source: ExperimentError) -> ConfigError {
    let keys = source.keys();
    // A set may change a whole section, and the error may name a section.
    let sets_it = |set: &&str| {
        let name = set.split_once('=').map_or("", |(name, _)| name.trim());
        let is_within = |inner: &str, outer: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with('.'));
        keys.iter().any(|key| name == *key || is_within(key, name) || is_within(name, key))
    };
    let sets = sets.iter().map(AsRef::as_ref).filter(sets_it).map(str::to_owned).collect();
    placed(&gather(text, path, &mut Reading::default()).unwrap_or_default(), sets, source, path)
}

/// Returns an error of these sets, or of the position in a file if there are none.
fn placed(keys: &Keys, sets: Vec<String>, source: ExperimentError, path: &Path) -> ConfigError {
    if !sets.is_empty() {
        return ConfigError::Sets { sets, source: source.into() };
    }
    let (path, at) = source.keys().into_iter().find_map(|key| keys.place(key)).unwrap_or((path, (1, 1)));
    ConfigError::Values { path: path.into(), at, source: source.into() }
}

/// Returns the sets without which the error would be gone, or all of them together.
fn blame<S: AsRef<str>>(sets: &[S], fails: impl Fn(&[&str]) -> bool) -> Vec<String> {
    let all: Vec<&str> = sets.iter().map(AsRef::as_ref).collect();
    let without = |left_out: usize| -> Vec<&str> {
        all.iter().enumerate().filter(|(at, _)| *at != left_out).map(|(_, set)| *set).collect()
    };
    let guilty: Vec<String> = (0..all.len()).filter(|&at| !fails(&without(at))).map(|at| all[at].to_owned()).collect();
    if guilty.is_empty() { all.into_iter().map(str::to_owned).collect() } else { guilty }
}

/// Parses the text of an experiment. Messages name `path`, and paths of bases start in its folder.
///
/// # Errors
///
/// [`ConfigError::Syntax`], also for its bases; [`ConfigError::Read`] if one of them cannot be read.
pub fn parse_experiment(text: &str, path: &Path) -> Result<Experiment, ConfigError> {
    gather(text, path, &mut Reading::default())?.parse(&Origin::start_of(path))
}

/// Reads the text of an experiment file, of at most 1 MiB.
///
/// # Errors
///
/// [`ConfigError::Read`] if there is no regular file, or it is longer, or it is not a text.
pub fn read_experiment_text(path: &Path) -> Result<String, ConfigError> {
    read_text_file(path, MAX_BYTES).map_err(|error| ConfigError::Read { path: path.into(), source: error.into() })
}

/// The files that are being read for one experiment.
#[derive(Default)]
struct Reading {
    /// Files that have the current one as a base, the outermost first.
    users: Vec<PathBuf>,
    /// Files and presets read so far, beside the experiment itself.
    bases: usize,
}

/// Collects the keys of a file over those of its bases. Each file is checked alone: a wrong value is reported even if a
/// later one overrides it.
fn gather(text: &str, path: &Path, reading: &mut Reading) -> Result<Keys, ConfigError> {
    let start = Origin::start_of(path);
    let mut own = Keys::of_text(text, path)?;
    let base = own.take("base");
    own.check_names()?;
    Keys::all().clone().overlaid(&own).parse(&start)?;
    let mut keys = Keys::default();
    if let Some(base) = base {
        let names: Vec<String> = ron::from_str(&base.text).map_err(|_| {
            let message = "`base` must be a list of presets and files, such as [\"coinrun-ppo\", \"mine.ron\"]";
            base.origin.error((1, 1), message.to_owned())
        })?;
        reading.users.push(path.into());
        for name in names {
            keys = keys.overlaid(&gather_base(&name, reading, &base.origin)?);
        }
        reading.users.pop();
    }
    Ok(keys.overlaid(&own))
}

fn gather_base(name: &str, reading: &mut Reading, origin: &Origin) -> Result<Keys, ConfigError> {
    let users = &reading.users;
    let user = users.last().cloned().unwrap_or_default();
    let path =
        if name.ends_with(".ron") { user.with_file_name(name) } else { format!("assets/presets/{name}.ron").into() };
    let chain = || {
        let files: Vec<String> = users.iter().chain([&path]).map(|file| file.display().to_string()).collect();
        files.join(" → ")
    };
    let same = |known: &PathBuf| {
        *known == path || known.canonicalize().is_ok_and(|known| path.canonicalize().is_ok_and(|path| path == known))
    };
    if users.iter().any(same) {
        return Err(origin.error((1, 1), format!("`base` goes round in a circle: {}", chain())));
    }
    if users.len() > MAX_DEPTH {
        return Err(origin.error((1, 1), format!("`base` goes more than {MAX_DEPTH} files deep: {}", chain())));
    }
    if reading.bases == MAX_BASES {
        let first = users.first().cloned().unwrap_or_default();
        let message =
            format!("{} is built on more than {MAX_BASES} files and presets: `base` may name fewer", first.display());
        return Err(origin.error((1, 1), message));
    }
    reading.bases += 1;
    if name.ends_with(".ron") {
        let text = read_text_file(&path, MAX_BYTES).map_err(|error| {
            origin.error((1, 1), format!("`base` names {}, which cannot be read: {error}", path.display()))
        })?;
        return gather(&text, &path, reading);
    }
    let preset = find_preset(name)
        .map_err(|error| origin.error((1, 1), format!("{error}; or a file, by its path ending in .ron")))?;
    gather(preset.text, &path, reading)
}

impl Experiment {
    /// Returns this experiment with each `key=value` put into it, in order. A key in a section has its path, such as
    /// `ppo.lr=0.0003`; values are written as in a file, and texts may lack their quotes: `train=hard:0..31`. A whole
    /// section is changed key by key: `ppo=(lr: 0.0003, epochs: 4)`.
    ///
    /// [`check`](Self::check) then finds values that contradict one another.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Set`] with the wrong text: no `=`, an unknown key, or a value of the wrong type.
    pub fn with_set<S: AsRef<str>>(&self, sets: &[S]) -> Result<Self, ConfigError> {
        sets.iter().try_fold(self.clone(), |experiment, set| put(&experiment, set.as_ref()))
    }

    /// Returns whether the algorithm reads this key, or some key in this section. A key that another one turns off,
    /// such as `score.kl_coef` without `score.kl`, counts as read.
    pub fn reads(&self, key: &str) -> bool {
        let key = renamed(key).unwrap_or(key);
        let is_asked = |path: &str| path.strip_prefix(key).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        let mut asked = known::all().filter(|setting| is_asked(setting.path)).peekable();
        asked.peek().is_none() || asked.any(|setting| self.is_among(setting.readers))
    }

    fn is_among(&self, readers: &[Reader]) -> bool {
        let is_this = |reader: &Reader| {
            reader.algorithm == self.algorithm.name() && reader.switch.is_none_or(|switch| self.is_on(switch))
        };
        readers.is_empty() || readers.iter().any(is_this)
    }

    fn is_on(&self, switch: &str) -> bool {
        let origin = Origin::Set(String::new());
        Keys::of_experiment(self, &origin).is_ok_and(|keys| keys.text(switch) == Some("true"))
    }
}

fn put(experiment: &Experiment, set: &str) -> Result<Experiment, ConfigError> {
    let origin = Origin::Set(set.to_owned());
    let refuse = |message: String| origin.error((1, 1), message);
    let Some((key, text)) = set.split_once('=') else {
        return Err(refuse("write key=value, such as ppo.lr=0.0003".to_owned()));
    };
    let (key, text) = (renamed(key.trim()).unwrap_or(key.trim()), text.trim());
    if key == "base" {
        return Err(refuse("`base` names what a file is built on: write it into an experiment file".to_owned()));
    }
    let mut keys = Keys::of_experiment(experiment, &origin)?;
    if is_section(key) && text.starts_with('(') {
        let section = Keys::of_set(key, text, &origin)?;
        section.check_names()?;
        return keys.overlaid(&section).parse(&origin);
    }
    let Some(setting) = known::find(key) else {
        return Err(refuse(unknown_key(key)));
    };
    if text == "None" {
        // A text may lack its quotes, but `None` takes the value of an optional key away.
        let mut without = keys.clone();
        without.put(key.to_owned(), Value { text: text.to_owned(), origin: origin.clone() });
        if let Ok(experiment) = without.parse(&origin) {
            return Ok(experiment);
        }
    }
    let text = if setting.sample().starts_with('"') && !text.starts_with('"') {
        ron::to_string(text).map_err(|error| refuse(error.to_string()))?
    } else {
        text.to_owned()
    };
    check_syntax(&text).map_err(|error| refuse(no_value(key, &text, &error.code)))?;
    keys.put(key.to_owned(), Value { text, origin: origin.clone() });
    keys.parse(&origin)
}

#[cfg(test)]
mod config_set_tests {
    use std::path::Path;

    use playbot_learner::{
        ConfidenceKind, EntropyCoef, StdKind,
        nn::{Activation, CnnKind},
    };

    use super::*;
    use crate::Algorithm;
    use bevy_playbot::vision::{ImageOptions, ObservationKind};

    fn experiment() -> Experiment {
        let text = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "demos/coinrun", steps: 1000,
            ppo: (gamma: 0.5, epochs: 7))"#;
        parse_experiment(text, Path::new("x.ron")).expect("valid")
    }

    fn error(set: &str) -> String {
        experiment().with_set(&[set]).expect_err("must be refused").to_string()
    }

    #[test]
    fn every_setting_of_the_tables_can_be_set_and_has_the_default_of_its_row() {
        let text = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", steps: 1000)"#;
        let least = parse_experiment(text, Path::new("x.ron")).expect("valid");
        for setting in known::all() {
            let with = |value: String| least.with_set(&[format!("{}={value}", setting.path)]).expect(setting.path);
            with(setting.sample());
            if let Some(default) = setting.default {
                assert_eq!(with(default()), least, "{}", setting.path);
            }
        }
    }

    #[test]
    fn keys_that_are_not_written_as_long_as_they_do_nothing_can_be_set() {
        let sets = [
            "skills.held_out=0.1",
            "skills.anneal_lr=true",
            "skills.patience=3",
            "skills.weight_decay=0.01",
            "skills.augment=[Translate(2)]",
            "skills.state_weight=2",
        ];
        let skills = experiment().with_set(&sets).expect("known keys").skills;
        assert_eq!((skills.held_out, skills.patience, skills.weight_decay), (0.1, Some(3), 0.01));
        assert!(skills.anneal_lr);
        assert_eq!(skills.state_weight, 2.0);
        assert_eq!(skills.augment.len(), 1);
        let older = experiment().with_set(&["sac.alpha_lr=0.5"]).expect("an older name");
        assert_eq!(older.sac.temperature_lr, 0.5);
    }

    #[test]
    fn values_of_every_kind_are_set_and_nothing_else_is() {
        let sets = [
            "score.kl=false",
            "arenas=32",
            "score.kl_coef = 0.3",
            "ppo.lr=1",
            "ppo.hidden=[64,64]",
            "ppo.activation=Tanh",
            "score.alpha=Off",
            "skills.prior_std=Vector",
            "ppo.total_updates=Some(3)",
            "sac.entropy=Fixed(0.5)",
            "sac.log_std=(-4, 1)",
            "train=hard:0..31",
            "test=\"hard:70..80\"",
            "demos=my recordings/a",
            "demo_steps=5000",
            "demo_wins=true",
            "observation=Raster",
            "image.stack=4",
            "image=(grayscale: true, width: 84)",
            "ppo.cnn=Nature(feature: 64)",
            "algorithm=bc",
            "seeds=[4, 5]",
            "variants=[(name: \"a\", set: [\"score.kl=true\"])]",
        ];
        let mut expected = experiment();
        expected.score.kl = false;
        expected.arenas = 32;
        expected.score.kl_coef = 0.3;
        expected.ppo.lr = 1.0;
        expected.ppo.hidden = vec![64, 64];
        expected.ppo.activation = Activation::Tanh;
        expected.score.confidence = ConfidenceKind::Off;
        expected.skills.prior_std = StdKind::Vector;
        expected.ppo.total_updates = Some(3);
        expected.sac.entropy = EntropyCoef::Fixed(0.5);
        expected.sac.log_std = (-4.0, 1.0);
        expected.train = "hard:0..31".parse().expect("a split");
        expected.test = "hard:70..80".parse().expect("a split");
        expected.demos = Some("my recordings/a".into());
        expected.demo_steps = Some(5000);
        expected.demo_wins = true;
        expected.observation = ObservationKind::Raster;
        expected.image = ImageOptions { stack: 4, grayscale: true, width: 84, ..ImageOptions::default() };
        expected.ppo.cnn = CnnKind::Nature { feature: 64 };
        expected.algorithm = Algorithm::BehaviourCloning;
        expected.seeds = vec![4, 5];
        expected.variants = vec![crate::experiment::Variant { name: "a".into(), set: vec!["score.kl=true".into()] }];
        let changed = experiment().with_set(&sets).expect("valid");
        assert_eq!(changed, expected);
        let back = changed.with_set(&["ppo.total_updates=None"]).expect("valid");
        assert_eq!(back.ppo.total_updates, None);
        let without = changed.with_set(&["demos=None"]).expect("not all need some");
        assert_eq!(without.demos, None);
        assert_eq!(without.with_set(&["demos=None/a"]).expect("a path").demos, Some("None/a".into()));
        assert_eq!(back.with_set(&["ppo.total_updates=9"]).expect("Some is understood").ppo.total_updates, Some(9));
    }

    #[test]
    fn a_section_is_changed_key_by_key_and_the_last_one_wins() {
        let changed = experiment().with_set(&["ppo=(lr: 0.25, epochs: 2)", "ppo.lr=0.5"]).expect("valid");
        assert_eq!((changed.ppo.lr, changed.ppo.epochs, changed.ppo.gamma), (0.5, 2, 0.5));
    }

    #[test]
    fn what_does_not_fit_is_named_with_what_was_given() {
        for (set, words) in [
            ("ppo.lr", "write key=value"),
            ("ppo.gama=1", "unknown key `ppo.gama`; did you mean `ppo.gamma`?"),
            ("sac.lr=1", "unknown key `sac.lr`; did you mean `sac.actor_lr`?"),
            (
                "ppo.augment=[Translate]",
                "`ppo.augment` must be a list in square brackets such as [Translate(1)], not [Translate]",
            ),
            ("kl_coef=1", "did you mean `score.kl_coef`?"),
            ("image.stak=2", "did you mean `image.stack`?"),
            ("stack=2", "did you mean `image.stack`?"),
            ("imag.width=32", "did you mean `image.width`?"),
            ("image=(stack: 2, gray: true)", "unknown key `image.gray`; did you mean `image.grayscale`?"),
            ("image.stack=-1", "`image.stack` must be a whole number such as 1, not -1"),
            ("observation=raster", "did you mean `Raster`?"),
            ("ppo.cnn=Natur", "did you mean `Nature`?"),
            ("pop.lr=1", "did you mean `ppo.lr`?"),
            ("ppo.qqq=1", "valid keys in `ppo`: activation"),
            ("steps.more=1", "`steps` has no keys"),
            ("ppo=3", "`ppo` is a section"),
            ("ppo=(gama: 1)", "did you mean `ppo.gamma`?"),
            ("ppo.lr=fast", "`ppo.lr` must be a number such as 0.0005, not fast"),
            ("ppo.lr=", "`ppo.lr` must be a number"),
            ("arenas=-3", "`arenas` must be a whole number such as 64, not -3"),
            ("score.kl=yes", "`score.kl` must be true or false, not yes"),
            ("ppo.hidden=[64,a]", "`ppo.hidden` must be a list in square brackets such as [200, 200], not [64,a]"),
            ("ppo.activation=Rellu", "did you mean `Relu`?"),
            ("sac.entropy=Fixd(0.2)", "did you mean `Fixed`?"),
            ("sac.entropy=Fixed(high)", "`sac.entropy` must be something such as Auto("),
            ("sac.entropy=Auto(initail: 1.0)", "unknown key `initail` in `sac.entropy`; did you mean `initial`?"),
            ("sac.log_std=3", "values in round brackets such as (-5.0, 2.0), not 3"),
            ("ppo.total_updates=soon", "`ppo.total_updates` must be None or Some(value), not soon"),
            ("train=hard", "`hard` is not a range of levels"),
            ("algorithm=score", "unknown algorithm `score`"),
            ("base=[]", "experiment file"),
            // A text must not reach beyond the value.
            ("ppo.lr=0.1, gamma: 0.9", "is not a value"),
            ("ppo.lr=0.1), score: (kl: false", "is not a value"),
        ] {
            let text = error(set);
            assert!(text.starts_with(&format!("`{set}`: ")) && text.contains(words), "{text}");
        }
    }

    /// Returns those of the keys that an experiment reads.
    fn read(settings: &str, keys: &[&'static str]) -> Vec<&'static str> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10, {settings})"#);
        let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
        keys.iter().copied().filter(|key| experiment.reads(key)).collect()
    }

    #[test]
    fn sections_of_other_algorithms_are_not_read() {
        let keys = ["steps", "ppo.lr", "sac", "skills.latent", "score.kl", "spirl.kl_coef", "rlpd.critics"];
        let of = |algorithm: &str| read(&format!("algorithm: {algorithm:?}"), &keys);
        assert_eq!(of("ppo"), ["steps", "ppo.lr"]);
        assert_eq!(of("score-ppo"), ["steps", "ppo.lr", "skills.latent", "score.kl"]);
        assert_eq!(of("score-sac"), ["steps", "sac", "skills.latent", "score.kl"]);
        assert_eq!(of("spirl-ppo"), ["steps", "ppo.lr", "skills.latent", "spirl.kl_coef"]);
        assert_eq!(of("spirl-sac"), ["steps", "sac", "skills.latent", "spirl.kl_coef"]);
        assert_eq!(of("rlpd"), ["steps", "sac", "rlpd.critics"]);
        assert_eq!(of("bc"), ["steps", "skills.latent"]);
    }

    #[test]
    fn nor_is_what_an_algorithm_has_in_their_place() {
        let keys = [
            "sac.critics",
            "sac.layer_norm",
            "sac.entropy",
            "sac.tau",
            "ppo.ent_coef",
            "ppo.lr",
            "score.kl_coef",
            "score.horizon",
        ];
        let of = |settings: &str| read(settings, &keys);
        assert_eq!(of(r#"algorithm: "rlpd""#), ["sac.entropy", "sac.tau"]);
        assert_eq!(of(r#"algorithm: "sac""#), ["sac.critics", "sac.layer_norm", "sac.entropy", "sac.tau"]);
        assert_eq!(of(r#"algorithm: "spirl-ppo""#), ["ppo.lr", "score.horizon"]);
        let learns = "spirl: (learn_decoder: true)";
        assert_eq!(
            of(&format!(r#"algorithm: "spirl-ppo", {learns}"#)),
            ["ppo.ent_coef", "ppo.lr", "score.kl_coef", "score.horizon"]
        );
        assert_eq!(of(r#"algorithm: "spirl-sac""#), ["sac.critics", "sac.layer_norm", "sac.tau", "score.horizon"]);
        let both =
            ["sac.critics", "sac.layer_norm", "sac.tau", "ppo.ent_coef", "ppo.lr", "score.kl_coef", "score.horizon"];
        assert_eq!(of(&format!(r#"algorithm: "spirl-sac", {learns}"#)), both);
        assert_eq!(of(r#"algorithm: "bc""#), ["score.horizon"]);
    }
}
