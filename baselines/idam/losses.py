"""IDAM's losses: of the matches, of the significance by the similarity matrix's entropy, of the validity."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from .network import IdamNetwork, at, chosen, motion, moved


class Sampled(NamedTuple):
    """The points of a pair of clouds that a loss is taken from.

    Attributes:
        source: (B, K) int64 indices.
        target: (B, L) int64 indices.
        partner: (B, K) int64, the target among the L that lies nearest to where a source point belongs.
        positive: (B, K), whether that is within the radius.
    """

    source: Tensor
    target: Tensor
    partner: Tensor
    positive: Tensor


def idam_losses(
    network: IdamNetwork, batch: dict[str, Tensor], *, source_share: float, target_share: float, radius: float
) -> dict[str, Tensor]:
    """Return the paper's three terms: "matching", "significance" and "validity".

    Args:
        network: The network.
        batch: Clouds and true motions.
        source_share: Share of the source's points that are sampled.
        target_share: The same of the target.
        radius: Within which a point is a partner, in extents of the target.
    """
    source, target, truth = batch["source"], batch["target"], batch["T_target_source"]
    sampled = balanced_sample(source, target, truth, source_share, target_share, radius)
    found = network.features(source, target)
    of_source, of_target = chosen(found.source, sampled.source), chosen(found.target, sampled.target)
    belongs = moved(truth, of_source).xyz
    positive = sampled.positive.to(source)
    terms = {name: source.new_zeros(()) for name in ("matching", "significance", "validity")}
    T_target_source = torch.eye(4).to(source).repeat(len(source), 1, 1)
    for i, similarity in enumerate(network.similarities):
        scores, validity = similarity(moved(T_target_source, of_source), of_target)
        logarithms = scores.log_softmax(dim=2)
        of_partner = logarithms.gather(2, sampled.partner[:, :, None])[:, :, 0]
        terms["matching"] = terms["matching"] - (of_partner * positive).sum() / positive.sum().clamp_min(1)
        best = scores.argmax(dim=2)
        matches = at(of_target.xyz, best)
        right = (torch.linalg.vector_norm(belongs - matches, dim=2) <= radius).to(source)
        terms["validity"] = terms["validity"] + functional.binary_cross_entropy_with_logits(validity, right)
        if i == 0:
            negative_entropy = (logarithms.exp() * logarithms).sum(dim=2).detach()
            significance = found.source_significance.gather(1, sampled.source)
            terms["significance"] = (significance - negative_entropy).square().mean()
        T_target_source = motion(of_source.xyz, matches, validity.detach().sigmoid())
    return terms


@torch.no_grad()
def balanced_sample(
    source: Tensor, target: Tensor, T_target_source: Tensor, source_share: float, target_share: float, radius: float
) -> Sampled:
    """Draw the points that a loss is taken from: half of the source's have a partner among the target's.

    Those are drawn from the source points that have one within the radius, where there are enough, and their partners
    are among the drawn targets; all others are drawn from the rest.

    Args:
        source: (B, N, 3).
        target: (B, M, 3).
        T_target_source: (B, 4, 4), the true motion.
        source_share: Share of the N points to draw.
        target_share: Share of the M points to draw.
        radius: In the points' unit.
    """
    belongs = source @ T_target_source[:, :3, :3].transpose(1, 2) + T_target_source[:, None, :3, 3]
    distances = torch.cdist(belongs, target, compute_mode="donot_use_mm_for_euclid_dist")
    nearest = distances.min(dim=2)
    count, half = (math.ceil(source_share * source.shape[1] / part) for part in (1, 2))
    order = torch.rand_like(nearest.values)
    first = (order + (nearest.values <= radius)).topk(half, dim=1).indices
    rest = order.scatter(1, first, -1.0).topk(count - half, dim=1).indices
    of_source = torch.cat([first, rest], dim=1)
    wanted = torch.rand_like(distances[:, 0]).scatter(1, nearest.indices.gather(1, first), 2.0)
    of_target = wanted.topk(max(half, math.ceil(target_share * target.shape[1])), dim=1).indices
    among = at(distances, of_source).gather(2, of_target[:, None].expand(-1, count, -1)).min(dim=2)
    return Sampled(of_source, of_target, among.indices, among.values <= radius)
