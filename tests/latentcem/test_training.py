import numpy as np
import pytest
import torch
from torch.utils.data import default_collate

from regbench.errors import UserError
from regbench.geometry.chamfer import chamfer_distance
from regbench.geometry.se3 import transform
from regbench.learning.training.check_trainable import check_trainable
from regbench.learning.weights import load_weights, save_weights
from regbench.protocols.seven_scenes import split_scans
from regbench.registry import open_dataset
from regbench_latentcem import loading, weight_files
from regbench_latentcem.actions import motion_of
from regbench_latentcem.losses import distances_after
from regbench_latentcem.model import LatentModel
from regbench_latentcem.training import LatentCemTraining
from regbench_latentcem.validation import ValidationPairs

SMALL = {"points": 64, "support_clouds": 2, "support_copies": 2, "validated": 2}


@pytest.mark.parametrize("dataset", ["modelnet40", "7scenes"])
def test_a_sample_is_a_function_of_its_generator(prepared_data, dataset):
    trainable = LatentCemTraining({**SMALL, "dataset": dataset, "held_out": 50}, data=prepared_data)
    sample, again = (trainable.sample(np.random.default_rng(0), progress) for progress in (0.0, 0.9))
    assert sample["source"].shape == (64, 3)
    assert sample["copies"].shape == (3, 64, 3)
    assert all(np.array_equal(sample[name], again[name]) for name in sample)


def test_first_f_then_d_too_are_trained_on_support_functions_then_everything(prepared_data):
    trainable = LatentCemTraining({**SMALL, "held_out": 9800}, data=prepared_data)
    batch = default_collate([trainable.sample(np.random.default_rng(seed), 0.0) for seed in range(2)])
    every = {"encoder", "decoder", "transformation", "evaluation"}
    for progress, trained in ((0.0, {"transformation"}), (0.6, {"transformation", "evaluation"}), (0.9, every)):
        torch.manual_seed(0)
        network = trainable.network()
        sum(trainable.losses(network, batch, progress).values()).backward()
        parts = {name.split(".")[0] for name, p in network.named_parameters() if p.grad is not None}
        assert parts == trained
        assert set(trainable.learning_rate_factors(network)) == {"evaluation."}


def test_f_may_learn_in_mixed_precision_and_all_else_stays_in_full(prepared_data):
    trainable = LatentCemTraining({**SMALL, "held_out": 9800}, data=prepared_data)
    batch = default_collate([trainable.sample(np.random.default_rng(seed), 0.0) for seed in range(2)])
    torch.manual_seed(0)
    network = trainable.network()

    def losses(progress, mixed):
        torch.manual_seed(1)
        with torch.autocast("cpu", torch.bfloat16, enabled=mixed):
            return {name: term.item() for name, term in trainable.losses(network, batch, progress).items()}

    alone = losses(0.0, mixed=False)
    assert losses(0.0, mixed=True) == pytest.approx(alone, rel=0.02)
    assert losses(0.0, mixed=True) != alone
    for progress in (0.6, 0.9):
        assert losses(progress, mixed=True) == losses(progress, mixed=False)


def test_what_is_held_out_or_tested_is_never_trained_on(prepared_data):
    for dataset, count in (("modelnet40", 9843), ("7scenes", 296)):
        trainable = LatentCemTraining({**SMALL, "dataset": dataset, "held_out": 50}, data=prepared_data)
        trained, held_out = trainable._clouds.trained, trainable._clouds.validated
        assert (len(trained), len(held_out)) == (count - 50, 50)
        assert not set(trained) & set(held_out)
    train, test = split_scans(open_dataset("7scenes", prepared_data).splits["scans"].ids)
    assert set(trained) | set(held_out) == set(train)
    assert not set(trained) & set(test)


def test_it_is_trainable(prepared_data):
    jointly = {"alone_share": 0.0, "support_share": 0.0}
    for start in (jointly, {"start": "random"}, {"start": "random", "encoder": "folding"}):
        assert check_trainable(LatentCemTraining({**SMALL, **start}, data=prepared_data)) == []


def test_weights_are_what_registration_needs_and_go_back_in(prepared_data, tmp_path, monkeypatch):
    trainable = LatentCemTraining(SMALL, data=prepared_data)
    torch.manual_seed(0)
    network = trainable.network()
    path = tmp_path / "some.safetensors"
    save_weights(path, trainable.tensors(network), trainable.card())
    assert path.stat().st_size < 8e6
    monkeypatch.setattr(weight_files, "FOLDER", tmp_path)
    cloud = torch.randn(1, 100, 3)
    loaded, other = loading.load_paper_model("some"), trainable.network()
    trainable.load(other, load_weights(path))
    for model in (loaded, other):
        assert torch.equal(model.encode(cloud), network.encode(cloud))
    assert loading.load_paper_model("some").configuration == network.configuration


def test_unknown_settings_are_refused():
    with pytest.raises(UserError, match="held_out"):
        LatentCemTraining({"heldout": 3}, data=None)


class TrueDistances:
    """In the place of a model: its states are the clouds, and its reward the true distance."""

    first_actions = LatentModel().first_actions

    def encode(self, clouds):
        return clouds

    def parameters(self):
        return iter([torch.zeros(1)])

    def reward(self, source, target):
        return lambda actions: -distances_after(source, target[:, None], actions[:, None], source.shape[1])[:, 0]


def test_with_true_distances_validation_finds_no_fault():
    clouds = [np.random.default_rng(seed).normal(size=(60, 3)) * [1, 0.6, 0.3] for seed in range(2)]
    figures = ValidationPairs.of(clouds, 60).figures(TrueDistances())
    assert figures["clean_r2_near"] == pytest.approx(1, abs=1e-6)
    assert figures["noise_r2_far"] == pytest.approx(1, abs=1e-6)
    assert figures["clean_median_rotation_error_deg"] < 0.5
    assert figures["clean_rmse_r_deg"] < 0.5
    assert figures["clean_recall_5_deg"] == 1


def test_validation_recomputed_by_hand():
    """R^2 from exact distances of really moved clouds, for one cloud and an untrained model."""
    cloud = np.random.default_rng(0).normal(size=(60, 3))
    torch.manual_seed(0)
    model = LatentModel().eval()
    pairs = ValidationPairs.of([cloud], 60)
    batch = pairs.batches["clean"]
    source, target = (points - points.mean(dim=1, keepdim=True) for points in (batch["source"], batch["copies"][:, 0]))
    actions = batch["proposed"][:, 0]
    true = torch.tensor(
        [
            chamfer_distance(transform(motion_of(action), source[0].double().numpy()), target[0].double().numpy())
            for action in actions[0]
        ]
    )
    with torch.no_grad():
        predicted = -model.reward(model.encode(source), model.encode(target))(actions)[0]
    expected = 1 - ((predicted - true) ** 2).sum() / ((true - true.mean()) ** 2).sum()
    assert pairs.figures(model)["clean_r2_far"] == pytest.approx(expected.item(), rel=1e-3)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"encoder": "folding"}, 'start = "support" needs encoder = "dgcnn"'),
        ({"dataset": "7scenes", "held_out": 300}, "held_out = 300 leaves no cloud to train on: 7scenes has 296"),
        ({"points": 100_000}, "points = 100000: clouds of modelnet40 have 1024"),
    ],
)
def test_settings_that_do_not_go_together_are_refused_in_one_line(prepared_data, settings, reason):
    with pytest.raises(UserError, match=reason):
        LatentCemTraining(settings, data=prepared_data).sample(np.random.default_rng(0), 0.0)


def test_clouds_may_have_more_points_than_the_benchmarks(prepared_data):
    trainable = LatentCemTraining({**SMALL, "points": 1000}, data=prepared_data)
    assert trainable.sample(np.random.default_rng(0), 0.0)["source"].shape == (1000, 3)


def test_only_a_d_that_starts_as_a_measure_learns_slowly(prepared_data):
    support, random = (
        LatentCemTraining({"start": start}, data=prepared_data).learning_rate_factors(LatentModel())
        for start in ("support", "random")
    )
    assert support == {"evaluation.": 0.002}
    assert random == {}


def test_the_recipe_has_every_setting(prepared_data):
    settings = LatentCemTraining({"noisy": 0.1}, data=prepared_data).settings
    assert settings["noisy"] == 0.1
    assert settings["support_copies"] == 6
