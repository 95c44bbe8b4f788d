"""Markdown tables of the attribution benchmark, from its log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bench import EFFECTS

__all__ = ["SHOWS", "tables"]

SHOWS = 0.05
"""Relative increase of the validation error above which an effect is detectable."""


def tables(done: Sequence[dict[str, Any]], command: str, kinds: Sequence[str], asked: int) -> str:
    """Markdown page: success rates, confusion table, and wrong answers to two effects.

    Args:
        done: Lines of the log.
        command: Command that generated the page.
        kinds: Names of the catalogue.
        asked: Number of requested campaigns.
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
        "each; the noise is white, coloured and with outliers in turn, and every second group logs "
        "the angle.",
        "The size of a large effect is from the upper part of its usual range; a small effect "
        "increases the error of the validation runs by 8 to 30 %.",
        "The order of the campaigns is such that the first n are a balanced sample for any n.",
        "",
        f"{len(counted)} of {asked} campaigns; {len(failed)} failed, and {len(skipped)} had no "
        f"effect size that gives the requested error.  Time per campaign on one core, fit and "
        f"search [s]: median {np.median(seconds):.0f}, 90 % quantile "
        f"{np.quantile(seconds, 0.9):.0f}.",
        "",
        "| campaigns | number | criterion | fraction |",
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
            f"| effects that are not detectable in the validation runs | {len(hidden)} | no wrong "
            f"effect named | {100 * right:.0f} % |"
        )
    lines += ["", "## Confusion table", "", "| hidden | number | named |", "|---|---|---|"]
    for name in [*kinds, *[n for n in EFFECTS if n not in kinds]]:
        some = [d for d in counted if [n for n, _ in d["effects"]] == [name] and _shows(d)]
        if some:
            lines.append(f"| `{name}` | {len(some)} | {_answers(some)} |")
    wrong = [d for d in counted if d["group"] == "two" and _shows(d) and not _exact(d)]
    if wrong:
        lines += ["", "## Campaigns with two effects and another answer", ""]
        lines += ["| hidden | named |", "|---|---|"]
    for d in wrong:
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
    """Ratio of the final validation error to the realised noise, over both channels (rms)."""
    return _rms(np.array(d["after"]) / np.array(d["noise_there"]))


def _rms(ratios: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(ratios))))


def _shows(d: dict[str, Any]) -> bool:
    """Return True if the effects, and each of two alone, increase the validation error."""
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
    ("motors without effects", "clean", "no effect named", lambda d: not d["named"]),
    ("one effect, large", "large", "named, no other effect", _exact),
    ("one effect, large", "large", "named or an alternative", _held),
    ("one effect, large", "large", "error of the final model within 2 % of the noise",
     lambda d: _rms(d["after"]) <= 1.02),
    ("one effect, large", "large", "error of the final model within 2 % of the realised noise",
     lambda d: _over_noise(d) <= 1.02),
    ("one effect, large", "large", "error of the final model within 5 % of the noise",
     lambda d: _rms(d["after"]) <= 1.05),
    ("one effect, large", "large", "nominal parameters within 3 sd",
     lambda d: max(np.abs(list(d["deviations"].values()))) <= 3.0),
    ("one effect, large", "large", "nominal parameters inside their 90 % intervals",
     lambda d: np.mean(np.abs(list(d["deviations"].values())) <= 1.645)),
    ("one effect, small", "small", "named", _named),
    ("one effect, small", "small", "named, no other effect", _exact),
    ("two effects", "two", "both named, no other effect", _exact),
    ("two effects", "two", "both named or an alternative", _held),
    ("listed effect type with another law", "law", "effect type named", _named),
    ("listed effect type with another law", "law", "named, no other effect", _exact),
    ("listed effect type with another law", "law",
     "error of the final model within 10 % of the noise",
     lambda d: _rms(d["after"]) <= 1.10),
    ("effects not in the catalogue", "unlisted",
     "`unlisted` with the correct equation and main driver", _traced),
    ("effects not in the catalogue", "unlisted", "`unlisted` named",
     lambda d: "unlisted" in d["named"]),
    ("effects not in the catalogue", "unlisted", "only listed effects named", _claimed),
    ("effects not in the catalogue", "unlisted",
     "half of the excess squared error removed", _halved),
)  # fmt: skip
