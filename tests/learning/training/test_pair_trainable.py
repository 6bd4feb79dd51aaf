"""Training pairs are the protocols', and what every method of two clouds gets for its training."""

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.errors import UserError
from regbench.geometry.se3 import euler_deg_from_rotation, transform
from regbench.learning.training.check_trainable import check_trainable
from regbench.learning.training.pair_samples import draw_pair
from regbench.protocols.draws import DCP_PRIOR, NOISE_CLIP
from regbench.testing.clouds import body
from tests.learning.toy_pair import ToyNetwork, ToyPairTraining

CLOUD = body(1024)


def pair(kind="clean", motions="benchmark", seed=0, points=784):
    found = draw_pair(CLOUD, points, kind, motions, 0.8, np.random.default_rng(seed))
    return {name: values.astype(np.float64) for name, values in found.items()}


@pytest.mark.parametrize("motions", ["benchmark", "about_mean", "twist"])
def test_the_motion_lays_the_source_on_the_target(motions):
    made = pair(motions=motions)
    moved = transform(made["T_target_source"], made["source"])
    distances, matches = cKDTree(made["target"]).query(moved)
    assert distances.max() < 1e-5
    assert sorted(matches) == list(range(784)) != matches.tolist()
    np.testing.assert_allclose(made["target"].mean(axis=0), 0, atol=1e-6)
    assert np.linalg.norm(made["target"], axis=1).max() == pytest.approx(1, rel=1e-5)


def test_motions_are_those_that_were_asked_for():
    rotations = {
        motions: np.stack(
            [pair(motions=motions, seed=seed, points=32)["T_target_source"][:3, :3] for seed in range(99)]
        )
        for motions in ("benchmark", "about_mean", "twist")
    }
    angles = np.stack([euler_deg_from_rotation(T[:3, :3]) for T in rotations["benchmark"]])
    assert angles.min() >= -1e-4
    assert 38 < angles.max() <= 45.001
    assert 0.7 < Rotation.from_matrix(rotations["twist"][:, :3, :3]).magnitude().max() <= 0.8001
    mean = DCP_PRIOR.mean_T_target_source()[:3, :3]
    np.testing.assert_allclose(rotations["about_mean"][:, :3, :3] @ mean, rotations["benchmark"][:, :3, :3], atol=1e-6)


def test_noise_is_on_both_clouds_and_clipped():
    made = pair("noise")
    distances, _ = cKDTree(made["target"]).query(transform(made["T_target_source"], made["source"]))
    assert np.median(distances) > 0.002
    assert distances.max() < 2 * np.sqrt(3) * NOISE_CLIP


def test_crops_and_resampled_shapes_have_the_protocols_counts():
    assert [pair("partial", points=1024)[name].shape for name in ("source", "target")] == [(717, 3)] * 2
    made = pair("resampled", points=1024)
    assert [made[name].shape for name in ("source", "target")] == [(512, 3)] * 2
    distances, _ = cKDTree(made["target"]).query(transform(made["T_target_source"], made["source"]))
    assert distances.min() > 1e-6


SMALL = {"points": 64, "validated_points": 64, "validated": 3, "held_out": 9800}


def test_a_trainable_of_few_lines_keeps_its_promises(prepared_data):
    assert check_trainable(ToyPairTraining(SMALL, data=prepared_data)) == []


def test_validation_measures_held_out_pairs_of_each_kind(prepared_data):
    trainable = ToyPairTraining({**SMALL, "kinds": ["clean", "partial"]}, data=prepared_data)
    network = ToyNetwork()
    network.layers[-1].weight.data.zero_()
    network.layers[-1].bias.data.zero_()
    with torch.no_grad():
        figures = trainable.validate(network)
    truths = torch.cat([batch["T_target_source"] for batch in trainable._pairs.values()])[:, :3, :3].double().numpy()
    angles = np.degrees(Rotation.from_matrix(truths).magnitude())
    assert figures["mean_rotation_error_deg"] == pytest.approx(angles.mean(), rel=1e-6)
    assert figures["clean_median_rotation_error_deg"] == pytest.approx(np.median(angles[:3]), rel=1e-6)
    assert figures["partial_recall_5_deg"] == 0


def test_the_card_says_what_it_was_trained_on_and_how(prepared_data):
    card = ToyPairTraining(SMALL, data=prepared_data).card()
    assert (card["method"], card["supervision"], card["configuration"]) == ("toy_pair", "supervised", {"width": 4})
    assert card["data"]["clouds held out"] == 9800


def test_unknown_settings_are_refused(tmp_path):
    with pytest.raises(UserError, match="toy_pair"):
        ToyPairTraining({"kinds": ["dirty"]}, data=tmp_path)
