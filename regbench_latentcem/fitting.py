"""Fits the equivariant model and the matcher, in closed form, to pairs made from training shapes.

    python -m regbench_latentcem.fitting --data data --out regbench_latentcem/weights

Transformation consistency (Eq. 6) says what a cloud's latent vectors, moved, should be: those of its moved, noisy or
resampled copy. What is left of z_Y - R z_X is the noise of each channel, and N its covariance over the channels:
N^(-1/2) makes every direction of the latent space as reliable as every other. Gradients add little to that.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor

from regbench.contract import Problem
from regbench.datasets.dataset import Dataset
from regbench.geometry.local_frame import LocalFrame
from regbench.geometry.se3 import transform
from regbench.learning.weights import save_weights
from regbench.protocols.draws import DCP_PRIOR, draw_motion, generator
from regbench.protocols.moved_copy import copied, cropped, resampled
from regbench.registry import open_dataset

from .equivariant import VectorEncoder, closed_form
from .matching import Matcher, local_descriptors

Kind = Literal["noise", "resampled", "partial"]
Array = NDArray[np.float64]

# Shapes that the fit sees, and the next ones, which validate it.
FITTED, VALIDATED = 1500, 200
# Seeds of the self-made pairs come from this name: no protocol's.
STREAM = "latentcem/fitting"
# Weight of the resampled copies' noise beside the noisy ones', each relative to its trace.
RESAMPLED_WEIGHT = 0.1
# Share of its mean eigenvalue that is added to the noise's covariance.
RIDGE = 0.1
# A point and its partner in the other crop are no farther apart under the true motion, in extents.
SAME_POINT = 0.03


def self_made_pairs(dataset: Dataset, kind: Kind, first: int, last: int) -> Iterator[tuple[Array, Array, Array]]:
    """Yield (source, target, T_target_source) of training shapes, moved by ourselves, in their local frame.

    Args:
        dataset: ModelNet40 as prepared.
        kind: What else is done to the clouds: as the protocols of that name do.
        first: First of the shapes, in an order drawn once.
        last: One after the last of them.
    """
    split = dataset.splits["train"]
    order = generator(STREAM, 0, "order of the shapes").permutation(len(split.points))
    for shape in order[first:last].tolist():
        cloud = np.asarray(split.points[shape], dtype=np.float64)
        T = draw_motion(DCP_PRIOR, generator(STREAM, shape, "motion"))
        if kind == "noise":
            made = copied(cloud[:784], T, STREAM, shape, noise="both")
        elif kind == "resampled":
            made = resampled(cloud, T, STREAM, shape, points=512)
        else:
            made = cropped(cloud, T, STREAM, shape, keep=0.7)
        frame = LocalFrame.of(Problem(source=made.source, target=made.target))
        yield frame.source, frame.target, frame.to_local(T)


def noise_of_channels(encoder: VectorEncoder, dataset: Dataset, kind: Kind, first: int, last: int) -> Tensor:
    """Return N, the mean of (z_Y - R z_X)(z_Y - R z_X)^T / |z_X|^2 over pairs, divided by its trace: (C, C)."""
    total = torch.zeros_like(encoder.mixing)
    for source, target, T in self_made_pairs(dataset, kind, first, last):
        z_source, z_target = (encoder.channels(torch.from_numpy(cloud)[None])[0] for cloud in (source, target))
        residual = z_target - z_source @ torch.from_numpy(T[:3, :3]).T
        total += residual @ residual.T / z_source.square().sum()
    return total / total.trace()


def fit_mixing(encoder: VectorEncoder, dataset: Dataset, shapes: int) -> None:
    """Set the encoder's mixing matrix to N^(-1/2), of Frobenius norm sqrt(C)."""
    N = noise_of_channels(encoder, dataset, "noise", 0, shapes)
    N += RESAMPLED_WEIGHT * noise_of_channels(encoder, dataset, "resampled", 0, shapes)
    N += RIDGE * N.trace() / len(N) * torch.eye(len(N), dtype=N.dtype)
    values, axes = torch.linalg.eigh(N)
    mixing = (axes * values.rsqrt()).T
    encoder.mixing.copy_(mixing * (len(N) ** 0.5 / torch.linalg.matrix_norm(mixing)))


def fit_matcher(matcher: Matcher, dataset: Dataset, shapes: int) -> None:
    """Set the matcher's projection by linear discriminant analysis on crops.

    Classes are points: what differs between a point's two descriptors, one in each crop, is noise, what differs
    between points is signal; the directions of greatest ratio are kept, scaled to unit noise.
    """
    differences, every = [], []
    for source, target, T in self_made_pairs(dataset, "partial", 0, shapes):
        of_source, of_target = (local_descriptors(torch.from_numpy(cloud)) for cloud in (source, target))
        distances, partners = (np.asarray(found) for found in cKDTree(target).query(transform(T, source)))
        same = distances < SAME_POINT
        differences.append(of_source[same] - of_target[partners[same]])
        every += [of_source[::5], of_target[::5]]
    noise, signal = torch.cat(differences), torch.cat(every)
    within = noise.T @ noise / len(noise) + 1e-3 * signal.var(dim=0).diag()
    values, axes = torch.linalg.eigh(within)
    whitening = axes * values.rsqrt()
    _, directions = torch.linalg.eigh((signal @ whitening).T.cov())
    matcher.projection.copy_((whitening @ directions.flip(1))[:, : matcher.projection.shape[1]])


def validated(encoder: VectorEncoder, matcher: Matcher, dataset: Dataset) -> dict[str, float]:
    """Return figures on shapes that the fit has not seen: the closed form's errors, the matcher's right matches."""
    figures: dict[str, float] = {}
    kinds: tuple[Kind, ...] = ("noise", "resampled")
    for kind in kinds:
        errors = []
        for source, target, T in self_made_pairs(dataset, kind, FITTED, FITTED + VALIDATED):
            z_source, z_target = (encoder(torch.from_numpy(cloud)[None]) for cloud in (source, target))
            rotations, _ = closed_form(z_source, z_target)
            cosine = (np.trace(rotations[0].numpy().T @ T[:3, :3]) - 1) / 2
            errors.append(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
        figures[f"{kind}_median_rotation_error_deg"] = float(np.median(errors))
        figures[f"{kind}_share_under_5_deg"] = float(np.mean(np.array(errors) < 5))
    found = []
    for source, target, T in self_made_pairs(dataset, "partial", FITTED, FITTED + VALIDATED):
        of_source, of_target = (matcher(torch.from_numpy(cloud)).numpy() for cloud in (source, target))
        misses = transform(T, source) - target[np.asarray(cKDTree(of_target).query(of_source)[1])]
        found.append(float(np.mean(np.linalg.norm(misses, axis=1) < SAME_POINT)))
    figures["partial_median_share_of_right_matches"] = float(np.median(found))
    return figures


@torch.no_grad()
def fit(data: Path, folder: Path, shapes: int = FITTED) -> None:
    """Fit both and write folder/equivariant.safetensors and folder/matcher.safetensors with their cards.

    Raises:
        UserError: ModelNet40 is not prepared in `data`.
    """
    dataset = open_dataset("modelnet40", data)
    encoder, matcher = VectorEncoder(), Matcher()
    before = validated(encoder, matcher, dataset)
    started = time.monotonic()
    fit_mixing(encoder, dataset, shapes)
    fit_matcher(matcher, dataset, shapes)
    hours = (time.monotonic() - started) / 3600
    after = validated(encoder, matcher, dataset)
    card: dict[str, Any] = {
        "supervision": "unsupervised",
        "trains": "latentcem",
        "data": f"modelnet40, {dataset.sha256}",
        "split": f"train: {shapes} shapes fitted, {VALIDATED} others validated, no label of a protocol's pair",
        "seed": STREAM,
        "steps": 0,
        "method": "closed form (regbench_latentcem/fitting.py)",
        "hours": round(hours, 4),
        "device": "cpu",
    }
    for name, network, monitor, configuration in (
        ("equivariant", encoder, "noise_median_rotation_error_deg", {"channels": len(encoder.weight)}),
        ("matcher", matcher, "partial_median_share_of_right_matches", {"size": matcher.projection.shape[1]}),
    ):
        own = {
            "configuration": configuration,
            "monitor": monitor,
            "validation": after,
            "validation_before_the_fit": before,
        }
        tensors = {key: tensor.float() for key, tensor in network.state_dict().items()}
        save_weights(folder / f"{name}.safetensors", tensors, card | own)


def main() -> None:
    """Read the command line and fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the prepared datasets")
    parser.add_argument("--out", type=Path, required=True, help="folder to write the weights into")
    arguments = parser.parse_args()
    fit(arguments.data, arguments.out)


if __name__ == "__main__":
    main()
