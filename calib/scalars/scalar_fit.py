"""From the published numbers of one cut to those of another: properties are fitted to the given ones, predict the rest.

The fit runs on the coarse grid that a calibration screens with; a run on the default grid at its end corrects each
number, and the fit goes on until that correction stands (:mod:`calib.scalars.given_numbers_fit`). A band comes from
draws of what is not fitted (:mod:`calib.scalars.randomised_likelihood`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from calib._version import __version__
from calib.io.folder import prepare, write_json
from calib.io.provenance import code_key, git_commit
from calib.io.typed_document import to_document
from calib.material.scene import cut_scene
from calib.scalars.cut_simulator import COARSE, FINE, CutSimulator
from calib.scalars.fitted_numbers import fitted_numbers
from calib.scalars.given_numbers_fit import fit_given_numbers
from calib.scalars.published_data import PublishedData
from calib.scalars.randomised_likelihood import randomised_fits
from calib.scalars.result import RESULT_FILE, ScalarFitResult
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore, Header
from calib.simulation.workers import Workers
from mpm.scene import Scene

DEFAULT_DRAWS = 32


def fit_scalars(
    published: PublishedData,
    out: Path,
    pool: Workers,
    *,
    draws: int = DEFAULT_DRAWS,
    seed: int = 0,
    resume: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> ScalarFitResult:
    """Fit, predict, and write scalars.json.

    Args:
        published: What was published.
        out: Output folder.
        pool: Where the simulations run.
        draws: Draws from the priors of what is not fitted; 0 for no band.
        seed: Seed of the draws and of the particles.
        resume: Go on with the runs in ``out``.
        say: Called with a line after each batch.

    Returns:
        What scalars.json holds.

    Raises:
        CutcalError: Anything wrong with the input, or a cut that breaks down at the fitted values.
    """
    scenes = {
        fidelity: {
            cut.name: cut_scene(published.food, cut.shape, published.knife, coarse=fidelity == COARSE, seed=seed)
            for cut in published.cuts
        }
        for fidelity in (COARSE, FINE)
    }
    with prepare(out, "scalars", resume=resume):
        with EvaluationStore(out / "evaluations.h5", Header("", "published scalars"), resume=resume, say=say) as store:
            evaluators = {fidelity: _evaluators(named, pool, store, fidelity) for fidelity, named in scenes.items()}
            simulator = CutSimulator(published, evaluators, say)
            best = fit_given_numbers(simulator)
            values = [published.fitted.to_dict(best.z)]
            found = {cut.name: simulator.simulate(cut, values, FINE)[0] or {} for cut in published.cuts}
            drawn = randomised_fits(simulator, best, draws, seed)
        result = ScalarFitResult(
            fitted=fitted_numbers(published, best, found, drawn),
            draws_asked=draws,
            seed=seed,
            evaluations=simulator.runs,
            failed_evaluations=simulator.broken,
            dx_m={name: scene.numerics.dx for name, scene in scenes[FINE].items()},
            device=pool.arch,
            cutcal=__version__,
            commit=git_commit(),
        )
        write_json(out / RESULT_FILE, to_document(result))
        return result


def _evaluators(
    scenes: Mapping[str, Scene], pool: Workers, store: EvaluationStore, fidelity: str
) -> dict[str, CachedEvaluator]:
    """Evaluators of candidates of each cut's scene, through the store."""
    return {
        name: CachedEvaluator(
            pool.evaluator(scene), store, scene=scene.as_dict(), code=code_key(), fidelity=f"{name} {fidelity}"
        )
        for name, scene in scenes.items()
    }
