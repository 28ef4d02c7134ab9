//! The schema and the C header against the Rust types, and the layout against the version.

use std::io::Write as _;
use std::process::{Command, Stdio};

use ipc_types::layout::WireSample as _;
use ipc_types::{
    CommandSample, ENUMS, RequestSample, ResponseSample, SAMPLES, StateSample, TruthSample, c_header, schema_json,
};
use serde_json::Value;

/// Name, offset and size of every field as the compiler sees them: an own list, so that the macro does not check
/// itself.
macro_rules! compiled {
    ($sample:ident: $($field:ident)+) => {
        (
            $sample::INFO.name,
            size_of::<$sample>(),
            vec![$(
                (stringify!($field), core::mem::offset_of!($sample, $field), size_of_val(&$sample::zeroed().$field)),
            )+],
        )
    };
}

type Compiled = (&'static str, usize, Vec<(&'static str, usize, usize)>);

fn compiled_layouts() -> Vec<Compiled> {
    vec![
        compiled!(StateSample: sequence stamp_ns boot_id applied_command_sequence joint_count wrench_valid
            drives_enabled reserved joint_position joint_velocity joint_position_reference twist_reference wrench),
        compiled!(CommandSample: sequence stamp_ns boot_id state_sequence state_stamp_ns valid_until_ns fallback_count
            late_count missed_count rejected_count compute_time_ns joint_count motion mode source active_axes verdict
            verdict_axis verdict_side stop_reason plan_length verdict_time_s verdict_margin velocity_offset
            joint_velocity_offset twist_command plan_end_ns planned_offset),
        compiled!(TruthSample: sequence stamp_ns boot_id answer_time_ns missed_commands lateness_ns in_contact
            contact_losses motion missed scenario_time_s normal_force_n penetration_m peak_normal_force_n joint_position
            joint_velocity tcp_position tcp_rotation tcp_twist wrench peak_wrench velocity_offset),
        compiled!(RequestSample: id deadline_ns kind force),
        compiled!(ResponseSample: id state_sequence command_sequence cycles fallback_count late_count missed_count
            rejected_count uptime_ns compute_time_ns status mode motion stop_reason active_axes verdict joint_count
            text_length verdict_margin verdict_time_s wrench velocity_offset text),
    ]
}

fn schema() -> Value {
    serde_json::from_str(&schema_json()).expect("the schema is JSON")
}

fn list<'a>(value: &'a Value, key: &str) -> &'a Vec<Value> {
    value[key].as_array().unwrap_or_else(|| panic!("{key} is a list in {value}"))
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().filter(|text| !text.is_empty()).unwrap_or_else(|| panic!("{key} is a text in {value}"))
}

fn number(value: &Value, key: &str) -> usize {
    value[key].as_u64().unwrap_or_else(|| panic!("{key} is a number in {value}")) as usize
}

#[test]
fn the_schema_gives_every_field_where_the_compiler_put_it() {
    let schema = schema();
    let (types, compiled) = (list(&schema, "types"), compiled_layouts());
    assert_eq!(types.len(), compiled.len());
    for (entry, (name, size, fields)) in types.iter().zip(compiled) {
        assert_eq!((text(entry, "name"), number(entry, "size"), number(entry, "alignment")), (name, size, 8));
        assert_eq!(text(entry, "type_name"), format!("admittanced.{name}.v{}", schema["schema_version"]));
        let from_schema: Vec<_> = list(entry, "fields")
            .iter()
            .map(|field| {
                let scalar = match text(field, "type") {
                    "u8" => 1,
                    "u32" => 4,
                    "u64" | "f64" => 8,
                    other => panic!("type {other}"),
                };
                let count: usize =
                    list(field, "shape").iter().map(|n| n.as_u64().expect("a dimension") as usize).product();
                (text(field, "name"), number(field, "offset"), scalar * count)
            })
            .collect();
        assert_eq!(from_schema, fields, "{name}");
    }
}

#[test]
fn the_schema_explains_everything_and_refers_to_nothing_unknown() {
    let schema = schema();
    let names = |key: &str| list(&schema, key).iter().map(|entry| text(entry, "name").to_owned()).collect::<Vec<_>>();
    let (types, enums) = (names("types"), names("enums"));
    for entry in list(&schema, "types") {
        assert!(!text(entry, "meaning").is_empty() && !text(entry, "writer").is_empty());
        for field in list(entry, "fields") {
            for key in ["unit", "range", "meaning"] {
                text(field, key);
            }
            if !field["enum"].is_null() {
                assert_eq!(text(field, "type"), "u32", "{field}");
                assert!(enums.contains(&text(field, "enum").to_owned()), "{field}");
            }
        }
    }
    for entry in list(&schema, "enums") {
        text(entry, "meaning");
        for value in list(entry, "values") {
            text(value, "meaning");
            number(value, "code");
        }
    }
    let mut carried = Vec::new();
    for service in list(&schema, "services") {
        for key in ["meaning", "creator", "writer", "reader"] {
            text(service, key);
        }
        assert_eq!(text(service, "name_pattern"), format!("admittanced/{{instance}}/{}", text(service, "name")));
        assert!(service["qos"].is_object(), "{service}");
        let keys: &[&str] = match text(service, "messaging_pattern") {
            "publish-subscribe" => &["payload"],
            "request-response" => &["request", "response"],
            "event" => &[],
            other => panic!("messaging pattern {other}"),
        };
        for key in keys {
            let name = text(service, key);
            let entry = list(&schema, "types").iter().find(|entry| entry["name"] == name).expect("a known type");
            assert_eq!(entry["type_name"], service[format!("{key}_type_name")]);
            carried.push(name.to_owned());
        }
    }
    assert_eq!(
        names("services"),
        ["state", "state-arrival", "command", "command-arrival", "truth", "request"].map(str::to_owned)
    );
    assert!(types.iter().all(|name| carried.contains(name)), "every type travels on a service");
}

/// FNV-1a, 64 bits.
fn fingerprint(lines: impl Iterator<Item = String>) -> u64 {
    lines
        .flat_map(|line| (line + "\n").into_bytes())
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn a_changed_layout_needs_a_new_schema_version() {
    let lines = SAMPLES.iter().flat_map(|sample| {
        let head = std::iter::once(format!("{} {}", sample.type_name, sample.size));
        head.chain(sample.fields.iter().map(|f| format!("{} {} {:?} {}", f.name, f.scalar, f.shape, f.offset)))
    });
    assert_eq!(
        (ipc_types::SCHEMA_VERSION, fingerprint(lines)),
        (1, 0x3b2f_196b_b08b_45db),
        "a sample changed: raise SCHEMA_VERSION and the version in every type name, then the fingerprint here"
    );
}

#[test]
fn a_changed_code_needs_a_new_schema_version() {
    let lines = ENUMS.iter().flat_map(|e| e.values.iter().map(|v| format!("{} {} {}", e.name, v.name, v.code)));
    assert_eq!(
        (ipc_types::SCHEMA_VERSION, fingerprint(lines)),
        (1, 0x6c91_1895_14d1_7d0f),
        "a code changed: raise SCHEMA_VERSION unless values were only added, then change the fingerprint here"
    );
}

#[test]
fn codes_go_there_and_back() {
    use ipc_types::{Mode, Motion, RequestKind, ResponseStatus, Side, Source, StopReason, Verdict};
    macro_rules! there_and_back {
        ($($name:ident)+) => {$(
            for &value in $name::ALL {
                assert_eq!($name::from_code(value.code()), Some(value));
                assert_eq!(value.to_string(), value.name());
            }
            assert_eq!($name::from_code(999), None);
        )+};
    }
    there_and_back!(Motion Mode Source Verdict Side StopReason RequestKind ResponseStatus);
    assert_eq!((Motion::Hold.code(), Mode::Stopped.code(), StopReason::ModelDisagrees.code()), (1, 4, 16));
    assert_eq!(RequestKind::from_code(0), None, "a zeroed request asks for nothing");
}

#[test]
fn a_zeroed_sample_is_all_zero() {
    let sample = CommandSample::zeroed();
    assert_eq!(sample, CommandSample::default());
    assert!(sample.planned_offset.iter().flatten().all(|v| v.to_bits() == 0) && sample.plan_end_ns == [0; 32]);
    assert_eq!((sample.sequence, sample.motion, sample.verdict_margin.to_bits()), (0, 0, 0));
}

#[test]
fn response_text_is_cut_at_a_character() {
    let mut response = ResponseSample::zeroed();
    response.set_text(&"é".repeat(600));
    assert_eq!((response.text_length, response.text().chars().count()), (1024, 512));
    response.set_text(&format!("a{}", "é".repeat(600)));
    assert_eq!((response.text_length, response.text().chars().count()), (1023, 512));
    response.set_text("refused");
    assert_eq!((response.text(), response.text[7]), ("refused".into(), 0));
    response.text_length = u32::MAX;
    response.text[0] = 0xff;
    assert!(response.text().starts_with("\u{fffd}efused"));
}

/// Compiles C text with the system's compiler; `None` when there is none.
fn compile(source: &str) -> Option<Result<(), String>> {
    let arguments = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", "-x", "c", "-"];
    let spawned =
        Command::new("cc").args(arguments).stdin(Stdio::piped()).stderr(Stdio::piped()).stdout(Stdio::null()).spawn();
    let mut child = match spawned {
        Ok(child) => child,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return None,
        Err(error) => panic!("cc: {error}"),
    };
    child.stdin.take().expect("piped").write_all(source.as_bytes()).expect("cc reads its input");
    let output = child.wait_with_output().expect("cc ends");
    Some(if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).into_owned()) })
}

#[test]
fn the_c_header_compiles_and_agrees_with_the_compiler() {
    // The offsets asserted here come from rustc; the header's own asserts come from the declarations.
    let mut source = c_header();
    for (name, size, fields) in compiled_layouts() {
        let name = format!("admittanced_{}_sample", name.trim_end_matches("Sample").to_lowercase());
        source += &format!("ADMITTANCED_ASSERT(sizeof({name}) == {size}, \"size\");\n");
        for (field, offset, bytes) in fields {
            source += &format!("ADMITTANCED_ASSERT(offsetof({name}, {field}) == {offset}, \"{name}.{field}\");\n");
            source += &format!("ADMITTANCED_ASSERT(sizeof((({name} *)0)->{field}) == {bytes}, \"{name}.{field}\");\n");
        }
    }
    source += "ADMITTANCED_ASSERT(ADMITTANCED_STOP_REASON_MODEL_DISAGREES == 16u, \"code\");\n";
    source += "const char *request_name = ADMITTANCED_SERVICE_REQUEST ADMITTANCED_STATE_SAMPLE_TYPE_NAME;\n";
    let Some(result) = compile(&source) else {
        eprintln!("SKIPPED: no C compiler \"cc\" on this machine");
        let required = std::env::var("ADMITTANCE_TESTS_REQUIRE").is_ok_and(|value| value == "all");
        assert!(!required, "ADMITTANCE_TESTS_REQUIRE=all: cc is required");
        return;
    };
    assert_eq!(result, Ok(()));
    let wrong = source.replace("uint64_t boot_id;", "uint32_t boot_id;");
    assert!(compile(&wrong).expect("cc is there").is_err(), "a changed field must not compile");
}
