//! Tests of whole charts and reports.

use crate::{results::sample_rows, *};

fn chart(curves: Vec<Curve>) -> Chart {
    Chart { title: "Return".into(), x_label: "steps".into(), y_label: "return".into(), curves, ..Chart::default() }
}

/// Checks that tags close in order and that attributes are quoted, which catches unescaped text.
fn assert_well_formed(markup: &str) {
    let mut open = Vec::new();
    for tag in markup.split('<').skip(1) {
        let (tag, text) = tag.split_once('>').expect("each tag ends");
        assert!(!text.contains('>'), "{text}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.split([' ', '\n']).next().expect("a name");
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "{tag}");
        } else if !tag.ends_with('/') && !["!DOCTYPE", "meta"].contains(&name) {
            open.push(name);
        }
    }
    assert_eq!(open, [] as [&str; 0]);
}

fn assert_sound(svg: &str) {
    assert_well_formed(svg);
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
}

#[test]
fn everything_is_escaped() {
    let evil = "</svg><script>alert(1)</script>\" onload='x' & \u{1b}[2J";
    let report = Report {
        title: evil.into(),
        subtitle: evil.into(),
        sections: vec![
            Section {
                heading: evil.into(),
                text: format!("{evil} `{evil}`"),
                charts: vec![Chart {
                    title: evil.into(),
                    x_label: evil.into(),
                    y_label: evil.into(),
                    curves: vec![Curve::new(evil, vec![(0.0, 1.0), (1.0, f64::NAN)]), Curve::new(evil, vec![])],
                    y_range: None,
                    marks: vec![(evil.into(), 0.5)],
                    notes: vec![evil.into()],
                }],
                tables: vec![
                    ResultTable {
                        caption: evil.into(),
                        rows: vec![ResultRow { method: evil.into(), split: evil.into(), ..sample_rows().remove(0) }],
                        ..Default::default()
                    }
                    .into(),
                    PlainTable { caption: evil.into(), columns: vec![evil.into()], rows: vec![vec![evil.into()]] }
                        .into(),
                ],
                code: vec![evil.into()],
            };
            5
        ],
    };
    let html = report.to_html();
    assert!(!html.contains("<script") && !html.contains('\u{1b}'));
    let styles = html.find("</style>").expect("a style");
    assert_well_formed(
        &html[styles..].replacen("</style>", "", 1).replacen("</head>", "", 1).replacen("</html>", "", 1),
    );
    // Nothing is loaded; the only address is the name of the SVG format.
    assert_eq!(html.matches("http://").count(), html.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
    assert!(!html.contains("https://") && !html.contains("url(") && !html.contains("src="));
}

#[test]
fn a_file_has_literal_colours_and_a_page_has_names_that_it_explains() {
    let curves = (0..8).map(|i| Curve::new(i.to_string(), vec![(0.0, f64::from(i)), (1.0, 1.0)])).collect();
    let chart = Chart { notes: vec!["A note.".into()], ..chart(curves) };
    let svg = chart.to_svg();
    assert_sound(&svg);
    assert!(!svg.contains("var(") && !svg.contains("--"), "a viewer without CSS variables would draw it black: {svg}");
    assert!(svg.contains(">A note.</text>"), "{svg}");
    let (_, style) = svg.split_once("<style>").expect("a style");
    let (style, _) = style.split_once("</style>").expect("its end");
    let (light, conditional) = style.split_once("@media (prefers-color-scheme: dark)").expect("colours of dark pages");
    let (dark, print) = conditional.split_once("@media print").expect("colours of paper");
    for (rules, line, ink) in
        [(light, "#0072b2", "#1f2328"), (dark, "#56b4e9", "#e6e8eb"), (print, "#0072b2", "#000000")]
    {
        assert!(
            rules.contains(&format!(
                ".chart .line.c0, .chart .leader.c0, .chart .seen-through.c0 {{ stroke: {line}; }}"
            ))
        );
        assert!(rules.contains(&format!("fill: {ink};")), "{rules}");
    }
    let page = Report { sections: vec![Section { charts: vec![chart], ..Section::default() }], ..Report::default() };
    let page = page.to_html();
    let names = page.split("var(").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0));
    let unknown: Vec<&str> = names.filter(|name| !page.contains(&format!("{name}: #"))).collect();
    assert!(unknown.is_empty() && page.contains("--c6: #"), "colours without a value: {unknown:?}");
}

#[test]
fn curves_without_values_are_said() {
    let svg = chart(vec![]).to_svg();
    assert_sound(&svg);
    assert!(svg.contains(">no data<"));
    let svg = chart(vec![Curve::new("a", vec![]), Curve::new("b", vec![(0.0, f64::NAN)])]).to_svg();
    assert_sound(&svg);
    assert!(svg.contains(">no data<") && svg.contains("Without any value to draw: a, b."), "{svg}");
}

#[test]
fn values_that_are_not_numbers_are_gaps_with_a_footnote() {
    let points = vec![(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, f64::INFINITY), (4.0, 1.0), (5.0, 2.0)];
    let svg = chart(vec![Curve::new("loss", points).with_band(vec![(0.0, f64::NAN); 6])]).to_svg();
    assert_sound(&svg);
    assert_eq!(svg.matches("<path class=\"line").count(), 2);
    assert!(svg.contains("Gaps are values that are not finite numbers: loss (2 of 6)."), "{svg}");
}

#[test]
fn a_single_point_is_a_dot() {
    let svg = chart(vec![Curve::new("one", vec![(5.0, 3.0)]).with_band(vec![(2.0, 4.0)])]).to_svg();
    assert_sound(&svg);
    assert_eq!((svg.matches("<circle").count(), svg.matches("<path").count()), (1, 0));
}

#[test]
fn extreme_values_are_drawn_or_gaps() {
    for points in [
        vec![(0.0, 1e300), (1.0, -1e300)],
        vec![(0.0, f64::MAX), (1.0, f64::MIN), (2.0, 0.0)],
        vec![(-1e-300, 5e-324), (1e-300, 0.0)],
        vec![(1e18, 7.0), (1e18 + 1.0, 7.0)],
        vec![(f64::NAN, 1.0)],
    ] {
        assert_sound(&chart(vec![Curve::new("x", points)]).to_svg());
    }
    let marks = vec![("never".into(), f64::NAN), ("late".into(), 9.0), ("later".into(), 9.1)];
    let svg = Chart { marks, ..chart(vec![Curve::new("x", vec![(0.0, 0.0), (10.0, 1.0)])]) }.to_svg();
    assert_sound(&svg);
    assert!(svg.contains(">late<") && !svg.contains(">never<"));
}

#[test]
fn charts_of_one_file_stand_below_each_other() {
    let curve = Curve::new("a", vec![(0.0, 0.0), (1.0, 1.0)]);
    let charts = [chart(vec![curve.clone()]), Chart { title: "Success".into(), ..chart(vec![curve]) }];
    let height = |svg: &str| -> f64 {
        assert_sound(svg);
        let (_, rest) = svg.split_once(" height=\"").expect("a height");
        rest.split_once('"').and_then(|(height, _)| height.parse().ok()).expect("a number")
    };
    let both = to_svg(&charts);
    assert!(both.contains("aria-label=\"Return; Success\"") && both.contains(">Success</text>"));
    // One margin above and one below for both, and a gap between them.
    let heights = charts.each_ref().map(|chart| height(&chart.to_svg()) - 24.0);
    assert_eq!(height(&both), heights[0] + 20.0 + heights[1] + 24.0);
    assert_sound(&to_svg(&[]));
}

#[test]
fn long_or_many_names_go_below_the_plot() {
    let below = |curves| {
        let svg = chart(curves).to_svg();
        assert_sound(&svg);
        !svg.contains("class=\"leader")
    };
    let curve = |label: &str| Curve::new(label, vec![(0.0, 0.0), (1.0, 1.0)]);
    assert!(!below(vec![curve("SCORE-PPO"), curve("PPO")]));
    assert!(below(vec![curve("SCORE-PPO without the penalty on the divergence from the decoder")]));
    assert!(below((0..20).map(|i| curve(&i.to_string())).collect()));
}

#[test]
fn a_report_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("report.html");
    let report = Report { title: "Old".into(), ..Default::default() };
    report.write(&path).expect("written");
    Report { title: "New".into(), ..report.clone() }.write(&path).expect("replaced");
    assert!(std::fs::read_to_string(&path).expect("read").contains("<h1>New</h1>"));
    assert_eq!(std::fs::read_dir(folder.path()).expect("listed").count(), 1);
    let missing = folder.path().join("missing").join("report.html");
    let error = report.write(&missing).expect_err("no folder").to_string();
    assert!(error.starts_with("cannot write the report") && error.contains("report.html"), "{error}");
    let blocked = folder.path().join("blocked");
    std::fs::create_dir_all(blocked.join("inside")).expect("created");
    assert!(report.write(&blocked).is_err(), "a folder is in the way");
    assert_eq!(std::fs::read_dir(folder.path()).expect("listed").count(), 2, "no temporary file is left");
}

#[test]
fn a_scatter_is_dots_that_nothing_joins_with_its_name_below() {
    let points = vec![(0.0, 1.0), (5.0, 3.0), (f64::NAN, 2.0), (2.0, 9.0)];
    let svg = chart(vec![Curve::scatter("bot", points)]).to_svg();
    assert_eq!(
        svg.matches("<circle class=\"dot seen-through c0 d0\"").count(),
        4,
        "three points, one in the legend: {svg}"
    );
    assert!(!svg.contains("<line class=\"line"), "{svg}");
    assert!(
        !svg.contains("<path class=\"line") && !svg.contains("class=\"leader") && svg.contains(">bot</text>"),
        "{svg}"
    );
}
