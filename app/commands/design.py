"""Command ``motorid design``: write the voltage of the next run and its expected gain."""

from __future__ import annotations

from pathlib import Path

from app.commands import options

__all__ = ["design"]


def design(
    out: options.ProfileOut,
    result: options.OptionalResult = None,
    nameplate: options.DesignPlate = None,
    narrow: options.Narrow = None,
    limit: options.DesignLimits = None,
    duration: options.Duration = None,
    rate: options.Rate = None,
    temperature: options.DesignTemperatures = None,
    seed: options.Seed = 0,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Design the next run: the voltage that separates alternatives and narrows parameters.

    Writes columns time_s,voltage_V,temperature_degC with one row per sample, which end at zero
    voltage, and FILE.json with the expected gain.  Every draw of the parameters holds the limits.
    """
    # Imported here: other commands need none of these.
    from app.commands import console
    from app.commands.files import read_result, writable_file
    from identification.design import (
        DesignOptions,
        profile_csv,
        proposal_entry,
        propose,
        task_of_nameplate,
        task_of_result,
    )
    from identification.errors import OptionError
    from identification.result.atomic import write_text
    from identification.result.entries import result_text

    chosen = DesignOptions(
        tuple(limit or ()), duration, rate, tuple(temperature or ()), narrow or "", seed
    )
    if (result is None) == (not nameplate):
        raise OptionError(
            "expected either the result.json of a fit, or --nameplate KEY=VALUE,... of a motor "
            "without runs"
        )
    about = Path(f"{out}.json")
    inputs = () if result is None else (result, result.parent)
    with writable_file(out, inputs=inputs), writable_file(about, inputs=inputs):
        if result is None:
            task = task_of_nameplate(",".join(nameplate or ()), chosen)
        else:
            task = task_of_result(read_result(result), chosen)
        proposal = propose(task)
        entry = proposal_entry(proposal)
        write_text(out, profile_csv(proposal))
        write_text(about, result_text(entry))
    if json:
        console.print_json(entry)
    elif not quiet:
        for line in (*entry["summary"], out, about):
            console.results_console().print(str(line), soft_wrap=True)
