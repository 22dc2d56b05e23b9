# SPDX-License-Identifier: GPL-3.0-or-later
"""
What an artist sees, step by step in Blender's window: menus, redo panel, sidebars, reports.

Not a pytest file: a harness that runs inside Blender calls `steps(gui)` and lets Blender redraw for as many seconds as
each step yields.  `gui` opens workspaces and sidebars, moves the pointer, presses keys and takes screenshots.
"""

import bpy  # isort: skip  (the wheel knows bmesh only after this)
import bmesh
import numpy as np
from everything_in_file import differences, everything


def steps(gui):
    gui.workspace("UV Editing")
    yield 1
    put_alone(gui, bpy.ops.mesh.primitive_monkey_add, _is_seam)
    show_checker(gui)
    bpy.ops.ed.undo_push(message="Checker")
    yield 2
    yield from _menus(gui)
    yield from _sidebars(gui)
    yield from _reports(gui)
    yield from _troubles(gui)
    yield from _seams(gui)
    yield from _check(gui)
    yield from _heatmap(gui)
    yield from _compare(gui)
    yield from _long_work(gui)


def _menus(gui):
    before = uvs()
    yield from _open_menu(gui, 'VIEW_3D')
    gui.shot("1_menu_view_3d.png")
    gui.key("q")
    yield 2
    yield from _end(gui)
    assert not np.array_equal(uvs(), before), "the menu entry did nothing"
    gui.shot("2_report.png")
    yield from _redo(gui, "3_redo_panel.png")

    with gui.override('IMAGE_EDITOR'):
        bpy.ops.image.view_all(fit_view=True)
    yield 1
    yield from _open_menu(gui, 'IMAGE_EDITOR')
    gui.shot("4_menu_image_editor.png")
    gui.key("Escape")
    yield 1
    overlay = gui.area('VIEW_3D').spaces.active.overlay
    overlay.show_overlays = False
    yield 1
    gui.shot("5_layout_with_checker.png")
    overlay.show_overlays = True


def _redo(gui, shot):
    """Open the redo panel, turn the boundary to Circle and back with the wheel, and close it."""
    before = uvs()
    gui.click(*gui.xy(gui.region(gui.area('VIEW_3D'), "HUD"), 0.3, 0.5))
    yield 3
    gui.shot(shot)
    x, y = gui.xy(gui.region(gui.area('VIEW_3D'), "HUD"), 0.7, 0)
    for wheel, changes in ((5, True), (4, False)):
        gui.xdo("mousemove", x - 2, y + 42, "mousemove", x, y + 42, "sleep", 0.2)
        gui.xdo("keydown", "ctrl", "click", wheel, "keyup", "ctrl")
        yield 3
        for _ in range(60):  # on a busy machine it takes longer
            if np.allclose(uvs(), before, atol=1e-4) != changes:
                break
            yield 0.5
        assert np.allclose(uvs(), before, atol=1e-4) != changes, "the redo panel did nothing, or did not come back"
        if changes:
            gui.shot(shot.replace(".", "_changed."))
    gui.click(*gui.xy(gui.region(gui.area('VIEW_3D'), "HUD"), 0.3, 0.04))
    yield 1


def _sidebars(gui):
    """Their buttons use the settings of the scene."""
    for number, editor in enumerate(('VIEW_3D', 'IMAGE_EDITOR'), start=6):
        gui.sidebar(editor)
        yield 1
        gui.sidebar(editor, "QH Unwrap")
        yield 1
        gui.shot(f"{number}_sidebar_{editor.lower()}.png")
    for editor in ('VIEW_3D', 'IMAGE_EDITOR'):
        for section in ("Advanced", "Mesh"):
            gui.click(*_button(gui, editor, _BUTTONS[section]))
            yield 1
    gui.shot("8_sidebars_with_all_sections.png")

    bpy.context.scene.qh_unwrap.placement = 'PACK'
    before = uvs()
    gui.click(*_button(gui, 'IMAGE_EDITOR', _BUTTONS["Unwrap"]))
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("9_no_uvs_selected.png")
    gui.key("Escape")
    with gui.override('IMAGE_EDITOR'):
        bpy.ops.uv.select_all(action='SELECT')
    gui.move('IMAGE_EDITOR', fy=0.95)  # away from the message
    yield 1
    gui.click(*_button(gui, 'IMAGE_EDITOR', _BUTTONS["Unwrap"]))
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("10_packed_by_the_button.png")
    assert not np.array_equal(uvs(), before), "the button did nothing"
    assert uvs().min() >= 0 and uvs().max() <= 1, "not packed: ESC, pressed before, stops Blender's packer"
    gui.key("ctrl+z")
    yield 2
    assert np.array_equal(uvs(), before), "undo did not restore"
    bpy.context.scene.qh_unwrap.placement = 'ORIGINAL'


def _reports(gui):
    """What goes wrong is said."""
    put_alone(gui, bpy.ops.mesh.primitive_cube_add, lambda one, other: False)
    yield 1
    gui.click(*_button(gui, 'VIEW_3D', _BUTTONS["Unwrap"]))
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("11_error.png")
    gui.move('VIEW_3D', fx=0.2, fy=0.9)
    yield 2
    gui.area('IMAGE_EDITOR').type = 'INFO'
    yield 1
    gui.shot("12_reports.png")


def _troubles(gui):
    """A mesh with many kinds of trouble: the panel leads to each."""
    gui.area('INFO').type = 'IMAGE_EDITOR'
    put_alone(gui, _troubled, lambda one, other: False)
    gui.sidebar('VIEW_3D', "QH Unwrap")
    yield 1
    for below_top in (
        _ADVANCED_BELOW_MESH,
        _BUTTONS["Mesh"],
        _BUTTONS["Layout"],
    ):  # they leave room for the last result
        gui.click(*_button(gui, 'VIEW_3D', below_top))
        yield 1
    gui.click(*_button(gui, 'VIEW_3D', _BUTTONS["Unwrap"]))
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("17_troubles.png")
    gui.move('VIEW_3D', fx=0.2, fy=0.9)
    with gui.override('VIEW_3D'):
        bpy.ops.uv.qh_unwrap_select(object="Troubles", island=1)
        bpy.ops.view3d.view_selected()
    yield 2
    gui.shot("18_island_selected.png")


def _seams(gui):
    """Seams are marked, and the islands that they make are laid out anew."""
    gui.area('IMAGE_EDITOR').ui_type = 'UV'
    put_alone(gui, bpy.ops.mesh.primitive_monkey_add, lambda one, other: False)
    gui.click(*_button(gui, 'VIEW_3D', _BUTTONS["Unwrap"]))
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("19_without_seams.png")
    gui.move('VIEW_3D', fx=0.2, fy=0.5)
    yield 1
    gui.key("ctrl+e")
    yield 1
    gui.shot("20_edge_menu.png")
    gui.key("Escape")
    yield 1
    with gui.override('VIEW_3D'):
        bpy.ops.uv.qh_seams('INVOKE_DEFAULT')
    yield from _end(gui)
    yield 1
    with gui.override('IMAGE_EDITOR'):
        bpy.ops.image.view_all(fit_view=True)
    yield 1
    gui.shot("21_seams.png")


def _check(gui):
    """A check says what is wrong with UVs, changes nothing, and leads to the faces in both editors."""
    put_alone(gui, bpy.ops.mesh.primitive_monkey_add, _is_seam)
    with gui.override('VIEW_3D'):
        bpy.ops.uv.smart_project(angle_limit=1.2)
    yield 1
    before = uvs()
    gui.click(*_button(gui, 'VIEW_3D', _BUTTONS["Check"]))
    yield 2
    yield from _end(gui)
    gui.shot("22_checked.png")
    assert np.array_equal(uvs(), before), "the check changed something"
    for sync in (True, False):
        bpy.context.scene.tool_settings.use_uv_select_sync = sync
        with gui.override('VIEW_3D'):
            bpy.ops.uv.qh_check_select(kind='WORST')
        yield 1
        gui.shot(f"23_worst_faces_sync_{sync}.png".lower())
        assert 0 < bpy.context.object.data.count_selected_items()[2] < 10, "not the worst faces are selected"


def _heatmap(gui):
    """It shows each quantity, follows the UVs, and leaves everything as it was."""
    put_alone(gui, bpy.ops.mesh.primitive_monkey_add, _is_seam)
    with gui.override('VIEW_3D'):
        bpy.ops.uv.unwrap(method='CONFORMAL', margin=0.01)
    yield 1
    everything()  # reading some of it makes it
    before = everything()
    for _ in ("on", "off", "on"):
        with gui.override('VIEW_3D'):
            bpy.ops.uv.qh_heatmap()
        yield 1
        assert not differences(before, everything()), differences(before, everything())[:9]
    for quantity in ('STRETCH', 'ANGLE', 'AREA', 'DENSITY'):
        bpy.context.scene.qh_heatmap.quantity = quantity
        yield 1
        gui.shot(f"24_heatmap_{quantity.lower()}.png")
    bpy.context.scene.qh_heatmap.property_unset("quantity")
    with gui.override('VIEW_3D'):
        bpy.ops.uv.qh_unwrap()
    yield 4
    gui.shot("25_heatmap_followed.png")
    with gui.override('VIEW_3D'):
        bpy.ops.object.mode_set(mode='OBJECT')
    yield 1
    gui.shot("26_heatmap_object_mode.png")
    with gui.override('VIEW_3D'):
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.uv.qh_heatmap()
    yield 1
    gui.shot("27_heatmap_off.png")


def _compare(gui):
    """A table of what methods make of copies, and a plot in the Image Editor that there is."""
    before = uvs()
    gui.move('VIEW_3D', fx=0.4, fy=0.5)
    with gui.override('VIEW_3D'):
        bpy.ops.uv.qh_compare('INVOKE_DEFAULT')
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("28_table.png")
    gui.key("Escape")
    yield 1
    editor = gui.area('IMAGE_EDITOR')
    editor.ui_type = 'IMAGE_EDITOR'
    yield 1
    with gui.override('VIEW_3D'):
        bpy.ops.uv.qh_plot('INVOKE_DEFAULT')
    yield 2
    yield from _end(gui)
    yield 1
    gui.shot("29_plot.png")
    assert editor.spaces.active.image == bpy.data.images["QH Unwrap Distortion"]
    editor.ui_type = 'UV'
    yield 1
    assert np.array_equal(uvs(), before), "the comparison changed something"


def _troubled(calc_uvs):
    """Adds a mesh of a closed cube, a torus with a hole, sheets with faces inside out and without area, two faces that
    Blender cuts along one diagonal, and a Möbius band.
    """
    bm = bmesh.new()

    def apart(number, geometry):
        vertices = {vertex for each in geometry for vertex in getattr(each, "verts", [each])}
        bmesh.ops.translate(bm, verts=list(vertices), vec=(3 * number, 0, 0))

    def sheet(number):
        made = bmesh.ops.create_grid(bm, x_segments=8, y_segments=8, size=1)["verts"]
        for vertex in made:
            vertex.co.z = 0.3 * np.sin(3 * vertex.co.x)
        faces = list({face for vertex in made for face in vertex.link_faces})
        apart(number, made)
        return faces

    apart(0, bmesh.ops.create_cube(bm, size=1.5)["verts"])
    rings, sides = 24, 12
    torus = [
        bm.verts.new(((1 + 0.3 * np.cos(b)) * np.cos(a), (1 + 0.3 * np.cos(b)) * np.sin(a), 0.3 * np.sin(b)))
        for a in 2 * np.pi * np.arange(rings) / rings
        for b in 2 * np.pi * np.arange(sides) / sides
    ]
    for k in range(1, rings * sides):  # but for the first
        (i, j), on = divmod(k, sides), (k // sides + 1) % rings * sides
        up = (j + 1) % sides
        bm.faces.new([torus[i * sides + j], torus[on + j], torus[on + up], torus[i * sides + up]])
    apart(1, torus)
    for face in sheet(2)[:3]:
        face.normal_flip()
    for vertex in sheet(3)[20].verts:
        vertex.co = (9, 0, 0)
    corners = [bm.verts.new(co) for co in ((0, 0, 0), (1, -0.1, 1), (2, 0, 0), (1, 1, 0), (1, 0, -1))]
    bm.faces.new([corners[k] for k in (0, 1, 2, 3)])
    bm.faces.new([corners[k] for k in (2, 1, 0, 4)])
    apart(4, corners)
    around, across = 40, 3
    band = [
        bm.verts.new(((1 + w * np.cos(a / 2)) * np.cos(a), (1 + w * np.cos(a / 2)) * np.sin(a), w * np.sin(a / 2)))
        for a in 2 * np.pi * np.arange(around) / around
        for w in 0.4 * (np.arange(across + 1) / across - 0.5)
    ]

    def at(i, j):
        return band[i * (across + 1) + j] if i < around else band[across - j]

    for i in range(around):
        for j in range(across):
            bm.faces.new([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
    apart(5.5, band)
    mesh = bpy.data.meshes.new("Troubles")
    bm.to_mesh(mesh)
    obj = bpy.data.objects.new("Troubles", mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)


def _long_work(gui):
    """It shows how far it is; ESC, an error and another file end it, and leave nothing behind."""
    for area in (area for area in gui.window.screen.areas if area.type == 'VIEW_3D'):
        area.spaces.active.show_region_ui = False
    put_alone(gui, wavy_sheet(180), lambda one, other: False)
    yield 2
    yield from _begin(gui)
    yield from _end(gui)
    yield 1
    assert uvs().any(), "not unwrapped in the end"
    gui.shot("13_finished.png")
    yield from _redo(gui, "14_redo_panel_afterwards.png")
    gui.key("ctrl+z")
    yield 2
    assert not uvs().any(), "it takes more than one step to undo"

    put_alone(gui, wavy_sheet(388), lambda one, other: False)
    yield 5
    yield from _begin(gui)
    for _ in range(4):  # until it is drawn without the menu
        yield 0.5
    gui.shot("15_running.png")
    gui.key("g")
    yield 0.5
    assert [operator.bl_idname for operator in gui.window.modal_operators] == ["UV_OT_qh_unwrap"], "a key got through"
    gui.key("Escape")
    yield from _end(gui)
    yield 2
    gui.shot("16_cancelled.png")
    assert not uvs().any() and bpy.context.mode == 'EDIT_MESH', "ESC changed something"


def _begin(gui):
    """Unwrap from the menu, until it is under way."""
    yield from _open_menu(gui, 'VIEW_3D')
    gui.key("q")
    for _ in range(100):
        yield 0.1
        if is_running(gui):
            return
    raise AssertionError("it did not go on beside the window")


def _end(gui):
    for _ in range(600):
        yield 0.1
        if not is_running(gui):
            return
    raise AssertionError("it did not end")


def is_running(gui):
    running = {operator.bl_idname for operator in gui.window.modal_operators}
    return bool(running & {"UV_OT_qh_unwrap", "UV_OT_qh_seams", "UV_OT_qh_check", "UV_OT_qh_compare", "UV_OT_qh_plot"})


def wavy_sheet(size):
    """Adds a wavy sheet of size x size quads."""

    def add(calc_uvs):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=size, y_subdivisions=size, calc_uvs=calc_uvs)
        mesh = bpy.context.object.data
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", points.ravel())
        points[:, 2] = 0.4 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])
        mesh.vertices.foreach_set("co", points.ravel())

    return add


_BUTTONS = {
    "Unwrap": 43,
    "Check": 69,
    "Layout": 187,
    "Mesh": 341,
    "Advanced": 366,
}  # pixels below the top of the sidebar
_ADVANCED_BELOW_MESH = 546  # the same, where the section Mesh is open


def put_alone(gui, add, is_seam):
    """Alone in the scene, in Edit Mode, all selected."""
    with gui.override('VIEW_3D'):
        if bpy.context.mode != 'OBJECT':
            bpy.ops.object.mode_set(mode='OBJECT')
        bpy.ops.object.select_all(action='SELECT')
        bpy.ops.object.delete()
        add(calc_uvs=False)
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
        mesh = bpy.context.object.data
        bm = bmesh.from_edit_mesh(mesh)
        for edge in bm.edges:
            edge.seam = is_seam(*(vertex.co for vertex in edge.verts))
        bmesh.update_edit_mesh(mesh)
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
        bpy.ops.ed.undo_push(message="Scene")  # where undo, and with it the redo panel, comes back to


def _is_seam(one, other):
    """The middle of the back of the head."""
    return abs(one.x) + abs(other.x) < 1e-4 and one.y + other.y > -0.5


def show_checker(gui):
    image = bpy.data.images.new("Checker", 1024, 1024)
    image.generated_type = 'COLOR_GRID'
    material = bpy.data.materials.new("Checker")
    material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    material.node_tree.nodes.active = texture
    bpy.context.object.data.materials.append(material)
    gui.area('VIEW_3D').spaces.active.shading.color_type = 'TEXTURE'
    gui.area('IMAGE_EDITOR').spaces.active.image = image
    gui.area('IMAGE_EDITOR').spaces.active.show_region_toolbar = False


def _open_menu(gui, editor):
    """U, and the Unwrap submenu on top of it."""
    gui.move(editor, fx=0.3, fy=0.3)
    yield 0.5
    gui.key("u")
    yield 1
    if editor == 'VIEW_3D':
        gui.key("Right")
        yield 1


def _button(gui, editor, below_top):
    x, y = gui.xy(gui.region(gui.area(editor), "UI"), 0.4, 0)
    return x, y + below_top


def uvs():
    bm = bmesh.from_edit_mesh(bpy.context.object.data)
    layer = bm.loops.layers.uv.active
    return np.array([loop[layer].uv[:] for face in bm.faces for loop in face.loops]) if layer else np.empty((0, 2))
