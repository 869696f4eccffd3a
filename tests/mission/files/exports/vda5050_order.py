"""JSON Schemas of an order of VDA 5050, versions 2.1 and 3.0, from the fields the specification lists."""

from __future__ import annotations

from typing import Any

Schema = dict[str, Any]
TEXT = {"type": "string"}
YES_OR_NO = {"type": "boolean"}
COUNT = {"type": "integer", "minimum": 0}
ANGLE = {"type": "number", "minimum": -3.14159265359, "maximum": 3.14159265359}
HALF_TURN = {"type": "number", "minimum": -1.570796327, "maximum": 1.570796327}
LENGTH = {"type": "number", "minimum": 0}
SPREAD = {"type": "number", "minimum": 0, "maximum": 3.141592654}


def strictly(required: Schema, optional: Schema) -> Schema:
    """An object of these keys and no others."""
    return {
        "type": "object",
        "required": list(required),
        "properties": {**required, **optional},
        "additionalProperties": False,
    }


def many(item: Schema) -> Schema:
    return {"type": "array", "items": item}


PARAMETER = strictly({"key": TEXT, "value": {"type": ["array", "boolean", "number", "string", "object"]}}, {})
PLACE = {"x": {"type": "number"}, "y": {"type": "number"}, "mapId": TEXT}
NUMBERED = {"sequenceId": COUNT, "released": YES_OR_NO}
ALONG = {
    **{"orientation": ANGLE, "orientationType": {"enum": ["GLOBAL", "TANGENTIAL"]}, "direction": TEXT},
    **{"maxRotationSpeed": LENGTH, "length": LENGTH},
    **{"trajectory": {"type": "object"}, "corridor": {"type": "object"}},
}


def order(version: str, action: Schema, node: Schema, edge: Schema, optional: Schema) -> Schema:
    """An order of nodes at even places in the sequence, and edges with these actions."""
    nodes = strictly({"nodeId": TEXT, **NUMBERED, "actions": many(action)}, node)
    nodes["properties"]["sequenceId"] = {**COUNT, "multipleOf": 2}
    edges = strictly({"edgeId": TEXT, **NUMBERED, "actions": many(action), **edge.pop("required", {})}, edge)
    header = {
        "headerId": COUNT,
        "timestamp": {"type": "string", "pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d+Z$"},
        "version": {"type": "string", "pattern": rf"^{version}\.\d+$"},
        **{"manufacturer": TEXT, "serialNumber": TEXT, "orderId": TEXT, "orderUpdateId": COUNT},
    }
    parts = {"nodes": {**many(nodes), "minItems": 1}, "edges": many(edges)}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **strictly({**header, **parts}, optional),
    }


ORDER_2_1 = order(
    r"2\.1",
    action=strictly(
        {"actionType": TEXT, "actionId": TEXT, "blockingType": {"enum": ["NONE", "SOFT", "HARD"]}},
        {"actionDescription": TEXT, "actionParameters": many(PARAMETER)},
    ),
    node={
        "nodeDescription": TEXT,
        "nodePosition": strictly(
            PLACE,
            {
                **{"theta": ANGLE, "allowedDeviationXY": LENGTH, "allowedDeviationTheta": SPREAD},
                "mapDescription": TEXT,
            },
        ),
    },
    edge={
        "required": {"startNodeId": TEXT, "endNodeId": TEXT},
        **{"edgeDescription": TEXT, "maxSpeed": LENGTH, "maxHeight": LENGTH, "minHeight": LENGTH},
        **{"rotationAllowed": YES_OR_NO, **ALONG},
    },
    optional={"zoneSetId": TEXT},
)
ORDER_3_0 = order(
    r"3\.0",
    action=strictly(
        {"actionType": TEXT, "actionId": TEXT, "blockingType": {"enum": ["NONE", "SOFT", "SINGLE", "HARD"]}},
        {"actionDescriptor": TEXT, "actionParameters": many(PARAMETER), "retriable": YES_OR_NO},
    ),
    node={
        "nodeDescriptor": TEXT,
        "nodePosition": strictly(
            PLACE,
            {
                "theta": ANGLE,
                "allowedDeviationXY": strictly({"a": LENGTH, "b": LENGTH, "theta": HALF_TURN}, {}),
                "allowedDeviationTheta": SPREAD,
            },
        ),
    },
    edge={
        **{"edgeDescriptor": TEXT, "maximumSpeed": LENGTH, "maximumMobileRobotHeight": LENGTH},
        **{"minimumLoadHandlingDeviceHeight": LENGTH, "reachOrientationBeforeEntering": YES_OR_NO, **ALONG},
    },
    optional={"orderDescription": TEXT},
)
ORDERS = {"vda5050": ORDER_3_0, "vda5050-2.1": ORDER_2_1}
"""By the name of the format."""
