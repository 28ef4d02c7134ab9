"""Puts the C client into the wheel, the one that ADMITTANCE_CLIENT_LIBRARY names or one built by edges/c/install, and
the stub of its samples."""

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


class WithLibrary(build_py):
    def run(self):
        super().run()
        package = Path(self.build_lib) / "admittance"
        stub.write(package / "wire.json", package / "wire.pyi")
        target = package / "libadmittance_client.so"
        given = os.environ.get("ADMITTANCE_CLIENT_LIBRARY")
        if given:
            shutil.copyfile(given, target)
            return
        with tempfile.TemporaryDirectory() as prefix:
            subprocess.run([HERE.parent / "c" / "install", prefix], check=True)
            shutil.copyfile(Path(prefix) / "lib" / "libadmittance_client.so", target)


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


setup(version=version(), cmdclass={"build_py": WithLibrary, "bdist_wheel": ForEveryPython}, distclass=OfOneMachine)
