"""The room as a MuJoCo model: alike with and without textures, free where targets go; truth against pixels."""

import math

import mujoco
import numpy as np
import pytest

from vergence_rig.rig import default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.renderer import RenderError
from vergence_sim.scene import HEAD_HEIGHT_M, build_scene
from vergence_sim.simulator import Simulator, TargetError
from vergence_sim.truth import GroundTruth

IDEAL = SimParameters.ideal({"world.seed": 2, "world.extra_cubes": 2, "world.look_alikes": 4})
SEEN = np.array([1, 1, 1, 0, 0, 0], np.uint8)


FIELDS = (0.8, 0.8)


@pytest.fixture(scope="module")
def seeing():
    try:
        simulator = Simulator(IDEAL)
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    yield simulator
    simulator.close()


def test_an_untextured_room_is_furnished_alike():
    grey, painted = (build_scene(default_rig(), IDEAL, FIELDS, textured) for textured in (False, True))
    assert grey.ntex == 0 < painted.ntex
    assert grey.ngeom == painted.ngeom
    for values in ("geom_pos", "geom_quat", "geom_size", "geom_type", "body_pos"):
        assert np.array_equal(getattr(grey, values), getattr(painted, values)), values


def test_the_same_parameters_share_one_model():
    assert build_scene(default_rig(), IDEAL, FIELDS, False) is build_scene(default_rig(), IDEAL, FIELDS, False)
    other = build_scene(default_rig(), IDEAL.replaced({"world.seed": 3}), FIELDS, False)
    assert not np.array_equal(other.geom_pos[:40], build_scene(default_rig(), IDEAL, FIELDS, False).geom_pos[:40])


@pytest.mark.parametrize("world_seed", range(8))
def test_nothing_stands_where_targets_go(world_seed):
    """From the head to two metres, 35 degrees to the sides and 20 up and down, every ray is free."""
    model = build_scene(default_rig(), SimParameters.ideal({"world.seed": world_seed}), FIELDS, textured=False)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    head, geom = np.array([0.0, 0.0, HEAD_HEIGHT_M]), np.zeros(1, np.int32)
    for azimuth in np.radians(np.linspace(-35, 35, 29)):
        for elevation in np.radians(np.linspace(-20, 20, 17)):
            ray = np.array(
                [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
            )
            distance = mujoco.mj_ray(model, data, head, ray, SEEN, True, -1, geom)
            assert distance > 2.0, f"{model.geom(int(geom[0])).name} is {distance:.2f} m away"


def pixels_of(simulator, eye, name):
    """Return which pixels (h, w) of an eye's ideal view show a body, from MuJoCo's segmentation."""
    renderer = simulator._renderer
    scene = renderer._scene
    before = scene.flags.copy()
    scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
    codes = renderer.render(simulator._data, eye)[:, :, :3].astype(int) @ np.array([1, 256, 65536])
    scene.flags[:] = before
    body = simulator._model.body(name).id
    ids = [
        geom.segid + 1
        for geom in scene.geoms[: scene.ngeom]
        if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and simulator._model.geom_bodyid[geom.objid] == body
    ]
    return np.isin(codes, ids)


@pytest.mark.parametrize(("target", "place"), [("cube", (0.45, 0.05, 0.03)), ("marker", (0.4, -0.04, 0.0))])
def test_boxes_are_those_of_the_segmentation(seeing, target, place):
    seeing.set_head({"pan_left": 0.02, "pan_right": 0.1, "tilt": 0.05})
    seeing.place_target(target, place)
    for eye in ("left", "right"):
        rows, columns = np.nonzero(pixels_of(seeing, eye, target))
        box = next(box for box in seeing.true_boxes(eye) if box.name == target and box.x_max_px - box.x_min_px > 10)
        found = [columns.min(), rows.min(), columns.max(), rows.max()]
        # MuJoCo draws a cylinder as a prism inside it.
        assert found == pytest.approx([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px], abs=1.5)


def test_visible_shares_are_those_of_the_segmentation(seeing):
    seeing.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    seeing.place_target("cube", (0.6, 0.0, 0.0))
    whole = {eye: pixels_of(seeing, eye, "cube").sum() for eye in ("left", "right")}
    seeing.place_object("occluder", (0.4, 0.1, 0.0))
    truth = seeing.truth()
    for eye, share in (("left", truth.left_visible_share), ("right", truth.right_visible_share)):
        assert share == pytest.approx(pixels_of(seeing, eye, "cube").sum() / whole[eye], abs=0.1)
    assert truth.left_visible_share < truth.right_visible_share
    seeing.place_object("occluder", (0.0, 0.0, -5.0))


def test_the_mean_disparity_is_that_of_the_rendered_pixels(seeing):
    """For a cube turned by 40 degrees, from its pixels' own rays: cast each to the cube, project into the other eye."""
    seeing.set_parameters(seeing.parameters.replaced({"target.yaw_rad": 0.7}))
    seeing.set_head({"pan_left": -0.05, "pan_right": 0.06, "tilt": 0.0})
    seeing.place_target("cube", (0.5, 0.0, 0.01))
    truth: GroundTruth = seeing._truth
    disparities = []
    for eye, other in (("left", "right"), ("right", "left")):
        rows, columns = np.nonzero(pixels_of(seeing, eye, "cube"))
        points = truth.surface(eye, "cube", np.column_stack([columns, rows])[::7].astype(float))
        for point in points[truth.sees(other, points)]:
            places = {name: truth.project(name, point)[0] for name in ("left", "right")}
            disparities.append(places["left"] - places["right"])
    assert seeing.truth().mean_disparity_px == pytest.approx(float(np.mean(disparities)), abs=0.5)
    seeing.set_parameters(seeing.parameters.replaced({"target.yaw_rad": 0.0}))


def test_further_cubes_are_cubes_and_can_be_put_anywhere(seeing):
    seeing.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.15})
    seeing.place_target("cube", (0.6, 0.1, 0.0))
    seeing.place_object("cube3", (0.6, -0.1, -0.05))
    boxes = seeing.true_boxes("left")
    assert {box.name for box in boxes} == {"cube"}
    assert len(boxes) == 3
    assert pixels_of(seeing, "left", "cube3").any()
    assert seeing.truth().target_point_m[1] > 0


@pytest.mark.parametrize(
    ("name", "place"), [("cube4", (1, 0, 0)), ("globe", (1, 0, 0)), ("occluder", (1, 0)), ("cube", (math.inf, 0, 0))]
)
def test_an_object_that_cannot_be_put_is_refused(name, place):
    simulator = Simulator(IDEAL, render=False)
    with pytest.raises(TargetError, match="must be"):
        simulator.place_object(name, place)


def test_both_targets_can_be_seen_at_once():
    simulator = Simulator(SimParameters.ideal(), render=False)
    simulator.place_object("marker", (0.6, -0.1, 0.0))
    assert {box.name for box in simulator.true_boxes("left")} == {"cube", "marker"}


@pytest.mark.parametrize("kind", ["four", "die"])
def test_the_distractor_goes_where_it_is_put_and_is_no_target(kind):
    simulator = Simulator(SimParameters.ideal({"world.distractor": kind}), render=False)
    simulator.place_target("cube", (0.8, 0.0, 0.0))
    boxes, truth = simulator.true_boxes("left"), simulator.truth()
    simulator.place_object("distractor", (0.4, -0.1, 0.0))
    assert simulator.true_boxes("left") == boxes
    assert simulator.truth().left_visible_share == truth.left_visible_share
    simulator.place_object("distractor", (0.4, 0.02, 0.0))
    assert simulator.truth().left_visible_share < 0.5 < truth.left_visible_share
    assert simulator.truth().target == "cube"


def test_shapes_left_out_for_being_outside_the_view_change_no_pixel(seeing, monkeypatch):
    seeing.place_target("cube", (0.5, 0.22, 0.1))  # cut by the image's edge
    poses = [
        {"pan_left": pan, "pan_right": pan - 0.1, "tilt": tilt} for pan in (-0.5, 0.0, 0.5) for tilt in (-0.3, 0.0, 0.4)
    ]

    def views():
        for pose in poses:
            seeing.set_head(pose)
            yield from (seeing._renderer._drawn(seeing._data, eye).copy() for eye in ("left", "right"))

    without = list(views())
    shapes_drawn = seeing._renderer._scene.ngeom
    monkeypatch.setattr("vergence_sim.renderer._outside", lambda model, *_: np.zeros(model.ngeom, bool))
    assert all(np.array_equal(some, all_) for some, all_ in zip(without, views(), strict=True))
    assert seeing._renderer._scene.ngeom > shapes_drawn
