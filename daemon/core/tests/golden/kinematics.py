#!/usr/bin/env python3
"""Golden poses and Jacobians for daemon/core/tests/core/kinematics.rs.

    python3 kinematics.py            write kinematics.json beside this script
    python3 kinematics.py --check    exit 1 unless kinematics.json is exactly what this script writes

Needs nothing but Python 3.9 or later: 80-digit decimal arithmetic from the standard library, so that the result is the
same on every machine.

Independent of the Rust code in daemon/core/src/robot, in method and in arithmetic:
- every rotation, fixed or turning, is the power series of a 4x4 twist matrix (a product of exponentials in the base
  frame); the Rust code multiplies frames built from sines and cosines, joint by joint;
- the Jacobian is the central difference of that pose (step 1e-25, error about 1e-50); the Rust code takes cross
  products of joint axes;
- no library for matrices, rotations or kinematics.

Conventions: SI units, rad; of a prismatic joint q is in m. A joint frame sits at `origin`, turned by fixed-axis roll, pitch, yaw `rpy`
(Rz(yaw) Ry(pitch) Rx(roll)) in its parent's frame, and turns about `axis`, or slides along it, which need not have unit length. Jacobian
rows: x y z rx ry rz of the tool centre point, in the base frame.
"""

import json
import math
import pathlib
import random
import sys
from decimal import Decimal, getcontext

getcontext().prec = 80
STEP = Decimal("1e-25")
SEED = 20161212
POSITIONS = 8
HALF_PI = math.pi / 2


def joint(origin, rpy, axis=(0.0, 0.0, 1.0), kind="revolute"):
    return {"origin": list(origin), "rpy": list(rpy), "axis": list(axis), "kind": kind}


ARMS = [
    {
        "name": "planar 2R, links 1 m and 1 m",
        "task_axes": 2,
        "joints": [joint((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), joint((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))],
        "tool": {"origin": [1.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0]},
        "singular": [
            {"why": "arm stretched", "q": [0.3, 0.0]},
            {"why": "arm stretched along x", "q": [0.0, 0.0]},
            {"why": "arm folded onto itself", "q": [-1.1, math.pi]},
        ],
    },
    {
        # Lengths of a UR10e. The second axis is long and negative on purpose: only its direction
        # counts.
        "name": "six joints, UR10e-like, offset tool",
        "task_axes": 6,
        "joints": [
            joint((0.0, 0.0, 0.1807), (0.0, 0.0, 0.0)),
            joint((0.0, 0.0, 0.0), (-HALF_PI, 0.0, 0.0), (0.0, 0.0, -2.5)),
            joint((-0.6127, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
            joint((-0.57155, 0.0, -0.17415), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
            joint((0.0, 0.11985, 0.0), (-HALF_PI, 0.0, 0.0)),
            joint((0.0, 0.11655, 0.0), (HALF_PI, math.pi, math.pi)),
        ],
        "tool": {"origin": [0.012, -0.034, 0.185], "rpy": [0.3, -0.2, 0.7]},
        "singular": [
            {"why": "elbow stretched", "q": [0.4, -1.2, 0.0, 0.8, 1.1, -0.6]},
        ],
    },
    {
        # Lengths of a KUKA LBR iiwa 14.
        "name": "seven joints, iiwa-like",
        "task_axes": 6,
        "joints": [
            joint((0.0, 0.0, 0.1575), (0.0, 0.0, 0.0)),
            joint((0.0, 0.0, 0.2025), (HALF_PI, 0.0, math.pi)),
            joint((0.0, 0.2045, 0.0), (HALF_PI, 0.0, math.pi)),
            joint((0.0, 0.0, 0.2155), (HALF_PI, 0.0, 0.0)),
            joint((0.0, 0.1845, 0.0), (-HALF_PI, math.pi, 0.0)),
            joint((0.0, 0.0, 0.2155), (HALF_PI, 0.0, 0.0)),
            joint((0.0, 0.081, 0.0), (-HALF_PI, math.pi, 0.0)),
        ],
        "tool": {"origin": [0.02, 0.01, 0.145], "rpy": [0.0, 0.1, -0.4]},
        "singular": [
            {"why": "arm stretched", "q": [0.2, 0.7, -0.3, 0.0, 0.5, 0.9, 0.1]},
        ],
    },
    {
        # Its base is tilted and its quill leans, as no SCARA's does: every entry counts.
        "name": "SCARA, four joints, the third prismatic",
        "task_axes": 3,
        "joints": [
            joint((0.0, 0.0, 0.32), (0.05, -0.1, 0.2)),
            joint((0.325, 0.0, 0.0), (0.0, 0.0, 0.0)),
            joint((0.275, 0.0, 0.04), (0.1, 0.2, 0.0), (0.0, 0.0, -2.0), "prismatic"),
            joint((0.0, 0.01, 0.0), (math.pi, 0.0, 0.0)),
        ],
        "tool": {"origin": [0.03, 0.0, 0.1], "rpy": [0.0, 0.1, 0.3]},
        "singular": [],
    },
]
# The seven joints on a linear axis that leans.
ARMS.append(
    {
        "name": "eight joints, the first prismatic",
        "task_axes": 6,
        "joints": [joint((0.1, -0.2, 0.3), (0.2, 0.1, -0.3), (0.0, 1.0, 0.0), "prismatic")] + ARMS[2]["joints"],
        "tool": ARMS[2]["tool"],
        "singular": [],
    }
)
# Lengths of a KUKA youBot's arm, each axis a little off its drawing.
ARMS.append(
    {
        "name": "five joints, youBot-like",
        "task_axes": 3,
        "joints": [
            joint((0.024, 0.0, 0.115), (0.0, 0.0, 0.1)),
            joint((0.033, 0.0, 0.032), (0.01, 0.0, 0.0), (0.0, 1.0, 0.0)),
            joint((0.0, 0.002, 0.155), (0.0, 0.02, 0.0), (0.0, 1.0, 0.0)),
            joint((0.0, 0.0, 0.135), (0.0, 0.0, -0.02), (0.0, -2.0, 0.0)),
            joint((0.0, 0.0, 0.11316), (0.0, 0.0, 0.0)),
        ],
        "tool": {"origin": [0.01, 0.0, 0.104], "rpy": [0.1, -0.2, 0.4]},
        "singular": [],
    }
)


def exact(values):
    """The exact value of each float: what the Rust test reads is what is computed with here."""
    return [Decimal(value) for value in values]


def identity():
    return [[Decimal(int(row == column)) for column in range(4)] for row in range(4)]


def product(left, right):
    return [[sum(left[i][k] * right[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def twist(angular, linear):
    """se(3): [angular]x and linear as a 4x4 matrix."""
    x, y, z = angular
    zero = Decimal(0)
    return [[zero, -z, y, linear[0]], [z, zero, -x, linear[1]], [-y, x, zero, linear[2]], [zero] * 4]


def exponential(matrix):
    """The power series of exp(matrix), to the last digit of the working precision."""
    total, term, order = identity(), identity(), 0
    while max(abs(value) for row in term for value in row) > Decimal("1e-85"):
        order += 1
        term = [[value / order for value in row] for row in product(term, matrix)]
        total = [[total[i][j] + term[i][j] for j in range(4)] for i in range(4)]
    return total


def turn(vector):
    """Rotation by a rotation vector (Decimal), as a homogeneous transform."""
    return exponential(twist(vector, [Decimal(0)] * 3))


def frame(origin, rpy):
    roll, pitch, yaw = exact(rpy)
    zero = Decimal(0)
    rotation = product(product(turn([zero, zero, yaw]), turn([zero, pitch, zero])), turn([roll, zero, zero]))
    for row, value in enumerate(exact(origin)):
        rotation[row][3] = value
    return rotation


def screws(arm):
    """Each joint's twist in the base frame at q = 0, and the pose of the tool there."""
    here, result = identity(), []
    for item in arm["joints"]:
        here = product(here, frame(item["origin"], item["rpy"]))
        axis = exact(item["axis"])
        length = sum(value * value for value in axis).sqrt()
        w = [sum(here[i][k] * axis[k] for k in range(3)) / length for i in range(3)]
        if item["kind"] == "prismatic":
            result.append(twist([Decimal(0)] * 3, w))
            continue
        p = [here[i][3] for i in range(3)]
        moment = [p[1] * w[2] - p[2] * w[1], p[2] * w[0] - p[0] * w[2], p[0] * w[1] - p[1] * w[0]]
        result.append(twist(w, moment))
    return result, product(here, frame(arm["tool"]["origin"], arm["tool"]["rpy"]))


def joint_motion(screw, angle):
    return exponential([[value * angle for value in row] for row in screw])


def chained(motions, home):
    total = identity()
    for motion in motions:
        total = product(total, motion)
    return product(total, home)


def jacobian_column(plus, here, minus):
    """Central difference: velocity of the tool centre point, then the vector of the skew matrix dR/dq R^T."""
    slope = [[(plus[i][j] - minus[i][j]) / (2 * STEP) for j in range(4)] for i in range(3)]
    spin = [[sum(slope[i][k] * here[j][k] for k in range(3)) for j in range(3)] for i in range(3)]
    return [slope[0][3], slope[1][3], slope[2][3], spin[2][1], spin[0][2], spin[1][0]]


def to_float(value):
    """The nearest float; what is zero but for the difference quotient's error is written as zero."""
    return float(value) if abs(value) > Decimal("1e-40") else 0.0


def rotation_of(pose):
    return [[to_float(pose[i][j]) for j in range(3)] for i in range(3)]


def golden_pose(arm, q):
    twists, home = screws(arm)
    angles = exact(q)
    motions = [joint_motion(screw, angle) for screw, angle in zip(twists, angles)]
    here = chained(motions, home)
    columns = []
    for index, (screw, angle) in enumerate(zip(twists, angles)):
        moved = [
            chained(motions[:index] + [joint_motion(screw, angle + step)] + motions[index + 1 :], home)
            for step in (STEP, -STEP)
        ]
        columns.append(jacobian_column(moved[0], here, moved[1]))
    return {
        "q": q,
        "position": [to_float(here[i][3]) for i in range(3)],
        "rotation": rotation_of(here),
        "jacobian": [[to_float(column[row]) for column in columns] for row in range(6)],
    }


def golden_difference(reference_rpy, axis, angle):
    """A pose turned by `angle` about `axis` (in the base frame) from its reference, and the shorter way back to that."""
    direction = exact(axis)
    length = sum(value * value for value in direction).sqrt()
    vector = exact([float(value / length * Decimal(angle)) for value in direction])
    size = sum(value * value for value in vector).sqrt()
    pi = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803")
    shorter = [value * (1 - 2 * pi / size) for value in vector] if size > pi else vector
    reference = frame([0.0, 0.0, 0.0], reference_rpy)
    turned = product(turn(vector), reference)
    return {
        "angle": angle,
        "reference": rotation_of(reference),
        "turned": rotation_of(turned),
        "rotation_vector": [float(value) for value in shorter],
    }


def golden():
    source = random.Random(SEED)
    arms = []
    for arm in ARMS:
        positions = [
            [round(source.uniform(-2.8, 2.8), 6) for _ in arm["joints"]] for _ in range(POSITIONS)
        ]
        arms.append({**arm, "poses": [golden_pose(arm, q) for q in positions]})
    angles = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.4, 2.2]
    angles += [math.pi - gap for gap in (1e-2, 1e-5, 1e-9)] + [math.pi + gap for gap in (1e-9, 1e-5, 1e-2)]
    differences = []
    for rpy in ([0.0, 0.0, 0.0], [0.8, -0.5, 2.1]):
        for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.3, -0.7, 0.5]):
            differences += [golden_difference(rpy, axis, angle) for angle in angles]
    return {"generated_by": "kinematics.py", "seed": SEED, "arms": arms, "differences": differences}


def pretty(value, indent=0):
    """JSON with one line per array of numbers, so that a change can be read in a diff."""
    pad = " " * (indent + 1)
    if isinstance(value, dict):
        items = [f"{pad}{json.dumps(key)}: {pretty(item, indent + 1)}" for key, item in value.items()]
        return "{\n" + ",\n".join(items) + "\n" + pad[1:] + "}"
    if isinstance(value, list) and any(isinstance(item, (list, dict)) for item in value):
        return "[\n" + ",\n".join(pad + pretty(item, indent + 1) for item in value) + "\n" + pad[1:] + "]"
    return json.dumps(value)


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
