"""What type checkers and editors are told of the samples, `wire.pyi`: written from the schema when the wheel is built."""

import json
from pathlib import Path

HEAD = '''"""The samples, and names of their codes."""

import ctypes
from typing import Any

SCHEMA: dict[str, Any]

def codes(enumeration: str) -> dict[int, str]:
    """Names of an enum's codes, such as `codes("Mode")`."""
'''
ELEMENTS = {"u8": "c_uint8", "u32": "c_uint32", "u64": "c_uint64", "f64": "c_double"}


def annotation(field):
    """How a field reads in Python."""
    element = f"ctypes.{ELEMENTS[field['type']]}"
    if not field["shape"]:
        return "float" if field["type"] == "f64" else "int"
    for _ in field["shape"]:
        element = f"ctypes.Array[{element}]"
    return element


def sample(declared):
    """A sample as a class, its fields with their units."""
    lines = ["", f"class {declared['name']}(ctypes.Structure):", f'    """{declared["meaning"]}"""', ""]
    for field in declared["fields"]:
        lines.append(f"    {field['name']}: {annotation(field)}")
        lines.append(f'    """{field["meaning"]} Unit: {field["unit"]}; {field["range"]}."""')
    return "\n".join(lines)


def write(schema_path: Path, path: Path):
    """Writes the stub of `admittance.wire`."""
    types = {entry["name"]: entry for entry in json.loads(schema_path.read_text())["types"]}
    path.write_text("\n".join([HEAD, sample(types["StateSample"]), sample(types["CommandSample"]), ""]))
