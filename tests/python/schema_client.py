"""A motion controller that knows the wire from the schema alone, and shares no code with the package `admittance` or the
C client: what it gets wrong, docs/wire.md or the schema leaves out.

    schema_client.py SCHEMA.json ROOT_PATH PREFIX INSTANCE

SCHEMA.json is the output of `admittancectl schema --json`. Opens every service that the daemon has, publishes state samples of
a 2-joint planar arm that stands still in free space, waits for the command that answers each of them, and prints
{"sent": N, "unanswered": [...], "opened": [...], "mode_names": [...]}. Needs iceoryx2 from PyPI.
"""

import ctypes
import json
import os
import sys
import time

import iceoryx2 as iox2

SAMPLES = 200
SAMPLING_TIME_S = 0.004
CONNECT_TIMEOUT_S = 10.0
ANSWER_TIMEOUT_S = 0.25
JOINT_POSITION = [1.2, -1.0]

SCALARS = {"u8": ctypes.c_uint8, "u32": ctypes.c_uint32, "u64": ctypes.c_uint64, "f64": ctypes.c_double}


def field_type(field, classes):
    """The ctypes type of a field, wrapped in its dimensions from the innermost outwards."""
    kind = SCALARS.get(field["type"]) or classes[field["type"]]
    for dimension in reversed(field["shape"]):
        kind = kind * dimension
    return kind


def make_class(entry, classes):
    """The ctypes structure of a type, which may hold those before it; ctypes has to lay it out as the schema says."""
    fields = [(field["name"], field_type(field, classes)) for field in entry["fields"]]
    type_name = entry["type_name"]
    made = type(entry["name"], (ctypes.Structure,), {"_fields_": fields, "type_name": staticmethod(lambda: type_name)})
    found = [getattr(made, name).offset for name, _ in fields] + [ctypes.sizeof(made), ctypes.alignment(made)]
    said = [field["offset"] for field in entry["fields"]] + [entry["size"], entry["alignment"]]
    if found != said:
        sys.exit(f"schema_client: {entry['name']}: ctypes lays out {found}, the schema says {said}")
    return made


class Contract:
    """Classes, enums and services of a schema, for one instance."""

    def __init__(self, schema, node, instance):
        self.node, self.instance = node, instance
        self.classes = {}
        for entry in schema["types"]:
            self.classes[entry["name"]] = make_class(entry, self.classes)
        self.enums = {
            entry["name"]: {value["code"]: value["name"] for value in entry["values"]} for entry in schema["enums"]
        }
        self.services = {entry["name"]: entry for entry in schema["services"]}

    def service(self, name):
        """The builder of a service with the schema's messaging pattern, types and quality of service."""
        entry = self.services[name]
        name = iox2.ServiceName.new(entry["name_pattern"].replace("{instance}", self.instance))
        builder = self.node.service_builder(name)
        match entry["messaging_pattern"]:
            case "publish-subscribe":
                builder = builder.publish_subscribe(self.classes[entry["payload"]])
            case "event":
                builder = builder.event()
            case "request-response":
                builder = builder.request_response(self.classes[entry["request"]], self.classes[entry["response"]])
            case other:
                sys.exit(f"schema_client: service {name}: unknown messaging pattern {other}")
        for setting, value in entry["qos"].items():
            builder = getattr(builder, setting)(value)
        return builder


def make_node(root_path, prefix):
    """A node with an explicit configuration: no configuration file is looked up."""
    config = iox2.config.default()
    config.global_cfg.root_path = iox2.Path.new(root_path)
    config.global_cfg.prefix = iox2.FileName.new(prefix)
    builder = iox2.NodeBuilder.new().name(iox2.NodeName.new("schema_client")).config(config)
    return builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)


def await_command(subscriber, listener, sequence, until):
    """The command that answers a state sample; None when it is not there at `until` (time.monotonic)."""
    while (left := until - time.monotonic()) > 0.0:
        received = subscriber.receive()
        if received is None:
            listener.timed_wait(iox2.Duration.from_secs_f64(left))
            continue
        command = type(received.payload().contents).from_buffer_copy(received.payload().contents)
        received.delete()
        if command.state_sequence == sequence:
            return command
    return None


def main(schema_path, root_path, prefix, instance):
    """The command line."""
    iox2.set_log_level(iox2.LogLevel.Error)
    with open(schema_path, encoding="utf-8") as file:
        schema = json.load(file)
    contract = Contract(schema, make_node(root_path, prefix), instance)
    # The motion controller's four; whoever comes first creates them. They stay referenced: ports live as long.
    state, state_arrival, command, command_arrival = (
        contract.service(name).open_or_create() for name in ("state", "state-arrival", "command", "command-arrival")
    )
    publisher = state.publisher_builder().create()
    notifier = state_arrival.notifier_builder().create()
    subscriber = command.subscriber_builder().create()
    listener = command_arrival.listener_builder().create()
    give_up = time.monotonic() + CONNECT_TIMEOUT_S
    while state.dynamic_config.number_of_subscribers == 0:
        if time.monotonic() > give_up:
            sys.exit(f"schema_client: nobody subscribed to state samples in {CONNECT_TIMEOUT_S} s")
        time.sleep(0.01)
    # A quality of service or a type that differs from the daemon's is refused here. Of the others' none is there.
    theirs = [name for name, entry in contract.services.items() if "admittanced" in entry["creator"]]
    opened = [contract.service(name).open() for name in theirs]

    boot_id = int.from_bytes(os.urandom(8), "little") | 1
    unanswered, mode_names, applied, start = [], [], 0, time.monotonic()
    for index in range(SAMPLES):
        # Absolute instants: a late cycle is caught up, so that the mean rate is kept.
        time.sleep(max(0.0, start + index * SAMPLING_TIME_S - time.monotonic()))
        sample = contract.classes["StateSample"](sequence=index + 1, boot_id=boot_id, applied_command_sequence=applied)
        sample.joint_count, sample.wrench_valid, sample.drives_enabled = len(JOINT_POSITION), 1, 1
        for joint, position in enumerate(JOINT_POSITION):
            sample.joint_position[joint] = sample.joint_position_reference[joint] = position
        sample.stamp_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        publisher.loan_uninit().write_payload(sample).send()
        notifier.notify()
        # The first samples may pass unanswered, while the connections are being made.
        patience = ANSWER_TIMEOUT_S if mode_names else SAMPLING_TIME_S
        answer = await_command(subscriber, listener, index + 1, time.monotonic() + patience)
        if answer is None:
            unanswered.append(index + 1)
            continue
        applied, name = answer.sequence, contract.enums["Mode"][answer.mode]
        mode_names += [name] if name not in mode_names else []
    print(json.dumps({"sent": SAMPLES, "unanswered": unanswered, "opened": theirs, "mode_names": mode_names}))
    del opened


if __name__ == "__main__":
    main(*sys.argv[1:])
