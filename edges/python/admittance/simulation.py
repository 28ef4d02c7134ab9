"""Runs in virtual time, by `admittancectl simulate`."""

import os
import tempfile
from pathlib import Path

from .program import Program, ProgramFailed, run
from .recording import Recording


class SimulationFailed(ProgramFailed):
    """A file is missing or wrong, or the run breaks off: `code` is the exit code of admittancectl, the text what it said."""


def simulate(
    config: str | os.PathLike[str],
    scenario: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    program: Program = None,
) -> Recording:
    """What the daemon of this configuration does to the plant of this scenario, both TOML files.

    In virtual time: as fast as it can be computed, and the same numbers every time. `out` keeps the recording, in a
    file that must not exist yet. `program` is an `admittancectl` other than this package's.
    """
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory, "simulation.mcap") if out is None else Path(out)
        # A name is a file's, whatever it begins with.
        files = [os.path.abspath(each) for each in (config, scenario, file)]
        run(program, "simulate", files[0], files[1], "--out", files[2], failure=SimulationFailed)
        return Recording(file)
