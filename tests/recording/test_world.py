from __future__ import annotations

import mujoco
import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from testbed.recording.bodies import disc, draw_bodies
from testbed.recording.stream import Clock, Recording
from testbed.recording.world import DIAL_RANGE, angle_text, dial_scale, nice_ceiling, rotor_extent

EVERY_SHAPE = """
<mujoco>
  <asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body name="rotor" pos="0 0 2">
      <geom name="disc" type="cylinder" size="0.3 0.02" pos="0 0 0.1"/>
      <geom name="post" type="capsule" size="0.1 0.5"/>
      <geom name="ball" type="sphere" size="0.1"/>
      <geom name="egg" type="ellipsoid" size="0.1 0.2 0.05"/>
      <geom name="block" type="box" size="0.1 0.1 0.1"/>
      <geom name="wedge" type="mesh" mesh="wedge" pos="0 0 -3"/>
      <site name="gyro"/>
      <site name="table_axis"/>
    </body>
  </worldbody>
</mujoco>
"""
SHAPE_OF = {
    "ground/floor": "Boxes3D",
    "rotor/disc": "Mesh3D",
    "rotor/post": "Capsules3D",
    "rotor/ball": "Ellipsoids3D",
    "rotor/egg": "Ellipsoids3D",
    "rotor/block": "Boxes3D",
    "rotor/wedge": "Mesh3D",
    "rotor/sites/gyro": "TransformAxes3D",
}


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(EVERY_SHAPE)


def test_every_kind_of_geom_is_drawn_in_the_frame_of_its_body(model, tmp_path):
    stream = rr.RecordingStream("test", send_properties=False)
    stream.save(tmp_path / "bodies.rrd")
    draw_bodies(Recording(stream, Clock(20e3, 1, (0.0, 0.0))), model, {"gyro": "#102030"}, 0.1)
    stream.disconnect()
    found = {}
    for chunk in RrdReader(tmp_path / "bodies.rrd").stream():
        kinds = {name.split(":")[0] for name in chunk.to_record_batch().schema.names if ":" in name}
        found.setdefault(chunk.entity_path, set()).update(kinds)
    for entity, shape in SHAPE_OF.items():
        assert {shape, "Transform3D"} <= found[f"/world/{entity}"], entity
    assert "/world/rotor/sites/table_axis" not in found, "a site that is no sensor"


def test_disc_is_closed_round_and_its_normals_point_out():
    mesh = disc(0.3, 0.02, np.array([1, 2, 3, 255], np.uint8))
    vertices = np.array(mesh.vertex_positions.as_arrow_array().to_pylist())
    normals = np.array(mesh.vertex_normals.as_arrow_array().to_pylist())
    corners = vertices[np.array(mesh.triangle_indices.as_arrow_array().to_pylist())]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A closed surface has no net area; its volume by the divergence theorem is that of the 128-sided prism.
    np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-7)
    volume = (areas * corners.mean(axis=1)).sum() / 3
    np.testing.assert_allclose(volume, 64 * np.sin(2 * np.pi / 128) * 0.3**2 * 0.04, rtol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-6)
    # The centre is inside, so every normal of a vertex has a part along the vertex.
    assert np.all((normals * vertices).sum(axis=1) > 0)


def test_extent_is_that_of_the_widest_part(model):
    extent = rotor_extent(model)
    # The mesh is centred by the compiler; the tetrahedron reaches 0.75 from its centroid along x and y.
    assert extent.center.tolist() == [0.0, 0.0, 2.0]
    assert extent.radius > 0.3
    only_disc = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="rotor" pos="0 0 2">'
        '<geom type="cylinder" size="0.3 0.02" pos="0 0 0.1"/><geom size="0.1" pos="0 0 0.2"/>'
        "</body></worldbody></mujoco>"
    )
    extent = rotor_extent(only_disc)
    assert extent.radius == pytest.approx(0.3)
    assert extent.top == pytest.approx(2.12)


@pytest.mark.property
@given(st.floats(0.0, 1e4))
def test_needle_stays_on_a_dial_that_holds_the_largest_angle(largest):
    full, factor = dial_scale(largest)
    assert factor >= 1.0
    assert full * factor <= DIAL_RANGE * (1 + 1e-12)
    assert full >= largest * (1 - 1e-12) or factor == 1.0
    # Magnified as far as steps of 1, 2, 5 allow: at least 40 % of the range is used (and 1 urad at the least).
    assert full * factor >= 0.4 * DIAL_RANGE


@pytest.mark.property
@given(st.floats(1e-12, 1e12))
def test_nice_ceiling_is_a_close_upper_bound(value):
    # The widest gap between neighbours is 1.5 to 2 and 3 to 4, a factor 4/3.
    assert value * (1 - 1e-12) <= nice_ceiling(value) <= value * 4 / 3 * (1 + 1e-12)


@pytest.mark.parametrize(
    ("angle", "text"),
    [(0.0, "0"), (np.radians(-30), "-30°"), (0.005, "+5 mrad"), (-1e-4, "-0.1 mrad"), (2e-5, "+20 µrad")],
)
def test_angles_are_written_in_the_unit_that_suits_them(angle, text):
    assert angle_text(angle) == text
