//! `admittancectl validate`: files against every key's type and range.

use std::path::{Path, PathBuf};

use admittance_egm::config::EdgeConfig;
use admittance_host::config::{self, LoadError, Section, keys_markdown};
use admittance_runner::config::Config;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use crate::{Exit, consequences, import};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittancectl validate /etc/admittanced/cell-3.toml\n  \
    admittancectl validate -v deploy/robots/six-joint.toml\n  \
    admittancectl validate --scenario plant-sim/scenarios/paper.toml\n  \
    admittancectl validate --egm /etc/admittanced/cell-3.egm.toml\n  admittancectl validate --keys")]
pub(crate) struct Args {
    /// Files to check; of a directory every file NAME.toml in it, where NAME.scenario.toml is a
    /// scenario and NAME.egm.toml admittance-egm's.
    #[arg(required_unless_present = "keys")]
    files: Vec<PathBuf>,
    /// The files are scenarios of plant-sim.
    #[arg(long)]
    scenario: bool,
    /// The files are admittance-egm's own. What they say of the daemon's arm is checked by `admittance-egm --check`.
    #[arg(long, conflicts_with = "scenario")]
    egm: bool,
    /// Print what follows, too: what the controller would believe of the arm, horizon, reach, rows
    /// and work of a cycle, safe speed.
    #[arg(short, long, conflicts_with_all = ["scenario", "egm", "keys"])]
    verbose: bool,
    /// Print every key with type, unit, range, default and meaning instead.
    #[arg(long)]
    keys: bool,
}

/// Whose file it is.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Daemon,
    Scenario,
    Egm,
}

impl Kind {
    /// What all files are said to be; `None` where nothing is said.
    fn told(args: &Args) -> Option<Self> {
        if args.scenario { Some(Self::Scenario) } else { args.egm.then_some(Self::Egm) }
    }

    /// What a file in a directory is by its name.
    fn by_name(file: &Path) -> Self {
        let name = file.to_string_lossy();
        if name.ends_with(".scenario.toml") {
            Self::Scenario
        } else if name.ends_with(".egm.toml") {
            Self::Egm
        } else {
            Self::Daemon
        }
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let told = Kind::told(args);
    if args.keys {
        let keys = match told.unwrap_or(Kind::Daemon) {
            Kind::Daemon => Config::keys(""),
            Kind::Scenario => Scenario::keys(""),
            Kind::Egm => EdgeConfig::keys(""),
        };
        println!("{}", keys_markdown(&keys));
        return Ok(Exit::Ok);
    }
    let mut worst = Exit::Ok;
    for path in &args.files {
        if path.is_dir() {
            for file in files_in(path)? {
                worst = worse(worst, one(&file, told.unwrap_or_else(|| Kind::by_name(&file)), args.verbose));
            }
        } else {
            worst = worse(worst, one(path, told.unwrap_or(Kind::Daemon), args.verbose));
        }
    }
    Ok(worst)
}

/// The code to end with: the last that is not Ok.
fn worse(before: Exit, now: Exit) -> Exit {
    if now == Exit::Ok { before } else { now }
}

/// The files of a directory that are to be checked, in the order of their names.
fn files_in(directory: &Path) -> Result<Vec<PathBuf>, (Exit, String)> {
    let failed = |error: std::io::Error| (Exit::NoInput, format!("{}: cannot be read: {error}", shown(directory)));
    let entries = std::fs::read_dir(directory).map_err(failed)?;
    let mut paths = entries.map(|entry| Ok(entry.map_err(failed)?.path())).collect::<Result<Vec<_>, _>>()?;
    paths.sort();
    let (files, others): (Vec<_>, Vec<_>) =
        paths.into_iter().partition(|path| path.extension().is_some_and(|end| end == "toml"));
    others.iter().for_each(|path| eprintln!("{}: left out, since its name does not end in .toml", shown(path)));
    if files.is_empty() {
        return Err((Exit::NoInput, format!("{}: no file in it ends in .toml", shown(directory))));
    }
    Ok(files)
}

/// A path as messages have it.
pub(crate) fn shown(path: &Path) -> String {
    config::escaped(&path.to_string_lossy())
}

fn warn(file: &Path, warnings: impl IntoIterator<Item = String>) {
    warnings.into_iter().for_each(|warning| eprintln!("{}: warning: {warning}", shown(file)));
}

/// Checks a file, and says what came of it.
fn one(file: &Path, kind: Kind, verbose: bool) -> Exit {
    let checked = match kind {
        Kind::Scenario => scenario(file).map(|scenario| warn(file, import::warning(&scenario.robot, file))),
        Kind::Egm => config::load::<EdgeConfig>(file).map(drop).map_err(|error| (code(&error), error.to_string())),
        Kind::Daemon => load(file).map(|config| {
            warn(file, config.warnings().into_iter().chain(import::warning(&config.robot, file)));
            if verbose {
                consequences::lines(&config).iter().for_each(|line| println!("{}: {line}", shown(file)));
            }
        }),
    };
    match checked {
        Ok(()) => {
            println!("{}: valid", shown(file));
            Exit::Ok
        }
        Err((code, why)) => {
            eprintln!("{why}");
            code
        }
    }
}

/// The configuration of a file, checked as far as `validate` does.
///
/// # Errors
/// The code that `validate` ends with, and what it says.
pub fn load(file: &Path) -> Result<Config, (Exit, String)> {
    let config: Config = config::load(file).map_err(|error| (code(&error), error.to_string()))?;
    check(&config).map_err(|why| (Exit::Config, format!("{}: {why}", shown(file))))?;
    Ok(config)
}

/// The scenario of a file, which plant-sim can set up: what it would check beyond the keys when it starts.
pub(crate) fn scenario(file: &Path) -> Result<Scenario, (Exit, String)> {
    let scenario: Scenario = config::load(file).map_err(|error| (code(&error), error.to_string()))?;
    VirtualRun::new(&scenario).map_err(|why| (Exit::Config, format!("{}: {why}", shown(file))))?;
    Ok(scenario)
}

fn code(error: &LoadError) -> Exit {
    match error {
        LoadError::Read { .. } => Exit::NoInput,
        LoadError::Config(_) => Exit::Config,
    }
}

/// What the daemon would check beyond the keys, when it starts.
fn check(config: &Config) -> Result<(), String> {
    config.ipc.settings(None, None, None)?;
    admittance_runner::cycle::build(config).map(|_| ())
}
