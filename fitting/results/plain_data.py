"""Results as plain data, for JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Return ``value`` as lists, dicts, numbers and strings, for JSON; None if not finite."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def json_object(fields: Mapping[str, Any]) -> str:
    """Return ``fields`` as the text of a JSON object, one field a line; NaN is null."""
    lines = (
        f"  {json.dumps(name)}: {json.dumps(plain(value), allow_nan=False)}"
        for name, value in fields.items()
    )
    return "{\n" + ",\n".join(lines) + "\n}\n"
