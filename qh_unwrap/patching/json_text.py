# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON text with some values changed, and every other character as it was."""

import json

_DECODER = json.JSONDecoder()
_SPACE = " \t\r\n"


def rewritten(text, old, new):
    """The text of `new`, given the text of `old`: what is equal in both keeps its text, key by key and item by item."""
    start = _skip(text, 0)
    end = len(text.rstrip(_SPACE))
    return text[:start] + _value(text[start:end], old, new) + text[end:]


def _value(text, old, new):
    if isinstance(old, dict) and isinstance(new, dict):
        return _members(text, old, new)
    if isinstance(old, list) and isinstance(new, list) and len(new) >= len(old):
        return _members(text, dict(enumerate(old)), dict(enumerate(new)))
    return text if type(old) is type(new) and old == new else _dumps(new)


def _members(text, old, new):
    if old == new:
        return text
    is_object = text[0] == "{"
    spans = list(_spans(text, is_object))
    if len(spans) != len(old) or old.keys() - new.keys():  # a key twice, or one that goes
        return _dumps(new if is_object else list(new.values()))
    parts, done = [], 0
    for (start, end), key in zip(spans, old, strict=True):
        parts += [text[done:start], _value(text[start:end], old[key], new[key])]
        done = end
    added = [
        f"{json.dumps(key, ensure_ascii=False)}:{_dumps(value)}" if is_object else _dumps(value)
        for key, value in new.items()
        if key not in old
    ]
    if added:
        place = done or 1
        parts += [text[done:place], "," if spans else "", ",".join(added)]
        done = place
    return "".join([*parts, text[done:]])


def _spans(text, is_object):
    """Yield where each value of an object or a list begins and ends."""
    place = _skip(text, 1)
    while text[place] not in "]}":
        if is_object:
            _, place = _DECODER.raw_decode(text, place)
            place = _skip(text, _skip(text, place) + 1)  # past the colon
        _, end = _DECODER.raw_decode(text, place)
        yield place, end
        place = _skip(text, end)
        if text[place] == ",":
            place = _skip(text, place + 1)


def _skip(text, place):
    while place < len(text) and text[place] in _SPACE:
        place += 1
    return place


def _dumps(value):
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))
