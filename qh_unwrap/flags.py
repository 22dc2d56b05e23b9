# SPDX-License-Identifier: GPL-3.0-or-later
"""The flags of the command line, and what --help says of them; needs no Blender."""

import argparse
import dataclasses
from pathlib import Path

from . import __version__
from .addon.failures import UsageError
from .addon.options import MeshOptions, SeamOptions
from .core import Settings
from .core.seam_settings import SeamSettings

_DESCRIPTION = "Unwrap meshes with little distortion and without flipped faces."
_INPUT = (
    "a .blend, .obj, .ply, .stl, .glb, .gltf, .fbx, .usd, .usda or .usdc file,"
    " or the word 'suzanne' for Blender's monkey with seams"
)
_EPILOG = """\
examples:
  qh-unwrap model.obj -o unwrapped.obj
      unwrap every island with the least distortion
  qh-unwrap model.fbx -o unwrapped.fbx --json report.json --strict
      for a pipeline: 1 if an island is not certified, and all the numbers in a file
  qh-unwrap scene.blend -o scene.blend --overwrite --object 'Wall*' --uv-map Lightmap --placement PACK
      pack a second UV map of some objects, in the same file
  qh-unwrap model.obj --boundary CIRCLE --balance 0.5 --refine 0 --preview picture.png
      look at the published map, and write nothing else
  qh-unwrap --check model.glb --json report.json
      check the UVs that are there, and change nothing

exit codes:
  0  everything is unwrapped; with --check, no fault was found
  1  some islands failed, or with --strict are not certified; the rest is written; with --check, faults were found
  2  wrong usage
  3  nothing could be done: nothing was unwrapped, or a file could not be read or written
  130, 143  stopped by Ctrl C or SIGTERM; nothing half done is left
"""
_NEEDS = {  # what each flag counts with, where its description does not say so
    "aspect": "only with --boundary RECTANGLE",
    "weights": "all but COTANGENT need another --boundary than FREE",
    "initial": "CURRENT needs UVs",
    "fill_holes": "only with another --boundary than FREE",
    "tensor_power": "only in the iterations, not in the refinement",
    "tolerance": "only with --refine 0",
    "margin_method": "only where islands are packed",
    "margin": "only where islands are packed",
    "rotate": "only with --placement PACK",
    "pixels_per_metre": "only with --texel-density GIVEN",
    "image_size": "only with --texel-density GIVEN",
    "weight_group": "only with --use-weights",
    "weight_factor": "only with --use-weights",
}
_CUT = (
    "never: leave closed islands as they are; needed: open what is closed or has handles along short seams; a number"
    " like 1.03: go on cutting where it stretches most, until the mean distortion is no larger (default needed)"
)
SPLIT = (".glb", ".gltf", ".stl", ".ply")  # what has its vertices split, or each face for itself


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise UsageError(f"{message} (qh-unwrap --help tells all flags)")


def parser():
    made = Parser(
        prog="qh-unwrap",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("input", metavar="INPUT", help=_INPUT)
    made.add_argument("-o", "--output", type=Path, help="file to write, in any of these formats except .stl")
    made.add_argument(
        "--check",
        action="store_true",
        help="unwrap nothing: say what there is to say of the UVs in the file; exits with 1 if there are faults",
    )
    made.add_argument("--object", action="append", metavar="NAME", help="unwrap this object only; may be repeated")
    made.add_argument("--seams-from-islands", action="store_true", help="first mark the cuts of the old UVs as seams")
    made.add_argument(
        "--collection",
        action="append",
        metavar="NAME",
        help="unwrap the objects in this collection only; may be repeated."
        " Here as in --object and --material, NAME can be a pattern like 'Wall*' or '*[0-9]'",
    )
    made.add_argument(
        "--material", action="append", metavar="NAME", help="unwrap the faces with this material only; may be repeated"
    )
    which = made.add_mutually_exclusive_group()
    which.add_argument(
        "--uv-map", metavar="NAME", help="write into this UV map, not the active one; it is made where it is missing"
    )
    which.add_argument(
        "--texcoord", type=int, metavar="N", help="write into the N-th UV map, from 0; the next one after all is made"
    )
    made.add_argument(
        "--json", type=Path, metavar="FILE", help="write a report, also if the run fails; - prints it, and no table"
    )
    made.add_argument(
        "--preview", type=Path, metavar="FILE", help="draw the model and its UVs, checkered, into a .png or .jpg file"
    )
    made.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help="plot the distortion of every triangle, beside that of Blender's own methods, into a .png or .svg file",
    )
    made.add_argument(
        "--write",
        choices=("patch", "export"),
        help="patch: change nothing in the file but the UVs, if it is an .obj, .glb, .gltf or .usd file and stays one;"
        " export: write it anew by Blender's exporter (default: patch if that can be done, within Blender export)",
    )
    made.add_argument("--overwrite", action="store_true", help="replace files that exist")
    made.add_argument("--strict", action="store_true", help="count islands that are not certified as failed")
    loudness = made.add_mutually_exclusive_group()
    loudness.add_argument("--quiet", action="store_true", help="show nothing but errors")
    loudness.add_argument("--verbose", action="store_true", help="show every island, however many there are")
    made.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    for title, kinds in _GROUPS.items():
        group = made.add_argument_group(title)
        for field in (field for kind in kinds for field in dataclasses.fields(kind) if field.name not in _IN_CUT):
            action = group.add_argument(f"--{field.name.replace('_', '-')}", **_argument(field))
            action.help = _help(field).replace("%", "%%")
    return made


_GROUPS = {
    "unwrapping": (Settings,),
    "mesh and placement": (MeshOptions,),
    "new seams": (SeamSettings, SeamOptions),
}
_IN_CUT = ("until", "unwrap", "distortion")  # which --cut says


def cut(text):
    """`--cut` as two settings: how far, and until which distortion."""
    name = str(text).upper()
    if name in ("NEVER", "NEEDED"):
        return dict(cut=name)
    try:
        return dict(cut="DISTORTION", distortion=float(text))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither never, needed nor a distortion like 1.03") from None


def _argument(field):
    if field.name == "cut":
        return dict(type=cut, metavar="HOW", default=cut("needed"))
    if field.name == "weld":
        return dict(action=argparse.BooleanOptionalAction, default=None)
    if type(field.default) is bool:
        return dict(action=argparse.BooleanOptionalAction, default=field.default)
    if field.metadata["choices"]:
        names = [choice.identifier for choice in field.metadata["choices"]]
        return dict(type=str.upper, choices=names, metavar="NAME", default=field.default)
    metavar = "NAME" if type(field.default) is str else "NUMBER"
    return dict(type=type(field.default), metavar=metavar, default=field.default)


def _help(field):
    meta, default = field.metadata, field.default
    if field.name == "cut":
        return _CUT
    notes = [_NEEDS[field.name]] if field.name in _NEEDS else []
    if field.name == "weld":
        notes.append(f"on if not given for {', '.join(SPLIT)}, off for others")
    elif type(default) is bool:
        notes.append(f"default {'on' if default else 'off'}")
    elif meta["choices"]:
        notes.append(f"default {default}")
    elif type(default) is str:
        notes.append(f"default {default or 'none'}")
    else:
        low, high = meta["range"]
        notes.append(f"{low:g} to {high:g}, default {default:g}")
    texts = "; ".join(f"{choice.identifier}: {choice.description}" for choice in meta["choices"])
    return f"{meta['description']} ({'; '.join(notes)}){f'. {texts}' if texts else ''}"
