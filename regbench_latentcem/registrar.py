"""LatentCEM as a method of regbench."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from regbench.contract import MotionPrior, Problem, Registrar, Registration
from regbench.geometry.local_frame import LocalFrame
from regbench.geometry.se3 import rotation_from_euler_deg, se3
from regbench.learning.training_words import training_words

if TYPE_CHECKING:
    from .planner import Plan


class LatentCem(Registrar):
    """Registration by planning with a latent dynamic model (Jiang et al., IJCAI 2021).

    Both clouds are centred and measured in extents of the target, and the source is turned by the start's rotation;
    the planner (Algorithm 1) searches what is left, a rotation and a small translation, about none.

    Args:
        model: "paper", the learned networks; or "equivariant", whose latent state turns with the cloud, so that the
            transformation network is exact and d is the distance of the latent states.
        weights: Name of the learned weights in this package, or a path that ends in .safetensors; "default": those of
            the model; "none": random ones, for "equivariant".
        refine: What follows the planner: "none"; "icp"; or "verify": the answers and elites of several planners, and
            motions that matched points agree on, are ranked by the true Chamfer distance, the best ones refined by
            ICP, and the one of least residual answered, with minus that residual (in extents of the target) as its
            `confidence`. See refinement.py.
        start: Where the planner searches, mu_0, which the paper does not say: "model" (the mean of the motions that the
            model was trained on; for "equivariant", whose f is exact, no rotation), "centroid" (no rotation, centroids
            matched), "prior" (the mean rotation that the protocol discloses), or "closed_form" (Kabsch on the latent
            states; for "equivariant"). A start that the problem gives replaces the first two. With "prior",
            refine=verify searches the prior's range alone: it answers no rotation that lies outside, unless that is
            what the start becomes.
        matches: Whether refine=verify takes candidates from matched points too; false: from the planners alone.
        T: Iterations of the planner. With 0 its answer is the start.
        N: Candidates in an iteration.
        K: Elites among them.
        sigma0_rad: First standard deviation of the three angles, which the paper does not say either; none: that of
            the trained actions, for "equivariant" 1.
        sigma0_translation: First standard deviation of the translation, in extents of the target; none: likewise,
            for "equivariant" 0.5.
        restarts: Planners of refine=verify, each with random draws of its own.
        icp_iterations: Most iterations of ICP.
    """

    name = "latentcem"
    kind = "learned"
    requires = ("torch", "safetensors")
    presets: ClassVar = {"paper": {"model": "paper", "refine": "none", "T": 10, "N": 1000, "K": 25}}
    _networks: Any = None
    _matcher: Any = None

    def __init__(
        self,
        *,
        model: Literal["paper", "equivariant"] = "paper",
        weights: str = "default",
        refine: Literal["none", "icp", "verify"] = "none",
        start: Literal["model", "centroid", "prior", "closed_form"] = "model",
        matches: bool = True,
        T: int = 10,
        N: int = 1000,
        K: int = 25,
        sigma0_rad: float | None = None,
        sigma0_translation: float | None = None,
        restarts: int = 4,
        icp_iterations: int = 100,
    ) -> None:
        self.model = model
        self.weights = weights
        self.refine = refine
        self.start = start
        self.matches = matches
        self.T = T
        self.N = N
        self.K = K
        self.sigma0_rad = sigma0_rad
        self.sigma0_translation = sigma0_translation
        self.restarts = restarts
        self.icp_iterations = icp_iterations

    def prepare(self) -> None:
        """Load the networks.

        Raises:
            UserError: The weights are missing, damaged, or of another model; or start=closed_form for "paper".
        """
        from regbench.errors import UserError

        from .loading import load_matcher, load_model

        if self.model == "paper" and self.start == "closed_form":
            raise UserError("latentcem: start=closed_form needs model=equivariant; the paper's latent state has none")
        self._networks = load_model(self.model, self.weights).eval().requires_grad_(False)
        if self.refine == "verify" and self.matches:
            self._matcher = load_matcher().requires_grad_(False)

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the start is taken from it."""
        if self.start == "prior" and problem.motion_prior is None:
            return "start=prior needs a motion prior, and the protocol discloses none"
        return None

    def data_files(self) -> list[Path]:
        """Return the weight files in use."""
        from .weight_files import matcher_path, named, weight_files

        name = named(self.model, self.weights)
        files = [] if name == "none" else [weight_files().file(name)]
        return files + ([matcher_path()] if self.refine == "verify" and self.matches else [])

    def training(self) -> str | None:
        """Return what the weights' card says of their training."""
        from .weight_files import named, weight_files

        name = named(self.model, self.weights)
        return None if name == "none" else training_words(weight_files().file(name))

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has no points, T, N and K do not fit together, or there is no prior to start from.
            UserError: As `prepare`.
        """
        if self._networks is None:
            self.prepare()
        frame = LocalFrame.of(problem)
        times = [_now_s(problem.device)]
        start = self._start(problem, frame)
        z_source, z_target = self._states(frame, start, problem.device)
        times.append(_now_s(problem.device))
        found = self._plan(z_source, z_target, start, problem)
        times.append(_now_s(problem.device))
        T_local, confidence = self._refine(found, frame, start, problem.motion_prior)
        times.append(_now_s(problem.device))
        return Registration(
            T_target_source=frame.from_local(T_local),
            iterations=self.T,
            confidence=confidence,
            stages_s=dict(zip(("encode", "plan", "refine"), np.diff(times).tolist(), strict=True)),
        )

    def search(self, problem: Problem) -> tuple[LocalFrame, NDArray[np.float64], Plan]:
        """Return the planner's search with all its candidates, in the local frame: for a picture of it.

        Between them stands the rotation by which the source is turned before any action, (4, 4).

        Raises:
            ValueError: As `register`.
            UserError: As `prepare`.
        """
        if self._networks is None:
            self.prepare()
        frame = LocalFrame.of(problem)
        start = self._start(problem, frame)
        found = self._plan(*self._states(frame, start, problem.device), start, problem, keep_candidates=True)
        return frame, se3(start[:3, :3], np.zeros(3)), found

    def _states(self, frame: LocalFrame, start: NDArray[np.float64], device: str) -> tuple[Any, Any]:
        """Return the latent states of the source, turned by the start's rotation, and of the target."""
        return self._encode(frame.source @ start[:3, :3].T, device), self._encode(frame.target, device)

    def _encode(self, cloud: NDArray[np.float64], device: str) -> Any:
        """Return the latent state of one (N, 3) cloud, as a batch of one."""
        import torch

        networks = self._networks.to(device)
        dtype = next(networks.parameters()).dtype
        return networks.encode(torch.tensor(cloud, dtype=dtype, device=device)[None])

    def _start(self, problem: Problem, frame: LocalFrame) -> NDArray[np.float64]:
        """Return where the planner searches as a (4, 4) motion in the local frame."""
        if self.start == "closed_form":
            from .equivariant import closed_form

            rotations, translations = closed_form(*self._states(frame, np.eye(4), problem.device))
            return se3(rotations[0].cpu().numpy(), translations[0].cpu().numpy())
        if self.start == "prior":
            if problem.motion_prior is None:
                raise ValueError("start=prior needs a motion prior, and the problem discloses none")
            return se3(problem.motion_prior.mean_T_target_source()[:3, :3], np.zeros(3))
        if problem.init_T_target_source is not None:
            return frame.to_local(problem.init_T_target_source)
        angle_deg = np.degrees(self._networks.first_actions.start_rad) if self.start == "model" else 0.0
        return se3(rotation_from_euler_deg([angle_deg] * 3), np.zeros(3))

    def _plan(
        self,
        z_source: Any,
        z_target: Any,
        start: NDArray[np.float64],
        problem: Problem,
        *,
        keep_candidates: bool = False,
    ) -> Plan:
        """Run the planner; for refine=verify several of them, the first as it is alone."""
        import torch

        from .planner import generators_of, plan

        seeds = [problem.seed]
        first = self._networks.first_actions
        sigma0_rad = first.deviation_rad if self.sigma0_rad is None else self.sigma0_rad
        sigma0_translation = first.deviation_translation if self.sigma0_translation is None else self.sigma0_translation
        sigma0 = [sigma0_rad] * 3 + [sigma0_translation] * 3
        if self.refine == "verify":
            seeds += np.random.SeedSequence(problem.seed).generate_state(self.restarts - 1).tolist()
            if self.start == "prior" and problem.motion_prior is not None:
                # No wider than half of the range.
                range_deg = np.subtract(problem.motion_prior.angle_max_deg, problem.motion_prior.angle_min_deg)
                sigma0[:3] = np.minimum(sigma0[:3], np.radians(range_deg) / 2).tolist()
        parameter = next(self._networks.parameters())
        return plan(
            self._networks.reward(z_source, z_target),
            torch.tensor([0.0, 0.0, 0.0, *start[:3, 3]]).to(parameter).repeat(len(seeds), 1),
            torch.tensor(sigma0).to(parameter).repeat(len(seeds), 1),
            iterations=self.T,
            candidates=self.N,
            elites=self.K,
            generators=generators_of(seeds),
            keep_candidates=keep_candidates,
        )

    def _refine(
        self, found: Plan, frame: LocalFrame, start: NDArray[np.float64], prior: MotionPrior | None
    ) -> tuple[NDArray[np.float64], float | None]:
        """Return the answer in the local frame, and the confidence in it if there is one."""
        from regbench.geometry.icp import icp

        from .actions import motion_of
        from .refinement import inside, octants, verified

        turned = se3(start[:3, :3], np.zeros(3))
        answers = [motion_of(action) @ turned for action in found.actions.cpu().numpy()]
        if self.refine == "none":
            return answers[0], None
        if self.refine == "icp":
            result = icp(frame.source, frame.target, answers[0], max_iterations=self.icp_iterations)
            return result.T_target_source, None
        # The first iteration's best are the most different from the answers.
        early = found.elites[:1, :, :1].reshape(-1, found.elites.shape[3]).cpu().numpy()
        candidates = [start, *answers, *(motion_of(action) @ turned for action in early)]
        searched = prior if self.start == "prior" else None
        if searched is not None:
            candidates += octants(searched)
        answer = verified(
            candidates,
            frame.source,
            frame.target,
            self.icp_iterations,
            more=lambda: self._matched(frame),
            allowed=lambda T: searched is None or inside(searched, T),
        )
        return answer.T_target_source, -answer.residual

    def _matched(self, frame: LocalFrame) -> list[NDArray[np.float64]]:
        """Return the motions that matched points agree on, in the local frame."""
        if not self.matches:
            return []
        import torch

        return list(self._matcher.motions(torch.from_numpy(frame.source), torch.from_numpy(frame.target)).numpy())


def _now_s(device: str) -> float:
    """Return the time once the device has done what it was given."""
    if device == "cuda":
        import torch

        torch.cuda.synchronize()
    return time.perf_counter()
