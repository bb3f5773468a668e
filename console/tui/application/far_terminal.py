"""A terminal that is not at the machine: who works there says once that he sees it, before drives are enabled."""

from __future__ import annotations

WITHIN_S = 10.0  # time in which the key has to be pressed again


class FarTerminal:
    """`client` is the address that the terminal comes from, "" for one at this computer."""

    def __init__(self, client: str = "") -> None:
        self.client = client
        self._asked_s = float("-inf")
        self._sees = False

    def asks(self, now_s: float, *, simulated: bool) -> bool:
        """Whether to ask now that the machine is seen; a second call soon after the first one says so."""
        if not self.client or simulated or self._sees:
            return False
        self._sees = now_s - self._asked_s <= WITHIN_S
        self._asked_s = now_s
        return not self._sees
