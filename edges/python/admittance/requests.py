"""What an operator asks of the daemon, by `admittancectl`: it knows how to ask, to wait and to say what was refused."""

import json
import os
from typing import Any

from .program import Program, ProgramFailed, run


class RequestFailed(ProgramFailed):
    """The daemon refused, or is not there: `code` is the exit code of admittancectl, the text what it said."""


def request(
    kind: str,
    *arguments: str,
    config: str | os.PathLike[str],
    program: Program = None,
) -> str:
    """Asks what `admittancectl KIND ARGUMENTS` asks, of the daemon of this configuration, such as `reset`; what it says.

    `program` is an `admittancectl` other than this package's."""
    return run(program, kind, "--config", os.fspath(config), *arguments, failure=RequestFailed)


def status(*, config: str | os.PathLike[str], program: Program = None) -> dict[str, Any]:
    """What `admittancectl status --json` says."""
    found: dict[str, Any] = json.loads(request("status", "--json", config=config, program=program))
    return found
