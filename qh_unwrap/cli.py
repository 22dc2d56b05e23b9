# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: `qh-unwrap`, `python -m qh_unwrap` and `blender --command qh_unwrap`; and the same for Python.

Exit codes: 0 everything unwrapped, or no fault found; 1 something failed (the rest is written), or faults found;
2 wrong usage; 3 nothing could be done; 130 and 143 after SIGINT and SIGTERM.
"""

import argparse
import dataclasses
import json
import os
import traceback
from contextlib import contextmanager, suppress
from pathlib import Path

from . import asked, console, flags
from .addon import stopping, streams, writing
from .addon.document import FAILED, OK, PARTIAL, USAGE, Record
from .addon.failures import FileError, UsageError
from .addon.last_run import last_run
from .addon.options import MeshOptions, SeamOptions
from .core import Settings, UnwrapError
from .core.seam_settings import SeamSettings
from .core.stepping import finished, mapped
from .patching.original import PatchError

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
            args = flags.parser().parse_args(argv)
        except SystemExit as stop:  # argparse, after --help
            return stop.code
        except UsageError as error:
            args, record = _understood(argv), Record()
            record.fail(USAGE, error)
            _finish(args, record)
        else:
            bar = console.Bar(wanted=not args.quiet)
            record = _carried_out(args, bar)
            bar.close()
        with suppress(stopping.Stopped):  # all is done: who stops now has read enough
            _show(args, record)
        return record.exit_code


def unwrap_file(path, output=None, **options):
    """Unwrap a file as the command line does; see `qh_unwrap.unwrap_file`."""
    args = flags.parser().parse_args(["suzanne"])
    known = {name: value for name, value in vars(args).items() if name not in _NOT_IN_PYTHON}
    unknown = sorted(options.keys() - known.keys())
    if unknown:
        raise UsageError(f"there is no option {', '.join(unknown)}: use {', '.join(known)}")
    if str(options.get("json")) == "-":
        raise UsageError("json is the path of a file here: the report is what is returned")
    for name, value in options.items():
        if isinstance(known[name], bool) and value not in (True, False):
            raise UsageError(f"{name} is {value!r}: choose True or False")
        if name in _REPEATABLE and isinstance(value, str):
            value = [value]
        elif name == "cut":
            try:
                value = flags.cut(value)
            except argparse.ArgumentTypeError as error:
                raise UsageError(f"cut: {error}") from None
        elif name in ("json", "preview", "plot") and value is not None:
            value = Path(value)
        elif isinstance(value, str) and isinstance(known[name], str) and known[name]:  # a choice, and no free name
            value = value.upper()
        setattr(args, name, value)
    if args.uv_map is not None and args.texcoord is not None:
        raise UsageError("uv_map and texcoord exclude each other")
    args.input, args.output = os.fspath(path), Path(output) if output is not None else None
    record = _carried_out(args)
    if record.exit_code == USAGE:
        raise UsageError(record.error)
    return record.to_dict()


_NOT_IN_PYTHON = ("input", "output", "quiet", "verbose")
_REPEATABLE = ("object", "collection", "material")


def _understood(argv):
    """What counts of arguments that are wrong in some other place: where to write the report, and how."""
    parser = flags.Parser(add_help=False, allow_abbrev=False)
    parser.add_argument("--json", type=Path)
    for name in ("overwrite", "quiet", "verbose"):
        parser.add_argument(f"--{name}", action="store_true")
    try:
        args, others = parser.parse_known_args(argv)
    except UsageError:
        args, others = parser.parse_args([]), []
    if args.json and any(asked.is_same(args.json, each.partition("=")[2] or each) for each in others):
        args.json = None  # it names the input, or another file
    return args


def _carried_out(args, progress=None):
    """Do it; returns the `Record` of it, which is in the file for the report as well if one is wanted."""
    record = Record()
    try:
        _run(args, record, progress)
    except UsageError as error:
        record.fail(USAGE, error)
    except FileError as error:
        record.fail(FAILED, error)
    except stopping.Stopped as stop:
        stopping.heard()
        record.fail(stop.exit_code, stop)
    except Exception as error:  # a fault of ours: the report is written all the same
        traceback.print_exc()
        record.fail(FAILED, f"{type(error).__name__}: {error}")
    _finish(args, record)
    return record


def _finish(args, record):
    record.begin(None)
    try:
        _keep(args, record)
    except FileError as error:
        if record.exit_code in (OK, PARTIAL):  # else there is something worse to tell
            record.fail(PARTIAL if record.files else FAILED, error)


def _run(args, record, progress):
    record.input, record.output = str(args.input), str(args.output) if args.output else None
    record.strict = bool(args.strict)
    asked.check_paths(args)
    if args.weld is None:
        args.weld = Path(args.input).suffix.lower() in flags.SPLIT
    try:
        vars(args).update(args.cut)
        kinds = Settings, MeshOptions, SeamSettings, SeamOptions
        settings, options, seam_settings, seam_options = (_made_from(args, kind) for kind in kinds)
        settings.check_together()
    except UnwrapError as error:
        raise UsageError(error) from None
    values = dataclasses.asdict(settings) | dataclasses.asdict(options)
    if options.cut != 'NEVER':
        values |= dataclasses.asdict(seam_settings) | dict(vertex_group=seam_options.vertex_group)
    record.settings = {name: getattr(value, "item", lambda value=value: value)() for name, value in values.items()}
    with stopping.undisturbed(), streams.quiet():
        try:
            import bpy
        except ImportError:
            raise UsageError("this needs Blender: pip install 'qh-unwrap[bpy]', or run it inside Blender") from None
        from .addon import choosing, files, inspecting, jobs, measuring, patches, plotting, preview, selection
    record.blender = bpy.app.version_string

    asked.check_formats(args, files, preview, plotting)
    record.write = patches.mode(args.write, args.input, args.output)
    _keep(args, record)  # which says that the run is not finished, in place of what an earlier one said
    record.begin("read")
    with _at_file("read", args.input, record):
        files.load(args.input)
    record.warn(files.missing_pictures())
    choice = choosing.choose(args.object, args.collection)
    record.skipped = choice.skipped
    objects = choice.required()
    maps = choosing.Maps(objects, args.uv_map, args.texcoord)
    asked.check_room(args, objects, files)
    record.begin("check" if args.check else "unwrap")
    if args.seams_from_islands:
        files.mark_cuts(objects, options)
    faces = selection.all_faces if args.check else selection.visible_faces
    targets = [selection.Target(obj, faces(obj.data)) for obj in objects]
    targets = choice.narrowed(targets, args.material)
    objects = choice.required()
    problem = options.use_weights and not args.check and selection.without_group(targets, options.weight_group)
    if problem:
        raise UsageError(problem)
    maps.make_missing(objects)
    patch = patches.Patch(args.input, objects, maps) if record.write == patches.PATCH else None

    def step(share):
        stopping.check()
        if progress:
            progress(share)

    with streams.quiet():
        if args.check:
            outcomes, cuts = finished(mapped(step, inspecting.check_targets(targets, bpy.context, options))), []
            record.check, record.published = last_run.check.to_dict(), last_run.check.published
        else:
            steps = jobs.cut_and_unwrap(targets, settings, options, bpy.context, seam_settings, seam_options)
            outcomes, cuts = finished(mapped(step, steps))
            record.published = measuring.add_published(outcomes, targets, options)
    record.cuts = [cut.to_dict() for cut in cuts if cut.new.any()]
    record.outcomes, record.places = outcomes, choosing.places(outcomes, objects)
    if args.check:
        record.judge()
        return
    record.begin("write")
    if record.done:
        _write(args, record, maps, targets, settings, options, patch)
    record.judge()


def _write(args, record, maps, targets, settings, options, patch):
    from .addon import checking, files, losses, plotting, preview

    named = {outcome.obj for outcome in record.done}
    done = {target.obj for target in targets if target.obj.name in named}

    def draw(path):
        preview.render(targets, record.outcomes, options, path)

    with writing.Staging(overwrite=args.overwrite) as staging:
        if args.preview:
            with _at_file("write", args.preview, record):
                staging.write(args.preview, draw, checking.check_image)
        if args.plot:
            with _at_file("write", args.plot, record):
                staging.write(args.plot, lambda path: _plot(path, targets, settings, options), plotting.check)
        if args.output:
            with _at_file("write", args.output, record):
                is_patched = patch and _patch(args, record, patch, staging)
            if args.output.suffix.lower() not in losses.ONE_MAP:  # of which the active one is that with the new UVs
                maps.restore(done)
            if not is_patched:
                record.losses = losses.of(args.output)
                with _at_file("write", args.output, record):
                    files.stage(staging, args.output)
        try:
            with _at_file("write", args.output or args.preview or args.plot, record):
                staging.put_in_place()
        finally:
            record.files = staging.placed


def _plot(path, targets, settings, options):
    """Plot what became of the targets beside what Blender's own methods make of copies of them."""
    import bpy

    from .addon import comparing, plotting

    methods = comparing.blenders(settings, options, current=False, ours=False)
    comparison = finished(comparing.compare(targets, methods, bpy.context, options))
    if comparison.figure is None:
        raise FileError(f"there is nothing to plot, {comparison.remarks[0]}")
    plotting.write(comparison.figure, path)


def _patch(args, record, patch, staging):
    """Whether the patched file waits in `staging`; if not, it is to be exported, and `record` says why."""
    try:
        patch.stage(staging, args.output, record.done)
    except PatchError as refusal:
        if args.write:
            raise FileError(f"it cannot be patched, {refusal}: use --write export") from None
        record.write, record.not_patched = "export", str(refusal)
    return not record.not_patched


def _keep(args, record):
    """Write the report, if one is wanted and nothing is in its way but a report of the same run."""
    if not args.json or str(args.json) == "-":
        return
    if not record.is_kept and args.json.exists() and not (args.overwrite and args.json.is_file()):
        return
    text = json.dumps(record.to_dict(), indent=2) + "\n"
    try:
        with writing.Staging(overwrite=True) as staging:
            staging.write_text(args.json, text)
            staging.put_in_place()
    except (OSError, FileError) as error:
        raise FileError(f"cannot write {args.json}: {error}") from error
    record.is_kept = True


def _show(args, record):
    if str(args.json) == "-":
        console.show(json.dumps(record.to_dict(), indent=2))
    else:
        is_written = record.exit_code in (OK, PARTIAL)
        told = record.outcomes if is_written or not record.done else []
        others = record.sentences() if is_written else record.warning_sentences()
        console.show_outcomes(told, others, verbose=args.verbose, quiet=args.quiet)
    if record.error:
        console.show(f"qh-unwrap: error: {record.error}", error=True)


@contextmanager
def _at_file(verb, path, record):
    told = []
    try:
        with streams.quiet(told):
            yield
    except (RuntimeError, OSError, FileError) as error:
        stopping.check()
        is_full = verb == "write" and writing.is_full(path)  # which Blender does not always say
        raise FileError(f"cannot {verb} {path}: {_reason(error)}{' (the disk is full)' if is_full else ''}") from error
    record.warn(told)


def _reason(error):
    """One line of what Blender says, which may be a traceback."""
    lines = [line for line in str(error).splitlines() if line.strip() and not line.startswith("Location:")]
    return lines[-1].removeprefix("Error: ") if lines else type(error).__name__


def _made_from(args, kind):
    names = [field.name for field in dataclasses.fields(kind)]
    return kind(**{name: getattr(args, name) for name in names if hasattr(args, name)})
