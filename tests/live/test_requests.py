"""Messages from a page: each becomes a request, or is refused with the reason."""

import json

import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft.core.errors import OptionError
from taichi_soft.live.requests import parse_request


@pytest.mark.parametrize(
    ("said", "request_"),
    [
        ({"do": "pause", "is_paused": True}, {"is_paused": True}),
        ({"do": "set", "name": "young", "value": 2e5}, {"name": "young", "value": 2e5}),
        ({"do": "set", "name": "substeps", "value": 7.6}, {"name": "substeps", "value": 8.0}),
        ({"do": "move", "point": [1, 2.5, -3], "extra": 1}, {"point": [1.0, 2.5, -3.0], "number": 0}),
        ({"do": "move", "point": [1, 2, 3], "number": 7}, {"point": [1.0, 2.0, 3.0], "number": 7}),
        ({"do": "choose", "law": "springs"}, {"law": "springs", "strain": None, "flips": None}),
        ({"do": "tint", "quantity": None}, {"quantity": None}),
        ({"do": "upload", "name": "a.obj"}, {"name": "a.obj", "up": None}),
        ({"do": "upload", "name": "a.obj", "up": "z"}, {"name": "a.obj", "up": "z"}),
        ({"do": "seen", "number": 3}, {"number": 3}),
        ({"do": "preset", "name": "gelatine"}, {"name": "gelatine"}),
        ({"do": "preset"}, {"name": None}),
        ({"do": "undo", "name": "all"}, {}),
    ],
)
def test_a_request_has_the_values_of_its_message_and_nothing_else(said, request_):
    assert parse_request(json.dumps(said)) == {"do": said["do"], "pane": 0, **request_}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "JSON"),
        ("[" * 2000, "JSON"),
        ("[1]", "'do'"),
        ('{"do": "fly"}', "one of"),
        ('{"do": ["set"]}', "'do'"),
        ('{"do": "stop"}', "one of"),
        ('{"do": "set", "name": "young", "value": 1e12}', "1e.08"),
        ('{"do": "set", "name": "young", "value": NaN}', "nan"),
        ('{"do": "set", "name": "young", "value": true}', "True"),
        ('{"do": "set", "name": "young", "value": "5"}', "'5'"),
        ('{"do": "set", "name": "mass", "value": 1}', "unknown slider"),
        ('{"do": "set", "name": {"a": 1}, "value": 1}', "unknown slider"),
        ('{"do": "move", "point": [1, 2]}', "three"),
        ('{"do": "move", "point": [1, 2, Infinity]}', "within"),
        ('{"do": "move", "point": [1, 2, NaN]}', "numbers"),
        ('{"do": "move", "point": [1, 2, 1%s]}' % ("0" * 400), "within"),
        ('{"do": "set", "name": "young", "value": 1%s}' % ("0" * 400), "must be from"),
        ('{"do": "move", "point": [1, 2, 1e30]}', "within"),
        ('{"do": "grab", "origin": [0, 0, 0], "direction": [0, 0, 0]}', "zero"),
        ('{"do": "choose", "law": "magic"}', "law must be one of"),
        ('{"do": "choose", "law": ["virial"]}', "law must be one of"),
        ('{"do": "upload", "name": "a.obj", "up": "x"}', "up must be one of y, z"),
        ('{"do": "preset", "name": "butter"}', "name must be one of"),
        ('{"do": "preset", "name": 1}', "name must be one of"),
        ('{"do": "pause", "is_paused": 1}', "true or false"),
        ('{"do": "pause", "is_paused": true, "pane": 5}', "pane"),
        ('{"do": "save", "what": null}', "what must be one of"),
        ('{"do": "seen", "number": -1}', "number"),
        ('{"do": "move", "point": [1, 2, 3], "number": "1"}', "number"),
        (json.dumps({"do": "spawn", "name": "x" * 101}), "word"),
        (json.dumps({"do": "spawn", "name": "x" * 10_000}), "4096"),
    ],
)
def test_an_invalid_message_is_refused_with_the_reason(text, reason):
    with pytest.raises(OptionError, match=reason):
        parse_request(text)
