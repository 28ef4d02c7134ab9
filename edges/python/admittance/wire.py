"""The samples as ctypes structures, made from the schema that comes with the package (`wire.json`)."""

import ctypes
import json
from importlib.resources import files
from typing import Any

SCHEMA: dict[str, Any] = json.loads(files(__package__).joinpath("wire.json").read_text())

_SCALARS = {"u8": ctypes.c_uint8, "u32": ctypes.c_uint32, "u64": ctypes.c_uint64, "f64": ctypes.c_double}


def _structure(name: str) -> type[ctypes.Structure]:
    declared = next(entry for entry in SCHEMA["types"] if entry["name"] == name)
    fields: list[tuple[str, Any]] = []
    for field in declared["fields"]:
        kind: Any = _SCALARS[field["type"]]
        for length in reversed(field["shape"]):
            kind = kind * length
        fields.append((field["name"], kind))
    meanings = (f"{field['name']}: {field['meaning']} Unit: {field['unit']}." for field in declared["fields"])
    text = "\n".join([declared["meaning"], "", *meanings])
    # With slots a name that is misspelt is an error, and not a field that stays zero.
    made = type(name, (ctypes.Structure,), {"_fields_": fields, "__doc__": text, "__slots__": ()})
    wrong = [field["name"] for field in declared["fields"] if getattr(made, field["name"]).offset != field["offset"]]
    if wrong or ctypes.sizeof(made) != declared["size"]:
        raise ImportError(f"{name}: this Python lays out {wrong or 'it'} otherwise than the schema")
    return made


def codes(enumeration: str) -> dict[int, str]:
    """Names of an enum's codes, such as `codes("Mode")`."""
    declared = next(entry for entry in SCHEMA["enums"] if entry["name"] == enumeration)
    return {value["code"]: value["name"] for value in declared["values"]}


StateSample = _structure("StateSample")
CommandSample = _structure("CommandSample")
