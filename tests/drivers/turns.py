"""Several hosts of one simulated card that take turns: each line goes out when the test says whose turn it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from threading import Semaphore, Thread

from drivers.link.base import Link
from drivers.link.passing import PassingLink

TIMEOUT_S = 20.0


class TurnLink(PassingLink):
    """A link whose lines wait for their turn. All that happens between two lines of one host happens at once."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.gated = self.over = False
        self._may_go, self._waits = Semaphore(0), Semaphore(0)

    def send(self, data: bytes) -> None:
        if self.gated and data.endswith(b"\r"):
            self._waits.release()
            assert self._may_go.acquire(timeout=TIMEOUT_S)
        super().send(data)

    def next_line(self) -> None:
        """Let one line out, and wait until its host has come to the next one, or to its end."""
        self._may_go.release()
        self.wait()

    def wait(self) -> None:
        assert self._waits.acquire(timeout=TIMEOUT_S)

    def ended(self) -> None:
        self.over = True
        self._waits.release()


class Turns:
    """Hosts that do something at once, line by line, in the order that `run` is given."""

    def __init__(self, links: Iterable[TurnLink]) -> None:
        self._links = tuple(links)

    def run(self, acts: Iterable[Callable[[], object]], order: Iterable[int]) -> None:
        """Begin what each host does, and let their lines out in this order of hosts; then the rest, in turn."""
        threads = []
        for link, act in zip(self._links, acts, strict=True):
            link.gated, link.over = True, False
            threads.append(Thread(target=self._work, args=(link, act)))
            threads[-1].start()
            link.wait()
        turns = iter(order)
        while waiting := [link for link in self._links if not link.over]:
            turn = next(turns, None)
            link = waiting[0] if turn is None else self._links[turn]
            if not link.over:
                link.next_line()
        for link, thread in zip(self._links, threads, strict=True):
            thread.join(TIMEOUT_S)
            link.gated = False

    @staticmethod
    def _work(link: TurnLink, act: Callable[[], object]) -> None:
        try:
            act()
        finally:
            link.ended()
