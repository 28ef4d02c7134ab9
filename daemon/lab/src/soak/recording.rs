//! Recordings by `admittancectl record` during the soak: complete up to the last chunk before a
//! kill.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::tally::Tally;
use admittancectl::Exit;
use admittancectl::recording::{Item, Recording as Reader};
use admittancectl::session::Session;

/// A file that a recorder writes.
#[derive(Debug)]
pub(crate) struct Recording {
    file: PathBuf,
    number: u32,
}

impl Recording {
    /// Starts the first recorder of the session.
    pub(crate) fn begin(session: &mut Session, config: &Path) -> Result<Self, (Exit, String)> {
        Self::number(1, session, config)
    }

    /// Starts another one, after the last.
    pub(crate) fn next(&self, session: &mut Session, config: &Path) -> Result<Self, (Exit, String)> {
        Self::number(self.number + 1, session, config)
    }

    fn number(number: u32, session: &mut Session, config: &Path) -> Result<Self, (Exit, String)> {
        let file = config.with_file_name(format!("recording-{number}.mcap"));
        session.start("recorder", "role-recorder", &[file.as_os_str(), OsStr::new("--config"), config.as_os_str()])?;
        Ok(Self { file, number })
    }

    /// Reads it, and removes it. No record may be missing between the first and the last.
    /// `in_order`: the recorder was not killed.
    pub(crate) fn check(self, tally: &mut Tally, in_order: bool) -> Result<(), (Exit, String)> {
        match missing(&self.file, in_order) {
            Ok(records) => tally.recorded(records),
            Err(why) => tally.broken("recordings_are_whole", format!("recording {}: {why}", self.number)),
        }
        let failed = |error: std::io::Error| (Exit::IoError, format!("{}: {error}", self.file.display()));
        std::fs::remove_file(&self.file).map_err(failed)
    }
}

/// How many records a file holds; what is wrong with it.
fn missing(file: &Path, in_order: bool) -> Result<u64, String> {
    let reader = Reader::open(file).map_err(|(_, why)| why)?;
    let (mut items, mut records) = (reader.items(), 0);
    let mut last: Option<(u64, u64)> = None;
    for item in items.by_ref() {
        let Item::Record(record) = item.map_err(|(_, why)| why)? else { continue };
        records += 1;
        if let Some((boot_id, sequence)) = last.filter(|(boot_id, _)| *boot_id == record.boot_id)
            && record.sequence != sequence + 1
        {
            return Err(format!("record {} after {sequence} of daemon {boot_id:#x}", record.sequence));
        }
        last = Some((record.boot_id, record.sequence));
    }
    if in_order && !items.is_complete() {
        return Err("it breaks off, although the recorder was ended in order".to_owned());
    }
    if records == 0 { Err("no record in it".to_owned()) } else { Ok(records) }
}

#[cfg(test)]
mod tests {
    use ipc_types::RecordSample;

    use super::*;
    use admittancectl::recording::RecordingWriter;

    fn written(sequences: &[(u64, u64)], finish: bool) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        let mut writer = RecordingWriter::new(&mut file, "planar", "a = 1").expect("room");
        for &(boot_id, sequence) in sequences {
            writer.record(&RecordSample { boot_id, sequence, ..RecordSample::zeroed() }).expect("room");
        }
        writer.flush().expect("room");
        if finish {
            writer.finish().expect("room");
        } else {
            std::mem::forget(writer);
        }
        file
    }

    #[test]
    fn a_gap_is_found_and_a_restart_is_none() {
        let whole = written(&[(1, 7), (1, 8), (2, 1), (2, 2)], true);
        assert_eq!(missing(whole.path(), true), Ok(4));
        let torn = written(&[(1, 7), (1, 8)], false);
        assert_eq!(missing(torn.path(), false), Ok(2));
        assert!(missing(torn.path(), true).is_err_and(|why| why.contains("breaks off")));
        let gap = written(&[(1, 7), (1, 9)], true);
        assert!(missing(gap.path(), true).is_err_and(|why| why.contains("record 9 after 7")));
        assert!(missing(written(&[], true).path(), true).is_err());
    }
}
