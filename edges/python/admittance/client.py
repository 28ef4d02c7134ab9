"""A motion controller in Python, by the C client: the same rules as in every other language.

ctypes, not a compiled extension: one wheel serves every Python 3, and there is no second list of the calls.
"""

import ctypes
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from .wire import SCHEMA, CommandSample, StateSample, codes

_ABI_VERSION = 1
_AXES: int = SCHEMA["constants"]["TASK_AXES"]
_JOINTS: int = SCHEMA["constants"]["MAX_JOINTS"]
_NO_ANSWER = 1
_HOLD = next(code for code, name in codes("Motion").items() if name == "Hold")


class _Options(ctypes.Structure):
    _fields_ = [
        ("abi_version", ctypes.c_uint32),
        ("joint_count", ctypes.c_uint32),
        ("root_path", ctypes.c_char_p),
        ("prefix", ctypes.c_char_p),
        ("instance", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("sampling_time_ns", ctypes.c_uint64),
        ("command_delay_ns", ctypes.c_uint64),
        ("velocity_offset_limit", ctypes.c_double * _AXES),
        ("joint_velocity_offset_limit", ctypes.c_double * _JOINTS),
    ]


class _Instruction(ctypes.Structure):
    _fields_ = [
        ("velocity_offset", ctypes.c_double * _AXES),
        ("until_ns", ctypes.c_uint64),
        ("motion", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class _Counts(ctypes.Structure):
    _fields_ = [
        ("missed", ctypes.c_uint64),
        ("rejected", ctypes.c_uint64),
        ("applied_sequence", ctypes.c_uint64),
        ("has_received", ctypes.c_uint32),
        ("is_missing", ctypes.c_uint32),
    ]


def _load() -> ctypes.CDLL:
    path = files(__package__).joinpath("libadmittance_client.so")
    library = ctypes.CDLL(os.fspath(path))  # type: ignore[call-overload]
    found = library.admittance_client_abi_version()
    if found != _ABI_VERSION:
        raise ImportError(f"{path} has version {found} of its interface: accepted: {_ABI_VERSION}")
    handle, out = ctypes.c_void_p, ctypes.POINTER
    arguments = {
        "open": [out(_Options), out(handle), ctypes.c_char_p, ctypes.c_size_t],
        "begin": [handle, ctypes.c_uint64, out(StateSample)],
        "publish": [handle, out(StateSample)],
        "receive": [handle, ctypes.c_uint64],
        "apply": [handle, ctypes.c_uint64, out(_Instruction)],
        "joint_velocity_offset": [handle, ctypes.c_uint64, out(ctypes.c_double)],
        "make_ready": [handle],
        "newest": [handle, out(CommandSample)],
        "counts": [handle, ctypes.c_uint64, out(_Counts)],
        "text": [handle],
        "close": [handle],
    }
    for name, types in arguments.items():
        getattr(library, f"admittance_client_{name}").argtypes = types
    library.admittance_client_text.restype = ctypes.c_char_p
    library.admittance_client_close.restype = None
    return library


_library = _load()


class Failure(Exception):
    """What a call says when it fails: `status` is a code of `admittance_client.h`."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Instruction:
    """What the joints are to do."""

    hold: bool
    """Zero joint velocity, whatever the twist reference is."""
    velocity_offset: tuple[float, ...]
    """To add to the twist reference, m/s and rad/s; zero when they hold."""
    until_ns: int
    """Until when this holds, unless an answer that is received meanwhile says otherwise."""


@dataclass(frozen=True)
class Counts:
    """What became of the answers so far."""

    missed: int
    """That came too late to act, or never, since the first accepted one."""
    rejected: int
    """That were refused."""
    applied_sequence: int
    """Number of the command in force; 0 = none yet."""


class Client:
    """Ports and rules of a motion controller; close it, or use it in a `with` statement.

    `sampling_time_s` and `command_delay_s` are the daemon's. `velocity_offset_limit` (m/s and rad/s per axis) and
    `joint_velocity_offset_limit` (rad/s per joint, m/s of one that slides) are the controller's own: an answer beyond
    them is refused.
    """

    def __init__(
        self,
        *,
        root_path: str,
        prefix: str,
        instance: str,
        joint_count: int,
        sampling_time_s: float,
        command_delay_s: float,
        velocity_offset_limit: Sequence[float],
        joint_velocity_offset_limit: Sequence[float],
        name: str = "python",
    ) -> None:
        self._handle = ctypes.c_void_p()
        for key, limits, length in (
            ("velocity_offset_limit", velocity_offset_limit, _AXES),
            ("joint_velocity_offset_limit", joint_velocity_offset_limit, joint_count),
        ):
            if len(limits) != length:
                raise ValueError(f"{key}: {len(limits)} values: accepted: {length}, math.inf for none")
        # Joints that are not there move nothing.
        joint_limits = [*joint_velocity_offset_limit, *[math.inf] * (_JOINTS - joint_count)]
        options = _Options(
            _ABI_VERSION,
            joint_count,
            root_path.encode(),
            prefix.encode(),
            instance.encode(),
            name.encode(),
            round(sampling_time_s * 1e9),
            round(command_delay_s * 1e9),
            (ctypes.c_double * _AXES)(*velocity_offset_limit),
            (ctypes.c_double * _JOINTS)(*joint_limits),
        )
        why = ctypes.create_string_buffer(512)
        status = _library.admittance_client_open(options, self._handle, why, len(why))
        if status < 0:
            raise Failure(status, why.value.decode())

    def begin(self, stamp_ns: int) -> "StateSample":
        """The sample of a state measured at `stamp_ns`: numbered, its measurement still to be filled in."""
        sample = StateSample()
        self._check(_library.admittance_client_begin(self._handle, stamp_ns, sample))
        return sample

    def publish(self, sample: "StateSample") -> None:
        """Publishes the sample and wakes the daemon."""
        self._check(_library.admittance_client_publish(self._handle, sample))

    def receive(self, now_ns: int) -> bool:
        """Takes the newest answer, without waiting: whether there was one. `Failure` when it is refused."""
        return self._check(_library.admittance_client_receive(self._handle, now_ns)) != _NO_ANSWER

    def apply(self, now_ns: int) -> Instruction:
        """What the joints are to do at this instant."""
        told = _Instruction()
        self._check(_library.admittance_client_apply(self._handle, now_ns, told))
        return Instruction(told.motion == _HOLD, tuple(told.velocity_offset), told.until_ns)

    def joint_velocity_offset(self, now_ns: int) -> "tuple[float, ...]":
        """What the joints add to their commanded velocity at this instant, after `apply`: of a controller that says
        follows_joint_velocity = 1 in its samples."""
        offset = (ctypes.c_double * _JOINTS)()
        self._check(_library.admittance_client_joint_velocity_offset(self._handle, now_ns, offset))
        return tuple(offset)

    def make_ready(self) -> None:
        """Makes room for the next sample: in the slack of a cycle."""
        self._check(_library.admittance_client_make_ready(self._handle))

    def newest(self) -> "CommandSample | None":
        """The newest accepted answer: mode, verdict, plan; None before the first."""
        command = CommandSample()
        status = self._check(_library.admittance_client_newest(self._handle, command))
        return None if status == _NO_ANSWER else command

    def counts(self) -> Counts:
        """What became of the answers so far."""
        found = _Counts()
        self._check(_library.admittance_client_counts(self._handle, 0, found))
        return Counts(found.missed, found.rejected, found.applied_sequence)

    def close(self) -> None:
        """Closes the ports; nothing happens when they are closed."""
        handle, self._handle = self._handle, ctypes.c_void_p()
        _library.admittance_client_close(handle)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check(self, status: int) -> int:
        if status < 0:
            raise Failure(status, _library.admittance_client_text(self._handle).decode())
        return status
