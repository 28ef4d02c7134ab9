//! `admittancectl identify`: what recordings of ordinary motion tell of the arm, its sensor and what
//! it touched, as keys of the configuration.
//!
//! `track` is the motion of a recording, `reference` what the joints were given,
//! `joint_loop` how one follows, `joint_fit` fits it; `loops`, `delay`, `tool` and `touch` fit that by
//! `least_squares`, `found` in their order. `fragment`, `text` and `page` say what came of it.

mod arm;
mod check;
mod delay;
mod estimate;
mod found;
mod fragment;
mod impact;
mod joint_fit;
mod joint_loop;
mod lag;
mod least_squares;
mod loops;
mod page;
mod reference;
mod same;
mod text;
mod told;
mod toml_text;
mod tool;
mod touch;
mod track;
mod unknown;
mod way;
mod written;

use std::path::{Path, PathBuf};

use admittance_host::config;
use admittance_runner::config::{Config, FrameName};
use arm::{Arm, arm};
use found::{Case, Found};
use ipc_types::RecordSample;
use serde::Serialize;
use track::{Track, tracks};
use written::NewFile;

use crate::recording::Recording;
use crate::{Exit, Outcome};

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Wanted is free motion in which every joint changes its speed a dozen times, rests with the tool turned \
    about two axes, and a touch under control: plant-sim/scenarios/identify-free.toml and identify-touch.toml show them. All recordings are of one arm with \
    one tool; old values are those of the first one's configuration.\n\nExit codes: 0 done, 64 usage, 65 no recording, a \
    damaged one, one without motion, of another arm, or given twice, 66 no such file, 73 a file cannot be created or is there \
    already, 74 writing failed, 78 configuration.\n\nExamples:\n  \
    admittancectl identify free.mcap touch.mcap\n  admittancectl identify cell.mcap --directory identified --write cell-new.toml\n  \
    admittancectl identify cell.mcap --check fresh.mcap"
)]
pub(crate) struct Args {
    /// What admittancectl record wrote.
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Also a page with measured and fitted curves, in this directory: a new one, or one without an
    /// index.html; one of an earlier identify is replaced.
    #[arg(long, value_name = "DIRECTORY")]
    directory: Option<PathBuf>,
    /// Also the recorded configuration with what was found, into this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// A recording that the fit does not see: how well what was found, and what was configured,
    /// predict its joint velocities.
    #[arg(long, value_name = "RECORDING")]
    check: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What recorded cycles tell.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The configuration as TOML, with what was found.
    pub configuration: String,
    /// What they do not tell.
    pub unknown: Vec<String>,
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    found: &'a Found,
    fragment: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    check: Option<&'a [check::Predicted]>,
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let (first, config, configured) = opened(&args.recordings[0])?;
    let arm =
        arm(&config.robot).ok_or_else(|| (Exit::Config, "robot: an arm that no program here knows".to_owned()))?;
    let mut all = moving(&args.recordings[0], tracks(&args.recordings[0], &first, &config, arm.as_ref())?)?;
    for path in &args.recordings[1..] {
        let new = more(path, &config, arm.as_ref(), &all)?;
        all.extend(new);
    }
    let fresh = args.check.as_deref().map(|path| more(path, &config, arm.as_ref(), &all)).transpose()?;
    // What cannot be written is said before the fit, which takes a while.
    let new = args.write.as_deref().map(NewFile::begin).transpose()?;
    args.directory.as_deref().map(written::directory).transpose()?;
    let mut case = Case::new(&config, arm.as_ref(), all);
    let found = case.found();
    let (entries, changed) = fragment::entries(&found, &config, &configured);
    let fragment = fragment::text(&entries);
    let predicted = fresh.map(|fresh| check::predicted(Case::new(&config, arm.as_ref(), fresh), &found));
    if args.json {
        let printed = Printed { found: &found, fragment: &fragment, check: predicted.as_deref() };
        let json = serde_json::to_string_pretty(&printed).map_err(|error| (Exit::Internal, error.to_string()))?;
        println!("{json}");
    } else {
        println!("{}", text::text(&found, &fragment).trim_end());
        predicted.iter().flatten().for_each(|joint| println!("{joint}"));
    }
    if let Some(new) = new {
        new.finish(&changed)?;
    }
    if let Some(directory) = &args.directory {
        let files: Vec<String> = args.recordings.iter().map(|path| path.display().to_string()).collect();
        page::write(directory, &files.join(", "), &case, &found, &fragment)
            .map_err(|error| (Exit::IoError, format!("--directory {}: {error}", directory.display())))?;
        eprintln!("page: {}", directory.join("index.html").display());
    }
    Ok(Exit::Ok)
}

/// What recordings of one arm tell, for programs: the configuration `text` of their daemon with what was
/// found.
///
/// # Errors
/// 78 for a configuration that is none, 65 without motion or with a command that cannot be played.
pub fn configuration(text: &str, recordings: &[Vec<RecordSample>]) -> Outcome<Identified> {
    let config: Config = config::parse(text, "the configuration").map_err(|error| (Exit::Config, error.to_string()))?;
    let arm =
        arm(&config.robot).ok_or_else(|| (Exit::Config, "robot: an arm that no program here knows".to_owned()))?;
    let refused = |why: String| (Exit::DataError, why);
    let mut tracks = Vec::new();
    for records in recordings {
        let records = records.iter().map(|record| Ok(Box::new(*record)));
        tracks.extend(track::of_records(records, &config, arm.as_ref(), &refused)?);
    }
    let tracks = moving(Path::new("the recordings"), tracks)?;
    let found = Case::new(&config, arm.as_ref(), tracks).found();
    let (_, configuration) = fragment::entries(&found, &config, text);
    let unknown = found.unknown.iter().map(|unknown| unknown.what.clone()).collect();
    Ok(Identified { configuration, unknown })
}

/// A recording with its configuration, parsed and as it is.
fn opened(path: &Path) -> Outcome<(Recording, Config, String)> {
    let recording = Recording::open(path)?;
    let text = recording.configurations().get(&0).cloned();
    let text = text.ok_or_else(|| (Exit::DataError, format!("{}: no configuration in it", path.display())))?;
    let config: Config =
        config::parse(&text, "the recorded configuration").map_err(|error| (Exit::Config, error.to_string()))?;
    if config.task.frame != FrameName::Base {
        let why = format!(
            "{}: task.frame = \"{}\" in its configuration: accepted: \"base\", since samples are of its directions",
            path.display(),
            config.task.frame
        );
        return Err((Exit::Config, why));
    }
    if config.redundancy.is_told() {
        let why = format!(
            "{}: [redundancy] in its configuration: accepted: none, since joints that follow what the daemon resolves are \
             not told a twist alone",
            path.display()
        );
        return Err((Exit::Config, why));
    }
    Ok((recording, config, text))
}

/// The motion of another recording of the same arm, of which nothing was read yet.
fn more(path: &Path, config: &Config, arm: &dyn Arm, read: &[Track]) -> Outcome<Vec<Track>> {
    let (recording, own, _) = opened(path)?;
    let refused = |why: String| (Exit::DataError, why);
    same::check_arm(path, config, &own).map_err(refused)?;
    let new = moving(path, tracks(path, &recording, config, arm)?)?;
    same::check_new(path, read, &new).map_err(refused)?;
    Ok(new)
}

/// The same, where it is any.
fn moving(path: &Path, tracks: Vec<Track>) -> Outcome<Vec<Track>> {
    if tracks.is_empty() {
        let why = "no motion in it: accepted is 0.2 s in a row or more with drives enabled";
        return Err((Exit::DataError, format!("{}: {why}", path.display())));
    }
    Ok(tracks)
}
