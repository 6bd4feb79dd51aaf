from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from regbench.geometry.se3 import transform
from regbench.registry import open_dataset
from regbench_latentcem.equivariant import VectorEncoder
from regbench_latentcem.fitting import fit_matcher, fit_mixing, noise_of_channels, self_made_pairs
from regbench_latentcem.loading import load_equivariant_model, load_matcher
from regbench_latentcem.matching import Matcher


@pytest.fixture(scope="module")
def dataset():
    return open_dataset("cad_demo", Path())


@pytest.mark.parametrize("kind", ["noise", "resampled", "partial"])
def test_a_self_made_pairs_motion_maps_its_clouds_onto_each_other(dataset, kind):
    first, again = (next(self_made_pairs(dataset, kind, 0, 1)) for _ in range(2))
    source, target, T = first
    distances, _ = cKDTree(target).query(transform(T, source))
    assert np.median(distances) < 0.05
    assert all(np.array_equal(*each) for each in zip(first, again, strict=True))


@torch.no_grad()
def test_the_mixing_makes_every_direction_as_noisy_as_every_other(dataset):
    encoder = VectorEncoder(channels=24)
    fit_mixing(encoder, dataset, 6)
    noise = noise_of_channels(encoder, dataset, "noise", 0, 6)
    noise += 0.1 * noise_of_channels(encoder, dataset, "resampled", 0, 6)
    before, after = (torch.linalg.eigvalsh(N) for N in (noise, encoder.mixing @ noise @ encoder.mixing.T))
    assert after[-1] / after.sum() < 0.2 * before[-1] / before.sum()
    assert float(torch.linalg.matrix_norm(encoder.mixing)) == pytest.approx(24**0.5)


@torch.no_grad()
def test_the_matchers_fit_finds_more_of_the_right_points(dataset):
    def share(matcher):
        right = []
        for source, target, T in self_made_pairs(dataset, "partial", 20, 26):
            of_source, of_target = (matcher(torch.from_numpy(cloud)).numpy() for cloud in (source, target))
            misses = transform(T, source) - target[cKDTree(of_target).query(of_source)[1]]
            right.append(np.mean(np.linalg.norm(misses, axis=1) < 0.03))
        return np.median(right)

    matcher = Matcher()
    before = share(matcher)
    fit_matcher(matcher, dataset, 12)
    assert share(matcher) > 2 * before
    assert share(load_matcher()) > 2 * before


def test_the_packages_fitted_weights_fit_the_model():
    assert load_equivariant_model("equivariant").encoder.mixing.shape == (1024, 1024)
