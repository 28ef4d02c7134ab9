//! The contract as a C header (C11 or C++11) that checks its own layout when it is compiled.

use std::fmt::{Result, Write};

use crate::layout::{FieldInfo, SampleInfo};
use crate::schema::EnumEntry;
use crate::schema::{Schema, ServiceEntry, schema};

/// The text of the header.
pub fn c_header() -> String {
    let mut text = String::new();
    write_header(&mut text, &schema()).expect("writing to a String does not fail");
    text
}

fn write_header(out: &mut String, schema: &Schema) -> Result {
    let (constants, conventions) = (&schema.constants, &schema.conventions);
    writeln!(
        out,
        "/* The wire contract of admittanced, schema version {}. Generated: do not edit.",
        schema.schema_version
    )?;
    writeln!(out, " * Transport: {}.", schema.transport)?;
    writeln!(out, " * Layout: {}.", conventions.layout)?;
    writeln!(out, " * Time: {}.", conventions.time)?;
    writeln!(out, " * Cartesian arrays: {}.", conventions.cartesian)?;
    writeln!(out, " * Joint arrays: {}.", conventions.joints)?;
    writeln!(out, " * Wrench: {}.", conventions.wrench)?;
    writeln!(out, " */\n#ifndef ADMITTANCED_H\n#define ADMITTANCED_H\n")?;
    writeln!(out, "#include <stddef.h>\n#include <stdint.h>\n")?;
    writeln!(out, "#ifdef __cplusplus\n#define ADMITTANCED_ASSERT static_assert")?;
    writeln!(out, "#define ADMITTANCED_ALIGNOF alignof\n#else\n#define ADMITTANCED_ASSERT _Static_assert")?;
    writeln!(out, "#define ADMITTANCED_ALIGNOF _Alignof\n#endif\n")?;
    writeln!(out, "#define ADMITTANCED_SCHEMA_VERSION {}u", schema.schema_version)?;
    writeln!(out, "#define ADMITTANCED_MAX_JOINTS {}", constants.max_joints)?;
    writeln!(out, "#define ADMITTANCED_TASK_AXES {}", constants.task_axes)?;
    writeln!(out, "#define ADMITTANCED_MAX_PLAN {}", constants.max_plan)?;
    writeln!(out, "#define ADMITTANCED_QUANTILES {}", constants.quantiles)?;
    writeln!(out, "#define ADMITTANCED_REQUEST_VALUES {}", constants.request_values)?;
    writeln!(out, "#define ADMITTANCED_TEXT_LENGTH {}\n", constants.text_length)?;
    writeln!(out, "/* Service names: printf formats of the instance name. */")?;
    for service in &schema.services {
        write_service(out, service)?;
    }
    for enumeration in &schema.enums {
        write_enum(out, enumeration)?;
    }
    for sample in schema.types {
        write_sample(out, sample)?;
    }
    writeln!(out, "\n#endif")
}

fn write_service(out: &mut String, service: &ServiceEntry) -> Result {
    let name = screaming(&service.name.replace('-', "_"));
    let format = service.name_pattern.replace("{instance}", "%s");
    writeln!(out, "#define ADMITTANCED_SERVICE_{name} \"{format}\" /* {} */", service.meaning)
}

fn write_enum(out: &mut String, enumeration: &EnumEntry) -> Result {
    writeln!(out, "\n/* {} {} */", enumeration.name, enumeration.meaning)?;
    let prefix = screaming(&snake(enumeration.name));
    for value in &enumeration.values {
        let name = screaming(&snake(value.name));
        writeln!(out, "#define ADMITTANCED_{prefix}_{name} {}u /* {} */", value.code, value.meaning)?;
    }
    Ok(())
}

fn write_sample(out: &mut String, sample: &SampleInfo) -> Result {
    let name = format!("admittanced_{}", snake(sample.name));
    writeln!(out, "\n/* {} Written by {}. */", sample.meaning, sample.writer)?;
    writeln!(out, "#define {}_TYPE_NAME \"{}\"", screaming(&name), sample.type_name)?;
    writeln!(out, "typedef struct {name} {{")?;
    for field in sample.fields {
        write_field(out, field)?;
    }
    writeln!(out, "}} {name};")?;
    writeln!(out, "ADMITTANCED_ASSERT(sizeof({name}) == {}, \"{name}\");", sample.size)?;
    writeln!(out, "ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF({name}) == {}, \"{name}\");", sample.alignment)?;
    for FieldInfo { name: field, offset, .. } in sample.fields {
        writeln!(out, "ADMITTANCED_ASSERT(offsetof({name}, {field}) == {offset}, \"{name}.{field}\");")?;
    }
    Ok(())
}

fn write_field(out: &mut String, field: &FieldInfo) -> Result {
    let scalar = match field.scalar {
        "u8" => "uint8_t",
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "f64" => "double",
        sample => &format!("admittanced_{}", snake(sample)),
    };
    let dimensions: String = field.shape.iter().map(|n| format!("[{n}]")).collect();
    writeln!(out, "    /* {} Unit: {}. Range: {}. */", field.meaning, field.unit, field.range)?;
    writeln!(out, "    {scalar} {}{dimensions};", field.name)
}

/// `StateSample` to `state_sample`.
fn snake(camel: &str) -> String {
    let mut out = String::new();
    for (index, c) in camel.chars().enumerate() {
        if c.is_ascii_uppercase() && index > 0 {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

fn screaming(snake: &str) -> String {
    snake.to_ascii_uppercase()
}
