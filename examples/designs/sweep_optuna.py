"""A study of optuna over an isolator, by ask and tell: the store keeps what was told, and a new study learns from it."""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import optuna

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
optuna.logging.set_verbosity(optuna.logging.ERROR)
ranges = {
    "k_leg": optuna.distributions.FloatDistribution(2e4, 2e5),
    "c_leg": optuna.distributions.FloatDistribution(10.0, 200.0),
}


def miss(runs, i):
    """Distance of the first mode of a design from 12 Hz and 5 % of damping, both relative."""
    return float((runs["frequency[0]"][i] / 12.0 - 1.0) ** 2 + (runs["damping[0]"][i] / 0.05 - 1.0) ** 2)


def search(n):
    """Go on until ``n`` designs are known."""
    m = mb.examples.cubic_hexapod()
    empty = mb.design.from_table({name: [] for name in ranges})
    runs = mb.sweep(m, empty, mb.outputs.modes(n=1), store=folder / "study")
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
    for i, point in enumerate(runs.designs):  # what earlier runs found
        study.add_trial(optuna.create_trial(params=point, distributions=ranges, value=miss(runs, i)))
    while len(study.trials) < n:
        trials = [study.ask(ranges) for _ in range(5)]
        found = runs.evaluate({name: [trial.params[name] for trial in trials] for name in ranges})
        for i, trial in enumerate(trials):
            study.tell(trial, miss(found, i))
    return study


first = search(25).best_value
study = search(60)
print(f"best distance {first:.1e} after 25 designs, {study.best_value:.1e} after {len(study.trials)}")
print("going on has not lost the best design:", study.best_value <= first)
