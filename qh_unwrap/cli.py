# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: `qh-unwrap`, `python -m qh_unwrap` and `blender --command qh_unwrap`.

Exit codes: 0 everything unwrapped, 1 something failed (the rest is written), 2 wrong usage, 3 nothing could be written;
130 and 143 after SIGINT and SIGTERM.
"""

import argparse
import dataclasses
import json
import os
import sys
from contextlib import contextmanager
from pathlib import Path

from . import __version__
from .addon import stopping, writing
from .addon.failures import FileError, UsageError
from .addon.options import MeshOptions
from .core import Settings, UnwrapError
from .core.stepping import finished

_DESCRIPTION = "Unwrap meshes with little distortion and without flipped faces."
_INPUT = (
    "a .blend, .obj, .ply, .stl, .glb, .gltf, .fbx, .usd, .usda or .usdc file,"
    " or the word 'suzanne' for Blender's monkey with seams"
)


_command = None


def register():
    """Let `blender --command qh_unwrap` come here."""
    global _command
    import bpy

    _command = bpy.utils.register_cli_command("qh_unwrap", main)


def unregister():
    import bpy

    bpy.utils.unregister_cli_command(_command)


def main(argv=None):
    with stopping.stoppable():
        try:
            return _run(_parser().parse_args(argv))
        except SystemExit as stop:  # argparse, after --help or a wrong argument
            return stop.code
        except UsageError as error:
            return _complain(error, 2)
        except FileError as error:
            return _complain(error, 3)
        except stopping.Stopped as stop:
            return _complain(stop, stop.exit_code)


def _complain(error, code):
    print(f"qh-unwrap: error: {error}", file=sys.stderr)
    return code


def _parser():
    parser = argparse.ArgumentParser(prog="qh-unwrap", description=_DESCRIPTION)
    parser.add_argument("input", metavar="INPUT", help=_INPUT)
    parser.add_argument("-o", "--output", type=Path, help="file to write, in any of these formats except .stl")
    parser.add_argument("--object", action="append", metavar="NAME", help="unwrap this object only; may be repeated")
    parser.add_argument("--weld", action="store_true", help="first join vertices that lie at the same place")
    parser.add_argument("--seams-from-islands", action="store_true", help="first mark the cuts of the old UVs as seams")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to this file")
    parser.add_argument("--preview", type=Path, metavar="FILE.png", help="draw the model and its UVs, checkered")
    parser.add_argument("--overwrite", action="store_true", help="replace files that exist")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    for title, kind in (("unwrapping", Settings), ("mesh and placement", MeshOptions)):
        group = parser.add_argument_group(title)
        for field in dataclasses.fields(kind):
            group.add_argument(f"--{field.name.replace('_', '-')}", **_argument(field))
    return parser


def _argument(field):
    meta = field.metadata
    description = meta["description"].replace("%", "%%")
    if type(field.default) is bool:
        return dict(action=argparse.BooleanOptionalAction, default=field.default, help=description)
    if meta["choices"]:
        names = [choice.identifier for choice in meta["choices"]]
        texts = "; ".join(f"{choice.identifier}: {choice.description}" for choice in meta["choices"])
        help = f"{description} (default {field.default}). {texts}"
        return dict(type=str.upper, choices=names, metavar="NAME", default=field.default, help=help)
    low, high = meta["range"]
    help = f"{description} ({low:g} to {high:g}, default {field.default:g})"
    return dict(type=type(field.default), metavar="NUMBER", default=field.default, help=help)


def _run(args):
    try:
        settings, options = (_made_from(args, kind) for kind in (Settings, MeshOptions))
        settings.check_together()
    except UnwrapError as error:
        raise UsageError(error) from None
    try:
        import bpy
    except ImportError:
        raise UsageError("this needs Blender: pip install 'qh-unwrap[bpy]', or run it inside Blender") from None
    from .addon import checking, files, outcome, preview, selection, unwrapping

    _check_files(args, files, preview)
    with _at_file("read", args.input, files):
        loaded = files.load(args.input)
    objects = _chosen(loaded, args)
    _check_room(args, objects, files)
    files.prepare(objects, weld=args.weld, seams_from_islands=args.seams_from_islands)
    targets = [selection.Target(obj, selection.visible_faces(obj.data)) for obj in objects]
    with files.quiet():
        outcomes = finished(unwrapping.unwrap_targets(targets, settings, options, bpy.context))
    if not outcomes:
        raise FileError(f"{', '.join(obj.name for obj in objects)}: there are no visible faces")

    done = [outcome for outcome in outcomes if not outcome.error]
    if done:
        with writing.Staging(overwrite=args.overwrite) as staging:
            if args.preview:
                with _at_file("write", args.preview, files):
                    staging.write(
                        args.preview, lambda path: preview.render(targets, outcomes, path), checking.check_image
                    )
            if args.output:
                with _at_file("write", args.output, files):
                    files.stage(staging, args.output)
            with _at_file("write", args.output or args.preview, files):
                staging.put_in_place()
    if args.json:
        with _at_file("write", args.json, files), writing.Staging(overwrite=True) as staging:
            document = _document(args, settings, options, outcomes, bpy.app.version_string)
            staging.write_text(args.json, json.dumps(document, indent=2) + "\n")
            staging.put_in_place()
    _print_table(outcomes, outcome)
    return (0 if len(done) == len(outcomes) else 1) if done else 3


@contextmanager
def _at_file(verb, path, files):
    try:
        with files.quiet(errors=True):
            yield
    except (RuntimeError, OSError, FileError) as error:
        stopping.check()
        raise FileError(f"cannot {verb} {path}: {_reason(error)}") from error


def _reason(error):
    """One line of what Blender says, which may be a traceback."""
    lines = [line for line in str(error).splitlines() if line.strip() and not line.startswith("Location:")]
    return lines[-1].removeprefix("Error: ") if lines else type(error).__name__


def _made_from(args, kind):
    return kind(**{field.name: getattr(args, field.name) for field in dataclasses.fields(kind)})


def _check_files(args, files, preview):
    if args.input != "suzanne":
        args.input = Path(args.input)
        if not args.input.is_file():
            raise UsageError(f"there is no file {args.input}")
        if args.input.suffix.lower() not in files.READERS:
            raise UsageError(f"cannot read {args.input}: use {', '.join(files.READERS)}")
    if args.output and args.output.suffix.lower() not in files.WRITERS:
        raise UsageError(f"cannot write {args.output}: UVs can be kept in {', '.join(files.WRITERS)}")
    if args.preview and args.preview.suffix.lower() not in preview.FORMATS:
        raise UsageError(f"cannot write {args.preview}: pictures can be {', '.join(preview.FORMATS)}")
    paths = list(filter(None, (args.output, _sibling(args.output), args.json, args.preview)))
    for path in paths:
        if not path.absolute().parent.is_dir():
            raise UsageError(f"there is no folder {path.absolute().parent}")
        if path.exists() and not args.overwrite:
            raise UsageError(f"{path} exists: choose another name, or pass --overwrite")
        if os.path.lexists(path) and not path.is_file():
            raise UsageError(f"{path} is a folder, or no file to write to")
    for path in paths:
        writing.check_folder(path)


def _check_room(args, objects, files):
    sizes = {args.preview: 100_000} if args.preview else {}
    if args.output:
        sizes[args.output] = files.likely_size(args.output, args.input, objects)
    writing.check_room(sizes)


def _sibling(path):
    """The other file that the format writes, if any."""
    suffix = {".obj": ".mtl", ".gltf": ".bin"}.get(path.suffix.lower()) if path else None
    return path.with_suffix(suffix) if suffix else None


def _chosen(objects, args):
    if not objects:
        raise FileError(f"there is no mesh in {args.input}")
    present = [obj.name for obj in objects]
    unknown = set(args.object or ()) - set(present)
    if unknown:
        raise UsageError(f"there is no mesh object {', '.join(sorted(unknown))}: the file has {', '.join(present)}")
    return [obj for obj in objects if not args.object or obj.name in args.object]


def _print_table(outcomes, words):
    """Print a row for each island, a line for each kind of message, and to stderr one for each kind of error."""
    head = ("island", "faces", "stretch", "sym. Dirichlet", "angle", "area", "flips", "iterations")
    rows = [_row(outcome, words.change) for outcome in outcomes if not outcome.error]
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    for row in (head, *rows) if rows else ():
        first, *others = (text.rjust(width) for text, width in zip(row, widths, strict=True))
        print("  ".join((first.strip().ljust(widths[0]), *others)))
    for sentence in words.sentences(outcomes):
        print(sentence)
    for sentence in words.error_sentences(outcomes):
        print(sentence, file=sys.stderr)


def _row(outcome, change):
    return (
        f"{outcome.obj} {outcome.number}",
        str(outcome.faces),
        *(
            change(outcome.before, outcome.after, name)
            for name in ("l2_stretch", "symmetric_dirichlet", "angle", "area")
        ),
        str(outcome.after.flips),
        str(outcome.iterations),
    )


def _document(args, settings, options, outcomes, blender_version):
    return dict(
        versions=dict(qh_unwrap=__version__, blender=blender_version),
        input=str(args.input),
        output=str(args.output) if args.output else None,
        settings=dataclasses.asdict(settings) | dataclasses.asdict(options),
        islands=[outcome.to_dict() for outcome in outcomes],
    )
