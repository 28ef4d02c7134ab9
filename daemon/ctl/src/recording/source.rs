//! The recording that a command reads, and what it says of a damaged one.

use std::path::PathBuf;

use super::Recording;
use crate::Exit;

#[derive(Debug, clap::Args)]
pub(crate) struct Source {
    /// What admittancectl record wrote.
    pub(crate) file: PathBuf,
    /// Leave out what is damaged, and go on with what is whole.
    #[arg(long)]
    recover: bool,
}

impl Source {
    /// Reads it; what is left out is said on stderr.
    ///
    /// # Errors
    /// As [`Recording::open`], which refuses a damaged one unless it is to be recovered.
    pub(crate) fn open(&self) -> Result<Recording, (Exit, String)> {
        if !self.recover {
            return Recording::open(&self.file);
        }
        let recording = Recording::recover(&self.file)?;
        for damage in recording.damages() {
            eprintln!("{}: {damage}; left out", self.file.display());
        }
        Ok(recording)
    }
}
