"""`ridetune simulate`: one car on a road, driven by recorded rims, or on a four-post rig."""

import math
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...engine.errors import SimulationError
from ...engine.identification.bands import Bands, bands
from ...engine.identification.kept_fit import KeptFit, read_fit
from ...engine.measurement import run_to_csv
from ...engine.run import Run
from ...engine.simulation.metrics import metrics
from .excitation import doubts, excitation, files_read, mode_of
from .inputs import find_vehicle
from .output import (
    print_fit_percent,
    print_table,
    print_warnings,
    require_place,
    significant,
    write_file,
)


def simulate(options: Namespace) -> None:
    """Simulate in the mode that the options name, print the report, write the run."""
    mode = mode_of(options)
    if not options.output and mode != "rims":
        raise SimulationError("Nothing says where the run goes; add -o run.csv.")
    places = [options.output, *_band_files(options)]
    for place in places:
        require_place(place, files_read(options))
    vehicle = find_vehicle(options.vehicle)
    driven = excitation(options, mode, vehicle)
    fit = _fit(options.vehicle) if options.bands else None
    simulation = driven.simulate(vehicle, options.model)
    if simulation.fit_percent:
        print_fit_percent({simulation.run.name: simulation.fit_percent})
    if options.output:
        write_file(options.output, run_to_csv(simulation.run))
        print(f"Wrote {options.output}: {simulation.run.time.size} samples.")
    shares = simulation.negative_load_share.items()
    lost = [f"{corner} {100.0 * share:.1f} %" for corner, share in shares if share > 0.0]
    if lost:
        print(f"Share of the time with a tyre load at or below zero: {', '.join(lost)}.")
    print_warnings([*doubts(driven), *simulation.warnings])
    if fit is not None:
        found = bands(fit, vehicle, driven, method=options.bands, model=options.model)
        _print_figures(simulation.run, found)
        print_warnings(found.warnings)
        for place, side in zip(_band_files(options), (found.lower, found.upper), strict=False):
            closed = {name: side[name] for name in side.columns if np.isfinite(side[name]).all()}
            write_file(place, run_to_csv(replace(side, channels=closed)))
            print(f"Wrote {place}: {len(closed)} channels.")


def _band_files(options: Namespace) -> list[Path]:
    """Where the ends of the bands go: beside the run."""
    if not (options.bands and options.output):
        return []
    run = Path(options.output)
    return [run.with_name(f"{run.stem}.{side}{run.suffix}") for side in ("lower", "upper")]


def _fit(name: str) -> KeptFit:
    if not Path(name).is_file():
        raise SimulationError(
            f"--bands needs the errors of a fit, and {name} has none; give --vehicle the file that"
            " ridetune identify wrote."
        )
    return read_fit(name)


def _print_figures(run: Run, found: Bands) -> None:
    """Print every figure with its interval."""
    rows = [("figure", "value", "from", "to (95 %)", "unit")]
    for one in metrics(run):
        ends = [end * one.display_factor for end in found.figures.get(one.name, ())]
        told = [significant(end, 4) if math.isfinite(end) else "open" for end in ends]
        low, high = told or ("counted", "no band")
        value = significant(one.value * one.display_factor, 4)
        rows.append((one.label, value, low, high, one.display_unit))
    print_table(rows, right=(1, 2, 3))
