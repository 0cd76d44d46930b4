"""Figures: no extreme is lost, what is drawn is what was measured, and the text is a legible, harmless SVG."""

from __future__ import annotations

import itertools
import re
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_rgb
from numpy.testing import assert_allclose

from testbed.pages.envelope import Envelope
from testbed.pages.palette import series_colors
from testbed.pages.svg import svg_text
from testbed.report.digest import Digest, ErrorTrace, RateTrace
from testbed.report.figures import errors_figure, rates_figure, spectrum_figure
from testbed.runs.metrics import FloorDensity

FS = 1000.0


def envelope_of(values: np.ndarray, start: int = 0, stop: int | None = None, n_bins: int = 50) -> Envelope:
    envelope = Envelope(start, values.size if stop is None else stop, FS, n_bins)
    envelope.process(0, values)
    return envelope


def make_digest(
    sensors: list[str], errors: dict[str, np.ndarray], std: float = 0.01, lines: tuple[float, ...] = (5.0,)
) -> Digest:
    n = 2000
    truth = np.sin(2 * np.pi * 5 * np.arange(n) / FS)
    freq_hz = np.geomspace(1.0, 500.0, 60)

    def rate(values: np.ndarray) -> RateTrace:
        return RateTrace(envelope_of(values), envelope_of(values, 1000, 1401), envelope_of(values))

    def error(values: np.ndarray, band: float | None) -> ErrorTrace:
        bands = None if band is None else envelope_of(np.full(n, band))
        return ErrorTrace(envelope_of(values), bands, None if band is None else 0.9, freq_hz, np.full(60, 1e-6), 3)

    rates = {"commanded": rate(truth), "truth": rate(truth)}
    rates |= {f"sensors/{name}": rate(0.5 * truth) for name in sensors}
    rates |= {f"fusion/{name}": rate(truth + values) for name, values in errors.items()}
    return Digest(
        2.0, 1.0, (1.0, 1.4), list(lines), rates,
        {name: error(0.5 * truth, None) for name in sensors},
        {name: error(values, std) for name, values in errors.items()},
    )  # fmt: skip


def colors_of(digest: Digest) -> dict[str, str]:
    return series_colors(list(digest.sensor_errors), list(digest.filter_errors))


@pytest.fixture
def digest() -> Digest:
    rng = np.random.default_rng(1)
    return make_digest(
        ["mhd_ars", "mems_gyro"],
        {"kalman": 0.01 * rng.standard_normal(2000), "shakf": 0.012 * rng.standard_normal(2000)},
    )


@pytest.mark.property
@settings(deadline=None, max_examples=60)
@given(st.data())
def test_envelope_keeps_extremes_for_any_division(data: st.DataObject):
    n = data.draw(st.integers(1, 300))
    n_bins = data.draw(st.integers(1, 60))
    start = data.draw(st.integers(0, n - 1))
    stop = data.draw(st.integers(start + 1, n))
    cuts = sorted(data.draw(st.sets(st.integers(1, n), max_size=6)) - {n})
    values = np.random.default_rng(n).standard_normal(n)
    envelope = Envelope(start, stop, FS, n_bins)
    for first, last in zip([0, *cuts], [*cuts, n], strict=True):
        envelope.process(first, values[first:last])
    # Sample k belongs to the last bin whose edge floor(j m / n_bins) is not above k - start.
    m, bins = stop - start, min(n_bins, stop - start)
    edges = [start + j * m // bins for j in range(bins + 1)]
    assert_allclose(envelope.low, [values[a:b].min() for a, b in itertools.pairwise(edges)], rtol=0)
    assert_allclose(envelope.high, [values[a:b].max() for a, b in itertools.pairwise(edges)], rtol=0)
    assert start / FS <= envelope.time[0] <= envelope.time[-1] <= (stop - 1) / FS


def test_envelope_of_few_samples_is_the_signal():
    values = np.array([3.0, 1.0, 2.0])
    envelope = envelope_of(values, n_bins=100)
    assert np.array_equal(envelope.low, values)
    assert np.array_equal(envelope.high, values)
    assert_allclose(envelope.time, [0.0, 0.001, 0.002], rtol=1e-15)


def test_envelope_spike_is_drawn(digest: Digest):
    error = np.zeros(2000)
    error[1234] = 0.5
    figure = errors_figure(make_digest([], {"kalman": error}), {"fusion/kalman": "#2f9e58"})
    vertices = figure.axes[0].collections[0].get_paths()[0].vertices
    # One bin is 40 samples: the spike stands at its middle, within 20 samples.
    peak = vertices[np.argmax(vertices[:, 1])]
    assert_allclose(peak, [1.234, np.degrees(0.5)], atol=0.0201)


def test_errors_figure_scale_is_set_after_settle_and_start_up_is_said():
    error = np.where(np.arange(2000) < 100, 1.0, 0.001)
    figure = errors_figure(make_digest([], {"kalman": error}, std=1e-5), {"fusion/kalman": "#2f9e58"})
    axes = figure.axes[0]
    assert_allclose(axes.get_ylim(), np.degrees([-0.00115, 0.00115]), rtol=1e-12)
    assert "start-up reaches 57 deg/s" in axes.get_title(loc="left")
    assert "90.0 % of the samples inside ±2 std" in axes.get_title(loc="left")


def test_errors_figure_shares_the_scale_of_like_errors_only():
    errors = {"a": np.full(2000, 0.001), "b": np.full(2000, 0.7), "c": np.full(2000, 0.002)}
    axes = errors_figure(
        make_digest([], errors, std=1e-6), dict.fromkeys(["fusion/a", "fusion/b", "fusion/c"], "#2f9e58")
    ).axes
    assert axes[0].get_ylim() == axes[2].get_ylim()
    assert axes[1].get_ylim()[1] > 100 * axes[0].get_ylim()[1]


def test_errors_figure_band_is_two_std(digest: Digest):
    lower, upper = errors_figure(digest, colors_of(digest)).axes[0].lines
    assert_allclose(upper.get_ydata(), np.degrees(0.02), rtol=1e-12)
    assert_allclose(lower.get_ydata(), np.degrees(-0.02), rtol=1e-12)


def test_errors_figure_of_an_exact_filter_draws():
    svg_text(errors_figure(make_digest([], {"kalman": np.zeros(2000)}, std=0.0), {"fusion/kalman": "#2f9e58"}), "x")


def test_rates_figure_axes_have_units_and_the_zoom(digest: Digest):
    above, sensors, below = rates_figure(digest, colors_of(digest)).axes
    assert sensors.get_xlim() == below.get_xlim()
    assert above.get_xlim() == (0.0, 2.0)
    assert below.get_xlim() == (1.0, 1.4)
    assert above.get_ylabel() == below.get_ylabel() == "rate [deg/s]"
    assert below.get_xlabel() == "time [s]"
    labels = [text.get_text() for text in below.figure.legends[0].get_texts()]
    assert labels == ["truth", "mhd_ars", "mems_gyro", "kalman", "shakf", "commanded"]


def test_spectrum_figure_root_density_lines_and_floor(digest: Digest):
    floor = FloorDensity(frequency_hz=[1.0, 500.0], density=[1e-5, 1e-5])
    axes = spectrum_figure(digest, colors_of(digest), floor).axes[0]
    drawn = {line.get_label(): line for line in axes.lines}
    # sqrt(1e-6 rad^2/s^2/Hz) = 1e-3 rad/s/sqrt(Hz) in deg.
    assert_allclose(drawn["kalman"].get_ydata(), np.degrees(1e-3), rtol=1e-12)
    assert_allclose(drawn["noise floor"].get_ydata(), 1e-5, rtol=0)
    marks = [line for line in axes.lines if list(line.get_xdata()) == [5.0, 5.0]]
    assert len(marks) == 1
    assert [text.get_text() for text in axes.texts] == ["5 Hz"]
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "noise floor" not in {
        line.get_label() for line in spectrum_figure(digest, colors_of(digest), None).axes[0].lines
    }


def test_spectrum_figure_many_lines_are_marked_without_labels():
    digest = make_digest([], {"kalman": np.zeros(2000)}, lines=tuple(np.arange(2.0, 40.0, 2.0)))
    axes = spectrum_figure(digest, colors_of(digest), None).axes[0]
    assert len(axes.lines) == 1 + 19
    assert not axes.texts


def test_legend_stands_clear_of_the_data(digest: Digest):
    long = {f"a_rather_long_filter_name_{i}": 0.01 * np.ones(2000) for i in range(5)}
    for case in (digest, make_digest(["mhd_ars"], long)):
        colors = colors_of(case)
        for figure in (rates_figure(case, colors), errors_figure(case, colors), spectrum_figure(case, colors, None)):
            figure.draw_without_rendering()
            legend = figure.legends[0].get_window_extent()
            assert legend.x1 <= figure.bbox.x1
            assert all(not legend.overlaps(axes.get_window_extent()) for axes in figure.axes)


def test_svg_text_is_one_harmless_element_in_the_color_of_the_page(digest: Digest):
    svg = svg_text(rates_figure(digest, colors_of(digest)), "rates")
    root = ET.fromstring(svg)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "width" not in root.attrib
    assert root.attrib["viewBox"].startswith("0 0 ")
    assert "currentColor" in svg
    assert not re.search(r"#000000|#010203|<script|<image|<!DOCTYPE|<text|font-family", svg)
    assert all(value.startswith("rates-") for value in re.findall(r'\bid="([^"]+)"', svg))


def test_svg_text_rounds_paths_by_less_than_a_tenth_of_a_point(digest: Digest, monkeypatch: pytest.MonkeyPatch):
    figure = spectrum_figure(digest, colors_of(digest), None)
    short = svg_text(figure, "x")
    monkeypatch.setattr("testbed.pages.svg._shorter", lambda path: path)
    exact = svg_text(figure, "x")

    def coordinates(svg: str) -> np.ndarray:
        return np.array(
            [float(x) for d in re.findall(r'\bd="([^"]*)"', svg) for x in re.findall(r"-?[\d.]+(?:e-?\d+)?", d)]
        )

    # Rounded to one decimal: 0.05, and what matplotlib's own six decimals leave.
    assert_allclose(coordinates(short), coordinates(exact), atol=0.050001, rtol=0)


def test_svg_text_name_with_dollar_signs_is_no_formula():
    digest = make_digest([], {r"$\nonsense$": np.zeros(2000)})
    svg_text(rates_figure(digest, colors_of(digest)), "x")


def test_lines_of_a_group_differ_in_more_than_color(digest: Digest):
    drawn = {line.get_label(): line for line in spectrum_figure(digest, colors_of(digest), None).axes[0].lines}
    assert drawn["kalman"]._dash_pattern != drawn["shakf"]._dash_pattern
    assert to_rgb(drawn["kalman"].get_color()) != to_rgb(drawn["shakf"].get_color())


@pytest.mark.parametrize(
    ("limits", "shown"),
    [
        ((1.3e-5, 8e-5), ["2×10⁻⁵", "5×10⁻⁵"]),  # no power of ten inside: the axis had no number at all
        ((3e-5, 6e-4), ["5×10⁻⁵", "10⁻⁴", "2×10⁻⁴", "5×10⁻⁴"]),  # one way of writing along an axis
        ((0.002, 0.06), ["0.002", "0.005", "0.01", "0.02", "0.05"]),
        ((1e-5, 30.0), ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "10⁰", "10¹"]),
        ((1e-5, 1e-3), ["10⁻⁵", "10⁻⁴", "10⁻³"]),
    ],
)
def test_a_narrow_logarithmic_axis_is_labelled_between_the_powers_of_ten(limits, shown):
    from matplotlib.figure import Figure

    from testbed.pages.decades import decade_axis

    figure = Figure()
    axes = figure.subplots()
    axes.set(yscale="log", ylim=limits)
    decade_axis(axes)
    figure.draw_without_rendering()
    labels = axes.get_yticklabels() + axes.get_yticklabels(minor=True)
    seen = {label.get_position()[1]: label.get_text() for label in labels if label.get_text()}
    assert [seen[y] for y in sorted(seen) if limits[0] * 0.999 <= y <= limits[1] * 1.001] == shown


def test_rates_figure_hides_no_sensor_under_the_truth(digest: Digest):
    """The truth is drawn over the sensors as two dashed edges: what lies beneath shows through."""
    colors = colors_of(digest)
    for axes in rates_figure(digest, colors).axes[:2]:
        assert {mpl.colors.to_hex(patch.get_facecolor()[0]) for patch in axes.collections} == {
            colors["sensors/mhd_ars"],
            colors["sensors/mems_gyro"],
        }
        truth = [line for line in axes.lines if line.get_color() == colors["truth"]]
        assert len(truth) == 2
        assert all(line.get_linestyle() == "--" for line in truth)


def test_figures_are_in_the_unit_that_is_asked_for(digest: Digest):
    colors, slow = colors_of(digest), ("deg/h", 3600.0)
    for draw in (rates_figure, errors_figure):
        plain, scaled = draw(digest, colors).axes[0], draw(digest, colors, slow).axes[0]
        assert "[deg/h]" in scaled.get_ylabel()
        assert_allclose(scaled.get_ylim(), 3600.0 * np.array(plain.get_ylim()), rtol=1e-9)
    spectra = [spectrum_figure(digest, colors, None, unit).axes[0] for unit in (("deg/s", 1.0), slow)]
    assert "[deg/h/√Hz]" in spectra[1].get_ylabel()
    assert_allclose(spectra[1].lines[0].get_ydata(), 3600.0 * spectra[0].lines[0].get_ydata(), rtol=1e-12)
