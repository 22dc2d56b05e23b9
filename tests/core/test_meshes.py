# SPDX-License-Identifier: GPL-3.0-or-later
"""Guarantees on scanned and modelled surfaces, from the folder that QH_MESHES names."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from qh_unwrap.core import Settings, Surface, errors, unwrap

from ..benchmarks.common import load_mesh
from .shapes import furthest_apart

FOLDER = Path(os.environ.get("QH_MESHES", "."))
pytestmark = pytest.mark.skipif("QH_MESHES" not in os.environ, reason="QH_MESHES names no folder of meshes")

DISKS = [
    "camel_b.obj",
    "camelhead.off",
    "cowhead.obj",
    "demosthenes.obj",
    "face_bff.obj",
    "face_igl.obj",
    "hand_yaron_slivers.obj",
    "hemisphere_pmp.off",
    "lilium.obj",
    "mannequin-devil.off",
    "maze.obj",
    "venus.obj",
]


def energy_at_first(mesh, settings=Settings()):  # noqa: B008 (it is never changed)
    return unwrap(*mesh, replace(settings, iterations=0, refine=0)).report.after.symmetric_dirichlet


@pytest.mark.parametrize("weights", ["COTANGENT", "MEAN_VALUE"])
@pytest.mark.parametrize("name", DISKS)
def test_circle_maps_have_no_flips(name, weights):
    mesh, settings = load_mesh(FOLDER / "disk" / name), Settings(boundary="CIRCLE", weights=weights)
    result = unwrap(*mesh, settings)
    assert result.report.after.flips == result.report.after.collapsed == 0
    assert result.report.after.symmetric_dirichlet < energy_at_first(mesh, settings) or weights != "COTANGENT"


@pytest.mark.parametrize("initial", ["HARMONIC", "UNIFORM", "MEAN_VALUE"])
def test_the_papers_map_of_the_mannequin(initial):
    settings = Settings(
        boundary="CIRCLE", initial=initial, balance=0.5, iterations=10, tolerance=0, repair=False, refine=0
    )
    after = unwrap(*load_mesh(FOLDER / "disk" / "mannequin-devil.off"), settings).report.after
    measured = (after.l2_stretch, after.angle, after.area, after.symmetric_dirichlet)
    np.testing.assert_allclose(measured, (2.158, 1.72, 1.48, 2.96), rtol=0.005)
    assert after.flips <= 4


def test_without_repair_the_mannequin_flips():
    settings = Settings(boundary="CIRCLE", iterations=10, tolerance=0, repair=False, refine=0)
    assert unwrap(*load_mesh(FOLDER / "disk" / "mannequin-devil.off"), settings).report.after.flips > 0


@pytest.mark.parametrize("name", ["lion_o_f10000.obj", "planck_s1.obj", "santa_i_f10000.obj"])
def test_what_opens_little_is_mirrored_however_far_it_goes(name):
    vertices, triangles = load_mesh(FOLDER / "charts" / name)
    one, other = unwrap(vertices, triangles), unwrap(vertices * [-1, 1, 1], triangles[:, ::-1])
    assert furthest_apart(one.uv, other.uv * [-1, 1]) < 1e-6


@pytest.mark.parametrize(
    "name, error",
    [
        ("bad_inverted_triangles.obj", errors.WindingError),
        ("bad_nonmanifold_toy.obj", errors.DuplicateError),
        ("bad_nonmanifold_vierbein.obj", errors.NonManifoldEdgeError),
        ("cat_closed_slivers.obj", errors.ClosedError),
        ("punctured_torus_g1.obj", errors.GenusError),
    ],
)
def test_broken_surfaces_are_named(name, error):
    with pytest.raises(error):
        Surface(*load_mesh(FOLDER / "broken" / name))


def test_zero_area_triangles_of_a_scan_are_survived():
    result = unwrap(*load_mesh(FOLDER / "broken" / "bad_zero_area_48.obj"))
    assert any("zero area" in warning for warning in result.report.warnings)
    assert np.isfinite(result.uv).all() and result.report.after.flips == 0


@pytest.mark.parametrize("fill_holes", [True, False])
@pytest.mark.parametrize("name", ["beetle_11loops.off", "capsule_quads_3loops.off", "halftunnel_quads_3loops.off"])
def test_surfaces_with_holes(name, fill_holes):
    mesh, settings = load_mesh(FOLDER / "artist" / name), Settings(boundary="CIRCLE", fill_holes=fill_holes)
    result = unwrap(*mesh, settings)
    assert result.report.after.flips == result.report.after.collapsed == 0
    assert result.report.after.symmetric_dirichlet <= energy_at_first(mesh, settings) + 1e-9


@pytest.mark.parametrize("name", DISKS)
def test_free_boundaries_are_certified(name):
    mesh = load_mesh(FOLDER / "disk" / name)
    result = unwrap(*mesh)
    assert result.report.injective and result.report.after.flips == 0
    assert result.report.after.symmetric_dirichlet <= energy_at_first(mesh) + 1e-9


@pytest.mark.parametrize(
    "name, most", [("camel_b.obj", 1.06), ("lilium.obj", 1.01), ("maze.obj", 1.01), ("hemisphere_pmp.off", 1.045)]
)
def test_free_boundaries_reach_the_least_distortion(name, most):
    result = unwrap(*load_mesh(FOLDER / "disk" / name), Settings(iterations=30, refine=0))
    assert result.report.injective and result.report.after.symmetric_dirichlet < most


@pytest.mark.parametrize(
    "name, most",
    [("beetle_11loops.off", 1.03), ("capsule_quads_3loops.off", 1.24), ("halftunnel_quads_3loops.off", 1.43)],
)
def test_free_boundaries_keep_holes_open(name, most):
    result = unwrap(*load_mesh(FOLDER / "artist" / name), Settings(iterations=12, refine=0))
    assert result.report.injective and result.report.after.symmetric_dirichlet < most
