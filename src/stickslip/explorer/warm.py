"""Loads the kernels when it is imported, by the process from which workers are forked,
so that each of them starts with compiled kernels.
"""

from contextlib import suppress

from stickslip.explorer import documents, simulate

for simulation in (
    {"method": "contacts", "contacts": 100},
    {"method": "master equation"},
):
    document = documents.first_document() | {"simulation": simulation}
    document["drive"]["distance"] = "5 mm"
    with suppress(Exception):  # the first question of a page will report the error
        for _ in simulate.run({"document": document}, lambda _share: None):
            pass
