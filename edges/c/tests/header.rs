//! The headers, and the schema of the Python package, are what the declarations say. `ADMITTANCE_WRITE_DOCS=1` writes them.

use std::path::{Path, PathBuf};

use admittance_client_c::{ABI_VERSION, Status};
use cbindgen::{Config, DocumentationStyle, EnumConfig, ExportConfig, ItemType, Language, Style};

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names of what Rust calls otherwise.
const NAMES: [(&str, &str); 7] = [
    ("Client", "admittance_client"),
    ("Options", "admittance_options"),
    ("Instruction", "admittance_instruction"),
    ("Counts", "admittance_counts"),
    ("Status", "admittance_status"),
    ("StateSample", "admittanced_state_sample"),
    ("CommandSample", "admittanced_command_sample"),
];

fn statuses() -> String {
    let mut text = format!(
        "/* Version of the interface that this header describes. */\n#define ADMITTANCE_CLIENT_ABI_VERSION {ABI_VERSION}u\n\n\
         /* What a call says. Below 0: it failed. */\ntypedef int32_t admittance_status;\n"
    );
    for (status, name) in Status::ALL {
        text += &format!("#define ADMITTANCE_STATUS_{name} ({}) /* {status} */\n", *status as i32);
    }
    text
}

fn generated() -> String {
    let config = Config {
        language: Language::C,
        style: Style::Both,
        cpp_compat: true,
        documentation_style: DocumentationStyle::C,
        header: Some(
            "/* A motion controller's side of admittanced (docs/client.md). Generated: do not edit. Units are SI and \
             radians,\n * instants nanoseconds of CLOCK_MONOTONIC. One thread at a time uses a handle. */"
                .to_owned(),
        ),
        include_guard: Some("ADMITTANCE_CLIENT_H".to_owned()),
        no_includes: true,
        sys_includes: ["stddef.h", "stdint.h"].map(str::to_owned).to_vec(),
        includes: vec!["admittanced.h".to_owned()],
        after_includes: Some(statuses()),
        usize_is_size_t: true,
        line_length: 120,
        enumeration: EnumConfig::default(),
        export: ExportConfig {
            item_types: vec![ItemType::OpaqueItems, ItemType::Structs, ItemType::Functions],
            exclude: vec!["Status".to_owned()],
            rename: NAMES.map(|(rust, c)| (rust.to_owned(), c.to_owned())).into(),
            ..ExportConfig::default()
        },
        ..Config::default()
    };
    let sources = ["lib.rs", "options.rs"].map(|name| here().join("src").join(name));
    let builder = sources.iter().fold(cbindgen::Builder::new(), |builder, source| builder.with_src(source));
    let mut text = Vec::new();
    builder.with_config(config).generate().expect("the sources can be read").write(&mut text);
    // Lengths of arrays are constants of the wire header.
    String::from_utf8(text)
        .expect("text")
        .replace("[TASK_AXES]", "[ADMITTANCED_TASK_AXES]")
        .replace("[MAX_JOINTS]", "[ADMITTANCED_MAX_JOINTS]")
}

fn is_up_to_date(name: &str, expected: &str) {
    let path: PathBuf = here().join("include").join(name);
    if std::env::var_os("ADMITTANCE_WRITE_DOCS").is_some() {
        std::fs::write(&path, expected).expect("the header can be written");
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{}: run with ADMITTANCE_WRITE_DOCS=1", path.display());
}

#[test]
fn the_header_is_what_the_library_declares() {
    is_up_to_date("admittance_client.h", &generated());
}

#[test]
fn the_wire_header_is_what_the_wire_declares() {
    is_up_to_date("admittanced.h", &ipc_types::c_header());
}

/// From which the Python package makes its samples.
#[test]
fn the_schema_of_the_python_package_is_what_the_wire_declares() {
    is_up_to_date("../../python/admittance/wire.json", &format!("{}\n", ipc_types::schema_json()));
}
