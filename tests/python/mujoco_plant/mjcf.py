"""The arm of a scenario as a model of MuJoCo's."""

import mujoco
import numpy as np


def text(values):
    """Numbers as an attribute, without a digit lost."""
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))


def orientation(rpy):
    """The quaternion of fixed-axis roll, pitch, yaw, as an attribute."""
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, np.array(rpy, dtype=float), "XYZ")
    return text(quaternion)


def reflected_inertia(scenario):
    """Inertia of the rotors on the joints' side of the gears, kg m²."""
    return scenario.of_joints("rotor_inertia_kg_m2", 0.0) * scenario.of_joints("gear_ratio", 1.0) ** 2


def link(scenario, index, armature, inner):
    """The body that a joint moves, with what it carries."""
    place, body = scenario.robot["joint"][index], scenario.body["joint"][index]
    return (
        f'<body pos="{text(place["origin_m"])}" quat="{orientation(place.get("origin_rpy_rad", [0.0] * 3))}">'
        f'<joint axis="{text(place.get("axis", [0.0, 0.0, 1.0]))}" armature="{text(armature[index])}"/>'
        f'<inertial mass="{text(body["mass_kg"])}" pos="{text(body["center_of_gravity_m"])}" '
        f'fullinertia="{text(body["inertia_kg_m2"])}"/>{inner}</body>'
    )


def rotor(inertia, index):
    """A rotor behind a gear that gives, on the joint's side of it: it turns by itself, and weighs nothing."""
    return (
        f'<body name="rotor{index}" gravcomp="1"><joint name="rotor{index}" axis="0 0 1"/>'
        f'<inertial mass="1" pos="0 0 0" diaginertia="{text([inertia[index]] * 3)}"/></body>'
    )


def build(scenario, timestep_s, gears_give):
    """The arm, its tool's site and its rotors: behind the gears that give, or all on their joints, as the drives think of
    it."""
    inertia = reflected_inertia(scenario)
    stiffness = scenario.of_joints("gear_stiffness_n_m_rad", 0.0)
    damping = scenario.of_joints("gear_damping_n_m_s_rad", 0.0)
    giving = [joint for joint in range(scenario.joints) if gears_give and stiffness[joint] > 0.0]
    armature = [0.0 if joint in giving else inertia[joint] for joint in range(scenario.joints)]
    tool = scenario.robot["tool"]
    inner = (
        f'<site name="tcp" pos="{text(tool.get("origin_m", [0.0] * 3))}" '
        f'quat="{orientation(tool.get("origin_rpy_rad", [0.0] * 3))}"/>'
    )
    for index in reversed(range(scenario.joints)):
        inner = link(scenario, index, armature, inner)
        inner = inner.replace("<joint axis", f'<joint name="joint{index}" axis', 1)
    rotors = "".join(rotor(inertia, joint) for joint in giving)
    gears = "".join(
        f'<fixed stiffness="{text(stiffness[joint])}" damping="{text(damping[joint])}" springlength="0">'
        f'<joint joint="rotor{joint}" coef="1"/><joint joint="joint{joint}" coef="-1"/></fixed>'
        for joint in giving
    )
    gravity = scenario.body.get("gravity_m_s2", [0.0, 0.0, -9.81])
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{text(timestep_s)}" gravity="{text(gravity)}" '
        f'integrator="implicitfast"><flag constraint="disable"/></option>'
        f"<worldbody>{inner}{rotors}</worldbody><tendon>{gears}</tendon></mujoco>"
    )
