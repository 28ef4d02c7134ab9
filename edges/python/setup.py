"""Puts the C client into the wheel: the one that ADMITTANCE_CLIENT_LIBRARY names, or one built by edges/c/install."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent


class WithLibrary(build_py):
    def run(self):
        super().run()
        target = Path(self.build_lib) / "admittance" / "libadmittance_client.so"
        given = os.environ.get("ADMITTANCE_CLIENT_LIBRARY")
        if given:
            shutil.copyfile(given, target)
            return
        with tempfile.TemporaryDirectory() as prefix:
            subprocess.run([HERE.parent / "c" / "install", prefix], check=True)
            shutil.copyfile(Path(prefix) / "lib" / "libadmittance_client.so", target)


class OfOneMachine(Distribution):
    """The wheel holds machine code, though none of it is Python's."""

    def has_ext_modules(self):
        return True


setup(cmdclass={"build_py": WithLibrary}, distclass=OfOneMachine)
