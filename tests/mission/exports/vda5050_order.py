"""JSON Schema of an order of VDA 5050, version 2.1, from the fields its specification lists."""

from __future__ import annotations

from typing import Any

TEXT = {"type": "string"}
COUNT = {"type": "integer", "minimum": 0}
ANGLE = {"type": "number", "minimum": -3.14159265359, "maximum": 3.14159265359}
LENGTH = {"type": "number", "minimum": 0}


def strictly(required: dict[str, Any], optional: dict[str, Any]) -> dict[str, Any]:
    """An object of these keys and no others."""
    return {
        "type": "object",
        "required": list(required),
        "properties": {**required, **optional},
        "additionalProperties": False,
    }


ACTION = strictly(
    {"actionType": TEXT, "actionId": TEXT, "blockingType": {"enum": ["NONE", "SOFT", "HARD"]}},
    {
        "actionDescription": TEXT,
        "actionParameters": {
            "type": "array",
            "items": strictly(
                {"key": TEXT, "value": {"type": ["array", "boolean", "number", "string", "object"]}}, {}
            ),
        },
    },
)
POSITION = strictly(
    {"x": {"type": "number"}, "y": {"type": "number"}, "mapId": TEXT},
    {
        "theta": ANGLE,
        "allowedDeviationXY": LENGTH,
        "allowedDeviationTheta": {"type": "number", "minimum": 0, "maximum": 3.141592654},
        "mapDescription": TEXT,
    },
)
NODE = strictly(
    {
        **{"nodeId": TEXT, "sequenceId": {**COUNT, "multipleOf": 2}, "released": {"type": "boolean"}},
        "actions": {"type": "array", "items": ACTION},
    },
    {"nodeDescription": TEXT, "nodePosition": POSITION},
)
EDGE = strictly(
    {
        **{"edgeId": TEXT, "sequenceId": COUNT, "released": {"type": "boolean"}},
        **{"startNodeId": TEXT, "endNodeId": TEXT, "actions": {"type": "array", "items": ACTION}},
    },
    {
        **{"edgeDescription": TEXT, "maxSpeed": LENGTH, "maxHeight": LENGTH, "minHeight": LENGTH},
        **{"orientation": ANGLE, "orientationType": {"enum": ["GLOBAL", "TANGENTIAL"]}, "direction": TEXT},
        **{"rotationAllowed": {"type": "boolean"}, "maxRotationSpeed": LENGTH, "length": LENGTH},
        **{"trajectory": {"type": "object"}, "corridor": {"type": "object"}},
    },
)
ORDER = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    **strictly(
        {
            "headerId": COUNT,
            "timestamp": {"type": "string", "pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d+Z$"},
            "version": {"type": "string", "pattern": r"^2\.\d+\.\d+$"},
            **{"manufacturer": TEXT, "serialNumber": TEXT, "orderId": TEXT, "orderUpdateId": COUNT},
            "nodes": {"type": "array", "items": NODE, "minItems": 1},
            "edges": {"type": "array", "items": EDGE},
        },
        {"zoneSetId": TEXT},
    ),
}
