"""Records of the shop, in a folder for as long as a command reads them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager

from console.cli.measured.records_report import filters_of
from console.site.shop.reading import ShopQuery, shop_folder


@contextmanager
def shop_records(options: Namespace) -> Iterator[None]:
    """Let `console records` read what its action needs of the shop. Raises SessionError: as `shop_folder`."""
    with shop_folder(options.shop, _query(options)) as found:
        options.data, options.lathes = str(found.path), found.lathes
        yield


def _query(options: Namespace) -> ShopQuery:
    if options.action in ("show", "debrief"):
        return ShopQuery(lathe=options.lathe, run=options.run)
    # One more than a list shows: it says whether there are more.
    whole, limit = options.action == "export", options.limit + 1
    return ShopQuery(lathe=options.lathe, filters=filters_of(options), limit=limit, whole=whole)
