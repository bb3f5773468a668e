"""How a part is cut, in two words: with which compensation, and how much of it."""

from __future__ import annotations

from console.session.state import Armed
from console.session.work import Work
from console.text.catalogue import Catalogue


def made_words(text: Catalogue, compensation: str | None, stage: str) -> str:
    """Return compensation and stage; `compensation` is the version that was learned, None the model."""
    what = text("made.model") if compensation is None else text("made.learned", version=compensation)
    return f"{what}, {text(f'made.{stage}')}"


def chosen_words(text: Catalogue, work: Work) -> str:
    """Return what is chosen for the job in hand; of a version that is another once more also that."""
    learned = work.compensation
    if learned is None or learned.reverts is None:
        return made_words(text, None if learned is None else str(learned.version), work.stage)
    older = text("made.model") if learned.is_model else str(learned.reverts)
    return made_words(text, f"{learned.version} (= {older})", work.stage)


def armed_words(text: Catalogue, armed: Armed) -> str:
    """Return what was armed."""
    return made_words(text, armed.made.version, armed.made.stage)
