//! Common parts of computations that take minutes: their options, and the figure at the end.

use std::path::PathBuf;

use serde::Serialize;

use crate::{Exit, parallel};

/// The options.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Threads; one for each processor when absent.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Also draw highest safe approach speed against cycle time into this SVG file.
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
}

impl Options {
    /// How many threads to use.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(parallel::processors, usize::from)
    }

    /// Whether a figure is asked for.
    pub fn wants_figure(&self) -> bool {
        self.figure.is_some()
    }

    /// Creates the figure's file: a typing error shows at once, not after minutes.
    pub fn begin_figure(&self) -> Result<(), (Exit, String)> {
        self.write_figure("")
    }

    /// Writes the figure, if one is asked for.
    ///
    /// # Errors
    /// What the file system says.
    pub fn write_figure(&self, svg: &str) -> Result<(), (Exit, String)> {
        let Some(path) = &self.figure else { return Ok(()) };
        std::fs::write(path, svg).map_err(|error| (Exit::Unavailable, format!("{}: {error}", path.display())))
    }

    /// Prints the result as JSON or, unless that is asked for, as `table` shows it.
    pub fn print(&self, result: &impl Serialize, table: impl FnOnce() -> String) -> Result<(), (Exit, String)> {
        if self.json {
            let json = serde_json::to_string_pretty(result).map_err(|error| (Exit::Internal, error.to_string()))?;
            println!("{json}");
        } else {
            println!("{}", table());
        }
        Ok(())
    }
}
