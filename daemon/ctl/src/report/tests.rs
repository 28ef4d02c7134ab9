//! The demo's page, of runs in virtual time.

use std::path::Path;
use std::process::Command;

use admittance_host::config::parse;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::VirtualTime;
use ipc_types::{RecordKind, RecordSample};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use super::figures::{COLORS, of_demo};
use super::*;
use crate::demo::{CONTROLLERS, Experiment, SCENARIO, run_of};

fn scenario() -> Scenario {
    let mut scenario: Scenario = parse(SCENARIO, "paper.toml").expect("shipped");
    // Without any time that passes there is no delay.
    scenario.timing.command_delay_s = 0.0;
    scenario
}

fn runs(scenario: &Scenario) -> Vec<Run> {
    let run = |controller: crate::demo::Controller| {
        let mut config: Config = parse(controller.config, controller.name).expect("shipped");
        config.control.command_delay_s = 0.0;
        let plant = VirtualRun::new(scenario).expect("shipped");
        let (mut truths, mut changes) = (Vec::new(), Changes::default());
        for step in VirtualTime::new(cycle::build(&config).expect("shipped"), plant).run().expect("it runs") {
            let kind = RecordKind::Sample.code();
            let record = RecordSample { kind, state: step.state, command: step.command, ..RecordSample::zeroed() };
            changes.add(&record, step.truth.scenario_time_s);
            truths.push(step.truth);
        }
        run_of(controller, scenario, truths, changes)
    };
    CONTROLLERS.into_iter().map(run).collect()
}

/// The page, in a directory with its figures.
fn page() -> (tempfile::TempDir, String) {
    let (directory, scenario) = (tempfile::tempdir().expect("a directory"), scenario());
    let experiment = Experiment { scenario, is_patient: false };
    write(directory.path(), &runs(&experiment.scenario), &experiment).expect("written");
    let page = std::fs::read_to_string(directory.path().join("index.html")).expect("written");
    (directory, page)
}

#[test]
fn the_page_says_in_a_sentence_what_it_shows() {
    let (_directory, page) = page();
    let lead = page.split("<p class=\"lead\">").nth(1).and_then(|text| text.split("</p>").next()).expect("a lead");
    for told in
        ["Five ways to control the same arm", "200 N are allowed", "low damping the arm loses contact", "never loses"]
    {
        assert!(lead.contains(told), "{told} is missing in {lead}");
    }
    assert!(lead.matches('.').count() == 1 && lead.ends_with('.'), "one sentence: {lead}");
    assert!(page.contains("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"));
    assert!(page.contains("prefers-color-scheme:dark"));
}

#[test]
fn the_page_shows_the_files_as_they_were_told() {
    let directory = tempfile::tempdir().expect("a directory");
    let page = |is_patient| {
        let experiment = Experiment::new(is_patient).expect("valid");
        write(directory.path(), &runs(&experiment.scenario), &experiment).expect("written");
        std::fs::read_to_string(directory.path().join("index.html")).expect("written")
    };
    let (shipped, patient) = (page(false), page(true));
    assert!(shipped.contains("acts 0.25 ms after") && shipped.matches("command_delay_s = 0.00025").count() == 2);
    assert!(patient.contains("acts 1 ms after") && patient.matches("command_delay_s = 0.001").count() == 2);
    assert!(!patient.contains("0.00025"));
}

#[test]
fn every_controller_is_drawn_in_every_figure() {
    let (directory, page) = page();
    for number in 3..=5 {
        let svg = std::fs::read_to_string(directory.path().join(format!("figure-{number}.svg"))).expect("written");
        let curves = &COLORS[..CONTROLLERS.len()];
        for (color, controller) in curves.iter().map(|(color, _)| color).zip(CONTROLLERS) {
            let stroke = format!("stroke=\"#{:02X}{:02X}{:02X}\"", color.0, color.1, color.2);
            // In the legend and in each panel.
            let panels = if number == 5 { 1 } else { 2 };
            let drawn = svg.matches(&stroke).count();
            assert!(drawn > panels, "figure {number}, {}: {drawn} lines", controller.name);
        }
        assert!(page.contains(&format!("Figure {number}: ")));
    }
    // Twice each: for screens and for phones.
    assert_eq!(page.matches("<svg").count(), 8);
    assert_eq!(page.matches("<figure>").count(), 4);
}

#[test]
fn figure_5_holds_all_of_every_path() {
    let scenario = scenario();
    let runs = runs(&scenario);
    let [_, _, (_, _, chart)] = of_demo(&runs, &scenario);
    let panel = &chart.panels[0];
    assert_eq!(panel.lines.len(), CONTROLLERS.len());
    for (line, run) in panel.lines.iter().zip(&runs) {
        let is_shown = |(x, y): &(f64, f64)| panel.x.contains(x) && panel.y.contains(y);
        assert!(line.points.len() > 40 && line.points.iter().all(is_shown), "{}", run.controller.name);
    }
}

#[test]
fn the_timeline_has_modes_and_verdicts_of_every_controller() {
    let (directory, _) = page();
    let svg = std::fs::read_to_string(directory.path().join("timeline.svg")).expect("written");
    for controller in CONTROLLERS {
        assert!(svg.contains(&format!(">{}</text>", controller.title)), "{}", controller.title);
    }
    for (band, count) in [(">mode</text>", 5), (">verdict</text>", 5)] {
        assert_eq!(svg.matches(band).count(), count, "{band}");
    }
    assert!(svg.matches("<title>Contact, ").count() > 8, "low damping bounces: {svg}");
    assert_eq!(svg.matches("<title>feasible, ").count(), 3, "one for each MPC: {svg}");
}

/// Elements that reach beyond the page at this width in px, as Chromium lays it out. (Its own windows
/// are never narrower than 500 px.)
fn beyond(page: &Path, width_px: u32) -> String {
    const MEASURE: &str = "const inner=frame.contentDocument,w=inner.documentElement.clientWidth;\
        const wide=[...inner.querySelectorAll('body *')].filter(e=>{const r=e.getBoundingClientRect();\
        return r.width>0&&(r.right>w+0.5||r.left<-0.5)}).map(e=>e.tagName);\
        document.title=`laid out at ${w} px, scrolls to ${inner.documentElement.scrollWidth}: ${wide.join(' ')}.`;";
    // What is folded is part of it.
    let text = std::fs::read_to_string(page).expect("written").replace("<details>", "<details open>");
    let text = serde_json::to_string(&text).expect("text").replace("</", "<\\/");
    let around = format!(
        "<!DOCTYPE html><title></title><body><script>const frame=document.createElement('iframe');\
         frame.style='border:0;width:{width_px}px;height:900px';frame.onload=()=>{{{MEASURE}}};frame.srcdoc={text};\
         document.body.append(frame)</script></body>"
    );
    let measured = page.with_file_name("measured.html");
    std::fs::write(&measured, around).expect("written");
    let profile = tempfile::tempdir().expect("a directory");
    let output = Command::new("chromium")
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(["--virtual-time-budget=10000", "--window-size=1600,1000"])
        .arg(format!("file://{}", measured.display()))
        .output()
        .expect("it was there a moment ago");
    let dom = String::from_utf8_lossy(&output.stdout);
    let title = dom.split("<title>").find(|text| text.starts_with("laid out")).and_then(|text| text.split('<').next());
    title.unwrap_or_else(|| panic!("{dom}{}", String::from_utf8_lossy(&output.stderr))).to_owned()
}

#[test]
fn nothing_is_wider_than_a_phone() {
    if Command::new("chromium").arg("--version").output().is_err() {
        assert!(std::env::var_os("ADMITTANCE_TESTS_REQUIRE").is_none_or(|all| all.is_empty()), "there is no chromium");
        std::eprintln!("SKIPPED: there is no chromium");
        return;
    }
    let (directory, _) = page();
    for width in [390, 1400] {
        let found = beyond(&directory.path().join("index.html"), width);
        assert_eq!(found, format!("laid out at {width} px, scrolls to {width}: ."));
    }
}
