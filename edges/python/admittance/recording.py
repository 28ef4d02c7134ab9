"""Recordings of `admittancectl record` and `simulate` as numpy arrays."""

import json
import os
from collections.abc import Iterator
from typing import Any

import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

_NOT_IN_JSON = {"NaN": np.nan, "inf": np.inf, "-inf": -np.inf}


def _number(value: Any) -> Any:
    return [_number(each) for each in value] if isinstance(value, list) else _NOT_IN_JSON.get(value, value)


class Topic:
    """The samples of one topic. Each field is an array, one row a sample, under the name that `docs/wire.md` and
    `admittancectl schema` have for it: `recording.state.joint_position`, in the units that they say. Names of codes are
    arrays of texts; the rows of a plan follow each other."""

    def __init__(self, name: str, messages: list[dict[str, Any]], fields: list[str]) -> None:
        self.name = name
        self._messages, self._fields = messages, fields

    def __len__(self) -> int:
        return len(self._messages)

    def __dir__(self) -> list[str]:
        return sorted(self._fields)

    def __getattr__(self, field: str) -> NDArray[Any]:
        if field.startswith("_") or field not in self._fields:
            raise AttributeError(f"{self.name} has no field {field}: accepted: {', '.join(self._fields)}")
        values = [_number(message[field]) for message in self._messages]
        if any(isinstance(value, list) and value and isinstance(value[0], str) for value in values):
            # Sets of names differ in length.
            made = np.empty(len(values), dtype=object)
            made[:] = values
        else:
            made = np.array(values)
        setattr(self, field, made)
        return made


class Recording:
    """A file of `admittancectl record` or `simulate`: `Recording("x.mcap").wrench`.

    `state`, `command`, `cycle` and `truth` (what only plant-sim knows) are its topics; those without samples are empty.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        messages: dict[str, list[dict[str, Any]]] = {}
        fields: dict[str, list[str]] = {}
        self.configuration = ""
        """The daemon's configuration, TOML."""
        with open(path, "rb") as file:
            reader = make_reader(file)
            for schema, channel, message in reader.iter_messages():
                topic = channel.topic.strip("/")
                if topic not in fields:
                    fields[topic] = list(json.loads(schema.data)["properties"]) if schema else []
                messages.setdefault(topic, []).append(json.loads(message.data))
            self.configuration = next((each.data.decode() for each in reader.iter_attachments()), "")
        self._topics = {name: Topic(name, found, fields[name]) for name, found in messages.items()}

    def __iter__(self) -> Iterator[Topic]:
        return iter(self._topics.values())

    def __getitem__(self, topic: str) -> Topic:
        return self._topics[topic]

    @property
    def state(self) -> Topic:
        """State samples as they were sent."""
        return self._topics.get("state", Topic("state", [], []))

    @property
    def command(self) -> Topic:
        """The daemon's answers."""
        return self._topics.get("command", Topic("command", [], []))

    @property
    def cycle(self) -> Topic:
        """What the law was given and what it learned."""
        return self._topics.get("cycle", Topic("cycle", [], []))

    @property
    def truth(self) -> Topic:
        """What only the simulated plant knows."""
        return self._topics.get("truth", Topic("truth", [], []))

    @property
    def time_s(self) -> NDArray[np.float64]:
        """When each state sample was measured, in s from the first."""
        stamps: NDArray[np.float64] = (self.state.stamp_ns - self.state.stamp_ns[0]) * 1e-9
        return stamps

    @property
    def wrench(self) -> NDArray[np.float64]:
        """Wrench of each state sample as it was sent, N and N m: x y z rx ry rz."""
        return self.state.wrench

    @property
    def velocity_offset(self) -> NDArray[np.float64]:
        """Velocity offset of each answer, m/s and rad/s: x y z rx ry rz."""
        return self.command.velocity_offset
