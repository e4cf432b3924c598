//! Tests of experiment files.

use crate::experiment::{PRESETS, file::*};

const GOOD: &str = r#"(
    game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "demos/coinrun",
    steps: 1000,
    ppo: (gamma: 0.99),
)"#;

fn good(text: &str) -> Experiment {
    parse_experiment(text, Path::new("x.ron")).expect("valid")
}

fn error(text: &str) -> String {
    parse_experiment(text, Path::new("x.ron")).expect_err("must be refused").to_string()
}

fn values(text: &str) -> String {
    good(text).check().expect_err("must be refused").to_string()
}

#[test]
fn an_experiment_in_utf_16_or_behind_a_mark_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("marked.ron");
    let marked = format!("\u{feff}{GOOD}");
    let utf_16: Vec<u8> = marked.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [marked.into_bytes(), utf_16] {
        std::fs::write(&path, bytes).expect("writable");
        assert_eq!(read_experiment(&path).expect("valid"), good(GOOD));
    }
}

#[test]
fn defaults_fill_in() {
    let experiment = good(GOOD);
    assert_eq!(experiment.ppo.gamma, 0.99);
    assert_eq!(experiment.eval.episodes_per_level, 1);
    assert_eq!(experiment.check(), Ok(()));
    assert_eq!(good(&experiment.to_ron().expect("Unicode")), experiment, "it reads back as it was");
}

#[test]
fn an_unknown_key_is_named_with_its_line_and_its_neighbour() {
    for (good, bad, line, words) in [
        ("gamma", "gama", "x.ron:4:11:", "unknown key `ppo.gama`; did you mean `ppo.gamma`?"),
        ("steps:", "step:", "x.ron:3:5:", "unknown key `step`; did you mean `steps`?"),
        ("steps:", "bases:", "x.ron:3:5:", "unknown key `bases`; did you mean `base`?"),
        ("ppo: (", "pppo: (", "x.ron:4:5:", "did you mean `ppo`?"),
        ("gamma", "horizon", "x.ron:4:11:", "did you mean `score.horizon`?"),
        ("gamma", "qqq", "x.ron:4:11:", "valid keys in `ppo`: activation, adam_eps, anneal_lr,"),
        ("steps:", "qqq:", "x.ron:3:5:", "valid keys: algorithm, arenas,"),
        ("(gamma: 0.99)", "0.99", "x.ron:4:5:", "`ppo` is a section"),
        ("gamma: 0.99", "gamma: 0.99, gamma: 1.0", "x.ron:4:24:", "`ppo.gamma` is there twice"),
    ] {
        let text = error(&GOOD.replace(good, bad));
        assert!(text.starts_with(line) && text.contains(words), "{text}");
    }
}

#[test]
fn a_wrong_value_says_what_was_expected_and_where() {
    for (value, line, words) in [
        ("ppo: (activation: Rellu)", "x.ron:4:", "(did you mean `Relu`?); valid: Relu, Tanh"),
        ("ppo: (\n activation: 3)", "x.ron:5:", "`ppo.activation` cannot be `3`; valid: Relu, Tanh"),
        ("ppo: (lr: fast)", "x.ron:4:", "`ppo.lr` must be a number such as 0.0005, not fast"),
        ("ppo: (epochs: 2.5)", "x.ron:4:", "`ppo.epochs` must be a whole number such as 3, not 2.5"),
        ("ppo: (norm_adv: 1)", "x.ron:4:", "`ppo.norm_adv` must be true or false, not 1"),
        ("ppo: (hidden: 64)", "x.ron:4:", "`ppo.hidden` must be a list in square brackets such as ["),
        ("skills: (augment: [Translate])", "x.ron:4:", "such as [Translate(1)], not [Translate]"),
        ("observation: Pixels", "x.ron:4:", "`observation` cannot be `Pixels`; valid: Vector"),
        ("algorithm: \"score-pp\"", "x.ron:4:", "did you mean `score-ppo`?"),
        ("variants: [\n(nam: \"a\")]", "x.ron:5:", "unknown key `nam` in `variants`; did you mean `name`?"),
        ("variants: [(set: [])]", "x.ron:4:", "`name` is missing in `variants`"),
    ] {
        let text = error(&GOOD.replace("ppo: (gamma: 0.99)", value));
        assert!(text.starts_with(line) && text.contains(words), "{text}");
    }
    let text = error(&GOOD.replace("hard:0..63", "hard:9..3"));
    assert!(text.starts_with("x.ron:2:") && text.contains("`train`") && text.contains("write hard:3..9"), "{text}");
}

#[test]
fn what_is_missing_or_no_experiment_is_named() {
    assert_eq!(
        error(&GOOD.replace("steps: 1000,", "")),
        "x.ron:1:1: `steps` is missing: how long to train, such as steps: 1000000"
    );
    assert!(
        error(&GOOD.replace("train: \"hard:0..63\",", ""))
            .contains("`train` is missing: levels to train on, such as train: ")
    );
    assert!(error(" \n").starts_with("x.ron:1:1: the file is empty"), "{}", error(" \n"));
    assert!(error(&GOOD[..60]).contains("is missing"), "{}", error(&GOOD[..60]));
    assert!(error("[1, 2]").contains("(key: value, ...)"));
    assert!(error(&GOOD.replace("),\n)", ",\n)")).starts_with("x.ron:5:"), "a bracket is missing");
}

#[test]
fn values_that_do_not_go_together_name_the_numbers_and_a_way_out() {
    assert_eq!(
        values(&GOOD.replace("gamma: 0.99", "num_steps: 128, minibatches: 7")),
        "`ppo.minibatches` is 7: must divide `arenas` × `ppo.num_steps` = 64 × 128 = 8192; 8 does"
    );
    assert_eq!(
        values(&GOOD.replace("ppo: (gamma: 0.99)", "worlds: 3")),
        "`worlds` is 3: must divide `arenas` = 64; 4 does"
    );
    let idle = "algorithm: \"sac\", sac: (num_steps: 0), ppo: (anneal_lr: true)";
    assert!(values(&GOOD.replace("ppo: (gamma: 0.99)", idle)).contains("`sac.num_steps` must be at least 1"));
    assert!(values(&GOOD.replace("gamma: 0.99", "gamma: 1.5")).contains("`ppo.gamma` must lie in 0..1"));
}

#[test]
fn who_spoils_a_sound_file_is_named() {
    let error = |text: &str, sets: &[&str]| {
        parse_experiment_with(text, Path::new("x.ron"), sets).expect_err("must be refused").to_string()
    };
    let text = error(GOOD, &["seed=3", "ppo.lr=NaN"]);
    assert!(text.starts_with("`ppo.lr=NaN`: `ppo.lr` must be"), "{text}");
    let text = error(GOOD, &["arenas=6", "worlds=4", "seed=3"]);
    assert!(text.starts_with("`arenas=6`, `worlds=4`: `worlds` is 4"), "{text}");
    let bad = GOOD.replace("gamma: 0.99", "gamma: 1.5");
    let text = error(&bad, &["seed=3"]);
    assert!(text.starts_with("x.ron:4:") && text.contains(": `ppo.gamma` must lie"), "wrong by itself: {text}");
    assert_eq!(error(GOOD, &["steps=0"]), "`steps=0`: must be at least 1", "the key is named once");
    assert!(error(GOOD, &["ppo.lr=0", "ppo.lr=-1"]).starts_with("`ppo.lr=-1`: "), "the last one counts");
}

#[test]
fn held_out_levels_are_never_trained_on() {
    assert!(values(&GOOD.replace("hard:64..127", "hard:63..127")).contains("hard:63..127"));
}

#[test]
fn presets_lie_below_one_another_and_below_the_file() {
    let text = GOOD.replace("game:", "base: [\"coinrun-ppo\", \"d4rl-ppo\"], game:");
    let experiment = good(&text);
    assert_eq!(experiment.ppo.gamma, 0.99, "the file's own");
    assert_eq!(experiment.steps, 1000, "the file's own");
    assert_eq!((experiment.arenas, experiment.ppo.num_steps), (1, 2048), "the later preset's");
    assert_eq!(experiment.ppo.ent_coef, 0.0, "the later preset's");
    assert_eq!(experiment.eval.episodes_per_level, 1, "the default");
    // The file gives the default of a value that a preset changes: the file's value still applies.
    let experiment = good(&text.replace("gamma: 0.99", "lr: 0.0005"));
    assert_eq!((experiment.ppo.lr, experiment.ppo.gamma), (0.0005, 0.99));
}

#[test]
fn every_preset_makes_an_experiment_with_settings_of_the_paper() {
    let with = |base: &str| {
        let text = GOOD.replace("steps: 1000,", "").replace("gamma: 0.99", "").replace("game:", base);
        let experiment = good(&text);
        assert_eq!(experiment.check(), Ok(()), "{base}");
        experiment
    };
    for preset in PRESETS {
        assert!(!preset.about().is_empty() && preset.text.starts_with("// "), "{}", preset.name);
        with(&format!("steps: 1, base: [\"{}\"], game:", preset.name));
    }
    let coinrun = with("base: [\"coinrun-ppo\", \"skill-paper\"], game:");
    let rows = coinrun.steps_per_update() / coinrun.ppo.minibatches as u64;
    assert_eq!((coinrun.ppo.lr, rows, coinrun.ppo.num_steps, coinrun.ppo.epochs), (5e-4, 256, 256, 3));
    assert_eq!((coinrun.ppo.gamma, coinrun.ppo.ent_coef, coinrun.steps), (0.999, 0.01, 7_500_000));
    assert_eq!((coinrun.skills.batch, coinrun.skills.epochs, coinrun.skills.gru_layers), (50, 600, 4));
    let d4rl = with("base: [\"d4rl-ppo\", \"skill-paper\", \"skill-released\", \"score-released-d4rl\"], game:");
    let rows = d4rl.steps_per_update() / d4rl.ppo.minibatches as u64;
    assert_eq!((d4rl.ppo.lr, rows, d4rl.ppo.num_steps, d4rl.ppo.epochs), (3e-4, 64, 2048, 10));
    assert_eq!(d4rl.ppo_config().total_updates, Some(d4rl.updates()), "the rate falls over the whole training");
    let sac = with("base: [\"d4rl-sac\"], algorithm: \"sac\", game:").sac;
    assert_eq!((sac.batch, sac.buffer, sac.tau, sac.gamma), (256, 1_000_000, 0.005, 0.99));
    let sac = with("base: [\"coinrun-sac\"], algorithm: \"sac\", game:").sac;
    assert_eq!((sac.batch, sac.buffer, sac.actor_lr, sac.gamma), (64, 10_000, 3e-4, 0.99));
    assert_eq!((d4rl.score.skill_interval, d4rl.skills.latent_reg), (1, 0.1));
    let base = "base: [\"coinrun-ppo\", \"skill-paper\", \"skill-released\", \"score-released-coinrun\"], game:";
    let released = with(base);
    assert_eq!((released.ppo.reward_gamma, released.ppo.minibatches, released.skills.window), (Some(0.99), 8, 5));
}

#[test]
fn files_can_be_built_on_files_and_errors_name_the_right_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("writable");
    let read = |name: &str| read_experiment(&folder.path().join(name));
    write("good.ron", GOOD);
    write("middle.ron", "(base: [\"coinrun-ppo\", \"good.ron\"], ppo: (lr: 0.1))");
    write("top.ron", "(base: [\"middle.ron\"],\n ppo: (gamma: 0.5))");
    let experiment = read("top.ron").expect("valid");
    assert_eq!((experiment.ppo.lr, experiment.ppo.gamma, experiment.steps), (0.1, 0.5, 1000));

    // A wrong value is reported in its own file, even if another file overrides it.
    write("middle.ron", "(base: [\"good.ron\"],\n ppo: (gamma: \"high\"))");
    let text = read("top.ron").expect_err("wrong").to_string();
    assert!(text.contains("middle.ron:2:") && text.contains("`ppo.gamma` must be a number"), "{text}");
    write("middle.ron", "(base: [\"good.ron\"],\n\n ppo: (gama: 0.5))");
    let text = read("top.ron").expect_err("wrong").to_string();
    assert!(text.contains("middle.ron:3:") && text.contains("`ppo.gamma`"), "{text}");

    write("middle.ron", "(base: [\"top.ron\"])");
    let text = read("top.ron").expect_err("a circle").to_string();
    assert!(text.contains("goes round in a circle: ") && text.contains("top.ron → "), "{text}");
    assert!(text.matches("top.ron").count() == 2 && text.matches("middle.ron").count() == 2, "{text}");
    for depth in 0..10 {
        write(&format!("deep{depth}.ron"), &format!("(base: [\"deep{}.ron\"])", depth + 1));
    }
    let text = read("deep0.ron").expect_err("too deep").to_string();
    assert!(text.contains("more than 8 files deep") && text.contains("deep9.ron"), "{text}");
    write("top.ron", "(\n base: [\"coinrun-pop\"])");
    let text = read("top.ron").expect_err("unknown").to_string();
    assert!(text.contains("top.ron:2:") && text.contains("did you mean `coinrun-ppo`?"), "{text}");
    write("top.ron", "(base: [\"gone.ron\"])");
    assert!(read("top.ron").expect_err("gone").to_string().contains("gone.ron, which cannot be read"));
    write("top.ron", "(base: \"good.ron\")");
    assert!(read("top.ron").expect_err("no list").to_string().contains("must be a list"));
}

#[test]
fn a_file_that_is_not_there_is_named_with_the_command_that_begins_one() {
    let text = read_experiment(Path::new("none.ron")).expect_err("not there").to_string();
    assert!(
        text.starts_with("cannot read none.ron: ") && text.ends_with("`playbot config show --out none.ron`"),
        "{text}"
    );
}

#[test]
fn a_key_or_value_of_ten_megabytes_is_named_with_its_place_in_less_than_a_kilobyte() {
    let big = "k".repeat(10_000_000);
    for (good, bad, place, words) in [
        ("steps: 1000", format!("steps: 1000, {big}: 3"), "x.ron:3:18: ", "unknown key `kkk"),
        ("gamma: 0.99", format!("{big}: 3"), "x.ron:4:11: ", "unknown key `ppo.kkk"),
        ("gamma: 0.99", format!("{big}: 3, {big}: 4"), "x.ron:4:", "k` is there twice"),
        ("gamma: 0.99", format!("gamma: {big}"), "x.ron:4:", "`ppo.gamma` must be a number"),
        ("gamma: 0.99", format!("activation: {big}"), "x.ron:4:", "`ppo.activation` cannot be `kkk"),
        ("\"hard:0..63\"", format!("\"{big}\""), "x.ron:2:", "`train`: `kkk"),
        ("game:", format!("base: [\"{big}\"], game:"), "x.ron:2:", "unknown preset `kkk"),
        ("game:", format!("base: [\"{big}.ron\"], game:"), "x.ron:2:", ".ron, which cannot be read"),
    ] {
        let text = error(&GOOD.replace(good, &bad));
        assert!(text.len() < 1024, "{} bytes: {}", text.len(), &text[..1000]);
        assert!(text.starts_with(place) && text.contains(words), "{text}");
    }
}

#[test]
fn values_of_every_kind_come_out_as_written() {
    let text = r##"// a comment, with ( and "
    Experiment( /* and /* another ) */ one */ a: 1, b : -0.5e-3 , c: "x, ) \" y", d: r#"raw " )"#,
        e: [1, (2, 3)], f: /* before */ Some(Relu), g: ')', h: { "k": (z: 1) }, i: (x: 1, y: (w: 2)), // last )
        j: Named(x: "//"), k: '"',
    )"##;
    let expected = [
        ("a", "1"),
        ("b", "-0.5e-3"),
        ("c", r#""x, ) \" y""#),
        ("d", r##"r#"raw " )"#"##),
        ("e", "[1, (2, 3)]"),
        ("f", "Some(Relu)"),
        ("g", "')'"),
        ("h", r#"{ "k": (z: 1) }"#),
        ("i", "(x: 1, y: (w: 2))"),
        ("j", r#"Named(x: "//")"#),
        ("k", "'\"'"),
    ];
    assert_eq!(fields(text), Some(expected.to_vec()));
    assert_eq!(fields("()"), Some(Vec::new()));
    assert_eq!(fields("( )"), Some(Vec::new()));
    let extended = "#![enable(implicit_some)]\n#![enable(unwrap_newtypes)] // on\n(a: 1)";
    assert_eq!(fields(extended), Some(vec![("a", "1")]));
}

#[test]
fn a_text_without_keys_is_no_struct() {
    for text in ["3", "[1]", "[]", "(1, 2)", "\"a: 1\"", "Relu", "Some(3)", "{\"a\": 1}", ""] {
        assert_eq!(fields(text), None, "{text}");
    }
}

#[test]
fn positions_count_from_one_in_characters() {
    let text = "(\n  ä: 1,\n  b: 2)";
    let fields = fields(text).expect("a struct");
    let at = |part: &str| position(text, offset(text, part));
    assert_eq!(at(fields[0].1), (2, 6));
    assert_eq!(at(fields[1].0), (3, 3));
}
