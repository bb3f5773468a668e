"""The fixtures of the console serve here, too."""

from tests.console.conftest import aligned, close, console, data_folder, in_copies, job_file, pytest_pyfunc_call

__all__ = ["aligned", "close", "console", "data_folder", "in_copies", "job_file", "pytest_pyfunc_call"]
