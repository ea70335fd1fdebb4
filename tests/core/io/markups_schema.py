"""What the published markups schema, version 1.0.3, asks of a point list."""

from __future__ import annotations

from typing import Any


def _numbers(n: int) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "minItems": n, "maxItems": n}


_FLAG = {"type": "boolean"}
_TEXT = {"type": "string"}
_NUMBER = {"type": "number"}

_POINT = {
    "type": "object",
    "properties": {
        "id": _TEXT,
        "label": _TEXT,
        "description": _TEXT,
        "associatedNodeID": _TEXT,
        "position": _numbers(3),
        "orientation": _numbers(9),
        "selected": _FLAG,
        "locked": _FLAG,
        "visibility": _FLAG,
        "positionStatus": {"enum": ["undefined", "preview", "defined"]},
    },
}

_DISPLAY_FLAGS = [
    "visibility",
    "propertiesLabelVisibility",
    "pointLabelsVisibility",
    "useGlyphScale",
    "sliceProjection",
    "sliceProjectionUseFiducialColor",
    "sliceProjectionOutlinedBehindSlicePlane",
    "handlesInteractive",
    "translationHandleVisibility",
    "rotationHandleVisibility",
    "scaleHandleVisibility",
]
_DISPLAY_NUMBERS = [
    "opacity",
    "textScale",
    "glyphScale",
    "glyphSize",
    "sliceProjectionOpacity",
    "lineThickness",
    "lineColorFadingStart",
    "lineColorFadingEnd",
    "lineColorFadingSaturation",
    "lineColorFadingHueOffset",
    "interactionHandleScale",
]
_DISPLAY_COLORS = ["color", "selectedColor", "activeColor", "sliceProjectionColor"]

_DISPLAY = {
    "type": "object",
    "properties": {
        **dict.fromkeys(_DISPLAY_FLAGS, _FLAG),
        **dict.fromkeys(_DISPLAY_NUMBERS, _NUMBER),
        **dict.fromkeys(_DISPLAY_COLORS, _numbers(3)),
        "glyphType": _TEXT,
        "snapMode": {"enum": ["unconstrained", "toVisibleSurface"]},
    },
}

_UNIT_CODE = {"type": "array", "items": _TEXT, "minItems": 3, "maxItems": 3}

SCHEMA = {
    "$schema": "http://json-schema.org/draft-07/schema#",
    "type": "object",
    "required": ["@schema", "markups"],
    "properties": {
        "@schema": _TEXT,
        "markups": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["type"],
                "properties": {
                    "type": {"enum": ["Fiducial", "Line", "Angle", "Curve", "ClosedCurve", "Plane", "ROI"]},
                    "name": _TEXT,
                    "coordinateSystem": {"enum": ["LPS", "RAS", "0", "1"]},
                    "coordinateUnits": {"anyOf": [{"enum": ["mm", "um"]}, _UNIT_CODE]},
                    "locked": _FLAG,
                    "fixedNumberOfControlPoints": _FLAG,
                    "labelFormat": _TEXT,
                    "lastUsedControlPointNumber": {"type": "integer"},
                    "controlPoints": {"type": "array", "items": _POINT},
                    "measurements": {"type": "array"},
                    "display": _DISPLAY,
                },
            },
        },
    },
}
