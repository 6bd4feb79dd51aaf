"""The originals of PointNetLK, DCP-v1 and IDAM, as their papers have them, with the names of their authors' modules."""

from itertools import pairwise

import torch
from scipy.spatial.transform import Rotation
from torch import nn


def block(sizes):
    layers = []
    for size, width in pairwise(sizes):
        layers += [nn.Conv1d(size, width, 1), nn.BatchNorm1d(width), nn.ReLU()]
    return nn.Sequential(*layers)


class PointNetLk(nn.Module):
    """PointNetLK's encoder."""

    def __init__(self, scale=8):
        super().__init__()
        self.h1 = block([3, 64 // scale, 64 // scale])
        self.h2 = block([64 // scale, 64 // scale, 128 // scale, 1024 // scale])

    def forward(self, points):
        return self.h2(self.h1(points.transpose(1, 2))).max(dim=2).values


class Revisited(nn.Module):
    """PointNetLK Revisited's."""

    def __init__(self):
        super().__init__()
        self.mlp1, self.mlp2, self.mlp3 = block([3, 8]), block([8, 16]), block([16, 64])

    def forward(self, points):
        return self.mlp3(self.mlp2(self.mlp1(points.transpose(1, 2)))).max(dim=2).values


def near(points, k):
    """Return the k nearest of (N, 3) points to each, (N, k)."""
    return torch.cdist(points, points, compute_mode="donot_use_mm_for_euclid_dist").topk(k, largest=False).indices


def kabsch(source, target, weights):
    """Return R (3, 3) and t (3,) by SciPy."""
    weights = weights / weights.sum()
    of_source, of_target = weights @ source, weights @ target
    R, _ = Rotation.align_vectors((target - of_target).double(), (source - of_source).double(), weights.double())
    R = torch.from_numpy(R.as_matrix()).to(source)
    return R, of_target - R @ of_source


class Dgcnn(nn.Module):
    def __init__(self, width):
        super().__init__()
        for place, (size, channels) in enumerate([(6, 64), (64, 64), (64, 128), (128, 256), (512, width)], start=1):
            setattr(self, f"conv{place}", nn.Conv2d(size, channels, 1, bias=False))
            setattr(self, f"bn{place}", nn.BatchNorm2d(channels))

    def step(self, place, values):
        return getattr(self, f"bn{place}")(getattr(self, f"conv{place}")(values)).relu()

    def forward(self, points):
        others = points[near(points, 20)]
        values = torch.cat([others, points[:, None].expand_as(others)], dim=2).permute(2, 0, 1)[None]
        highest = []
        for place in range(1, 5):
            values = self.step(place, values)
            highest.append(values.amax(dim=3, keepdim=True))
        return self.step(5, torch.cat(highest, dim=1))[0, :, :, 0].T


class Head(nn.Module):
    def __init__(self):
        super().__init__()
        self.reflect = nn.Parameter(torch.diag(torch.tensor([1.0, 1.0, -1.0])), requires_grad=False)


class Dcp(nn.Module):
    """DCP-v1."""

    def __init__(self, width=32):
        super().__init__()
        self.emb_nn, self.head = Dgcnn(width), Head()

    def forward(self, source, target):
        of_source, of_target = self.emb_nn(source), self.emb_nn(target)
        shares = (of_source @ of_target.T / of_source.shape[1] ** 0.5).softmax(dim=1)
        return kabsch(source, shares @ target, torch.ones_like(source[:, 0]))


class Convolution(nn.Module):
    def __init__(self, size, width, of):
        super().__init__()
        convolution, norm = of
        self.conv, self.bn = convolution(size, width, 1, bias=False), norm(width)

    def forward(self, values):
        return self.bn(self.conv(values)).relu()


IN_1D, IN_2D = (nn.Conv1d, nn.BatchNorm1d), (nn.Conv2d, nn.BatchNorm2d)


class Convolutions(nn.Module):
    def __init__(self, widths, of):
        super().__init__()
        layers = [Convolution(*sizes, of) for sizes in pairwise(widths[:-1])]
        self.conv = nn.ModuleList([*layers, of[0](*widths[-2:], 1)])

    def forward(self, values):
        for layer in self.conv:
            values = layer(values)
        return values


class Propagate(nn.Module):
    def __init__(self, size, width):
        super().__init__()
        self.conv2d, self.conv1d = Convolutions((size, width, width), IN_2D), Convolutions((width, width), IN_1D)

    def forward(self, values, neighbours):
        edges = values[:, :, neighbours[0]] - values[:, :, :, None]
        return self.conv1d(self.conv2d(edges).amax(dim=3))


class Graph(nn.Module):
    def __init__(self):
        super().__init__()
        for place in range(1, 6):
            setattr(self, f"propogate{place}", Propagate(3 if place == 1 else 64, 64))

    def forward(self, points):
        neighbours, values = near(points, 12)[None], points.T[None]
        for place in range(1, 6):
            values = getattr(self, f"propogate{place}")(values, neighbours)
        return values


class Idam(nn.Module):
    """IDAM on its graph network."""

    def __init__(self, iterations=3):
        super().__init__()
        self.emb_nn, self.head = Graph(), Head()
        self.significance_fc = Convolutions((64, 64, 32, 1), IN_1D)
        self.sim_mat_conv1 = nn.ModuleList(Convolutions((132, 32, 32), IN_2D) for _ in range(iterations))
        self.sim_mat_conv2 = nn.ModuleList(Convolutions((32, 32, 1), IN_2D) for _ in range(iterations))
        self.weight_fc = nn.ModuleList(Convolutions((32, 32, 1), IN_1D) for _ in range(iterations))

    def kept(self, points):
        values = self.emb_nn(points)
        best = self.significance_fc(values)[0, 0].topk(len(points) // 6).indices
        return points[best], values[0][:, best]

    def forward(self, source, target):
        (source, of_source), (target, of_target) = self.kept(source), self.kept(target)
        R, t, placed = torch.eye(3).to(source), torch.zeros(3).to(source), source
        for first, second, validity in zip(self.sim_mat_conv1, self.sim_mat_conv2, self.weight_fc, strict=True):
            offsets = placed[:, None] - target
            distances = offsets.norm(dim=2, keepdim=True)
            geometry = torch.cat([distances, offsets / (distances + 1e-8)], dim=2).permute(2, 0, 1)
            N, M = len(source), len(target)
            pairs = [of_source[:, :, None].expand(-1, -1, M), of_target[:, None].expand(-1, N, -1), geometry]
            values = first(torch.cat(pairs)[None])
            weights = validity(values.amax(dim=3))[0, 0].sigmoid()
            best = second(values)[0, 0].argmax(dim=1)
            step_R, step_t = kabsch(placed, target[best], weights * (weights >= weights.median()))
            placed = placed @ step_R.T + step_t
            R, t = step_R @ R, step_R @ t + step_t
        return R, t
