"""Renders data for, trains, evaluates and exports the detector that ships: `python -m training`."""

import vergence_sim  # noqa: F401 - chooses MuJoCo's way to render, before anything imports MuJoCo
