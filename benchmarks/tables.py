"""The tables of the attribution benchmark, from its log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bench import EFFECTS

__all__ = ["SHOWS", "tables"]

SHOWS = 0.05
"""Rise of the error on the runs left out above which an effect shows."""


def tables(done: Sequence[dict[str, Any]], command: str, kinds: Sequence[str], asked: int) -> str:
    """The document: what was asked, what was reached, and what was taken for what.

    Args:
        done: Lines of the log.
        command: That made it.
        kinds: Names of the catalogue.
        asked: Campaigns that were asked for.
    """
    counted = [d for d in done if "named" in d]
    failed = [d for d in done if "failed" in d]
    skipped = [d for d in done if "skipped" in d]
    seconds = [d["seconds"] for d in counted]
    lines = [
        "# Attribution of hidden effects",
        "",
        f"Made by `{command}`.",
        "Motors are drawn at random from 1 W to 10 kW, with five training and two validation runs "
        "each, white, coloured and spiky noise by turns, and the angle logged in every second "
        "group.",
        "Sizes are from the upper part of each effect's usual range or, for small ones, such that "
        "the error on the runs left out rises by 8 to 30 %.",
        "The campaigns come in such an order that any beginning of the list is a fair mixture.",
        "",
        f"{len(counted)} of {asked} campaigns; {len(failed)} failed, and {len(skipped)} could not "
        f"be made as small as wanted.  Seconds a campaign on one core, fit and search: median "
        f"{np.median(seconds):.0f}, nine in ten below {np.quantile(seconds, 0.9):.0f}.",
        "",
        "| campaigns | number | what is counted | share |",
        "|---|---|---|---|",
    ]
    for words, group, label, holds in _ROWS:
        some = [d for d in counted if d["group"] == group and (group == "clean" or _shows(d))]
        if some:
            share = float(np.mean([holds(d) for d in some]))
            lines.append(f"| {words} | {len(some)} | {label} | {100 * share:.0f} % |")
    hidden = [d for d in counted if d["group"] != "clean" and not _shows(d)]
    if hidden:
        right = float(
            np.mean([set(d["named"]) <= {name for name, _ in d["effects"]} for d in hidden])
        )
        lines.append(
            f"| effects that hardly show on the runs left out | {len(hidden)} | nothing else "
            f"named | {100 * right:.0f} % |"
        )
    lines += ["", "## What was taken for what", "", "| hidden | number | named |", "|---|---|---|"]
    for name in [*kinds, *[n for n in EFFECTS if n not in kinds]]:
        some = [d for d in counted if [n for n, _ in d["effects"]] == [name] and _shows(d)]
        if some:
            lines.append(f"| `{name}` | {len(some)} | {_answers(some)} |")
    lines += ["", "## Two effects that were not both named, or not alone", ""]
    lines += ["| hidden | named |", "|---|---|"]
    for d in counted:
        if d["group"] == "two" and _shows(d) and not _exact(d):
            named = " + ".join(sorted(d["named"])) or "nothing"
            lines.append(f"| {' + '.join(sorted(n for n, _ in d['effects']))} | {named} |")
    return "\n".join([*lines, ""])


def _answers(some: Sequence[dict[str, Any]]) -> str:
    answers: dict[str, int] = {}
    for d in some:
        words = [
            f"{name} ({', '.join(where)})" if name == "unlisted" else name
            for name, where in sorted(zip(d["named"], d["where"], strict=True))
        ]
        answer = " + ".join(words) or "nothing"
        answers[answer] = answers.get(answer, 0) + 1
    ordered = sorted(answers.items(), key=lambda item: -item[1])
    return "; ".join(f"{answer}: {count}" for answer, count in ordered)


def _over_noise(d: dict[str, Any]) -> float:
    """Error after over the noise that really is in the runs left out, both channels together."""
    return _rms(np.array(d["after"]) / np.array(d["noise_there"]))


def _rms(ratios: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(ratios))))


def _shows(d: dict[str, Any]) -> bool:
    """Whether the effects raise the error, and of two each by itself."""
    alone = min(d["rises"]) if d["group"] == "two" else np.inf
    return _rms(d["before"]) > 1.0 + SHOWS and alone > SHOWS


def _exact(d: dict[str, Any]) -> bool:
    return sorted(d["named"]) == sorted(name for name, _ in d["effects"])


def _held(d: dict[str, Any]) -> bool:
    return {name for name, _ in d["effects"]} <= {*d["named"], *d["alternatives"]}


def _named(d: dict[str, Any]) -> bool:
    return {name for name, _ in d["effects"]} <= set(d["named"])


def _traced(d: dict[str, Any]) -> bool:
    effect = EFFECTS[d["effects"][0][0]]
    return any(
        name == "unlisted" and where[0] == effect.equation and effect.drivers[0] in where[1:]
        for name, where in zip(d["named"], d["where"], strict=True)
    )


def _claimed(d: dict[str, Any]) -> bool:
    return bool(d["named"]) and "unlisted" not in d["named"]


def _halved(d: dict[str, Any]) -> bool:
    before, after = (max(_rms(d[key]) ** 2 - 1.0, 0.0) for key in ("before", "after"))
    return after <= 0.5 * before


_ROWS = (
    ("clean motors", "clean", "nothing added", lambda d: not d["named"]),
    ("one effect, large", "large", "exactly that named", _exact),
    ("one effect, large", "large", "among named or alternatives", _held),
    ("one effect, large", "large", "error after within 2 % of the noise",
     lambda d: _rms(d["after"]) <= 1.02),
    ("one effect, large", "large", "error after within 2 % of the noise in those runs",
     lambda d: _over_noise(d) <= 1.02),
    ("one effect, large", "large", "error after within 5 % of the noise",
     lambda d: _rms(d["after"]) <= 1.05),
    ("one effect, large", "large", "declared parameters within 3 sd",
     lambda d: max(np.abs(list(d["deviations"].values()))) <= 3.0),
    ("one effect, large", "large", "declared parameters inside their 90 % intervals",
     lambda d: np.mean(np.abs(list(d["deviations"].values())) <= 1.645)),
    ("one effect, small", "small", "named", _named),
    ("one effect, small", "small", "exactly that named", _exact),
    ("two effects", "two", "both and nothing else", _exact),
    ("two effects", "two", "both among named or alternatives", _held),
    ("another law of a listed kind", "law", "named by its kind", _named),
    ("another law of a listed kind", "law", "exactly that named", _exact),
    ("another law of a listed kind", "law", "error after within 10 % of the noise",
     lambda d: _rms(d["after"]) <= 1.10),
    ("effects in no catalogue", "unlisted", "`unlisted`, right equation and main driver", _traced),
    ("effects in no catalogue", "unlisted", "`unlisted` named",
     lambda d: "unlisted" in d["named"]),
    ("effects in no catalogue", "unlisted", "claimed as listed ones alone", _claimed),
    ("effects in no catalogue", "unlisted", "half of the excess squared error removed", _halved),
)  # fmt: skip
