"""An import contract: no module imports itself by way of others."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, output


class NoCircles(Contract):
    """Modules of the root packages have an order in which each imports only those before it."""

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Return whether it is kept, with the first circle that is found."""
        order = TopologicalSorter(
            {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
        )
        try:
            order.prepare()
        except CycleError as circle:
            return ContractCheck(kept=False, metadata={"circle": circle.args[1]})
        return ContractCheck(kept=True)

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Print the circle."""
        output.print_error(" imports ".join(reversed(check.metadata["circle"])), bold=True)
