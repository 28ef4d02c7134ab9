#!/usr/bin/env python3
"""Golden wrenches for daemon/core/tests/core/wrench.rs.

    python3 wrench.py            write wrench.json beside this script
    python3 wrench.py --check    exit 1 unless wrench.json is exactly what this script writes

Needs nothing but Python 3.9 or later: 80-digit decimal arithmetic, with the rigid motions of kinematics.py beside it.

Independent of the Rust code in daemon/core/src/intake/wrench.rs, which rotates vectors and takes cross products: here every wrench follows
from virtual work. The tool is moved a little along each axis of the base frame through the TCP and turned a little about it;
what the sensor's forces and torques do in that motion, and what gravity does at the centre of gravity, is by definition the
component of the wrench at the TCP. The little motions are central differences (step 1e-25, error about 1e-50).

Conventions: SI units, rad. `tcp_rpy` is the orientation of the TCP in the base frame, `sensor_*` the pose of the sensor in the frame of the
TCP, fixed-axis roll, pitch, yaw. `given` is what the sensor gives when the robot, over the tool, exerts `wrench` on the environment (base
frame, at the TCP): with its bias, and with the reaction's sign where `reaction` is true.
"""

import pathlib
import random
import sys
from decimal import Decimal

from kinematics import STEP, exact, exponential, frame, pretty, product, to_float, twist

SEED = 20261121
CASES = 12


def unit(index):
    return [Decimal(int(index == other)) for other in range(3)]


def moved(tcp, axis, step):
    """The TCP's frame at the origin, moved along or turned about one axis of the base frame."""
    zero = [Decimal(0)] * 3
    small = [step * value for value in unit(axis % 3)]
    motion = twist(zero, small) if axis < 3 else twist(small, zero)
    return product(exponential(motion), tcp)


def work_of_sensor(tcp, sensor, axis):
    """Velocities of the sensor in its own axes for a motion of the TCP: its origin's, then its spin."""
    plus, minus = (product(moved(tcp, axis, step), sensor) for step in (STEP, -STEP))
    here = product(tcp, sensor)
    slope = [[(plus[i][j] - minus[i][j]) / (2 * STEP) for j in range(4)] for i in range(3)]
    linear = [sum(here[k][i] * slope[k][3] for k in range(3)) for i in range(3)]
    # R^T dR: the spin in the sensor's own axes.
    spin = [[sum(here[k][i] * slope[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return linear + [spin[2][1], spin[0][2], spin[1][0]]


def work_of_gravity(tcp, center, gravity_force, axis):
    """Work of the tool's weight in a motion of the TCP, per length or angle."""
    place = frame(center, [0.0, 0.0, 0.0])
    plus, minus = (product(moved(tcp, axis, step), place) for step in (STEP, -STEP))
    return sum(force * (plus[i][3] - minus[i][3]) / (2 * STEP) for i, force in enumerate(gravity_force))


def golden_case(source):
    def values(count, size):
        return [round(source.uniform(-size, size), 6) for _ in range(count)]

    case = {
        "tcp_rpy": values(3, 3.0),
        "sensor_origin": values(3, 0.3),
        "sensor_rpy": values(3, 3.0),
        "reaction": source.random() < 0.5,
        "bias": values(6, 8.0),
        "mass": round(source.uniform(0.2, 5.0), 6),
        "center_of_gravity": values(3, 0.2),
        "gravity": values(3, 9.81),
        "given": values(6, 60.0),
    }
    tcp = frame([0.0, 0.0, 0.0], case["tcp_rpy"])
    sensor = frame(case["sensor_origin"], case["sensor_rpy"])
    sign = -1 if case["reaction"] else 1
    loads = [sign * (given - bias) for given, bias in zip(exact(case["given"]), exact(case["bias"]))]
    weight = [Decimal(case["mass"]) * value for value in exact(case["gravity"])]
    wrench = []
    for axis in range(6):
        # What the robot does over the sensor and what gravity does, arrives at the environment.
        over_sensor = sum(load * rate for load, rate in zip(loads, work_of_sensor(tcp, sensor, axis)))
        wrench.append(to_float(over_sensor + work_of_gravity(tcp, case["center_of_gravity"], weight, axis)))
    return {**case, "wrench": wrench}


def golden():
    source = random.Random(SEED)
    return {"generated_by": "wrench.py", "seed": SEED, "cases": [golden_case(source) for _ in range(CASES)]}


def main(arguments):
    target = pathlib.Path(__file__).with_suffix(".json")
    if arguments not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 64
    text = pretty(golden()) + "\n"
    if not arguments:
        target.write_bytes(text.encode())
        return 0
    if not target.exists() or target.read_bytes() != text.encode():
        print(f"{target} is not what {pathlib.Path(__file__).name} computes: regenerate it", file=sys.stderr)
        return 1
    print(f"{target.name}: as computed")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
