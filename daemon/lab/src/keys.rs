//! Keys of a configuration or a scenario, changed one by one before it is parsed as one.

use admittancectl::{Exit, Outcome};
use toml::{Table, Value};

/// The table that a shipped file is.
///
/// # Errors
/// [`Exit::Internal`] with what toml says: files are shipped whole.
pub(crate) fn parsed(text: &str) -> Outcome<Table> {
    text.parse().map_err(|error: toml::de::Error| (Exit::Internal, error.to_string()))
}

/// Sets a key; a section that is not there is added.
pub(crate) fn set(table: &mut Table, section: &str, key: &str, value: impl Into<Value>) {
    let section = table.entry(section).or_insert_with(|| Value::Table(Table::new()));
    if let Some(section) = section.as_table_mut() {
        section.insert(key.to_owned(), value.into());
    }
}

/// Real time, with this SCHED_FIFO priority on this processor.
pub(crate) fn real_time(table: &mut Table, priority: u32, cpu: u32) {
    set(table, "realtime", "lock_memory", true);
    set(table, "realtime", "priority", i64::from(priority));
    set(table, "realtime", "cpu", i64::from(cpu));
}
