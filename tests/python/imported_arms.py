#!/usr/bin/env python3
"""What Pinocchio computes of the arms in example-robot-data, for tests/tests/imported_arms.rs.

    python3 imported_arms.py POSES    print JSON: each arm with its URDF and links, and so many poses

Needs the packages pin and example-robot-data. A pose is what the arm does between its base and its tip while every other
joint is at zero: position and orientation of the tip, its Jacobian (linear rows first) and the torques that hold the arm,
all in the base link's frame. Besides, what each joint may do at most. SI units, rad; of joints that slide m and N.
"""

import importlib.metadata
import json
import pathlib
import random
import sys

import numpy as np
import pinocchio as pin

SEED = 20261124
# URDF, base link, tip link.
ARMS = [
    ("ur_description/urdf/ur3_robot.urdf", "base_link", "tool0"),
    ("ur_description/urdf/ur5_robot.urdf", "base_link", "tool0"),
    ("ur_description/urdf/ur10_robot.urdf", "world", "ee_link"),
    ("panda_description/urdf/panda.urdf", "panda_link0", "panda_hand_tcp"),
    ("xarm_description/urdf/xarm7.urdf", "link_base", "link_eef"),
    ("kinova_description/robots/kinova.urdf", "base", "j2s6s200_end_effector"),
    ("z1_description/urdf/z1.urdf", "link00", "gripperStator"),
    ("tiago_description/robots/tiago.urdf", "torso_lift_link", "arm_tool_link"),
    # With the torso, which slides.
    ("tiago_description/robots/tiago.urdf", "torso_fixed_link", "arm_tool_link"),
]


def robots():
    files = importlib.metadata.files("example-robot-data")
    path = next(file for file in files if file.parts[-2:] == ("urdf", "z1.urdf"))
    return pathlib.Path(path.locate()).resolve().parents[2]


def joints_between(model, base, tip):
    """Indices of the joints that move the tip and not the base."""
    def above(frame):
        joint = model.frames[model.getFrameId(frame, pin.FrameType.BODY)].parentJoint
        while joint != 0:
            yield joint
            joint = model.parents[joint]

    fixed = set(above(base))
    return sorted(joint for joint in above(tip) if joint not in fixed)


def arm_between(model, base, tip):
    joints = joints_between(model, base, tip)
    locked = [joint for joint in range(1, model.njoints) if joint not in joints]
    return pin.buildReducedModel(model, locked, pin.neutral(model))


def limits(model):
    """Of each joint: lower and upper position (none of a joint that turns without end), speed, effort."""
    for joint in model.joints[1:]:
        ends = [limit[joint.idx_q] for limit in (model.lowerPositionLimit, model.upperPositionLimit)]
        yield {
            "position": [float(end) for end in ends] if joint.nq == 1 else None,
            "speed": float(model.velocityLimit[joint.idx_v]),
            "effort": float(model.effortLimit[joint.idx_v]),
        }


def poses(source, model, base, tip, count):
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    base_frame, tip_frame = (model.getFrameId(link, pin.FrameType.BODY) for link in (base, tip))
    in_world = data.oMf[base_frame].copy()
    turn = in_world.rotation.T
    for _ in range(count):
        angles = [source.uniform(-3.1, 3.1) for _ in range(model.nv)]
        q = np.zeros(model.nq)
        for joint, angle in zip(model.joints[1:], angles):
            # A joint without limits is a point on the unit circle.
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
        jacobian = pin.computeFrameJacobian(model, data, q, tip_frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        torque = pin.computeGeneralizedGravity(model, data, q)
        pin.framesForwardKinematics(model, data, q)
        at = in_world.actInv(data.oMf[tip_frame])
        yield {
            "q": angles,
            "position": at.translation.tolist(),
            "rotation": at.rotation.tolist(),
            "jacobian": np.vstack([turn @ jacobian[:3], turn @ jacobian[3:]]).tolist(),
            "gravity_torque": torque.tolist(),
        }


def main():
    source, count, arms = random.Random(SEED), int(sys.argv[1]), []
    for name, base, tip in ARMS:
        urdf = robots() / name
        model = pin.buildModelFromUrdf(str(urdf))
        gravity = model.gravity.linear
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.neutral(model))
        turn = data.oMf[model.getFrameId(base, pin.FrameType.BODY)].rotation.T
        arm = arm_between(model, base, tip)
        arms.append({
            "urdf": str(urdf),
            "base": base,
            "tip": tip,
            "gravity": (turn @ gravity).tolist(),
            "limits": list(limits(arm)),
            "poses": list(poses(source, arm, base, tip, count)),
        })
    json.dump(arms, sys.stdout)


main()
