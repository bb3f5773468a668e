"""What is fuzzed: a reader of bytes from outside, with inputs to begin from and the errors that it may raise.

The oracle is the same for all: a reader returns, or raises one of its documented errors, soon and in bounded
memory. What more must hold (the same result in any segmentation, nothing changed where it was refused) a target
checks itself, and raises `FoundError`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

CORPUS = Path(__file__).parent.parent / "fuzz_corpus"
"""Inputs that once broke a reader, one folder for each target: they are tried first, in each run."""

LONGEST = 16_384
"""Bytes of an input: every sound input to begin from is shorter."""


class FoundError(AssertionError):
    """A reader did something that it must not."""


Try = Callable[[bytes], object]


@dataclass(frozen=True, kw_only=True)
class Target:
    """`opened` sets up what tries share, and returns the function of one try; `errors` may leave the reader."""

    name: str
    what: str
    seeds: Callable[[], list[bytes]]
    errors: tuple[type[Exception], ...]
    opened: Callable[[], contextlib.AbstractContextManager[Try]]

    def starts(self) -> list[bytes]:
        """Return the inputs to begin from: those that once broke it, then the sound ones."""
        kept = sorted((CORPUS / self.name).glob("*")) if (CORPUS / self.name).is_dir() else []
        return [path.read_bytes() for path in kept] + [seed[:LONGEST] for seed in self.seeds()]

    @contextlib.contextmanager
    def trying(self) -> Iterator[Callable[[bytes], bool]]:
        """Return the function of one try, which returns whether the input was accepted."""
        with self.opened() as attempt:

            def one(data: bytes) -> bool:
                try:
                    attempt(data)
                except self.errors:
                    return False
                return True

            yield one


def pure(read: Try) -> Callable[[], contextlib.AbstractContextManager[Try]]:
    """A target without anything to set up."""
    return lambda: contextlib.nullcontext(read)
