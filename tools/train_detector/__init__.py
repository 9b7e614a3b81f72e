"""Makes, trains, evaluates and exports the detector that ships: `python -m tools.train_detector`."""

import vergence_sim  # noqa: F401 - chooses MuJoCo's way to render, before anything imports MuJoCo
