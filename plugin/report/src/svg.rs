//! Charts as SVG.

use crate::{
    chart::{Axis, Chart, Mark, band_paths, is_point, line_path, stretches},
    escape::escape,
    number::tick_labels,
    text_table::{spread, text_width, wrap},
};
use std::fmt::Write;

/// Fonts and lines of a chart. Its colours are names, such as `var(--ink)`, that [`PALETTES`] explain.
const RULES: &str = include_str!("chart.css");

/// Colours of a chart on one kind of surface.
struct Palette {
    /// The condition of the surface; empty for the colours without any condition.
    media: &'static str,
    /// Names and colours.
    colours: [(&'static str, &'static str); 5 + COLOURS],
}

/// The colours on a light page, on a dark page and on paper. The first are those of viewers that know no conditions.
const PALETTES: [Palette; 3] = [
    palette("", ["#ffffff", "#1f2328", "#57606a", "#e4e7eb", "#8c959f"], LINES_ON_LIGHT),
    palette(
        "(prefers-color-scheme: dark)",
        ["#15181c", "#e6e8eb", "#a3abb5", "#2a2f36", "#6b747f"],
        ["#56b4e9", "#ff8a3d", "#2fc79a", "#e58fcb", "#f0c04a", "#9fd3ff", "#b8bec6"],
    ),
    palette("print", ["#ffffff", "#000000", "#333333", "#dddddd", "#777777"], LINES_ON_LIGHT),
];

/// Colours of the lines on a light page and on paper.
const LINES_ON_LIGHT: [&str; COLOURS] = ["#0072b2", "#d55e00", "#009e73", "#b2529b", "#c98500", "#3a9bdc", "#5b5b5b"];

/// Number of line colours.
const COLOURS: usize = 7;

const fn palette(media: &'static str, surface: [&'static str; 5], lines: [&'static str; COLOURS]) -> Palette {
    let [paper, ink, soft, hair, axis] = surface;
    let [c0, c1, c2, c3, c4, c5, c6] = lines;
    let colours = [
        ("--paper", paper),
        ("--ink", ink),
        ("--soft", soft),
        ("--hair", hair),
        ("--axis", axis),
        ("--c0", c0),
        ("--c1", c1),
        ("--c2", c2),
        ("--c3", c3),
        ("--c4", c4),
        ("--c5", c5),
        ("--c6", c6),
    ];
    Palette { media, colours }
}

impl Palette {
    /// Wraps rules in the condition of this palette.
    fn conditional(&self, rules: &str) -> String {
        if self.media.is_empty() { rules.to_owned() } else { format!("@media {} {{\n{rules}}}\n", self.media) }
    }
}

/// Returns the style sheet of charts in a page, for light and dark surroundings and for paper. Colours are CSS
/// variables, which other styles of the page may use too.
pub(crate) fn page_style() -> String {
    let variables = PALETTES.iter().map(|palette| {
        let colours = palette.colours.map(|(name, colour)| format!("{name}: {colour};")).join(" ");
        palette.conditional(&format!(".chart, .bar {{ {colours} }}\n"))
    });
    variables.collect::<String>() + RULES
}

/// Returns the style sheet of a chart in a file of its own. Its colours are literal, since many viewers of SVG know no
/// CSS variables; viewers without conditions show the colours of a light page.
fn file_style() -> String {
    let literal = |palette: &Palette| {
        // Rules without a colour are the same everywhere.
        let lines = RULES.split_inclusive('\n').filter(|line| palette.media.is_empty() || line.contains("var(--"));
        let rules = palette
            .colours
            .iter()
            .fold(lines.collect::<String>(), |rules, (name, colour)| rules.replace(&format!("var({name})"), colour));
        palette.conditional(&rules)
    };
    PALETTES.iter().map(literal).collect()
}

/// Width of the drawing in pixels.
const WIDTH: f64 = 720.0;

/// Height of the plot without its labels, in pixels.
const PLOT_HEIGHT: f64 = 250.0;

/// Font size of labels in pixels.
const SIZE: f64 = 13.0;

/// Distance of two lines of text in pixels.
const LINE: f64 = 17.0;

/// Space around the charts of a file in pixels.
const MARGIN: f64 = 12.0;

/// Space between charts of one file in pixels.
const GAP: f64 = 20.0;

/// Length of the sample line before a label, with its space.
const KEY: f64 = 26.0;

impl Chart {
    /// Returns the chart as a complete SVG file, 720 pixels wide and a margin. Text stays text, without fonts, scripts
    /// or CSS variables, and colours follow the reader's light or dark setting where the viewer knows it.
    pub fn to_svg(&self) -> String {
        to_svg(std::slice::from_ref(self))
    }
}

/// Draws charts below each other as one complete SVG file, see [`Chart::to_svg`].
pub fn to_svg(charts: &[Chart]) -> String {
    let (mut body, mut height) = (String::new(), 0.0);
    for chart in charts {
        let (content, own_height) = content(chart);
        let _ = write!(body, "<g transform=\"translate(0 {height:.1})\">\n{content}</g>\n");
        height += own_height + GAP;
    }
    let titles: Vec<&str> = charts.iter().map(|chart| chart.title.as_str()).collect();
    let paper = format!("<rect class=\"paper\" x=\"-{MARGIN}\" y=\"-{MARGIN}\" width=\"100%\" height=\"100%\"/>\n");
    let style = format!("<style>\n{}</style>\n{paper}", file_style());
    element(&titles.join("; "), (height - GAP).max(0.0), MARGIN, &(style + &body))
}

/// Draws the chart for a page that holds [`page_style`].
pub(crate) fn draw(chart: &Chart) -> String {
    let (content, height) = content(chart);
    element(&chart.title, height, 0.0, &content)
}

/// Returns the elements of a chart, and its height.
fn content(chart: &Chart) -> (String, f64) {
    let layout = Layout::new(chart);
    let mut body = String::new();
    head(chart, &layout, &mut body);
    axes(chart, &layout, &mut body);
    marks(&layout, &mut body);
    lines(chart, &layout, &mut body);
    labels(chart, &layout, &mut body);
    foot(chart, &layout, &mut body);
    (body, layout.height)
}

fn element(label: &str, height: f64, margin: f64, body: &str) -> String {
    let (width, height, label) = (WIDTH + 2.0 * margin, height + 2.0 * margin, escape(label));
    format!(
        "<svg class=\"chart\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{:.0} {:.0} {width:.0} {height:.0}\" \
         width=\"{width:.0}\" height=\"{height:.0}\" role=\"img\" aria-label=\"{label}\">\n{body}</svg>\n",
        0.0 - margin,
        0.0 - margin,
    )
}

/// Positions in the drawing. All lengths in pixels.
struct Layout {
    x: Axis,
    y: Axis,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    height: f64,
    title: Vec<String>,
    marks: Vec<Mark>,
    /// True if the labels stand beside the lines, false for below the plot.
    direct: bool,
    notes: Vec<String>,
}

impl Layout {
    fn new(chart: &Chart) -> Self {
        let points = || chart.curves.iter().flat_map(|c| c.points.iter().copied()).filter(is_point);
        let bands = chart.curves.iter().flat_map(|c| c.band.iter().flatten().copied()).filter(is_point);
        let x = Axis::tight(points().map(|p| p.0).chain(chart.marks.iter().map(|m| m.1)), 6);
        let wanted = chart.y_range.into_iter().flat_map(|(low, high)| [low, high]);
        let y = Axis::rounded(points().map(|p| p.1).chain(bands.flat_map(|b| [b.0, b.1])).chain(wanted), 5);

        let drawn = || chart.curves.iter().filter(|c| !c.is_blank() && !c.label.is_empty());
        let label = drawn().map(|c| text_width(&c.label, SIZE)).fold(0.0, f64::max);
        // The lines of a scatter have no end to label.
        let has_ends = !chart.curves.iter().any(|curve| curve.is_scatter);
        let direct = has_ends && label <= 170.0 && drawn().count() as f64 * LINE <= PLOT_HEIGHT;
        let ticks = tick_labels(&y.ticks, y.step).iter().map(|t| text_width(t, SIZE)).fold(0.0, f64::max);
        let left = ticks + 12.0;
        let right = if direct && label > 0.0 { WIDTH - label - KEY - 12.0 } else { WIDTH - 16.0 };

        let title = wrap(&chart.title, WIDTH - 10.0, 16.0);
        let mut top = 6.0 + 20.0 * title.len() as f64;
        if !chart.y_label.is_empty() {
            top += LINE;
        }
        let marks = Mark::place(&chart.marks, WIDTH, SIZE, |v| left + x.place(v) * (right - left));
        let rows = marks.iter().map(|m| m.row + 1).max().unwrap_or(0);
        top += 10.0 + LINE * rows as f64;
        let bottom = top + PLOT_HEIGHT;

        let notes: Vec<String> = chart.footnotes().iter().flat_map(|n| wrap(n, WIDTH - 10.0, SIZE)).collect();
        let legend = if direct { 0 } else { drawn().count() };
        let x_label = usize::from(!chart.x_label.is_empty());
        let height = bottom + 24.0 + LINE * (x_label + legend + notes.len()) as f64 + 8.0;
        Self { x, y, left, right, top, bottom, height, title, marks, direct, notes }
    }

    fn px(&self, x: f64) -> f64 {
        self.left + self.x.place(x) * (self.right - self.left)
    }

    fn py(&self, y: f64) -> f64 {
        self.bottom - self.y.place(y) * (self.bottom - self.top)
    }
}

fn text(out: &mut String, class: &str, x: f64, y: f64, anchor: &str, content: &str) {
    let content = escape(content);
    let _ =
        writeln!(out, "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{content}</text>");
}

fn rule(out: &mut String, class: &str, from: (f64, f64), to: (f64, f64)) {
    let _ = writeln!(
        out,
        "<line class=\"{class}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>",
        from.0, from.1, to.0, to.1
    );
}

fn circle(out: &mut String, class: &str, (x, y): (f64, f64)) {
    let _ = writeln!(out, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\"/>");
}

fn head(chart: &Chart, at: &Layout, out: &mut String) {
    for (i, line) in at.title.iter().enumerate() {
        text(out, "title", 0.0, 17.0 + 20.0 * i as f64, "start", line);
    }
    let y = 6.0 + 20.0 * at.title.len() as f64 + 13.0;
    if !chart.y_label.is_empty() {
        text(out, "quiet", 0.0, y, "start", &chart.y_label);
    }
}

fn axes(chart: &Chart, at: &Layout, out: &mut String) {
    for (tick, label) in at.y.ticks.iter().zip(tick_labels(&at.y.ticks, at.y.step)) {
        let y = at.py(*tick);
        let class = if *tick == 0.0 || y >= at.bottom - 0.5 { "base" } else { "grid" };
        rule(out, class, (at.left, y), (at.right, y));
        text(out, "quiet", at.left - 8.0, y + 4.5, "end", &label);
    }
    for (tick, label) in at.x.ticks.iter().zip(tick_labels(&at.x.ticks, at.x.step)) {
        let x = at.px(*tick);
        rule(out, "base", (x, at.bottom), (x, at.bottom + 5.0));
        text(out, "quiet", x, at.bottom + 19.0, "middle", &label);
    }
    if !chart.x_label.is_empty() {
        text(out, "quiet", at.right, at.bottom + 19.0 + LINE, "end", &chart.x_label);
    }
}

fn marks(at: &Layout, out: &mut String) {
    let y = |mark: &Mark| at.top - 8.0 - LINE * mark.row as f64;
    for mark in &at.marks {
        rule(out, "mark", (mark.x, y(mark) - 11.0), (mark.x, at.bottom));
    }
    for mark in &at.marks {
        let (x, anchor) = if mark.label_left { (mark.x - 4.0, "end") } else { (mark.x + 4.0, "start") };
        text(out, "quiet halo", x, y(mark), anchor, &mark.label);
    }
}

/// Returns the classes that give a line its colour and, from the second round of colours on, its dashes.
fn line_class(index: usize) -> String {
    format!("c{} d{}", index % COLOURS, (index / COLOURS).min(2))
}

fn lines(chart: &Chart, at: &Layout, out: &mut String) {
    let parts: Vec<_> = chart.curves.iter().map(|c| stretches(c, |x| at.px(x), |y| at.py(y))).collect();
    // All bands lie below all lines.
    for (i, part) in parts.iter().enumerate() {
        for path in part.iter().flat_map(|dots| band_paths(dots)) {
            let _ = writeln!(out, "<path class=\"band {}\" d=\"{path}\"/>", line_class(i));
        }
    }
    // The first curve is the subject: it is drawn last, above the others.
    for (i, part) in parts.iter().enumerate().rev() {
        let class = line_class(i);
        for dots in part {
            if let [dot] = dots.as_slice() {
                if let Some((low, high)) = dot.band {
                    rule(out, &format!("line {class}"), (dot.x, low), (dot.x, high));
                }
                // Dots of a scatter may lie on each other.
                let kind = if chart.curves[i].is_scatter { "dot seen-through" } else { "dot" };
                circle(out, &format!("{kind} {class}"), (dot.x, dot.y));
            } else {
                let _ = writeln!(out, "<path class=\"line {class}\" d=\"{}\"/>", line_path(dots));
            }
        }
    }
    if chart.curves.iter().all(|c| c.is_blank()) {
        let (x, y) = ((at.left + at.right) / 2.0, (at.top + at.bottom) / 2.0);
        text(out, "quiet", x, y, "middle", "no data");
    }
}

/// Writes the names of the lines: at the right of the plot, at the height of each line's end, or below the plot.
fn labels(chart: &Chart, at: &Layout, out: &mut String) {
    let named: Vec<(usize, &str, (f64, f64))> = chart
        .curves
        .iter()
        .enumerate()
        .filter(|(_, c)| !c.label.is_empty())
        .filter_map(|(i, c)| Some((i, c.label.as_str(), *c.points.iter().rfind(|p| is_point(p))?)))
        .collect();
    if !at.direct {
        let mut y = at.bottom + 19.0 + if chart.x_label.is_empty() { 0.0 } else { LINE };
        for (i, label, _) in &named {
            y += LINE;
            if chart.curves[*i].is_scatter {
                circle(out, &format!("dot seen-through {}", line_class(*i)), (at.left + 9.0, y - 4.5));
            } else {
                rule(out, &format!("line {}", line_class(*i)), (at.left, y - 4.5), (at.left + 18.0, y - 4.5));
            }
            text(out, "label", at.left + KEY, y, "start", label);
        }
        return;
    }
    let wanted: Vec<f64> = named.iter().map(|(_, _, end)| at.py(end.1)).collect();
    let placed = spread(&wanted, LINE, at.top, at.bottom);
    for ((i, label, end), (y, wanted)) in named.iter().zip(placed.iter().zip(&wanted)) {
        let class = line_class(*i);
        let key = at.right + 12.0;
        // A thin line leads from the end of the curve to its label, if the curve reaches the margin.
        if at.px(end.0) > at.right - 1.0 {
            rule(out, &format!("leader {class}"), (at.right + 2.0, *wanted), (key, *y));
        }
        rule(out, &format!("line {class}"), (key, *y), (key + 12.0, *y));
        text(out, "label", at.right + KEY + 3.0, y + 4.5, "start", label);
    }
}

fn foot(chart: &Chart, at: &Layout, out: &mut String) {
    let x_label = usize::from(!chart.x_label.is_empty());
    let legend =
        if at.direct { 0 } else { chart.curves.iter().filter(|c| !c.is_blank() && !c.label.is_empty()).count() };
    for (i, note) in at.notes.iter().enumerate() {
        let y = at.bottom + 24.0 + LINE * (x_label + legend + i) as f64 + 12.0;
        text(out, "note", 0.0, y, "start", note);
    }
}
