//! Whose the root path and the counter of nodes are.

mod common;

use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::PathBuf;

use common::Private;
use ipc_types::services::state;
use ipc_types::{Access, IpcSettings, shared_memory_files};

/// Mode and length of the counter of node ids, if it is there.
fn counter(place: &IpcSettings) -> Option<(u32, u64)> {
    let files = shared_memory_files(&place.prefix).unwrap();
    let counter = files.iter().find(|file| file.to_string_lossy().ends_with(".global_mgmt"))?;
    let found = std::fs::symlink_metadata(counter).unwrap();
    Some((found.mode() & 0o7777, found.len()))
}

#[test]
fn the_counter_of_nodes_is_closed_to_others_and_goes_with_the_last_node() {
    let place = Private::new();
    let (first, second) = (place.node("first").unwrap(), place.visiting_node("second").unwrap());
    assert_eq!(counter(&place), Some((0o600, 16)));
    let publisher = state(&second, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    drop(first);
    assert_eq!(counter(&place), Some((0o600, 16)));
    drop((publisher, second));
    assert_eq!(shared_memory_files(&place.prefix).unwrap(), Vec::<PathBuf>::new());
}

#[test]
fn a_counter_that_was_open_or_is_damaged_is_exchanged() {
    let place = Private::new();
    let node = place.node("first").unwrap();
    let file = shared_memory_files(&place.prefix).unwrap().swap_remove(0);
    let inode = || std::fs::metadata(&file).unwrap().ino();
    let sh = |script: &str| {
        let status = std::process::Command::new("sh").args(["-euc", script, "sh"]).arg(&file).status().unwrap();
        assert!(status.success(), "{script}");
    };
    for damage in ["chmod 0666 \"$1\"", "truncate -s 0 \"$1\"", "truncate -s 8 \"$1\"", "rm \"$1\"; mkfifo \"$1\""] {
        let before = inode();
        sh(damage);
        drop(place.visiting_node("second").unwrap());
        assert_eq!(counter(&place), Some((0o600, 16)), "{damage}");
        assert_ne!(inode(), before, "{damage}");
    }
    drop(node);
}

#[test]
fn a_visitor_makes_no_place() {
    let place = Private::new();
    let error = place.visiting_node("tool").unwrap_err().to_string();
    assert!(error.contains("is admittanced running"), "{error}");
    assert!(!place.root_path.exists() && counter(&place).is_none());
}

#[test]
fn a_place_that_others_could_take_is_refused() {
    let place = Private::new();
    let refused = |root_path: &str| {
        let settings = IpcSettings { root_path: root_path.into(), ..place.0.clone() };
        settings.node("daemon").unwrap_err().to_string()
    };
    let public = format!("/tmp/{}root", place.prefix);
    assert!(refused(&public).contains("directly in /tmp, where everyone may take its name"));
    assert!(refused(&format!("{public}/deeper")).contains("directly in /tmp"), "it would have to be made there");
    assert!(!PathBuf::from(&public).exists());
    std::fs::DirBuilder::new().mode(0o777).create(&place.root_path).unwrap();
    std::process::Command::new("chmod").arg("0777").arg(&place.root_path).status().unwrap();
    assert!(refused(place.root_path.to_str().unwrap()).contains("can be written by others"));
    std::fs::remove_dir(&place.root_path).unwrap();
    std::os::unix::fs::symlink("/run", &place.root_path).unwrap();
    assert!(refused(place.root_path.to_str().unwrap()).contains("is not a directory"));
    std::fs::remove_file(&place.root_path).unwrap();
}
