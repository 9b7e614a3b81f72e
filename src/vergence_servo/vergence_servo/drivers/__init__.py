"""Servo backends: one file each behind the protocol in `protocol.py`; `registry.py` opens them by name."""
