"""What is read after a kill, on a full disk or in a read-only folder is whole, and is what its name says.

Six moments and four sizes here; ``make crash`` takes 200 moments and 20 sizes (the variables below).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

KILLS = int(os.environ.get("TESTBED_CRASH_KILLS", "6"))
SIZES = int(os.environ.get("TESTBED_CRASH_SIZES", "4"))

# What is killed; what other commands write half as often.
ACTIONS = dict.fromkeys(("run", "report", "training"), KILLS)
ACTIONS |= dict.fromkeys(("replayed", "exported", "identified", "swept"), max(KILLS // 2, 4))

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="forks and signals of POSIX systems"),
]


def drive(*arguments, before=()):
    command = [*before, sys.executable, "-m", "tests.crash.driver", *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    print(found)
    return found


def test_what_was_killed_leaves_the_earlier_or_the_new_one_whole(tmp_path):
    found = drive("kill", ",".join(f"{name}={kills}" for name, kills in ACTIONS.items()), 2026, tmp_path)
    assert {name: one["faults"] for name, one in found.items() if one["faults"]} == {}
    assert found.keys() == ACTIONS.keys()
    for name, one in found.items():
        # Half of the moments are within the length that was measured before, the others about its end.
        assert one["ends"].get("signal 9", 0) >= ACTIONS[name] // 4
        assert set(one["ends"]) <= {"signal 9", "status 0"}


def name_space():
    """Return what gives a name space in which a file system may be mounted, None if the machine forbids it."""
    before = ["unshare", "--user", "--map-root-user", "--mount"]
    probe = [*before, "mount", "-t", "tmpfs", "-o", "size=64k", "none", "/tmp"]
    if shutil.which("unshare") is None or subprocess.run(probe, capture_output=True, check=False).returncode:
        return None
    return before


def test_full_and_read_only_disks_leave_the_earlier_one_whole(tmp_path):
    before = name_space()
    if before is None:
        pytest.skip("no small file system can be mounted here: unshare -Urm is missing or forbidden")
    found = drive("disk", SIZES, tmp_path, before=before)
    assert found["faults"] == []
    # On the smallest disk a second run does not fit, on the largest it does.
    assert found["ends"]["run status 3"] >= 1
    assert found["ends"]["run status 0"] >= 1
