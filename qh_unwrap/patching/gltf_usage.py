# SPDX-License-Identifier: GPL-3.0-or-later
"""Who reads what in a glTF file, so that only what nobody else reads is replaced."""

from collections import Counter
from functools import cache

import numpy as np

from .gltf_file import element_size


class Usage:
    """What the file's document refers to before anything is changed."""

    def __init__(self, file):
        self._file = file
        document = file.json
        self.accessors = Counter()  # how often each is used
        self.views = Counter()
        for mesh in document.get("meshes", ()):
            for primitive in mesh["primitives"]:
                self.accessors.update(numbers(primitive))
                self.accessors.update([primitive[key] for key in ["indices"] if key in primitive])
        for animation in document.get("animations", ()):
            for sampler in animation["samplers"]:
                self.accessors.update((sampler["input"], sampler["output"]))
        for skin in document.get("skins", ()):
            self.accessors.update([skin[key] for key in ["inverseBindMatrices"] if key in skin])
        for accessor in document.get("accessors", ()):
            self.views.update(part["bufferView"] for part in _parts(accessor))
        for image in document.get("images", ()):
            self.views.update([image[key] for key in ["bufferView"] if key in image])
        self._readers = cache(self._readers)

    def is_alone(self, number):
        """Whether no other accessor, and no other view, has any of this accessor's bytes; not if it is a sparse one."""
        accessor = self._file.json["accessors"][number]
        if "sparse" in accessor or "bufferView" not in accessor:
            return False
        view = self._file.json["bufferViews"][accessor["bufferView"]]
        places = _places(view, accessor.get("byteOffset", 0), accessor["count"], element_size(accessor), False)
        return bool((self._readers(view["buffer"])[places] == 1).all())

    def is_free(self, view):
        """Whether a view is that of one accessor alone, so that its bytes can go with it."""
        view_json = self._file.json["bufferViews"][view]
        if self.views[view] != 1 or "extensions" in view_json:
            return False
        start = view_json.get("byteOffset", 0)
        return bool((self._readers(view_json["buffer"])[start : start + view_json["byteLength"]] <= 1).all())

    def _readers(self, buffer):
        """(n,) how many read each byte of a buffer."""
        document = self._file.json
        readers = np.zeros(document["buffers"][buffer]["byteLength"], dtype=np.uint16)
        views = document["bufferViews"]
        for accessor in document["accessors"]:
            for part in _parts(accessor):
                view = views[part["bufferView"]]
                if view["buffer"] == buffer:
                    offset = part.get("byteOffset", 0)
                    readers[_places(view, offset, part["count"], part["size"], part["packed"])] += 1
        for number, view in enumerate(views):
            if view["buffer"] == buffer and (number not in self.views or "extensions" in view):
                readers[view.get("byteOffset", 0) :][: view["byteLength"]] += 1
        for image in document.get("images", ()):
            if "bufferView" in image and views[image["bufferView"]]["buffer"] == buffer:
                view = views[image["bufferView"]]
                readers[view.get("byteOffset", 0) :][: view["byteLength"]] += 1
        return readers


def numbers(primitive):
    """The accessors of all attributes and morph targets."""
    return [number for group in [primitive["attributes"], *primitive.get("targets", ())] for number in group.values()]


def _parts(accessor):
    """Where the values of an accessor, and what a sparse one has in their place, lie."""
    if "bufferView" in accessor:
        yield accessor | dict(size=element_size(accessor), packed=False)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        index = sparse["indices"] | dict(type="SCALAR")
        yield index | dict(count=sparse["count"], size=element_size(index), packed=True)
        yield sparse["values"] | dict(count=sparse["count"], size=element_size(accessor), packed=True)


def _places(view, offset, count, size, packed):
    """The bytes of some elements: a slice where they lie side by side, else their numbers."""
    start, stride = view.get("byteOffset", 0) + offset, size if packed else view.get("byteStride") or size
    if stride == size:
        return slice(start, start + count * size)
    return (start + stride * np.arange(count)[:, None] + np.arange(size)).ravel()
