"""The drives: a PI speed loop for each joint, and the torques that a model of the arm asks for."""

import math

import mujoco
import numpy as np

import mjcf


class Drives:
    """The reference passes through a lag first, so that it has an acceleration; the torques of the model, which has all
    rotors on their joints, are those of the reference at the position that the encoders show."""

    def __init__(self, scenario, start):
        section = scenario.body["drive"]
        self.period_ns = round(1e9 / section.get("rate_hz", 8000.0))
        self.period_s = self.period_ns / 1e9
        self.factor = section.get("feed_forward_factor", 1.0)
        self.gain = scenario.of_joints("speed_gain_n_m_s_rad", 0.0)
        self.integral_share = self.period_s / section.get("integral_time_s", 0.02)
        self.limit = scenario.of_joints("torque_limit_n_m", math.inf)
        counts = scenario.of_joints("encoder_counts", math.inf)
        self.encoder_step = 2.0 * math.pi / scenario.of_joints("gear_ratio", 1.0) / counts
        # Of an endless resolution: so fine that it does not matter.
        self.encoder_step[self.encoder_step == 0.0] = 1e-15
        self.decay = np.exp(-self.period_s / scenario.time_constant_s)
        self.model = mjcf.build(scenario, self.period_s, gears_give=False)
        self.data = mujoco.MjData(self.model)
        self.desired = np.zeros(scenario.joints)
        self.velocity = np.zeros(scenario.joints)
        # What the gears have to carry at rest winds them up, and the integral parts hold it there.
        self.holding = self.needed(start, np.zeros(scenario.joints))
        stiffness = scenario.of_joints("gear_stiffness_n_m_rad", math.inf)
        self.start = start + self.holding / stiffness
        self.seen = self.quantised(self.start)
        self.integral = self.holding - self.factor * self.needed(self.seen, np.zeros(scenario.joints))

    def quantised(self, position):
        """What the encoders show of motors at a position in rad."""
        return np.rint(position / self.encoder_step) * self.encoder_step

    def needed(self, position, acceleration):
        """The torques that the model needs for an acceleration at a position and the desired velocity."""
        data = self.data
        data.qpos, data.qvel, data.qacc = position, self.desired, acceleration
        mujoco.mj_inverse(self.model, data)
        return data.qfrc_inverse.copy()

    def tick(self, position, reference):
        """The torques up to the next tick, from the motors' position in rad and the velocity reference in rad/s."""
        seen = self.quantised(position)
        self.velocity = (seen - self.seen) / self.period_s
        self.seen = seen
        following = reference + (self.desired - reference) * self.decay
        forward = self.factor * self.needed(seen, (following - self.desired) / self.period_s)
        error = self.desired - self.velocity
        proportional = self.gain * error
        asked = forward + proportional + self.integral
        # At its limit a drive sums up nothing that leads further beyond it.
        sums = (np.abs(asked) <= self.limit) | (asked * error < 0.0)
        self.integral += np.where(sums, proportional * self.integral_share, 0.0)
        self.desired = following
        return np.clip(asked, -self.limit, self.limit)
