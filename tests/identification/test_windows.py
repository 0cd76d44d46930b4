"""Parts of a spectrum: lines alone, all else divided, nothing that spilled over."""

from __future__ import annotations

import numpy as np

from testbed.identification.windows import spectrum_parts


def test_what_is_flat_is_divided_into_parts_that_do_not_overlap(rng):
    parts = spectrum_parts(rng.exponential(size=5000))
    used = np.concatenate([part.bins for part in parts])
    assert np.unique(used).size == used.size
    # Parts placed one by one where there is room fill three quarters of a line (Renyi 1958).
    assert used.size > 0.6 * 5000
    assert not any(part.is_line for part in parts)
    assert all(part.bins.size >= 17 for part in parts)


def test_a_line_has_a_part_of_its_own_without_those_beside(rng):
    power = 1e-6 * rng.exponential(size=1000)
    power[[200, 205, 600]] = 1.0
    parts = {part.peak: part for part in spectrum_parts(power)}
    assert parts.keys() == {200, 205, 600}
    assert all(part.is_line for part in parts.values())
    assert not np.isin([204, 205, 206], parts[200].bins).any()
    assert np.isin([199, 200, 201], parts[200].bins).all()


def test_the_skirts_of_a_line_are_no_excitation():
    """A sine for a tenth of the record: (10 / pi m)^2 in power."""
    m = np.arange(3000) - 1000.0
    power = np.sinc(m / 10.0) ** 2
    assert all(abs(part.peak - 1000) < 100 for part in spectrum_parts(power))
