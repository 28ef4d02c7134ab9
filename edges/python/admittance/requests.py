"""What an operator asks of the daemon, by `admittancectl`: it knows how to ask, to wait and to say what was refused."""

import json
import os
import shutil
import subprocess
from typing import Any


class RequestFailed(Exception):
    """The daemon refused, or is not there: `code` is the exit code of admittancectl, the text what it said."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


def request(
    kind: str, *arguments: str, config: str | os.PathLike[str], program: str = "admittancectl"
) -> str:
    """Asks what `admittancectl KIND ARGUMENTS` asks, of the daemon of this configuration, such as `reset`; what it says."""
    found = shutil.which(program)
    if found is None:
        raise FileNotFoundError(f"program = {program!r}: accepted: a path, or a name that PATH has")
    command = [found, kind, "--config", os.fspath(config), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RequestFailed(done.returncode, (done.stderr or done.stdout).strip())
    return done.stdout


def status(*, config: str | os.PathLike[str], program: str = "admittancectl") -> dict[str, Any]:
    """What `admittancectl status --json` says."""
    found: dict[str, Any] = json.loads(request("status", "--json", config=config, program=program))
    return found
