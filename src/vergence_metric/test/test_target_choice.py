"""Which of several objects is the target: identities over time, and the policies."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes.association import associate
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.follow_parameters import POLICIES, FollowParameters
from vergence_metric.boxes.object_tracks import ObjectTracks
from vergence_metric.boxes.parameters import AssociationParameters
from vergence_metric.boxes.target_choice import RequestedObject, TargetChoice
from vergence_metric.testing.people_scene import SIZE_PX, PeopleScene, sway, walk
from vergence_rig.geometry import EyeAngles

P = AssociationParameters()
FOLLOW = FollowParameters()
PERIOD_S = 0.1


def box(x, y, width=60.0, height=60.0, score=0.8, class_name="face"):
    xyxy = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
    return Box(xyxy, score, ("face", "cube", "motion").index(class_name), class_name)


class Chooser:
    """Tracks and choice of one graph."""

    def __init__(self, **parameters):
        self.parameters = FollowParameters(**parameters)
        self.tracks = ObjectTracks(self.parameters)
        self.choice = TargetChoice(self.parameters, self.tracks, frozenset({"motion"}))
        self.objects = []

    def see(self, boxes, stamp_s, geometry=None, images=None):
        found = associate(boxes[0], boxes[1], P, geometry=geometry, images=images)
        return self.on(found, stamp_s, images, geometry)

    def on(self, found, stamp_s, images=None, geometry=None):
        self.objects = self.tracks.update(found, stamp_s, images, geometry)
        return self.choice.choose(self.objects, stamp_s, SIZE_PX)


def boxes_at(*columns, **how):
    """The same boxes in both eyes, 20 px apart."""
    left = [box(column, 240.0, **how) for column in columns]
    return left, [box(b.center_px[0] - 20.0, 240.0, **how) for b in left]


# ------------------------------------------------------------------------------------------------- identities


def ids_by_person(scene, times, eyes_at=lambda time_s: None, **parameters):
    """Return for every person the ids that it had, in order of their first use."""
    chooser = Chooser(**parameters)
    had: list[list[int]] = [[] for _ in scene.paths]
    for time_s in times:
        found, images, geometry, whose = scene.look(time_s, eyes_at(time_s))
        chooser.on(found, time_s, images, geometry)
        for one in chooser.objects:
            person = whose[id(one.boxes.shown)]
            if one.object_id not in had[person]:
                had[person].append(one.object_id)
    return had


@pytest.mark.parametrize("seed", range(4))
def test_two_that_cross_keep_their_ids(seed):
    scene = PeopleScene([walk(1.0, -0.4, 0.3), walk(1.5, 0.4, -0.3)], seed)
    assert [len(ids) for ids in ids_by_person(scene, np.arange(0.0, 3.0, PERIOD_S))] == [1, 1]


@pytest.mark.parametrize("seed", range(4))
def test_three_that_cross_keep_their_ids_while_the_eyes_turn(seed):
    scene = PeopleScene([walk(0.8, -0.3, 0.25), walk(1.2, 0.35, -0.3), walk(1.7, 0.1, 0.0)], seed)

    def turning(time_s):
        return EyeAngles(0.1 * math.sin(time_s), 0.1 * math.sin(time_s) + 0.05, 0.02)

    had = ids_by_person(scene, np.arange(0.0, 3.0, PERIOD_S), turning)
    assert [len(ids) for ids in had] == [1, 1, 1]
    assert len({ids[0] for ids in had}) == 3


@settings(deadline=None, max_examples=12)
@given(st.integers(0, 10_000), st.floats(0.05, 0.2), st.floats(3.0, 8.0))
def test_an_id_is_never_given_to_another_person_while_both_are_seen(seed, amplitude_m, period_s):
    scene = PeopleScene([sway(1.1, -0.2, amplitude_m, period_s), sway(1.5, 0.2, amplitude_m, period_s, 2.0)], seed)
    first, second = ids_by_person(scene, np.arange(0.0, 6.0, PERIOD_S))
    assert not set(first) & set(second)


def test_an_id_outlasts_a_gap_and_no_longer():
    chooser = Chooser()
    first = chooser.see(boxes_at(300), 0.0).target.object_id
    assert chooser.see(boxes_at(310), FOLLOW.forget_after_s).target.object_id == first
    assert chooser.see(boxes_at(310), 2 * FOLLOW.forget_after_s + 0.01).target.object_id != first


def test_a_clock_that_runs_back_forgets_all():
    chooser = Chooser()
    first = chooser.see(boxes_at(300), 10.0).target.object_id
    assert chooser.see(boxes_at(300), 1.0).target.object_id != first


def test_it_is_recognised_though_the_eyes_turned():
    scene, chooser = PeopleScene([]), Chooser()
    before = scene.geometry()
    first = chooser.see(([box(419.5, 239.5)], [box(419.5, 239.5)]), 0.0, before).target.object_id
    after = scene.geometry(EyeAngles(-0.2, -0.2, 0.0))
    there = after.pixel(True, before.direction(True, (419.5, 239.5)))
    same, decoy = box(*there), box(419.5, 239.5, score=0.99)
    target = chooser.see(([decoy, same], [box(419.5, 239.5, score=0.99), box(*there)]), 0.1, after).target
    assert target.object_id == first
    assert target.boxes.left is same


def test_the_past_settles_an_ambiguous_pair_and_a_guess_does_not():
    chooser = Chooser()
    target = chooser.see(([box(300, 200)], [box(200, 200)]), 0.0).target
    boxes = [box(302, 200)], [box(272, 200), box(202, 201)]
    assert associate(*boxes, P).pairs[0].ambiguous
    settled = associate(*boxes, P, expected=chooser.tracks.expected(target.object_id, 0.05, None)).pairs[0]
    assert (settled.right.center_px[0], settled.ambiguous) == (202, False)
    assert chooser.tracks.expected(target.object_id, 5.0, None) is None
    guessing = Chooser()
    guess = guessing.see(([box(300, 200)], [box(270, 200), box(200, 201)]), 0.0).target
    expected = guessing.tracks.expected(guess.object_id, 0.1, None)
    assert expected is not None
    assert (expected.left_px, expected.right_px) == ((300, 200), None)


def test_where_an_object_is_comes_with_it():
    scene, chooser = PeopleScene([lambda _: (1.2, 0.2, -0.1)], noise_px=0.0, miss_share=0.0), Chooser()
    found, images, geometry, _ = scene.look(0.0)
    (one,) = [chooser.on(found, 0.0, images, geometry).target]
    assert one.distance_m == pytest.approx(math.hypot(1.2, 0.2, 0.1), rel=0.02)
    assert one.version_rad == pytest.approx(math.atan2(0.2, math.hypot(1.2, 0.1)), abs=0.01)
    assert one.tilt_rad == pytest.approx(math.atan2(0.1, 1.2), abs=0.01)


# ------------------------------------------------------------------------------------------------- policies


def test_the_target_stays_the_target():
    chooser = Chooser()
    assert chooser.see(boxes_at(200), 0.0).target.boxes.left.center_px[0] == 200
    stronger = box(452, 240, score=0.99)
    left, right = boxes_at(205)
    assert chooser.see(([*left, stronger], [*right, box(432, 240)]), 0.1).target.boxes.left is left[0]
    # Gone for a moment: nothing else is taken for it, and then something is.
    gone = chooser.see(([stronger], [box(432, 240)]), 0.2)
    assert gone.target is None
    assert "has not been seen for 0.1 s" in gone.reason
    late = chooser.see(([stronger], [box(432, 240)]), 0.1 + FOLLOW.forget_after_s + 0.01)
    assert late.target.boxes.left is stronger


def test_one_eye_blind():
    left, right = boxes_at(300)
    assert Chooser().see((left, []), 0.0).target.boxes.left is left[0]
    assert Chooser().see(([], right), 0.0).target.boxes.right is right[0]
    assert Chooser().see(([], []), 0.0).target is None


def standing(*places):
    return PeopleScene([walk(x, y, 0.0) for x, y in places], noise_px=0.5, miss_share=0.0)


@pytest.mark.parametrize(
    ("policy", "person"), [("nearest", 1), ("largest", 1), ("central", 0), ("sticky", 0)], ids=lambda v: str(v)
)
def test_each_policy_chooses_its_own(policy, person):
    scene, chooser = standing((1.6, 0.0), (0.9, 0.3)), Chooser(policy=policy)
    found, images, geometry, whose = scene.look(0.0)
    choice = chooser.on(found, 0.0, images, geometry)
    assert whose[id(choice.target.boxes.shown)] == person
    assert "2 objects" in choice.reason


def test_every_policy_chooses_nothing_where_nothing_is():
    for policy in POLICIES:
        choice = Chooser(policy=policy).see(([], []), 0.0)
        assert choice.target is None
        assert choice.reason == "no object is in view"


def run(chooser, scene, until_s):
    """Return (time, person) of every change of the target."""
    changes, last = [], None
    for time_s in np.arange(0.0, until_s, PERIOD_S):
        found, images, geometry, whose = scene.look(float(time_s))
        target = chooser.on(found, float(time_s), images, geometry).target
        if target is not None and target.object_id != last:
            changes.append((float(time_s), whose[id(target.boxes.shown)]))
            last = target.object_id
    return changes


def test_a_nearer_one_takes_over_only_after_a_time():
    comes = [lambda _: (1.6, 0.0, 0.0), lambda t: (0.8 if t > 1.0 else 1.5, 0.3, 0.0)]
    changes = run(Chooser(), PeopleScene(comes, noise_px=0.5, miss_share=0.0), 5.0)
    assert [person for _, person in changes] == [0, 1]
    assert 1.0 + FOLLOW.takeover_after_s <= changes[1][0] < 1.0 + FOLLOW.takeover_after_s + 1.0


def test_one_that_is_nearer_by_less_than_the_margin_never_takes_over():
    scene = standing((1.5, 0.0), (1.5 / FOLLOW.takeover_ratio * 1.1, 0.3))
    assert [person for _, person in run(Chooser(), scene, 6.0)] == [0]


def test_without_distances_a_larger_one_takes_over():
    chooser = Chooser()
    for i in range(40):
        left = [box(320, 240), box(500, 240, 100, 100, score=0.5)]
        target = chooser.see((left, []), 0.1 * i).target
    assert target.boxes.left is left[1]


@pytest.mark.parametrize("seed", range(3))
def test_two_that_sway_do_not_take_turns(seed):
    scene = PeopleScene([sway(1.2, -0.25, 0.15, 5.0), sway(1.3, 0.25, 0.15, 7.0, 1.0)], seed)
    assert len(run(Chooser(), scene, 20.0)) == 1


def test_a_requested_class_is_chosen_and_others_are_not():
    chooser = Chooser()
    left, right = boxes_at(320)
    cubes = boxes_at(500, class_name="cube")
    both = [*left, *cubes[0]], [*right, *cubes[1]]
    assert chooser.see(both, 0.0).target.class_name == "face"
    chooser.choice.request(RequestedObject("cube"))
    assert chooser.see(both, 0.1).target.class_name == "cube"
    assert chooser.see((left, right), 0.2).target is None
    assert chooser.see((left, right), 5.0).reason == "no cube is in view"


def test_a_class_that_is_hidden_is_chosen_by_name_only():
    chooser, moving = Chooser(), boxes_at(320, class_name="motion")
    assert chooser.see(moving, 0.0).target is None
    assert [one.class_name for one in chooser.objects] == ["motion"]
    chooser.choice.request(RequestedObject("motion"))
    assert chooser.see(moving, 0.1).target.class_name == "motion"


def test_a_requested_object_is_the_target_while_it_is_seen_and_the_glance_ends():
    chooser = Chooser()
    boxes = boxes_at(300, 500)
    first = chooser.see(boxes, 0.0).target
    other = next(one for one in chooser.objects if one.object_id != first.object_id)
    chooser.choice.request(RequestedObject("face", other.object_id))
    assert chooser.see(boxes, 0.1).target.object_id == other.object_id
    missing = chooser.see(boxes_at(300), 0.2)
    assert missing.target is None
    for stamp_s in np.arange(0.3, 0.3 + FOLLOW.forget_after_s, PERIOD_S):
        last = chooser.see(boxes_at(300), float(stamp_s))
    assert last.target.object_id == first.object_id
    chooser.choice.request(RequestedObject("face", first.object_id))
    chooser.see(boxes, 2.4)
    chooser.choice.request(RequestedObject("face"))
    assert chooser.see(boxes, 2.5).target.object_id == first.object_id
