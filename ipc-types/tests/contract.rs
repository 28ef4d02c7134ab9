//! The schema and the C header against the Rust types, and the layout against the version.

use std::io::Write as _;
use std::process::{Command, Stdio};

use ipc_types::layout::{SampleInfo, WireSample as _};
use ipc_types::{
    CommandSample, DiagnosticsSample, ENUMS, RecordSample, RequestSample, ResponseSample, SAMPLES, StateSample,
    TruthSample, TwistSample, c_header, schema_json,
};
use serde_json::Value;

/// Name and type name, and name, offset and size of every field as the compiler sees them: an own
/// list, so that the macro does not check itself.
macro_rules! compiled {
    ($sample:ident v $version:literal: $($field:ident)+) => {
        (
            ($sample::INFO.name, concat!("admittanced.", stringify!($sample), ".v", $version)),
            size_of::<$sample>(),
            vec![$(
                (stringify!($field), core::mem::offset_of!($sample, $field), size_of_val(&$sample::zeroed().$field)),
            )+],
        )
    };
}

type Compiled = ((&'static str, &'static str), usize, Vec<(&'static str, usize, usize)>);

fn compiled_layouts() -> Vec<Compiled> {
    vec![
        compiled!(StateSample v 2: sequence stamp_ns boot_id applied_command_sequence joint_count wrench_valid
            drives_enabled plays_plan joint_position joint_velocity joint_position_reference twist_reference wrench
            joint_torque torque_valid follows_joint_velocity joint_velocity_reference),
        compiled!(CommandSample v 3: sequence stamp_ns boot_id state_sequence state_stamp_ns valid_until_ns fallback_count
            late_count missed_count rejected_count compute_time_ns joint_count motion mode source active_axes verdict
            verdict_axis verdict_side stop_reason plan_length verdict_time_s verdict_margin verdict_share velocity_offset
            joint_velocity_offset twist_command plan_end_ns planned_offset joint_per_twist),
        compiled!(TruthSample v 1: sequence stamp_ns boot_id answer_time_ns missed_commands lateness_ns in_contact
            contact_losses motion missed scenario_time_s normal_force_n penetration_m peak_normal_force_n joint_position
            joint_velocity tcp_position tcp_rotation tcp_twist wrench peak_wrench velocity_offset),
        compiled!(RequestSample v 1: id deadline_ns kind force law given values),
        compiled!(ResponseSample v 4: id state_sequence command_sequence cycles fallback_count late_count missed_count
            rejected_count uptime_ns compute_time_ns status mode motion stop_reason active_axes verdict joint_count
            text_length verdict_margin verdict_time_s wrench velocity_offset law enabled force_limit wrench_bias
            normal_stiffness_n_m surface_normal contact_point verdict_axis verdict_side
            believed_stiffness_n_m believed_stiffness_band_n_m believed_normal verdict_share text),
        compiled!(RecordSample v 7: sequence now_ns boot_id expired_at wake_up_latency_ns compute_time_ns answer_time_ns
            dropped_count limited_count contact_losses kind iterations fault limited forced done stop_order enabled
            contact_point wrench law reserved force_limit wrench_bias normal_stiffness_n_m surface_normal
            belief_uncertainty_n expected_pressing_n expected_spring_n expected_stamp_ns tool_acceleration
            joint_velocity joint_acceleration state command exceeded_count wrench_without_lag
            believed_stiffness_n_m believed_stiffness_band_n_m believed_normal wrench_deviation),
        compiled!(DiagnosticsSample v 5: sequence stamp_ns boot_id uptime_ns cycles cycles_last_second fallback_count
            late_count missed_count rejected_count limited_count dropped_count contact_losses solver_failures mode motion
            stop_reason active_axes verdict verdict_axis verdict_side task_axes verdict_margin verdict_time_s wrench
            force_limit minimum_force velocity_offset wake_up_ns wake_up_last_second_ns compute_ns compute_last_second_ns
            answer_ns answer_last_second_ns exceeded_count state_stamp_ns missed_lately believed_stiffness_n_m
            believed_stiffness_band_n_m believed_tilt_rad verdict_share),
        compiled!(TwistSample v 1: sequence stamp_ns boot_id valid_for_ns frame reserved twist),
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
    for (entry, ((name, type_name), size, fields)) in types.iter().zip(compiled) {
        assert_eq!((text(entry, "name"), text(entry, "type_name")), (name, type_name));
        assert_eq!((number(entry, "size"), number(entry, "alignment")), (size, 8), "{name}");
        let from_schema: Vec<_> = list(entry, "fields")
            .iter()
            .map(|field| {
                let scalar = match text(field, "type") {
                    "u8" => 1,
                    "u32" => 4,
                    "u64" | "f64" => 8,
                    sample => number(types.iter().find(|entry| entry["name"] == sample).expect("a known type"), "size"),
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
        ["state", "state-arrival", "command", "command-arrival", "truth", "record", "diagnostics", "twist", "request"]
            .map(str::to_owned)
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
fn a_changed_layout_needs_a_new_version_of_its_sample() {
    let of = |sample: &SampleInfo| {
        let head = std::iter::once(sample.size.to_string());
        let fields = sample.fields.iter().map(|f| format!("{} {} {:?} {}", f.name, f.scalar, f.shape, f.offset));
        (sample.type_name, fingerprint(head.chain(fields)))
    };
    let found: Vec<_> = SAMPLES.iter().map(of).collect();
    let known = [
        ("admittanced.StateSample.v2", 0x0938_8be2_b452_0017),
        ("admittanced.CommandSample.v3", 0x199b_fbd5_0112_f2ee),
        ("admittanced.TruthSample.v1", 0x7aeb_0f8a_3fab_11b8),
        ("admittanced.RequestSample.v1", 0x1f12_9cd2_b9c5_6793),
        ("admittanced.ResponseSample.v4", 0xd424_04e2_b016_6ab0),
        ("admittanced.RecordSample.v7", 0xdcbd_f1b1_3134_4e5f),
        ("admittanced.DiagnosticsSample.v5", 0x2770_3b9b_75ec_1451),
        ("admittanced.TwistSample.v1", 0x9b8c_a60e_99eb_ee9e),
    ];
    assert_eq!(found, known, "a sample changed: raise the version in its type name, then change its fingerprint here");
}

#[test]
fn a_changed_code_needs_a_new_schema_version() {
    let lines = ENUMS.iter().flat_map(|e| e.values.iter().map(|v| format!("{} {} {}", e.name, v.name, v.code)));
    assert_eq!(
        (ipc_types::SCHEMA_VERSION, fingerprint(lines)),
        (1, 0x31c9_be31_b833_94cb),
        "a code changed: raise SCHEMA_VERSION unless values were only added, then change the fingerprint here"
    );
}

#[test]
fn codes_go_there_and_back() {
    use ipc_types::{
        Fault, Law, Mode, Motion, RecordKind, RequestKind, ResponseStatus, Side, Source, StopReason, Verdict,
    };
    macro_rules! there_and_back {
        ($($name:ident)+) => {$(
            for &value in $name::ALL {
                assert_eq!($name::from_code(value.code()), Some(value));
                assert_eq!(value.to_string(), value.name());
            }
            assert_eq!($name::from_code(999), None);
        )+};
    }
    there_and_back!(Motion Mode Source Verdict Side StopReason RequestKind Law ResponseStatus RecordKind Fault);
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
    // The offsets asserted here come from rustc; the header's own asserts come from the
    // declarations.
    let mut source = c_header();
    for ((name, _), size, fields) in compiled_layouts() {
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

#[test]
fn the_tables_of_the_page_agree_with_the_schema() {
    let page = include_str!("../../docs/wire.md");
    let schema: Value = serde_json::from_str(&schema_json()).unwrap();
    let list = |key: &str| schema[key].as_array().unwrap().clone();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    // Rows begin with a name in backquotes; the second cell follows.
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
    let rows: Vec<(String, String)> = rows
        .map(|row| {
            let mut cells = row.split(" | ");
            (cells.next().unwrap().trim_end_matches('`').to_owned(), cells.next().unwrap_or("").to_owned())
        })
        .collect();
    let (types, services): (Vec<_>, Vec<_>) = rows.into_iter().partition(|(name, _)| name.starts_with("admittanced."));

    let types: Vec<_> = types.into_iter().map(|(name, size)| (name, size.trim_end_matches(" |").to_owned())).collect();
    let expected: Vec<_> = list("types").iter().map(|of| (text(&of["type_name"]), of["size"].to_string())).collect();
    assert_eq!(types, expected);
    let expected: Vec<_> =
        list("services").iter().map(|of| (text(&of["name"]), text(&of["messaging_pattern"]))).collect();
    assert_eq!(services, expected);
    assert!(page.contains(&format!("`SCHEMA_VERSION` ({})", schema["schema_version"])));
}
