"""What stands out in a sweep, gathered while its rows go by."""

import re
from collections.abc import Iterable, Iterator

import numpy as np

from ...engine.sweeps.figures import OK, figures
from ...engine.sweeps.sweep import Block
from .output import print_table, significant

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


class Summary:
    """The least and the greatest of each figure, and why cars failed."""

    def __init__(self):
        self._cars = 0
        self._extremes: dict[str, list[tuple[float, int]]] = {}
        self._failed: dict[str, list] = {}

    def noting(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """The same blocks, each noted as it goes by."""
        for block in blocks:
            self._note(block)
            yield block

    def print(self) -> None:
        """Print failures, then the table of figures."""
        failed = sum(count for count, _, _ in self._failed.values())
        if failed:
            count, number, sentence = max(self._failed.values(), key=lambda group: group[0])
            print(
                f"{failed} of {self._cars} cars failed, {count} of them like car {number}:"
                f" {sentence}"
            )
        rows = [("figure", "unit", "least", "car", "greatest", "car")]
        for figure in figures():
            if figure.name in self._extremes:
                ends = [
                    (significant(value * figure.display_factor, 4), str(number))
                    for value, number in self._extremes[figure.name]
                ]
                rows.append((figure.label, figure.display_unit, *ends[0], *ends[1]))
        if len(rows) > 1:
            print_table(rows, right=(2, 3, 4, 5))

    def _note(self, block: Block) -> None:
        self._cars += len(block["car"])
        for figure in figures():
            values = block[figure.name]
            if np.all(np.isnan(values)):
                continue
            here = [int(np.nanargmin(values)), int(np.nanargmax(values))]
            found = [(float(values[k]), int(block["car"][k])) for k in here]
            least, greatest = self._extremes.get(figure.name, found)
            self._extremes[figure.name] = [
                min(least, found[0], key=lambda one: one[0]),
                max(greatest, found[1], key=lambda one: one[0]),
            ]
        for k in np.flatnonzero(block["status"] != OK):
            sentence = block["status"][k]
            # Failures of one kind differ in their numbers.
            group = self._failed.setdefault(
                _NUMBER.sub("", sentence), [0, int(block["car"][k]), sentence]
            )
            group[0] += 1
