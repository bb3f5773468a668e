"""The state shared by all clients of the Ethernet board, and the requests that it answers by itself."""

from __future__ import annotations

from drivers.pmac.ethernet import DPRAM_BYTES, TAKEN, Direction, Request, RequestCode

FACTORY_ADDRESS = bytes((192, 6, 94, 5))

_OWN = frozenset(
    (
        RequestCode.GETMEM,
        RequestCode.SETMEM,
        RequestCode.SETBIT,
        RequestCode.SETBITS,
        RequestCode.IPADDRESS,
        RequestCode.FWDOWNLOAD,
    )
)


class Board:
    """The DPRAM and the settings of one board."""

    def __init__(self) -> None:
        self.dpram = bytearray(DPRAM_BYTES)
        self.ip_address = FACTORY_ADDRESS

    def answer(self, request: Request) -> bytes | None:
        """Return the reply, None when the request is for the controller."""
        if request.code not in _OWN:
            return None
        place, data = request.value, request.data
        match request.code:
            case RequestCode.GETMEM:
                return bytes(self.dpram[place : place + request.length])
            case RequestCode.SETMEM:
                self.dpram[place : place + len(data)] = data
            case RequestCode.SETBIT if request.index:
                self._change_word(place, to_set=data)
            case RequestCode.SETBIT:
                self._change_word(place, to_keep=data)
            case RequestCode.SETBITS:
                to_clear = int.from_bytes(data[4:], "little")
                self._change_word(place, to_set=data[:4], to_keep=(~to_clear & 0xFFFF_FFFF).to_bytes(4, "little"))
            case RequestCode.IPADDRESS:
                # A new address is stored; it would take effect after the next power-up.
                self.ip_address = data if request.direction == Direction.DOWNLOAD else self.ip_address
                return self.ip_address
            case _:
                pass  # firmware is accepted, but the old one keeps running
        return TAKEN

    def _change_word(self, place: int, to_set: bytes = bytes(4), to_keep: bytes = b"\xff" * 4) -> None:
        for number, (one, kept) in enumerate(zip(to_set, to_keep, strict=True), place):
            self.dpram[number] = (self.dpram[number] | one) & kept
