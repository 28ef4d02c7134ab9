#!/usr/bin/env python3
"""Instructions per warm solve of every problem file, and per cycle of a contact with the surface known and with a range of it,
counted by callgrind: a figure that a busy machine does not change.

    instructions.py EXAMPLES            compares with instructions.json; exit 1 when something takes over 3 % more
    instructions.py EXAMPLES --write    writes what it counts

EXAMPLES is the directory of the release builds of the examples "solve" and "cycles". What a run takes besides solving and
stepping cancels out: the difference of three rounds and one is counted. VALGRIND names another valgrind than that of the
path: what an old one does not know is not counted there, and said (3.19 knows no vmovq from one register to another, as some arms'
code has it; 3.24 does).
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
RECORD = HERE / "instructions.json"
PROBLEMS_PER_FILE = 80
CYCLES_PER_ROUND = 300
TOLERANCE = 0.03
VALGRIND = os.environ.get("VALGRIND", "valgrind")
# Arms beside those that are also counted with a range.
ARMS = ("gantry", "planar-three", "scara", "five-joint", "six-all", "seven", "rail", "eight-joint")


def count(program, rounds):
    """Instructions of a run; None where this valgrind does not know one of them."""
    with tempfile.TemporaryDirectory() as directory:
        command = [VALGRIND, "--tool=callgrind", f"--callgrind-out-file={directory}/out", *program, str(rounds)]
        run = subprocess.run(command, capture_output=True, text=True)
    if "Unrecognised instruction" in run.stderr:
        return None
    found = re.search(r"Collected : (\d+)", run.stderr)
    if run.returncode != 0 or not found:
        sys.exit(f"{' '.join(command)} failed:\n{run.stderr}")
    return int(found.group(1))


def main():
    if len(sys.argv) not in (2, 3) or sys.argv[2:] not in ([], ["--write"]):
        sys.exit(__doc__)
    examples = pathlib.Path(sys.argv[1])
    programs = {}
    for file in sorted((HERE / "problems").glob("*.bin")):
        programs[file.stem] = ([examples / "solve", file], PROBLEMS_PER_FILE)
    for joints in ("two", "six"):
        for told in ("known", "range"):
            programs[f"cycle, {joints} joints, {told}"] = ([examples / "cycles", joints, told], CYCLES_PER_ROUND)
    for arm in ARMS:
        programs[f"cycle, {arm}, known"] = ([examples / "cycles", arm, "known"], CYCLES_PER_ROUND)
    found = {}
    for name, (program, pieces) in programs.items():
        program = [str(word) for word in program]
        one, three = count(program, 1), count(program, 3)
        if one is None or three is None:
            print(f"{name}: not counted: {VALGRIND} does not know an instruction of it")
        else:
            found[name] = round((three - one) / 2 / pieces)
    recorded = json.loads(RECORD.read_text())
    if sys.argv[2:]:
        # What was not counted stays as it is.
        kept = {name: found.get(name, recorded.get(name)) for name in programs}
        written = {name: instructions for name, instructions in kept.items() if instructions is not None}
        RECORD.write_text(json.dumps(written, indent=2) + "\n")
        return
    slower = False
    for name, instructions in found.items():
        change = instructions / recorded[name] - 1
        verdict = "too many" if change > TOLERANCE else "fewer: write them down" if change < -TOLERANCE else "as recorded"
        print(f"{name}: {instructions} instructions, {100 * change:+.1f} %, {verdict}")
        slower |= change > TOLERANCE
    if slower:
        sys.exit(f"over {100 * TOLERANCE:.0f} % more instructions than recorded: find out why, or run {sys.argv[0]} EXAMPLES --write")


if __name__ == "__main__":
    main()
