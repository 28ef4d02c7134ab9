//! `admittancectl import` as a person uses it, and what `validate` later says of the URDF.

use std::path::Path;
use std::process::Command;

fn ctl(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_admittancectl")).args(arguments).output().expect("it starts");
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// Each marked line with the example that it ends with.
fn filled_in(printed: &str) -> String {
    let filled = |line: &str| match (line.starts_with('#'), line.rsplit_once("; such as ")) {
        (false, Some((_, example))) => format!("{} = {example}\n", line.split(' ').next().unwrap_or_default()),
        _ => format!("{line}\n"),
    };
    printed.lines().map(filled).collect()
}

#[test]
fn validate_says_when_the_urdf_has_changed_or_is_gone() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = |name: &str| directory.path().join(name).to_str().expect("text").to_owned();
    let [urdf, config, scenario] = ["arm.urdf", "cell.toml", "cell.scenario.toml"].map(path);
    let text = include_str!("../src/import/tests/arm.urdf");
    let write = |path: &str, text: &str| std::fs::write(path, text).expect("written");
    write(&urdf, text);
    let import = ["import", &urdf, "--base", "world", "--tip", "tcp"];
    let (code, printed, said) = ctl(&import);
    assert_eq!((code, said.as_str()), (Some(0), ""), "{said}");
    write(&config, &printed);
    let (code, _, said) = ctl(&["validate", &config]);
    assert!(code == Some(78) && said.contains("control.sampling_time_s = nan"), "{said}");
    write(&config, &filled_in(&printed));
    let (code, printed, said) = ctl(&[&import[..], &["--scenario"]].concat());
    assert_eq!(code, Some(0), "{said}");
    write(&scenario, &filled_in(&printed));
    // By the example it starts with every joint in the middle, where this arm is singular: plant-sim refuses it.
    let (code, _, said) = ctl(&["validate", "--scenario", &scenario]);
    assert!(code == Some(78) && said.contains("cell.scenario.toml: start.joint_position_rad = ["), "{said}");
    let set_up = |line: &str| match line.split(" = ").next() {
        Some("joint_position_rad") => "joint_position_rad = [0.3, 0.5, 1.0, 0.4, 0.8, 0.2]\n".to_owned(),
        Some("speed_gain_n_m_s_rad") => "speed_gain_n_m_s_rad = 5.0\n".to_owned(),
        _ => format!("{line}\n"),
    };
    write(&scenario, &filled_in(&printed).lines().map(set_up).collect::<String>());

    let validate = || ctl(&["validate", directory.path().to_str().expect("text")]);
    let (code, valid, said) = validate();
    assert!(
        code == Some(0) && valid.matches(": valid").count() == 2 && !said.contains("robot.source"),
        "{valid}{said}"
    );
    write(&urdf, &text.replacen("upper=\"2.5\"", "upper=\"2.4\"", 1));
    let (code, valid, said) = validate();
    assert!(code == Some(0) && valid.matches(": valid").count() == 2, "{valid}{said}");
    assert_eq!(said.matches("arm.urdf has changed since it was imported (SHA-256 ").count(), 2, "{said}");
    std::fs::remove_file(&urdf).expect("it is there");
    let (code, _, said) = validate();
    assert_eq!((code, said.matches("arm.urdf cannot be read: ").count()), (Some(0), 2), "{said}");

    // A path that is not absolute begins where the configuration is.
    write(&urdf, text);
    let told = std::fs::read_to_string(&config).expect("written above");
    write(&config, &told.replacen(&format!("urdf = \"{urdf}\""), "urdf = \"arm.urdf\"", 1));
    let (code, _, said) = ctl(&["validate", &config]);
    assert!(code == Some(0) && !said.contains("robot.source"), "{said}");
    write(&config, &told.replacen("sha256 = \"", "sha256 = \"g", 1));
    let (code, _, said) = ctl(&["validate", &config]);
    assert!(code == Some(78) && said.contains("robot.source.sha256"), "{said}");
}

#[test]
fn files_that_cannot_be_read_and_no_urdfs_have_their_exit_codes() {
    let directory = tempfile::tempdir().expect("a directory");
    let import = |file: &Path| ctl(&["import", file.to_str().expect("text"), "--base", "a", "--tip", "b"]);
    let (code, _, said) = import(&directory.path().join("none.urdf"));
    assert!(code == Some(66) && said.contains("none.urdf: cannot be read: "), "{said}");
    let large = directory.path().join("large.urdf");
    std::fs::File::create(&large).and_then(|file| file.set_len(50 << 20)).expect("written");
    let (code, _, said) = import(&large);
    assert!(code == Some(66) && said.contains("accepted: a regular file of up to 4 MiB"), "{said}");
    let (code, _, said) = import(directory.path());
    assert!(code == Some(66) && said.contains("it is a directory"), "{said}");
    let other = directory.path().join("\u{1b}.urdf");
    std::fs::write(&other, "<sdf/>").expect("written");
    let (code, printed, said) = import(&other);
    assert!(code == Some(65) && said.contains("\\u{1b}.urdf:1: it begins with <sdf>"), "{said}");
    assert!(printed.is_empty() && !said.contains('\u{1b}'), "{printed}{said:?}");
    let (code, ..) = ctl(&["import", "arm.urdf", "--base", "a"]);
    assert_eq!(code, Some(64));
}

/// 200 MB of address space, of which the program itself takes a part, are enough for whatever a file holds:
/// one line says why it is no arm.
#[test]
fn no_file_takes_much_memory() {
    /// ulimit counts KiB.
    const LIMIT_KIB: u64 = 200_000_000 / 1024;
    const LARGEST: usize = 4 << 20;
    let directory = tempfile::tempdir().expect("a directory");
    let urdf = directory.path().join("arm.urdf");
    let import = |base: &str, tip: &str| {
        let limited = format!("ulimit -v {LIMIT_KIB} && exec \"$@\"");
        let mut command = Command::new("sh");
        command.args(["-c", &limited, "sh", env!("CARGO_BIN_EXE_admittancectl"), "import"]).arg(&urdf);
        let output = command.args(["--base", base, "--tip", tip]).output().expect("it starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let links = |count: usize| (0..count).map(|link| format!("<link name=\"l{link}\"/>")).collect::<String>();
    let joint = |joint: usize, parent: usize, kind: &str| {
        let child = joint + 1;
        format!(
            "<joint name=\"j{joint}\" type=\"{kind}\"><parent link=\"l{parent}\"/><child link=\"l{child}\"/>\
             <axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    let chain = |kind: &str| (0..1999).map(|at| joint(at, at, kind)).collect::<String>();
    let star = (0..1999).map(|at| joint(at, 0, "fixed")).collect::<String>();
    let robot = |inside: &str| format!("<robot name=\"r\">{inside}</robot>");
    let long = |piece: &str| piece.repeat((LARGEST - 100) / piece.len());
    let cases = [
        ("a chain that moves", robot(&(links(2000) + &chain("revolute")))),
        ("a chain that is fixed", robot(&(links(2000) + &chain("fixed")))),
        ("a star", robot(&(links(2000) + &star))),
        ("elements", robot(&long("<a/>"))),
        ("deep", robot(&(long("<a>")))),
        ("deep and closed", robot(&("<a>".repeat(500_000) + &"</a>".repeat(500_000)))),
        ("comments", robot(&long("<!---->"))),
        ("tags without an end", long("<")),
        ("text", robot(&long("x"))),
        ("lines", robot(&long("\n"))),
        ("attributes", robot(&format!("<link {}/>", long("a=\"\" ")))),
        ("entities", format!("<!DOCTYPE r [{}]><robot/>", "<!ENTITY a \"&b;&b;&b;&b;\">".repeat(100_000))),
        ("names", robot(&format!("<link name=\"{}\"/>", long("n")))),
        ("references", robot(&long("&#x41;"))),
        ("namespaces", robot(&long("<a xmlns:b=\"c\"/>"))),
        ("no text", "\u{0}".repeat(LARGEST - 100)),
    ];
    for (what, text) in cases {
        std::fs::write(&urdf, text).expect("written");
        let (code, said) = import("l0", "l1999");
        assert!(code == Some(65) && said.lines().count() == 1 && said.len() < 2000, "{what}: {code:?} {said:.300}");
    }
    std::fs::File::create(&urdf).and_then(|file| file.set_len(50 << 20)).expect("written");
    assert_eq!(import("a", "b").0, Some(66), "50 MiB");
    std::fs::write(&urdf, include_str!("../src/import/tests/arm.urdf")).expect("written");
    assert_eq!(import("world", "tcp").0, Some(0), "an arm");
}

/// TOML is UTF-8: another path could not be found again.
#[test]
fn a_path_that_is_not_utf_8_is_refused() {
    use std::os::unix::ffi::OsStrExt as _;
    let directory = tempfile::tempdir().expect("a directory");
    let urdf = directory.path().join(std::ffi::OsStr::from_bytes(b"a\xff.urdf"));
    std::fs::write(&urdf, include_str!("../src/import/tests/arm.urdf")).expect("written");
    let mut import = Command::new(env!("CARGO_BIN_EXE_admittancectl"));
    let output = import.arg("import").arg(&urdf).args(["--base", "world", "--tip", "tcp"]).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(64) && said.contains("accepted: a path in UTF-8"), "{said}");
    assert!(output.stdout.is_empty());
}
