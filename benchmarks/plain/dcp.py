"""DCP-v2 as its paper has it: convolutions on every edge, attention by its two products, matches in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

WIDTHS = (64, 64, 128, 256)
HEADS = 4


class PlainAttention(nn.Module):
    """Multi-head attention.

    Args:
        width: Channels.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.into, self.out = nn.Linear(width, 3 * width), nn.Linear(width, width)

    def forward(self, points: Tensor, others: Tensor) -> Tensor:
        """Map (B, N, width) by what they take from (B, M, width)."""
        weights, biases = self.into.weight.chunk(3), self.into.bias.chunk(3)
        inputs = (points, others, others)
        q, k, v = (
            functional.linear(x, w, b).view(*x.shape[:2], HEADS, -1).transpose(1, 2)
            for x, w, b in zip(inputs, weights, biases, strict=True)
        )
        shares = (q @ k.transpose(2, 3) / math.sqrt(q.shape[3])).softmax(dim=3)
        answer: Tensor = self.out((shares @ v).transpose(1, 2).flatten(2))
        return answer


class PlainBlock(nn.Module):
    """Attention to itself, for the decoder then to the other cloud, then two layers on points; norms come first.

    Args:
        width: Channels.
        hidden: Channels between the two layers.
        crossed: Whether it is the decoder.
    """

    def __init__(self, width: int, hidden: int, crossed: bool) -> None:
        super().__init__()
        self.to_self = PlainAttention(width)
        self.to_other = PlainAttention(width) if crossed else None
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(3 if crossed else 2))
        self.first, self.second = nn.Linear(width, hidden), nn.Linear(hidden, width)
        self.last = nn.LayerNorm(width)

    def forward(self, points: Tensor, others: Tensor | None = None) -> Tensor:
        """Map (B, N, width), the decoder with the (B, M, width) encoding of the other cloud."""
        normed = self.norms[0](points)
        points = points + self.to_self(normed, normed)
        if self.to_other is not None:
            points = points + self.to_other(self.norms[1](points), others)
        points = points + self.second(functional.relu(self.first(self.norms[-1](points))))
        answer: Tensor = self.last(points)
        return answer


class PlainDcp(nn.Module):
    """The network.

    Args:
        width: Channels of an embedding.
        hidden: Channels inside the transformer's layers on points.
        k: Neighbours.
    """

    def __init__(self, *, width: int = 512, hidden: int = 1024, k: int = 20) -> None:
        super().__init__()
        self.k = k
        self.edges = nn.ModuleList(nn.Conv2d(2 * a, b, 1) for a, b in zip((3, *WIDTHS[:-1]), WIDTHS, strict=True))
        self.norms = nn.ModuleList(nn.LayerNorm(b) for b in WIDTHS)
        self.embedding, self.norm = nn.Conv1d(sum(WIDTHS), width, 1), nn.LayerNorm(width)
        self.encoder, self.decoder = PlainBlock(width, hidden, False), PlainBlock(width, hidden, True)

    def align(self, source: Tensor, target: Tensor) -> Tensor:
        """Return T_target_source, (B, 4, 4), of (B, N, 3) and (B, M, 3)."""
        F_source, F_target = self.dgcnn(source), self.dgcnn(target)
        of_source = F_source + self.decoder(F_source, self.encoder(F_target))
        of_target = F_target + self.decoder(F_target, self.encoder(F_source))
        shares = (of_source @ of_target.transpose(1, 2) / math.sqrt(of_source.shape[2])).softmax(dim=2)
        matches = shares @ target
        source_mean, match_mean = source.mean(dim=1, keepdim=True), matches.mean(dim=1, keepdim=True)
        U, _, Vt = torch.linalg.svd((matches - match_mean).transpose(1, 2) @ (source - source_mean))
        sign = torch.ones(len(source), 3)
        sign[:, 2] = torch.det(U @ Vt)
        motion = torch.eye(4).repeat(len(source), 1, 1)
        motion[:, :3, :3] = U @ torch.diag_embed(sign) @ Vt
        motion[:, :3, 3] = (match_mean - source_mean @ motion[:, :3, :3].transpose(1, 2))[:, 0]
        return motion

    def dgcnn(self, cloud: Tensor) -> Tensor:
        """Return (B, N, width) embeddings of a (B, N, 3) cloud."""
        features, found = cloud, []
        for convolution, norm in zip(self.edges, self.norms, strict=True):
            neighbours = torch.cdist(features, features).topk(min(self.k, cloud.shape[1]), dim=2, largest=False).indices
            near = torch.stack([each[index] for each, index in zip(features, neighbours, strict=True)])
            centre = features[:, :, None].expand_as(near)
            edges = convolution(torch.cat([near - centre, centre], dim=3).permute(0, 3, 1, 2))
            features = functional.leaky_relu(norm(edges.max(dim=3).values.transpose(1, 2)), 0.2)
            found.append(features)
        embedded = self.embedding(torch.cat(found, dim=2).transpose(1, 2)).transpose(1, 2)
        return functional.leaky_relu(self.norm(embedded), 0.2)


def from_ours(state: Mapping[str, Tensor], configuration: Mapping[str, Any]) -> PlainDcp:
    """Return the plain network with the weights of `DcpNetwork(**configuration).state_dict()`."""
    plain = PlainDcp(**configuration)
    names = {
        "encoded.": "encoder.last.",
        "decoded.": "decoder.last.",
        "self_attn.in_proj_": "to_self.into.",
        "self_attn.out_proj": "to_self.out",
        "multihead_attn.in_proj_": "to_other.into.",
        "multihead_attn.out_proj": "to_other.out",
        "linear1": "first",
        "linear2": "second",
        "coder.norm1": "coder.norms.0",
        "coder.norm2": "coder.norms.1",
        "coder.norm3": "coder.norms.2",
    }
    names |= {f"edges.{i}.norm": f"norms.{i}" for i in range(len(WIDTHS))}
    names |= {f"edges.{i}.edge": f"edges.{i}" for i in range(len(WIDTHS))}
    shapes = plain.state_dict()
    renamed = {}
    for name, tensor in state.items():
        for ours, theirs in names.items():
            name = name.replace(ours, theirs)
        renamed[name] = tensor.reshape(shapes[name].shape)
    plain.load_state_dict(renamed)
    return plain
