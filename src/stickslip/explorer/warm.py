"""Loads the kernels when it is imported: by the process that workers are forked from, so that each is born warm."""

import json
from contextlib import suppress

from stickslip.explorer import documents, simulate


def _warm() -> None:
    begin = documents.first()
    for method in ("contacts", "master equation"):
        document = json.loads(json.dumps(begin))
        document["simulation"] = {"method": method, **({"contacts": 100} if method == "contacts" else {})}
        document["drive"]["distance"] = "5 mm"
        with suppress(Exception):  # the first question will tell
            for _ in simulate.run({"document": document}, lambda _share: None):
                pass


_warm()
