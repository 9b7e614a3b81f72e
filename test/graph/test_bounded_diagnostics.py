"""However much a report says, its message stays small, and can be sent."""

from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from vergence_common.diagnostics import LONGEST_MESSAGE, LONGEST_VALUE, MOST_VALUES, OK, Diagnostics, Report

pytestmark = pytest.mark.graph

TEXTS = st.text(max_size=30).flatmap(lambda text: st.sampled_from([text, text * 1000]))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    message=TEXTS, values=st.dictionaries(TEXTS, TEXTS | st.floats() | st.integers(), max_size=6), many=st.booleans()
)
def test_a_status_is_bounded(message: str, values: dict[str, object], many: bool, graph: Any) -> None:
    given = values | ({str(i): i for i in range(5000)} if many else {})
    diagnostics = Diagnostics(graph.client)
    diagnostics.add("test", lambda: Report(OK, message, given))
    diagnostics.publish()
    array = deserialize_message(serialize_message(diagnostics._message), DiagnosticArray)
    (status,) = array.status
    assert len(status.message) <= 2 * LONGEST_MESSAGE
    assert len(status.values) <= MOST_VALUES
    assert all(len(entry.key) + len(entry.value) <= 4 * LONGEST_VALUE for entry in status.values)
    graph.client.destroy_publisher(diagnostics._publisher)
    graph.client.destroy_timer(diagnostics._timer)
