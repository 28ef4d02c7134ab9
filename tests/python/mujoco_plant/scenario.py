"""A scenario of plant-sim, read from the same TOML file: as far as this plant knows what is in it."""

import tomllib

import numpy as np

NS = 1_000_000_000

# The keys that this plant acts upon, and those that do not matter to it. Any other is refused: a plant that left
# something out would judge another arm.
KNOWN = {
    "": "name ipc robot rigid_body timing start surface wrench noise motion realtime",
    "robot": "name task_axes velocity_time_constant_s joint tool",
    "robot.joint": "origin_m origin_rpy_rad axis",
    "robot.tool": "origin_m origin_rpy_rad",
    "rigid_body": "gravity_m_s2 joint drive",
    "rigid_body.joint": "mass_kg center_of_gravity_m inertia_kg_m2 rotor_inertia_kg_m2 gear_ratio gear_stiffness_n_m_rad "
    "gear_damping_n_m_s_rad viscous_friction_n_m_s_rad coulomb_friction_n_m breakaway_friction_n_m "
    "stribeck_velocity_rad_s slip_velocity_rad_s torque_limit_n_m speed_gain_n_m_s_rad encoder_counts",
    "rigid_body.drive": "rate_hz integral_time_s feed_forward_factor",
    "timing": "sampling_time_s command_delay_s settle_s substep_s",
    "start": "joint_position_rad",
    "surface": "point_m normal stiffness_n_m damping_n_s_m friction slip_velocity_m_s",
    "wrench": "time_constant_s",
    "noise": "wrench",
    "motion": "duration_s twist",
}


class UnknownKey(Exception):
    """The scenario has something that this plant does not know."""


def check(table, path=""):
    """Refuses what is not in KNOWN."""
    known = KNOWN[path].split()
    for key, value in table.items():
        if key not in known:
            raise UnknownKey(f"{path}.{key}".lstrip("."))
        inner = f"{path}.{key}".lstrip(".")
        if inner in KNOWN:
            for entry in value if isinstance(value, list) else [value]:
                check(entry, inner)


class Scenario:
    """What is in the file, in SI units and whole nanoseconds."""

    def __init__(self, path):
        with open(path, "rb") as file:
            table = tomllib.load(file)
        check(table)
        if table["noise"].get("wrench", 0.0) != 0.0:
            raise UnknownKey("noise.wrench above 0")
        self.robot = table["robot"]
        self.body = table["rigid_body"]
        self.surface = table.get("surface")
        self.start = np.array(table["start"]["joint_position_rad"])
        self.joints = len(self.start)
        self.time_constant_s = np.array(self.robot["velocity_time_constant_s"])
        self.wrench_time_constant_s = np.array(table["wrench"]["time_constant_s"])
        timing = table["timing"]
        self.sampling_ns = round(timing["sampling_time_s"] * NS)
        self.delay_ns = round(timing.get("command_delay_s", 0.0) * NS)
        # Samples at rest before the motion.
        self.waiting = round(timing.get("settle_s", 0.5) / timing["sampling_time_s"])
        self.phases, end = [], 0
        for phase in table["motion"]:
            end += round(phase["duration_s"] / timing["sampling_time_s"])
            self.phases.append((end, np.array(phase["twist"])))
        # Samples of the motion.
        self.samples = end

    def of_joints(self, key, default):
        """One value for each joint; the default where a joint has none."""
        return np.array([joint.get(key, default) for joint in self.body["joint"]], dtype=float)

    def twist(self, index):
        """The commanded velocity of the TCP from a sample to the next; zero before and after the motion."""
        phases = [twist for end, twist in self.phases if index < end] if index >= 0 else []
        return phases[0] if phases else np.zeros(self.robot["task_axes"])
