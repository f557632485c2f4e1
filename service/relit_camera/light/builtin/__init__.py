"""Six environments of our own, computed: nothing to download, no licence to mind.

Each module paints one with `paint() -> radiance` in viewer axes (see `canvas`); `catalogue` names them and gives
panoramas.
"""
