"""The base of all answers: each prints as a short text, and converts to plain numbers and texts."""

import html
import math
from dataclasses import fields, is_dataclass
from typing import Any


class Answer:
    """Base of the records that answer a question; a record says what it found in ``__str__``."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists, as JSON takes them; what is not finite is None."""
        found: dict[str, Any] = plain(self)
        return found


def plain(value: Any) -> Any:
    """Return what JSON can hold of a record, mapping, sequence, array or value; what is not finite becomes None.

    Beside a number of a record that has an error there is one.
    """
    if is_dataclass(value) and not isinstance(value, type):
        held = {field.name: getattr(value, field.name) for field in fields(value)}
        errors = {f"{name}_error": each.error for name, each in held.items() if hasattr(each, "error")}
        return {name: plain(each) for name, each in (held | errors).items()}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return {"real": plain(value.real), "imag": plain(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return plain(value.tolist()) if hasattr(value, "tolist") else str(value)
