//! A client of `serve --mcp`, as that of a language model: it starts the program, and speaks over its standard input and
//! output.

use std::{
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

use serde_json::{Value, json};

use crate::waiting::Heard;

/// A conversation with a program.
pub struct ModelClient {
    program: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    errors: Heard,
    requests: u64,
}

impl ModelClient {
    /// Starts a program, and says nothing yet.
    pub fn silent(mut command: Command) -> Self {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut program = command.spawn().expect("the program starts");
        let output = BufReader::new(program.stdout.take().expect("piped"));
        let errors = Heard::of(program.stderr.take().expect("piped"));
        let input = program.stdin.take();
        Self { program, input, output, errors, requests: 0 }
    }

    /// Starts a program, and greets it as a client of this name.
    #[track_caller]
    pub fn of(command: Command, name: &str) -> Self {
        let mut client = Self::silent(command);
        let about = json!({ "protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": { "name": name } });
        let greeted = client.request("initialize", about);
        assert_eq!(greeted["result"]["protocolVersion"], "2025-06-18", "{greeted}");
        client.say(r#"{"jsonrpc":"2.0","method":"notifications/initialized"}"#);
        client
    }

    /// Sends a line.
    pub fn say(&mut self, line: &str) {
        writeln!(self.input.as_mut().expect("it has not left"), "{line}").expect("the program is there");
    }

    /// Returns the next line of the program, which is JSON.
    #[track_caller]
    pub fn hear(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("readable");
        serde_json::from_str(&line).unwrap_or_else(|_| panic!("no JSON: `{line}`; {}", self.errors.text()))
    }

    /// Sends a request, and returns the whole answer.
    #[track_caller]
    pub fn request(&mut self, method: &str, params: Value) -> Value {
        self.requests += 1;
        let id = self.requests;
        self.say(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params }).to_string());
        let answer = self.hear();
        assert_eq!((&answer["id"], &answer["jsonrpc"]), (&json!(id), &json!("2.0")), "{answer}");
        answer
    }

    /// Calls a tool, and returns its result.
    #[track_caller]
    pub fn call(&mut self, tool: &str, arguments: Value) -> Value {
        let mut answer = self.request("tools/call", json!({ "name": tool, "arguments": arguments }));
        assert!(answer["result"].is_object(), "{tool}: {answer}");
        answer["result"].take()
    }

    /// Calls a tool that can do it, and returns its data.
    #[track_caller]
    pub fn data(&mut self, tool: &str, arguments: Value) -> Value {
        let mut result = self.call(tool, arguments);
        assert_eq!(result["isError"], false, "{tool}: {result}");
        let text = result["content"][0]["text"].as_str().expect("text");
        let told: Value = serde_json::from_str(text).expect("JSON");
        assert_eq!(told, result["structuredContent"], "text and data are the same");
        result["structuredContent"].take()
    }

    /// Calls a tool that cannot do it, and returns why.
    #[track_caller]
    pub fn refused(&mut self, tool: &str, arguments: Value) -> String {
        let result = self.call(tool, arguments);
        assert_eq!(result["isError"], true, "{tool}: {result}");
        result["content"][0]["text"].as_str().expect("text").to_owned()
    }

    /// Sends a request that is an error of the protocol, and returns its number and its words.
    #[track_caller]
    pub fn wrong(&mut self, method: &str, params: Value) -> (i64, String) {
        let answer = self.request(method, params);
        let error = &answer["error"];
        (error["code"].as_i64().expect("an error"), error["message"].as_str().expect("words").to_owned())
    }

    /// Returns the number of the process.
    pub fn id(&self) -> u32 {
        self.program.id()
    }

    /// Leaves without a word, and returns exit code and messages of the program. It has written no line that was not read.
    #[track_caller]
    pub fn leave(mut self) -> (i32, String) {
        drop(self.input.take());
        self.to_end()
    }

    /// Waits for the end of the program.
    #[track_caller]
    pub fn to_end(mut self) -> (i32, String) {
        let mut rest = String::new();
        self.output.read_line(&mut rest).expect("readable");
        assert_eq!(rest, "", "not asked for");
        let status = self.program.wait().expect("a child");
        (status.code().expect("no signal"), self.errors.to_end())
    }
}

impl Drop for ModelClient {
    fn drop(&mut self) {
        // A test that has failed leaves it behind.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// Returns the bytes of a text in base 64.
pub fn from_base64(text: &str) -> Vec<u8> {
    let value = |letter: u8| match letter {
        b'A'..=b'Z' => u32::from(letter - b'A'),
        b'a'..=b'z' => u32::from(letter - b'a') + 26,
        b'0'..=b'9' => u32::from(letter - b'0') + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("`{}` is no letter of base 64", letter as char),
    };
    let letters: Vec<u8> = text.bytes().filter(|letter| *letter != b'=').collect();
    let group = |letters: &[u8]| {
        let bits = letters.iter().fold(0, |bits, letter| bits << 6 | value(*letter)) << (6 * (4 - letters.len()));
        bits.to_be_bytes()[1..letters.len()].to_vec()
    };
    letters.chunks(4).flat_map(group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base_64_is_read_as_in_its_standard() {
        for (text, bytes) in [("", ""), ("Nw==", "7"), ("Nzc=", "77"), ("Nzc3", "777"), ("Nzc3Nw==", "7777")] {
            assert_eq!(from_base64(text), bytes.as_bytes());
        }
    }
}
