"""An arm with masses in MuJoCo, in the place of plant-sim: the daemon answers it over shared memory, in lock step.

    mujoco_plant SCENARIO.toml SCHEMA.json ROOT_PATH PREFIX INSTANCE CLOCK [DISABLE_AT_S]

CLOCK is the file of the daemon's clock (driven_clock.c), which this plant sets: no sample is late, however long the step
before it has taken. At DISABLE_AT_S of the motion a person disables control. Prints one JSON object per sample: what was
true, the state sample, and what the daemon answered.
"""

import json
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "ipc-types/python"))

import iceoryx2 as iox2
from foreign_client import CONNECT_TIMEOUT_S, Contract, MotionController, load_schema, make_node

from driven_clock import DrivenClock
from plant import Plant
from request import ask
from scenario import Scenario

# Of the arm in a tick of the drives, where plant-sim does one or two.
STEPS = 4
# The daemon takes microseconds; a busy machine may not.
ANSWER_TIMEOUT_S = 30.0


def code(contract, enum, name):
    """The code of a name."""
    return next(code for code, found in contract.enums[enum].items() if found == name)


def plain(value):
    """A field of a sample as JSON has it."""
    return list(value) if hasattr(value, "__len__") else value


def main(scenario_path, schema_path, root_path, prefix, instance, clock_path, disable_at_s="inf"):
    """The command line."""
    iox2.set_log_level(iox2.LogLevel.Error)
    contract = Contract(load_schema(schema_path))
    scenario = Scenario(scenario_path)
    node = make_node(root_path, prefix, "mujoco_plant")
    controller = MotionController(contract, node, instance)
    if not controller.wait_for_daemon(CONNECT_TIMEOUT_S):
        sys.exit("mujoco_plant: nobody subscribed to state samples")
    clock = DrivenClock(clock_path)
    plant = Plant(scenario, clock.now.value, STEPS, code(contract, "Motion", "Hold"))
    disable_at = round(float(disable_at_s) * 1e9 / scenario.sampling_ns) if disable_at_s != "inf" else None
    while not plant.is_finished():
        clock.set(plant.now_ns)
        if plant.index == disable_at:
            deadline_ns = plant.now_ns + scenario.sampling_ns
            ask(contract, node, instance, code(contract, "RequestKind", "Disable"), deadline_ns)
        sample = controller.next_sample(plant.arm.joint_position())
        plant.measure(sample)
        controller.publish(sample)
        command = controller.wait_for_answer(sample.sequence, time.monotonic() + ANSWER_TIMEOUT_S)
        if command is None:
            sys.exit(f"mujoco_plant: sample {sample.sequence} was not answered within {ANSWER_TIMEOUT_S} s")
        plant.playback.receive(command)
        truth = plant.truth()
        for key, enum in (("mode", "Mode"), ("stop_reason", "StopReason"), ("source", None), ("fallback_count", None)):
            value = getattr(command, key)
            truth[key] = contract.enum_name(enum, value) if enum else value
        truth["state"] = {name: plain(getattr(sample, name)) for name, *_ in sample._fields_}
        print(json.dumps(truth))
        plant.integrate()
    clock.release()


if __name__ == "__main__":
    main(*sys.argv[1:])
