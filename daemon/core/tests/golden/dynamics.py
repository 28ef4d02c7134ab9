#!/usr/bin/env python3
"""Golden dynamics for daemon/core/tests/core/dynamics.rs, by Pinocchio.

    python3 dynamics.py            write dynamics.json beside this script
    python3 dynamics.py --check    exit 1 unless dynamics.json says what this script computes

Needs the package pin, version 4.1.0 (numpy comes with it). What the cases are must be in the file to the last bit; what
Pinocchio answers may differ by 1e-12 of the largest entry, since its builds add up in different orders.

The arms are those of kinematics.py beside it, with invented masses: links like rods or boxes whose principal axes are
those of no frame, and rotors behind gears.

Conventions: SI units, rad; of prismatic joints m and N. `inertia` is about the centre of gravity, along the axes of the link's frame; `reflected` is
a rotor's inertia times its gear ratio squared (kg of a prismatic joint); `wrench` is what the robot exerts on the environment at the tool centre
point, in the base frame, so that Pinocchio's external force is its reaction. `torque` answers `acceleration` with the
wrench, `forward` is the acceleration that `drive` brings about with the wrench. `momentum` is M q̇, `carried` is Cᵀ q̇ with the C of
Christoffel's symbols, `link_weights` has a row for each link that weighs alone. The kinetic energy is that of the links
as Pinocchio moves them, and of the rotors: its own sum leaves the rotors out, but for those of prismatic joints.
"""

import json
import pathlib
import random
import sys

import numpy as np
import pinocchio as pin

from kinematics import ARMS, pretty

SEED = 20261124
CASES = 6
VERSION = "4.1.0"
AGREEMENT = 1e-12
GRAVITY = {
    2: [0.3, -9.81, 0.2], 6: [0.0, 0.0, -9.81], 7: [0.5, -1.5, -9.6], 4: [0.2, 0.4, -9.7], 8: [0.0, -0.6, -9.8],
    5: [-0.4, 0.1, -9.8],
}
# kg, and a size of each link in m from which its box of inertia is made.
MASSES = {
    2: [12.0, 7.0],
    6: [7.4, 13.1, 4.0, 2.1, 2.0, 1.6],
    7: [4.1, 4.0, 3.0, 2.7, 1.7, 1.8, 1.2],
    4: [6.0, 4.5, 1.5, 0.8],
    8: [45.0, 4.1, 4.0, 3.0, 2.7, 1.7, 1.8, 1.2],
    5: [1.4, 1.3, 0.8, 0.8, 0.9],
}
REFLECTED = {
    2: [0.0, 0.8],
    6: [2.1, 2.1, 0.9, 0.25, 0.25, 0.2],
    7: [1.3, 1.3, 0.8, 0.8, 0.5, 0.2, 0.2],
    4: [1.2, 0.7, 30.0, 0.1],
    8: [80.0, 1.3, 1.3, 0.8, 0.8, 0.5, 0.2, 0.2],
    5: [0.3, 0.3, 0.14, 0.07, 0.02],
}


def link(source, mass):
    """A box of even density, turned at random."""
    sides = [source.uniform(0.05, 0.6) for _ in range(3)]
    squares = [side * side for side in sides]
    moments = np.diag([mass / 12 * (sum(squares) - square) for square in squares])
    turn = pin.rpy.rpyToMatrix(*(source.uniform(-3.0, 3.0) for _ in range(3)))
    tensor = turn @ moments @ turn.T
    tensor = (tensor + tensor.T) / 2
    return {
        "mass": mass,
        "center_of_gravity": [round(source.uniform(-0.3, 0.3), 6) for _ in range(3)],
        "inertia": [[round(value, 9) for value in row] for row in tensor.tolist()],
    }


def placed(item):
    return pin.SE3(pin.rpy.rpyToMatrix(*item["rpy"]), np.array(item["origin"]))


def model_of(arm, weighs=lambda link: True):
    model = pin.Model()
    parent = 0
    for index, (item, body) in enumerate(zip(arm["joints"], arm["links"])):
        axis = np.array(item["axis"])
        kind = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}[item["kind"]]
        joint = kind(axis / np.linalg.norm(axis))
        parent = model.addJoint(parent, joint, placed(item), f"joint {index}")
        inertia = pin.Inertia(body["mass"], np.array(body["center_of_gravity"]), np.array(body["inertia"]))
        if weighs(index):
            model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.armature = np.array(arm["reflected"])
    model.gravity = pin.Motion(np.array(arm["gravity"]), np.zeros(3))
    tool = model.addFrame(pin.Frame("tool", parent, placed(arm["tool"]), pin.FrameType.OP_FRAME))
    return model, tool


def reaction(model, data, tool, q, wrench):
    """What the environment exerts on the last joint's body, in that body's frame."""
    pin.framesForwardKinematics(model, data, q)
    last = len(data.oMi) - 1
    at_tool = pin.SE3(np.eye(3), data.oMf[tool].translation)
    exerted = pin.Force(-np.array(wrench[:3]), -np.array(wrench[3:]))
    forces = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    forces[last] = data.oMi[last].actInv(at_tool.act(exerted))
    return forces


def weight_of(arm, link, q):
    """What holds an arm of which only one link weighs anything."""
    model, _ = model_of(arm, lambda other: other == link)
    return pin.computeGeneralizedGravity(model, model.createData(), q)


def case(source, arm):
    model, tool = model_of(arm)
    data = model.createData()
    joints = len(arm["joints"])

    def draw(size, count=joints):
        return [round(source.uniform(-size, size), 6) for _ in range(count)]

    given = {
        "q": draw(3.0),
        "velocity": draw(3.0),
        "acceleration": draw(20.0),
        "drive": draw(150.0),
        "wrench": draw(200.0, 3) + draw(30.0, 3),
    }
    q, v, a, drive = (np.array(given[key]) for key in ("q", "velocity", "acceleration", "drive"))
    forces = reaction(model, data, tool, q, given["wrench"])
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    pin.forwardKinematics(model, data, q, v)
    bodies = zip(data.v[1:], model.inertias[1:])
    moving = 0.5 * float(sum(body.np @ inertia.matrix() @ body.np for body, inertia in bodies))
    rotors = 0.5 * float(np.array(arm["reflected"]) @ (v * v))
    return given, {
        "torque": pin.rnea(model, data, q, v, a, forces).tolist(),
        "mass_matrix": mass.tolist(),
        "bias": pin.nonLinearEffects(model, data, q, v).tolist(),
        "gravity": pin.computeGeneralizedGravity(model, data, q).tolist(),
        "momentum": (mass @ v).tolist(),
        "carried": (pin.computeCoriolisMatrix(model, data, q, v).T @ v).tolist(),
        "link_weights": [weight_of(arm, link, q).tolist() for link in range(joints)],
        "forward": pin.aba(model, data, q, v, drive, forces).tolist(),
        "kinetic_energy": [moving + rotors],
        "potential_energy": [pin.computePotentialEnergy(model, data, q)],
    }


def golden():
    source = random.Random(SEED)
    arms = []
    for geometry in ARMS:
        count = len(geometry["joints"])
        arm = {key: geometry[key] for key in ("name", "joints", "tool")}
        arm["links"] = [link(source, mass) for mass in MASSES[count]]
        arm |= {"reflected": REFLECTED[count], "gravity": GRAVITY[count]}
        cases = [case(source, arm) for _ in range(CASES)]
        arm["cases"] = [{"given": given, "answers": answers} for given, answers in cases]
        arms.append(arm)
    return {"generated_by": f"dynamics.py with Pinocchio {VERSION}", "seed": SEED, "arms": arms}


def agree(found, expected, agreement, is_answer=False):
    if isinstance(expected, dict):
        keys = found.keys() == expected.keys() if isinstance(found, dict) else False
        return keys and all(agree(found[key], expected[key], agreement, is_answer or key == "answers") for key in expected)
    if is_answer and isinstance(expected, list):
        found, expected = np.array(found), np.array(expected)
        return found.shape == expected.shape and bool(
            np.all(np.abs(found - expected) <= agreement * np.max(np.abs(expected)))
        )
    if isinstance(expected, list):
        same = isinstance(found, list) and len(found) == len(expected)
        return same and all(agree(one, other, agreement, is_answer) for one, other in zip(found, expected))
    return found == expected


def main(arguments, golden=golden, script=pathlib.Path(__file__), agreement=AGREEMENT):
    target = script.with_suffix(".json")
    if arguments not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 64
    if pin.__version__ != VERSION:
        print(f"Pinocchio is {pin.__version__}; accepted is {VERSION}: pip install pin=={VERSION}", file=sys.stderr)
        return 69
    computed = golden()
    if not arguments:
        target.write_bytes((pretty(computed) + "\n").encode())
        return 0
    if not target.exists() or not agree(json.loads(target.read_text()), computed, agreement):
        print(f"{target} is not what {script.name} computes: regenerate it", file=sys.stderr)
        return 1
    print(f"{target.name}: as computed by Pinocchio {VERSION}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
