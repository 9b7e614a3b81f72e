"""Imported before any test: vergence_sim chooses how MuJoCo renders, and has to before MuJoCo is imported."""

import vergence_sim

__all__ = ["vergence_sim"]
