//! The records of an MCAP file, and a copy of one with a bit changed.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::Record;

/// Every record of an MCAP file, chunks unpacked.
pub(crate) fn mcap_records(file: &Path) -> Vec<Record<'static>> {
    let bytes = std::fs::read(file).expect("the recording is there");
    let reader = mcap::read::ChunkFlattener::new(&bytes).expect("an MCAP file that is complete");
    reader.map(|record| record.expect("a sound file").into_owned()).collect()
}

/// Writes a recording again with one bit of one command changed: the last of the joint velocity
/// offset's first element, in the middle of the contact. Returns the sequence of its record.
pub(crate) fn with_altered_bit(original: &Path, altered: &Path) -> u64 {
    let records = mcap_records(original);
    let topics: BTreeMap<u16, String> = records
        .iter()
        .filter_map(|record| match record {
            Record::Channel(channel) => Some((channel.id, channel.topic.clone())),
            _ => None,
        })
        .collect();
    let is_command = |id: u16| topics.get(&id).is_some_and(|topic| topic == "/command");
    let json = |data: &[u8]| serde_json::from_slice::<serde_json::Value>(data).expect("JSON");
    let has_axes = |command: &serde_json::Value| command["active_axes"].as_array().is_some_and(|axes| !axes.is_empty());
    let in_contact: Vec<usize> = (0..records.len())
        .filter(|index| match &records[*index] {
            Record::Message { header, data } => is_command(header.channel_id) && has_axes(&json(data)),
            _ => false,
        })
        .collect();
    let target = in_contact[in_contact.len() / 2];
    let mut sequence = 0;
    let mut writer = mcap::Writer::new(BufWriter::new(File::create(altered).expect("a new file"))).expect("a header");
    for (index, record) in records.into_iter().enumerate() {
        match record {
            Record::Metadata(metadata) => writer.write_metadata(&metadata).expect("written"),
            Record::Attachment { header, data, .. } => {
                let (log_time, create_time) = (header.log_time, header.create_time);
                let (name, media_type) = (header.name, header.media_type);
                writer.attach(&mcap::Attachment { log_time, create_time, name, media_type, data }).expect("written");
            }
            Record::Schema { header, data } => {
                writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(drop).expect("written");
            }
            Record::Channel(channel) => {
                writer
                    .add_channel_with_id(
                        channel.id,
                        channel.schema_id,
                        &channel.topic,
                        &channel.message_encoding,
                        &channel.metadata,
                    )
                    .map(drop)
                    .expect("written");
            }
            Record::Message { header, data } => {
                let mut data = data.into_owned();
                if index == target {
                    let mut command = json(&data);
                    let value = command["joint_velocity_offset"][0].as_f64().expect("a number");
                    command["joint_velocity_offset"][0] = f64::from_bits(value.to_bits() ^ 1).into();
                    sequence = u64::from(header.sequence);
                    data = command.to_string().into_bytes();
                }
                writer.write_to_known_channel(&header, &data).expect("written");
            }
            _ => {}
        }
    }
    writer.finish().expect("written");
    sequence
}
