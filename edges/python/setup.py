"""Puts the C client and `admittancectl` into the wheel, those that ADMITTANCE_CLIENT_LIBRARY and ADMITTANCE_PROGRAM name
or ones built by edges/c/install and cargo, and the stub of its samples."""

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


def put_library(target):
    given = os.environ.get("ADMITTANCE_CLIENT_LIBRARY")
    if given:
        shutil.copyfile(given, target)
        return
    with tempfile.TemporaryDirectory() as prefix:
        subprocess.run([HERE.parent / "c" / "install", prefix], check=True)
        shutil.copyfile(Path(prefix) / "lib" / "libadmittance_client.so", target)


def put_program(target):
    given = os.environ.get("ADMITTANCE_PROGRAM")
    if not given:
        subprocess.run(["cargo", "build", "--release", "-p", "admittancectl"], check=True, cwd=HERE)
        given = Path(os.environ.get("CARGO_TARGET_DIR", HERE.parent.parent / "target")) / "release" / "admittancectl"
    shutil.copyfile(given, target)
    target.chmod(0o755)
    # What a debugger wants of it is most of it.
    if shutil.which("strip"):
        subprocess.run(["strip", target], check=True)


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
