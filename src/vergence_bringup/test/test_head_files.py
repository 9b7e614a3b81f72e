"""The shipped URDF and MJCF are those of the built-in rig, and both turn as its kinematics do."""

from pathlib import Path

import numpy as np
import pytest

from vergence_rig.head_mjcf import head_mjcf
from vergence_rig.head_urdf import head_urdf
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, default_rig

PACKAGE = Path(__file__).resolve().parent.parent
MJCF = PACKAGE / "mjcf" / "vergence_head.xml"


def test_the_files_are_up_to_date():
    # python tools/write_head_files.py writes them.
    assert (PACKAGE / "urdf" / "vergence_head.urdf").read_text(encoding="utf-8") == head_urdf(default_rig())
    assert MJCF.read_text(encoding="utf-8") == head_mjcf(default_rig())


def test_mujoco_turns_the_cameras_of_the_file_as_the_kinematics_do():
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(MJCF))
    data, angles = mujoco.MjData(model), (0.31, -0.12, -0.22)
    for name, angle in zip(JOINT_NAMES, angles, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    kinematics = Kinematics(default_rig())
    for eye, pan in zip(("left", "right"), angles, strict=False):
        camera = model.camera(eye).id
        assert data.cam_xpos[camera] == pytest.approx(kinematics.lens(eye == "left", pan, angles[2]))
        # MuJoCo's cameras have x right, y up and look along -z.
        rotation = data.cam_xmat[camera].reshape(3, 3) * (1.0, -1.0, -1.0)
        assert rotation == pytest.approx(kinematics.rotation_rig_from_optical(pan, angles[2]), abs=1e-9)
        field = 2 * np.degrees(np.arctan(240 / 539))
        assert model.cam_fovy[camera] == pytest.approx(field)
