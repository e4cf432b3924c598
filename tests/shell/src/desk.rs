//! A display of a test's own, with simulated input and screenshots.
#![allow(clippy::disallowed_methods, reason = "a window lives by the clock")]

use std::{
    path::Path,
    process::{Child, Command, ExitStatus, Output, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use crate::waiting::{Heard, PATIENCE, comes, output};

const NEEDS: &str = "this test opens a window on a display of its own and needs Xvfb, xdotool and a Vulkan driver: \
                     `apt-get install xvfb xdotool mesa-vulkan-drivers libxcursor1 libxi6 libxkbcommon-x11-0`";

/// An X server without a screen, for the windows of one program.
pub struct Desk {
    program: &'static str,
    server: Child,
    display: String,
    folder: tempfile::TempDir,
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Desk {
    /// Starts a server with a free number for the program at this path. Its screen is a file.
    pub fn new(program: &'static str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-noreset", "-nolisten", "tcp", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect(NEEDS);
        let number = Heard::of(server.stdout.take().expect("piped"));
        let mut desk = Self { program, server, display: String::new(), folder };
        comes(PATIENCE, || number.text().ends_with('\n') || number.is_over());
        let number = number.text();
        assert!(number.ends_with('\n'), "Xvfb does not start");
        desk.display = format!(":{}", number.trim());
        desk
    }

    /// Starts the program in a scaled window: it has this many pixels for each logical one.
    pub fn open_scaled(&self, folder: &Path, args: &[&str], scale: &str) -> Seat<'_> {
        let mut command = self.command(folder, args);
        command.env("WINIT_X11_SCALE_FACTOR", scale);
        self.sit_down(command, args[1])
    }

    /// Returns the program with these arguments, on this display.
    pub fn command(&self, folder: &Path, args: &[&str]) -> Command {
        let mut command = Command::new(self.program);
        command.args(args).current_dir(folder).env("DISPLAY", &self.display);
        command
    }

    /// Starts the program with these arguments, of which the second names the game, and waits for its window.
    pub fn open(&self, folder: &Path, args: &[&str]) -> Seat<'_> {
        self.sit_down(self.command(folder, args), args[1])
    }

    /// Starts a program that plays this game, and waits for its window.
    fn sit_down(&self, mut command: Command, game: &str) -> Seat<'_> {
        // Out of the way of the window, which would otherwise have the keyboard before it is given it.
        self.xdotool(&["mousemove", "1000", "790"]);
        let mut program = command.stderr(Stdio::piped()).spawn().expect("the program starts");
        let errors = Heard::of(program.stderr.take().expect("piped"));
        let mut seat = Seat { desk: self, program, errors, window: String::new() };
        seat.wait("a window", |seat| {
            // Only the title of a running game begins like this: the window has started to play.
            let found = seat.desk.xdotool(&["search", "--name", &format!("^{game} .* tick")]);
            seat.window = String::from_utf8_lossy(&found.stdout).trim().to_owned();
            !seat.window.is_empty()
        });
        seat.take_keyboard();
        // Without a window manager the keyboard changes hands twice, and Bevy lets go of all keys in between.
        seat.pass_ticks(8);
        seat
    }

    fn xdotool(&self, args: &[&str]) -> Output {
        let mut command = Command::new("xdotool");
        command.args(args).env("DISPLAY", &self.display);
        output(&mut command).unwrap_or_else(|error| panic!("xdotool {args:?}: {error}; {NEEDS}"))
    }

    /// Returns the pixels of the screen's upper left square, `side` × `side`.
    pub fn pixels(&self, side: usize) -> Vec<u32> {
        let bytes = std::fs::read(self.folder.path().join("Xvfb_screen0")).expect("Xvfb keeps its screen there");
        // An X window dump: a header of big-endian numbers, colours of 12 bytes, rows.
        let field = |index: usize| {
            let bytes = bytes[4 * index..].first_chunk().expect("a header");
            u32::from_be_bytes(*bytes) as usize
        };
        let (start, row_bytes) = (field(0) + 12 * field(19), field(12));
        let row = |y: usize| bytes[start + y * row_bytes..][..4 * side].chunks_exact(4);
        let pixel = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], 0]);
        (0..side).flat_map(|y| row(y).map(pixel).collect::<Vec<_>>()).collect()
    }
}

/// A running program, from the player's seat.
pub struct Seat<'a> {
    desk: &'a Desk,
    program: Child,
    /// Its messages.
    errors: Heard,
    window: String,
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

impl Seat<'_> {
    fn xdotool(&self, args: &[&str]) {
        let output = self.desk.xdotool(args);
        assert!(output.status.success(), "xdotool {args:?}: {}", String::from_utf8_lossy(&output.stderr));
    }

    /// Gives the window the keyboard.
    fn take_keyboard(&mut self) {
        self.wait("keyboard", |seat| {
            // Refused until the window is on the screen; keys pressed before would be lost.
            seat.desk.xdotool(&["windowfocus", &seat.window]);
            let focus = seat.desk.xdotool(&["getwindowfocus", "-f"]);
            String::from_utf8_lossy(&focus.stdout).trim() == seat.window
        });
    }

    /// Takes the window off the screen, as a window manager does that minimises it. It loses the keyboard.
    pub fn hide(&self) {
        self.xdotool(&["windowunmap", "--sync", &self.window]);
    }

    /// Puts a hidden window back on the screen, and gives it the keyboard.
    pub fn show(&mut self) {
        self.xdotool(&["windowmap", "--sync", &self.window]);
        self.take_keyboard();
    }

    /// Presses and releases a key.
    pub fn tap(&self, key: &str) {
        self.xdotool(&["key", "--delay", "1", key]);
    }

    /// Moves the mouse to a position in the window, in pixels from its upper left corner, and clicks.
    pub fn click(&self, x: u32, y: u32) {
        let at = [x, y].map(|place| place.to_string());
        self.xdotool(&["mousemove", "--window", &self.window, &at[0], &at[1]]);
        self.xdotool(&["click", "1"]);
    }

    /// Presses keys and does not let go.
    pub fn hold(&self, keys: &[&str]) {
        keys.iter().for_each(|key| self.xdotool(&["keydown", key]));
    }

    /// Lets go.
    pub fn release(&self, keys: &[&str]) {
        keys.iter().for_each(|key| self.xdotool(&["keyup", key]));
    }

    /// Returns the title of the window.
    pub fn title(&self) -> String {
        let output = self.desk.xdotool(&["getwindowname", &self.window]);
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }

    /// Waits until the title contains this.
    pub fn read(&mut self, words: &str) -> String {
        self.wait(words, |seat| seat.title().contains(words));
        self.title()
    }

    /// Waits until the game has played a number of ticks, of one episode or of several; a busy machine takes longer than by
    /// the clock.
    pub fn pass_ticks(&mut self, ticks: u32) {
        let (mut seen, mut passed) = (self.tick(), 0);
        self.wait("ticks", |seat| {
            let tick = seat.tick();
            // A lower tick is of the next episode.
            passed += if tick < seen { tick } else { tick - seen };
            seen = tick;
            passed >= ticks
        });
    }

    /// Waits as long as a number of ticks takes, in a game that stands still.
    pub fn sit_out(&self, ticks: u32) {
        sleep(Duration::from_secs(1) * ticks / 15);
    }

    /// Returns the tick in the window's title.
    fn tick(&self) -> u32 {
        let title = self.title();
        let tick = title.split(" · ").find_map(|part| part.strip_prefix("tick "));
        tick.and_then(|tick| tick.parse().ok()).unwrap_or_else(|| panic!("no tick in the title `{title}`"))
    }

    /// Waits until a condition holds, and fails if it takes too long.
    pub fn wait(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        let start = Instant::now();
        while !done(self) {
            let gone = self.program.try_wait().expect("a child of this test");
            assert!(gone.is_none(), "the program has ended ({gone:?}) before {what}: {}", self.errors.to_end());
            assert!(start.elapsed() < PATIENCE, "no {what} in {PATIENCE:?}; {}", self.state());
            sleep(Duration::from_millis(50));
        }
    }

    /// Waits for the program's own end, and returns its exit status and its messages.
    pub fn leave(mut self) -> (ExitStatus, String) {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            if let Some(status) = self.program.try_wait().expect("a child of this test") {
                return (status, self.errors.to_end());
            }
            sleep(Duration::from_millis(50));
        }
        panic!("the program does not end; {}", self.state());
    }

    /// Sends the program this signal, such as `-TERM`.
    pub fn send(&self, signal: &str) {
        let sent =
            Command::new("kill").args([signal, &self.program.id().to_string()]).status().expect("a shell's kill");
        assert!(sent.success(), "it runs");
    }

    /// Ends the program as a crash would.
    pub fn kill(mut self) {
        self.program.kill().expect("it runs");
        self.program.wait().expect("it has ended");
    }

    /// Describes a program that does not behave as expected.
    fn state(&self) -> String {
        format!("the title is `{}`, and it said so far: {}", self.title(), self.errors.text())
    }
}
