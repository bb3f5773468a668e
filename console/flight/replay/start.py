"""Start of a replay: the recording is read first, and refused before anything is shown."""

from __future__ import annotations

import os
import sys
import tempfile
from argparse import Namespace
from pathlib import Path

from console.flight.cli import replay
from console.text.catalogue import Catalogue


def main(options: Namespace, text: Catalogue) -> int:
    """Play a recording at the terminal, or print what a command without screens prints.

    Raises:
        ProblemError: no such recording, a damaged one, no terminal.
    """
    if options.file is None or options.list or options.text or options.json or options.lesson_file:
        return replay.main(options, text)
    from console.flight.playback import Playback
    from console.flight.recording import read_recording
    from console.flight.replay.replay_app import ReplayApp
    from console.session.appearance import appearance_of
    from console.session.configuration import KEYS
    from console.session.errors import SessionError
    from console.tui.theme import COLOUR, COLOUR_VARIABLE, MONO
    from profiles.problem import Problem

    path = replay.path_of(options)
    if not (sys.stdin.isatty() and sys.stdout.isatty() and sys.stderr.isatty()):
        raise SessionError(Problem(code="flight.no_terminal"))
    playback = Playback(read_recording(path))
    with tempfile.TemporaryDirectory(prefix="trilobe-replay-") as nothing:
        palette = MONO if os.environ.get(COLOUR_VARIABLE) else COLOUR
        configuration = options.configuration
        appearance = appearance_of({key: configuration.value(key) for key in KEYS}, text.language)
        app = ReplayApp(playback, text=text, palette=palette, data=Path(nothing), appearance=appearance)
        app.run(mouse=False)
    if app.fault is not None:
        raise app.fault
    return app.return_code or 0
