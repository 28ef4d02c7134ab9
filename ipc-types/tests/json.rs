//! Samples as JSON: what recordings hold.

use ipc_types::layout::{WireSample as _, WireType as _};
use ipc_types::{CommandSample, RecordSample, StateSample, json_schema};
use serde_json::Value;

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_else(|| panic!("{key} is no text in {value}"))
}

fn number(value: &Value, key: &str) -> usize {
    value[key].as_u64().unwrap_or_else(|| panic!("{key} is no number in {value}")) as usize
}

#[test]
fn a_sample_comes_back_from_json_to_the_bit() {
    let mut record = RecordSample { boot_id: u64::MAX, kind: 3, ..RecordSample::zeroed() };
    // Shortest forms, subnormals, a signed zero, and what JSON cannot say.
    let values = [0.1 + 0.2, -0.0, 5e-324, f64::MAX, 1.0 / 3.0, 123_456_789.012_345_67];
    record.command.planned_offset[31] = values;
    record.state.wrench = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-300, 1.0, 2.5];
    let text = record.to_json().to_string();
    let back = RecordSample::from_json(&serde_json::from_str(&text).expect("JSON")).expect("a record");
    assert_eq!(back.command.planned_offset[31].map(f64::to_bits), values.map(f64::to_bits));
    assert_eq!(back.state.wrench.map(f64::to_bits), record.state.wrench.map(f64::to_bits));
    assert_eq!((back.boot_id, back.kind), (u64::MAX, 3));
    assert_eq!(RecordSample::from_json(&StateSample::zeroed().to_json()), None, "another sample");
    // Codes as names; one that nobody declared comes back too, and so does what earlier versions wrote.
    record.command.mode = 77;
    let mut json = record.to_json();
    let code = |json: &Value| RecordSample::from_json(json).map(|record| (record.kind, record.command.mode));
    assert_eq!((&json["kind"], &json["command"]["mode"]), (&Value::from("Reset"), &Value::from("77")));
    assert_eq!(code(&json), Some((3, 77)));
    json["kind"] = Value::from(3);
    assert_eq!(code(&json), Some((3, 77)));
    json["kind"] = Value::from("Rest");
    assert_eq!(code(&json), None);
    assert_eq!(StateSample::from_json(&serde_json::json!({ "sequence": 1 })), None, "fields are missing");
}

#[test]
fn the_json_schema_has_the_shape_of_the_json() {
    fn check(schema: &Value, value: &Value) {
        match text(schema, "type") {
            "object" => {
                let fields = value.as_object().expect("an object");
                assert_eq!(schema["required"].as_array().expect("a list").len(), fields.len());
                fields.iter().for_each(|(name, value)| check(&schema["properties"][name], value));
            }
            "array" if schema["uniqueItems"] == true => {
                let names = schema["items"]["enum"].as_array().expect("the names");
                assert!(value.as_array().expect("a list").iter().all(|value| names.contains(value)), "{value}");
            }
            "array" => {
                let values = value.as_array().expect("a list");
                assert_eq!((number(schema, "minItems"), number(schema, "maxItems")), (values.len(), values.len()));
                assert!(values.iter().all(|value| !value.is_array()), "Foxglove refuses lists of lists: {schema}");
                values.iter().for_each(|value| check(&schema["items"], value));
            }
            "integer" => assert!(value.is_u64(), "{schema}: {value}"),
            "number" => assert!(value.is_f64(), "{schema}: {value}"),
            "string" => assert!(value.is_string(), "{schema}: {value}"),
            other => panic!("type {other}"),
        }
        text(schema, "description");
    }
    // Items of a list have no description of their own: the list's says it.
    let mut schema = json_schema(&RecordSample::INFO);
    describe_items(&mut schema);
    let mut record = RecordSample::zeroed();
    record.command.active_axes = 0b11_1111;
    check(&schema, &record.to_json());
    let reset = &schema["properties"]["kind"]["oneOf"][2];
    assert_eq!((text(reset, "const"), text(reset, "description")), ("Reset", "A reset was asked for."));
}

fn describe_items(schema: &mut Value) {
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        properties.values_mut().for_each(describe_items);
    }
    if let Some(items) = schema.get_mut("items") {
        items["description"] = Value::from("item");
        describe_items(items);
    }
}

#[test]
fn axes_have_names_and_the_numbers_of_earlier_recordings_are_read() {
    let command = CommandSample { active_axes: 0b10_0001, verdict_axis: 1, ..CommandSample::zeroed() };
    let json = command.to_json();
    assert_eq!((&json["active_axes"], &json["verdict_axis"]), (&serde_json::json!(["x", "rz"]), &"y".into()));
    let axes = |active: Value, of_verdict: Value| {
        let json = with(&with(&json, "active_axes", active), "verdict_axis", of_verdict);
        CommandSample::from_json(&json).map(|command| (command.active_axes, command.verdict_axis))
    };
    assert_eq!(axes(json["active_axes"].clone(), "y".into()), Some((0b10_0001, 1)));
    assert_eq!(axes(33.into(), 1.into()), Some((0b10_0001, 1)), "as in earlier versions");
    assert_eq!(axes(serde_json::json!([]), "x".into()), Some((0, 0)));
    assert_eq!(axes(serde_json::json!(["x", "31", "x"]), "7".into()), Some((0x8000_0001, 7)), "without names");
    assert_eq!(axes(serde_json::json!(["x", "32"]), "x".into()), None, "no bit");
    assert_eq!(axes(serde_json::json!(["w"]), "x".into()), None, "no axis");
}

/// An object with another value.
fn with(object: &Value, name: &str, value: Value) -> Value {
    let mut object = object.clone();
    object[name] = value;
    object
}
