"""An arm with masses in MuJoCo, in the place of plant-sim: the daemon answers it over shared memory, in lock step.

    mujoco_plant SCENARIO.toml CLOCK --root-path PATH --prefix PREFIX --instance NAME [--disable-at-s S --program FILE
        --config FILE --preload FILE]

CLOCK is the file of the daemon's clock (driven_clock.c), which this plant sets: no sample is late, however long the step
before it has taken. At S of the motion a person disables control, by the program, which runs by the same clock when FILE is
preloaded. Prints one JSON object per sample: what was true, the state sample, and what the daemon answered.
"""

import argparse
import json
import math
import os
import sys
import time

import admittance

from driven_clock import DrivenClock
from plant import Plant
from scenario import Scenario

# Of the arm in a tick of the drives, where plant-sim does one or two.
STEPS = 4
# The daemon takes microseconds; a busy machine may not.
ANSWER_TIMEOUT_S = 30.0
# Between two looks for an answer.
LOOK_S = 50e-6


def plain(value):
    """A field of a sample as JSON has it."""
    return list(value) if hasattr(value, "__len__") else value


def wait_for_answer(client, sample):
    """The command that answers a state sample."""
    end = time.monotonic() + ANSWER_TIMEOUT_S
    while time.monotonic() < end:
        if client.receive(sample.stamp_ns):
            command = client.newest()
            if command.state_sequence == sample.sequence:
                return command
        else:
            time.sleep(LOOK_S)
    sys.exit(f"mujoco_plant: sample {sample.sequence} was not answered within {ANSWER_TIMEOUT_S} s")


def disable(given):
    """As a person does: the program runs by the daemon's clock, or what it asks would be overdue."""
    os.environ.update(LD_PRELOAD=given.preload, DRIVEN_CLOCK=given.clock)
    place = ("--instance", given.instance, "--root-path", given.root_path, "--prefix", given.prefix)
    admittance.request("disable", *place, config=given.config, program=given.program)


def main(given):
    """Runs the scenario to the end of its motion."""
    scenario = Scenario(given.scenario)
    modes, reasons = admittance.codes("Mode"), admittance.codes("StopReason")
    with admittance.Client(
        root_path=given.root_path,
        prefix=given.prefix,
        instance=given.instance,
        joint_count=scenario.joints,
        sampling_time_s=scenario.sampling_ns / 1e9,
        command_delay_s=scenario.delay_ns / 1e9,
        velocity_offset_limit=[math.inf] * 6,
        joint_velocity_offset_limit=[math.inf] * scenario.joints,
        name="mujoco_plant",
    ) as client:
        clock = DrivenClock(given.clock)
        plant = Plant(scenario, clock.now.value, STEPS, client)
        while not plant.is_finished():
            clock.set(plant.now_ns)
            if given.disable_at_s is not None and plant.index == round(given.disable_at_s * 1e9 / scenario.sampling_ns):
                disable(given)
            sample = client.begin(plant.now_ns)
            plant.measure(sample)
            client.publish(sample)
            command = wait_for_answer(client, sample)
            plant.playback.receive(command)
            truth = plant.truth()
            truth["mode"], truth["stop_reason"] = modes[command.mode], reasons[command.stop_reason]
            truth["source"], truth["fallback_count"] = command.source, command.fallback_count
            truth["state"] = {name: plain(getattr(sample, name)) for name, *_ in sample._fields_}
            print(json.dumps(truth))
            plant.integrate()
        clock.release()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="mujoco_plant")
    parser.add_argument("scenario")
    parser.add_argument("clock")
    for name in ("--root-path", "--prefix", "--instance"):
        parser.add_argument(name, required=True)
    for name in ("--program", "--config", "--preload"):
        parser.add_argument(name)
    parser.add_argument("--disable-at-s", type=float)
    main(parser.parse_args())
