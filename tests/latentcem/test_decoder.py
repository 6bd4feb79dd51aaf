import pytest
import torch

from regbench_latentcem.decoder import FoldingDecoder, MlpDecoder


@pytest.fixture(autouse=True)
def _seed():
    torch.manual_seed(0)


@pytest.mark.parametrize("make", [FoldingDecoder, MlpDecoder])
def test_a_latent_becomes_784_points(make):
    decoder = make()
    latents = torch.randn(3, 512)
    clouds = decoder(latents)
    assert clouds.shape == (3, 784, 3)
    torch.testing.assert_close(clouds, torch.cat([decoder(each[None]) for each in latents]), rtol=0, atol=1e-5)


def test_the_grid_is_a_plane_of_28_by_28():
    grid = FoldingDecoder().grid
    assert grid.shape == (784, 2)
    assert len(torch.unique(grid, dim=0)) == 784
    assert (grid.min().item(), grid.max().item()) == pytest.approx((-0.3, 0.3))


def test_folding_is_two_3_layer_networks_on_the_latent_beside_each_point():
    decoder = FoldingDecoder()

    def fold(network, z, points):
        first = torch.cat([network.of_latent.weight, network.of_point.weight], dim=1)
        both = torch.cat([z[:, None].expand(-1, points.shape[1], -1), points], dim=2)
        return network.rest(both @ first.T + network.of_latent.bias)

    z = torch.randn(2, 512)
    expected = fold(decoder.second, z, fold(decoder.first, z, decoder.grid.expand(2, -1, -1)))
    torch.testing.assert_close(decoder(z), expected, rtol=0, atol=1e-5)
