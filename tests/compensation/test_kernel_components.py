"""Kernel principal components: a curve comes out of noise, and with all of them nothing is lost."""

import numpy as np

from testbed.compensation.kernel_components import kernel_components


def circle(n, noise, seed=1):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * np.pi, n)
    clean = np.stack([np.cos(angle), np.sin(angle)])
    return clean, clean + noise * rng.standard_normal((2, n))


def test_with_all_components_the_instants_come_back():
    """Up to the ridge of a thousandth of the kernel's diagonal, ten times the square root of which is a tenth."""
    _, modes = circle(300, 0.05)
    assert np.std(kernel_components(modes, share=0.9999) - modes) < 0.1 * modes.std()


def test_few_components_bring_instants_nearer_to_their_curve():
    _, modes = circle(1000, 0.2)
    kept = kernel_components(modes, share=0.6)
    radius, found = np.hypot(*modes), np.hypot(*kept)
    assert np.std(found) < 0.8 * np.std(radius)
    # And not to a point: the angle is kept.
    assert np.corrcoef(kept[0], modes[0])[0, 1] > 0.95


def test_units_and_chunks_go_through():
    """Modes over their own deviation; more instants than a chunk holds."""
    _, modes = circle(9000, 0.2)
    found = kernel_components(modes, seed=3)
    assert found.shape == modes.shape
    np.testing.assert_allclose(kernel_components(1e-7 * modes, seed=3), 1e-7 * found, rtol=1e-6, atol=1e-16)
