//! Tests of `serve --mcp` through a client that speaks as that of a language model.

use std::{fs, path::Path};

use playbot_shell::{ModelClient, from_base64};
use serde_json::{Value, json};

use crate::program::{code, command, done, ended, errors, playbot};

/// Starts a session of a game.
fn session(folder: &Path, args: &[&str]) -> ModelClient {
    ModelClient::of(command(folder, &[&["serve"], args, &["--mcp"]].concat()), "tester")
}

#[test]
fn a_model_plays_to_the_goal_and_its_session_replays() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let mut client = session(folder, &["coinrun", "--levels", "easy:0..9", "--render", "96"]);
    let tools = client.request("tools/list", json!({}))["result"]["tools"].take();
    let names: Vec<&str> = tools.as_array().expect("a list").iter().filter_map(|tool| tool["name"].as_str()).collect();
    assert_eq!(names, ["observe", "act", "level", "reset", "findings", "replay"]);
    for tool in tools.as_array().expect("a list") {
        for part in ["title", "description"] {
            assert!(tool[part].as_str().is_some_and(|text| !text.is_empty()), "{tool}");
        }
        for schema in ["inputSchema", "outputSchema"] {
            assert_eq!(tool[schema]["type"], "object", "{tool}");
        }
        assert!(tool["annotations"]["readOnlyHint"].is_boolean(), "{tool}");
    }
    assert!(tools[1]["inputSchema"]["properties"]["action"].to_string().contains("\"right+jump\""));

    let level = client.data("level", json!({ "level": 3 }));
    assert_eq!((&level["mode"], &level["levels"]["last"], &level["played"]), (&json!("easy"), &json!(9), &Value::Null));
    assert!(level["shown"]["text"].as_str().is_some_and(|plan| plan.lines().count() > 5), "{level}");
    assert_eq!(level["picture"], json!([96, 96]));

    assert!(client.refused("observe", json!({})).contains("call `reset`"));
    let begun = client.data("reset", json!({ "level": "easy:3" }));
    assert_eq!((&begun["level"], &begun["tick"], &begun["over"]), (&json!(3), &json!(0), &json!(false)));
    assert!(begun["agents"][0]["values"].is_null(), "there are too many to show them unasked");
    let played = client.data("act", json!({ "action": "right", "ticks": 60, "names": ["vx", "coin_"] }));
    assert_eq!((&played["ticks"], &played["stopped"]), (&json!(60), &Value::Null));
    let values = played["agents"][0]["values"].as_object().expect("values");
    assert!(values.contains_key("vx") && values.contains_key("coin_dx") && !values.contains_key("vy"));
    let seen = client.call("observe", json!({ "picture": true }));
    assert!(seen["structuredContent"]["agents"][0]["values"].as_object().is_some_and(|values| values.len() > 100));
    let picture = &seen["content"][1];
    assert_eq!((&picture["type"], &picture["mimeType"]), (&json!("image"), &json!("image/png")));
    let bytes = from_base64(picture["data"].as_str().expect("text"));
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let mut pixels = vec![0; decoder.output_buffer_size().expect("a size")];
    let info = decoder.next_frame(&mut pixels).expect("a PNG");
    assert_eq!((info.width, info.height), (96, 96));
    assert!(pixels.iter().any(|value| *value != pixels[0]), "it shows something");

    let won = client.data("act", json!({ "action": 8, "ticks": 600 }));
    let agent = &won["agents"][0];
    assert_eq!((&won["over"], &won["stopped"]), (&json!(true), &json!("the episode is over")));
    assert_eq!(
        (&agent["terminated"], &agent["truncated"], &agent["success"]),
        (&json!(true), &json!(false), &json!(true))
    );
    assert_eq!((&agent["reward"], &agent["return"]), (&json!(10.0), &json!(10.0)));
    assert!(client.refused("act", json!({ "action": "right" })).contains("call `reset`"));
    let again = client.data("replay", json!({}));
    assert_eq!((&again["same"], &again["ticks"], &again["end"]), (&json!(true), &won["tick"], &json!("terminated")));

    let found = client.data("findings", json!({ "report": "The coin\nhangs in the air.", "tick": 80 }));
    let file = found["reported"]["file"].as_str().expect("a file").to_owned();
    assert!(file.starts_with("runs/mcp/findings/easy-3.report.tester-"), "{file}");
    assert_eq!(found["findings"][0]["message"], "The coin hangs in the air.");

    // In turn, and left without a word in the middle of the episode.
    assert_eq!(client.data("reset", json!({}))["level"], 4);
    client.data("act", json!({ "action": "right", "ticks": 20 }));
    let (code, said) = client.leave();
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("2 episodes, ") && said.contains("1 finding, recorded in runs/mcp/session.demo"), "{said}");

    let verified = done(folder, &["demo", "verify", "runs/mcp"]).0;
    assert!(verified.contains("2 episodes, ") && verified.contains("all as recorded"), "{verified}");
    let shown = done(folder, &["demo", "show", "runs/mcp/session.demo"]).0;
    assert!(shown.contains("played by     tester") && shown.contains("cut off"), "{shown}");
    let replayed = done(folder, &["replay", &file]).0;
    assert!(replayed.contains("it happens again at tick 80"), "{replayed}");
    done(folder, &["replay", &file, "--minimise", "--out", "short.finding", "--replays", "20"]);
    assert!(done(folder, &["replay", "short.finding"]).0.contains("it happens again"));
    // The next session has a folder of its own.
    let (code, said) = session(folder, &["coinrun", "--levels", "easy:0..9"]).leave();
    assert!(code == 0 && said.contains("recorded in runs/mcp-2"), "{said}");
}

#[test]
fn numbers_are_played_by_name() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut client = session(temporary.path(), &["maze2d", "--out", "played"]);
    let first = client.data("reset", json!({}))["agents"][0]["values"]["x"].as_f64().expect("a number");
    let down = json!({ "action": { "push x (down the rows)": 1.0 }, "ticks": 20 });
    let then = client.data("act", down)["agents"][0]["values"]["x"].as_f64().expect("a number");
    assert!(then > first + 0.1, "{first} {then}");
    client.data("act", json!({ "action": [-1.0, 0.5], "ticks": 5 }));
    assert!(client.refused("act", json!({ "action": { "push": 1.0 } })).contains("push y (along the columns)"));
    assert_eq!(client.data("replay", json!({}))["same"], true);
    client.leave();
    assert!(done(temporary.path(), &["demo", "verify", "played"]).0.contains("25 ticks replayed, all as recorded"));
}

#[test]
fn beyond_its_bounds_a_session_can_still_be_read() {
    let temporary = tempfile::tempdir().expect("a folder");
    let bounds = ["coinrun", "--levels", "easy:0..9", "--max-steps", "30", "--max-ticks-per-call", "20"];
    let mut client = session(temporary.path(), &bounds);
    client.data("reset", json!({}));
    let words = client.refused("act", json!({ "action": "right", "ticks": 21 }));
    assert!(words.contains("a call plays 1 to 20 (--max-ticks-per-call)"), "{words}");
    assert!(client.refused("act", json!({ "action": "right", "ticks": 0 })).contains("1 to 20"));
    assert_eq!(client.data("act", json!({ "action": "right", "ticks": 20 }))["ticks_left"], 10);
    let last = client.data("act", json!({ "action": "right", "ticks": 20 }));
    assert_eq!(last["ticks"], 10);
    assert!(last["stopped"].as_str().is_some_and(|words| words.contains("its 30 ticks (--max-steps)")), "{last}");
    for (tool, arguments) in [("act", json!({ "action": "right" })), ("reset", json!({}))] {
        let words = client.refused(tool, arguments);
        assert!(words.contains("--max-steps") && words.contains("saved in runs/mcp/session.demo"), "{words}");
    }
    assert_eq!(client.data("observe", json!({}))["tick"], 30);
    assert_eq!(client.data("replay", json!({}))["same"], true);
    assert_eq!(client.data("findings", json!({}))["episodes"][0]["ticks"], 30);
    client.data("level", json!({}));
    client.leave();
    assert!(done(temporary.path(), &["demo", "verify", "runs/mcp"]).0.contains("30 ticks replayed, all as recorded"));
}

#[test]
fn what_is_wrong_is_said_with_what_is_right() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut client = ModelClient::silent(command(temporary.path(), &["serve", "coinrun", "--mcp"]));
    assert_eq!(client.wrong("tools/list", json!({})).0, -32600);
    assert_eq!(client.request("ping", json!({}))["result"], json!({}));
    assert_eq!(client.wrong("initialize", json!({})).0, -32602);
    // An older client is answered in its version, a later one in that of the program.
    for (wanted, answered) in [("2024-11-05", "2024-11-05"), ("2099-01-01", "2025-06-18")] {
        let greeted = client.request("initialize", json!({ "protocolVersion": wanted }));
        assert_eq!(greeted["result"]["protocolVersion"], answered);
    }
    for (line, number) in [("{", -32700), ("[]", -32600), ("\u{1}", -32700)] {
        client.say(line);
        let answer = client.hear();
        assert_eq!((&answer["id"], &answer["error"]["code"]), (&Value::Null, &json!(number)), "{line}");
    }
    // A notification gets no answer.
    client.say(r#"{"jsonrpc":"2.0","method":"notifications/unknown"}"#);
    for (method, params, number, words) in [
        ("resources/list", json!({}), -32601, "`resources/list`"),
        ("tool/list", json!({}), -32601, "did you mean `tools/list`?"),
        ("tools/list", json!({ "cursor": "2" }), -32602, "cursor"),
        ("tools/call", json!({}), -32602, "`name`"),
        ("tools/call", json!({ "name": "obserev" }), -32602, "did you mean `observe`?"),
        ("tools/call", json!({ "name": "act", "arguments": [] }), -32602, "are an object"),
        ("tools/call", json!({ "name": "act", "arguments": { "tick": 1 } }), -32602, "expected one of `action`"),
        ("tools/call", json!({ "name": "reset", "arguments": { "level": 0.5 } }), -32602, "`reset`"),
    ] {
        let (code, said) = client.wrong(method, params);
        assert!(code == number && said.contains(words), "{method}: {code} {said}");
    }
    for (tool, arguments, words) in [
        ("act", json!({ "action": "right" }), "call `reset`"),
        ("replay", json!({}), "nothing was played yet"),
        ("findings", json!({ "report": "it shakes" }), "nothing was played yet"),
        ("reset", json!({ "level": 500 }), "take one from 0 to 499"),
        ("reset", json!({ "level": "Cave" }), "take a number from 0 to 499"),
        ("observe", json!({ "names": ["coin_sene"] }), "did you mean `coin_seen`?"),
    ] {
        let said = client.refused(tool, arguments);
        assert!(said.contains(words), "{tool}: {said}");
    }
    client.data("reset", json!({}));
    for (arguments, words) in [
        (json!({ "action": "jmup" }), "did you mean `jump`?); valid: left+down, left"),
        (json!({ "action": 15 }), "numbered from 0 to 14"),
        (json!({}), "name an `action`"),
        (json!({ "actions": { "left": "jump" } }), "this game has one agent"),
    ] {
        let said = client.refused("act", arguments);
        assert!(said.contains(words), "{said}");
    }
    assert!(client.refused("replay", json!({ "episode": 1 })).contains("from 0 to 0"));
    client.data("act", json!({ "action": "jump" }));
    assert!(client.refused("findings", json!({ "report": "x", "tick": 1 })).contains("no tick 1"));
    assert!(client.refused("findings", json!({ "report": " " })).contains("a sentence"));
    let (code, said) = client.leave();
    assert_eq!(code, 0, "{said}");
}

#[test]
fn options_of_other_clients_are_refused() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::create_dir_all(folder.join("full")).expect("writable");
    fs::write(folder.join("full/a"), "in the way").expect("writable");
    for (args, words) in [
        (&["--mcp", "--arenas", "2"][..], "a model plays one arena"),
        (&["--mcp", "--transport", "tcp"], "--transport"),
        (&["--mcp", "--listen", "here"], "--listen"),
        (&["--mcp", "--autoreset", "disabled"], "--autoreset"),
        (&["--mcp", "--once"], "--once"),
        (&["--max-steps", "5"], "--mcp"),
        (&["--mcp", "--max-steps", "0"], "--max-steps"),
        (&["--mcp", "--out", "full"], "name a new folder with --out"),
        (&["--mcp", "--levels", "hardest:0..9"], "hardest"),
    ] {
        let refused = playbot(folder, &[&["serve", "coinrun"], args].concat());
        assert!(code(&refused) == 3 && errors(&refused).contains(words), "{args:?}: {}", errors(&refused));
        assert!(refused.stdout.is_empty() && !folder.join("runs").exists(), "{args:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_session_that_is_stopped_is_recorded() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut client = session(temporary.path(), &["coinrun", "--levels", "easy:0..9"]);
    client.data("reset", json!({}));
    client.data("act", json!({ "action": "right", "ticks": 7 }));
    let id = client.id().to_string();
    assert!(std::process::Command::new("kill").args(["-TERM", &id]).status().expect("kill is there").success());
    let (code, said) = client.to_end();
    assert!(code == 143 && said.contains("stopping") && said.contains("7 ticks"), "{code}: {said}");
    let (verified, _) = ended(temporary.path(), &["demo", "verify", "runs/mcp"], 0);
    assert!(verified.contains("7 ticks replayed, all as recorded"), "{verified}");
}
