"""The motion controller's side of admittanced, and its recordings as numpy arrays.

SI units and radians; instants are nanoseconds of CLOCK_MONOTONIC (`time.monotonic_ns()` on Linux). Cartesian arrays are
x y z rx ry rz at the TCP in the robot's base frame; a wrench is what the robot exerts on the environment.
"""

from .client import Client, Counts, Failure, Instruction
from .recording import Recording, Topic
from .requests import RequestFailed, request, status
from .simulation import SimulationFailed, simulate
from .wire import CommandSample, StateSample, codes

__all__ = [
    "Client",
    "CommandSample",
    "Counts",
    "Failure",
    "Instruction",
    "Recording",
    "RequestFailed",
    "SimulationFailed",
    "StateSample",
    "Topic",
    "codes",
    "request",
    "simulate",
    "status",
]
