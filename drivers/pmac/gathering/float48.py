"""The 48-bit floating-point numbers of the controller: 36 bits of mantissa, 12 of exponent.

The signed mantissa is from 0.5 up to 1, or from -1 up to -0.5; it is in the X word and the upper half of the Y
word, the exponent plus 2047 in the lower half. Zero has no bit set. Sources: Turbo PMAC User Manual, computational
features; PMAC User Manual, writing a host communications program.
"""

from __future__ import annotations

import math

_EXPONENT_BITS = 12
_EXPONENT_OFFSET = 2047
_FRACTION_BITS = 35
_SIGN = 1 << _FRACTION_BITS
_MANTISSA = 2 * _SIGN - 1


def encode(value: float) -> int:
    """Return the register value of a number, rounded to its 36 bits, half to even.

    Raises:
        ValueError: not a finite number.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number that a register holds")
    share, exponent = math.frexp(value)
    mantissa = round(math.ldexp(share, _FRACTION_BITS))
    if mantissa == 0:
        return 0
    if mantissa == _SIGN:
        mantissa, exponent = _SIGN // 2, exponent + 1
    elif mantissa == -_SIGN // 2:  # -0.5 is written as -1 of the exponent below
        mantissa, exponent = -_SIGN, exponent - 1
    return (mantissa & _MANTISSA) << _EXPONENT_BITS | exponent + _EXPONENT_OFFSET


def decode(register: int) -> float:
    """Return the number in an unsigned 48-bit register value.

    Raises:
        OverflowError: beyond the range of a Python float.
    """
    exponent = register & ((1 << _EXPONENT_BITS) - 1)
    mantissa = register >> _EXPONENT_BITS
    signed = (mantissa ^ _SIGN) - _SIGN
    return math.ldexp(signed, exponent - _EXPONENT_OFFSET - _FRACTION_BITS)
