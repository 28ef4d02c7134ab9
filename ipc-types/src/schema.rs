//! The contract as JSON: everything that a client in any language needs, taken from the
//! declarations themselves.

use admittance_vocabulary::{EnumInfo, EnumValueInfo};
use serde::Serialize;
use serde_json::{Value, json};

use crate::layout::{FieldInfo, SampleInfo};
use crate::qos::{EventQos, PublishSubscribeQos, RequestResponseQos, ServiceSpec};
use crate::services::{COMMAND, COMMAND_ARRIVAL, DIAGNOSTICS, RECORD, REQUEST, STATE, STATE_ARRIVAL, TRUTH, TWIST};
use crate::{ENUMS, MAX_JOINTS, MAX_PLAN, QUANTILES, REQUEST_VALUES, SAMPLES, SCHEMA_VERSION, TASK_AXES, TEXT_LENGTH};

/// The whole contract. Its JSON form is made by [`schema_json`].
#[derive(Debug, Clone, Serialize)]
pub struct Schema {
    /// Version of layout and meaning.
    pub schema_version: u32,
    /// Middleware and release that carry the services.
    pub transport: &'static str,
    /// What holds for every field.
    pub conventions: Conventions,
    /// Limits of the arrays.
    pub constants: Constants,
    /// Regular expression of instance names.
    pub instance_pattern: &'static str,
    /// Every service.
    pub services: Vec<ServiceEntry>,
    /// Every sample type.
    pub types: &'static [SampleInfo],
    /// Every enum.
    pub enums: Vec<EnumEntry>,
}

/// One enum: a `u32` with named codes.
#[derive(Debug, Clone, Serialize)]
pub struct EnumEntry {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Its values.
    pub values: Vec<EnumValueEntry>,
}

/// One value of an enum.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct EnumValueEntry {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// The code on the wire.
    pub code: u32,
    /// What it says.
    pub meaning: &'static str,
}

/// What holds for every field.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Conventions {
    /// Layout rule.
    pub layout: &'static str,
    /// Clock of every stamp.
    pub time: &'static str,
    /// Frame and order of Cartesian arrays.
    pub cartesian: &'static str,
    /// Order of joint arrays.
    pub joints: &'static str,
    /// Sign of wrenches.
    pub wrench: &'static str,
}

/// Limits of the arrays.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub struct Constants {
    /// [`MAX_JOINTS`].
    pub max_joints: usize,
    /// [`TASK_AXES`].
    pub task_axes: usize,
    /// [`MAX_PLAN`].
    pub max_plan: usize,
    /// [`QUANTILES`].
    pub quantiles: usize,
    /// [`REQUEST_VALUES`].
    pub request_values: usize,
    /// [`TEXT_LENGTH`].
    pub text_length: usize,
}

/// One service.
#[derive(Debug, Clone, Serialize)]
pub struct ServiceEntry {
    /// Last part of the name.
    pub name: &'static str,
    /// The whole name, with `{instance}` in place of the instance.
    pub name_pattern: String,
    /// What it carries and when.
    pub meaning: &'static str,
    /// Who makes it.
    pub creator: &'static str,
    /// Who publishes, notifies or requests.
    pub writer: &'static str,
    /// Who subscribes, listens or serves.
    pub reader: &'static str,
    /// Pattern, types and quality of service.
    #[serde(flatten)]
    pub pattern: Pattern,
}

/// Pattern of a service with its types (names of entries in `types`, and their type names) and
/// quality of service.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "messaging_pattern", rename_all = "kebab-case")]
pub enum Pattern {
    /// Samples from a publisher to subscribers.
    PublishSubscribe {
        /// Name of the sample type.
        payload: &'static str,
        /// Its type name.
        payload_type_name: &'static str,
        /// Quality of service.
        qos: PublishSubscribeQos,
    },
    /// Notifications without payload.
    Event {
        /// Quality of service.
        qos: EventQos,
    },
    /// Requests from clients to a server, which responds.
    RequestResponse {
        /// Name of the request's sample type.
        request: &'static str,
        /// Its type name.
        request_type_name: &'static str,
        /// Name of the response's sample type.
        response: &'static str,
        /// Its type name.
        response_type_name: &'static str,
        /// Quality of service.
        qos: RequestResponseQos,
    },
}

/// The contract as data.
pub fn schema() -> Schema {
    Schema {
        schema_version: SCHEMA_VERSION,
        transport: "iceoryx2 0.10, shared memory on one host",
        conventions: Conventions {
            layout: "C layout of the host (native byte order), explicit offsets, no implicit padding; shape [] is a \
                     scalar, \
                     [a, b] is a rows of b values",
            time: "nanoseconds of CLOCK_MONOTONIC on this host, taken by the writer",
            cartesian: "x y z rx ry rz at the TCP in the robot's base frame; an axis that the arm does not control \
                        is 0; \
                        of the task frame where a field says so: that is the base frame unless the daemon's [task] says otherwise",
            joints: "base to tip; values after joint_count are 0",
            wrench: "what the ROBOT exerts on the ENVIRONMENT: pushing along +x gives a positive x force",
        },
        constants: Constants {
            max_joints: MAX_JOINTS,
            task_axes: TASK_AXES,
            max_plan: MAX_PLAN,
            quantiles: QUANTILES,
            request_values: REQUEST_VALUES,
            text_length: TEXT_LENGTH,
        },
        instance_pattern: "[a-z0-9][a-z0-9_-]{0,31}",
        services: services(),
        types: SAMPLES,
        enums: ENUMS.iter().map(enum_entry).collect(),
    }
}

/// The contract as indented JSON.
pub fn schema_json() -> String {
    serde_json::to_string_pretty(&schema()).expect("strings, numbers and lists only: nothing that JSON cannot hold")
}

/// The JSON schema of a sample as [`WireType::to_json`](crate::layout::WireType::to_json) writes
/// it.
pub fn json_schema(sample: &SampleInfo) -> Value {
    let properties: serde_json::Map<String, Value> =
        sample.fields.iter().map(|field| (field.name.to_owned(), field_schema(field))).collect();
    let required: Vec<&str> = sample.fields.iter().map(|field| field.name).collect();
    json!({
        "title": sample.name,
        "description": format!("{} NaN and infinities, which JSON lacks, are the texts NaN, inf and -inf.", sample.meaning),
        "type": "object",
        "properties": properties,
        "required": required,
    })
}

fn field_schema(field: &FieldInfo) -> Value {
    let mut schema = match field.scalar {
        "f64" => json!({ "type": "number" }),
        "u8" | "u32" | "u64" => json!({ "type": "integer" }),
        sample => SAMPLES.iter().find(|known| known.name == sample).map_or(Value::Null, json_schema),
    };
    // Foxglove refuses nested lists: rows follow each other.
    let mut layout = String::new();
    if !field.shape.is_empty() {
        let length: usize = field.shape.iter().product();
        schema = json!({ "type": "array", "items": schema, "minItems": length, "maxItems": length });
        if let [rows, columns] = field.shape {
            layout = format!(" {rows} rows of {columns} values, one after the other.");
        }
    }
    if let Some(codes) = ENUMS.iter().find(|known| Some(known.name) == field.enumeration) {
        let name = |value: &EnumValueInfo| json!({ "const": value.name, "description": value.meaning });
        schema = json!({ "type": "string", "oneOf": codes.values.iter().map(name).collect::<Value>() });
    }
    if let Some(codes) = ENUMS.iter().find(|known| Some(known.name) == field.set_of) {
        let name = |value: &EnumValueInfo| Value::from(value.name);
        let names = json!({ "type": "string", "enum": codes.values.iter().map(name).collect::<Value>() });
        schema = json!({ "type": "array", "items": names, "uniqueItems": true });
    }
    schema["description"] =
        Value::from(format!("{}{layout} Unit: {}. Range: {}.", field.meaning, field.unit, field.range));
    schema
}

fn enum_entry(info: &EnumInfo) -> EnumEntry {
    let value = |value: &EnumValueInfo| EnumValueEntry { name: value.name, code: value.code, meaning: value.meaning };
    EnumEntry { name: info.name, meaning: info.meaning, values: info.values.iter().map(value).collect() }
}

fn services() -> Vec<ServiceEntry> {
    vec![
        publish_subscribe(&STATE),
        event(&STATE_ARRIVAL),
        publish_subscribe(&COMMAND),
        event(&COMMAND_ARRIVAL),
        publish_subscribe(&TRUTH),
        publish_subscribe(&RECORD),
        publish_subscribe(&DIAGNOSTICS),
        publish_subscribe(&TWIST),
        request_response(&REQUEST),
    ]
}

fn publish_subscribe(spec: &ServiceSpec<PublishSubscribeQos>) -> ServiceEntry {
    let payload = &spec.samples[0];
    entry(
        spec,
        Pattern::PublishSubscribe { payload: payload.name, payload_type_name: payload.type_name, qos: spec.qos },
    )
}

fn event(spec: &ServiceSpec<EventQos>) -> ServiceEntry {
    entry(spec, Pattern::Event { qos: spec.qos })
}

fn request_response(spec: &ServiceSpec<RequestResponseQos>) -> ServiceEntry {
    let (request, response) = (&spec.samples[0], &spec.samples[1]);
    let pattern = Pattern::RequestResponse {
        request: request.name,
        request_type_name: request.type_name,
        response: response.name,
        response_type_name: response.type_name,
        qos: spec.qos,
    };
    entry(spec, pattern)
}

fn entry<Q>(spec: &ServiceSpec<Q>, pattern: Pattern) -> ServiceEntry {
    ServiceEntry {
        name: spec.name,
        name_pattern: spec.name_pattern(),
        meaning: spec.meaning,
        creator: spec.creator,
        writer: spec.writer,
        reader: spec.reader,
        pattern,
    }
}
