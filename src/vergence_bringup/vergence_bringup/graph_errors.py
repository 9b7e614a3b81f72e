"""Failures of a running graph of nodes."""


class ProcessError(ValueError):
    """A node cannot be started, or its process has ended unexpectedly."""


class GraphError(RuntimeError):
    """A running graph did not answer in time, or refused a request."""
