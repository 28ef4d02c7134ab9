#!/usr/bin/env python3
"""A motion controller in Python that knows admittanced from its schema alone.

    foreign_client.py SCHEMA.json ROOT_PATH PREFIX INSTANCE        ("-" reads the schema from stdin)

SCHEMA.json is the output of `admittancectl schema --json`. Classes, service names and quality of service all come from
it; no layout is written down here. It publishes state samples of a 2-joint planar arm that stands still in free space,
waits for the command that answers each of them, and prints one JSON object:

    {"sent": N, "answered": M, "mode_names": [...], "last_command": {...}}

Exit code: 0 when every sample but the first few was answered, 1 when not, 64 usage, 66 no such schema file, 69 no
daemon or no shared memory, 78 a schema that this program cannot follow. Needs Python 3.9 or newer and iceoryx2 0.10.0
from PyPI.
"""

import ctypes
import json
import os
import sys
import time

import iceoryx2 as iox2

SAMPLES = 200
SAMPLING_TIME_S = 0.004
# Samples that may pass unanswered at the start, while the connections are being made.
START_UP_SAMPLES = 10
CONNECT_TIMEOUT_S = 10.0
ANSWER_TIMEOUT_S = 0.25

SCALARS = {"u8": ctypes.c_uint8, "u32": ctypes.c_uint32, "u64": ctypes.c_uint64, "f64": ctypes.c_double}


class SchemaError(Exception):
    """The schema holds something that this program cannot follow."""


def load_schema(path):
    """Reads the schema from a file, or from stdin when the path is "-"."""
    if path == "-":
        return json.load(sys.stdin)
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def field_type(field, classes):
    """The ctypes type of a field: its scalar, or the class of the sample that it holds, wrapped in its dimensions from the
    innermost outwards."""
    try:
        kind = SCALARS.get(field["type"]) or classes[field["type"]]
    except KeyError:
        raise SchemaError(f"field {field['name']}: unknown type {field['type']}") from None
    for dimension in reversed(field["shape"]):
        kind = kind * dimension
    return kind


def make_class(entry, classes):
    """Builds the ctypes structure of one type, which may hold those before it; refuses it when ctypes lays it out differently
    than the schema says."""
    type_name = entry["type_name"]
    cls = type(
        entry["name"],
        (ctypes.Structure,),
        {
            "_fields_": [(field["name"], field_type(field, classes)) for field in entry["fields"]],
            "type_name": staticmethod(lambda: type_name),
            "__doc__": entry["meaning"],
        },
    )
    for field in entry["fields"]:
        offset = getattr(cls, field["name"]).offset
        if offset != field["offset"]:
            raise SchemaError(f"{entry['name']}.{field['name']}: ctypes offset {offset}, schema {field['offset']}")
    if (ctypes.sizeof(cls), ctypes.alignment(cls)) != (entry["size"], entry["alignment"]):
        raise SchemaError(
            f"{entry['name']}: ctypes size {ctypes.sizeof(cls)} and alignment {ctypes.alignment(cls)}, "
            f"schema {entry['size']} and {entry['alignment']}"
        )
    return cls


class Contract:
    """Classes, enums and services of one schema."""

    def __init__(self, schema):
        self.types = {entry["name"]: entry for entry in schema["types"]}
        self.classes = {}
        for name, entry in self.types.items():
            self.classes[name] = make_class(entry, self.classes)
        self.enums = {
            entry["name"]: {value["code"]: value["name"] for value in entry["values"]} for entry in schema["enums"]
        }
        self.services = {entry["name"]: entry for entry in schema["services"]}

    def builder(self, node, instance, name):
        """The builder of a service with the schema's messaging pattern, types and quality of service."""
        entry = self.services[name]
        builder = node.service_builder(iox2.ServiceName.new(entry["name_pattern"].replace("{instance}", instance)))
        pattern = entry["messaging_pattern"]
        if pattern == "publish-subscribe":
            builder = builder.publish_subscribe(self.classes[entry["payload"]])
        elif pattern == "event":
            builder = builder.event()
        elif pattern == "request-response":
            builder = builder.request_response(self.classes[entry["request"]], self.classes[entry["response"]])
        else:
            raise SchemaError(f"service {name}: unknown messaging pattern {pattern}")
        for setting, value in entry["qos"].items():
            builder = getattr(builder, setting)(value)
        return builder

    def open_or_create(self, node, instance, name):
        """Opens a service, or creates it when it is not there: for the daemon and the motion controller only."""
        return self.builder(node, instance, name).open_or_create()

    def open(self, node, instance, name):
        """Opens a service that exists: for everyone else."""
        return self.builder(node, instance, name).open()

    def enum_name(self, enum, code):
        """The name of a code; the code itself when this schema does not know it."""
        return self.enums[enum].get(code, code)

    def to_dict(self, type_name, sample):
        """A sample as plain values; codes appear by name."""
        out = {}
        for field in self.types[type_name]["fields"]:
            value = getattr(sample, field["name"])
            if field["enum"] is not None:
                value = self.enum_name(field["enum"], value)
            if field["shape"]:
                value = [list(row) if len(field["shape"]) == 2 else row for row in value]
            out[field["name"]] = value
        return out


def make_node(root_path, prefix, name):
    """A node with an explicit configuration: no configuration file is looked up."""
    config = iox2.config.default()
    config.global_cfg.root_path = iox2.Path.new(root_path)
    config.global_cfg.prefix = iox2.FileName.new(prefix)
    return (
        iox2.NodeBuilder.new()
        .name(iox2.NodeName.new(name))
        .config(config)
        .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        .create(iox2.ServiceType.Ipc)
    )


class MotionController:
    """The motion controller's four ports, and one cycle over them."""

    def __init__(self, contract, node, instance):
        self.contract = contract
        self.state_class = contract.classes["StateSample"]
        # The services stay referenced: ports and their counts live as long as they do.
        self.state = contract.open_or_create(node, instance, "state")
        self.state_arrival = contract.open_or_create(node, instance, "state-arrival")
        self.command = contract.open_or_create(node, instance, "command")
        self.command_arrival = contract.open_or_create(node, instance, "command-arrival")
        self.publisher = self.state.publisher_builder().create()
        self.notifier = self.state_arrival.notifier_builder().create()
        self.subscriber = self.command.subscriber_builder().create()
        self.listener = self.command_arrival.listener_builder().create()
        self.boot_id = int.from_bytes(os.urandom(8), "little") | 1
        self.sequence = 0
        self.applied_command_sequence = 0

    def wait_for_daemon(self, timeout_s):
        """Waits until someone subscribes to state samples; False when nobody did in time."""
        end = time.monotonic() + timeout_s
        while self.state.dynamic_config.number_of_subscribers == 0:
            if time.monotonic() > end:
                return False
            time.sleep(0.01)
        return True

    def next_sample(self, joint_position):
        """The next state sample, with this instant's stamp: of an arm that stands still in free space."""
        self.sequence += 1
        sample = self.state_class()
        sample.sequence = self.sequence
        sample.boot_id = self.boot_id
        sample.applied_command_sequence = self.applied_command_sequence
        sample.joint_count = len(joint_position)
        sample.wrench_valid = 1
        sample.drives_enabled = 1
        for joint, position in enumerate(joint_position):
            sample.joint_position[joint] = position
            sample.joint_position_reference[joint] = position
        sample.stamp_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        return sample

    def publish(self, sample):
        """Publishes a state sample and wakes the daemon."""
        self.publisher.loan_uninit().write_payload(sample).send()
        self.notifier.notify()

    def receive(self):
        """The newest command that has not been read yet, as an own copy; None when there is none."""
        received = self.subscriber.receive()
        if received is None:
            return None
        command = type(received.payload().contents).from_buffer_copy(received.payload().contents)
        received.delete()
        self.applied_command_sequence = command.sequence
        return command

    def wait_for_answer(self, sequence, until):
        """The command that answers a state sample; None when it is not there at `until` (time.monotonic)."""
        while True:
            command = self.receive()
            if command is not None and command.state_sequence == sequence:
                return command
            left = until - time.monotonic()
            if left <= 0.0:
                return None
            if command is None:
                self.listener.timed_wait(iox2.Duration.from_secs_f64(left))


def run(contract, root_path, prefix, instance):
    """Runs the controller over all samples. Returns the result object and the samples that were not answered."""
    node = make_node(root_path, prefix, "foreign_client")
    controller = MotionController(contract, node, instance)
    if not controller.wait_for_daemon(CONNECT_TIMEOUT_S):
        raise ConnectionError(f"nobody subscribed to state samples in {CONNECT_TIMEOUT_S} s: is admittanced running?")
    unanswered, mode_names, last = [], [], None
    start = time.monotonic()
    for index in range(SAMPLES):
        # Absolute instants: a late cycle is caught up, so that the mean rate is kept.
        due = start + index * SAMPLING_TIME_S
        time.sleep(max(0.0, due - time.monotonic()))
        sample = controller.next_sample([1.2, -1.0])
        controller.publish(sample)
        patience = SAMPLING_TIME_S if last is None else ANSWER_TIMEOUT_S
        command = controller.wait_for_answer(sample.sequence, time.monotonic() + patience)
        if command is None:
            unanswered.append(sample.sequence)
            continue
        last = command
        name = contract.enum_name("Mode", command.mode)
        if name not in mode_names:
            mode_names.append(name)
    result = {
        "sent": SAMPLES,
        "answered": SAMPLES - len(unanswered),
        "mode_names": mode_names,
        "last_command": None if last is None else contract.to_dict("CommandSample", last),
    }
    return result, unanswered


def main(arguments):
    """The command line."""
    if len(arguments) != 4:
        print("usage: foreign_client.py SCHEMA.json ROOT_PATH PREFIX INSTANCE", file=sys.stderr)
        return 64
    path, root_path, prefix, instance = arguments
    iox2.set_log_level(iox2.LogLevel.Error)
    try:
        contract = Contract(load_schema(path))
    except OSError as error:
        print(f"foreign_client: {path}: {error.strerror}", file=sys.stderr)
        return 66
    except (KeyError, TypeError, ValueError, SchemaError) as error:
        print(f"foreign_client: {path} is no schema of admittanced: {error!r}", file=sys.stderr)
        return 78
    try:
        result, unanswered = run(contract, root_path, prefix, instance)
    # iceoryx2 raises one exception type per operation, without a common base.
    except Exception as error:
        print(f"foreign_client: instance {instance} in {root_path} ({prefix}): {error!r}", file=sys.stderr)
        return 69
    print(json.dumps(result))
    missing = [sequence for sequence in unanswered if sequence > START_UP_SAMPLES]
    if missing:
        print(f"foreign_client: {len(missing)} samples not answered, the first is {missing[0]}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
