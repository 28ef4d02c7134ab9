#!/usr/bin/env python3
"""Golden estimates for daemon/core/src/intake/momentum_observer/tests.rs, by Pinocchio and numpy.

    python3 momentum_observer.py            write momentum_observer.json beside this script
    python3 momentum_observer.py --check    exit 1 unless momentum_observer.json says what this script computes

Needs the package pin, version 4.1.0 (numpy comes with it).

The filter of the CASE 2015 paper as a textbook has it, in one dense state [p; f]: Van Loan's matrix exponential gives
transition and noise, the update is Joseph's, and inverses are numpy's. The Rust code has blocks, a closed form and a Cholesky
factor. Dynamics are Pinocchio's: M and C as matrices, weights by each link's own model. Here is also where the choice of the
walk of f is written down again: with it, the gain of p is the lag times that of f.

The arm and its masses are the six-joint arm of dynamics.py beside it; it swings, and presses with a wrench that steps. One
sample is missing. Conventions: SI units, rad; `wrench` is what the robot exerts on the environment, base frame, at the TCP.
"""

import math
import pathlib
import random
import sys

import numpy as np
import pinocchio as pin

import dynamics
from kinematics import pretty

SEED = 20261125
SAMPLES = 60
MISSING = 23
PERIOD = 0.001
LAG = 0.006
FRICTION = {
    "viscous": [12.0, 12.0, 7.0, 2.0, 2.0, 2.0],
    "coulomb": [12.0, 12.0, 8.0, 3.0, 3.0, 3.0],
    "breakaway": [18.0, 18.0, 12.0, 4.5, 4.5, 4.5],
    "stribeck_velocity": 0.05,
    "slip_velocity": 0.001,
    "tolerance": 0.3,
    "unknown": 0.2,
}
MASS_TOLERANCE = 0.05
ACCELERATION_TOLERANCE = 0.1
TORQUE_NOISE = [0.5, 0.5, 0.3, 0.1, 0.1, 0.1]
VELOCITY_NOISE = 0.0005


def dry(joint, velocity):
    fall = FRICTION["breakaway"][joint] - FRICTION["coulomb"][joint]
    return FRICTION["coulomb"][joint] + fall * math.exp(-((velocity / FRICTION["stribeck_velocity"]) ** 2))


def friction(joint, velocity):
    smooth = velocity / math.hypot(velocity, FRICTION["slip_velocity"])
    return FRICTION["viscous"][joint] * velocity + dry(joint, velocity) * smooth


def stuck_variance(joint, velocity):
    slip = FRICTION["slip_velocity"]
    slope = slip**2 / math.hypot(velocity, slip) ** 3
    stuck = dry(joint, velocity) * min(1.0, slope * VELOCITY_NOISE)
    return stuck**2 + FRICTION["unknown"] ** 2


def exponential(matrix):
    """By its series: the matrices here are nilpotent, or nearly zero."""
    total, term = np.eye(len(matrix)), np.eye(len(matrix))
    for order in range(1, 12):
        term = term @ matrix / order
        total = total + term
    return total


def samples(arm, model, data, tool):
    source = random.Random(SEED)
    middle = np.array([0.3, 1.2, -1.8, 2.2, 1.57, 0.3])
    swing = np.array([source.uniform(0.05, 0.3) for _ in range(6)])
    rate = np.array([source.uniform(4.0, 30.0) for _ in range(6)])
    phase = np.array([source.uniform(-3.0, 3.0) for _ in range(6)])
    given = []
    for index in range(SAMPLES):
        if index == MISSING:
            continue
        t = index * PERIOD
        q = middle + swing * np.sin(rate * t + phase)
        v = swing * rate * np.cos(rate * t + phase)
        a = -swing * rate**2 * np.sin(rate * t + phase)
        wrench = [20.0, -10.0, -100.0, 3.0, -2.0, 1.0] if index >= SAMPLES // 2 else [0.0] * 6
        torque = pin.rnea(model, data, q, v, a, dynamics.reaction(model, data, tool, q, wrench))
        torque = torque + [friction(joint, v[joint]) + source.gauss(0.0, TORQUE_NOISE[joint]) for joint in range(6)]
        v = v + [source.gauss(0.0, VELOCITY_NOISE) for _ in range(6)]
        rounded = {"q": q, "velocity": v, "torque": torque}
        given.append({"time": t} | {key: [round(x, 9) for x in map(float, values)] for key, values in rounded.items()})
    return given


def seen(arm, model, data, tool, sample):
    q, v, torque = (np.array(sample[key]) for key in ("q", "velocity", "torque"))
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    coriolis = pin.computeCoriolisMatrix(model, data, q, v).copy()
    jacobian = pin.computeFrameJacobian(model, data, q, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED).copy()
    weights = np.array([dynamics.weight_of(arm, link, q) for link in range(6)])
    rubbing = np.array([friction(joint, v[joint]) for joint in range(6)])
    to_wrench = np.linalg.inv(jacobian.T)
    unsure = np.diag([(FRICTION["tolerance"] * friction(joint, v[joint])) ** 2 for joint in range(6)])
    unsure += MASS_TOLERANCE**2 * sum(np.outer(weight, weight) for weight in weights)
    noise = VELOCITY_NOISE**2 * mass @ mass.T
    return {
        "time": sample["time"],
        "momentum": mass @ v,
        "noise": noise,
        "drive": torque - rubbing + coriolis.T @ v - weights.sum(axis=0),
        "jacobian": jacobian,
        "to_wrench": to_wrench,
        "lasting": unsure,
        "stuck": np.array([stuck_variance(joint, v[joint]) for joint in range(6)]),
    }


def estimates(arm, model, data, tool, given):
    power = np.diag(np.array(TORQUE_NOISE) ** 2)
    state, covariance, before, passing, answers = None, None, None, None, []
    for sample in given:
        now = seen(arm, model, data, tool, sample)
        force_noise = now["to_wrench"] @ power @ now["to_wrench"].T
        if state is None:
            state = np.concatenate([now["momentum"], now["to_wrench"] @ now["drive"]])
            covariance = np.block([[now["noise"], np.zeros((6, 6))], [np.zeros((6, 6)), force_noise]])
            passing = now["stuck"]
        else:
            h = now["time"] - before["time"]
            flow = np.zeros((12, 12))
            flow[:6, 6:] = -now["jacobian"].T
            density = np.zeros((12, 12))
            density[:6, :6] = power * h
            by_momentum = now["to_wrench"] @ covariance[:6, :6] @ now["to_wrench"].T
            density[6:, 6:] = (force_noise * h + 2 * by_momentum / LAG) / LAG**2
            # Van Loan 1978.
            both = exponential(np.block([[-flow, density], [np.zeros((12, 12)), flow.T]]) * h)
            transition = both[12:, 12:].T
            process = transition @ both[:12, 12:]
            state = transition @ state
            state[:6] += (before["drive"] + now["drive"]) / 2 * h
            covariance = transition @ covariance @ transition.T + process
            measured = np.hstack([np.eye(6), np.zeros((6, 6))])
            gain = covariance @ measured.T @ np.linalg.inv(measured @ covariance @ measured.T + now["noise"])
            state = state + gain @ (now["momentum"] - measured @ state)
            left = np.eye(12) - gain @ measured
            covariance = left @ covariance @ left.T + gain @ now["noise"] @ gain.T
            accelerating = np.abs(now["drive"] - now["jacobian"].T @ state[6:])
            now_passing = now["stuck"] + (ACCELERATION_TOLERANCE * accelerating) ** 2
            passing = np.maximum(now_passing, passing * math.exp(-2 * h / LAG))
        before = now
        unsure = now["lasting"] + np.diag(passing)
        off = now["to_wrench"] @ unsure @ now["to_wrench"].T
        answers.append(
            {"wrench": state[6:].tolist(), "deviation": np.sqrt(np.diag(covariance[6:, 6:] + off)).tolist()}
        )
    return answers


def golden():
    arm = dynamics.golden()["arms"][1]
    arm.pop("cases")
    model, tool = dynamics.model_of(arm)
    data = model.createData()
    given = samples(arm, model, data, tool)
    cases = estimates(arm, model, data, tool, given)
    told = {"friction": FRICTION, "mass_tolerance": MASS_TOLERANCE, "acceleration_tolerance": ACCELERATION_TOLERANCE, "torque_noise": TORQUE_NOISE}
    told |= {"velocity_noise": VELOCITY_NOISE, "lag": LAG}
    steps = [{"given": sample, "answers": answer} for sample, answer in zip(given, cases)]
    return {"generated_by": f"momentum_observer.py with Pinocchio {dynamics.VERSION}", "seed": SEED} | {
        "arm": arm,
        "told": told,
        "steps": steps,
    }


if __name__ == "__main__":
    sys.exit(dynamics.main(sys.argv[1:], golden, pathlib.Path(__file__), 1e-9))
