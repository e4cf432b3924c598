//! Progress bars on standard error, for everything that can take longer than two seconds.

use std::{sync::LazyLock, time::Duration};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

/// All bars, so that a part's bar stands below that of the whole.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// A bar with a title, a count, the time left and room for a message.
pub fn bar(title: &str, length: u64, unit: &str) -> ProgressBar {
    let template = format!("{title:<22} [{{bar:32}}] {{human_pos}}/{{human_len}} {unit} {{eta}} left  {{msg}}");
    let style =
        ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ");
    let bar = BARS.add(ProgressBar::new(length)).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
