# SPDX-License-Identifier: GPL-3.0-or-later
"""A run on one file, from the flags to the files in place: the same for the command line, Python and a batch."""

import dataclasses
import json
import traceback
from contextlib import contextmanager

from . import asked
from .addon import stopping, streams, suffixes, writing
from .addon.document import FAILED, OK, PARTIAL, USAGE, Record
from .addon.failures import NO_BLENDER, FileError, UsageError
from .addon.last_run import last_run
from .addon.options import MeshOptions, SeamOptions
from .core import Settings, UnwrapError
from .core.relax_settings import RelaxSettings
from .core.seam_settings import SeamSettings
from .core.stepping import finished, mapped
from .patching.original import PatchError


def carried_out(args, progress=None):
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
    finish(args, record)
    return record


def finish(args, record):
    """End the record, and write the report, if one is wanted."""
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
    settings, options, seam_settings, seam_options, relax_settings = settings_of(args)
    values = dataclasses.asdict(relax_settings if args.relax else settings) | dataclasses.asdict(options)
    if options.cut != 'NEVER' and not args.relax:
        values |= dataclasses.asdict(seam_settings) | dict(vertex_group=seam_options.vertex_group)
    record.settings = {name: getattr(value, "item", lambda value=value: value)() for name, value in values.items()}
    with stopping.undisturbed(), streams.quiet():
        try:
            import bpy
        except ImportError:
            raise UsageError(NO_BLENDER) from None
        from .addon import (
            choosing,
            files,
            inspecting,
            jobs,
            measuring,
            patches,
            plotting,
            preview,
            selection,
            uv_selection,
        )
    record.blender = bpy.app.version_string

    asked.check_formats(args, preview, plotting)
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
    problem = options.use_weights and not args.check and selection.without_group(objects, options.weight_group)
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
            if args.relax:
                chosen = [(target.obj, uv_selection.of_faces(target.obj, target.faces)) for target in targets]
                steps = jobs.relax(chosen, relax_settings, options, bpy.context)
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
        # Regions that are relaxed have other numbers than islands.
        preview.render(targets, [] if args.relax else record.outcomes, options, path)

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


def settings_of(args):
    """The `Settings`, `MeshOptions`, `SeamSettings`, `SeamOptions` and `RelaxSettings` of the flags; raises
    `UsageError`."""
    given = vars(args) | args.cut
    if args.weld is None:
        given["weld"] = str(args.input).lower().endswith(suffixes.SPLIT)
    try:
        kinds = Settings, MeshOptions, SeamSettings, SeamOptions, RelaxSettings
        made = [_made_from(given, kind) for kind in kinds]
        made[0].check_together()
    except UnwrapError as error:
        raise UsageError(error) from None
    return made


def _made_from(given, kind):
    names = [field.name for field in dataclasses.fields(kind)]
    return kind(**{name: given[name] for name in names if name in given})
