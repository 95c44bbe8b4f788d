"""NUTS of numpyro on a JAX simulation of the same model.

    python -m benchmarks.peers.nuts TASK --seed 0

The affine maps of all intervals do not depend on the state, so they are computed for all samples at
once; the recursion over the samples is a scan, eight samples per iteration.  Reverse-mode
differentiation in double precision gives the gradient.  The chains run as one vectorised program,
start from draws of the normal approximation and move in coordinates that make it a standard normal.
All functions are compiled before they are timed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from math import factorial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from numpyro.infer import NUTS

from benchmarks.peers.child import TARGET, Stopwatch, ess_min, posterior_line, report
from benchmarks.peers.task import Task

__all__ = ["gradient_seconds", "main", "potential_of"]

_ORDER = 8
_UNROLLED = 8
_CHAINS = 4
_WARM_UP = 200
_CHUNK = 50
_LONGEST_S = 120.0


def _maps(task: Task, values: Any) -> tuple[Any, ...]:
    """Entries of the transition matrix and of the input of all intervals, (n_sample, n_run)."""
    ra25, alpha_ra, kt25, alpha_kt, inertia, friction, inductance = values
    h, heat = task.interval[0], task.temperature.T - 25.0
    kt = kt25 * (1.0 + alpha_kt * heat)
    a, k = h * ra25 * (1.0 + alpha_ra * heat) / inductance, h * kt / inductance
    c, b = h * kt / inertia, h * friction / inertia
    trace, determinant = -(a + b), a * b + k * c
    # phi(M) = (exp(M) - I) / M = p I + q M by Cayley and Hamilton, Horner's scheme.
    p, q = jnp.full_like(a, 1.0 / factorial(_ORDER + 1)), jnp.zeros_like(a)
    for n in range(_ORDER, 0, -1):
        p, q = 1.0 / factorial(n) - q * determinant, p + q * trace
    p11, p12, p21, p22 = p - q * a, -q * k, q * c, p - q * b
    u = h * task.voltage.T / inductance
    return (
        1.0 - p11 * a + p12 * c, -p11 * k - p12 * b, -p21 * a + p22 * c, 1.0 - p21 * k - p22 * b,
        p11 * u, p21 * u,
    )  # fmt: skip


def potential_of(task: Task) -> Callable[[Any], Any]:
    """Negative log density of one point (9,) in standardised coordinates.

    Args:
        task: Data and posterior.
    """
    logged = jnp.asarray(task.current.T), jnp.asarray(task.speed.T)

    def stepped(carry: Any, row: Any) -> tuple[Any, None]:
        i, w, of_current, of_speed = carry
        a11, a12, a21, a22, b1, b2, logged_current, logged_speed = row
        of_current += (logged_current - i) ** 2
        of_speed += (logged_speed - w) ** 2
        return (a11 * i + a12 * w + b1, a21 * i + a22 * w + b2, of_current, of_speed), None

    def potential(z: Any) -> Any:
        point = task.centre + task.root @ z
        position, deviation = point[:7], point[7:]
        logs = jnp.exp(jnp.where(task.is_log == 1, position, 0.0))
        values = jnp.where(task.is_log == 1, logs, position * task.scale)
        starts = task.states + task.response @ (position - task.centre[:7])
        zero = jnp.zeros(starts.shape[0])
        carry = (starts[:, 0], starts[:, 1], zero, zero)
        rows = (*_maps(task, values), *logged)
        (*_, of_current, of_speed), _ = lax.scan(stepped, carry, rows, unroll=_UNROLLED)
        sums = jnp.stack([of_current.sum(), of_speed.sum()])
        prior = 0.5 * jnp.sum(((position - task.prior_mean) / task.prior_sd) ** 2)
        inside = jnp.all((position >= task.lower) & (position <= task.upper))
        channels = task.counts * deviation + 0.5 * sums * jnp.exp(-2.0 * deviation)
        return jnp.where(inside, prior + jnp.sum(channels), jnp.inf)

    return potential


def _compiled(task: Task, seed: int) -> tuple[Any, Any]:
    """Initial state of all chains, and the compiled function of `_CHUNK` steps."""
    # The coordinates are standardised already, so only the step size is adapted.
    kernel = NUTS(potential_fn=potential_of(task), step_size=0.5, adapt_mass_matrix=False)
    keys = jax.random.split(jax.random.PRNGKey(seed), _CHAINS)
    start = np.random.default_rng(seed).standard_normal((_CHAINS, task.centre.size))
    state = kernel.init(keys, _WARM_UP, jnp.asarray(start), (), {})

    def step(state: Any, _: Any) -> tuple[Any, Any]:
        state = kernel.sample(state, (), {})  # of all chains: `init` had a key for each
        return state, (state.z, state.num_steps, state.diverging)

    advance = jax.jit(lambda state: lax.scan(step, state, None, length=_CHUNK))
    return state, advance.lower(state).compile()


def main() -> None:
    """Sample until the target and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003
    task, watch = Task.load(chosen.task), Stopwatch()
    with watch.timed("first call"):
        state, advance = _compiled(task, chosen.seed)
    with watch.timed("warm-up"):
        for _ in range(_WARM_UP // _CHUNK):
            state, _ = jax.block_until_ready(advance(state))
    kept, steps, diverged = [], [], 0
    while True:
        with watch.timed("sampling"):
            state, (z, taken, diverging) = jax.block_until_ready(advance(state))
        kept.append(np.asarray(z))
        steps.append(np.asarray(taken))
        diverged += int(np.sum(diverging))
        chain = task.physical(task.centre + np.concatenate(kept) @ task.root.T)
        if ess_min(chain) >= TARGET or watch.wall["sampling"] > _LONGEST_S:
            break
    line = posterior_line(watch, chain, 1.0)
    line["leapfrog_steps"] = float(np.mean(np.concatenate(steps)))
    line["divergent"] = diverged
    line["steps"], line["evaluations"] = chain.shape[0], int(np.sum(np.concatenate(steps)))
    line["gradient_s"] = gradient_seconds(task)
    report(line, ("jax", "numpyro", "numpy"))


def gradient_seconds(task: Task) -> float:
    """Wall time of one gradient of one of the chains, run together [s]."""
    gradient = jax.jit(jax.vmap(jax.value_and_grad(potential_of(task))))
    z = jnp.zeros((_CHAINS, task.centre.size))
    jax.block_until_ready(gradient(z))
    begun = time.perf_counter()
    jax.block_until_ready(gradient(z))
    return (time.perf_counter() - begun) / _CHAINS


if __name__ == "__main__":
    main()
