"""The geoms and sites of a MuJoCo model as static Rerun shapes under their bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
import rerun as rr

from testbed.pages.palette import rgb

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from testbed.recording.stream import Recording
    from testbed.signals import FloatArray

N_FACETS = 128


def draw_bodies(recording: Recording, model: mujoco.MjModel, colors: Mapping[str, str], scale: float) -> None:
    """Draw every geom in the frame of its body, and give each sensor its colour, its axes and a label.

    Parameters
    ----------
    recording : Recording
        Where it goes.
    model : mujoco.MjModel
        The bodies.
    colors : mapping of str to str
        Colour of each sensor; a geom or a site of that name belongs to it.
    scale : float
        Size that axes and labels are a fraction of [m].
    """
    for geom in range(model.ngeom):
        _draw_geom(recording, model, geom, colors)
    sites = [site for site in range(model.nsite) if model.site(site).name in colors]
    for number, site in enumerate(sites):
        _draw_sensor(recording, model, site, colors[model.site(site).name], scale, number)


def _draw_geom(recording: Recording, model: mujoco.MjModel, geom: int, colors: Mapping[str, str]) -> None:
    body = model.body(int(model.geom_bodyid[geom])).name
    name = model.geom(geom).name or f"geom_{geom}"
    # The frame of the world itself is /world, where the moving bodies are.
    entity = f"/world/{body}/{name}" if body != "world" else f"/world/ground/{name}"
    half = model.geom_size[geom]
    color = (np.array(model.geom_rgba[geom]) * 255).astype(np.uint8)
    if name in colors:
        color[:3] = rgb(colors[name])
    kind = int(model.geom_type[geom])  # comparing the numpy integer itself with the enum is one-sided
    if kind == int(mujoco.mjtGeom.mjGEOM_CYLINDER):
        shape: rr.AsComponents = disc(float(half[0]), float(half[1]), color)
    elif kind == int(mujoco.mjtGeom.mjGEOM_MESH):
        shape = _mesh(model, int(model.geom_dataid[geom]), color)
    elif kind in {int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)}:
        axes = half if kind == int(mujoco.mjtGeom.mjGEOM_ELLIPSOID) else np.full(3, half[0])
        shape = rr.Ellipsoids3D(half_sizes=[axes], colors=color, fill_mode="solid")
    elif kind == int(mujoco.mjtGeom.mjGEOM_CAPSULE):
        ends = [[0, 0, -half[1]]]
        shape = rr.Capsules3D(lengths=2 * half[1], radii=half[0], translations=ends, colors=color, fill_mode="solid")
    elif kind == int(mujoco.mjtGeom.mjGEOM_PLANE):
        size = [*np.where(half[:2] > 0, half[:2], model.stat.extent), 1e-4]
        shape = rr.Boxes3D(half_sizes=[size], colors=color, fill_mode="solid")
    else:
        shape = rr.Boxes3D(half_sizes=[half], colors=color, fill_mode="solid")
    recording.static(entity, _pose(model.geom_pos[geom], model.geom_quat[geom]), shape)


def _draw_sensor(recording: Recording, model: mujoco.MjModel, site: int, color: str, scale: float, number: int) -> None:
    name = model.site(site).name
    entity = f"/world/{model.body(int(model.site_bodyid[site])).name}/sites/{name}"
    recording.static(entity, _pose(model.site_pos[site], model.site_quat[site]), rr.TransformAxes3D(0.3 * scale))
    # Sensors may sit on top of each other: their labels stand around the axis, each on a leader.
    angle = np.radians(65.0 + 180.0 * number)
    place = scale * np.array([0.75 * np.cos(angle), 0.75 * np.sin(angle), 0.6])
    foot = scale * np.array([0, 0, 0.07 + 0.1 * (number == 0)])
    recording.static(
        f"{entity}/leader", rr.LineStrips3D([[foot, place]], colors=rgb(color), radii=rr.Radius.ui_points(1))
    )
    label = rr.Points3D([place], labels=name, colors=rgb(color), radii=1e-4, show_labels=True)
    recording.static(f"{entity}/label", label)


def _pose(position: FloatArray, quaternion: FloatArray) -> rr.Transform3D:
    return rr.Transform3D(translation=position, quaternion=quaternion[[1, 2, 3, 0]])


def disc(radius: float, half_height: float, color: NDArray[np.uint8]) -> rr.Mesh3D:
    """Return a cylinder about z with normals, so that it is shaded and round; `rr.Cylinders3D` shows facets.

    Parameters
    ----------
    radius, half_height : float
        Size [m].
    color : ndarray of uint8, shape (4,)
        RGBA.
    """
    angle = np.linspace(0, 2 * np.pi, N_FACETS, endpoint=False)
    outward = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(N_FACETS)))
    up = np.array([0.0, 0.0, 1.0])
    rings = [radius * outward - half_height * up, radius * outward + half_height * up]
    vertices = np.concatenate([*rings, *rings])
    normals = np.concatenate([outward, outward, np.tile(-up, (N_FACETS, 1)), np.tile(up, (N_FACETS, 1))])
    here = np.arange(N_FACETS)
    there = (here + 1) % N_FACETS
    fan = np.column_stack((np.zeros(N_FACETS - 2, int), here[1:-1], there[1:-1]))
    triangles = np.concatenate(
        [
            np.column_stack((here, there, here + N_FACETS)),
            np.column_stack((there, there + N_FACETS, here + N_FACETS)),
            fan[:, [0, 2, 1]] + 2 * N_FACETS,
            fan + 3 * N_FACETS,
        ]
    )
    return rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, vertex_normals=normals, albedo_factor=color)


def _mesh(model: mujoco.MjModel, mesh: int, color: NDArray[np.uint8]) -> rr.Mesh3D:
    vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    return rr.Mesh3D(
        vertex_positions=model.mesh_vert[vertices], triangle_indices=model.mesh_face[faces], albedo_factor=color
    )
