#!/usr/bin/env python3
"""Golden joint velocities for daemon/core/tests/core/redundancy.rs.

    python3 redundancy.py            write redundancy.json beside this script
    python3 redundancy.py --check    exit 1 unless redundancy.json is exactly what this script writes

Needs nothing but Python 3.9 or later: fractions of the standard library, and its decimals for roots, so that the result
is the same on every machine.

Independent of the Rust code in daemon/core/src/robot, in method and in arithmetic. That multiplies J by its scaled
transpose and inverts the product; here every joint velocity is the solution of its own least-squares problem, as one
system of linear equations with a multiplier for each direction, solved exactly:
- weighted: min q' W q subject to J q = t;
- damped: min |J q - t|^2 + lambda^2 q' W q, with W scaled to a least weight of 1;
- the null-space part of v: min (z - v)' W (z - v) subject to J z = 0.
"""

import json
import pathlib
import random
import sys
from decimal import Decimal, getcontext
from fractions import Fraction

getcontext().prec = 60
SEED = 20161213
# Joints and directions of the task; the axes, where not all six.
ARMS = [(7, 6, None), (8, 6, None), (6, 6, (0, 1, 2, 3, 5)), (4, 6, (0, 1)), (7, 6, (2,)), (2, 2, (1,))]
CASES = 4
# Part of the reciprocal condition number below which damping acts that a case is at.
NEAR = Fraction(1, 2)
FACTOR = Fraction(1, 8)


def solve(matrix, right):
    """Gauss's elimination, exactly; the matrix is regular."""
    rows = [list(row) + [value] for row, value in zip(matrix, right)]
    for column in range(len(rows)):
        pivot = next(row for row in range(column, len(rows)) if rows[row][column] != 0)
        rows[column], rows[pivot] = rows[pivot], rows[column]
        rows[column] = [value / rows[column][column] for value in rows[column]]
        for row in range(len(rows)):
            if row != column:
                factor = rows[row][column]
                rows[row] = [a - factor * b for a, b in zip(rows[row], rows[column])]
    return [row[-1] for row in rows]


def constrained(weights, jacobian, linear, right):
    """The q of least q' W q / 2 - linear' q subject to J q = right."""
    joints, axes = len(weights), len(jacobian)
    matrix = [[Fraction(0)] * (joints + axes) for _ in range(joints + axes)]
    for joint, weight in enumerate(weights):
        matrix[joint][joint] = weight
    for axis in range(axes):
        for joint in range(joints):
            matrix[joint][joints + axis] = matrix[joints + axis][joint] = jacobian[axis][joint]
    return solve(matrix, list(linear) + list(right))[:joints]


def damped(weights, jacobian, twist, square):
    joints = range(len(weights))
    matrix = [
        [sum(row[a] * row[b] for row in jacobian) + (square * weights[a] if a == b else 0) for b in joints] for a in joints
    ]
    return solve(matrix, [sum(row[a] * t for row, t in zip(jacobian, twist)) for a in joints])


def norm(rows):
    total = sum(value * value for row in rows for value in row)
    return (Decimal(total.numerator) / Decimal(total.denominator)).sqrt()


def fraction(value):
    """A number that a double holds exactly."""
    return Fraction(float(value))


def case(random_numbers, joints, axes):
    number = lambda: fraction(random_numbers.uniform(-1.0, 1.0))
    jacobian = [[number() for _ in range(joints)] for _ in axes]
    weights = [fraction(10.0 ** random_numbers.uniform(-2.0, 2.0)) for _ in range(joints)]
    twist, velocity = [number() for _ in axes], [number() for _ in range(joints)]
    relative = [weight / min(weights) for weight in weights]
    unit = lambda axis: [Fraction(int(axis == other)) for other in range(len(axes))]
    inverse = [constrained(weights, jacobian, [0] * joints, unit(axis)) for axis in range(len(axes))]
    reciprocal_condition = 1 / (norm(jacobian) * norm(inverse))
    # Where damping begins, as a double; how near the pose is follows from that.
    below = fraction(reciprocal_condition / Decimal(NEAR.numerator) * Decimal(NEAR.denominator))
    condition = Fraction(reciprocal_condition)
    square = FACTOR * FACTOR * (1 - (condition / below) ** 2)
    return {
        "jacobian": [[float(value) for value in row] for row in jacobian],
        "weights": [float(weight) for weight in weights],
        "twist": [float(value) for value in twist],
        "velocity": [float(value) for value in velocity],
        "damping_factor": float(FACTOR),
        "damping_below": float(below),
        "reciprocal_condition": float(reciprocal_condition),
        "weighted": [float(value) for value in constrained(weights, jacobian, [0] * joints, twist)],
        "damped": [float(value) for value in damped(relative, jacobian, twist, square)],
        "null": [
            float(value)
            for value in constrained(weights, jacobian, [w * v for w, v in zip(weights, velocity)], [0] * len(axes))
        ],
    }


def golden():
    random_numbers = random.Random(SEED)
    arms = []
    for joints, task_axes, axes in ARMS:
        axes = tuple(range(task_axes)) if axes is None else axes
        cases = [case(random_numbers, joints, axes) for _ in range(CASES)]
        arms.append({"joints": joints, "task_axes": task_axes, "axes": list(axes), "cases": cases})
    return json.dumps({"written_by": "redundancy.py", "arms": arms}, indent=1) + "\n"


def main():
    path = pathlib.Path(__file__).with_suffix(".json")
    if sys.argv[1:] == ["--check"]:
        if path.read_text(encoding="utf-8") != golden():
            sys.exit(f"{path} is not what {pathlib.Path(__file__).name} writes")
    elif sys.argv[1:]:
        sys.exit(f"{sys.argv[0]}: accepted: --check, or nothing")
    else:
        path.write_text(golden(), encoding="utf-8")


main()
