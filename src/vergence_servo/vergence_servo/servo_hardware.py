"""The servos of a head with all that drives them safely: drivers, guardians, limits and the pose that is remembered."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from vergence_rig.regular_file import expanded
from vergence_rig.rig import JOINT_NAMES
from vergence_rig.rig_file import load_rig
from vergence_servo.calibration import load_servos, servo_limits
from vergence_servo.driver_set import DriverSet, backends_of
from vergence_servo.drivers.protocol import Backend
from vergence_servo.guardian import Guardians
from vergence_servo.last_pose import default_pose_file, read_pose, write_pose
from vergence_servo.parameters import ServoNodeParameters
from vergence_servo.servo_channel import RetryParameters
from vergence_servo.servo_head import ServoHead


class ServoHardware:
    """Opens the servos of servos.yaml within the limits of rig.yaml; for one thread at a time.

    `head` takes the commands; `step` is to be called at `update_rate_hz`. All times are of `time.monotonic`.
    """

    def __init__(
        self,
        values: ServoNodeParameters,
        retry: RetryParameters,
        driver_values: Callable[[Backend], Mapping[str, Any]] = lambda backend: {},
    ) -> None:
        """Open the drivers and release all servos.

        Args:
            values: files, backend and limits.
            retry: waits before a failed channel is tried again.
            driver_values: parameters of a backend; its defaults if none.

        Raises:
            ServoCalibrationError: an unusable servos.yaml.
            RigError: an unusable rig.yaml.
            DriverUnavailableError: a backend that cannot be opened; nothing stays open then.
        """
        self._values = values
        servos = load_servos(values.servos)
        rig = load_rig(values.rig)
        backends = backends_of(servos, values.joints, values.backend)
        limits = {
            name: servo_limits(name, servos[name], rig.joints[name] if name in JOINT_NAMES else None)
            for name in values.joints
        }
        channels = {name: limit.calibration.channel for name, limit in limits.items()}
        self.drivers = DriverSet(backends, driver_values, channels)
        self.guardians: Guardians | None = None
        try:
            if values.guardian:
                self.guardians = Guardians(self.drivers, channels, values.guardian_timeout_s)
            self.pose_file = expanded(values.pose_file) if values.pose_file else default_pose_file()
            self.pose = read_pose(self.pose_file)
            self.head = ServoHead(self.drivers.by_joint, limits, values, self.pose, time.monotonic(), retry)
        except BaseException:
            self.drivers.close()
            if self.guardians is not None:
                self.guardians.dismiss()
            raise

    @property
    def steps_rad(self) -> dict[str, float]:
        """The smallest step of every joint [rad]."""
        return {
            name: self.head.channels[name].limits.calibration.step_rad(driver.resolution_us)
            for name, driver in self.drivers.by_joint.items()
        }

    def set_parameters(self, values: ServoNodeParameters, retry: RetryParameters) -> None:
        """Use other time-outs and waits from now on."""
        self._values = values
        self.head.set_parameters(values, retry)

    def step(self) -> float:
        """Send what is due; return the pause [s] after which the guardians have released the servos, else 0."""
        now_s = time.monotonic()
        pause_s = 0.0 if self.guardians is None else self.guardians.beat(now_s)
        if pause_s:
            self.head.release(now_s)
        self.head.step(now_s)
        return pause_s

    def save_pose(self) -> None:
        """Remember the pose, if it has changed. Raises OSError."""
        pose = self.head.sent_rad()
        if pose != self.pose:
            self.pose = pose
            write_pose(self.pose_file, pose)

    def park(self) -> None:
        """Go to the parking pose with the servos that get pulses, for `park_time_limit_s` at most."""
        limit_s = self._values.park_time_limit_s
        deadline_s = time.monotonic() + limit_s
        if self.head.pulsing and limit_s > 0:
            self.head.park(time.monotonic(), only_pulsing=True)
            while not self.head.parked and time.monotonic() < deadline_s:
                self.step()
                time.sleep(0.005)

    def close(self) -> None:
        """Release everything and free the hardware."""
        self.head.release(time.monotonic())
        self.drivers.close()
        if self.guardians is not None:
            self.guardians.dismiss()
