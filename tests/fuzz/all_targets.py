"""All targets by name, in the order of the table."""

from __future__ import annotations

from collections.abc import Mapping

from tests.fuzz.of_controller import OF_CONTROLLER
from tests.fuzz.of_feed import OF_FEED
from tests.fuzz.of_files import OF_FILES
from tests.fuzz.of_sockets import OF_SOCKETS
from tests.fuzz.target import Target

TARGETS: Mapping[str, Target] = {each.name: each for each in (*OF_CONTROLLER, *OF_FILES, *OF_FEED, *OF_SOCKETS)}
