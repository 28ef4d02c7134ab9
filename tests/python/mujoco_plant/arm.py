"""The arm in MuJoCo: links, gears, rotors and friction, and what presses on its TCP."""

import mujoco
import numpy as np

import mjcf
from surface import Surface


class Arm:
    """It starts at rest; a step lasts `timestep_s`, and the torques of the motors are constant over it."""

    def __init__(self, scenario, timestep_s, motor_start):
        self.model = mjcf.build(scenario, timestep_s, gears_give=True)
        self.data = mujoco.MjData(self.model)
        joints = range(scenario.joints)
        self.joints = scenario.joints
        names = [f"rotor{joint}" for joint in joints]
        rotors = [mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
        # Where the motor of each joint is: at its rotor, or at the joint itself.
        self.motors = np.array([joint if rotor < 0 else rotor for joint, rotor in zip(joints, rotors)])
        self.tcp = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, "tcp")
        self.hand = self.model.site_bodyid[self.tcp]
        self.surface = Surface(scenario.surface) if scenario.surface else None
        self.viscous = scenario.of_joints("viscous_friction_n_m_s_rad", 0.0)
        self.coulomb = scenario.of_joints("coulomb_friction_n_m", 0.0)
        breakaway = scenario.of_joints("breakaway_friction_n_m", np.nan)
        self.stribeck = np.where(np.isnan(breakaway), 0.0, breakaway - self.coulomb)
        self.stribeck_velocity = scenario.of_joints("stribeck_velocity_rad_s", 0.05)
        self.slip_velocity = scenario.of_joints("slip_velocity_rad_s", 0.001)
        self.translation, self.rotation = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        self.data.qpos[self.motors] = motor_start
        self.data.qpos[: scenario.joints] = scenario.start
        self.look()

    def look(self):
        """Where everything is now, and what it presses on."""
        data = self.data
        # Friction is its slope times the velocity: as a damping of the joint the integrator takes it implicitly, as it
        # must where a joint sticks.
        velocity = data.qvel[self.motors]
        dry = self.coulomb + self.stribeck * np.exp(-((velocity / self.stribeck_velocity) ** 2))
        self.model.dof_damping[self.motors] = self.viscous + dry / np.hypot(velocity, self.slip_velocity)
        mujoco.mj_step1(self.model, data)
        mujoco.mj_jacSite(self.model, data, self.translation, self.rotation, self.tcp)
        self.normal_force, self.force = 0.0, (0.0, 0.0, 0.0)
        if self.surface:
            velocity = self.translation @ data.qvel
            self.normal_force, self.force = self.surface.contact(self.position().tolist(), velocity.tolist())

    def step(self, torque):
        """A step under these torques of the motors in N m."""
        data = self.data
        data.qfrc_applied[self.motors] = torque
        # J^T f: the surface pushes back at the TCP.
        data.qfrc_applied[: self.joints] -= np.dot(self.force, self.translation[:, : self.joints])
        mujoco.mj_step2(self.model, data)
        data.qfrc_applied[:] = 0.0
        self.look()

    def position(self):
        """Of the TCP, m."""
        return self.data.site_xpos[self.tcp]

    def joint_position(self):
        """Of the links, rad."""
        return self.data.qpos[: self.joints]

    def motor_position(self):
        """Of the motors, on the joints' side of the gears, rad."""
        return self.data.qpos[self.motors]

    def jacobian(self, axes):
        """Of the TCP: x y z rx ry rz of the base frame by the joints."""
        return np.vstack((self.translation, self.rotation))[:axes, : self.joints]
