# SPDX-License-Identifier: GPL-3.0-or-later
"""Many assets: planned, unwrapped by worker processes here or on a cluster, remembered in a ledger, and reported."""
