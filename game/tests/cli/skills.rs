//! Tests of `playbot skills`: rollouts of a grid of skills, as lines, as a file and as a page with names.

use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::Path,
    process::Stdio,
};

use serde_json::Value;

use crate::program::{command, done, ended, json_lines};

/// Writes `clone.policy`, behaviour cloning from a few recordings with skills of three values.
fn learned(folder: &Path) {
    done(folder, &["record", "coinrun", "--levels", "easy:0..3", "--out", "a.demo"]);
    let small = ["skills.latent=3", "skills.epochs=1", "skills.hidden=[16]", "skills.encoder_hidden=8", "demos=a.demo"];
    let sets: Vec<&str> = small.iter().flat_map(|set| ["--set", *set]).collect();
    done(folder, &[&["learn-skills", "coinrun", "--out", "skills.safetensors"], &sets[..]].concat());
    let export = ["policy", "export", "--skills", "skills.safetensors", "--out", "clone.policy", "coinrun"];
    done(folder, &[&export[..], &sets].concat());
}

/// Sends a request to the page at an address, and returns the JSON of its answer.
fn asked(address: &str, method: &str, path: &str, body: &str) -> Value {
    let mut stream = TcpStream::connect(address).expect("it listens");
    let length = body.len();
    write!(stream, "{method} {path} HTTP/1.1\r\nHost: {address}\r\nContent-Length: {length}\r\n\r\n{body}")
        .expect("it reads");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers");
    let (_, json) = answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("{answer}"));
    serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {answer}"))
}

#[test]
fn each_skill_is_rolled_out_from_one_state() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    learned(folder);
    let skills = ["skills", "coinrun", "--mode", "easy", "--policy", "clone.policy", "--level", "7", "--tick", "5"];
    let with = |more: &[&'static str]| [&skills[..], more].concat();

    let (text, _) = done(folder, &with(&["--ticks", "12", "--json"]));
    let tiles = json_lines(&text);
    assert_eq!(tiles.len(), 25);
    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect() };
    let starts: Vec<Vec<f64>> = tiles.iter().map(|tile| numbers(&tile["path"][0])).collect();
    assert!(starts[0].len() == 2 && starts.iter().all(|start| *start == starts[0]), "one state: {starts:?}");
    let corners = [0, 4, 24].map(|index: usize| numbers(&tiles[index]["z"]));
    assert!(corners[0][0] < 0.0 && corners[0][1] > 0.0 && corners[1][0] > 0.0 && corners[2][1] < 0.0, "{corners:?}");
    assert!(tiles.iter().all(|tile| numbers(&tile["z"])[2] == 0.0));
    assert_eq!(text, done(folder, &with(&["--ticks", "12", "--json"])).0, "the same lines each time");
    // From the first tick of the episode as well, which ends what was followed before it.
    let start = ["skills", "coinrun", "--mode", "easy", "--policy", "clone.policy", "--level", "7", "--ticks", "6"];
    let (text, _) = done(folder, &[&start[..], &["--json"]].concat());
    assert!(json_lines(&text).iter().all(|tile| numbers(&tile["path"][0])[0] > 0.0), "it stands in the level: {text}");
    done(folder, &[&start[..], &["--out", "start.html"]].concat());
    let page = fs::read_to_string(folder.join("start.html")).expect("written");
    let pictures: BTreeSet<&str> =
        page.split("data:image/png;base64,").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert_eq!(pictures.len(), 25, "each shows the bars of its own skill");
    let (drawn, _) = done(folder, &with(&["--ticks", "6", "--draw", "3", "--json"]));
    let drawn: Vec<Vec<f64>> = json_lines(&drawn).iter().map(|tile| numbers(&tile["z"])).collect();
    assert!(drawn.len() == 3 && drawn[0] != drawn[1], "{drawn:?}");

    done(folder, &with(&["--ticks", "6", "--out", "skills.html"]));
    let page = fs::read_to_string(folder.join("skills.html")).expect("written");
    assert_eq!(page.matches("data:image/png;base64,").count(), 25);
    for address in ["src=\"http", "href=\"http", "@import", "url("] {
        assert!(!page.contains(address), "{address}");
    }

    let (_, said) = ended(folder, &with(&["--dims", "0,3", "--json"]), 3);
    assert!(said.contains("z has 3 values, counted from 0"), "{said}");
    let late = ["skills", "coinrun", "--mode", "easy", "--policy", "clone.policy", "--tick", "99999", "--json"];
    let (_, said) = ended(folder, &late, 3);
    assert!(said.contains("there is no tick 99999"), "{said}");
    let (_, said) = ended(folder, &["skills", "coinrun", "--bot", "random"], 3);
    assert!(said.contains("follows no skills"), "{said}");
    let (_, said) = ended(folder, &["skills", "coinrun"], 3);
    assert!(said.contains("add --run or --policy"), "{said}");
}

#[test]
fn the_page_answers_and_keeps_names_which_pictures_then_show() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    learned(folder);
    let args = [
        "skills",
        "coinrun",
        "--mode",
        "easy",
        "--policy",
        "clone.policy",
        "--level",
        "7",
        "--ticks",
        "5",
        "--port",
        "0",
    ];
    let mut child = command(folder, &args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts");
    let lines = BufReader::new(child.stderr.take().expect("a pipe")).lines().map_while(Result::ok);
    let address = lines.into_iter().find_map(|line| {
        let (_, address) = line.split_once("http://")?;
        address.split(';').next().map(str::to_owned)
    });
    let address = address.expect("the page has an address");
    let about = asked(&address, "GET", "/about", "");
    assert_eq!((&about["about"]["latent"], about["skills"].as_array().map(Vec::len)), (&3.into(), Some(25)), "{about}");
    let tile = asked(&address, "GET", "/tile?z=0.5,-0.5,0", "");
    assert!(
        tile["picture"].as_str().is_some_and(|picture| picture.starts_with("data:image/png;base64,iVBOR")),
        "{tile}"
    );
    assert_eq!((&tile["ticks"], &tile["name"]), (&5.into(), &Value::Null), "{tile}");
    let wrong = asked(&address, "GET", "/tile?z=0.5", "");
    assert!(wrong["error"].as_str().is_some_and(|words| words.contains("other values")), "{wrong}");
    let named = asked(&address, "POST", "/name", r#"{"name":"leap","z":[0.5,-0.5,0],"radius":0.4}"#);
    assert_eq!(named["names"][0]["name"], "leap", "{named}");
    assert_eq!(asked(&address, "GET", "/tile?z=0.6,-0.5,0", "")["name"], "leap");
    let refused = asked(&address, "POST", "/name", "no JSON");
    assert!(refused["error"].is_string(), "{refused}");
    child.kill().expect("it runs");
    child.wait().expect("it ends");

    let names = fs::read_to_string(folder.join("clone.skill-names.json")).expect("kept beside the policy");
    assert!(names.contains("leap"), "{names}");
    let tiles =
        ["skills", "coinrun", "--mode", "easy", "--policy", "clone.policy", "--level", "7", "--ticks", "5", "--json"];
    let tiles = json_lines(&done(folder, &tiles).0);
    assert!(
        tiles.iter().any(|tile| tile["name"] == "leap") && tiles.iter().any(|tile| tile["name"].is_null()),
        "{tiles:?}"
    );
    fs::write(folder.join("clone.skill-names.json"), "{").expect("writable");
    let (_, said) = ended(folder, &["view", "coinrun", "--policy", "clone.policy", "--level", "7"], 3);
    assert!(said.contains("clone.skill-names.json") && said.contains("not a list of named skills"), "{said}");
}
