# SPDX-License-Identifier: GPL-3.0-or-later
"""QH Unwrap in Blender: the only place that imports bpy or bmesh."""
