//! `status --json`: its keys, declared once for the values and for their JSON schema.

use admittance_core::quantities::AXIS_NAMES;
use ipc_types::{DiagnosticsSample, Law, Mode, Motion, ResponseSample, Side, StopReason, TASK_AXES, Verdict};
use serde_json::{Map, Value, json};

use crate::diagnostics::{latencies, sample_age_ns};

/// Version of these keys and their meaning; a key that is added doesn't change it.
const VERSION: u32 = 1;

/// What is known of a daemon.
pub(super) struct Said<'a> {
    /// Its answer; [`of_diagnostics`] where it could not be asked.
    pub(super) response: &'a ResponseSample,
    pub(super) diagnostics: &'a DiagnosticsSample,
    /// Whether it was asked: what only an answer has is not said otherwise.
    pub(super) asked: bool,
}

/// As much of a daemon's answer as its diagnostics have.
pub(super) fn of_diagnostics(diagnostics: &DiagnosticsSample) -> ResponseSample {
    ResponseSample {
        mode: diagnostics.mode,
        motion: diagnostics.motion,
        stop_reason: diagnostics.stop_reason,
        active_axes: diagnostics.active_axes,
        verdict: diagnostics.verdict,
        verdict_axis: diagnostics.verdict_axis,
        verdict_side: diagnostics.verdict_side,
        verdict_margin: diagnostics.verdict_margin,
        verdict_time_s: diagnostics.verdict_time_s,
        verdict_share: diagnostics.verdict_share,
        wrench: diagnostics.wrench,
        force_limit: diagnostics.force_limit,
        velocity_offset: diagnostics.velocity_offset,
        believed_stiffness_n_m: diagnostics.believed_stiffness_n_m,
        believed_stiffness_band_n_m: diagnostics.believed_stiffness_band_n_m,
        cycles: diagnostics.cycles,
        fallback_count: diagnostics.fallback_count,
        late_count: diagnostics.late_count,
        missed_count: diagnostics.missed_count,
        rejected_count: diagnostics.rejected_count,
        uptime_ns: diagnostics.uptime_ns,
        ..ResponseSample::zeroed()
    }
}

/// A key.
struct Key {
    name: &'static str,
    meaning: &'static str,
    /// Its JSON schema, without the meaning.
    schema: fn() -> Value,
    /// `None` where there is nothing to say: the key is not there then.
    value: fn(&Said<'_>) -> Option<Value>,
    is_optional: bool,
}

fn text() -> Value {
    json!({ "type": "string" })
}

fn count() -> Value {
    json!({ "type": "integer", "minimum": 0 })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn flag() -> Value {
    json!({ "type": "boolean" })
}

fn numbers(length: usize) -> Value {
    json!({ "type": "array", "items": number(), "minItems": length, "maxItems": length })
}

fn axes() -> Value {
    numbers(TASK_AXES)
}

fn point() -> Value {
    numbers(3)
}

fn axis_name() -> Value {
    json!({ "enum": AXIS_NAMES })
}

fn quantiles() -> Value {
    let names = ["p50_ns", "p99_ns", "p999_ns", "max_ns"];
    let properties: Map<String, Value> = names.iter().map(|name| ((*name).to_owned(), count())).collect();
    json!({ "type": "object", "properties": properties, "required": names, "additionalProperties": false })
}

/// A latency of the diagnostics by its place there; since the start, or in the last second.
fn latency(said: &Said<'_>, index: usize, is_last_second: bool) -> Value {
    let (_, all, last_second) = latencies(said.diagnostics)[index];
    let [p50, p99, p999, max] = if is_last_second { last_second } else { all };
    json!({ "p50_ns": p50, "p99_ns": p99, "p999_ns": p999, "max_ns": max })
}

/// `None` where there is no verdict.
fn of_verdict(said: &Said<'_>, value: impl Fn(&ResponseSample) -> Value) -> Option<Value> {
    let has_verdict = Verdict::from_code(said.response.verdict).is_some_and(|verdict| verdict != Verdict::None);
    has_verdict.then(|| value(said.response))
}

/// `None` before the first sample was answered.
fn of_sample(said: &Said<'_>, value: impl Into<Value>) -> Option<Value> {
    (said.response.cycles > 0).then(|| value.into())
}

/// `None` where the daemon was not asked.
fn of_answer(said: &Said<'_>, value: impl Into<Value>) -> Option<Value> {
    said.asked.then(|| value.into())
}

/// `None` in both cases.
fn of_answered_sample(said: &Said<'_>, value: impl Into<Value>) -> Option<Value> {
    of_sample(said, value).filter(|_| said.asked)
}

macro_rules! names {
    ($enumeration:ident) => {
        || {
            let names = $enumeration::ALL.iter().map(|value| value.name());
            json!({ "enum": names.collect::<Vec<_>>() })
        }
    };
    ($enumeration:ident or $none:literal) => {
        || {
            let names = std::iter::once($none).chain($enumeration::ALL.iter().map(|value| value.name()));
            json!({ "enum": names.collect::<Vec<_>>() })
        }
    };
}

macro_rules! keys {
    ($($name:ident: $schema:expr, $meaning:literal, |$said:ident| $value:expr $(, if $optional:ident)?;)+) => {
        const KEYS: &[Key] = &[$(Key {
            name: stringify!($name),
            meaning: $meaning,
            schema: $schema,
            value: |$said| keys!(@value $value $(, $optional)?),
            is_optional: keys!(@is_optional $($optional)?),
        },)+];
    };
    (@value $value:expr) => { Some(Value::from($value)) };
    (@value $value:expr, present) => { $value };
    (@is_optional) => { false };
    (@is_optional present) => { true };
}

keys! {
    version: || json!({ "const": VERSION }), "Version of these keys and their meaning.", |_said| VERSION;
    asked: flag, "Whether the daemon itself was asked. Otherwise this is of its diagnostics alone, as they come to another \
        machine: keys that only an answer has are not there.", |said| said.asked;
    text: text, "For a person; of an answer.", |said| of_answer(said, said.response.text().into_owned()), if present;
    mode: names!(Mode), "Mode of the daemon.", |said| Mode::name_of(said.response.mode);
    motion: names!(Motion), "Motion of the last command.", |said| Motion::name_of(said.response.motion);
    stop_reason: names!(StopReason or "None"), "Why the daemon is stopping or stopped, or not in control.",
        |said| StopReason::name_of(said.response.stop_reason);
    enabled: flag, "Whether control is enabled.", |said| of_answer(said, said.response.enabled == 1), if present;
    law: names!(Law), "Law in force.", |said| of_answer(said, Law::name_of(said.response.law)), if present;
    active_axes: || json!({ "type": "array", "items": axis_name() }), "Task axes in contact and controlled.", |said| {
        let is_active = |axis: &usize| said.response.active_axes & (1 << axis) != 0;
        (0..TASK_AXES).filter(is_active).map(|axis| AXIS_NAMES[axis]).collect::<Vec<_>>()
    };
    verdict: names!(Verdict), "Whether the force limits can be met over the horizon; None: no axis is in contact, or the law \
        gives none.",
        |said| Verdict::name_of(said.response.verdict);
    verdict_axis: axis_name, "Task axis that the verdict speaks of; with a verdict alone.", |said| {
        of_verdict(said, |of| AXIS_NAMES.get(of.verdict_axis as usize).copied().into())
    }, if present;
    verdict_side: names!(Side or "None"), "Force limit that the verdict speaks of; with a verdict alone.",
        |said| of_verdict(said, |of| Side::name_of(of.verdict_side).into()), if present;
    verdict_margin: number, "N, of rx ry rz N m: limit minus predicted peak, or minus what is missing; with a verdict alone.",
        |said| of_verdict(said, |of| of.verdict_margin.into()), if present;
    verdict_time_s: number, "s, from the state sample to what the verdict speaks of; with a verdict alone.",
        |said| of_verdict(said, |of| of.verdict_time_s.into()), if present;
    verdict_share: number, "1, 0 to 1: of AtRisk, the share of what may be there that can't be kept below the limit; else 0; with a \
        verdict alone.",
        |said| of_verdict(said, |of| of.verdict_share.into()), if present;
    wrench: axes, "N, N m: wrench of the last accepted state sample as the law sees it, robot on environment, at the TCP, task \
        frame.", |said| said.response.wrench.to_vec();
    wrench_bias: axes, "N, N m: bias in force, as the sensor gives the wrench.",
        |said| of_answer(said, said.response.wrench_bias.to_vec()), if present;
    force_limit: axes, "N, N m: f_max in force.", |said| said.response.force_limit.to_vec();
    minimum_force: axes, "N, N m: configured minimum in contact; 0 on axes that are not controlled.",
        |said| said.diagnostics.minimum_force.to_vec();
    velocity_offset: axes, "m/s, rad/s: velocity offset of the last command, base frame.",
        |said| said.response.velocity_offset.to_vec();
    normal_stiffness_n_m: number, "N/m: stiffness in force along the surface normal.",
        |said| of_answer(said, said.response.normal_stiffness_n_m), if present;
    believed_stiffness_n_m: number, "N/m: stiffness along the normal as it is believed to be; once there was a sample.",
        |said| of_sample(said, said.response.believed_stiffness_n_m), if present;
    believed_stiffness_band_n_m: || numbers(2), "N/m: least and greatest that it may be: one standard deviation where a range \
        is told, else that stiffness; once there was a sample.",
        |said| of_sample(said, said.response.believed_stiffness_band_n_m.to_vec()), if present;
    surface_normal: point, "Outward surface normal in force, base frame.",
        |said| of_answer(said, said.response.surface_normal.to_vec()), if present;
    believed_normal: point, "Outward surface normal as it is believed to be, base frame; once there was a sample.",
        |said| of_answered_sample(said, said.response.believed_normal.to_vec()), if present;
    believed_tilt_rad: number, "rad: angle between believed_normal and surface_normal; 0 where no tolerance of the normal is \
        told. Once there was a sample.", |said| of_sample(said, said.diagnostics.believed_tilt_rad), if present;
    contact_point_m: point, "m: a point of the surface as it is believed to be, base frame.",
        |said| of_answer(said, said.response.contact_point.to_vec()), if present;
    uptime_ns: count, "ns since the start of the daemon, as are all counts.", |said| said.response.uptime_ns;
    state_sequence: count, "Sequence of the last state sample that was answered; 0: none yet.",
        |said| of_answer(said, said.response.state_sequence), if present;
    command_sequence: count, "Sequence of the last command; 0: none yet.",
        |said| of_answer(said, said.response.command_sequence), if present;
    cycles: count, "State samples answered.", |said| said.response.cycles;
    cycles_last_second: count, "State samples answered in the last whole second.",
        |said| said.diagnostics.cycles_last_second;
    rejected_count: count, "State samples refused by validation.", |said| said.response.rejected_count;
    missed_count: count, "State samples never seen: gaps in their sequence.", |said| said.response.missed_count;
    missed_lately: count, "The same of the last 100.", |said| said.diagnostics.missed_lately;
    sample_age_ns: count, "ns: how old the last accepted state sample was at the last diagnostics, which is what the law acts \
        on; with a sample alone.", |said| sample_age_ns(said.diagnostics).map(Value::from), if present;
    fallback_count: count, "Cycles answered by a fallback instead of the law.", |said| said.response.fallback_count;
    late_count: count, "Cycles answered after their deadline.", |said| said.response.late_count;
    limited_count: count, "Cycles whose offset a limit had to cut after the law.", |said| said.diagnostics.limited_count;
    exceeded_count: count, "State samples whose force was beyond its limit.", |said| said.diagnostics.exceeded_count;
    contact_losses: count, "Contacts lost that should have been kept.", |said| said.diagnostics.contact_losses;
    solver_failures: count, "Cycles without a usable answer of the solver although it had time.",
        |said| said.diagnostics.solver_failures;
    records_dropped: count, "Records dropped because the service thread was too slow.", |said| said.diagnostics.dropped_count;
    compute_time_ns: count, "ns: compute time of the last cycle.",
        |said| of_answer(said, said.response.compute_time_ns), if present;
    wake_up_time: quantiles, "From a state sample stamped to received, since the start.", |said| latency(said, 0, false);
    wake_up_time_last_second: quantiles, "The same in the last whole second.", |said| latency(said, 0, true);
    compute_time: quantiles, "From a state sample received to its command published, since the start.",
        |said| latency(said, 1, false);
    compute_time_last_second: quantiles, "The same in the last whole second.", |said| latency(said, 1, true);
    answer_time: quantiles, "From a state sample stamped to its command published, since the start.",
        |said| latency(said, 2, false);
    answer_time_last_second: quantiles, "The same in the last whole second.", |said| latency(said, 2, true);
}

/// What a daemon said, as one object.
pub(super) fn values(said: &Said<'_>) -> Value {
    let present = KEYS.iter().filter_map(|key| Some((key.name.to_owned(), (key.value)(said)?)));
    Value::Object(present.collect())
}

/// The JSON schema of [`values`].
pub(super) fn schema() -> Value {
    let property = |key: &Key| {
        let mut schema = (key.schema)();
        schema["description"] = Value::from(key.meaning);
        (key.name.to_owned(), schema)
    };
    let required: Vec<&str> = KEYS.iter().filter(|key| !key.is_optional).map(|key| key.name).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "admittancectl status --json",
        "type": "object",
        "properties": KEYS.iter().map(property).collect::<Map<String, Value>>(),
        "required": required,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(verdict: Verdict) -> Value {
        let (law, verdict) = (Law::Mpc.code(), verdict.code());
        let response =
            ResponseSample { law, cycles: 7, active_axes: 0b10, verdict, verdict_axis: 1, ..ResponseSample::zeroed() };
        let diagnostics = DiagnosticsSample { stamp_ns: 3_000, state_stamp_ns: 1_000, ..DiagnosticsSample::zeroed() };
        values(&Said { response: &response, diagnostics: &diagnostics, asked: true })
    }

    #[test]
    fn without_a_verdict_nothing_is_said_of_it() {
        let of_verdict = ["verdict_axis", "verdict_side", "verdict_margin", "verdict_time_s", "verdict_share"];
        let (none, some) = (said(Verdict::None), said(Verdict::Feasible));
        assert_eq!((&none["verdict"], &none["active_axes"]), (&"None".into(), &json!(["y"])));
        assert!(of_verdict.iter().all(|key| none.get(key).is_none()) && none["sample_age_ns"] == 2_000, "{none}");
        assert!(of_verdict.iter().all(|key| some.get(key).is_some()) && some["verdict_axis"] == "y", "{some}");
    }

    #[test]
    fn what_only_an_answer_has_is_not_there_without_one() {
        let diagnostics = DiagnosticsSample { cycles: 3, mode: Mode::Contact.code(), ..DiagnosticsSample::zeroed() };
        let said = Said { response: &of_diagnostics(&diagnostics), diagnostics: &diagnostics, asked: false };
        let (said, schema) = (values(&said), schema());
        assert_eq!((&said["asked"], &said["mode"], &said["cycles"]), (&false.into(), &"Contact".into(), &3.into()));
        let required = schema["required"].as_array().expect("a list");
        let missing = required.iter().filter(|key| said.get(key.as_str().expect("a name")).is_none());
        assert_eq!(missing.count(), 0, "{said}");
        let of_answer =
            ["text", "enabled", "law", "wrench_bias", "surface_normal", "believed_normal", "state_sequence"];
        assert!(of_answer.iter().all(|key| said.get(key).is_none()), "{said}");
        assert!(said.get("believed_stiffness_n_m").is_some(), "{said}");
    }

    #[test]
    fn the_schema_tells_every_key_once() {
        let (schema, said) = (schema(), said(Verdict::Infeasible));
        let properties = schema["properties"].as_object().expect("an object");
        let values = said.as_object().expect("an object");
        assert_eq!(properties.len(), KEYS.len(), "a key is declared twice");
        assert!(properties.keys().eq(values.keys()));
        for (name, property) in properties {
            let (value, told) = (&values[name], &property["type"]);
            let is_so = match told.as_str() {
                Some("string") => value.is_string(),
                Some("integer") => value.is_u64(),
                Some("number") => value.is_number(),
                Some("boolean") => value.is_boolean(),
                Some("array") => value.is_array(),
                Some("object") => value.is_object(),
                Some(other) => panic!("{name}: {other}"),
                None => {
                    property["const"] == *value || property["enum"].as_array().is_some_and(|all| all.contains(value))
                }
            };
            assert!(
                is_so && !property["description"].as_str().expect("a text").is_empty(),
                "{name}: {value} of {property}"
            );
        }
    }
}
