//! The files that are written: what stands in their way is said before the fit, which takes a while.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::page::TITLE;
use crate::{Exit, Outcome};

/// A new file that appears when it is complete.
pub(super) struct NewFile {
    path: PathBuf,
    /// Where it is until then; gone with this value.
    part: PathBuf,
    file: File,
}

impl NewFile {
    /// Begins one beside its place.
    ///
    /// # Errors
    /// 73 when the place is taken, or nothing can be created there.
    pub(super) fn begin(path: &Path) -> Outcome<Self> {
        let failed = |why: &dyn std::fmt::Display| (Exit::CantCreate, format!("--write {}: {why}", path.display()));
        // Also what hangs when it is opened, such as a FIFO, is there.
        if fs::symlink_metadata(path).is_ok() {
            return Err(failed(&"it exists, and is never overwritten: accepted is the name of a new file"));
        }
        let name = path.file_name().ok_or_else(|| failed(&"no name of a file"))?;
        let mut part = name.to_owned();
        part.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(part);
        let file = File::create_new(&part).map_err(|error| failed(&error))?;
        Ok(Self { path: path.to_owned(), part, file })
    }

    /// Writes all of it, and has it appear.
    ///
    /// # Errors
    /// 74 when writing fails, 73 when the place was taken meanwhile.
    pub(super) fn finish(mut self, text: &str) -> Outcome<()> {
        let failed = |code: Exit, error: io::Error| (code, format!("--write {}: {error}", self.path.display()));
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.sync_all());
        written.map_err(|error| failed(Exit::IoError, error))?;
        // A link never replaces what is there.
        fs::hard_link(&self.part, &self.path).map_err(|error| failed(Exit::CantCreate, error))
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        // If it is gone already, so much the better.
        let _ = fs::remove_file(&self.part);
    }
}

/// Creates the directory of a page, or takes one in which no other page is.
///
/// # Errors
/// 73 when something else is there.
pub(super) fn directory(path: &Path) -> Outcome<()> {
    let failed = |why: String| (Exit::CantCreate, format!("--directory {}: {why}", path.display()));
    if fs::metadata(path).is_ok_and(|found| !found.is_dir()) {
        return Err(failed("it is no directory: accepted is a directory, or a name that is free".to_owned()));
    }
    fs::create_dir_all(path).map_err(|error| failed(error.to_string()))?;
    let page = path.join("index.html");
    let Ok(found) = fs::symlink_metadata(&page) else { return Ok(()) };
    if !found.is_file() || !fs::read_to_string(&page).is_ok_and(|text| text.contains(TITLE)) {
        let accepted = "accepted is a directory without one, or with that of an earlier identify, which is replaced";
        return Err(failed(format!("its index.html is not one of identify: {accepted}")));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_when_it_is_complete_and_replaces_nothing() {
        let place = tempfile::tempdir().expect("a directory");
        let path = place.path().join("new.toml");
        let files = || fs::read_dir(place.path()).expect("readable").count();
        drop(NewFile::begin(&path).expect("begun"));
        assert_eq!(files(), 0);
        let (one, other) = (NewFile::begin(&path).expect("begun"), place.path().join("none/new.toml"));
        assert!(!path.exists());
        one.finish("a = 1\n").expect("written");
        assert_eq!((fs::read_to_string(&path).expect("there").as_str(), files()), ("a = 1\n", 1));
        let Err((code, why)) = NewFile::begin(&path) else { panic!("overwritten") };
        assert!(code == Exit::CantCreate && why.contains("exists") && why.contains("new.toml"), "{why}");
        assert!(NewFile::begin(&other).is_err_and(|(code, _)| code == Exit::CantCreate));
    }

    #[test]
    fn a_page_replaces_only_its_like() {
        let place = tempfile::tempdir().expect("a directory");
        let pages = place.path().join("a/b");
        directory(&pages).expect("created");
        let page = pages.join("index.html");
        fs::write(&page, format!("<title>{TITLE}</title>")).expect("written");
        directory(&pages).expect("an earlier one");
        fs::write(&page, "mine").expect("written");
        for path in [&pages, &page] {
            let (code, why) = directory(path).expect_err("refused");
            assert!(code == Exit::CantCreate && why.contains("accepted is"), "{why}");
        }
    }
}
