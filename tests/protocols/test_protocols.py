"""Protocols are what REFERENCES says, and frozen."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.errors import UserError
from regbench.geometry.se3 import invert, transform
from regbench.protocols.draws import NOISE_CLIP, derive_seed, draw_motion, draw_noise, generator
from regbench.protocols.moved_copy import DCP_PRIOR
from regbench.protocols.seven_scenes import split_scans
from regbench.registry import find_protocol, names
from regbench.runner.run import survey

DEMO_SHA256 = "6befdfeefae1fc6bd0eeda5b8013b7ac9329703be46d997b1b2d1c80b0a6a3de"
MODELNET = ["clean", "noise", "noise-shared", "unseen", "resampled", "partial"]


@pytest.fixture(scope="session")
def opened(prepared_data):
    """Every protocol on the real data, opened once."""
    ids = [name for name in names("regbench.protocols")]
    return {name: find_protocol(name).open(prepared_data) for name in ids}


def same_points(a, b):
    """Whether two clouds hold the same points in any order, to rounding."""
    distances, matches = cKDTree(b).query(a)
    return distances.max() < 1e-9 and len(set(matches)) == len(np.unique(b, axis=0))


def test_demo_is_frozen(tmp_path):
    sha256, _ = survey("demo@1", find_protocol("demo@1").open(tmp_path))
    assert sha256 == DEMO_SHA256, "a problem of demo@1 changed: that is demo@2"


def test_a_motion_is_dcp_s():
    """Independent rendering: SciPy's lower-case 'zyx' on the triple (z, y, x), angles drawn before translations."""
    rng = generator("modelnet40/clean@1", 17, "motion")
    x, y, z = rng.uniform(0, 45, 3)
    translation = rng.uniform(-0.5, 0.5, 3)
    T = draw_motion(DCP_PRIOR, generator("modelnet40/clean@1", 17, "motion"))
    np.testing.assert_allclose(T[:3, :3], Rotation.from_euler("zyx", [z, y, x], degrees=True).as_matrix(), atol=1e-15)
    np.testing.assert_array_equal(T[:3, 3], translation)


def test_motions_cover_the_range_and_have_the_published_mean_angle():
    motions = np.array([draw_motion(DCP_PRIOR, generator("test", index, "motion")) for index in range(4000)])
    angles_deg = np.degrees(Rotation.from_matrix(motions[:, :3, :3]).magnitude())
    assert abs(angles_deg.mean() - 44.8) < 1.0
    assert angles_deg.max() < 86
    assert np.abs(motions[:, :3, 3]).max() <= 0.5


def test_noise_is_clipped_gauss():
    noise = draw_noise((200_000,), generator("test", 0, "noise"))
    assert abs(noise.std() - 0.01) < 1e-4
    assert np.abs(noise).max() <= NOISE_CLIP


def test_seeds_differ_by_everything_they_are_derived_from():
    seeds = {derive_seed(*what) for what in [("a", 0, "x"), ("a", 0, "y"), ("a", 1, "x"), ("b", 0, "x")]}
    assert len(seeds) == 4


@pytest.mark.parametrize("name", ["demo@1", *(f"modelnet40/{kind}@1" for kind in MODELNET), "7scenes/clean@1"])
def test_a_problem_is_the_same_alone_and_in_any_order(opened, name):
    problems = opened[name]
    first = [problems.pair(index) for index in (5, 3, 5)]
    np.testing.assert_array_equal(first[0].source, first[2].source)
    np.testing.assert_array_equal(first[0].target, first[2].target)
    np.testing.assert_array_equal(first[0].T_target_source, first[2].T_target_source)
    assert not np.array_equal(first[0].T_target_source, first[1].T_target_source)


def test_sizes(opened):
    counts = {name: len(problems) for name, problems in opened.items()}
    assert counts["modelnet40/clean@1"] == counts["modelnet40/noise@1"] == counts["modelnet40/partial@1"] == 2468
    assert counts["modelnet40/unseen@1"] == 1266
    assert counts["7scenes/clean@1"] == counts["7scenes/frames@1"] == 57
    assert counts["demo@1"] >= 200
    sizes = {name: problems.pair(0).source.shape for name, problems in opened.items()}
    assert sizes["modelnet40/clean@1"] == sizes["7scenes/clean@1"] == sizes["7scenes/frames@1"] == (784, 3)
    assert sizes["modelnet40/resampled@1"] == (512, 3)
    assert sizes["modelnet40/partial@1"] == (717, 3)


@pytest.mark.parametrize("name", ["modelnet40/clean@1", "modelnet40/noise-shared@1", "7scenes/clean@1"])
def test_target_is_a_permuted_exact_copy(opened, name):
    pair = opened[name].pair(11)
    moved = transform(pair.T_target_source, pair.source)
    assert same_points(moved, pair.target)
    assert np.abs(moved - pair.target).max() > 0.1, "both clouds must be permuted, each on its own"
    clean = opened["modelnet40/clean@1"].pair(11)
    if name == "modelnet40/noise-shared@1":
        assert not same_points(pair.source, pair.clean_source)
    else:
        assert same_points(clean.source, clean.clean_source)


def test_noise_is_independent_on_both_clouds(opened):
    pair = opened["modelnet40/noise@1"].pair(4)
    residual_source = cKDTree(pair.clean_source).query(pair.source)[0]
    residual_target = cKDTree(pair.clean_target).query(pair.target)[0]
    back = transform(invert(pair.T_target_source), pair.target)
    between = cKDTree(pair.source).query(back)[0]
    assert 0.005 < residual_source.mean() < 0.02
    assert 0.005 < residual_target.mean() < 0.02
    assert between.mean() > 0.005


def test_resampled_clouds_share_no_point(opened):
    pair = opened["modelnet40/resampled@1"].pair(8)
    back = transform(invert(pair.T_target_source), pair.target)
    assert same_points(np.vstack([pair.source, back]), pair.clean_source)
    assert cKDTree(pair.source).query(back)[0].min() > 1e-6


def test_partial_crops_are_half_spaces_of_70_percent(opened):
    problems = opened["modelnet40/partial@1"]
    for index in (0, 9):
        pair = problems.pair(index)
        distance, kept = cKDTree(pair.clean_source).query(pair.source)
        inside = np.zeros(len(pair.clean_source), dtype=bool)
        inside[kept[distance < 0.03]] = True
        gap = pair.clean_source[inside].mean(axis=0) - pair.clean_source[~inside].mean(axis=0)
        assert np.linalg.norm(gap) > 0.05
        back = transform(invert(pair.T_target_source), pair.target)
        assert not np.allclose(np.sort(back[:, 0]), np.sort(pair.source[:, 0]), atol=0.05)


def test_unseen_holds_the_last_20_categories(opened, prepared_data):
    problems = opened["modelnet40/unseen@1"]
    labels = {problems.pair(index).label for index in range(0, len(problems), 7)}
    assert "airplane" not in labels
    assert {"xbox", "tv_stand"} & labels


def test_scans_are_scaled_by_the_longest_side_then_centred(opened):
    source = opened["7scenes/clean@1"].pair(2).source
    assert np.ptp(source, axis=0).max() == pytest.approx(1.0)
    np.testing.assert_allclose(source.mean(axis=0), 0, atol=1e-12)


def test_frame_pairs_align_by_the_camera_poses(opened):
    """Where the poses say the frames meet, the truth brings most points near each other; the identity does not."""
    better = 0
    for index in range(0, 57, 8):
        pair = opened["7scenes/frames@1"].pair(index)
        tree = cKDTree(pair.target)
        truth = np.median(tree.query(transform(pair.T_target_source, pair.source))[0])
        identity = np.median(tree.query(pair.source)[0])
        assert truth < 0.05
        better += truth < identity
    assert better >= 7


def test_train_and_test_scans_are_apart():
    kitchen = [f"redkitchen/seq-01/frame-{2 * k:06d}" for k in range(500)]
    stairs = [f"stairs/seq-0{s}/frame-{k:06d}" for s in range(1, 5) for k in range(3)]
    train, test = split_scans([*stairs, *kitchen])
    ids = [*stairs, *kitchen]
    assert (len(train), len(test)) == (296, 57)
    assert not set(train) & set(test)
    assert sum(ids[index].startswith("stairs") for index in test) == 12
    last_train = max(ids[index] for index in train)
    first_test = min(ids[index] for index in test)
    assert last_train < "redkitchen/seq-01/frame-000750" < "redkitchen/seq-01/frame-000800" <= first_test


def test_with_office_the_published_rule_holds():
    ids = [f"{scene}/seq-01/frame-{k:06d}" for scene in ("chess", "office", "stairs") for k in range(200)]
    train, test = split_scans(ids)
    assert {ids[index].split("/")[0] for index in test} == {"office"}
    assert {ids[index].split("/")[0] for index in train} == {"chess", "stairs"}


def test_too_few_scans_are_named():
    with pytest.raises(UserError, match="12 scans needed of stairs"):
        split_scans(["redkitchen/seq-01/frame-000000"])


def test_unknown_protocols_get_a_suggestion():
    with pytest.raises(UserError, match=r"did you mean 'modelnet40/clean@1'"):
        find_protocol("modelnet40/clean")


def test_nothing_of_the_answer_is_in_a_problem(opened):
    problem, pair = opened["modelnet40/clean@1"].problem(3, protocol="modelnet40/clean@1")
    for value in vars(problem).values():
        assert value is not pair.T_target_source
        assert value is not pair
    assert not problem.source.flags.writeable
    assert problem.source.base is None
