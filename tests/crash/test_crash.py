"""What is read after a kill, on a full disk or in a read-only folder is whole, and is what its name says.

Ten moments and six sizes here; ``make crash`` takes 200 moments and 20 sizes (the variables below).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

KILLS = int(os.environ.get("TESTBED_CRASH_KILLS", "10"))
SIZES = int(os.environ.get("TESTBED_CRASH_SIZES", "6"))

# What other commands write: killed half as often.
OUTPUTS = ("replayed", "exported", "identified", "swept")

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


@pytest.mark.parametrize("action", ["run", "report", "training", *OUTPUTS])
def test_what_was_killed_leaves_the_earlier_or_the_new_one_whole(tmp_path, action):
    kills = max(KILLS // 2, 4) if action in OUTPUTS else KILLS
    found = drive("kill", action, kills, 2026, tmp_path)
    assert found["faults"] == []
    # Half of the moments are within the length that was measured before, the others about its end.
    assert found["ends"].get("signal 9", 0) >= kills // 4
    assert set(found["ends"]) <= {"signal 9", "status 0"}


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
