"""The password that keeps the programs of a card from being read."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError


class Password:
    """None is set at first; it has to be given again after every reset (Software Reference, PASSWORD)."""

    def __init__(self, text: str = "") -> None:
        self.text = text
        self._given = not text

    @property
    def locked(self) -> bool:
        """Whether it is set, and was not given since the last reset."""
        return not self._given

    def give(self, text: str) -> None:
        """Give the password, or set another one when it is given already.

        Raises:
            PmacError: 002, it is another one.
        """
        if self._given:
            self.text = text
        elif text == self.text:
            self._given = True
        else:
            raise PmacError(ErrorCode.PASSWORD, "not the password")

    def lock(self) -> None:
        """Forget that it was given (a reset)."""
        self._given = not self.text

    def clear(self) -> None:
        """Set none, as the factory does."""
        self.text, self._given = "", True
