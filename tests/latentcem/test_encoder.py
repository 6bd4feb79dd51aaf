import numpy as np
import pytest
import torch
from torch.nn import functional

from regbench.learning.layers.edge_convolution import EdgeConvolution
from regbench.learning.layers.neighbours import nearest_neighbours
from regbench_latentcem.encoder import DgcnnEncoder, FoldingEncoder, local_covariances

ENCODERS = [DgcnnEncoder, lambda: DgcnnEncoder(normalisation="layer"), FoldingEncoder]


def cloud(points, batch=2, dtype=torch.float32):
    return torch.randn(batch, points, 3, generator=torch.Generator().manual_seed(0), dtype=dtype) * 0.5


@pytest.fixture(autouse=True)
def _seed():
    torch.manual_seed(0)


@pytest.mark.parametrize("make", ENCODERS)
@pytest.mark.parametrize("points", [1, 10, 5000])
def test_clouds_of_any_size_have_a_latent_of_512(make, points):
    with torch.no_grad():
        latent = make()(cloud(points))
    assert latent.shape == (2, 512)
    assert torch.isfinite(latent).all()


@pytest.mark.parametrize("make", ENCODERS)
def test_the_order_of_the_points_does_not_matter(make):
    points = cloud(200)
    encoder = make()
    permuted = points[:, torch.randperm(200, generator=torch.Generator().manual_seed(1))]
    torch.testing.assert_close(encoder(permuted), encoder(points), rtol=0, atol=1e-5)


@pytest.mark.parametrize("make", ENCODERS)
def test_a_batch_equals_singles(make):
    points, encoder = cloud(150, batch=3), make()
    singles = torch.cat([encoder(each[None]) for each in points])
    torch.testing.assert_close(encoder(points), singles, rtol=0, atol=1e-5)


def test_dgcnn_is_the_published_network():
    """Every step written out from DGCNN's paper, on edges, in the order that its code has."""

    def edge_layer(layer, x):
        neighbours = nearest_neighbours(x, 20)
        near = torch.stack([points[indices] for points, indices in zip(x, neighbours, strict=True)])
        centre = x[:, :, None].expand_as(near)
        return functional.leaky_relu(layer.edge(torch.cat([near - centre, centre], dim=3)), 0.2).amax(dim=2)

    encoder = DgcnnEncoder().double()
    points = cloud(784, dtype=torch.float64)
    x1 = edge_layer(encoder.convolutions[0], points)
    x2 = edge_layer(encoder.convolutions[1], x1)
    x3 = edge_layer(encoder.convolutions[2], x2)
    x4 = edge_layer(encoder.convolutions[3], x3)
    assert [x.shape[2] for x in (x1, x2, x3, x4)] == [64, 64, 128, 256]
    expected = functional.leaky_relu(encoder.last(torch.cat([x1, x2, x3, x4], dim=2)), 0.2).amax(dim=1)
    torch.testing.assert_close(encoder(points), expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("points", "neighbours"), [(100, 8), (256, 8), (392, 10), (784, 20), (1568, 40), (5000, 40)])
def test_neighbourhoods_are_the_same_part_of_clouds_of_any_size(points, neighbours, monkeypatch):
    asked = []
    monkeypatch.setattr(
        EdgeConvolution, "forward", lambda layer, x, k: (asked.append(k), layer.edge(torch.cat([x, x], 2)))[1]
    )
    DgcnnEncoder()(cloud(points, batch=1))
    assert asked == [neighbours] * 4


def test_latents_start_at_a_size_that_trains():
    """He's initialisation holds the activations through the layers: neither vanishing nor exploding."""
    with torch.no_grad():
        latent = DgcnnEncoder()(cloud(784))
    assert 0.05 < latent.square().mean().sqrt() < 5


def test_bfloat16_stays_near_float32():
    encoder, points = DgcnnEncoder(), cloud(200)
    with torch.no_grad():
        full = encoder(points)
        half = encoder.to(torch.bfloat16)(points.to(torch.bfloat16)).float()
    assert functional.cosine_similarity(half, full).min() > 0.98


def test_covariances_are_numpys():
    points = cloud(40, dtype=torch.float64)
    neighbours = nearest_neighbours(points, 16)
    found = local_covariances(points, neighbours)
    for b, i in ((0, 0), (1, 17)):
        expected = np.cov(points[b, neighbours[b, i]].numpy().T, bias=True)
        np.testing.assert_allclose(found[b, i], expected, atol=1e-12)
