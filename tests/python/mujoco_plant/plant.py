"""The plant from sample to sample: commands, drives, arm and wrench estimate. It has no clock."""

import admittance
import mujoco
import numpy as np

from arm import Arm
from drives import Drives
from playback import Playback


class Disagreement(Exception):
    """The client and this plant's own reading of the rules differ."""


class Plant:
    """At its first sample. `steps` of the arm make a tick of its drives; `client` says what its joints are to follow."""

    def __init__(self, scenario, first_ns, steps, client):
        self.scenario = scenario
        self.client = client
        self.axes = scenario.robot["task_axes"]
        self.drives = Drives(scenario, scenario.start)
        if scenario.sampling_ns % self.drives.period_ns != 0:
            raise ValueError("a cycle is no whole number of the drives' ticks")
        self.steps = steps
        step_s = self.drives.period_s / steps
        self.arm = Arm(scenario, step_s, self.drives.start)
        # A frame of its own for the commanded positions.
        self.frame = mujoco.MjData(self.arm.model)
        hold = next(code for code, name in admittance.codes("Motion").items() if name == "Hold")
        self.playback = Playback(scenario.delay_ns, self.axes, hold)
        self.now_ns = first_ns
        self.index = -scenario.waiting
        self.position_reference = scenario.start.copy()
        self.estimate, self.pressing = np.zeros(self.axes), np.zeros(self.axes)
        tau = scenario.wrench_time_constant_s
        self.estimate_share = np.where(tau > 0.0, 1.0 - np.exp(-step_s / np.where(tau > 0.0, tau, 1.0)), 1.0)
        self.torque = self.drives.holding
        self.peak = self.arm.normal_force

    def measure(self, sample):
        """What the sensors show, into a state sample that the client has begun."""
        if sample.applied_command_sequence != self.playback.applied_sequence():
            raise Disagreement(f"{sample.applied_command_sequence} is in force, not {self.playback.applied_sequence()}")
        sample.wrench_valid = sample.drives_enabled = sample.torque_valid = 1
        for field, values in (
            (sample.joint_position, self.drives.quantised(self.arm.motor_position())),
            (sample.joint_velocity, self.drives.velocity),
            (sample.joint_position_reference, self.position_reference),
            (sample.twist_reference, self.scenario.twist(self.index)),
            (sample.wrench, self.estimate),
            (sample.joint_torque, self.torque),
        ):
            field[: len(values)] = values.tolist()

    def truth(self):
        """What is true at the instant of a sample; the peak is that since the last one."""
        truth = {
            "scenario_time_s": self.index * self.scenario.sampling_ns / 1e9,
            "tcp_position": self.arm.position().tolist(),
            "joint_position": self.arm.joint_position().tolist(),
            "normal_force_n": self.arm.normal_force,
            "force": list(self.arm.force),
            "peak_normal_force_n": self.peak,
        }
        self.peak = self.arm.normal_force
        return truth

    def is_finished(self):
        """Whether the motion is over: its last sample is behind."""
        return self.index > self.scenario.samples

    def integrate(self):
        """Goes on to the next sample."""
        twist = self.scenario.twist(self.index)
        acting = None
        for _ in range(self.scenario.sampling_ns // self.drives.period_ns):
            step, offset = self.told()
            if acting != (self.playback.applied_sequence(), step):
                acting = (self.playback.applied_sequence(), step)
                reference = self.reference(twist, offset)
            self.torque = self.drives.tick(self.arm.motor_position(), reference)
            for _ in range(self.steps):
                self.arm.step(self.torque)
                self.look()
            self.now_ns += self.drives.period_ns
        self.told()
        self.position_reference = self.advanced(self.position_reference, twist, self.scenario.sampling_ns / 1e9)
        self.index += 1

    def look(self):
        """Follows the contact over a step: its peak, and the lag of the wrench estimate."""
        self.peak = max(self.peak, self.arm.normal_force)
        pressing = np.zeros(self.axes)
        pressing[:3] = self.arm.force[: self.axes]
        self.estimate += (0.5 * (pressing + self.pressing) - self.estimate) * self.estimate_share
        self.pressing = pressing

    def told(self):
        """The step of the plan in force, and what the joints are to follow: None when they hold, else the velocity offset in
        m/s and rad/s."""
        instruction = self.client.apply(self.now_ns)
        told = None if instruction.hold else instruction.velocity_offset[: self.axes]
        self.playback.apply(self.now_ns)
        step = self.playback.step(self.now_ns)
        expected = self.playback.offset(step)
        if told != expected:
            raise Disagreement(f"at {self.now_ns} ns the client says {told}, the rules say {expected}")
        return step, told

    def reference(self, twist, offset):
        """The velocity reference of the joints in rad/s; none moves without an offset."""
        if offset is None:
            return np.zeros(self.scenario.joints)
        return np.linalg.solve(self.arm.jacobian(self.axes), twist + np.array(offset))

    def advanced(self, position, twist, duration_s):
        """Where the commanded velocity alone leads the joints (rad), by a step of the classic Runge-Kutta method."""
        if not twist.any():
            return position
        first = self.rate(position, twist)
        second = self.rate(position + first * (0.5 * duration_s), twist)
        third = self.rate(position + second * (0.5 * duration_s), twist)
        fourth = self.rate(position + third * duration_s, twist)
        return position + (first + (second + third) * 2.0 + fourth) * (duration_s / 6.0)

    def rate(self, position, twist):
        """The joint velocity in rad/s that moves the TCP with a twist, at a joint position in rad."""
        model, frame, arm = self.arm.model, self.frame, self.arm
        frame.qpos[: len(position)] = position
        mujoco.mj_kinematics(model, frame)
        mujoco.mj_comPos(model, frame)
        translation, rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, frame, translation, rotation, arm.tcp)
        return np.linalg.solve(np.vstack((translation, rotation))[: self.axes, : len(position)], twist)
