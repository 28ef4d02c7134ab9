"""Puts the C client and `admittancectl` into the wheel, those that ADMITTANCE_CLIENT_LIBRARY and ADMITTANCE_PROGRAM name
or ones built by edges/c/install and cargo, and the stub of its samples."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent
# A build that is isolated does not look here.
sys.path.insert(0, str(HERE))

import stub  # noqa: E402


def given(variable):
    """The file that this variable names; None where it is not set."""
    value = os.environ.get(variable)
    # pip builds in a directory of its own choice: a relative path would mean another file.
    if value and not (os.path.isabs(value) and os.path.isfile(value)):
        sys.exit(f"{variable} = {value!r}: accepted: the absolute path of a file")
    return value


def put_library(target):
    library = given("ADMITTANCE_CLIENT_LIBRARY")
    if library:
        shutil.copyfile(library, target)
        return
    with tempfile.TemporaryDirectory() as prefix:
        subprocess.run([HERE.parent / "c" / "install", prefix], check=True)
        shutil.copyfile(Path(prefix) / "lib" / "libadmittance_client.so", target)


def put_program(target):
    shutil.copyfile(given("ADMITTANCE_PROGRAM") or built_program(), target)
    target.chmod(0o755)
    # Most of it is for debuggers. One that strip cannot read stays as it is.
    if shutil.which("strip"):
        subprocess.run(["strip", target], check=False)


def built_program():
    """`admittancectl` in the release profile, wherever cargo puts it."""
    words = "build --release --locked -p admittancectl --bin admittancectl --message-format=json-render-diagnostics"
    said = subprocess.run(["cargo", *words.split()], check=True, cwd=HERE, stdout=subprocess.PIPE, text=True).stdout
    artifacts = [json.loads(line) for line in said.splitlines() if line.startswith("{")]
    programs = [artifact["executable"] for artifact in artifacts if artifact.get("executable")]
    if not programs:
        sys.exit("cargo built no admittancectl; ADMITTANCE_PROGRAM names one that is there already")
    return programs[-1]


class WithPrograms(build_py):
    def run(self):
        super().run()
        package = Path(self.build_lib) / "admittance"
        stub.write(package / "wire.json", package / "wire.pyi")
        put_library(package / "libadmittance_client.so")
        put_program(package / "admittancectl")


class OfOneMachine(Distribution):
    """The wheel holds machine code."""

    def has_ext_modules(self):
        return True


class ForEveryPython(bdist_wheel):
    """None of the machine code is Python's: ctypes calls it."""

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


def version():
    """The workspace's, which is said there."""
    manifest = (HERE.parent.parent / "Cargo.toml").read_text()
    return re.search(r'^version = "(.*)"$', manifest, re.MULTILINE)[1]


setup(version=version(), cmdclass={"build_py": WithPrograms, "bdist_wheel": ForEveryPython}, distclass=OfOneMachine)
