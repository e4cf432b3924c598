//! Rewriting of an example with a `main` into a file that another `main` can include.

/// Turns `main` into `pub fn game(app: &mut App)`: without `DefaultPlugins`, which belong to the maker of the app, and
/// without `run`. Comments on the whole file become ordinary ones, since `include!` takes no inner ones. The text of
/// `stand_ins` is put below, and its plugin function of that name is added first, if it has one.
///
/// # Errors
///
/// The example does not look as expected: a part to be changed is missing, or is there twice.
pub fn rewrite(example: &str, stand_ins: Option<&str>) -> Result<String, String> {
    let mut text: String = example.lines().map(|line| line.replacen("//!", "//", 1) + "\n").collect();
    let has_plugin = stand_ins.is_some_and(|text| text.contains("fn stand_ins("));
    let plugin = if has_plugin { "        .add_plugins(stand_ins)\n" } else { "" };
    for (from, to) in [
        ("fn main() {\n    App::new()\n", "pub fn game(app: &mut App) {\n    app\n"),
        ("        .add_plugins(DefaultPlugins)\n", plugin),
        ("\n        .run();\n", ";\n"),
    ] {
        match text.matches(from).count() {
            1 => text = text.replacen(from, to, 1),
            n => return Err(format!("`{}` is there {n} times instead of once", from.trim())),
        }
    }
    Ok(text + stand_ins.map(|text| format!("\n{text}")).unwrap_or_default().as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = "\
//! A game.
use bevy::prelude::*;

fn main() {
    App::new()
        .add_plugins(DefaultPlugins)
        .add_systems(Startup, setup)
        .run();
}
";

    #[test]
    fn main_becomes_a_function_over_an_app() {
        let game = rewrite(EXAMPLE, None).expect("it is as examples are");
        assert_eq!(
            game,
            "\
// A game.
use bevy::prelude::*;

pub fn game(app: &mut App) {
    app
        .add_systems(Startup, setup);
}
"
        );
    }

    #[test]
    fn stand_ins_are_added_first_and_stand_below() {
        let game = rewrite(EXAMPLE, Some("fn stand_ins(_: &mut App) {}\n")).expect("it is as examples are");
        assert!(game.contains("    app\n        .add_plugins(stand_ins)\n        .add_systems"), "{game}");
        assert!(game.ends_with("}\n\nfn stand_ins(_: &mut App) {}\n"), "{game}");
    }

    #[test]
    fn stand_ins_without_a_plugin_only_stand_below() {
        let game = rewrite(EXAMPLE, Some("mod rand {}\n")).expect("it is as examples are");
        assert!(!game.contains("stand_ins"), "{game}");
        assert!(game.ends_with("}\n\nmod rand {}\n"), "{game}");
    }

    #[test]
    fn an_example_that_looks_otherwise_is_refused() {
        let other = EXAMPLE.replace("        .run();\n", "");
        let error = rewrite(&other, None).expect_err("it runs nothing");
        assert!(error.contains(".run();"), "{error}");
        let twice = format!("{EXAMPLE}{EXAMPLE}");
        assert!(rewrite(&twice, None).is_err_and(|error| error.contains("2 times")));
    }
}
