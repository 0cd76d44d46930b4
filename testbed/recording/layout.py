"""The layout a recording opens with: turntable and fluid on the left, rates, errors and diagnostics on the right."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import rerun.blueprint as rrb

from testbed.recording.channel import HEIGHT, WIDTH
from testbed.recording.plots import BESIDE, LEGEND, at_cursor, errors_in_row, plot
from testbed.recording.stream import TIMELINE
from testbed.recording.target import ENTITY as TARGET
from testbed.recording.target import HALF
from testbed.recording.world import rotor_extent

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import mujoco

    from testbed.recording.plots import Extremes
    from testbed.recording.stream import Clock
    from testbed.units import RateUnit

ZOOM = 0.05  # s on each side of the time cursor
LATELY = 2.0  # s before the time cursor while a run is watched
SHOWN = 0.5  # s of the window recorded sample by sample
FEWEST = 1000  # samples in both, at the least
LOG = "log10_"
# Points of the screen: what plots share in a window of 900, what a plot needs beside its legend, and a name in that.
ROOM, FRAME, ENTRY = 834, 88, 23
DIAGNOSTICS = {  # prefix of the name: name of the tab, short, since all share a row; quantity and unit of the plot
    # The viewer has no logarithmic axis: what spans decades is recorded as its logarithm too. {} is the unit of a rate.
    f"{LOG}R_": ("R", "Adapted R", "log10 of ({})²"),
    f"{LOG}N_": ("N", "Noise statistic N", "log10 of ({})²"),
    f"{LOG}Q_": ("Q", "Process noise Q", "log10 of ({})²"),
    "gated_": ("Gated", "Gated readings", "counted"),
    "R_": ("R", "Adapted R", "({})²"),
    "N_": ("N", "Noise statistic N", "({})²"),
    "frequency_": ("Frequency", "Frequency that is seen", "Hz"),
    "band_": ("Band", "Band: 0 low, 1 mid, 2 high", "-"),
    "innovation_": ("Innovation", "Innovation", "{}"),
    f"{LOG}innovation_variance_": ("Its variance", "Innovation variance", "log10 of ({})²"),
    "innovation_variance_": ("Its variance", "Innovation variance", "({})²"),
    "S_": ("S", "Factor S of R", "-"),
    "Q_": ("Q", "Process noise Q", "({})²"),
    "std": ("Claimed std", "Claimed std", "{}"),
    "": ("Other", "", ""),
}


# Kinds whose scale is set by the start too: what is counted, and logarithms.
UNSETTLED = frozenset(kind for kind in DIAGNOSTICS if kind.startswith((LOG, "gated_", "band_")))
# What a row of plots is about, its views, which are tabs, and how many lines the first of them names.
Row = tuple[str, "list[rrb.View | rrb.Container]", int]


def blueprint(
    *,
    entities: Mapping[str, Extremes],
    sensors: Sequence[str],
    filters: Sequence[str],
    channels: Sequence[str],
    model: mujoco.MjModel | None,
    clock: Clock,
    unit: RateUnit,
    marks: Sequence[str] = (),
    live: bool = False,
) -> rrb.Blueprint:
    """Return the layout for the signals that the recording has.

    Parameters
    ----------
    entities : mapping of str to tuple of float or None
        Paths of the scalar signals that are to be seen, with their extremes after settle as far as these are known.
    sensors, filters, channels : sequence of str
        Names of the sensors, of the filters and of the sensors that have a velocity profile.
    model : mujoco.MjModel, optional
        The bodies, for the place of the camera; a recording that is replayed has none.
    clock : Clock
        Length of the run and the window recorded sample by sample.
    unit : str
        Of every rate.
    marks : sequence of str, optional
        Paths of the crosses of readings that were struck out.
    live : bool, optional
        Whether the time cursor follows what comes in; else it stands.
    """
    window, duration = clock.detail, clock.n_time / clock.sample_rate_hz
    rates = ["/commanded/rate", *(f"/sensors/{n}/rate" for n in sensors), "/truth/rate"]
    rates = [rate for rate in rates if rate in entities] + [f"/fusion/{n}/rate" for n in filters]
    truth_and_filters = [rate for rate in rates if rate.startswith(("/truth", "/fusion"))]
    estimated = "Truth and estimates" if "/truth/rate" in rates else "Estimates"
    least = FEWEST / clock.sample_rate_hz
    zoom, around = (window[0], min(window[0] + max(SHOWN, least), duration)), max(ZOOM, 0.5 * least)
    span = f"every sample from {zoom[0]:g} to {zoom[1]:g} s"
    left: list[rrb.View | rrb.Container] = [] if model is None else [_turntable(model)]
    if channels:
        probes = [(f"At three heights, {n} [{unit}]", [f"/sensors/{n}/channel/velocity"]) for n in channels]
        left.append(_tabs([*map(_profile, channels), *(plot(*probe, zoom) for probe in probes)]))
    closer = [
        plot(f"Rate, {span} [{unit}]", [*rates, *marks], zoom),
        plot(f"{estimated} [{unit}]", truth_and_filters, (0.0, duration)),
    ]
    if live:
        # Who looks on sees what comes in: in front stands what moves with it. Around the cursor there is nothing yet.
        closer.insert(0, at_cursor(f"Rate, the last {LATELY:g} s [{unit}]", [*rates, *marks], (-LATELY, 0.0)))
    else:
        at = at_cursor(f"Rate ±{_short(around)} at the cursor [{unit}]", [*rates, *marks], (-around, around))
        closer.insert(1, at)
    right: list[Row] = [
        ("Rates", [plot(f"Rate, whole run [{unit}]", rates, (0.0, duration))], len(rates)),
        ("Rates, closer", closer, len(rates) + len(marks)),
    ]
    views: list[rrb.View | rrb.Container]
    errors = {entity: entities[entity] for entity in entities if re.fullmatch(r"/fusion/[^/]+/error", entity)}
    if errors:
        views = [
            errors_in_row(f"Error = estimate − truth, {span}", "Error of {}", errors, zoom, unit),
            errors_in_row(f"Error from {window[0]:g} s on", "{}, settled", errors, (window[0], duration), unit),
            errors_in_row("Error, whole run", "{}, whole run", dict.fromkeys(errors), (0.0, duration), unit),
        ]
        right.append(("Errors", views[::-1] if live else views, 3 if len(errors) <= BESIDE else 8))
    if sights := [entity for entity in entities if entity.startswith("/pointing/")]:
        left.append(_target())
        views = [
            plot(f"Pointing error, {span} [µrad]", sights, zoom),
            plot(f"Pointing error from {window[0]:g} s on [µrad]", sights, (window[0], duration)),
        ]
        right.append(("Pointing", views, len(sights)))
    thermometers = [entity for entity in entities if entity.endswith("/temperature")]
    if thermometers:
        drifts = [entity for entity in entities if entity.endswith("/drift")]
        views = [
            plot("Temperature inside [K]", thermometers, (0.0, duration)),
            plot(f"True thermal drift [{unit}]", drifts, (0.0, duration)),
        ]
        right.append(("Temperature", views, len(thermometers)))
    if diagnostics := _diagnostics(entities, sensors):
        views = [_beside(kind, by_sensor, entities, duration, unit) for kind, by_sensor in diagnostics.items()]
        # These plots have titles of their own below the tabs'.
        n_lines = 1 + max(map(len, next(iter(diagnostics.values())).values()))
        right.append(("Inside the filters", views, n_lines))
    shares = {"row_shares": [3, 2, 2][: len(left)]} if len(left) > 1 else {}
    plots = _rows(right)
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(*left, **shares), plots, column_shares=[2, 3]) if left else plots,
        rrb.TimePanel(timeline=TIMELINE, play_state="following" if live else "paused", state="collapsed"),
        collapse_panels=True,
        auto_layout=False,
        auto_views=False,
    )


def _rows(rows: Sequence[Row]) -> rrb.Container:
    """Put the rows under each other, as high as their legends need; where the window is too low for all, the topics
    behind the rates are tabs of one row.
    """
    needs = [FRAME + ENTRY * max(n_lines, 3) for _, _, n_lines in rows]
    if sum(needs) <= ROOM or len(rows) < 4:
        return rrb.Vertical(*(_tabs(views) for _, views, _ in rows), row_shares=needs)
    topics = rrb.Tabs(*(_tabs(views, name) for name, views, _ in rows[2:]), active_tab=0)
    return rrb.Vertical(*(_tabs(views) for _, views, _ in rows[:2]), topics, row_shares=[*needs[:2], max(needs[2:])])


def _tabs(views: Sequence[rrb.View | rrb.Container], name: str | None = None) -> rrb.View | rrb.Container:
    return views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0, name=name)


def _short(seconds: float) -> str:
    return f"{seconds:g} s" if seconds >= 1.0 else f"{1e3 * seconds:g} ms"


def _diagnostics(entities: Iterable[str], sensors: Sequence[str]) -> dict[str, dict[str, list[str]]]:
    """Return by quantity, which is a tab, and sensor the entities of a plot, for sensors differ by orders of magnitude;
    what is there as its logarithm is seen as that.
    """
    groups: dict[str, dict[str, list[str]]] = {kind: {} for kind in DIAGNOSTICS}
    for entity in entities:
        top, _, name, *_ = [*entity.split("/")[1:], ""]
        if top == "fusion" and name not in {"rate", "error"}:
            # The longest prefix decides: innovation_variance_ is no innovation_.
            kind = max((kind for kind in DIAGNOSTICS if name.startswith(kind)), key=len)
            of = name.removeprefix(kind)
            groups[kind].setdefault(of if of in sensors or not kind else "", []).append(entity)
    return {kind: by_sensor for kind, by_sensor in groups.items() if by_sensor and not groups.get(LOG + kind)}


def _beside(
    kind: str,
    contents_of: Mapping[str, Sequence[str]],
    entities: Mapping[str, Extremes],
    duration: float,
    unit: RateUnit,
) -> rrb.Container:
    tab, quantity, dimension = DIAGNOSTICS[kind]
    suffix = f" [{dimension.format(unit)}]" if dimension else ""
    # What has no name of a kind is many quantities, each a tab; sensors stand beside each other.
    n_beside = len(contents_of) if kind else 1
    plots = []
    for of, contents in contents_of.items():
        name = ", ".join(filter(None, (quantity, of))) + suffix
        known = [found for found in map(entities.get, contents) if found is not None and kind not in UNSETTLED]
        # A filter that starts from nothing may be far off at first.
        extremes = (min(low for low, _ in known), max(high for _, high in known)) if known else None
        plots.append(plot(name, contents, (0.0, duration), LEGEND * n_beside, extremes))
    return rrb.Horizontal(*plots, name=tab) if kind else rrb.Tabs(*plots, active_tab=0, name=tab)


def _turntable(model: mujoco.MjModel) -> rrb.Spatial3DView:
    rotor = rotor_extent(model)
    target = np.array([rotor.center[0], rotor.center[1], rotor.top - 0.4 * rotor.radius])
    eye = target + rotor.radius * np.array([2.6, -0.95, 1.9])
    return rrb.Spatial3DView(
        origin="/world",
        name="Turntable",
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0, 0, 1]),
        line_grid=False,
        background=rrb.Background((26, 30, 36)),
    )


def _target() -> rrb.Spatial2DView:
    bounds = rrb.VisualBounds2D(x_range=[-1.3 * HALF, 1.3 * HALF], y_range=[-1.1 * HALF, 1.72 * HALF])
    return rrb.Spatial2DView(origin=TARGET, contents=["$origin/**"], name="Beam on the target", visual_bounds=bounds)


def _profile(sensor: str) -> rrb.Spatial2DView:
    margin = 26.0
    bounds = rrb.VisualBounds2D(
        x_range=[-WIDTH / 2 - margin, WIDTH / 2 + margin], y_range=[-HEIGHT - margin, 1.7 * margin]
    )
    return rrb.Spatial2DView(
        origin=f"/sensors/{sensor}/channel",
        contents=["$origin/profile", "$origin/axes", "$origin/labels"],
        name=f"Fluid velocity profile, {sensor}",
        visual_bounds=bounds,
    )
