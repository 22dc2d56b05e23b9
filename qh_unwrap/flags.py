# SPDX-License-Identifier: GPL-3.0-or-later
"""The flags of the command line, and what --help says of them; needs no Blender."""

import argparse
import dataclasses
from pathlib import Path

from . import __version__
from .addon.failures import UsageError
from .addon.options import MeshOptions, SeamOptions
from .addon.suffixes import SPLIT
from .core import Settings
from .core.relax_settings import RelaxSettings
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
  qh-unwrap models/*.glb -O unwrapped --jobs 4 --resume --report report.html
      many files, four at a time; after an interruption the same command goes on
  qh-unwrap model.obj -o relaxed.obj --relax
      keep the outlines of the UVs that there are, and even out what is in them
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
with -O FOLDER: 0 if every file ends with 0, else 1 if some were written, 3 if none was

farms: qh-unwrap farm --help
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
    made.add_argument("input", metavar="INPUT", nargs="*", help=_INPUT)
    made.add_argument("-o", "--output", type=Path, help="file to write, in any of these formats except .stl")
    made.add_argument(
        "--check",
        action="store_true",
        help="unwrap nothing: say what there is to say of the UVs in the file; exits with 1 if there are faults",
    )
    made.add_argument("--object", action="append", metavar="NAME", help="unwrap this object only; may be repeated")
    made.add_argument("--seams-from-islands", action="store_true", help="first mark the cuts of the old UVs as seams")
    made.add_argument(
        "--relax",
        action="store_true",
        help="do not unwrap, but relax the UVs that there are where they lie; of all options those of relaxing count,"
        " and --balance, --correct-aspect, --correct-scale, --use-subsurf-data and --weld",
    )
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
    _add_batch(made.add_argument_group("many files", _MANY))
    made.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    for title, kinds in _GROUPS.items():
        group = made.add_argument_group(title)
        told = {*_IN_CUT, *(["balance"] if kinds == (RelaxSettings,) else [])}  # elsewhere
        for field in (field for kind in kinds for field in dataclasses.fields(kind) if field.name not in told):
            action = group.add_argument(f"--{field.name.replace('_', '-')}", **_argument(field))
            action.help = _help(field).replace("%", "%%")
    return made


def parsed(argv):
    """The arguments; raises `UsageError` where they do not go together, and `SystemExit` after --help."""
    made = parser()
    args = made.parse_intermixed_args(argv)
    if not (args.input or args.list):
        made.error("the following arguments are required: INPUT")
    if args.output_folder is None:
        given = [name for name in BATCH if getattr(args, name) != made.get_default(name)]
        if given or len(args.input) > 1:
            what = f"--{given[0].replace('_', '-')}" if given else "more than one INPUT"
            made.error(f"{what} needs -O FOLDER")
        args.input = args.input[0]
    return args


def _add_batch(group):
    """The flags for many files, all of which are in `BATCH`."""
    group.add_argument(
        "-O", "--output-folder", type=Path, metavar="FOLDER", help="folder for the outputs, which is made if need be"
    )
    group.add_argument(
        "--name",
        metavar="PATTERN",
        default="{stem}_uv{suffix}",
        help="what each output is called: {stem} and {suffix} are those of the input, {folder} is its folder from the"
        " one that all inputs are in (default {stem}_uv{suffix})",
    )
    group.add_argument("--list", type=Path, metavar="FILE", help="take the inputs from the lines of a text file")
    group.add_argument("--only", metavar="NUMBERS", help="unwrap only some of the inputs, such as 1-10,15")
    group.add_argument("--jobs", type=int, metavar="N", help="how many files to unwrap at a time (default 1)")
    group.add_argument(
        "--timeout", type=float, metavar="SECONDS", help="give up a file that takes longer, at its second try"
    )
    group.add_argument("--memory", type=float, metavar="GB", help="give up a file that takes more, at its second try")
    group.add_argument("--resume", action="store_true", help="leave out what an earlier run has done in the same way")
    group.add_argument(
        "--report", type=Path, metavar="FILE", action="append", help="write a .csv or .html report; may be repeated"
    )
    group.add_argument(
        "--progress",
        choices=("json", "openjd"),
        help="json: print an object in a line for each file, and nothing else; openjd: lines for Open Job Description",
    )
    group.add_argument("--dask", metavar="ADDRESS", help="unwrap on the Dask cluster of the scheduler at this address")


BATCH = "output_folder", "name", "list", "only", "jobs", "timeout", "memory", "resume", "report", "progress", "dask"
_MANY = "Unwrap each file in a worker process.  A file that crashes, hangs or takes too much memory is tried twice."


def farm_parser():
    """The parser of what comes after the word `farm`."""
    made = Parser(prog="qh-unwrap farm", description="Farms and their schedulers.", allow_abbrev=False)
    words = made.add_subparsers(dest="word", required=True, metavar="WORD", parser_class=Parser)
    for name, title in (("openjd", "a job template for Open Job Description"), ("flamenco", "a job type for Flamenco")):
        text = f"print {title}; FLAGS are those with which to unwrap"
        words.add_parser(name, help=text, description=text, usage=f"qh-unwrap farm {name} [FLAGS]")
    text = "write a report of all that was written to a folder"
    word = words.add_parser("report", help=text, description=text)
    word.add_argument("folder", type=Path, metavar="FOLDER", help="what -O was")
    word.add_argument("files", type=Path, metavar="FILE", nargs="+", help="a .csv or .html file")
    word.add_argument("--overwrite", action="store_true", help="replace files that exist")
    words.add_parser("worker", help="be a worker: for qh-unwrap itself")
    return made


_GROUPS = {
    "unwrapping": (Settings,),
    "mesh and placement": (MeshOptions,),
    "new seams": (SeamSettings, SeamOptions),
    "relaxing, with --relax": (RelaxSettings,),
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
