from profiles import cutting as cutting
from profiles import findings as findings
from profiles import job as job
from profiles import least_squares as least_squares
from profiles import machine as machine
from profiles import materials as materials
from profiles import problem as problem
from profiles import roundness as roundness
from profiles import rules as rules
from profiles import store as store
from profiles import traces as traces
from profiles.axis import envelope as envelope
from profiles.axis import envelope as safe_speed
from profiles.axis import identification as identification
from profiles.axis import response as response
from profiles.axis import servo as servo
from profiles.axis import servo as tool_stiffness
from profiles.compensations import learning as learning
from profiles.compensations import next_version as next_version
from profiles.compensations import path as compensation
from profiles.lobe import cut_error as cut_error
from profiles.lobe import lobe_fit as lobe_fit
from profiles.lobe import prediction as prediction

__all__ = [
    "compensation",
    "cut_error",
    "cutting",
    "envelope",
    "findings",
    "identification",
    "job",
    "learning",
    "least_squares",
    "lobe_fit",
    "machine",
    "materials",
    "next_version",
    "prediction",
    "problem",
    "response",
    "roundness",
    "rules",
    "safe_speed",
    "servo",
    "store",
    "tool_stiffness",
    "traces",
]
