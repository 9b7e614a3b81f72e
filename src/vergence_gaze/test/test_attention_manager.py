"""What attention looks at: classes in order, dwell times, glances and policies. No head and no controller."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.attention.manager import AttentionManager, Focus
from vergence_gaze.attention_parameters import POLICIES, AttentionParameters
from vergence_gaze.estimation.observations import BoxSighting, DetectedObject
from vergence_rig.parameters import ParameterError

PERIOD_S = 0.1
P = AttentionParameters(classes=("face", "cube", "motion"), glance_every_s=4.0)


def boxes(stamp_s, objects, target_id=0):
    """What the detector sees: (id, class) of every object, and which it has chosen."""
    direction = 0.0 if target_id else math.nan
    seen = tuple(DetectedObject(number, name) for number, name in objects)
    name = next((name for number, name in objects if number == target_id), "")
    return BoxSighting(
        stamp_s, 0.0, direction, 0.0, direction, 0.0, math.nan, 0.002, 0.1, name, bool(target_id), object_id=target_id,
        objects=seen,
    )  # fmt: skip


class Room:
    """An attention manager, and a detector that measures what it is asked for."""

    def __init__(self, parameters=P):
        self.manager, self.time_s = AttentionManager(parameters), 10.0
        self.target_id = 0
        self.changes = []

    def see(self, *objects, for_s=PERIOD_S, verged=True):
        """See these objects for a time; returns the focus in the end."""
        for _ in range(round(for_s / PERIOD_S)):
            focus = self.manager.focus
            if focus is not None and focus.object_id:
                self.target_id = focus.object_id
            elif focus is not None:
                fitting = [number for number, name in objects if name == focus.class_name]
                if self.target_id not in fitting:
                    self.target_id = fitting[0] if fitting else 0
            if self.target_id not in [number for number, _ in objects]:
                self.target_id = 0
            self.time_s += PERIOD_S
            self.manager.observe(boxes(self.time_s, objects, self.target_id), self.time_s)
            if self.manager.update(self.time_s, verged and bool(self.target_id)):
                self.changes.append(self.manager.focus)
        return self.manager.focus


def looked_at(room):
    return [None if focus is None else (focus.class_name, focus.object_id) for focus in room.changes]


def test_the_most_interesting_class_in_view_is_looked_at():
    room = Room()
    assert room.see((1, "cube"), (2, "face"), (3, "chair"), for_s=0.5).class_name == "face"
    assert room.manager.describe() == "social: the most interesting class in view is face"


def test_what_is_in_no_list_is_never_looked_at():
    room = Room()
    assert room.see((3, "chair"), for_s=5.0) is None
    assert "scanning the room" in room.manager.describe()


def test_what_is_seen_for_a_moment_only_is_not_looked_at():
    room = Room()
    assert room.see((1, "face"), for_s=0.2) is None
    assert room.see(for_s=2.0) is None


def test_a_more_interesting_class_takes_over_after_the_least_dwell():
    room = Room()
    room.see((1, "cube"), for_s=0.6)
    assert room.see((1, "cube"), (2, "face"), for_s=0.4).class_name == "cube"
    assert room.see((1, "cube"), (2, "face"), for_s=P.min_dwell_s).class_name == "face"
    assert room.see((1, "cube"), (2, "face"), for_s=3.0).class_name == "face"


def test_what_is_gone_is_given_up_after_a_time_for_the_next_or_for_nothing():
    room = Room()
    room.see((1, "face"), (2, "cube"), for_s=0.5)
    assert room.see((2, "cube"), for_s=P.gone_after_s - 0.2).class_name == "face"
    assert room.see((2, "cube"), for_s=0.5).class_name == "cube"
    assert room.see(for_s=P.gone_after_s - 0.2).class_name == "cube"
    assert room.see(for_s=0.5) is None


def test_a_glance_and_back_to_the_same_one():
    room = Room()
    room.see((1, "face"), (2, "face"), for_s=P.glance_every_s + 0.7)
    assert looked_at(room) == [("face", 0), ("face", 2)]
    room.see((1, "face"), (2, "face"), for_s=P.glance_s + 0.2)
    assert looked_at(room)[2:] == [("face", 1)]
    assert "back from a glance" in room.manager.describe()
    room.see((1, "face"), (2, "face"), for_s=P.min_dwell_s + 0.1)
    assert looked_at(room)[3:] == [("face", 0)]
    assert room.target_id == 1


def test_glances_go_to_each_in_turn():
    room = Room()
    room.see((1, "face"), (2, "face"), (3, "cube"), for_s=40.0)
    glances = [number for name, number in looked_at(room) if number not in (0, 1)]
    assert glances[:4] in ([2, 3, 2, 3], [3, 2, 3, 2])


def test_a_glance_at_what_goes_away_ends_at_once_and_one_that_never_arrives_ends_too():
    room = Room()
    room.see((1, "face"), (2, "face"), for_s=P.glance_every_s + 0.7)
    room.see((1, "face"), for_s=P.gone_after_s + 0.2)
    assert looked_at(room)[-1] == ("face", 1)
    room = Room()
    room.see((1, "face"), (2, "face"), for_s=P.glance_every_s + 0.7)
    room.see((1, "face"), (2, "face"), for_s=3.0, verged=False)
    assert looked_at(room)[-2:] == [("face", 1), ("face", 0)]


def test_no_glance_while_the_eyes_are_not_verged_or_nothing_else_is_there():
    busy, alone = Room(), Room()
    busy.see((1, "face"), (2, "face"), for_s=10.0, verged=False)
    alone.see((1, "face"), for_s=10.0)
    assert looked_at(busy) == looked_at(alone) == [("face", 0)]


def test_focused_keeps_to_one_object_whatever_comes():
    room = Room()
    room.manager.set_policy("focused")
    room.see((1, "cube"), for_s=1.0)
    assert room.see((1, "cube"), (2, "face"), (3, "cube"), for_s=30.0) == room.changes[0]
    assert looked_at(room) == [("cube", 0)]


@pytest.mark.parametrize("policy", ["disabled", "random"])
def test_these_policies_look_at_no_object(policy):
    room = Room()
    room.manager.set_policy(policy)
    assert room.see((1, "face"), for_s=3.0) is None
    assert room.manager.describe().startswith(policy)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(POLICIES),
    st.lists(
        st.tuples(
            st.lists(st.tuples(st.integers(1, 4), st.sampled_from(["face", "cube", "motion", "chair"])), max_size=4),
            st.floats(0.1, 3.0),
            st.booleans(),
        ),
        max_size=25,
    ),
)
def test_whatever_is_seen_a_focus_is_of_a_listed_class_and_lasts_its_dwell(policy, scenes):
    room = Room()
    room.manager.set_policy(policy)
    last_s, last = -math.inf, None
    for objects, for_s, verged in scenes:
        by_id = dict(objects)
        for _ in range(round(for_s / PERIOD_S)):
            room.see(*by_id.items(), verged=verged)
            focus = room.manager.focus
            if focus == last:
                continue
            assert focus is None or focus.class_name in P.classes
            # One object is left for another at the earliest when its time has passed, or when it is gone.
            held_s = room.time_s - last_s
            if last is not None and focus is not None and held_s < min(P.min_dwell_s, P.glance_s) - 1e-6:
                assert isinstance(last, Focus)
                assert last.class_name not in by_id.values() or last.object_id not in by_id
            last_s, last = room.time_s, focus


def test_classes_must_differ():
    with pytest.raises(ParameterError, match="different names"):
        AttentionParameters(classes=("face", "face"))
