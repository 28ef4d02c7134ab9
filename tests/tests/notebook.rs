//! The notebook of docs/, from the wheel to the plot; and what the wheel tells a type checker.

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::c_controller::installed;
use end_to_end::session::output;
use end_to_end::{Need, binaries, needs, python};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// What of the repository the notebook uses, in a directory of its own: a wheel is built beside its sources.
fn repository() -> (tempfile::TempDir, PathBuf) {
    let directory = tempfile::tempdir().expect("a directory");
    let root = directory.path().to_owned();
    for place in ["docs", "edges/python/admittance"] {
        std::fs::create_dir_all(root.join(place)).expect("a directory");
        for entry in std::fs::read_dir(Path::new(ROOT).join(place)).expect("it is there") {
            let path = entry.expect("it can be listed").path();
            if path.is_file() {
                std::fs::copy(&path, root.join(place).join(path.file_name().expect("a file"))).expect("copied");
            }
        }
    }
    for file in ["pyproject.toml", "setup.py", "stub.py"].map(|name| Path::new("edges/python").join(name)) {
        std::fs::copy(Path::new(ROOT).join(&file), root.join(&file)).expect("copied");
    }
    for place in ["deploy", "plant-sim", "Cargo.toml"] {
        symlink(Path::new(ROOT).join(place), root.join(place)).expect("linked");
    }
    (directory, root)
}

#[test]
fn the_notebook_goes_from_the_wheel_to_a_plot_in_ten_lines() {
    if !needs(Need::PythonTools) || !needs(Need::CToolchain) {
        return;
    }
    let (_directory, root) = repository();
    let place = root.join("site-packages");
    let mut notebook = Command::new(python().expect("needs(PythonTools) found one"));
    notebook.arg(Path::new(ROOT).join("tests/python/notebook.py")).arg(root.join("docs/contact.ipynb")).arg(&place);
    // Nothing but what the wheel brings.
    notebook.env("PATH", "/usr/bin:/bin");
    notebook.env("ADMITTANCE_PROGRAM", &binaries().admittancectl);
    notebook.env("ADMITTANCE_CLIENT_LIBRARY", installed().join("lib/libadmittance_client.so"));
    let (code, text) = output(&mut notebook);
    assert_eq!(code, Some(0), "{text}");
    println!("{text}");
    let lines = text.lines().last().and_then(|line| line.split(' ').next()?.parse().ok()).unwrap_or(u32::MAX);
    assert!(lines <= 10, "ten lines with the install: {text}");
    let metadata = place.join(concat!("admittance-", env!("CARGO_PKG_VERSION"), ".dist-info"));
    let wheel = std::fs::read_to_string(metadata.join("WHEEL")).expect("a wheel of the workspace's version");
    assert!(wheel.contains("\nTag: py3-none-linux_x86_64\n"), "one wheel for every Python: {wheel}");

    // Its user's code is checked against what the wheel says of itself, and the package against its own words.
    let user = r#"
import admittance

def publish(client: admittance.Client) -> float:
    sample = client.begin(1)
    sample.joint_position[0:2] = [0.1, 0.2]
    sample.wrench_valid = 1
    client.publish(sample)
    newest = client.newest()
    return newest.planned_offset[0][1] if newest else 0.0

names: dict[int, str] = admittance.codes("Mode")
force: float = admittance.simulate("a.toml", "b.toml").wrench.max()
"#;
    let wrong = user.replace("client.begin(1)", "client.begin(\"now\")");
    for (name, text, accepted) in [("user.py", user, true), ("wrong.py", wrong.as_str(), false)] {
        let file = root.join(name);
        std::fs::write(&file, text).expect("written");
        let mut mypy = Command::new(python().expect("one was found"));
        mypy.current_dir(&root).args(["-m", "mypy", "--strict", "--cache-dir", "mypy-cache"]).arg(&file);
        mypy.env("MYPYPATH", &place);
        let (code, text) = output(&mut mypy);
        assert_eq!(code == Some(0), accepted, "{text}");
        assert!(accepted || text.contains("expected \"int\""), "{text}");
    }
}
