"""`admittancectl`, which does what this package asks of it."""

import os
import shutil
import subprocess
from pathlib import Path

Program = str | os.PathLike[str] | None
"""A path, a name that PATH has, or None: the program that came with this package."""


class ProgramFailed(Exception):
    """The program ended with another exit code than 0: `code` is that code, the text what it said."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


def run(program: Program, *arguments: str, failure: type[ProgramFailed]) -> str:
    """What `program ARGUMENTS` prints; `failure` when it says that it could not."""
    own = Path(__file__).with_name("admittancectl")
    found = shutil.which(own if program is None else program)
    if found is None:
        if program is None:
            raise FileNotFoundError(
                f"{os.fspath(own)!r} is not there, or not executable: a wheel of this package brings it; "
                "program= names another admittancectl"
            )
        raise FileNotFoundError(
            f"program = {os.fspath(program)!r}: accepted: a path, or a name that PATH has; "
            "`cargo build --release` makes target/release/admittancectl"
        )
    done = subprocess.run([found, *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise failure(done.returncode, (done.stderr or done.stdout).strip())
    return done.stdout
