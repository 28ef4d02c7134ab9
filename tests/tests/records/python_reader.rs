//! A recording as the PyPI package `mcap` reads it.

use std::path::Path;
use std::process::{Command, Output};

use end_to_end::{Need, needs, python};

/// The PyPI package reads the same channels, schemas and configuration.
pub(crate) fn read_with_python(file: &Path, complete: bool) {
    if !needs(Need::Python) {
        return;
    }
    let script = r#"
import collections, json, sys
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.records import Attachment, Channel, Footer, Message, Metadata, Schema

counts, keys, topics, schemas = collections.Counter(), {}, {}, {}
attachments, metadata, complete = [], [], False
try:
    with open(sys.argv[1], "rb") as file:
        for record in StreamReader(file, record_size_limit=None).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                topics[record.id] = record
            elif isinstance(record, Message):
                channel = topics[record.channel_id]
                schema = json.loads(schemas[channel.schema_id].data)
                message = json.loads(record.data)
                assert channel.message_encoding == "json"
                assert schemas[channel.schema_id].encoding == "jsonschema" and schema["type"] == "object"
                for name, field in schema["properties"].items():
                    # All that Foxglove takes.
                    assert field["type"] in ("number", "integer", "string", "array"), name
                    assert field["type"] != "array" or field["items"]["type"] in ("number", "integer", "string"), name
                assert set(message) == set(schema["required"]) == set(schema["properties"]), channel.topic
                if channel.topic == "/command":
                    assert message["mode"] in ("Idle", "Free", "Contact", "Stopping", "Stopped"), message["mode"]
                    assert set(message["active_axes"]) <= {"x", "y"} and message["verdict_axis"] in ("x", "y"), message
                counts[channel.topic] += 1
            elif isinstance(record, Attachment):
                attachments.append((record.name, record.data.decode()))
            elif isinstance(record, Metadata):
                metadata.append((record.name, record.metadata))
            elif isinstance(record, Footer):
                complete = True
except McapError as error:
    print("breaks off:", error, file=sys.stderr)
if complete:
    with open(sys.argv[1], "rb") as file:
        reader = make_reader(file)
        assert sum(1 for _ in reader.iter_messages(topics=["/cycle"])) == counts["/cycle"]
        assert next(reader.iter_attachments()).name == "configuration-0.toml"
print(json.dumps({"counts": counts, "attachments": attachments, "metadata": metadata, "complete": complete}))
"#;
    let mut reader = Command::new(python().expect("needs(Python) found one"));
    let Output { status, stdout, stderr } = reader.arg("-c").arg(script).arg(file).output().expect("python starts");
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    let found: serde_json::Value = serde_json::from_slice(&stdout).expect("one JSON object");
    assert_eq!(found["complete"], complete);
    assert_eq!(found["metadata"][0][0], "admittanced");
    let configuration = found["attachments"][0][1].as_str().expect("a text");
    assert!(configuration.contains("[mpc]"), "{configuration}");
    let count = |topic: &str| found["counts"][topic].as_u64().unwrap_or(0);
    assert!(count("/state") > 200 && count("/cycle") >= count("/command"), "{}", found["counts"]);
    assert!(count("/command") >= count("/state") && count("/truth") > 200, "{}", found["counts"]);
}
