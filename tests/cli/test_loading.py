"""While libraries load nobody looks for garbage."""

from __future__ import annotations

import gc

from testbed.cli.loading import loading


def test_the_search_for_garbage_rests_while_libraries_load_and_goes_on_afterwards():
    before = gc.get_freeze_count()
    with loading():
        kept = [[] for _ in range(1000)]
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() >= before + len(kept)
