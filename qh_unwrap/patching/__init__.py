# SPDX-License-Identifier: GPL-3.0-or-later
"""New UVs in a mesh file that is otherwise left as it is.  Needs no Blender."""
