"""Runs the code cells of a notebook as Jupyter does, and holds what it shows to what it is about.

    notebook.py NOTEBOOK.ipynb PLACE

`%pip install` goes into PLACE, without a network: what else the notebook wants is there.
"""

import json
import os
import pathlib
import shlex
import subprocess
import sys

OFFLINE = ["--quiet", "--disable-pip-version-check", "--no-index", "--no-deps", "--no-build-isolation"]


def install(words, place):
    """What `%pip WORDS` does."""
    subprocess.run([sys.executable, "-m", "pip", *words, *OFFLINE, "--target", place], check=True)


def run(notebook, place):
    """The names that the cells leave behind, and how many lines of code they are."""
    names, count = {}, 0
    for cell in json.loads(notebook.read_text())["cells"]:
        if cell["cell_type"] != "code":
            continue
        if cell["outputs"] or cell["execution_count"] is not None:
            sys.exit(f"{notebook}: a cell has outputs: they are nobody's who reads it; accepted: none")
        text = "".join(cell["source"])
        count += sum(bool(line.strip()) for line in text.splitlines())
        if text.startswith("%pip "):
            install(shlex.split(text.removeprefix("%pip ")), place)
        else:
            exec(compile(text, notebook.name, "exec"), names)
    return names, count


def main(notebook, place):
    """The command line."""
    notebook, place = pathlib.Path(notebook).resolve(), pathlib.Path(place).resolve()
    sys.path.insert(0, str(place))
    os.environ["MPLBACKEND"] = "Agg"
    os.chdir(notebook.parent)
    names, count = run(notebook, place)
    contact = names["contact"]
    (drawn,) = names["force"].lines
    assert (drawn.get_ydata() == contact.truth.normal_force_n).all()
    assert (drawn.get_xdata() == contact.truth.scenario_time_s).all()
    touch = drawn.get_xdata()[drawn.get_ydata() > 0.0][0]
    assert 0.816 <= touch < 0.824, touch
    assert 100.0 < contact.truth.peak_normal_force_n.max() < 200.0 > 5.0 * contact.truth.normal_force_n[-1]
    assert len(names["offset"].lines) == 2
    for axes in (names["force"], names["offset"]):
        assert axes.get_ylabel().endswith(("in N", "in m/s")), axes.get_ylabel()
    names["figure"].savefig(place / "contact.png")
    assert (place / "contact.png").stat().st_size > 10_000
    assert pathlib.Path(sys.modules["admittance"].__file__).is_relative_to(place)
    print(f"{count} lines of code, {len(contact.state)} samples, contact at {touch:.3f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
