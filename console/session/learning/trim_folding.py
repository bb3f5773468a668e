"""What goes from the trim of a cut into the table of the next one.

With three jaws or more the trim at the lobe is the tool's own error, and repeats: all of it goes into the table.
With two jaws the lobe comes twice a turn, and so does the force of an oval blank, at another angle each time. Then
only the mean of what the parts have needed goes in, with some that needed nothing: the oval of one blank would be
on the next part with the wrong angle, and each trim would begin from it.
"""

from __future__ import annotations

from profiles.compensations.causes import OVAL

NEEDED_NOTHING = 4
"""Parts that needed nothing: the force of an oval blank is twice what repeats of it. Assumed."""


class TrimFolding:
    """The corrections, um of the command at the order of the lobe, that the parts of one row have needed."""

    def __init__(self, lobes: int) -> None:
        self.of_blanks = lobes == OVAL
        self._needed: list[complex] = []
        self._in_table = 0j

    @property
    def fraction(self) -> float:
        """What goes into the table of the tool's error at the other orders, after the parts so far.

        Friction couples them to the motion that the oval of a blank makes: the mean, with one part without any.
        """
        return 1.0 / (len(self._needed) + 1) if self.of_blanks else 1.0

    def change(self, trim_um: complex, off_um: complex) -> complex:
        """Return the change of the table, after a part with this trim which the tool was still off by."""
        if not self.of_blanks:
            return trim_um
        self._needed.append(self._in_table + trim_um + off_um)
        before, self._in_table = self._in_table, sum(self._needed) / (len(self._needed) + NEEDED_NOTHING)
        return self._in_table - before
