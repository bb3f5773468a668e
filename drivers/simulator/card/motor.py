"""A motor of the simulated controller: its host commands, and its reports."""

from __future__ import annotations

from math import inf

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.simulator.card.motor_loop import MotorLoop


class Motor(MotorLoop):
    """A loop that is closed, opened, jogged and homed.

    Reported and commanded positions are the counts of the loop plus `bias`, and `offset_following` keeps the
    followed distance out of the reports.
    """

    @property
    def activated(self) -> bool:
        """Whether Ix00 is set."""
        return self.variable(0) != 0.0

    @property
    def position(self) -> float:
        """Actual position as reported."""
        followed = self.superimposed if self.offset_following else 0.0
        return self.encoder + self.bias - followed

    @property
    def jogging(self) -> bool:
        """Whether a jog or a home search is being played."""
        return self.jog.player is not None

    def enable(self) -> None:
        """Close the loop at the present position."""
        if not self.enabled:
            self.enabled = True
            self._output = None
            self.fatal_error = self.amplifier_fault = False
            here = self.axis.close_loop()
            self.desired, self.velocity = here - self.correction - self.superimposed, 0.0
            self._sample_travel(self.encoder, self.guard)

    def kill(self) -> None:
        """Open the loop; the axis coasts."""
        self.enabled = False
        self._output = None
        self.jog.forget()

    def reset(self) -> None:
        """Start as at power-up: killed, not homed, and at position 0 wherever the axis is."""
        self.read_absolute_position()
        self.fatal_error = self.amplifier_fault = False
        self.home_capture = self.variable_jog = self.correction = self.superimposed = 0.0
        self.stopped_at = None
        self.travel.positive = self.travel.negative = self.travel.stopped = False
        self._power_up_origin = self.axis.origin

    def read_absolute_position(self) -> None:
        """Set the present position to 0, killed and not homed: there is no absolute encoder to read."""
        self.kill()
        self.home_complete = False
        self._rebase(self.encoder)
        self.bias = self.superimposed = 0.0

    def phase(self) -> None:
        """`$`: no phasing is needed; close the loop where the motor stands. Raises PmacError: 018, it moves."""
        if self.velocity or self.jogging:
            raise PmacError(ErrorCode.PHASE_REFERENCE, f"#{self.number} moves")
        self.enable()

    def open_loop(self, percent: float) -> None:
        """Open the loop and hold the output at `percent` of Ix69, limited to 100 as on the controller."""
        output = max(-1.0, min(percent / 100.0, 1.0))
        self.jog.forget()
        self.enabled = False
        self.fatal_error = self.amplifier_fault = False
        self._sample_travel(self.encoder, self.guard)
        self.travel.stopped = self.travel.bars(output)
        self._output = 0.0 if self.travel.stopped else output

    def jog_speed(self, direction: int) -> None:
        """Jog indefinitely in `direction`; 0 stops, and closes the loop of a killed motor."""
        self.enable()
        if self._is_barred(direction):
            return
        speed = direction * abs(self.variable(22))
        if speed:
            self.jog.run_at(speed, self.desired, self.velocity)
        else:
            self.jog.stop(self.desired, self.velocity)

    def jog_to(self, position: float, past_trigger: float | None = None) -> None:
        """Jog to a reported position in counts, after a stop if the motor moves.

        With `past_trigger`, the motor stops at the home trigger and goes that many counts past it.
        """
        self._go_to(position - self.bias, past_trigger)

    def jog_by(self, distance: float, from_actual: bool = False, past_trigger: float | None = None) -> None:
        """Jog by `distance` counts from the commanded position, or from the actual one."""
        self.enable()
        here = self.encoder - self.correction - self.superimposed if from_actual else self.desired
        self._go_to(here + distance, past_trigger)

    def jog_back(self) -> None:
        """Jog to where a stopped program left the motor, or else to where it was before its last jog."""
        self._go_to(self.jog.began_at if self.stopped_at is None else self.stopped_at)
        self.jog.pre_jog = self.jogging and not self.travel.stopped

    def home(self) -> None:
        """Search the home trigger at Ix23; Ix13 and Ix14 are ignored until it is found."""
        self.enable()
        speed = self.variable(23)
        self.home_complete = False
        self.travel.sample(self.encoder, inf, -inf, pins_used=self.guard.switches_used)
        if self._is_barred(speed):
            return
        self.jog.run_at(speed, self.desired, self.velocity)
        self.jog.seek(homes=True)

    def home_zero(self) -> None:
        """Home at the present position without a move; the following error stays what it is."""
        here = self.desired if self.enabled else self.encoder
        self.jog.forget()
        self._declare_home(here, here)

    def know_home(self) -> None:
        """Be homed as if the trigger had been found at machine position 0; nothing moves."""
        self._declare_home(-self.axis.origin, -self.axis.origin)

    def abort(self) -> None:
        """Come to rest at Ix15; an open loop is closed."""
        self.enable()
        self.jog.abort(self.desired, self.velocity)

    def stop_on_limit(self) -> None:
        """Come to rest at Ix15, or remove an open-loop output, because the direction is blocked."""
        if self.enabled:
            self.abort()
        else:
            self._output = 0.0
        self.travel.stopped = True

    def _go_to(self, target: float, past_trigger: float | None = None) -> None:
        self.enable()
        if self._is_barred(target - self.desired):
            return
        self.jog.go_to(target, self.desired, self.velocity)
        if past_trigger is not None and self.jogging:
            self.jog.seek(homes=False, past_trigger=past_trigger)

    def _is_barred(self, direction: float) -> bool:
        """Whether a limit blocks the motion. The motor stops, or stays, without any other report."""
        barred = self.travel.bars(direction)
        self.travel.stopped = barred or (self.travel.stopped and not direction)
        if barred and self.velocity:
            self.jog.stop(self.desired, self.velocity)
        return barred
